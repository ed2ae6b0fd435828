"""Labels while a motion is still going on."""

from motionary.live.annotator import LiveAnnotator, LiveEvent, Status
from motionary.live.people import LivePeople, PersonEvent
from motionary.live.poses import Pose, PoseLines, write_lines
from motionary.live.sources import PipeSource, Source, WebSocketSource

__all__ = [
    "LiveAnnotator",
    "LiveEvent",
    "LivePeople",
    "PersonEvent",
    "PipeSource",
    "Pose",
    "PoseLines",
    "Source",
    "Status",
    "WebSocketSource",
    "write_lines",
]
