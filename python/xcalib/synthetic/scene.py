"""The street as a renderer takes it: textured parallelograms, described without any camera.

World axes are those of a camera looking down the street: x right, y down, z forward, in metres, the
road surface at y = 0. Every surface is a `Face`, X(u, v) = origin + u * right + v * down with u and
v in [0, 1], carrying a `Texture` that holds an independent picture for each modality.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .texture import Array, Texture

BEHIND = 32.0  # [m] the street starts this far behind the first camera
AHEAD = 200.0  # [m] and reaches this far beyond the last


@dataclass(frozen=True)
class Face:
    """A textured parallelogram. Seen from its front, `right` is right and `down` is down."""

    origin: Array
    right: Array
    down: Array
    texture: Texture
    gain: float = 1.0  # daylight on the surface: which way it faces the sun
    one_sided: bool = False  # part of a closed body, so its back is never seen
    velocity: float = 0.0  # [m per frame] along z
    reach: float = AHEAD  # [m] drawn up to this distance


@dataclass(frozen=True)
class Scene:
    """All faces of a street as arrays over N faces, ready for a rasteriser.

    origin, right, down: (N, 3) [m]; velocity: (N,) [m per frame] along z; gain: (N,) daylight;
    one_sided: (N,) bool; reach: (N,) [m]; textures: N; lamps: (L, 3) [m], street lamps. The last
    `num_sky` faces form a box at infinity: their origins are directions, not points.
    """

    origin: Array
    right: Array
    down: Array
    velocity: Array
    gain: Array
    one_sided: Array
    reach: Array
    textures: list[Texture]
    lamps: Array
    num_sky: int

    @staticmethod
    def from_faces(faces: list[Face], sky: list[Face], lamps: list[tuple[float, ...]]) -> Scene:
        every = faces + sky
        return Scene(
            origin=np.array([face.origin for face in every], np.float64),
            right=np.array([face.right for face in every], np.float64),
            down=np.array([face.down for face in every], np.float64),
            velocity=np.array([face.velocity for face in every], np.float64),
            gain=np.array([face.gain for face in every], np.float64),
            one_sided=np.array([face.one_sided for face in every], bool),
            reach=np.array([face.reach for face in every], np.float64),
            textures=[face.texture for face in every],
            lamps=np.array(lamps, np.float64).reshape(-1, 3),
            num_sky=len(sky),
        )
