"""Mattes mutual information by SimpleITK: affine, and a B-spline on top of it."""

import numpy as np
import SimpleITK as sitk

from . import NotFound, into_source, on_grid_of, prepared


def _method(levels: tuple[int, ...], share: float) -> sitk.ImageRegistrationMethod:
    method = sitk.ImageRegistrationMethod()
    method.SetMetricAsMattesMutualInformation(50)
    method.SetMetricSamplingStrategy(method.RANDOM)
    method.SetMetricSamplingPercentage(share, seed=1)
    method.SetInterpolator(sitk.sitkLinear)
    method.SetShrinkFactorsPerLevel(levels)
    method.SetSmoothingSigmasPerLevel([level / 2 for level in levels])
    return method


def _images(reference: np.ndarray, source: np.ndarray) -> tuple[sitk.Image, sitk.Image]:
    return tuple(
        sitk.GetImageFromArray(prepared(image))
        for image in (reference, on_grid_of(reference, source))
    )


def _affine(fixed: sitk.Image, moving: sitk.Image) -> sitk.Transform:
    method = _method((4, 2, 1), 0.15)
    method.SetOptimizerAsRegularStepGradientDescent(2.0, 1e-3, 100, relaxationFactor=0.6)
    method.SetOptimizerScalesFromPhysicalShift()
    transform = sitk.AffineTransform(2)
    transform.SetCenter([(side - 1) / 2 for side in fixed.GetSize()])
    method.SetInitialTransform(transform, inPlace=True)
    method.Execute(fixed, moving)
    return transform


def _map(transform: sitk.Transform, fixed: sitk.Image, source: np.ndarray) -> np.ndarray:
    field = sitk.TransformToDisplacementField(transform, sitk.sitkVectorFloat64, fixed.GetSize())
    shift = sitk.GetArrayFromImage(field)
    y, x = np.mgrid[: shift.shape[0], : shift.shape[1]]
    at = np.stack([x + shift[..., 0], y + shift[..., 1]], axis=-1).astype(np.float32)
    return into_source(at, source)


def affine(reference: np.ndarray, source: np.ndarray) -> np.ndarray:
    fixed, moving = _images(reference, source)
    try:
        return _map(_affine(fixed, moving), fixed, source)
    except RuntimeError as error:  # how SimpleITK says that the images came apart
        raise NotFound(str(error).splitlines()[-1]) from None


def bspline(reference: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Mesh of 8 x 6 on top of the affine."""
    fixed, moving = _images(reference, source)
    try:
        start = _affine(fixed, moving)
        spline = sitk.BSplineTransformInitializer(fixed, (8, 6))
        method = _method((2,), 0.2)
        method.SetOptimizerAsLBFGSB(1e-5, 30, 5, 60)
        method.SetMovingInitialTransform(start)
        method.SetInitialTransform(spline, inPlace=True)
        method.Execute(fixed, moving)
    except RuntimeError as error:
        raise NotFound(str(error).splitlines()[-1]) from None
    return _map(sitk.CompositeTransform([start, spline]), fixed, source)
