"""Footage behind a URL (``s3://bucket/visible``, ``zip://visible::drive.zip``), by fsspec.

The names of a folder are there at once, in a folder of this process; what is in a file comes when
it is read, and goes again when there is too much. The extra ``xcalib-rgbt[remote]``.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib
import os
import re
import shutil
import tempfile
import threading
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ._core import InputError, fingerprint
from .cache import cache_folder

MOST_BYTES = 1 << 30
"""Of files of folders, at a time."""
AT_ONCE = {".csv", ".txt", ".yaml", ".yml", ".json"}
"""Tables beside frames are small, and many readers look for them."""


def is_url(spec: str | Path) -> bool:
    """Whether it names something behind a URL; ``file://`` too."""
    return re.match(r"[a-z][a-z0-9+.-]+://", str(spec)) is not None


def file_system(url: str) -> tuple[Any, str]:
    """The file system of a URL and the path in it, or `InputError`."""
    try:
        fsspec = importlib.import_module("fsspec")
    except ImportError:
        raise InputError(
            f"{url}: URLs need the package fsspec, expected `pip install xcalib-rgbt[remote]`"
        ) from None
    scheme = url.partition("://")[0]
    try:
        files, path = fsspec.core.url_to_fs(url)
    except (ImportError, ValueError) as error:
        raise InputError(
            f"{url}: the scheme {scheme}:// is not installed ({' '.join(str(error).split())});"
            " cameras are read by `xcalib-cli register --live`"
        ) from None
    except Exception as error:  # each file system has errors of its own
        raise InputError(f"{url}: {_brief(error)}") from None
    return files, path


def child(url: str, name: str) -> str:
    """The URL of something in the folder of another."""
    first, chain, rest = url.partition("::")
    return f"{first.rstrip('/')}/{name}{chain}{rest}"


@dataclass(frozen=True)
class _Remote:
    files: Any
    path: str
    url: str
    size: int
    mark: str
    """Changes with what is in it."""


_lock = threading.RLock()
_known: dict[Path, _Remote] = {}
_here: OrderedDict[Path, int] = OrderedDict()
_folders: dict[str, Path] = {}


def local_name(spec: str | Path) -> str | Path:
    """A name on this machine for what a URL names; other names as they are.

    A folder's files have no contents before `fetch`; a file is fetched now, once a machine.
    """
    if not is_url(spec):
        return spec
    url, topic, part = str(spec), "", ""
    files, path = file_system(url)
    try:
        if "#" in url and not files.exists(path):
            url, topic, part = url.rpartition("#")
            files, path = file_system(url)
        if not files.exists(path):
            raise InputError(f"{spec}: no such file or folder")
        local = _folder(url, files, path) if files.isdir(path) else _file(url, files, path)
    except InputError:
        raise
    except Exception as error:  # each file system has errors of its own
        raise InputError(f"{spec}: {_brief(error)}") from None
    return f"{local}{topic}{part}" if topic else local


def fetch(path: Path) -> None:
    """Have the contents of a file of a remote folder here; nothing for other files."""
    if not _known:
        return
    with _lock:
        remote = _known.get(path)
        if remote is None:
            return
        if path in _here:
            _here.move_to_end(path)
            return
    partial = path.with_name(f".{path.name}.{threading.get_ident()}")
    try:
        remote.files.get_file(remote.path, str(partial))
    except Exception as error:  # each file system has errors of its own
        partial.unlink(missing_ok=True)
        raise OSError(f"{remote.url}: {_brief(error)}") from None
    with _lock:
        partial.replace(path)
        _here[path] = remote.size
        while sum(_here.values()) > MOST_BYTES and len(_here) > 1:
            oldest, _ = _here.popitem(last=False)
            _make_empty(oldest)


def identity(path: Path) -> Path:
    """What stands for a file of a remote folder where it is asked whether it has changed: a name
    that is no file's, the same on every machine.
    """
    remote = _known.get(path) if _known else None
    return path if remote is None else Path(f"{remote.url} {remote.size} {remote.mark}")


def shown(path: Path) -> str:
    """A path for messages."""
    remote = _known.get(path) if _known else None
    return str(path) if remote is None else remote.url


@contextlib.contextmanager
def named(path: Path) -> Iterator[None]:
    """Fetch a file, and have errors within name its URL."""
    fetch(path)
    try:
        yield
    except ValueError as error:
        if path not in _known:
            raise
        raise type(error)(str(error).replace(str(path), shown(path))) from None


def _folder(url: str, files: Any, path: str) -> Path:
    with _lock:
        if url in _folders:
            return _folders[url]
        folder = Path(tempfile.mkdtemp(prefix="xcalib-remote-")) / (
            path.rstrip("/").rpartition("/")[2] or "root"
        )
        atexit.register(shutil.rmtree, folder.parent, ignore_errors=True)
        folder.mkdir()
        for info in files.ls(path, detail=True):
            name = info["name"].rstrip("/").rpartition("/")[2]
            if info["type"] != "file" or not name or name in (".", ".."):
                continue
            local = folder / name
            _known[local] = _Remote(
                files, info["name"], child(url, name), int(info.get("size") or 0), _mark(info)
            )
            _make_empty(local)
            if local.suffix.lower() in AT_ONCE:
                fetch(local)
        _folders[url] = folder
        return folder


def _make_empty(path: Path) -> None:
    """A file of this name; who has opened what it was can read on."""
    partial = path.with_name(f".{path.name}.empty")
    partial.touch()
    partial.replace(path)


def _file(url: str, files: Any, path: str) -> Path:
    """The file, in the user's cache: videos and networks are read over and over."""
    info = files.info(path)
    mark = fingerprint(f"{url} {info.get('size')} {_mark(info)}")
    local = cache_folder() / "remote" / mark / path.rpartition("/")[2]
    if not local.is_file():
        local.parent.mkdir(parents=True, exist_ok=True)
        partial = local.with_name(f".{local.name}.{os.getpid()}.{threading.get_ident()}")
        try:
            files.get_file(path, str(partial))
            seconds = int(mark, 16) % 10**9  # what is the same everywhere: no date
            os.utime(partial, (seconds, seconds))
            partial.replace(local)
        finally:
            partial.unlink(missing_ok=True)
    return local


def _mark(info: dict[str, Any]) -> str:
    """What of an entry changes with its contents."""
    for name in ("ETag", "etag", "md5", "CRC", "mtime", "LastModified", "date_time", "created"):
        if info.get(name) is not None:
            return fingerprint(f"{name} {info[name]}")
    return ""


def _brief(error: BaseException) -> str:
    return " ".join(str(error).split())[:300] or type(error).__name__
