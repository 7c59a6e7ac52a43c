"""The C API of libstridewire-client, for ctypes.

A test compares the layout of these structs with that of stridewire/client.h.
"""

import ctypes as c
import ctypes.util
import os

ABI_VERSION = 5
MAX_TEXT_BYTES = 160
MAX_NAME_BYTES = 64
MAX_PARAMETERS = 7
MAX_JOINTS = 256


class stridewire_client_options(c.Structure):
    _fields_ = [("struct_bytes", c.c_size_t), ("abi_version", c.c_uint32),
                ("max_events", c.c_uint32), ("max_commands", c.c_uint32),
                ("pose_history", c.c_uint32), ("max_command_bytes", c.c_size_t),
                ("max_pose_bytes", c.c_size_t), ("render_delay_s", c.c_double),
                ("connect_timeout_s", c.c_double), ("ping_interval_s", c.c_double),
                ("seed", c.c_uint64), ("client_name", c.c_char_p), ("auth_token", c.c_char_p),
                ("respawn", c.c_uint8), ("library_folder", c.c_char_p)]


class stridewire_spawn(c.Structure):
    _fields_ = [("avatar", c.c_uint32), ("position_m", c.c_double * 3),
                ("heading_rad", c.c_double)]


class stridewire_movement(c.Structure):
    _fields_ = [("avatar", c.c_uint32), ("request_id", c.c_uint64), ("type", c.c_int),
                ("foot", c.c_int), ("length_m", c.c_double), ("side_m", c.c_double),
                ("height_m", c.c_double), ("turn_rad", c.c_double), ("seconds", c.c_double),
                ("has_side", c.c_uint8), ("has_at", c.c_uint8), ("has_heading", c.c_uint8),
                ("at_m", c.c_double * 3), ("heading_rad", c.c_double),
                ("waypoints_m", c.POINTER(c.c_double)), ("waypoint_count", c.c_size_t),
                ("has_speed", c.c_uint8), ("speed_m_s", c.c_double), ("interrupt", c.c_int),
                ("exact_only", c.c_uint8), ("allow_nearest", c.c_uint8)]


class stridewire_layer(c.Structure):
    _fields_ = [("avatar", c.c_uint32), ("name", c.c_char_p), ("fade_out", c.c_uint8),
                ("weight", c.c_double), ("blend_s", c.c_double), ("speed", c.c_double)]


class stridewire_observation(c.Structure):
    _fields_ = [("mode", c.c_int), ("every_n_ticks", c.c_uint16), ("with_events", c.c_uint8),
                ("avatars", c.POINTER(c.c_uint32)), ("avatar_count", c.c_size_t),
                ("detail", c.c_int), ("region", c.c_void_p)]


class stridewire_parameters(c.Structure):
    _fields_ = [("values", c.c_double * MAX_PARAMETERS), ("names", c.c_uint8 * MAX_PARAMETERS),
                ("count", c.c_uint8)]


class stridewire_event(c.Structure):
    _fields_ = [("type", c.c_int), ("status", c.c_int), ("command", c.c_uint64),
                ("request_id", c.c_uint64), ("tick", c.c_uint64), ("time_s", c.c_double),
                ("world", c.c_uint32), ("avatar", c.c_uint32), ("item_index", c.c_uint32),
                ("accepted", c.c_uint32), ("kind", c.c_int), ("foot", c.c_int),
                ("group", c.c_int32), ("resumed", c.c_uint8), ("extrapolated", c.c_uint8),
                ("clamped", c.c_uint8), ("cut_short", c.c_uint8), ("position_m", c.c_double * 3),
                ("base_position_m", c.c_double * 3), ("base_heading_rad", c.c_double),
                ("requested", stridewire_parameters), ("applied", stridewire_parameters),
                ("rtt_s", c.c_double), ("dropped_batches", c.c_uint64),
                ("dropped_events", c.c_uint64), ("events_dropped_before", c.c_uint64),
                ("text", c.c_char * MAX_TEXT_BYTES), ("missed_m", c.c_double),
                ("missed_rad", c.c_double), ("nearest_length_m", c.c_double),
                ("nearest_side_m", c.c_double), ("nearest_height_m", c.c_double),
                ("nearest_turn_rad", c.c_double), ("nearest_heading_rad", c.c_double),
                ("speed_m_s", c.c_double), ("outcome", c.c_int)]


class stridewire_joint(c.Structure):
    _fields_ = [("name", c.c_char * (MAX_NAME_BYTES + 1)), ("parent", c.c_int32),
                ("offset_m", c.c_float * 3)]


class stridewire_end_site(c.Structure):
    _fields_ = [("joint", c.c_uint32), ("offset_m", c.c_float * 3)]


class stridewire_leg(c.Structure):
    _fields_ = [("hip", c.c_int32), ("knee", c.c_int32), ("ankle", c.c_int32),
                ("ball", c.c_int32), ("ball_offset_m", c.c_float * 3),
                ("toe_tip_offset_m", c.c_float * 3)]


class stridewire_skeleton(c.Structure):
    _fields_ = [("joint_count", c.c_uint32), ("end_site_count", c.c_uint32),
                ("legs", stridewire_leg * 2), ("tick_hz", c.c_double),
                ("library_hash", c.c_char * (MAX_NAME_BYTES + 1))]


class stridewire_skeleton_buffers(c.Structure):
    _fields_ = [("joints", c.POINTER(stridewire_joint)), ("joint_capacity", c.c_size_t),
                ("end_sites", c.POINTER(stridewire_end_site)),
                ("end_site_capacity", c.c_size_t)]


class stridewire_layer_name(c.Structure):
    _fields_ = [("name", c.c_char * (MAX_NAME_BYTES + 1))]


class stridewire_pose(c.Structure):
    _fields_ = [("kind", c.c_int), ("joint_count", c.c_uint32), ("tick", c.c_uint64),
                ("time_s", c.c_double), ("held_s", c.c_double), ("root_position_m", c.c_float * 3),
                ("discontinuity", c.c_uint8), ("standing", c.c_uint8), ("detail", c.c_uint8),
                ("rotations_xyzw", c.c_void_p), ("joint_capacity", c.c_size_t)]


_CLIENT = c.c_void_p
_WORLD = c.c_uint32
_COMMAND = c.POINTER(c.c_uint64)
_P = c.POINTER
_IDS = _P(c.c_uint32)

# Arguments of the functions that return a status.
_STATUS_FUNCTIONS = {
    "client_create": [_P(stridewire_client_options), _P(_CLIENT)],
    "client_connect": [_CLIENT, c.c_char_p, c.c_uint16],
    "client_last_error": [_CLIENT, c.c_char_p, c.c_size_t],
    "client_join_world": [_CLIENT, c.c_char_p, c.c_int, _P(_WORLD), _COMMAND],
    "client_leave_world": [_CLIENT, _WORLD, _COMMAND],
    "client_spawn": [_CLIENT, _WORLD, _P(stridewire_spawn), c.c_size_t, _COMMAND],
    "client_teleport": [_CLIENT, _WORLD, _P(stridewire_spawn), c.c_size_t, _COMMAND],
    "client_remove": [_CLIENT, _WORLD, _IDS, c.c_size_t, _COMMAND],
    "client_request": [_CLIENT, _WORLD, _P(stridewire_movement), c.c_size_t, _COMMAND],
    "client_cancel": [_CLIENT, _WORLD, _IDS, c.c_size_t, _COMMAND],
    "client_set_layers": [_CLIENT, _WORLD, _P(stridewire_layer), c.c_size_t, _COMMAND],
    "client_observe": [_CLIENT, _WORLD, _P(stridewire_observation), _P(c.c_uint32), _COMMAND],
    "client_stop_observing": [_CLIENT, c.c_uint32, _COMMAND],
    "client_poll_events": [_CLIENT, _P(stridewire_event), c.c_size_t, _P(c.c_size_t)],
    "client_wait_event": [_CLIENT, c.c_double],
    "client_get_skeleton": [_CLIENT, _WORLD, _P(stridewire_skeleton),
                            _P(stridewire_skeleton_buffers)],
    "client_list_layers": [_CLIENT, _WORLD, _P(stridewire_layer_name), c.c_size_t,
                           _P(c.c_size_t)],
    "client_list_avatars": [_CLIENT, _WORLD, _IDS, c.c_size_t, _P(c.c_size_t)],
    "client_render_time": [_CLIENT, _P(c.c_double)],
    "client_sample_pose": [_CLIENT, _WORLD, c.c_uint32, c.c_double, _P(stridewire_pose)],
    "client_latest_pose": [_CLIENT, _WORLD, c.c_uint32, _P(stridewire_pose)],
    "client_next_pose": [_CLIENT, _WORLD, c.c_uint32, c.c_uint64, _P(stridewire_pose)],
}


def load() -> c.CDLL:
    """Loads the library: STRIDEWIRE_CLIENT_LIBRARY, or the installed one with this ABI version."""
    name = os.environ.get("STRIDEWIRE_CLIENT_LIBRARY") or f"libstridewire-client.so.{ABI_VERSION}"
    try:
        library = c.CDLL(name)
    except OSError as error:
        raise ImportError(
            f"cannot load {name}: {error}. Install the client library (cmake --install BUILD "
            "--component client) and run ldconfig, or set STRIDEWIRE_CLIENT_LIBRARY to its path"
        ) from error
    for name, arguments in _STATUS_FUNCTIONS.items():
        function = getattr(library, "stridewire_" + name)
        function.argtypes = arguments
        function.restype = c.c_int
    library.stridewire_client_options_init.argtypes = [_P(stridewire_client_options), c.c_size_t]
    library.stridewire_client_options_init.restype = None
    library.stridewire_client_destroy.argtypes = [_CLIENT]
    library.stridewire_client_destroy.restype = None
    library.stridewire_client_get_state.argtypes = [_CLIENT]
    library.stridewire_client_get_state.restype = c.c_int
    for name in ("stridewire_status_name", "stridewire_status_text"):
        getattr(library, name).argtypes = [c.c_int]
        getattr(library, name).restype = c.c_char_p
    library.stridewire_version.argtypes = []
    library.stridewire_version.restype = c.c_char_p
    return library
