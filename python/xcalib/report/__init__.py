"""One self-contained HTML page on a calibration: whether to trust it, and what it looks like."""

from .page import write_page
from .run import Run, of_report

__all__ = ["Run", "of_report", "write_page"]
