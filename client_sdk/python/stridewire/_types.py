"""Values of the Python client."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vec3 = Sequence[float]


def point(position_m: Vec3) -> tuple[float, ...]:
    """Returns the three numbers of a position. ctypes would replace missing numbers by zeros."""
    numbers = tuple(position_m)
    if len(numbers) != 3:
        raise ValueError(f"expected a position of 3 numbers (x, y, z), got {len(numbers)}")
    return numbers


class EventType(enum.IntEnum):
    """Type of an event. Types from ACCEPTED on are about an avatar."""

    CONNECTED = 0
    CONNECT_FAILED = 1
    CONNECTION_LOST = 2
    SESSION_LOST = 3
    CLOSED = 4
    WORLD_JOINED = 5
    REPLY = 6
    ITEM = 7
    LAGGING = 8
    NOTICE = 9
    PONG = 10
    TERRAIN = 11
    ACCEPTED = 32
    STARTED = 33
    FOOT_STRIKE = 34
    FINISHED = 35
    IDLE = 36
    REJECTED = 37
    SPAWNED = 38
    REMOVED = 39
    ENTERED = 40
    LEFT = 41


class Outcome(enum.IntEnum):
    """How a request ended. Every accepted request has exactly one event whose outcome is not
    NONE."""

    NONE = 0
    COMPLETED = 1
    REJECTED = 2
    CANCELLED = 3
    REPLACED = 4
    REMOVED = 5


class Kind(enum.IntEnum):
    """Kind of a movement that an avatar plays."""

    STEP_LEFT = 0
    STEP_RIGHT = 1
    JUMP = 2
    STAND = 3


class Foot(enum.IntEnum):
    """The foot that a step moves.

    AUTO: while walking, the foot that did not move last; from a stand, the foot that fits the
    request better.
    """

    AUTO = 0
    LEFT = 1
    RIGHT = 2


class Interrupt(enum.IntEnum):
    """When a request begins. All values except QUEUED also drop the requests queued before."""

    QUEUED = 0
    AFTER_MOVEMENT = 1
    NOW = 2


class PoseMode(enum.IntEnum):
    """Form of received poses: without loss, compressed, or evaluated here (without loss)."""

    FULL = 0
    QUANTISED = 1
    MOVEMENT = 2


class PoseKind(enum.IntEnum):
    """Origin of a pose."""

    MISSING = 0
    INTERPOLATED = 1
    HELD = 2
    RAW = 3
    EXTRAPOLATED = 4


class StridewireError(Exception):
    """A call or command that failed. `status` is a name such as "no_such_avatar"."""

    def __init__(self, status: str, text: str) -> None:
        super().__init__(f"{status}: {text}")
        self.status = status
        self.text = text


@dataclass(frozen=True)
class Event:
    """Something that happened. Ignore fields that its type does not use."""

    type: EventType
    status: str  #: Name of a status, "ok" if nothing failed.
    text: str
    command: int
    world: int
    avatar: int
    request_id: int  #: 0 for a movement that the server inserted.
    tick: int
    time_s: float  #: Server time.
    kind: Kind
    foot: Foot
    item_index: int
    accepted: int
    outcome: Outcome
    cut_short: bool
    clamped: bool
    extrapolated: bool
    resumed: bool
    position_m: tuple[float, float, float]
    base_position_m: tuple[float, float, float]
    base_heading_rad: float
    missed_m: float
    nearest_length_m: float
    speed_m_s: float


@dataclass(frozen=True)
class Skeleton:
    """The joints of all avatars of a world. A joint follows its parent in the arrays."""

    names: tuple[str, ...]
    parents: NDArray[np.int32]  #: Shape (joints,); -1 for the root, joint 0.
    offsets_m: NDArray[np.float32]  #: Shape (joints, 3), relative to the parent.
    tick_hz: float
    library_hash: str

    def joint_positions_m(self, root_position_m: NDArray[np.float32],
                          rotations_xyzw: NDArray[np.float32]) -> NDArray[np.float32]:
        """Returns the world positions of all joints.

        `root_position_m` has the shape (..., 3) and `rotations_xyzw` (..., joints, 4). The result
        has the shape (..., joints, 3).
        """
        positions = np.empty(rotations_xyzw.shape[:-1] + (3,), np.float32)
        world = np.empty_like(rotations_xyzw)
        for joint, parent in enumerate(self.parents):
            if parent < 0:
                positions[..., joint, :] = root_position_m
                world[..., joint, :] = rotations_xyzw[..., joint, :]
                continue
            turn = world[..., parent, :]
            positions[..., joint, :] = (positions[..., parent, :]
                                        + rotate(turn, self.offsets_m[joint]))
            world[..., joint, :] = multiply(turn, rotations_xyzw[..., joint, :])
        return positions


@dataclass(frozen=True)
class Playout:
    """Describes how the render time adapts to the connection. Times that are not known yet are
    0."""

    delay_s: float  #: Delay of the render time behind the server time.
    target_delay_s: float  #: The delay that `delay_s` approaches.
    jitter_s: float  #: Mean lateness of pose messages relative to the fastest one.
    newest_age_s: float  #: Server time that has passed since the newest pose message.
    displayed_poses: int  #: Number of sampled poses.
    extrapolated_poses: int  #: Poses extrapolated beyond the newest received one.
    held_poses: int  #: Poses sampled after the newest one without extrapolation.


@dataclass(frozen=True)
class Pose:
    """A pose of an avatar."""

    kind: PoseKind
    tick: int
    time_s: float  #: Server time.
    root_position_m: NDArray[np.float32]  #: Shape (3,), in the world.
    #: Shape (joints, 4). The first rotation is in the world, the others relative to the parent.
    rotations_xyzw: NDArray[np.float32]
    discontinuity: bool  #: RAW: True if the previous pose must not be interpolated with this one.
    standing: bool  #: True: the avatar stands and has no request.
    #: Poses with equal segments belong to one continuous motion. Poses with different segments must
    #: not be blended: for example, the avatar has teleported or the client has reconnected in
    #: between.
    segment: int


@dataclass(frozen=True)
class Recording:
    """Poses of one avatar, tick by tick."""

    times_s: NDArray[np.float64]  #: Shape (n,), server time.
    root_positions_m: NDArray[np.float32]  #: Shape (n, 3).
    rotations_xyzw: NDArray[np.float32]  #: Shape (n, joints, 4).
    events: tuple[Event, ...]  #: Events of the avatar during the recording.


def rotate(q: NDArray[np.float32], v: NDArray[np.float32]) -> NDArray[np.float32]:
    """Rotates the vectors v by the unit quaternions q (x, y, z, w)."""
    axis = q[..., :3]
    t = 2.0 * np.cross(axis, v)
    return v + q[..., 3:] * t + np.cross(axis, t)


def multiply(p: NDArray[np.float32], q: NDArray[np.float32]) -> NDArray[np.float32]:
    """Returns the product p q of quaternions (x, y, z, w)."""
    out = np.empty(np.broadcast_shapes(p.shape, q.shape), np.float32)
    out[..., :3] = (p[..., 3:] * q[..., :3] + q[..., 3:] * p[..., :3]
                    + np.cross(p[..., :3], q[..., :3]))
    out[..., 3] = p[..., 3] * q[..., 3] - np.sum(p[..., :3] * q[..., :3], axis=-1)
    return out
