"""Pages to watch: motions with their labels, and why; files that need no network."""

from motionary.reporting.classes import report_library
from motionary.reporting.clips import PAGE_HZ
from motionary.reporting.comparing import report_comparison
from motionary.reporting.galleries import Judging, MotionFiles, Motions, rank_among, report_hits
from motionary.reporting.html import Page
from motionary.reporting.lanes import Lane
from motionary.reporting.recordings import Tracks, report
from motionary.reporting.tracking import report_tracking

__all__ = [
    "PAGE_HZ",
    "Judging",
    "Lane",
    "MotionFiles",
    "Motions",
    "Page",
    "Tracks",
    "rank_among",
    "report",
    "report_comparison",
    "report_hits",
    "report_library",
    "report_tracking",
]
