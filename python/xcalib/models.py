"""Model files: fetched once, checked after that.

The model folder holds the files and ``index.json``, which names where each came from and the hash
it had when it came. There is no list of hashes to compare with: the first fetch is trusted, and
later changes are found.
"""

from __future__ import annotations

import http.client
import json
import os
import shutil
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from ._core import keep_file, read_text
from .cache import file_hash
from .depth.recipes import RECIPES
from .frames import InputError, write_bytes

CHUNK = 1 << 20
TIMEOUT = 30
"""Without a byte for this long a transfer has failed [s]."""
LARGEST = 16 << 30
"""No model file is larger; a server that goes on sending is cut off here [bytes]."""


class Redirects(urllib.request.HTTPRedirectHandler):
    """Follows a server to other addresses of http(s) only, and never from https to http."""

    def redirect_request(
        self, req: urllib.request.Request, fp: Any, code: int, msg: str, headers: Any, newurl: str
    ) -> urllib.request.Request | None:
        """The request to the new address."""
        scheme = urlsplit(newurl).scheme
        if scheme not in ("http", "https") or (req.type == "https" and scheme != "https"):
            raise urllib.error.URLError(f"it leads to another scheme, {scheme}")
        return super().redirect_request(req, fp, code, msg, headers, newurl)


def model_folder() -> Path:
    """``XCALIB_MODELS``, or ``xcalib/models`` in the user's data folder (``XDG_DATA_HOME``)."""
    given = os.environ.get("XCALIB_MODELS")
    if given:
        return Path(given)
    data = os.environ.get("XDG_DATA_HOME")
    return (Path(data) if data else Path.home() / ".local" / "share") / "xcalib" / "models"


def read_index(folder: Path) -> dict[str, dict[str, Any]]:
    """What is known of the files of a model folder: name -> url, sha256, bytes."""
    path = folder / "index.json"
    if not path.exists():
        return {}
    try:
        index = json.loads(read_text(path))
        files = index["files"]
        good = index["format"] == "xcalib-models" and all(
            isinstance(files[name]["url"], str) and isinstance(files[name]["sha256"], str)
            for name in files
        )
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        good = False
    if not good:
        raise InputError(f"{path}: not an index of models (format xcalib-models)")
    return dict(files)


def fetch(
    url: str,
    folder: Path | None = None,
    name: str | None = None,
    show: Callable[[int, int | None], None] | None = None,
) -> Path:
    """Download a file into the model folder, or resume that, and return its path.

    A file that is already there is only checked.

    Parameters
    ----------
    url
        Address, http or https.
    folder
        Model folder; None is the user's.
    name
        Name for the file; None takes the address' own.
    show
        Called with the bytes so far, and in all if that is known.

    Raises
    ------
    InputError
        An address or a name that cannot be used, or a file that is not the one first fetched.
    RuntimeError
        The network is not there, or the transfer failed; what came is kept to be resumed.
    """
    if url in RECIPES:
        raise InputError(
            f"no address of ONNX weights is confirmed for {url}; see {RECIPES[url].source}"
            " and give the file's own address"
        )
    parts = urlsplit(url)
    plain = url.isascii() and url.isprintable() and " " not in url  # as urllib wants it
    if "@" in parts.netloc:
        raise InputError(
            f"the address at {parts.netloc.rpartition('@')[2]} has a name or a password in it,"
            " which would be printed and kept; expected one without"
        )
    if parts.scheme not in ("http", "https") or not parts.netloc or not plain:
        known = ", ".join(RECIPES)
        raise InputError(f"{url!r} is neither an http(s) address nor one of {known}")
    name = name or unquote(parts.path).rsplit("/", 1)[-1]
    if not name or name.startswith(".") or Path(name).name != name or name == "index.json":
        raise InputError(f"{name!r} cannot be the name of a model file, expected --name FILE")
    folder = folder or model_folder()
    path = folder / name
    index = read_index(folder)
    known_hash = index.get(name, {}).get("sha256")
    if path.exists():
        if known_hash is None:
            raise InputError(f"{path} exists, but was not fetched; expected another --name")
        if index[name]["url"] != url:
            raise InputError(
                f"{path} was fetched from {index[name]['url']}; expected another --name"
            )
        _check(path, known_hash)
        return path

    folder.mkdir(parents=True, exist_ok=True)
    # Not discarded where the transfer fails: the next one resumes it.
    partial = folder / f".{name}.partial"
    _transfer(url, partial, show)
    if not partial.stat().st_size:
        partial.unlink()
        raise RuntimeError(f"{url}: the server sent an empty file")
    found = file_hash(partial)
    if known_hash is not None and found != known_hash:
        partial.unlink()
        raise InputError(
            f"{url}: sha256 is {found}, expected {known_hash} as when it was first fetched"
        )
    index[name] = {"url": url, "sha256": found, "bytes": partial.stat().st_size}
    document = {"format": "xcalib-models", "version": 1, "files": index}
    write_bytes(folder / "index.json", (json.dumps(document, indent=2) + "\n").encode())
    keep_file(partial, path)
    return path


def verify(folder: Path | None = None) -> dict[str, str]:
    """Hash every fetched file again: name -> ``ok``, ``changed`` or ``missing``."""
    folder = folder or model_folder()
    states = {}
    for name, entry in read_index(folder).items():
        path = folder / name
        if not path.is_file():
            states[name] = "missing"
        else:
            states[name] = "ok" if file_hash(path) == entry["sha256"] else "changed"
    return states


def _check(path: Path, expected: str) -> None:
    found = file_hash(path)
    if found != expected:
        raise InputError(
            f"{path}: sha256 is {found}, expected {expected} as when it was first fetched;"
            " remove the file to fetch it again"
        )


def _continues(content_range: str, have: int) -> bool:
    """Whether a part of a file begins where what came before ends."""
    return content_range.replace("bytes ", "", 1).startswith(f"{have}-")


def _check_room(url: str, total: int, partial: Path) -> None:
    free = shutil.disk_usage(partial.parent).free
    if total > min(LARGEST, free):
        raise InputError(
            f"{url}: {total} bytes, expected at most {LARGEST}, and what the disk has free: {free}"
        )


def _without_links(name: str, flags: int) -> int:
    """Open a file that may not be a link to another."""
    return os.open(name, flags | os.O_NOFOLLOW, 0o666)


def _transfer(url: str, partial: Path, show: Callable[[int, int | None], None] | None) -> None:
    """Append to ``partial`` what it lacks, or start over where the server has another file now."""
    tag = partial.with_name(f"{partial.name}.etag")
    request = urllib.request.Request(url)
    have = partial.stat().st_size if partial.exists() and tag.exists() else 0
    if have:
        # Without the same entity tag the server sends the whole file.
        request.add_header("Range", f"bytes={have}-")
        request.add_header("If-Range", tag.read_text(encoding="utf-8"))
    try:
        with urllib.request.build_opener(Redirects).open(request, timeout=TIMEOUT) as response:
            if response.status != 206:
                have = 0
            elif not _continues(response.headers.get("Content-Range", ""), have):
                partial.unlink()
                raise RuntimeError(f"{url}: cannot be resumed, fetch it again")
            length = response.headers.get("Content-Length", "")
            total = have + int(length) if length.isdecimal() else None
            _check_room(url, total or 0, partial)
            mode = "ab" if have else "wb"
            # Only a strong tag promises the same bytes.
            etag = response.headers.get("ETag", "")
            tag.unlink(missing_ok=True)
            if etag and not etag.startswith("W/"):
                write_bytes(tag, etag.encode())
            with open(partial, mode, opener=_without_links) as file:
                while chunk := response.read1(CHUNK):
                    file.write(chunk)
                    have += len(chunk)
                    if have > LARGEST:
                        raise InputError(f"{url}: more than {LARGEST} bytes, expected a model file")
                    if show:
                        show(have, total)
    except urllib.error.HTTPError as error:
        if error.code == 416:  # nothing is left to send, or the file has become shorter
            partial.unlink(missing_ok=True)
            tag.unlink(missing_ok=True)
            raise RuntimeError(f"{url}: cannot be resumed, fetch it again") from None
        raise RuntimeError(f"{url}: {error.code} {error.reason}") from None
    except urllib.error.URLError as error:
        raise RuntimeError(f"{url}: cannot be reached: {error.reason}") from None
    except (TimeoutError, ConnectionError, http.client.HTTPException) as error:
        raise RuntimeError(
            f"{url}: transfer broke off after {have} bytes ({error}); fetch again to resume"
        ) from None
    if total is not None and have != total:
        raise RuntimeError(
            f"{url}: transfer broke off after {have} of {total} bytes; fetch again to resume"
        )
    tag.unlink(missing_ok=True)
