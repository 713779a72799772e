"""Journals that others have written, or nobody should have."""

from __future__ import annotations

from table import REGISTER, Content, Row

FIRST = '{"format":"xcalib-register","version":1,"made_with":{"command":"xcalib"}}\n'
NONE = "out/register.jsonl: not a journal of format xcalib-register, version 1"


def journal(
    name: str, text: Content, message: str = NONE, more: str = "", code: int = 2, **files: Content
) -> Row:
    given: dict[str, Content] = {"out/register.jsonl": text}
    return Row(f"journal-{name}", REGISTER + more, message, files=given | files, code=code)


ROWS = [
    journal("words", "no\n"),
    journal("empty-object", "{}\n"),
    journal("list", "[]\n"),
    journal("null", "null\n"),
    journal("other-format", '{"format":"x","version":1,"made_with":{}}\n'),
    journal("other-version", FIRST.replace("1,", "99,", 1)),
    journal("made-with-list", FIRST.replace('{"command":"xcalib"}', "[]")),
    journal(
        "made-with-numbers", FIRST.replace('"xcalib"}', "1}"), "this output was made otherwise"
    ),
    journal("binary", bytes(range(256)) + b"\n"),
    journal("deep", FIRST + "[" * 100000 + "\n"),
    journal("deep-unit", FIRST + '{"frames":' + '{"a":' * 50000 + "\n"),
    journal("unit-is-a-number", FIRST + "7\n"),
    journal("no-frames", FIRST + '{"files":{"0.png":1}}\n'),
    journal("no-files", FIRST + '{"frames":{"a":1}}\n'),
    journal("count-is-text", FIRST + '{"frames":{"a":"b"},"files":{"0.png":1}}\n'),
    journal("count-is-infinite", FIRST + '{"frames":{"a":1e999},"files":{"0.png":1}}\n'),
    journal("size-is-a-list", FIRST + '{"frames":{"a":1},"files":{"0.png":[1]}}\n'),
    journal("file-above", FIRST + '{"frames":{"a":1},"files":{"../rig.yaml":1}}\n'),
    journal("file-from-the-root", FIRST + '{"frames":{"a":1},"files":{"/etc/passwd":1}}\n'),
    journal("file-deep", FIRST + '{"frames":{"a":1},"files":{"a/b/c.png":1}}\n'),
    journal(
        "file-above-overwrite",
        FIRST + '{"frames":{"a":1},"files":{"../rig.yaml":1}}\n',
        more=" --overwrite",
    ),
    journal("otherwise", FIRST, "this output was made otherwise (", files=""),
    Row(
        "journal-folder",
        REGISTER,
        "out/register.jsonl is no file, expected a journal",
        files={"out/register.jsonl/x": ""},
    ),
    Row(
        "journal-pipe",
        "register rig.yaml visible thermal --depth depth -o .",
        "register.jsonl is no file, expected a journal",
        pipes=("register.jsonl",),
    ),
    Row(
        "journal-link",
        REGISTER,
        "out/register.jsonl is no file",
        files={"mine.jsonl": "mine"},
        links={"out/register.jsonl": "../mine.jsonl"},
    ),
]
