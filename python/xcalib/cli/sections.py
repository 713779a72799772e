"""Help in sections: what most need first, the rarely used options last."""

from __future__ import annotations

import click

DEPTH = ("depth_spec", "depth_scale", "depth_unit", "depth_invalid", "complete", "depth_steady")
FOOTAGE = (
    "pairing",
    "time_offset",
    "max_gap",
    "reference_times",
    "source_times",
    "exif_orientation",
    "source_colormap",
    "source_readout",
    "reference_readout",
)
RARE = (
    *("camera_height", "horizon", "far", "plane_hfov", "plane_roll"),
    *("depth_recipe", "depth_focal", "inverse_scale", "inverse_shift", "providers"),
    *("lidar_calibration", "stereo_calibration"),
    *("stereo_baseline", "stereo_focal", "stereo_doffs", "completion_confidence"),
)


class Sectioned(click.Command):
    """A command whose help has sections."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options under their sections."""
        sections: dict[str, list[tuple[str, str]]] = {
            "Options": [],
            "Depth": [],
            "Footage and pairing": [],
            "Depth by a plane, a network, lidar or stereo": [],
        }
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx)
            if record is None:
                continue
            name = param.name or ""
            index = 1 if name in DEPTH else 2 if name in FOOTAGE else 3 if name in RARE else 0
            sections[list(sections)[index]].append(record)
        for title, records in sections.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)
