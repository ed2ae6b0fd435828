"""Pages to watch: a recording with its labels, and why; one file that needs no network."""

from motionary.reporting.clips import PAGE_HZ
from motionary.reporting.lanes import Lane
from motionary.reporting.recordings import Tracks, build_report, report

__all__ = ["PAGE_HZ", "Lane", "Tracks", "build_report", "report"]
