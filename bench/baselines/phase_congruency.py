"""Keypoints on phase congruency, described by maps of the strongest orientation.

Written from what the paper of RIFT (Li, Hu and Ai 2020, "RIFT: Multi-modal image matching based on
radiation-variation insensitive feature transform") describes, without its code: a log-Gabor bank of
4 scales and 6 orientations; corners on the minimum and edge points on the maximum moment of phase
congruency; for each, a 96 x 96 patch of the map of the orientation of greatest amplitude, as 6 x 6
histograms; mutual nearest neighbours, RANSAC. The cyclic search that makes it invariant to turns is
left out: the rigs here are upright within 5 deg.
"""

import cv2
import numpy as np

from . import NotFound, homography_map, into_source, on_grid_of, prepared
from .homographies import from_matches

SCALES, ORIENTATIONS = 4, 6
KEYPOINTS = 2500  # on each moment map
PATCH, CELLS = 96, 6


def _bank(shape: tuple[int, int]) -> np.ndarray:
    """Log-Gabor filters (orientation, scale, H, W) in the order of numpy's FFT."""
    fy, fx = np.meshgrid(np.fft.fftfreq(shape[0]), np.fft.fftfreq(shape[1]), indexing="ij")
    radius, angle = np.hypot(fx, fy), np.arctan2(-fy, fx)
    radius[0, 0] = 1
    lowpass = 1 / (1 + (radius / 0.45) ** 30)
    filters = np.empty((ORIENTATIONS, SCALES, *shape), np.float32)
    for o in range(ORIENTATIONS):
        difference = np.abs(np.angle(np.exp(1j * (angle - o * np.pi / ORIENTATIONS))))
        spread = (1 + np.cos(np.minimum(difference * ORIENTATIONS / 2, np.pi))) / 2
        for s in range(SCALES):
            centre = 1 / (3 * 1.6**s)
            radial = np.exp(-(np.log(radius / centre) ** 2) / (2 * np.log(0.75) ** 2)) * lowpass
            radial[0, 0] = 0
            filters[o, s] = radial * spread
    return filters


def moments(image: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Maximum and minimum moment of phase congruency, and the index of the strongest orientation.

    Kovesi's measure: the energy of the filters' sum, less what noise gives it, over their
    amplitudes, weighted by how many frequencies take part.
    """
    spectrum = np.fft.fft2(image.astype(np.float32))
    angles = np.arange(ORIENTATIONS) * np.pi / ORIENTATIONS
    xx = xy = yy = 0.0
    amplitudes = np.empty((ORIENTATIONS, *image.shape), np.float32)
    bank = _bank(image.shape)
    for o, angle in enumerate(angles):
        responses = np.fft.ifft2(spectrum * bank[o])
        amplitude = np.abs(responses)
        total = amplitude.sum(axis=0)
        amplitudes[o] = total
        mean = responses.sum(axis=0)
        mean /= np.abs(mean) + 1e-4
        even = responses.real * mean.real + responses.imag * mean.imag
        odd = np.abs(responses.imag * mean.real - responses.real * mean.imag)
        energy = (even - odd).sum(axis=0)
        # Noise: the finest scale's amplitude is Rayleigh distributed where there is no edge.
        tau = np.median(amplitude[0]) / np.sqrt(np.log(4))
        tau *= (1 - (1 / 1.6) ** SCALES) / (1 - 1 / 1.6)
        threshold = tau * np.sqrt(np.pi / 2) + 2 * tau * np.sqrt((4 - np.pi) / 2)
        width = (total / (amplitude.max(axis=0) + 1e-4) - 1) / (SCALES - 1)
        weight = 1 / (1 + np.exp(10 * (0.5 - width)))
        congruency = weight * np.maximum(energy - threshold, 0) / (total + 1e-4)
        x, y = congruency * np.cos(angle), congruency * np.sin(angle)
        xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
    root = np.sqrt(4 * xy**2 + (xx - yy) ** 2)
    return (xx + yy + root) / 2, (xx + yy - root) / 2, amplitudes.argmax(axis=0)


def _keypoints(moment: np.ndarray) -> np.ndarray:
    """(N, 2) the strongest FAST corners of a moment map, away from the border."""
    top = max(float(np.percentile(moment, 99.5)), 1e-9)
    image = np.uint8(255 * np.clip(moment / top, 0, 1))
    found = cv2.FastFeatureDetector.create(8, True).detect(image)
    found = sorted(found, key=lambda point: -point.response)
    points = np.float32([point.pt for point in found]).reshape(-1, 2)
    margin = PATCH // 2
    inside = (points >= margin).all(axis=1) & (
        points < np.subtract(moment.shape[::-1], margin)
    ).all(axis=1)
    return points[inside][:KEYPOINTS]


def features(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 2) and their descriptors (N, CELLS^2 * ORIENTATIONS) of unit length."""
    maximum, minimum, strongest = moments(image)
    points = np.concatenate([_keypoints(minimum), _keypoints(maximum)])
    side = PATCH // CELLS
    steps = (np.arange(CELLS) - (CELLS - 1) / 2) * side
    x = points[:, 0, None] + np.tile(steps, CELLS)
    y = points[:, 1, None] + np.repeat(steps, CELLS)
    cells = []
    for o in range(ORIENTATIONS):
        counts = cv2.blur((strongest == o).astype(np.float32), (side, side))
        cells.append(
            cv2.remap(counts, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR)
        )
    descriptors = np.stack(cells, axis=-1).reshape(len(points), -1)
    norms = np.linalg.norm(descriptors, axis=1, keepdims=True)
    return points, descriptors / np.maximum(norms, 1e-9)


def rift(reference: np.ndarray, source: np.ndarray) -> np.ndarray:
    """A homography by the above."""
    (points, descriptors), (others, other_descriptors) = (
        features(prepared(image)) for image in (reference, on_grid_of(reference, source))
    )
    if min(len(points), len(others)) < 10:
        raise NotFound("no keypoints")
    likeness = descriptors @ other_descriptors.T
    best, back = likeness.argmax(axis=1), likeness.argmax(axis=0)
    mutual = back[best] == np.arange(len(points))
    homography = from_matches(points[mutual], others[best[mutual]], reference.shape)
    return into_source(homography_map(reference.shape, homography), source)
