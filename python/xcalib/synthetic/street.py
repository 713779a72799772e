"""A street: road, houses, trees, furniture, people, cars and sky."""

from __future__ import annotations

from .buildings import Buildings
from .furniture import Furniture
from .ground import Ground
from .scene import Scene
from .sky import Sky
from .traffic import Traffic


def build(seed: int, length: float, speed: float) -> Scene:
    """A street that can be driven for `length` metres from z = 0, cars moving at about `speed`."""
    return StreetPainter(seed, length, speed).scene()


class StreetPainter(Ground, Buildings, Furniture, Traffic, Sky):
    """Paints the whole street."""

    def scene(self) -> Scene:
        self.place_ground()
        self.place_buildings()
        self.place_furniture()
        self.place_traffic()
        return Scene.from_faces(self.faces, self.sky(), self.lamps)
