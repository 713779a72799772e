"""Fetching model files, from a server on this machine."""

from __future__ import annotations

import hashlib
import http.server
import re
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from conftest import run
from xcalib import models
from xcalib.depth.recipes import RECIPES
from xcalib.frames import InputError
from xcalib.models import fetch, read_index, verify

DATA = bytes(range(256)) * 5000


class Server(http.server.ThreadingHTTPServer):
    """Serves `data` under every path, with ranges and entity tags."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.data = DATA
        self.break_after: int | None = None
        """Bytes after which a transfer is cut off."""
        self.tags = True
        self.length = True
        self.whole = False
        """Answer a range with the whole file, as if it were the range."""
        self.redirect = ""
        self.asked: list[str | None] = []
        """The ranges that were asked for."""

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/models/net.onnx"


class Handler(http.server.BaseHTTPRequestHandler):
    """One request."""

    server: Server

    def log_message(self, *args: object) -> None:
        pass

    def do_GET(self) -> None:
        server, data = self.server, self.server.data
        wanted = self.headers.get("Range")
        server.asked.append(wanted)
        if "missing" in self.path:
            self.send_error(404)
            return
        if server.redirect:
            self.send_response(302)
            self.send_header("Location", server.redirect)
            self.end_headers()
            return
        tag = f'"{hashlib.sha256(data).hexdigest()[:8]}"'
        start = 0
        if wanted and self.headers.get("If-Range") == tag:
            start = int(wanted.removeprefix("bytes=").removesuffix("-"))
        if wanted and start >= len(data):
            self.send_error(416)
            return
        self.send_response(206 if start else 200)
        if server.whole:
            start = 0
        elif start:
            self.send_header("Content-Range", f"bytes {start}-{len(data) - 1}/{len(data)}")
        if server.length:
            self.send_header("Content-Length", str(len(data) - start))
        if server.tags:
            self.send_header("ETag", tag)
        self.end_headers()
        self.wfile.write(data[start : server.break_after])


@pytest.fixture
def server() -> Iterator[Server]:
    with Server() as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XCALIB_MODELS", str(tmp_path / "models"))
    return tmp_path / "models"


def test_fetched_once_and_checked_ever_after(server: Server, folder: Path) -> None:
    path = fetch(server.url)
    assert path == folder / "net.onnx"
    assert path.read_bytes() == DATA
    expected = {"url": server.url, "sha256": hashlib.sha256(DATA).hexdigest(), "bytes": len(DATA)}
    assert read_index(folder) == {"net.onnx": expected}
    assert {file.name for file in folder.iterdir()} == {"net.onnx", "index.json"}
    assert fetch(server.url) == path
    assert server.asked == [None]

    path.write_bytes(DATA[:-1] + b"x")
    with pytest.raises(InputError, match=r"net\.onnx: sha256 is .* expected .* first fetched"):
        fetch(server.url)
    assert verify() == {"net.onnx": "changed"}


@pytest.mark.parametrize("tags", [True, False])
def test_broken_transfer_is_resumed(server: Server, folder: Path, tags: bool) -> None:
    server.break_after, server.tags = 300_000, tags
    with pytest.raises(RuntimeError, match=rf"broke off after 300000 of {len(DATA)} bytes"):
        fetch(server.url)
    assert not (folder / "net.onnx").exists()
    server.break_after = None
    seen: list[tuple[int, int | None]] = []
    assert fetch(server.url, show=lambda *state: seen.append(state)).read_bytes() == DATA
    # Without a tag nothing shows whether the file is still the same: it is fetched anew.
    assert server.asked == [None, "bytes=300000-" if tags else None]
    assert seen[-1] == (len(DATA), len(DATA))
    assert (seen[0][0] > 300_000) or not tags
    assert verify() == {"net.onnx": "ok"}


def test_file_that_changed_meanwhile_is_not_patched_together(server: Server, folder: Path) -> None:
    server.break_after = 300_000
    with pytest.raises(RuntimeError, match="fetch again to resume"):
        fetch(server.url)
    server.break_after, server.data = None, DATA[::-1]
    assert fetch(server.url).read_bytes() == DATA[::-1]
    assert server.asked == [None, "bytes=300000-"]


def test_a_whole_file_in_place_of_the_rest_is_not_appended(server: Server, folder: Path) -> None:
    server.break_after = 300_000
    with pytest.raises(RuntimeError, match="fetch again to resume"):
        fetch(server.url)
    server.break_after, server.whole = None, True
    with pytest.raises(RuntimeError, match="cannot be resumed, fetch it again"):
        fetch(server.url)
    assert read_index(folder) == {}
    assert fetch(server.url).read_bytes() == DATA


@pytest.mark.parametrize("length", [True, False])
def test_what_is_no_model_by_its_size_is_refused(
    server: Server, folder: Path, monkeypatch: pytest.MonkeyPatch, length: bool
) -> None:
    server.length = length
    monkeypatch.setattr(models, "LARGEST", 1_000_000)
    with pytest.raises(InputError, match="bytes, expected"):
        fetch(server.url)
    server.data = b""
    with pytest.raises(RuntimeError, match="the server sent an empty file"):
        fetch(server.url, name="empty.onnx")
    assert read_index(folder) == {}
    assert not list(folder.glob("*.onnx"))


@pytest.mark.parametrize("address", ["ftp://127.0.0.1/net.onnx", "file:///etc/hostname"])
def test_a_server_leads_to_no_other_scheme(server: Server, folder: Path, address: str) -> None:
    server.redirect = address
    with pytest.raises(RuntimeError, match=r"another scheme|not allowed"):
        fetch(server.url)
    assert read_index(folder) == {}


def test_passwords_are_neither_printed_nor_kept(server: Server, folder: Path) -> None:
    result = run("models", "fetch", server.url.replace("http://", "http://me:secret@"))
    assert result.exit_code == 2
    assert "secret" not in result.output and "expected one without" in result.stderr
    assert not folder.exists()


def test_a_planted_link_is_not_followed(server: Server, folder: Path, tmp_path: Path) -> None:
    folder.mkdir()
    mine = tmp_path / "mine"
    mine.write_text("mine")
    (folder / ".net.onnx.partial").symlink_to(mine)
    with pytest.raises(OSError, match="symbolic links"):
        fetch(server.url)
    assert mine.read_text() == "mine"


def test_another_file_at_the_old_address_is_refused(server: Server, folder: Path) -> None:
    fetch(server.url).unlink()
    server.data = DATA + b"more"
    with pytest.raises(InputError, match=r"sha256 is .* expected .* as when it was first fetched"):
        fetch(server.url)
    assert [file.name for file in folder.iterdir()] == ["index.json"]
    server.data = DATA
    assert fetch(server.url).read_bytes() == DATA


def test_names_do_not_collide(server: Server, folder: Path) -> None:
    fetch(server.url)
    other = server.url.replace("models", "others")
    with pytest.raises(InputError, match=r"was fetched from .*; expected another --name"):
        fetch(other)
    assert fetch(other, name="other.onnx").name == "other.onnx"
    (folder / "mine.onnx").write_bytes(b"mine")
    with pytest.raises(InputError, match=r"mine\.onnx exists, but was not fetched"):
        fetch(server.url, name="mine.onnx")
    assert (folder / "mine.onnx").read_bytes() == b"mine"


@pytest.mark.parametrize("name", ["../net.onnx", ".hidden", "index.json", "a/b.onnx"])
def test_names_stay_in_the_folder(server: Server, folder: Path, name: str) -> None:
    with pytest.raises(InputError, match="cannot be the name of a model file"):
        fetch(server.url, name=name)
    assert not folder.exists()


def test_addresses_are_checked(folder: Path) -> None:
    for url in (
        "file:///etc/hostname",
        "depth",
        "ftp://host/a.onnx",
        "https://",
        "http://host/a b.onnx",
    ):
        with pytest.raises(InputError, match=f"{re.escape(url)}' is neither an http"):
            fetch(url)
    with pytest.raises(InputError, match=r"no address .* depth-pro; see https://github\.com/apple"):
        fetch("depth-pro")


def test_network_that_is_not_there_is_one_line(server: Server, folder: Path) -> None:
    nobody = server.url.replace("127.0.0.1", "no-such-host.invalid")
    for url, problem in ((nobody, "cannot be reached"), (server.url + "missing", ": 404 ")):
        result = run("models", "fetch", url)
        assert result.exit_code == 1, result.output
        assert problem in result.stderr
        assert result.stderr.startswith("error: ")
        assert result.stderr.count("\n") == 1
        assert result.stdout == ""
    assert verify() == {}


def test_commands(server: Server, folder: Path) -> None:
    result = run("models", "fetch", server.url, "--name", "net.onnx")
    assert (result.exit_code, result.stdout) == (0, f"{folder / 'net.onnx'}\n")
    listed = run("models", "list").stdout
    assert all(f"  {name} (" in listed for name in RECIPES)
    assert f"net.onnx  sha256 {hashlib.sha256(DATA).hexdigest()}  {server.url}" in listed
    assert run("models", "verify").exit_code == 0
    (folder / "net.onnx").unlink()
    result = run("models", "verify")
    assert result.exit_code == 1
    assert result.stdout == "net.onnx: missing\n1 files, 1 not as they were fetched\n"


@pytest.mark.parametrize("text", ["", "[]", '{"format": "other"}', '{"files": {"a": {}}}'])
def test_index_that_is_none_is_named(folder: Path, text: str) -> None:
    folder.mkdir()
    (folder / "index.json").write_text(text)
    with pytest.raises(InputError, match=r"index\.json: not an index of models"):
        verify()


def test_every_recipe_names_its_source() -> None:
    for shipped in RECIPES.values():
        assert shipped.source.startswith("https://")
        assert shipped.licence
