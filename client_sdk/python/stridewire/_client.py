"""The client and its worlds."""

from __future__ import annotations

import collections
import ctypes as c
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from . import _abi, _load
from ._requests import Requests
from ._types import (Event, EventType, Foot, Kind, Outcome, Playout, Pose, PoseKind, PoseMode,
                     Recording, Skeleton, StridewireError, Vec3, point)

_library = _load.load()
_NO_TICK = 2**64 - 1
_BUFFER_TOO_SMALL = 150
_TIMEOUT = 300


def version() -> str:
    """Returns the version of the client library."""
    return _library.stridewire_version().decode()


def _name(status: int) -> str:
    return _library.stridewire_status_name(status).decode()


def _check(status: int) -> None:
    if status != 0:
        raise StridewireError(_name(status), _library.stridewire_status_text(status).decode())


def _address(text: str) -> _abi.stridewire_address:
    host, colon, port = text.rpartition(":")
    if not colon or not port.isdecimal() or int(port) > 65535:
        raise ValueError(f"address: expected HOST:PORT, got {text!r}")
    return _abi.stridewire_address(host.strip("[]").encode(), int(port))


def _ids(avatars: Iterable[int]) -> Any:
    ids = list(avatars)
    for avatar in ids:
        if not 0 <= avatar < 2**32:  # ctypes would wrap it.
            raise ValueError(f"expected ids of avatars from 0 to 4294967295, got {avatar}")
    return (c.c_uint32 * len(ids))(*ids)


def _event_of(e: _abi.stridewire_event) -> Event:
    text = e.text.decode("utf-8", "replace")
    if not text and e.status != 0:
        text = _library.stridewire_status_text(e.status).decode()
    return Event(
        EventType(e.type), _name(e.status), text, e.command, e.world, e.avatar, e.request_id,
        e.tick, e.time_s, Kind(e.kind), Foot(e.foot), e.item_index, e.accepted,
        Outcome(e.outcome), bool(e.cut_short), bool(e.clamped), bool(e.extrapolated),
        bool(e.resumed), tuple(e.position_m), tuple(e.base_position_m), e.base_heading_rad,
        e.missed_m, e.nearest_length_m, e.speed_m_s)


class Client:
    """A connection to a server.

    The client reconnects automatically until `close` is called or the server refuses it
    permanently. Use it as a context manager:

        with stridewire.Client("127.0.0.1:7420") as client:
            world = client.join("plaza")

    `address` is HOST:PORT, or a list of up to 16 servers that offer the same worlds. The client
    tries them in order. After a lost connection, it starts with the same server.

    `timeout_s` limits every call that waits for the server, except `World.wait` and `World.record`,
    which have their own limits. A client is not thread-safe.
    """

    #: Number of events that are kept for `poll_events`, and in each world for `wait`. If there are
    #: more, the oldest are dropped.
    MAX_EVENTS = 65536

    def __init__(self, address: str | Sequence[str], *, name: str = "stridewire-python",
                 token: str = "", timeout_s: float = 10.0, render_delay_s: float | None = None,
                 pose_history: int = 256, respawn: bool = False,
                 library_folder: str | None = None) -> None:
        texts = [address] if isinstance(address, str) else list(address)
        addresses = (_abi.stridewire_address * len(texts))(*map(_address, texts))
        self.timeout_s = timeout_s
        self._handle = c.c_void_p()
        self._events: collections.deque[Event] = collections.deque(maxlen=self.MAX_EVENTS)
        self._watchers: list[Callable[[Event], None]] = []
        self._buffer = (_abi.stridewire_event * 64)()
        self._next_request_id = 1
        options = _abi.stridewire_client_options()
        _library.stridewire_client_options_init(c.byref(options), c.sizeof(options))
        if options.abi_version != _abi.ABI_VERSION:
            raise ImportError(f"the client library has ABI version {options.abi_version}, expected "
                              f"{_abi.ABI_VERSION}")
        options.client_name = name.encode()
        options.auth_token = token.encode()
        if render_delay_s is not None:
            options.render_delay_s = render_delay_s
        options.pose_history = pose_history
        options.respawn = respawn
        options.library_folder = library_folder.encode() if library_folder else None
        _check(_library.stridewire_client_create(c.byref(options), c.byref(self._handle)))
        try:
            _check(_library.stridewire_client_connect_any(self._handle, addresses,
                                                          len(addresses)))
            self._wait(lambda event: event.type in (EventType.CONNECTED, EventType.CLOSED),
                       "the server did not answer")
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    def close(self) -> None:
        """Ends the session. The server removes the avatars that this client has spawned, except in
        persistent worlds."""
        if getattr(self, "_handle", None):
            _library.stridewire_client_destroy(self._handle)
            self._handle = c.c_void_p()

    def join(self, world: str, *, observer: bool = False) -> World:
        """Joins a world. An observer may not command avatars."""
        handle = c.c_uint32()
        command = c.c_uint64()
        _check(_library.stridewire_client_join_world(self._handle, world.encode(), int(observer),
                                                     c.byref(handle), c.byref(command)))
        self._await_reply(command.value)
        return World(self, handle.value, world)

    def poll_events(self) -> list[Event]:
        """Returns the events since the last call."""
        self._pump(0.0)
        events = list(self._events)
        self._events.clear()
        return events

    def playout(self) -> Playout:
        """Returns the delays of the render time and the counts of sampled poses."""
        raw = _abi.stridewire_playout()
        _check(_library.stridewire_client_get_playout(self._handle, c.byref(raw)))
        return Playout(raw.delay_s, raw.target_delay_s, raw.jitter_s, raw.newest_age_s,
                       raw.displayed_poses, raw.extrapolated_poses, raw.held_poses)

    def _last_error(self) -> str:
        text = c.create_string_buffer(1100)
        _library.stridewire_client_last_error(self._handle, text, len(text))
        return text.value.decode("utf-8", "replace")

    def _pump(self, patience_s: float) -> None:
        """Waits for events for at most `patience_s`, and passes them to the watchers."""
        if not self._handle:
            raise StridewireError("closed", "the client is closed")
        status = _library.stridewire_client_wait_event(self._handle, patience_s)
        if status == _TIMEOUT:
            return
        _check(status)
        count = c.c_size_t(len(self._buffer))
        while count.value == len(self._buffer):
            _check(_library.stridewire_client_poll_events(self._handle, self._buffer,
                                                          len(self._buffer), c.byref(count)))
            for raw in self._buffer[:count.value]:
                event = _event_of(raw)
                self._events.append(event)
                for watcher in self._watchers:
                    watcher(event)

    def _wait(self, is_wanted: Callable[[Event], bool], what: str,
              timeout_s: float | None = None) -> Event:
        """Waits for an event that has not arrived yet."""
        found: list[Event] = []

        def watch(event: Event) -> None:
            if is_wanted(event):
                found.append(event)
            elif event.type == EventType.CLOSED:
                raise StridewireError(event.status, event.text)

        self._watchers.append(watch)
        deadline = time.monotonic() + (self.timeout_s if timeout_s is None else timeout_s)
        try:
            while not found:
                left_s = deadline - time.monotonic()
                if left_s <= 0.0:
                    raise StridewireError("timeout", f"{what} in time. {self._last_error()}")
                self._pump(min(left_s, 1.0))
        finally:
            self._watchers.remove(watch)
        if found[0].type == EventType.CLOSED:
            raise StridewireError(found[0].status, found[0].text)
        return found[0]

    def _await_reply(self, command: int) -> list[Event]:
        """Waits for the reply to a command. Returns the events of its items."""
        items: list[Event] = []

        def is_reply(event: Event) -> bool:
            if event.command != command:
                return False
            if event.type == EventType.ITEM:
                items.append(event)
            return event.type == EventType.REPLY

        reply = self._wait(is_reply, "the server did not reply")
        if reply.status != "ok":
            raise StridewireError(reply.status, reply.text)
        return items


class World(Requests):
    """A joined world. Its commands wait for the reply of the server, and raise StridewireError if
    an item was refused; the other items were executed."""

    def __init__(self, client: Client, handle: int, name: str) -> None:
        self.client = client
        self.name = name
        self._handle = handle
        self._skeleton: Skeleton | None = None
        self._rotations = np.empty((_abi.MAX_JOINTS, 4), np.float32)
        self._rotations_pointer = self._rotations.ctypes.data_as(c.POINTER(c.c_float))
        self._ended: dict[int, Event] = {}
        self._open: set[int] = set()
        client._watchers.append(self._watch)

    def _watch(self, event: Event) -> None:
        # Stores the last events of the requests of this object, for wait().
        if event.type == EventType.SESSION_LOST:
            self._open.clear()
            self._skeleton = None  # The next session may have another library.
        if event.world == self._handle and event.request_id in self._open and event.outcome:
            self._open.discard(event.request_id)
            self._ended[event.request_id] = event
            if len(self._ended) > self.client.MAX_EVENTS:
                del self._ended[next(iter(self._ended))]

    def _command(self, function: Callable[..., int], *arguments: Any) -> list[Event]:
        command = c.c_uint64()
        _check(function(self.client._handle, self._handle, *arguments, c.byref(command)))
        return self.client._await_reply(command.value)

    def leave(self) -> None:
        """Leaves the world. The server removes the avatars that this client has spawned in it,
        unless the world is persistent."""
        self._command(_library.stridewire_client_leave_world)
        self.client._watchers.remove(self._watch)

    # Avatars.

    def spawn(self, position_m: Vec3 = (0.0, 0.0, 0.0), heading_rad: float = 0.0,
              avatar: int = 0) -> int:
        """Spawns an avatar and returns its id. With `avatar` 0 the server chooses the id."""
        spawn = _abi.stridewire_spawn(avatar, point(position_m), heading_rad)
        items = self._command(_library.stridewire_client_spawn, c.byref(spawn), 1)
        return items[0].avatar if items else avatar

    def teleport(self, avatar: int, position_m: Vec3, heading_rad: float = 0.0) -> None:
        """Moves an avatar at once. It drops its requests and stands."""
        place = _abi.stridewire_spawn(avatar, point(position_m), heading_rad)
        self._command(_library.stridewire_client_teleport, c.byref(place), 1)

    def remove(self, *avatars: int) -> None:
        """Removes avatars."""
        self._command(_library.stridewire_client_remove, _ids(avatars), len(avatars))

    def avatars(self) -> list[int]:
        """Returns the ids of the avatars whose poses the client receives."""
        count = c.c_size_t()
        ids = (c.c_uint32 * 0)()
        while _library.stridewire_client_list_avatars(
                self.client._handle, self._handle, ids, len(ids),
                c.byref(count)) == _BUFFER_TOO_SMALL:
            ids = (c.c_uint32 * count.value)()
        return list(ids[:count.value])

    def _request(self, movement: _abi.stridewire_movement) -> int:
        request_id = self.client._next_request_id
        self.client._next_request_id += 1
        movement.request_id = request_id
        self._open.add(request_id)
        try:
            self._command(_library.stridewire_client_request, c.byref(movement), 1)
        except StridewireError:
            self._open.discard(request_id)
            raise
        return request_id

    def cancel(self, *avatars: int) -> None:
        """Drops the requests of these avatars that have not started. Walks in progress end after
        their current step."""
        self._command(_library.stridewire_client_cancel, _ids(avatars), len(avatars))

    def wait(self, request_id: int, timeout_s: float = 60.0) -> Event:
        """Waits until a request has ended, and returns its last event. See its `outcome`. Raises
        StridewireError if the session is lost meanwhile, because the request then has no event."""
        if request_id not in self._open and request_id not in self._ended:
            raise ValueError(f"no request has the id {request_id}, or its last event was already "
                             "returned or dropped")
        if request_id not in self._ended:
            event = self.client._wait(
                lambda event: request_id in self._ended or event.type == EventType.SESSION_LOST,
                f"request {request_id} has not ended", timeout_s)
            if request_id not in self._ended:
                raise StridewireError("session_lost", event.text)
        return self._ended.pop(request_id)

    # Layers.

    def layers(self) -> list[str]:
        """Returns the names of the layers of the world's library, for example "wave"."""
        names = (_abi.stridewire_layer_name * 64)()
        count = c.c_size_t()
        _check(_library.stridewire_client_list_layers(self.client._handle, self._handle, names,
                                                      len(names), c.byref(count)))
        return [entry.name.decode() for entry in names[:count.value]]

    def set_layer(self, avatar: int, layer: str, enabled: bool = True, *, weight: float = 1.0,
                  blend_s: float = 0.3, speed: float = 1.0) -> None:
        """Starts, changes or ends a layer, which plays on top of the movements."""
        entry = _abi.stridewire_layer(avatar, layer.encode(), not enabled, weight, blend_s, speed)
        self._command(_library.stridewire_client_set_layers, c.byref(entry), 1)

    # Poses.

    def observe(self, mode: PoseMode = PoseMode.QUANTISED, *, avatars: Iterable[int] = (),
                every_n_ticks: int = 1, events: bool = False) -> int:
        """Subscribes to the poses of these avatars, or of all avatars if `avatars` is empty.
        Returns the number of the subscription."""
        ids = _ids(avatars)
        observation = _abi.stridewire_observation(
            mode=mode, every_n_ticks=every_n_ticks, with_events=events,
            avatars=ids if len(ids) > 0 else None, avatar_count=len(ids))
        subscription = c.c_uint32()
        self._command(_library.stridewire_client_observe, c.byref(observation),
                      c.byref(subscription))
        return subscription.value

    def stop_observing(self, subscription: int) -> None:
        """Ends a subscription."""
        command = c.c_uint64()
        _check(_library.stridewire_client_stop_observing(self.client._handle, subscription,
                                                         c.byref(command)))
        self.client._await_reply(command.value)

    def skeleton(self) -> Skeleton:
        """Returns the skeleton of all avatars of this world."""
        if self._skeleton is None:
            raw = _abi.stridewire_skeleton()
            joints = (_abi.stridewire_joint * _abi.MAX_JOINTS)()
            end_sites = (_abi.stridewire_end_site * _abi.MAX_JOINTS)()
            buffers = _abi.stridewire_skeleton_buffers(joints, len(joints), end_sites,
                                                       len(end_sites))
            _check(_library.stridewire_client_get_skeleton(self.client._handle, self._handle,
                                                           c.byref(raw), c.byref(buffers)))
            known = joints[:raw.joint_count]
            self._skeleton = Skeleton(
                tuple(joint.name.decode() for joint in known),
                np.array([joint.parent for joint in known], np.int32),
                np.array([tuple(joint.offset_m) for joint in known], np.float32),
                raw.tick_hz, raw.library_hash.decode())
        return self._skeleton

    def _fill(self, function: Callable[..., int], avatar: int, *arguments: Any) -> Pose | None:
        pose = _abi.stridewire_pose(rotations_xyzw=self._rotations_pointer,
                                    joint_capacity=len(self._rotations))
        _check(function(self.client._handle, self._handle, avatar, *arguments, c.byref(pose)))
        if pose.kind == PoseKind.MISSING:
            return None
        return Pose(PoseKind(pose.kind), pose.tick, pose.time_s,
                    np.array(pose.root_position_m, np.float32),
                    self._rotations[:pose.joint_count].copy(), bool(pose.discontinuity),
                    bool(pose.standing), pose.segment)

    def pose(self, avatar: int) -> Pose | None:
        """Returns the newest received pose; None if there is none yet."""
        return self._fill(_library.stridewire_client_latest_pose, avatar)

    def sample(self, avatar: int, time_s: float | None = None) -> Pose | None:
        """Returns the pose at a server time, or at the render time. None if no pose is known."""
        if time_s is None:
            now = c.c_double()
            _check(_library.stridewire_client_render_time(self.client._handle, c.byref(now)))
            time_s = now.value
        return self._fill(_library.stridewire_client_sample_pose, avatar, c.c_double(time_s))

    def record(self, avatar: int, seconds: float, until: int | None = None) -> Recording:
        """Records the poses of an avatar for `seconds`, or until the request with the id `until`
        has ended."""
        events: list[Event] = []

        def watch(event: Event) -> None:
            if event.world == self._handle and event.avatar == avatar:
                events.append(event)

        poses: list[Pose] = []
        after = _NO_TICK
        self.client._watchers.append(watch)
        deadline = time.monotonic() + seconds
        try:
            while time.monotonic() < deadline and (until is None or until not in self._ended):
                self.client._pump(0.02)
                while (pose := self._fill(_library.stridewire_client_next_pose, avatar,
                                          c.c_uint64(after))) is not None:
                    after = pose.tick
                    poses.append(pose)
        finally:
            self.client._watchers.remove(watch)
        joints = len(self.skeleton().names)
        return Recording(
            np.array([pose.time_s for pose in poses], np.float64),
            np.array([pose.root_position_m for pose in poses], np.float32).reshape(-1, 3),
            np.array([pose.rotations_xyzw for pose in poses], np.float32).reshape(-1, joints, 4),
            tuple(events))
