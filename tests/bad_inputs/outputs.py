"""Outputs that would replace what is read, what others have made, or what is no file."""

from __future__ import annotations

from table import CALIBRATE, EVALUATE, REGISTER, Row

HERE = "visible thermal --depth depth"
SCENE = "register rig.yaml visible thermal --depth depth -o"
AN_INPUT = "is an input"
A_FOLDER = "is an input folder, expected another"
OTHERS = "does not say that a run made it; expected another output, or --overwrite"


ROWS = [
    # -- register: over the frames
    Row("o-source", f"{SCENE} thermal", f"thermal {A_FOLDER}"),
    Row("o-reference", f"{SCENE} visible", f"visible {A_FOLDER}"),
    Row("o-depth", f"{SCENE} depth", f"depth {A_FOLDER}"),
    Row("o-source-slash", f"{SCENE} thermal/", A_FOLDER),
    Row("o-source-dots", f"{SCENE} out/../thermal", A_FOLDER, files={"out/x": ""}),
    Row("o-source-link", f"{SCENE} link", f"link {A_FOLDER}", links={"link": "thermal"}),
    Row("o-source-overwrite", f"{SCENE} thermal --overwrite", A_FOLDER),
    Row(
        "o-pattern",
        "register rig.yaml visible 'thermal/*.png' --depth depth -o thermal",
        f"thermal {A_FOLDER}",
    ),
    Row(
        "o-pgm",
        "register rig.yaml visible gray --depth depth -o gray",
        f"gray {A_FOLDER}",
        files={f"gray/{i}.pgm": b"P5 48 36 255\n" + bytes(48 * 36) for i in (0, 1)},
    ),
    Row(
        "o-number-pattern",
        "register rig.yaml visible/%d.png thermal --depth depth -o visible",
        f"visible {A_FOLDER}",
    ),
    Row(
        "o-above-masks",
        "register rig.yaml visible masks --depth depth -o .",
        f"masks {A_FOLDER}",
        links={"masks": "thermal"},
    ),
    Row(
        "o-above-overlays",
        "register rig.yaml overlays thermal --depth depth -o . --overlay",
        f"overlays {A_FOLDER}",
        links={"overlays": "visible"},
    ),
    Row(
        "o-image-through-link",
        f"{SCENE} out --overwrite",
        f"out/0.png would be overwritten, but {AN_INPUT}",
        links={"out/0.png": "../thermal/0.png"},
    ),
    Row(
        "o-video-itself",
        "register rig.yaml w.mkv#left w.mkv#right --depth plane -o w.mkv --overwrite",
        f"w.mkv would be overwritten, but {AN_INPUT}",
    ),
    Row(
        "o-video-masks",
        "register rig.yaml w.mkv#left o.masks.mkv#left --depth plane -o o.mkv --overwrite",
        f"o.masks.mkv would be overwritten, but {AN_INPUT}",
        links={"o.masks.mkv": "w.mkv"},
    ),
    Row(
        "o-video-overlay",
        "register rig.yaml o.overlay.mkv#left w.mkv#right --depth plane -o o.mkv --overlay",
        f"o.overlay.mkv would be overwritten, but {AN_INPUT}",
        links={"o.overlay.mkv": "w.mkv"},
    ),
    Row(
        "o-journal-is-the-rig",
        "register out/register.jsonl visible thermal --depth depth -o out",
        f"register.jsonl would be overwritten, but {AN_INPUT}",
        links={"out/register.jsonl": "../rig.yaml"},
    ),
    # -- register: over what others have made
    Row(
        "o-others-image",
        REGISTER,
        f"out/0.png is there, and out/register.jsonl {OTHERS}",
        files={"out/0.png": "mine"},
    ),
    Row(
        "o-others-mask",
        REGISTER,
        f"out/masks/1.png is there, and out/register.jsonl {OTHERS}",
        files={"out/masks/1.png": "mine"},
    ),
    Row(
        "o-others-video",
        f"{SCENE} o.mkv",
        f"o.mkv is there, and o.mkv.register.jsonl {OTHERS}",
        files={"o.mkv": "mine"},
    ),
    Row(
        "o-others-masks",
        f"{SCENE} o.mp4",
        f"o.masks.mkv is there, and o.mp4.register.jsonl {OTHERS}",
        files={"o.masks.mkv": "mine"},
    ),
    Row(
        "o-others-overlay",
        f"{SCENE} o.mp4 --overlay",
        "o.overlay.mp4 is there, and ",
        files={"o.overlay.mp4": "mine"},
    ),
    Row(
        "o-shared-masks",
        f"{SCENE} o.avi --overwrite",
        "o.avi would share o.masks.mkv with ./o.mp4, expected another name",
        files={"o.mp4": "x", "o.masks.mkv": "x", "o.mp4.register.jsonl": "{}\n"},
    ),
    Row(
        "o-parts-are-a-file",
        f"{SCENE} o.mkv",
        "o.mkv.parts is no folder",
        files={"o.mkv.parts": "mine"},
    ),
    Row(
        "o-parts-are-a-link",
        f"{SCENE} o.mkv",
        "o.mkv.parts is no folder",
        links={"o.mkv.parts": "thermal"},
    ),
    # -- register: no folder and no video
    Row("o-empty", f"{SCENE} ''", "cannot write to '': the name is empty"),
    Row("o-image-name", f"{SCENE} o.png", "cannot write to o.png: a video is .mp4, .avi or .mkv"),
    Row("o-other-video-name", f"{SCENE} o.mov", "cannot write to o.mov: a video is .mp4"),
    Row("o-rig-name", f"{SCENE} new.yaml", "cannot write to new.yaml: a video is .mp4"),
    Row("o-device", f"{SCENE} /dev/null", "cannot write to /dev/null: /dev/null is a file"),
    Row("o-a-file", f"{SCENE} some", "is a file, expected a folder", files={"some": "x"}),
    Row("o-below-a-file", f"{SCENE} some/out", "is a file, expected a folder", files={"some": "x"}),
    Row("o-proc", f"{SCENE} /proc/out", "cannot write to /proc/out: /proc: "),
    Row("o-video-link", f"{SCENE} link.mkv", "link.mkv: it is a link", links={"link.mkv": "w.mkv"}),
    Row("o-video-nowhere", f"{SCENE} link.mkv", "leads nowhere", links={"link.mkv": "none"}),
    Row("o-video-pipe", f"{SCENE} pipe.mkv", "it is a pipe or a device", pipes=("pipe.mkv",)),
    Row("o-equals", f"{SCENE[:-3]} -o=out", "cannot write to =out: expected -o out (./=out is a"),
    Row("o-missing", f"register rig.yaml {HERE}", "--output"),
    # -- evaluate --json
    Row(
        "json-image",
        f"{EVALUATE} --json thermal/0.png",
        f"thermal/0.png would be overwritten, but {AN_INPUT}",
    ),
    Row(
        "json-depth",
        f"{EVALUATE} --json depth/1.png",
        f"depth/1.png would be overwritten, but {AN_INPUT}",
    ),
    Row(
        "json-rig", f"{EVALUATE} --json rig.yaml", f"rig.yaml would be overwritten, but {AN_INPUT}"
    ),
    Row("json-rig-dots", f"{EVALUATE} --json visible/../rig.yaml", f"but {AN_INPUT} (rig.yaml)"),
    Row(
        "json-link",
        f"{EVALUATE} --json link.json",
        f"but {AN_INPUT} (rig.yaml)",
        links={"link.json": "rig.yaml"},
    ),
    Row(
        "json-times",
        f"{EVALUATE} --reference-times t.csv --pair order --json t.csv",
        f"t.csv would be overwritten, but {AN_INPUT}",
        files={"t.csv": "0 0.0\n1 1.0\n"},
    ),
    Row(
        "json-table-of-folder",
        f"{EVALUATE} --pair order --json visible/timestamps.csv",
        f"but {AN_INPUT}",
        files={"visible/timestamps.csv": "0 0.0\n1 1.0\n"},
    ),
    Row("json-empty", f"{EVALUATE} --json ''", "cannot write to '': the name is empty"),
    Row("json-folder", f"{EVALUATE} --json visible", "cannot write to visible: it is a folder"),
    Row("json-new-folder", f"{EVALUATE} --json new/", "cannot write to new/: that names a folder"),
    Row(
        "json-nowhere", f"{EVALUATE} --json link", "link that leads nowhere", links={"link": "none"}
    ),
    Row("json-below-a-file", f"{EVALUATE} --json rig.yaml/x", "is a file, expected a folder"),
    Row(
        "json-pipe-unread",
        f"{EVALUATE} --json pipe",
        "cannot write to pipe: nobody reads this pipe",
        pipes=("pipe",),
    ),
    Row("json-proc", f"{EVALUATE} --json /proc/x.json", "cannot write to /proc: /proc: "),
    # -- calibrate
    Row(
        "rig-image",
        f"calibrate {HERE} -o visible/0.png",
        f"visible/0.png would be overwritten, but {AN_INPUT}",
    ),
    Row(
        "rig-initial",
        f"calibrate {HERE} --initial rig.yaml -o rig.yaml",
        f"rig.yaml would be overwritten, but {AN_INPUT}",
    ),
    Row(
        "rig-link",
        f"calibrate {HERE} -o link",
        f"but {AN_INPUT} (thermal/1.png)",
        links={"link": "thermal/1.png"},
    ),
    Row("rig-equals", f"calibrate {HERE} -o=r.yaml", "cannot write to =r.yaml: expected -o r.yaml"),
    Row("rig-empty", f"calibrate {HERE} -o ''", "cannot write to '': the name is empty"),
    Row("rig-folder", f"calibrate {HERE} -o visible", "it is a folder, expected a file name"),
    Row("rig-new-folder", f"calibrate {HERE} -o new/", "that names a folder, expected a file name"),
    Row(
        "report-image",
        f"{CALIBRATE} --report depth/0.png",
        f"depth/0.png would be overwritten, but {AN_INPUT}",
    ),
    Row("report-is-the-rig", f"{CALIBRATE} --report new.yaml", "new.yaml would be written twice"),
    Row(
        "report-is-the-rig-otherwise",
        f"{CALIBRATE} --report visible/../new.yaml",
        "would be written twice",
    ),
    Row(
        "report-is-initial", f"{CALIBRATE} --initial rig.yaml --report rig.yaml", f"but {AN_INPUT}"
    ),
    Row("report-empty", f"{CALIBRATE} --report ''", "cannot write to '': the name is empty"),
    Row("report-new-folder", f"{CALIBRATE} --report new/", "that names a folder"),
]
