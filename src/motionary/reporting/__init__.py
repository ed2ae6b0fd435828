"""Pages to watch: motions with their labels, and why; files that need no network."""

from motionary.reporting.classes import report_library
from motionary.reporting.comparing import report_comparison
from motionary.reporting.contents import PAGE_HZ, Lane, describe_body
from motionary.reporting.galleries import Judging, MotionFiles, Motions, rank_among, report_hits
from motionary.reporting.html import UNIT_M, Page, build_page
from motionary.reporting.recordings import Tracks, report, report_tracking

__all__ = [
    "PAGE_HZ",
    "UNIT_M",
    "Judging",
    "Lane",
    "MotionFiles",
    "Motions",
    "Page",
    "Tracks",
    "build_page",
    "describe_body",
    "rank_among",
    "report",
    "report_comparison",
    "report_hits",
    "report_library",
    "report_tracking",
]
