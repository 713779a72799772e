"""Dense flow for each pair, without geometry."""

import cv2
import numpy as np

from xcalib.flow import FlowOptions, patch_flow

from . import edges, grid, into_source, on_grid_of, prepared


def patches(reference: np.ndarray, source: np.ndarray) -> np.ndarray:
    """The built-in patch flow; where it is not sure, what surrounds it (Gaussian, 12 px)."""
    flow, confidence = patch_flow(
        prepared(reference),
        prepared(on_grid_of(reference, source)),
        None,
        FlowOptions(max_shift=24),
    )
    weight = cv2.GaussianBlur(confidence, (0, 0), 12) + 1e-6
    smooth = cv2.GaussianBlur(flow * confidence[..., None], (0, 0), 12) / weight[..., None]
    return into_source(grid(reference.shape) + smooth, source)


def dis(reference: np.ndarray, source: np.ndarray) -> np.ndarray:
    """OpenCV's DIS flow on gradient magnitudes, which are what the two images share."""
    images = (edges(reference), edges(on_grid_of(reference, source)))
    here, there = (np.uint8(255 * cv2.GaussianBlur(one, (0, 0), 1.0)) for one in images)
    method = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    flow = method.calc(here, there, np.zeros((*here.shape, 2), np.float32))
    return into_source(grid(reference.shape) + flow, source)
