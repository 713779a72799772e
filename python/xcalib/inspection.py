"""The facts of a rig, in units one can picture."""

from ._core import describe, facts_text, rig_document

__all__ = ["describe", "facts_text", "rig_document"]
