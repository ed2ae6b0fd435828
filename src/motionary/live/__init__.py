"""Labels while a motion is still going on."""

from motionary.live.annotator import LiveAnnotator, LiveEvent, Status
from motionary.live.people import LivePeople, PersonEvent, PersonPose
from motionary.live.poses import Pose, PoseLines, write_lines
from motionary.live.sockets import PageServer, WebSocketSource
from motionary.live.sources import OscSender, OscSource, PipeSource, Source
from motionary.live.vmc import VMC_HZ, VMC_PORT, VmcReader, write_messages

__all__ = [
    "VMC_HZ",
    "VMC_PORT",
    "LiveAnnotator",
    "LiveEvent",
    "LivePeople",
    "OscSender",
    "OscSource",
    "PageServer",
    "PersonEvent",
    "PersonPose",
    "PipeSource",
    "Pose",
    "PoseLines",
    "Source",
    "Status",
    "VmcReader",
    "WebSocketSource",
    "write_lines",
    "write_messages",
]
