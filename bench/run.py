"""The benchmarks, one after the other. Each prints the machine, the commit and its figures.

Not among them, for they take long: frame_choice, clock_offset, flow_term.
"""

import subprocess
import sys
from pathlib import Path

for name in (
    "register_frame",
    "night_rig",
    "flir_rig",
    "synthetic_rigs",
    "depth_measured",
    "depth_completion",
    "depth_conditioning",
    "patch_flow",
    "depth_sources",
):
    print(f"== {name}", flush=True)
    subprocess.run([sys.executable, str(Path(__file__).parent / f"{name}.py")], check=True)
