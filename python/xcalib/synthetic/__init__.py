"""Synthetic drives: a visible-thermal rig in a textured street, with exact depth.

For tests, benchmarks and demonstrations: the one place where the true rig, the true depth and the
true occlusions are known. Both cameras see the same geometry; every surface has an unrelated albedo
and temperature, so that structure is shared and contrast is not.

>>> rig = random_rig(seed=1)
>>> frames = list(render(rig, num_frames=8, seed=1))
>>> write("drive", frames, rig)
"""

from .drive import Frame, Street, render
from .files import write
from .rigs import demo_rig, random_rig

__all__ = ["Frame", "Street", "demo_rig", "random_rig", "render", "write"]
