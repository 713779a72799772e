"""`xcalib batch`: drives calibrated, compared with their last rigs, registered, and summed up."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import Result

from conftest import run
from drive import contents
from xcalib import Rig
from xcalib.batch.run import has_moved, locked


def drive_of(scene: Path, name: str, **more: object) -> dict[str, object]:
    folders = {kind: str(scene / kind) for kind in ("visible", "thermal", "depth")}
    given = {"reference": folders["visible"], "source": folders["thermal"]}
    return {"name": name, **given, "depth": folders["depth"], **more}


def write_jobs(path: Path, *jobs: dict[str, object], **more: object) -> Path:
    path.write_text(yaml.safe_dump({"jobs": list(jobs), **more}))
    return path


@pytest.fixture(scope="module")
def fleet(rendered: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Result]:
    """A job file, what became of it, and its result."""
    folder = tmp_path_factory.mktemp("fleet")
    moved = Rig.load(rendered / "rig.yaml")
    moved.t = moved.t + np.array([0.2, 0, 0])
    moved.save(folder / "last.yaml")
    spoiled = Path(shutil.copytree(rendered, folder / "spoiled"))
    (spoiled / "thermal" / "000002.png").write_bytes(b"nothing")
    jobs = write_jobs(
        folder / "jobs.yaml",
        drive_of(rendered, "known", rig=str(rendered / "rig.yaml"), calibrate=False),
        drive_of(rendered, "bumped", rig=str(folder / "last.yaml"), register={"overlay": True}),
        drive_of(spoiled, "spoiled", rig=str(rendered / "rig.yaml"), calibrate=False),
        drive_of(folder / "nowhere", "lost"),
        defaults={"calibrate": {"frames": 6}},
    )
    return jobs, folder / "out", run("batch", jobs, "-o", folder / "out")


def test_a_batch_sums_up_its_drives(fleet: tuple[Path, Path, Result]) -> None:
    _, out, result = fleet
    assert result.exit_code == 1, result.output
    assert "1 of 4 drives are good" in result.stdout
    with (out / "summary.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["name"], row["state"]) for row in rows] == [
        ("lost", "failed"),
        ("bumped", "moved"),
        ("spoiled", "incomplete"),
        ("known", "good"),
    ]
    lost, bumped, spoiled, known = rows
    assert lost["why"].endswith("nowhere/visible: no such folder")
    assert bumped["trusted"] == "True" and float(bumped["expected_median_px"]) < 2
    assert float(bumped["moved_median_px"]) > 2
    assert float(bumped["nec_new_rig"]) > float(bumped["nec_last_rig"])
    assert (spoiled["registered"], spoiled["left_out"], spoiled["missing"]) == ("5", "1", "0")
    assert (known["frames"], known["registered"]) == ("6", "6")
    document = json.loads((out / "summary.json").read_text())
    (name, why), *others = document["drives"][2]["left_out_frames"]
    assert not others and name == "000002" and "000002.png: cannot decode" in why
    page = (out / "index.html").read_text()
    assert page.index("lost") < page.index("bumped") < page.index("spoiled") < page.index("known")
    assert 'href="bumped/rig.yaml"' in page


def test_its_drives_are_those_of_the_commands(
    fleet: tuple[Path, Path, Result], rendered: Path, tmp_path: Path
) -> None:
    _, out, _ = fleet
    folders = (rendered / "visible", rendered / "thermal", "--depth", rendered / "depth")
    rig = out / "bumped" / "rig.yaml"
    result = run("register", rig, *folders, "--overlay", "-o", out / "bumped" / "registered")
    assert result.exit_code == 0, result.output  # its journal is that of the command
    assert result.stdout.startswith("6 frames (6 from before), ")
    report = json.loads((out / "bumped" / "report.json").read_text())
    assert report["rig"] == str(rig)
    assert run("register", rig, *folders, "-o", tmp_path / "o", "--overlay").exit_code == 0
    assert contents(tmp_path / "o") == contents(out / "bumped" / "registered")


def test_a_finished_batch_does_nothing_and_says_so(fleet: tuple[Path, Path, Result]) -> None:
    jobs, out, _ = fleet
    kept = yaml.safe_load(jobs.read_text())
    kept["jobs"] = kept["jobs"][:2]
    before = contents(out / "bumped")
    result = run("batch", write_jobs(jobs.with_name("two.yaml"), **kept), "-o", out)
    assert result.exit_code == 3, result.output
    assert result.stdout.startswith("nothing to do: 1 of 2 drives are good")
    assert "bumped: moved" in result.stderr and "the rig has moved by" in result.stderr
    assert contents(out / "bumped") == before


def test_when_a_rig_has_moved() -> None:
    def found(median: float, p95: float, trusted: bool = True) -> dict[str, object]:
        return {"trusted": trusted, "drift": {"median_px": median, "p95_px": p95}}

    assert not has_moved(None)
    assert not has_moved({"trusted": True, "drift": None})
    assert not has_moved(found(1.9, 4.9))
    assert has_moved(found(2.1, 3.0))
    assert has_moved(found(1.0, 5.1))
    assert not has_moved(found(200, 300, trusted=False))  # it says nothing of the last one


@pytest.mark.parametrize(
    ("jobs", "message"),
    [
        ("", "expected keys and values"),
        ("jobs: 3", "jobs is 3, expected a list"),
        ("jobs: []", "expected a list"),
        ("drives: []", "jobs is missing"),
        ("{jobs: [{name: a, reference: v, source: t}]}", "job 1 (a): depth is missing"),
        ("{jobs: [{reference: v, source: t, depth: d}]}", "job 1: name is None"),
        ("{jobs: [{name: ../a, reference: v, source: t, depth: d}]}", "name is '../a'"),
        ("{jobs: [{name: a, reference: v, source: t, depth: d, bins: 3}]}", "unknown key 'bins'"),
        (
            "{jobs: [{name: a, reference: v, source: t, depth: d, register: {frames: 3}}]}",
            "job 1 (a): register: unknown key 'frames', expected overlay, nearest",
        ),
        (
            "{jobs: [{name: a, reference: v, source: t, depth: d, calibrate: {frames: 0}}]}",
            "job 1 (a): Invalid value for '--frames'",
        ),
        (
            "{jobs: [{name: a, reference: v, source: t, depth: d, calibrate: false}]}",
            "calibrate is false, expected a rig",
        ),
        (
            "{jobs: [{name: a, reference: v, source: t, depth: d}], defaults: {name: b}}",
            "defaults: unknown key 'name'",
        ),
        (
            "{jobs: [{name: a, reference: v, source: t, depth: d},"
            " {name: a, reference: v, source: t, depth: d}]}",
            "job 2 (a): the name is there already",
        ),
    ],
)
def test_bad_job_files(
    refused: Callable[..., str], tmp_path: Path, jobs: str, message: str
) -> None:
    (tmp_path / "jobs.yaml").write_text(jobs)
    line = refused("batch", tmp_path / "jobs.yaml", "-o", tmp_path / "out")
    assert message in line and "jobs.yaml" in line


def test_two_batches_on_one_output(
    refused: Callable[..., str], rendered: Path, tmp_path: Path
) -> None:
    jobs = write_jobs(tmp_path / "jobs.yaml", drive_of(rendered, "one"))
    with locked(tmp_path / "out"):
        line = refused("batch", jobs, "-o", tmp_path / "out")
    assert f"{tmp_path / 'out'}: another batch is writing to this output" in line
