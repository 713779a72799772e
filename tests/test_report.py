"""The page on a calibration: what stands in it, and that a browser shows it."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from conftest import run
from xcalib import overlays
from xcalib.report import charts

Refused = Callable[..., str]


SMALL = ("--working-width", 80, "--frames", 3, "--search", "off", "--quiet")


@pytest.fixture(scope="module")
def made(rendered: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with rig.yaml, report.json and report.html, of a quick calibration."""
    folder = tmp_path_factory.mktemp("made")
    inputs = (rendered / "visible", rendered / "thermal", "--depth", rendered / "depth")
    more = ("--initial", rendered / "rig.yaml", "-o", folder / "rig.yaml")
    result = run("calibrate", *inputs, *SMALL, *more, "--report", folder / "report.json")
    assert result.exit_code in (0, 3), result.output
    result = run("report", folder, "-o", folder / "report.html")
    assert result.exit_code == 0, result.output
    return folder


@pytest.fixture(scope="module")
def page(made: Path) -> Path:
    return made / "report.html"


def test_the_report_says_how_to_repeat_it(made: Path) -> None:
    document = json.loads((made / "report.json").read_text())
    facts = document["run"]
    assert facts["program"] == "xcalib" and facts["directory"] == str(Path.cwd())
    assert facts["arguments"][0] == "calibrate" and "--depth" in facts["arguments"]
    taken = [row["file"] for row in facts["choice"] if row["taken"]]
    assert sorted(taken) == sorted(document["files"])
    assert all(row["reason"] for row in facts["choice"])


def test_the_page_is_whole_and_alone(made: Path, page: Path) -> None:
    text = page.read_text()
    assert len(text) < 5e6
    # No address but data and the namespace of SVG: nothing is fetched.
    assert not re.findall(r"(?:src|href)=\"(?!data:)", text)
    assert set(re.findall(r"https?://[\w./]+", text)) == {"http://www.w3.org/2000/svg"}
    document = json.loads((made / "report.json").read_text())
    for name in document["files"]:
        assert Path(name).stem in text
    assert document["run"]["arguments"][1] in text


def test_calibrate_writes_the_page_too(rendered: Path, tmp_path: Path) -> None:
    inputs = (rendered / "visible", rendered / "thermal", "--depth", rendered / "depth")
    more = ("--initial", rendered / "rig.yaml", "-o", tmp_path / "rig.yaml")
    result = run("calibrate", *inputs, *SMALL, *more, "--report", tmp_path / "a.html")
    assert result.exit_code in (0, 3), result.output
    assert (tmp_path / "a.html").read_text().startswith("<!DOCTYPE html>")


def test_the_page_of_a_run_of_xcalib_cli(made: Path, rendered: Path, tmp_path: Path) -> None:
    """Whose options are the same, and which ran in another folder."""
    document = json.loads((made / "report.json").read_text())
    inputs = ["visible", "thermal", "--depth", "depth", "--initial", "rig.yaml"]
    document["run"] |= {
        "program": "xcalib-cli",
        "arguments": ["--json", "calibrate", *inputs, "-o", str(made / "rig.yaml")],
        "directory": str(rendered),
    }
    document["message"] = "<b onload='alert(1)'>"
    document.pop("verdict", None)
    document["files"] = [f"visible/{Path(name).name}" for name in document["files"]]
    (tmp_path / "report.json").write_text(json.dumps(document))
    result = run("report", tmp_path, "-o", tmp_path / "a.html")
    assert result.exit_code == 0, result.output
    text = (tmp_path / "a.html").read_text()
    assert "xcalib-cli --json calibrate visible" in text
    assert "<b onload" not in text and "&lt;b onload" in text, "names are escaped"


def change(key: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def apply(document: dict[str, Any]) -> None:
        at = document
        *above, last = key.split(".")
        for name in above:
            at = at[name]
        at[last] = value

    return apply


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (change("version", 2), "expected format xcalib-report, version 1"),
        (lambda document: document.pop("run"), "does not say which command made it"),
        (change("run.arguments", [1]), "does not say which command made it"),
        (change("run.arguments", ["evaluate"]), "expected a calibration"),
        (change("run.arguments", ["calibrate", "a", "--wild"]), "is not as it was: No such option"),
        (
            change("run.directory", "/nowhere/at/all"),
            "/nowhere/at/all, which is not there any more",
        ),
        (change("rig", "none.yaml"), "none.yaml"),
        (change("files", ["gone.png"]), "gone.png was used, and is not among the frames any more"),
    ],
)
def test_bad_runs(
    made: Path,
    tmp_path: Path,
    refused: Refused,
    spoil: Callable[[dict[str, Any]], None],
    message: str,
) -> None:
    document = json.loads((made / "report.json").read_text())
    spoil(document)
    (tmp_path / "report.json").write_text(json.dumps(document))
    assert message in refused("report", tmp_path / "report.json", "-o", tmp_path / "a.html")


def test_bad_usage(tmp_path: Path, refused: Refused) -> None:
    (tmp_path / "report.json").write_text("{}")
    assert "ends in .html" in refused("report", tmp_path, "-o", tmp_path / "a.txt")
    (tmp_path / "report.json").unlink()
    assert "a folder without report.json" in refused("report", tmp_path)


# -- Overlays and charts --------------------------------------------------------------------------


def test_edges_are_those_of_the_source_and_not_of_its_rim() -> None:
    image = np.full((60, 80), 60, np.uint8)
    image[20:40, 30:50] = 200
    mask = np.zeros((60, 80), np.uint8)
    mask[5:55, 5:75] = 1
    shown = np.where(mask != 0, image, 0).astype(np.uint8)
    found = overlays.edges_of(shown, mask)
    ys, xs = np.nonzero(found)
    assert len(ys) > 60
    near = [min(abs(y - e) for e in (19.5, 39.5)) for y in ys]
    beside = [min(abs(x - e) for e in (29.5, 49.5)) for x in xs]
    assert max(np.minimum(near, beside)) <= 1.5
    reference = np.full((60, 80, 3), 90, np.uint8)
    drawn = overlays.with_edges(reference, shown, mask)
    assert (drawn[found] == overlays.EDGE).all() and (drawn[~found] == 90).all()


@pytest.mark.parametrize("kind", overlays.KINDS)
def test_what_is_not_valid_shows_the_reference(kind: str) -> None:
    random = np.random.default_rng(1)
    reference = random.integers(0, 256, (40, 60), np.uint8)
    source = random.integers(0, 256, (40, 60), np.uint8)
    picture = overlays.KINDS[kind](reference, source, np.zeros((40, 60), np.uint8))
    assert picture.shape == (40, 60, 3) and picture.dtype == np.uint8
    assert (picture[..., 0] == picture[..., 2]).all(), "gray, as the reference is"


@pytest.mark.parametrize(("low", "high"), [(0, 1), (0, 0.037), (-3, 8), (0, 412), (0, 1e-6)])
def test_ticks_are_round_and_inside(low: float, high: float) -> None:
    found = charts.ticks(low, high)
    assert 3 <= len(found) <= 10 and min(found) >= low - 1e-12 and max(found) <= high + 1e-12
    steps = np.diff(found)
    assert np.allclose(steps, steps[0]) and f"{steps[0]:.0e}"[0] in "125"


# -- In a browser ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Debian's Chromium."""
    paths = [shutil.which(name) for name in ("chromium", "chromedriver")]
    if None in paths:
        pytest.skip("no Chromium: `apt-get install chromium chromium-driver`")
    webdriver = pytest.importorskip("selenium.webdriver")
    service = pytest.importorskip("selenium.webdriver.chrome.service")
    options = webdriver.ChromeOptions()
    options.binary_location = paths[0]
    for flag in (
        "--headless=new",
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--window-size=900,900",
    ):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=service.Service(paths[1]))
    yield driver
    driver.quit()


def picture(element: Any) -> Any:
    data = np.frombuffer(element.screenshot_as_png, np.uint8)
    return cv2.imdecode(data, cv2.IMREAD_COLOR).astype(int)


def test_a_browser_shows_it(browser: Any, page: Path) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    browser.get(page.as_uri())
    images = browser.find_elements(By.TAG_NAME, "img")
    assert len(images) >= 6
    decoded = browser.execute_async_script(
        "const done = arguments[0]; Promise.all([...document.images].map(i => i.decode()))"
        ".then(() => done(true), error => done(String(error)));"
    )
    assert decoded is True
    assert all(browser.execute_script("return arguments[0].naturalWidth", i) > 1 for i in images)

    stack = browser.find_element(By.CSS_SELECTOR, "figure:not([hidden]) .stack")
    cut = stack.find_element(By.CSS_SELECTOR, ".cut")
    middle = picture(stack)
    ActionChains(browser).move_to_element(cut).click_and_hold().move_by_offset(
        -200, 0
    ).release().perform()
    assert int(cut.get_attribute("value")) < 40
    by_mouse = picture(stack)
    assert (by_mouse != middle).any()
    cut.send_keys(Keys.END)
    assert cut.get_attribute("value") == "100"
    before = picture(stack)
    cut.send_keys(Keys.HOME)
    after = picture(stack)
    assert np.abs(before - after).max() > 50

    shown = {"edges": after}
    for mode in ("blend", "checker", "source", "mask", "arrows"):
        browser.find_element(By.CSS_SELECTOR, f"input[value={mode}]").click()
        shown[mode] = picture(stack)
        others = [image for name, image in shown.items() if name != mode]
        assert all((shown[mode] != image).any() for image in others), mode

    rig = browser.find_element(By.ID, "rig")
    at_first = rig.find_element(By.TAG_NAME, "line").get_attribute("x2")
    rig.send_keys(Keys.ARROW_LEFT)
    assert rig.find_element(By.TAG_NAME, "line").get_attribute("x2") != at_first
    assert browser.get_log("browser") == []
    # On a phone nothing sticks out to the side.
    browser.set_window_size(500, 900)  # the narrowest that Chromium takes
    width = browser.execute_script(
        "return document.documentElement.scrollWidth - document.documentElement.clientWidth"
    )
    assert width == 0
