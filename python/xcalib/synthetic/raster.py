"""Which face of a street a camera sees at every sample, at what depth, and in what colour.

How a view is made. A face X(u, v) = G (u, v, 1)^T, G = [right down origin] in camera axes, is seen
at pixel x~ where z K^-1 x~ = G (u, v, 1)^T, so A x~ = (u, v, 1) / z with A = (K G)^-1: inverse
depth and the edges of the face are affine in the pixel, whether or not the face crosses the camera
plane. Visibility takes the greatest 1/z at every sample; then each face paints the samples it won,
from its texture, filtered to the distance. Samples lie on a regular grid symmetric about every
(integer) pixel centre; depth is evaluated at the centres themselves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import DTypeLike

from ..reprojection import inside_image
from .scene import BEHIND, Scene
from .texture import Array, Texture

_NEAR = 0.05  # [m] nothing is nearer than this to a camera
_ROW = 4096  # points in a row of the arrays given to OpenCV: it refuses sides of 2^15 and more
_BAND = 1.6  # a face is filtered for one distance at a time, within this factor


@dataclass(frozen=True)
class View:
    """A camera in the street: x_camera = R x_world + t; for directions on the sky, sky @ x_world.

    The depth of a sky direction d is sky_depth * (d_z in this camera) / (sky_z . d).
    """

    width: int
    height: int
    K: Array
    R: Array
    t: Array
    sky: Array
    sky_z: Array
    sky_depth: float


class Raster:
    """Which face every sample of a view sees, and at what inverse depth.

    Sample i of `samples` per pixel lies at pixel coordinate (i + 1/2) / samples - 1/2.
    """

    def __init__(self, scene: Scene, view: View, samples: int, index: int) -> None:
        self.scene, self.view, self.time = scene, view, float(index)
        self.width, self.height = view.width * samples, view.height * samples
        half = (samples - 1) / 2
        self.K = np.array([[samples, 0, half], [0, samples, half], [0, 0, 1.0]]) @ view.K
        self._place_faces()

    def _place_faces(self) -> None:
        """A = (K G)^-1 of all faces, and the samples and depths that each can cover at most."""
        scene, view = self.scene, self.view
        origin = scene.origin.copy()
        origin[:, 2] += scene.velocity * self.time
        solid = np.arange(len(origin)) < len(origin) - scene.num_sky
        nearest = origin[:, 2] + np.minimum(0, scene.right[:, 2] + scene.down[:, 2])
        ahead = nearest - float((-view.R.T @ view.t)[2])
        # From here on a face is known by its place among those in reach; `ids` leads back.
        self.ids = ids = np.flatnonzero(~solid | ((ahead < scene.reach) & (ahead > -2 * BEHIND)))
        solid = solid[ids]
        self.num_solid = int(solid.sum())
        self.textures = [scene.textures[face] for face in ids]
        G = np.stack([scene.right[ids], scene.down[ids], origin[ids]], axis=-1)
        size = np.linalg.norm(np.cross(G[:, :, 0], G[:, :, 1]), axis=1)
        G = np.where(solid[:, None, None], view.R, view.sky) @ G
        G[solid, :, 2] += view.t
        determinant = np.linalg.det(G)
        # Seen exactly edge-on, or from behind where that is the inside of a body: nothing to draw.
        drawn = (np.abs(determinant) > 1e-7 * size) & ((determinant > 0) | ~scene.one_sided[ids])
        G[~drawn] = np.eye(3)
        self.A = np.linalg.inv(self.K @ G)
        self.bounds, self.depths = self._extents(G)
        drawn &= (self.bounds[:, 0] < self.bounds[:, 2]) & (self.bounds[:, 1] < self.bounds[:, 3])
        # Near ones first, so that most of what is hidden can be passed over; the sky last of all.
        order = np.argsort(np.where(solid, self.depths[:, 0], np.inf), kind="stable")
        self.drawn = order[drawn[order]].tolist()
        # (p, q, w) = A x~ = (u, v, 1) / z: inside means p, q, w - p and w - q >= 0, each a
        # half-plane, which starts or ends every row of samples at x = -(b y + c) / a.
        p, q, w = np.moveaxis(self.A, 1, 0)
        edges = np.stack([p, q, w - p, w - q], axis=1)
        slope = np.where(edges[:, :, 0] == 0, 1e-30, edges[:, :, 0])
        self.row_cuts = -edges[:, :, 1:] / slope[:, :, None]
        self.starts_row = slope > 0

    def _extents(self, G: Array) -> tuple[Array, Array]:
        """Bounds (N, 4) as x0 y0 x1 y1, ends excluded, and depths (N, 2), of the parts before
        _NEAR."""
        right, down, origin = G[:, :, 0], G[:, :, 1], G[:, :, 2]
        corners = np.stack([origin, origin + right, origin + right + down, origin + down], axis=1)
        following = np.roll(corners, -1, axis=1)
        z, z_next = corners[..., 2], following[..., 2]
        step = np.where(z_next == z, 1.0, z_next - z)
        share = np.clip((_NEAR - z) / step, 0, 1)[..., None]
        cuts = corners + share * (following - corners)
        crosses = (z < _NEAR) != (z_next < _NEAR)
        points = np.concatenate([corners, cuts], axis=1)
        valid = np.concatenate([z >= _NEAR, crosses], axis=1)
        depth = np.where(valid, np.maximum(points[..., 2], _NEAR), np.nan)
        pixels = points @ self.K.T
        xy = pixels[..., :2] / depth[..., None]
        low = np.where(valid[..., None], xy, np.inf).min(axis=1)
        high = np.where(valid[..., None], xy, -np.inf).max(axis=1)
        limit = np.array([self.width, self.height], np.float64)
        low = np.clip(np.ceil(np.where(np.isfinite(low), low, limit) - 1e-3), 0, limit)
        high = np.clip(np.floor(np.where(np.isfinite(high), high, -1) + 1e-3) + 1, 0, limit)
        depths = np.stack(
            [np.where(valid, depth, np.inf).min(axis=1), np.where(valid, depth, 0).max(axis=1)],
            axis=1,
        )
        return np.concatenate([low, high], axis=1).astype(np.int64), depths

    def find_visible(self, dtype: DTypeLike) -> None:
        """Fills `faces` (face per sample) and `inverse_depth` [1/m]; the sky fills the rest."""
        self.inverse_depth = np.zeros((self.height, self.width), dtype)
        self.faces = np.full((self.height, self.width), -1, np.int16)
        xs, ys = np.arange(self.width, dtype=np.float64), np.arange(self.height, dtype=np.float64)
        columns = xs.astype(np.float32)
        for face in self.drawn:
            x0, y0, x1, y1 = self.bounds[face].tolist()
            window = np.s_[y0:y1, x0:x1]
            if (
                face < self.num_solid
                and self.inverse_depth[window].min() * self.depths[face, 0] > 1.001
            ):
                continue  # all of the window is nearer already
            first, last = self._row_ends(face, ys[y0:y1])
            won = columns[x0:x1] >= first
            won &= columns[x0:x1] <= last
            if face < self.num_solid:
                a, b, c = self.A[face, 2]
                w = np.add.outer((b * ys[y0:y1] + c).astype(dtype), (a * xs[x0:x1]).astype(dtype))
                won &= w > self.inverse_depth[window]
            else:
                won &= self.faces[window] < 0
            if self.textures[face].alpha is not None:
                if not won.any():
                    continue
                won &= self._sampled(face, "alpha", x0, y0, x1, y1) > 127
            np.copyto(self.faces[window], np.int16(face), where=won)
            if face < self.num_solid:
                np.copyto(self.inverse_depth[window], w, where=won)

    def _row_ends(self, face: int, ys: Array) -> tuple[Array, Array]:
        """The first and last x on the face in every row, (h, 1) float32; first > last: none."""
        cuts = self.row_cuts[face]
        cut = cuts[:, :1] * ys + cuts[:, 1:]
        starts = self.starts_row[face]
        first = cut[starts].max(axis=0, initial=-1.0)
        last = cut[~starts].min(axis=0, initial=self.width)
        return first.astype(np.float32)[:, None], last.astype(np.float32)[:, None]

    def paint(self, kind: str) -> Array:
        """The image of all samples: "day" (h, w, 3), "night" (h, w, 4) or "thermal" (h, w),
        uint8."""
        channels = {"day": (3,), "night": (4,), "thermal": ()}[kind]
        image = np.zeros((self.height, self.width, *channels), np.uint8)
        counts = np.bincount((self.faces + 1).ravel(), minlength=len(self.textures) + 1)[
            1:
        ].tolist()
        for face in self.drawn:
            if counts[face] == 0:
                continue
            x0, y0, x1, y1 = self.bounds[face].tolist()
            mine = self.faces[y0:y1, x0:x1] == face
            for low, high in self._bands(face, x0, y0, x1, y1):
                part = mine
                if high < math.inf:
                    w = self.inverse_depth[y0:y1, x0:x1]
                    part = mine & (w >= low) & (w < high)
                mask = part.view(np.uint8)
                bx, by, bw, bh = cv2.boundingRect(mask)
                if bw == 0:
                    continue
                box = (x0 + bx, y0 + by, x0 + bx + bw, y0 + by + bh)
                colour = self._sampled(
                    face, kind, *box, weight=math.sqrt(low * high) if low else 0.0
                )
                inner = np.ascontiguousarray(mask[by : by + bh, bx : bx + bw])
                cv2.copyTo(colour, inner, image[box[1] : box[3], box[0] : box[2]])
        return image

    def _bands(self, face: int, x0: int, y0: int, x1: int, y1: int) -> list[tuple[float, float]]:
        """Ranges of 1/z that are filtered alike; one open range where depth hardly varies."""
        if face >= self.num_solid:
            return [(0.0, np.inf)]
        near, far = self.depths[face]
        corners = self.A[face, 2] @ np.array([[x0, x1, x0, x1], [y0, y0, y1, y1], [1, 1, 1, 1]])
        top = min(1 / near, float(corners.max()))
        bottom = max(1 / far, float(corners.min()))
        if top <= bottom * _BAND:
            return [(0.0, np.inf)]
        count = int(np.ceil(np.log(top / bottom) / np.log(_BAND)))
        limits = bottom * (top / bottom) ** (np.arange(count + 1) / count)
        limits[0] *= 0.999
        limits[-1] *= 1.001
        return list(pairwise(limits.tolist()))

    def _sampled(
        self, face: int, kind: str, x0: int, y0: int, x1: int, y1: int, weight: float = 0.0
    ) -> Array:
        """A window of the texture as this camera sees it; `weight`: the 1/z to filter for."""
        texture = self.textures[face]
        A = self.A[face]
        level_u = level_v = 0  # what is cut out is shape, the same at every distance
        if kind != "alpha":
            x, y = (x0 + x1 - 1) / 2, (y0 + y1 - 1) / 2
            level_u, level_v = self._levels(A, texture, x, y, weight)
        gain = float(self.scene.gain[self.ids[face]]) if kind == "day" else 1.0
        level = texture.level(kind, level_u, level_v, gain)
        height, width = level.shape[:2]
        # u in [0, 1] spans the texture edge to edge; the centre of texel i is u = (i + 1/2) /
        # width.
        texel = np.array([[width, 0, -0.5], [0, height, -0.5], [0, 0, 1.0]])
        shift = np.array([[1.0, 0, x0], [0, 1.0, y0], [0, 0, 1.0]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return cv2.warpPerspective(
            level,
            texel @ A @ shift,
            (x1 - x0, y1 - y0),
            flags=flags,
            borderMode=cv2.BORDER_REPLICATE,
        )

    @staticmethod
    def _levels(A: Array, texture: Texture, x: float, y: float, weight: float) -> tuple[int, int]:
        """How far to filter in u and v about (x, y): to about one texel per sample."""
        (pa, pb, pc), (qa, qb, qc), (wa, wb, wc) = A.tolist()
        w = weight if weight > 0 else max(wa * x + wb * y + wc, 1e-6)
        u = min(max((pa * x + pb * y + pc) / w, 0.0), 1.0)
        v = min(max((qa * x + qb * y + qc) / w, 0.0), 1.0)
        width, height = texture.size
        texels_u = math.hypot(pa - u * wa, pb - u * wb) / w * width
        texels_v = math.hypot(qa - v * wa, qb - v * wb) / w * height
        level_u = round(math.log2(max(texels_u, 1.0)))
        level_v = round(math.log2(max(texels_v, 1.0)))
        return min(level_u, int(math.log2(width))), min(level_v, int(math.log2(height)))

    @property
    def is_sky(self) -> Array:
        return self.faces >= self.num_solid

    def depth(self) -> Array:
        """(h, w) float32 [m]; the sky's is as `View` says."""
        depth = np.zeros(self.faces.shape, np.float32)
        seen = self.inverse_depth > 0
        np.divide(1.0, self.inverse_depth, out=depth, where=seen, casting="same_kind")
        if self.view.sky_depth > 0:
            ys, xs = np.nonzero(self.is_sky)
            rays = np.linalg.inv(self.K) @ np.stack([xs, ys, np.ones(len(xs))])
            depth[ys, xs] = self.view.sky_depth / (self.view.sky_z @ rays)
        return depth

    def depth_of(self, faces: Array, x: Array, y: Array) -> Array:
        """(N,) [m] of these faces where they are seen at sample coordinates x, y; as depth()."""
        at = np.stack([x, y, np.ones(len(x))])
        solid = (faces >= 0) & (faces < self.num_solid)
        depth = np.zeros(len(faces))
        w = np.einsum("in,ni->n", at[:, solid], self.A[faces[solid], 2])
        depth[solid] = 1 / np.maximum(w, 1e-6)
        if self.view.sky_depth > 0:
            sky = faces >= self.num_solid
            rays = np.linalg.inv(self.K) @ at[:, sky]
            depth[sky] = self.view.sky_depth / (self.view.sky_z @ rays)
        return depth

    def points_in_world(self) -> list[Array]:
        """World x, y and z [m] of what every sample sees, each (h, w) float32; the sky is far."""
        z = 1 / np.maximum(self.inverse_depth, np.float32(1e-4))
        back = self.view.R.T @ np.linalg.inv(self.K)
        centre = -self.view.R.T @ self.view.t
        xs, ys = np.arange(self.width), np.arange(self.height)
        points = []
        for axis in range(3):
            a, b, c = back[axis]
            ray = np.add.outer((b * ys + c).astype(np.float32), (a * xs).astype(np.float32))
            points.append(ray * z + np.float32(centre[axis]))
        return points

    def hides(self, targets: Array, owners: Array) -> Array:
        """Which of the points seen at `targets` lie behind a face other than their own.

        targets: (H, W, 3) as x [px], y [px], depth [m] in this camera, NaN where there is none;
        owners: (H, W), the id of the face each point is on; -1 is no face's.
        """
        hidden = np.zeros(owners.shape, bool)
        with np.errstate(invalid="ignore"):
            known = np.flatnonzero(inside_image(targets, self.width, self.height))
        x, y, depth = (targets[..., axis].ravel()[known] for axis in range(3))
        owner, found = owners.ravel()[known], np.zeros(len(known), bool)
        # The sky is behind everything, however near it is painted.
        depth = np.where(owner >= len(self.scene.textures) - self.scene.num_sky, np.inf, depth)
        for face in self.drawn:
            if face >= self.num_solid:
                break
            x0, y0, x1, y1 = self.bounds[face].tolist()
            near = (x > x0 - 1) & (x < x1) & (y > y0 - 1) & (y < y1)
            index = np.flatnonzero(near & ~found & (owner != self.ids[face]))
            p, q, w = self.A[face] @ np.stack([x[index], y[index], np.ones(len(index))])
            # By more than a rounding error in front: the faces of a body share their edges.
            between = (p >= 0) & (q >= 0) & (p <= w) & (q <= w) & (w * depth[index] > 1 + 1e-4)
            index, p, q, w = index[between], p[between], q[between], w[between]
            found[index[self._opaque(face, p / w, q / w)]] = True
        hidden.ravel()[known] = found
        return hidden

    def _opaque(self, face: int, u: Array, v: Array) -> Array:
        alpha = self.textures[face].alpha
        if alpha is None or not len(u):
            return np.ones(len(u), bool)
        height, width = alpha.shape
        at = np.zeros((2, -(-len(u) // _ROW) * _ROW), np.float32)
        at[:, : len(u)] = u * width - 0.5, v * height - 0.5
        x, y = at.reshape(2, -1, _ROW)
        cut = cv2.remap(alpha, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        opaque: Array = cut.ravel()[: len(u)] > 127
        return opaque
