"""Labels of either image of a frame on the other: points, boxes, polygons and masks.

>>> moved = Shapes(rig, depth, "source").polygon(corners)

A box or a polygon is carried as one thing at one depth: that of the middle of what is in it, for
its corners often lie on what is behind it. What cannot be told is said: `Moved.notes`.
"""

from .coco import transfer_coco
from .shapes import Moved, Shapes
from .yolo import transfer_yolo

__all__ = ["Moved", "Shapes", "transfer_coco", "transfer_yolo"]
