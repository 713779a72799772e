"""A homography for each pair: by ECC on edges, and by SIFT keypoints with RANSAC."""

import cv2
import numpy as np

from . import NotFound, edges, homography_map, into_source, on_grid_of, plausible, prepared


def ecc(reference: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Enhanced correlation of gradient magnitudes, coarse to fine: shift, affine, homography."""
    target, moving = edges(reference), edges(on_grid_of(reference, source))
    warp = np.eye(3, dtype=np.float32)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-5)
    last = 1.0
    for factor, motion in (
        (0.25, cv2.MOTION_TRANSLATION),
        (0.5, cv2.MOTION_AFFINE),
        (1.0, cv2.MOTION_HOMOGRAPHY),
    ):
        warp = _rescaled(warp, factor / last)
        last = factor
        a, b = (
            cv2.resize(one, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
            for one in (target, moving)
        )
        rows = 3 if motion == cv2.MOTION_HOMOGRAPHY else 2
        try:
            _, found = cv2.findTransformECC(a, b, warp[:rows].copy(), motion, stop, None, 5)
        except cv2.error as error:
            if error.code != cv2.Error.StsNoConv:
                raise
            raise NotFound("ECC did not converge") from None
        warp[:rows] = found
    if not plausible(warp, reference.shape):
        raise NotFound("ECC ended in an implausible homography")
    return into_source(homography_map(reference.shape, warp.astype(np.float64)), source)


def _rescaled(warp: np.ndarray, factor: float) -> np.ndarray:
    """The same warp of images that are `factor` as large (pixel centres at integers)."""
    shift = (factor - 1) / 2
    to = np.array([[factor, 0, shift], [0, factor, shift], [0, 0, 1]])
    return (to @ warp @ np.linalg.inv(to)).astype(np.float32)


def from_matches(here: np.ndarray, there: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """RANSAC; a homography of fewer than 10 inliers is chance."""
    if len(here) < 10:
        raise NotFound(f"{len(here)} matches")
    homography, inliers = cv2.findHomography(
        here, there, cv2.RANSAC, 3.0, maxIters=5000, confidence=0.999
    )
    if not plausible(homography, shape) or inliers.sum() < 10:
        raise NotFound("no homography of 10 matches")
    return homography


def sift(reference: np.ndarray, source: np.ndarray) -> np.ndarray:
    """SIFT keypoints matched both ways with Lowe's ratio of 0.9."""
    detector = cv2.SIFT_create(4000, contrastThreshold=0.01)
    (points, descriptors), (others, other_descriptors) = (
        detector.detectAndCompute(np.uint8(255 * prepared(image)), None)
        for image in (reference, on_grid_of(reference, source))
    )
    if min(len(points), len(others)) < 10:
        raise NotFound("no keypoints")
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    back = {
        m[0].queryIdx: m[0].trainIdx for m in matcher.knnMatch(other_descriptors, descriptors, k=1)
    }
    pairs = [
        (a.queryIdx, a.trainIdx)
        for a, b in matcher.knnMatch(descriptors, other_descriptors, k=2)
        if a.distance < 0.9 * b.distance and back[a.trainIdx] == a.queryIdx
    ]
    here = np.float32([points[i].pt for i, _ in pairs])
    there = np.float32([others[i].pt for _, i in pairs])
    homography = from_matches(here, there, reference.shape)
    return into_source(homography_map(reference.shape, homography), source)
