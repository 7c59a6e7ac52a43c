"""Client of the Stridewire animation server. README.md shows how to use it."""

from ._client import Client, World, version
from ._types import (Event, EventType, Foot, Interrupt, Kind, Outcome, Playout, Pose, PoseKind,
                     PoseMode, Recording, Skeleton, StridewireError)

__all__ = [
    "Client", "Event", "EventType", "Foot", "Interrupt", "Kind", "Outcome", "Playout", "Pose",
    "PoseKind", "PoseMode", "Recording", "Skeleton", "StridewireError", "World", "version",
]
