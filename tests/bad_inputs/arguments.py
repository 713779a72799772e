"""Arguments out of their ranges, and commands that do not go together."""

from __future__ import annotations

from table import CALIBRATE, EVALUATE, INSPECT, REGISTER, Row


def option(command: str, given: str, message: str = "") -> Row:
    """The message names the option, unless it is another."""
    flag = given.split()[0]
    return Row(
        f"{command.split()[0]}-{given.replace(' ', '=')}", f"{command} {given}", message or flag
    )


ROWS = [
    *(
        option(REGISTER, given)
        for given in (
            "--threads 1e20",
            "--threads 100000000000000000000",
            "--threads 8000",
            "--threads -1",
            "--threads two",
            "--occlusion maybe",
            "--pair best",
            "--max-gap 0",
            "--max-gap -1",
            "--max-gap wide",
            "--time-offset soon",
            "--time-offset inf",
            "--time-offset nan",
            "--source-readout 2",
            "--source-readout auto",
            "--reference-readout soon",
            "--no-such-option",
            "--far",
        )
    ),
    *(
        option(REGISTER.replace("depth -o", "plane -o"), given, message)
        for given, message in (
            ("--far 0", "far"),
            ("--far nan", "far"),
            ("--camera-height -1", "height"),
            ("--camera-height 1e400", "height"),
            ("--horizon nan", "horizon"),
            ("--plane-hfov 0", "hfov"),
            ("--plane-hfov 180", "hfov"),
            ("--plane-roll inf", "roll"),
        )
    ),
    option(REGISTER, "--depth-scale 0", "depth scale is 0, expected above 0 m per count"),
    option(REGISTER, "--depth-scale -1", "depth scale is -1, expected above 0 m per count"),
    option(REGISTER, "--depth-scale nan", "depth scale is nan, expected above 0 m per count"),
    option(REGISTER, "--complete --completion-confidence 2", "confidence"),
    *(
        option(EVALUATE, given)
        for given in ("--width 0", "--width 1e9", "--width 99999999999", "--threads 1025")
    ),
    option(EVALUATE, "--source-colormap none-such", "none-such"),
    *(
        option(CALIBRATE, given, message)
        for given, message in (
            ("--frames 0", "--frames"),
            ("--frames -3", "--frames"),
            ("--frames 100000000000000000000", "--frames"),
            ("--seed -1", "--seed"),
            ("--seed 4294967296", "--seed"),
            ("--threads 4096", "--threads"),
            ("--choose best", "--choose"),
            ("--search far", "--search"),
            ("--solver magic", "--solver"),
            ("--mount sideways", "sideways"),
            ("--max-roll 181", "roll"),
            ("--max-fov-ratio 1", "fov"),
            ("--max-fov-ratio nan", "fov"),
            ("--reference-hfov 0", "hfov"),
            ("--reference-hfov 180", "hfov"),
            ("--reference-intrinsics 1,2,3", "four numbers FX,FY,CX,CY"),
            ("--reference-intrinsics 1,2,3,x", "four numbers FX,FY,CX,CY"),
            ("--reference-intrinsics 0,1,2,3", "expected finite numbers, FX and FY above 0 px"),
            ("--source-intrinsics 1e400,1,2,3", "--source-intrinsics"),
            ("--source-intrinsics nan,1,2,3", "--source-intrinsics"),
            ("--working-width 0", "--working-width"),
            ("--working-width 10", "working_width = 10, expected at least 64 px"),
            ("--flow none.onnx", "none.onnx"),
            ("--flow fast", "fast"),
            ("--explain --choose spread", "--explain goes with --choose informed"),
            ("--refine-plane", "--refine-plane goes with --depth plane"),
            ("--initial none.yaml", "none.yaml: No such file or directory"),
            ("--source-colormap none-such", "none-such"),
        )
    ),
    Row(
        "no-such-command", "undistort rig.yaml", "No such command 'undistort', expected calibrate,"
    ),
    Row("no-such-option-at-all", "-v", "No such option '-v'"),
    Row("misspelt-option", f"{CALIBRATE} --frame 4", "--frames"),
    Row("misspelt-and-missing", "calibrate visible thermal --ouput r.yaml", "--output"),
    Row("no-rig", "inspect", "RIG"),
    Row("too-many", f"{INSPECT} more.yaml", "more.yaml"),
    Row("too-many-words", f"{EVALUATE} more", "expected evaluate RIG REFERENCE SOURCE"),
    Row(
        "no-source",
        "register rig.yaml visible --depth plane -o out",
        "; expected register RIG REFERENCE SOURCE",
    ),
    Row("number-with-a-unit", f"{CALIBRATE} --reference-hfov 90deg", "number"),
]
