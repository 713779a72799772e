"""Thermal images as cameras save them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from conftest import run
from xcalib import Registrar, Rig
from xcalib.depth import read_depth
from xcalib.footage import ImageFiles
from xcalib.frames import Image, InputError, list_files, read_image, write_image
from xcalib.thermal import KNOWN, recognise, scalar_sources

MAPS = ("inferno", "jet", "hot", "turbo", "viridis", "iron", "rainbow")


@pytest.fixture(scope="module")
def values() -> NDArray[np.uint8]:
    """A scene of every value: smooth ground, hot and cold boxes, a little noise."""
    random = np.random.default_rng(3)
    y, x = np.mgrid[:240, :320]
    scene = 60 + 0.3 * y + 0.25 * x
    for _ in range(40):
        left, top = random.integers(0, 300), random.integers(0, 220)
        w, h = random.integers(8, 60, 2)
        scene[top : top + h, left : left + w] = random.uniform(0, 255)
    smooth = cv2.GaussianBlur(scene, (0, 0), 1.2) + random.normal(0, 1, scene.shape)
    return smooth.clip(0, 255).round().astype(np.uint8)


def jpeg(image: Image, quality: int) -> Image:
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return cv2.imdecode(data, cv2.IMREAD_UNCHANGED)


def correlation(a: Image, b: Image) -> float:
    return float(np.corrcoef(a.ravel().astype(float), b.ravel().astype(float))[0, 1])


@pytest.mark.parametrize("name", MAPS)
def test_a_known_map_is_named_and_inverted(values: NDArray[np.uint8], name: str) -> None:
    found = recognise([KNOWN[name].curve[values]])
    assert found is not None
    assert found.name == name
    # Maps repeat colours here and there: as near as 8 bits of colour allow.
    assert np.mean(np.abs(found.invert(KNOWN[name].curve[values]) - values.astype(int)) <= 3) > 0.95


@pytest.mark.parametrize("name", MAPS)
def test_jpeg_is_borne(values: NDArray[np.uint8], name: str) -> None:
    image = jpeg(KNOWN[name].curve[values], 80)
    found = recognise([image])
    assert found is not None
    assert correlation(found.invert(image), values) > 0.95


@pytest.mark.parametrize("quality", [95, 80])
def test_a_map_that_nobody_knows_is_estimated(values: NDArray[np.uint8], quality: int) -> None:
    stops = np.array([(60, 0, 0), (200, 30, 0), (140, 170, 0), (0, 190, 80), (60, 240, 255)])
    places = np.linspace(0, 255, len(stops))
    curve = np.stack([np.interp(np.arange(256), places, stops[:, c]) for c in range(3)], axis=1)
    image = jpeg(curve.round().astype(np.uint8)[values], quality)
    found = recognise([image])
    assert found is not None
    assert found.name == "estimated"
    place = found.invert(image)
    assert correlation(place, values) > 0.97, "the bright end is the hot one"


def test_gray_and_tinted_images_are_none(values: NDArray[np.uint8]) -> None:
    assert recognise([values]) is None
    assert recognise([cv2.cvtColor(values, cv2.COLOR_GRAY2BGR)]) is None
    tint = (values[..., None] * np.array([0.8, 0.9, 1.0])).astype(np.uint8)
    assert recognise([tint]) is None


def test_images_of_two_kinds_are_none(values: NDArray[np.uint8]) -> None:
    assert recognise([KNOWN["inferno"].curve[values], values]) is None


def test_a_scene_in_natural_colours_is_none(rendered: Path) -> None:
    paths = list_files(rendered / "visible")
    assert recognise([read_image(path) for path in paths]) is None


@pytest.mark.parametrize("folder", ["lynred_night/visible", "roadscene/visible"])
def test_real_photographs_are_none(xcalib_data: Path, folder: str) -> None:
    if not (xcalib_data / folder).is_dir():
        pytest.skip(f"no {folder} in {xcalib_data}")
    for path in list_files(xcalib_data / folder)[::4]:
        assert recognise([read_image(path)]) is None, path


def test_real_false_colour_is_recognised(xcalib_data: Path) -> None:
    if not (xcalib_data / "flir_adas").is_dir():
        pytest.skip(f"no flir_adas in {xcalib_data}")
    for path in list_files(xcalib_data / "flir_adas"):
        found = recognise([read_image(path)])
        assert (found.name if found else None) == ("inferno" if "_T" in path.name else None)


# -- The commands --------------------------------------------------------------------------------


def coloured(scene: Path) -> list[NDArray[np.uint8]]:
    """Replace the thermal images by false colour; returns what they were."""
    before = []
    for path in list_files(scene / "thermal"):
        before.append(read_image(path))
        write_image(path, KNOWN["jet"].curve[before[-1]])
    return before


def test_sources_are_turned_back_to_numbers(scene: Path) -> None:
    before = coloured(scene)
    sources, line = scalar_sources(ImageFiles(list_files(scene / "thermal")))
    assert "jet" in line
    for source, was in zip(sources, before, strict=True):
        np.testing.assert_allclose(source, was, atol=3)
    kept, line = scalar_sources(ImageFiles(list_files(scene / "thermal")), "none")
    assert kept[0].ndim == 3
    assert line == ""
    named, _ = scalar_sources(ImageFiles(list_files(scene / "thermal")), "jet")
    np.testing.assert_array_equal(named[0], sources[0])
    with pytest.raises(InputError, match=r"'magenta' is not known, expected auto, none or one of"):
        scalar_sources(sources, "magenta")


def test_evaluate_says_so_and_scores_the_numbers(scene: Path, rendered: Path) -> None:
    arguments = ("evaluate", rendered / "rig.yaml", scene / "visible", scene / "thermal")
    depth = ("--depth", scene / "depth")
    plain = run(*arguments, *depth)
    coloured(scene)
    found = run(*arguments, *depth)
    assert found.exit_code == 0, found.output
    assert found.stderr.count("\n") == 1
    assert "false colour (map: jet)" in found.stderr
    lines = [r.stdout.splitlines()[1].split() for r in (plain, found)]
    assert lines[0][0] == lines[1][0] == "NEC"
    assert float(lines[1][2]) == pytest.approx(float(lines[0][2]), abs=0.01)


def test_an_unknown_map_is_refused(scene: Path, refused: Callable[..., str]) -> None:
    line = refused(
        *("evaluate", scene / "rig.yaml", scene / "visible", scene / "thermal"),
        *("--depth", "plane", "--source-colormap", "magenta"),
    )
    assert "'magenta'" in line


def test_register_keeps_the_colours_of_the_file(scene: Path) -> None:
    coloured(scene)
    out = scene / "out"
    run(
        *("register", scene / "rig.yaml", scene / "visible", scene / "thermal"),
        *("--depth", scene / "depth", "-o", out),
    )
    assert read_image(list_files(out)[0]).ndim == 3


@pytest.mark.parametrize("dtype", ["uint16", "float32"])
def test_nearest_never_mixes_radiometric_values(scene: Path, dtype: str) -> None:
    """Counts (22 000 and more) and degrees Celsius, some below 0, come out as they went in."""
    random = np.random.default_rng(5)
    for path in list_files(scene / "thermal"):
        shape = read_image(path).shape[:2]
        raw = random.integers(22_000, 30_000, shape)
        image = raw.astype(np.uint16) if dtype == "uint16" else (raw / 100 - 253.15).astype("f4")
        write_image(path.with_suffix(".tiff"), image)
        path.unlink()
    rig, depths = scene / "rig.yaml", list_files(scene / "depth", (".png", ".tiff", ".npy"))
    arguments = ("register", rig, scene / "visible", scene / "thermal", "--depth", scene / "depth")
    result = run(*arguments, "-o", scene / "out", "--nearest")
    assert result.exit_code == 0, result.output
    source = read_image(list_files(scene / "thermal")[0])
    image = read_image(list_files(scene / "out")[0])
    mask = read_image(list_files(scene / "out" / "masks")[0])
    assert image.dtype == source.dtype
    assert np.isin(image[mask == 0], source).all()
    points = Registrar(Rig.load(rig)).map(read_depth(depths[0]))[mask == 0]
    u, v = np.floor(points + 0.5).astype(int).T
    assert np.mean(image[mask == 0] == source[v, u]) > 0.999
    blended, _ = Registrar(Rig.load(rig)).register(source, read_depth(depths[0]))
    assert not np.isin(blended[mask == 0], source).all()
