"""What holds for any input, not only for the examples of other tests."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray

from xcalib import Pinhole, Registrar, Rig
from xcalib._core import natural_order, pair_times, read_array, read_file, write_file

FEW = settings(max_examples=60, deadline=None)
SIDES = st.integers(2, 40)
TIMES = st.lists(st.floats(0, 100), min_size=1, max_size=30).map(sorted)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("any")


def finite(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


@st.composite
def pinholes(draw: st.DrawFn) -> Pinhole:
    width, height = draw(SIDES), draw(SIDES)
    fx, fy = (side * draw(finite(0.3, 10)) for side in (width, height))
    cx, cy = (side * draw(finite(0, 1)) for side in (width, height))
    return Pinhole(width, height, fx, fy, cx, cy, draw(finite(-1, 1)))


@st.composite
def rigs(draw: st.DrawFn) -> Rig:
    rig = Rig(draw(pinholes()), draw(pinholes()))
    axis = np.array([draw(finite(-1, 1)) for _ in range(3)])
    rig.R = rotation(axis)
    rig.t = [draw(finite(-2, 2)) for _ in range(3)]
    return rig


def rotation(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """By a rotation vector."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-9:
        return np.eye(3)
    x, y, z = vector / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K)


@FEW
@given(rig=rigs())
def test_rigs_read_back_bit_by_bit(folder: Path, rig: Rig) -> None:
    rig.save(folder / "rig.yaml")
    back = Rig.load(folder / "rig.yaml")
    np.testing.assert_array_equal(back.R, rig.R)
    np.testing.assert_array_equal(back.t, rig.t)
    for one, other in ((back.reference, rig.reference), (back.source, rig.source)):
        np.testing.assert_array_equal(one.K, other.K)
        assert (one.width, one.height) == (other.width, other.height)


@FEW
@given(data=st.binary(max_size=2000))
def test_any_bytes_are_a_rig_or_refused(folder: Path, data: bytes) -> None:
    path = folder / "bytes.yaml"
    path.write_bytes(data)
    with pytest.raises(ValueError, match=r"bytes\.yaml: ") as caught:
        Rig.load(path)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 500


@FEW
@given(
    array=npst.arrays(
        npst.floating_dtypes(sizes=(16, 32, 64), endianness="?"),
        npst.array_shapes(min_dims=2, max_dims=2, max_side=12),
    ),
    fortran=st.booleans(),
)
def test_arrays_are_read_as_numpy_reads_them(
    folder: Path, array: NDArray[Any], fortran: bool
) -> None:
    path = folder / "array.npy"
    np.save(path, np.asfortranarray(array) if fortran else array)
    with np.errstate(over="ignore"):
        np.testing.assert_array_equal(read_array(path, False), array.astype(np.float32))


@FEW
@given(data=st.binary(max_size=300), head=st.booleans())
def test_any_bytes_are_an_array_or_refused(folder: Path, data: bytes, head: bool) -> None:
    path = folder / "bytes.npy"
    path.write_bytes((b"\x93NUMPY\x01\x00" if head else b"") + data)
    with pytest.raises(ValueError, match=r"bytes\.npy: "):
        read_array(path, False)


@FEW
@given(data=st.binary(max_size=3000))
def test_files_are_written_as_they_are(folder: Path, data: bytes) -> None:
    write_file(folder / "any", data)
    assert read_file(folder / "any") == data


FLOATS = st.floats(width=32, allow_nan=True, allow_infinity=True)


@FEW
@given(rig=rigs(), data=st.data())
def test_valid_pixels_are_finite_and_between_those_of_the_source(
    rig: Rig, data: st.DataObject
) -> None:
    shapes = [(camera.height, camera.width) for camera in (rig.source, rig.reference)]
    source = data.draw(npst.arrays(np.float32, shapes[0], elements=FLOATS))
    depth = data.draw(npst.arrays(np.float32, shapes[1], elements=FLOATS))
    image, mask = Registrar(rig, 1).register(source, depth)
    assert np.isfinite(image).all() and mask.max() <= 3
    assert not image[(mask != 0) & (mask != 2)].any()
    assert (mask[~(np.isfinite(depth) & (depth > 0))] == 3).all()
    values = source[np.isfinite(source)].astype(np.float64)
    if (mask == 0).any():
        slack = 1e-4 * float(np.abs(values).max()) + 1e-30
        assert values.min() - slack <= image[mask == 0].min()
        assert image[mask == 0].max() <= values.max() + slack


@FEW
@given(first=TIMES, second=TIMES, offset=finite(-5, 5), gap=finite(0.01, 10))
def test_pairs_in_time_are_one_to_one_in_order_and_near(
    first: list[float], second: list[float], offset: float, gap: float
) -> None:
    try:
        pairing = pair_times(np.array(first), np.array(second), offset, gap)
    except ValueError:  # none are near
        apart = np.abs(np.subtract.outer(np.array(second) - offset, np.array(first)))
        assert (apart > gap - 1e-9).all()
        return
    one, other = pairing.references, pairing.sources
    assert len(one) == len(other) > 0
    assert (np.diff(one) > 0).all() and (np.diff(other) > 0).all()
    apart = np.abs(np.array(second)[other] - offset - np.array(first)[one])
    assert (apart <= gap + 1e-9).all()


@FEW
@given(names=st.lists(st.text(max_size=12), max_size=20))
def test_natural_order_is_an_order(names: list[str]) -> None:
    order = natural_order(names)
    assert sorted(order) == list(range(len(names)))
    again = natural_order([names[i] for i in order])
    assert [names[i] for i in order] == [names[order[i]] for i in again]
