"""What ONNX Runtime says of a graph that fails, in words that say what to do."""

from __future__ import annotations

import re

SIZES = (
    "the usual cause is an image size that it was not made for: of depth networks `size` and"
    " `multiple` in the .yaml file beside the model set it"
)

OPENING: tuple[tuple[str, str], ...] = (
    (
        r"[Ee]xternal data",
        "a file of its weights is missing or not readable beside it ({0}); fetch that too, and keep"
        " its name",
    ),
    (
        r"not a registered function/op",
        "needs operators that ONNX Runtime does not have: {0}",
    ),
    (
        r"(?:INVALID_PROTOBUF|No graph was found)",
        "not an ONNX model, or truncated",
    ),
    (
        r"Unsupported model IR version: (\d+), max supported IR version: (\d+)",
        "is of ONNX's IR version {1}, this ONNX Runtime reads up to {2}; expected a newer"
        " onnxruntime, or an older export",
    ),
    (
        r"Opset (\d+) is under development.*?till opset (\d+)",
        "is of opset {1}, this ONNX Runtime knows up to {2}; expected a newer onnxruntime, or an"
        " export of an older opset",
    ),
    (
        r"Could not find an implementation for (\S+?)\(\d+\)",
        "its operator {1} is not there for the types in the graph, or for this provider; expected"
        " an export in float32, or `--providers cpu`",
    ),
    (
        r"(?:INVALID_GRAPH|Type Error|Invalid model\.)",
        "its graph is not valid ({0}); export it again",
    ),
    (
        r"(?:[Ff]ailed to allocate memory|bad_alloc|out of memory)",
        "does not fit into memory",
    ),
)
"""Patterns, and what stands for them: {0} is what ONNX Runtime says, {1} ... are the groups."""

RUNNING: tuple[tuple[str, str], ...] = (
    (
        r"Got invalid dimensions for input.*?index: (\d+) Got: (\d+) Expected: (\d+)",
        "axis {1} of its input is fixed at {3}, it was given {2}",
    ),
    (
        r"(?:[Ff]ailed to allocate memory|bad_alloc|out of memory)",
        "out of memory; a smaller `size` in the .yaml file beside the model takes less",
    ),
    (
        r"while running (\S+) node\. Name:'([^']*)'",
        "its step {1} '{2}' fails ({0}); " + SIZES,
    ),
)


def brief(message: str) -> str:
    """What ONNX Runtime says, without its error codes, and the places in its sources."""
    text = " ".join(message.split(" : ", 3)[-1].split()).split("Status Message: ")[-1]
    # A file, a line, and the function; often what was tested too.
    text = re.sub(r"/\S+\.(?:cc|h):\d+ .*(?: was false\. |\) )", "", text)
    return text.rstrip(". ")[:300]


def in_words(message: str, known: tuple[tuple[str, str], ...]) -> str:
    """The words for the first pattern that is in a message; its own where none is."""
    line = " ".join(message.split())
    for pattern, words in known:
        found = re.search(pattern, line)
        if found:
            return words.format(brief(message), *found.groups())
    return brief(message)
