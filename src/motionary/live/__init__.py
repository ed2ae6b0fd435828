"""Labels while a motion is still going on."""

from motionary.live.annotator import LiveAnnotator, LiveEvent, Status

__all__ = ["LiveAnnotator", "LiveEvent", "Status"]
