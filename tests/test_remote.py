"""Footage and outputs behind URLs: in a zip, and in a store of objects like S3's."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from conftest import run
from drive import contents
from xcalib import remote
from xcalib.batch.manifest import ObjectLock

moto_server = pytest.importorskip("moto.server")
s3fs = pytest.importorskip("s3fs")


@pytest.fixture(scope="module")
def bucket() -> Iterator[Any]:
    """A bucket `drives` of a server that answers as S3 does."""
    server = moto_server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (
            ("AWS_ENDPOINT_URL", f"http://{host}:{port}"),
            ("AWS_ACCESS_KEY_ID", "x"),
            ("AWS_SECRET_ACCESS_KEY", "x"),
            ("AWS_DEFAULT_REGION", "us-east-1"),
        ):
            patch.setenv(name, value)
        files = s3fs.S3FileSystem()
        files.mkdir("drives")
        yield files
    server.stop()


@pytest.fixture(scope="module")
def stored(bucket: Any, rendered: Path) -> str:
    """The URL of `rendered` in the bucket."""
    for kind in ("visible", "thermal", "depth"):
        bucket.put(f"{rendered / kind}/", f"drives/one/{kind}/", recursive=True)
    return "s3://drives/one"


@pytest.fixture(scope="module")
def registered(rendered: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What `register` writes of `rendered`."""
    out = tmp_path_factory.mktemp("registered") / "out"
    folders = (rendered / "visible", rendered / "thermal", "--depth", rendered / "depth")
    assert run("register", rendered / "rig.yaml", *folders, "-o", out).exit_code == 0
    return contents(out)


def test_a_store_of_objects_in_and_out(
    bucket: Any, stored: str, rendered: Path, registered: dict[str, bytes], tmp_path: Path
) -> None:
    folders = (f"{stored}/visible", f"{stored}/thermal", "--depth", f"{stored}/depth")
    arguments = ("register", rendered / "rig.yaml", *folders, "-o", "s3://drives/out")
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    names = {name.removeprefix("drives/out/") for name in bucket.find("drives/out")}
    notes = {name for name in names if name.startswith("register/")}
    assert "register/made_with.json" in notes and "register/lock" not in notes
    assert {name: bucket.cat(f"drives/out/{name}") for name in names - notes} == registered
    assert run(*arguments).stdout.startswith("nothing to do: all 6 frames are there")
    other = run(*arguments, "--nearest")
    assert other.exit_code == 2
    assert "made otherwise (nearest no, now yes)" in other.stderr

    bucket.rm("drives/out/register/" + min(n for n in notes if "made" not in n).rpartition("/")[2])
    bucket.pipe("drives/one/thermal/000003.png", b"nothing")
    bucket.invalidate_cache()
    remote._folders.clear()
    again = run(*arguments)
    assert again.exit_code == 3, again.output
    assert f"000003 ({stored}/thermal/000003.png: cannot decode" in again.stderr
    bucket.put(str(rendered / "thermal" / "000003.png"), "drives/one/thermal/000003.png")
    remote._folders.clear()


def test_a_zip_of_a_drive(
    rendered: Path, registered: dict[str, bytes], tmp_path: Path, bucket: Any
) -> None:
    drive = shutil.make_archive(str(tmp_path / "drive"), "zip", rendered)
    bucket.put(drive, "drives/drive.zip")
    for where in (drive, "s3://drives/drive.zip"):
        out = tmp_path / where.rpartition("/")[0].replace("/", "_")
        folders = [f"zip://{kind}::{where}" for kind in ("visible", "thermal", "depth")]
        result = run(
            *("register", rendered / "rig.yaml", *folders[:2], "--depth", folders[2], "-o", out)
        )
        assert result.exit_code == 0, result.output
        assert contents(out) == registered


def test_a_batch_in_a_store_of_objects(
    bucket: Any, stored: str, rendered: Path, registered: dict[str, bytes], tmp_path: Path
) -> None:
    job = {
        "name": "one",
        "reference": f"{stored}/visible",
        "source": f"{stored}/thermal",
        "depth": f"{stored}/depth",
        "rig": str(rendered / "rig.yaml"),
        "calibrate": False,
    }
    (tmp_path / "jobs.yaml").write_text(yaml.safe_dump({"jobs": [job]}))
    result = run("batch", tmp_path / "jobs.yaml", "-o", "s3://drives/fleet", "--quiet")
    assert result.exit_code == 0, result.output
    assert bucket.cat("drives/fleet/one/registered/000002.png") == registered["000002.png"]
    drives = json.loads(bucket.cat("drives/fleet/summary.json"))["drives"]
    assert [(drive["state"], drive["registered"]) for drive in drives] == [("good", 6)]
    assert not bucket.exists("drives/fleet/batch.lock")
    lock = ObjectLock("s3://drives/fleet", "batch.lock")
    second = run("batch", tmp_path / "jobs.yaml", "-o", "s3://drives/fleet")
    lock.close()
    assert second.exit_code == 2
    assert "s3://drives/fleet: another run is writing to this output" in second.stderr


def test_what_is_too_much_goes_again(
    stored: str, rendered: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(remote, "MOST_BYTES", 1)
    folder = Path(remote.local_name(f"{stored}/visible"))
    first, second, *_ = sorted(folder.iterdir())
    for path in (first, second, first):
        remote.fetch(path)
        assert path.read_bytes() == (rendered / "visible" / path.name).read_bytes()
    assert second.stat().st_size == 0


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("gopher://drive/visible", "the scheme gopher:// is not installed"),
        ("s3://drives/nowhere", "s3://drives/nowhere: no such file or folder"),
        ("zip://visible::nowhere.zip", "nowhere.zip"),
    ],
)
def test_urls_that_cannot_be_read(
    bucket: Any, refused: Callable[..., str], rendered: Path, tmp_path: Path, url: str, message: str
) -> None:
    given = ("register", rendered / "rig.yaml", url, rendered / "thermal", "--depth", "plane")
    assert message in refused(*given, "-o", tmp_path / "out")


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("gopher://drive/out", "the scheme gopher:// is not installed"),
        ("s3://drives/out.mkv", "expected a folder"),
        ("zip://out::out.zip", "cannot be written to"),
    ],
)
def test_urls_that_cannot_be_written(
    refused: Callable[..., str], rendered: Path, url: str, message: str
) -> None:
    folders = (rendered / "visible", rendered / "thermal", "--depth", rendered / "depth")
    assert message in refused("register", rendered / "rig.yaml", *folders, "-o", url)


def test_without_the_extra(
    refused: Callable[..., str], rendered: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("fsspec", "distributed"):
        monkeypatch.setitem(sys.modules, name, None)
    given = ("register", rendered / "rig.yaml", "s3://a/b", "c", "--depth", "plane")
    assert "pip install xcalib-rgbt[remote]" in refused(*given, "-o", tmp_path / "out")
    folders = (rendered / "visible", rendered / "thermal", "--depth", rendered / "depth")
    given = ("register", rendered / "rig.yaml", *folders, "--scheduler", "tcp://127.0.0.1:1")
    assert "pip install xcalib-rgbt[dask]" in refused(*given, "-o", tmp_path / "out")
