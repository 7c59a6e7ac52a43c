#ifndef STRIDEWIRE_COMMANDS_H
#define STRIDEWIRE_COMMANDS_H

// The contents of commands to a server. stridewire/client.h declares the functions that send them.

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Role of a client in a world.
typedef enum stridewire_role {
  STRIDEWIRE_CONTROLLER = 0,  ///< Commands avatars and receives all events of the world.
  STRIDEWIRE_OBSERVER = 1,    ///< Observes only.
  STRIDEWIRE_ROLE_MAX = 0x7fffffff
} stridewire_role;

/// An avatar to spawn.
typedef struct stridewire_spawn {
  /// Id of the avatar in its world. 0: the server chooses an id and reports it in an ITEM event. If
  /// the id is in use, the server refuses the item with AVATAR_EXISTS.
  uint32_t avatar;
  double position_m[3];  ///< World position of the base frame.
  double heading_rad;    ///< Heading of the base frame.
} stridewire_spawn;

/// Type of a requested movement.
typedef enum stridewire_movement_type {
  STRIDEWIRE_STEP = 0,   ///< Step with given parameters or to a given footprint.
  STRIDEWIRE_JUMP = 1,   ///< Jump with both feet.
  STRIDEWIRE_STAND = 2,  ///< Stand for a given time.
  STRIDEWIRE_WALK = 3,   ///< Walk to a position and heading with as many steps as needed.
  STRIDEWIRE_MOVEMENT_TYPE_MAX = 0x7fffffff
} stridewire_movement_type;

/// A foot of an avatar.
typedef enum stridewire_foot {
  /// In requests: while walking, the foot that did not move last; from a stand, the foot that fits
  /// the request better.
  STRIDEWIRE_FOOT_AUTO = 0,
  STRIDEWIRE_FOOT_LEFT = 1,
  STRIDEWIRE_FOOT_RIGHT = 2,
  STRIDEWIRE_FOOT_MAX = 0x7fffffff
} stridewire_foot;

/// Time at which a requested movement begins. All values except STRIDEWIRE_QUEUED also drop the
/// queue.
typedef enum stridewire_interrupt {
  STRIDEWIRE_QUEUED = 0,  ///< The movement begins after all queued movements.
  /// The movement begins after the current step or jump. A current stand ends at once, and a walk
  /// ends after its current step.
  STRIDEWIRE_AFTER_MOVEMENT = 1,
  /// The movement begins as soon as the feet allow it.
  STRIDEWIRE_NOW = 2,
  STRIDEWIRE_INTERRUPT_MAX = 0x7fffffff
} stridewire_interrupt;

/// A requested movement. A movement type ignores the fields of other types.
typedef struct stridewire_movement {
  uint32_t avatar;  ///< Id of the avatar, not 0.
  /// Id that the application chooses, not 0. Events of the request contain it.
  uint64_t request_id;
  stridewire_movement_type type;
  stridewire_foot foot;  ///< Step: the moving foot.
  /// Step: forward distance between the feet at its end, in metres. Jump: forward distance, in
  /// metres.
  double length_m;
  /// Step, if `has_side`: sideways distance between the feet, positive towards the moving foot's
  /// side.
  double side_m;
  double height_m;   ///< Step, jump: height difference between start and end.
  double turn_rad;   ///< Step, jump: change of heading, positive to the left.
  double seconds;    ///< Stand: duration.
  uint8_t has_side;  ///< Step: 1 uses `side_m`, 0 leaves the sideways distance to the server.
  /// Step: 1 places the foot at `at_m` and ignores length, side, height and turn.
  uint8_t has_at;
  /// Step with `has_at`: 1 uses `heading_rad`, 0 leaves the heading of the foot to the server.
  uint8_t has_heading;
  /// Step with `has_at`: world position of the ball of the foot. Walk: destination of the base
  /// frame; its height is ignored.
  double at_m[3];
  /// Step with `has_at` and `has_heading`: heading of the foot. Walk: heading at the destination.
  double heading_rad;
  /// Walk: coordinates x, y, z of each waypoint, 3 * waypoint_count numbers.
  const double* waypoints_m;
  size_t waypoint_count;  ///< Walk: number of waypoints, at most STRIDEWIRE_MAX_WAYPOINTS.
  uint8_t has_speed;      ///< Walk: 1 uses `speed_m_s`, 0 leaves the speed to the server.
  /// Walk with `has_speed`: speed in m/s, 0.05 to 5. The server comes as close to it as the library
  /// allows, see `speed_m_s` of stridewire_event.
  double speed_m_s;
  stridewire_interrupt interrupt;
  /// Step: 1 rejects the step unless the foot can land exactly on the requested footprint. Must not
  /// be combined with `allow_nearest`.
  uint8_t exact_only;
  /// Step, jump: 1 plays the nearest movement of the library, however far it is from the request. 0
  /// rejects the request if its place would be missed by more than 0.2 m, or its direction or
  /// heading by more than 60 degrees.
  uint8_t allow_nearest;
} stridewire_movement;

/// Heights on a regular grid, interpolated bilinearly. The height outside the grid is 0.
typedef struct stridewire_height_field {
  double origin_m[2];      ///< World x and z of the first sample.
  double cell_m;           ///< Distance between neighbouring samples, 0.01 to 1000.
  uint32_t columns;        ///< Number of samples along x, 2 to STRIDEWIRE_MAX_TERRAIN_COLUMNS.
  uint32_t rows;           ///< Number of samples along z, 2 to STRIDEWIRE_MAX_TERRAIN_COLUMNS.
  const float* heights_m;  ///< Heights of columns * rows samples, row by row, x fastest.
} stridewire_height_field;

/// A block with vertical sides and a flat top.
typedef struct stridewire_terrain_box {
  double min_m[2];  ///< Smallest x and z.
  double max_m[2];  ///< Largest x and z.
  double height_m;  ///< World height of the top.
} stridewire_terrain_box;

/// Terrain of a world. Its height at a point is the maximum of the height field and of all boxes
/// there. Without height field and boxes the terrain is flat at y = 0.
typedef struct stridewire_terrain_def {
  const stridewire_height_field* height_field;  ///< Heights of the ground. NULL: no height field.
  /// Array of boxes. May be NULL if `box_count` is 0.
  const stridewire_terrain_box* boxes;
  /// Number of boxes, at most STRIDEWIRE_MAX_TERRAIN_BOXES.
  size_t box_count;
} stridewire_terrain_def;

/// Starts, changes or ends a layer: a clip of the library that plays over the current movement, for
/// example waving or carrying. Layers change neither the legs nor the root. See
/// stridewire_client_list_layers.
typedef struct stridewire_layer {
  uint32_t avatar;   ///< Id of the avatar, not 0.
  const char* name;  ///< Name of the layer, 1 to STRIDEWIRE_MAX_NAME_BYTES bytes.
  uint8_t fade_out;  ///< 1: fade the layer out and end it. `weight` and `speed` are then ignored.
  double weight;     ///< Weight of the layer, above 0 and at most 1.
  double blend_s;    ///< Time until weight and speed reach their new values, 0 to 10.
  double speed;      ///< Playback speed, 0.1 to 4. 1 plays as recorded.
} stridewire_layer;

/// Enables or disables foot planting for a list of avatars.
typedef struct stridewire_planting {
  const uint32_t* avatars;  ///< Ids of the avatars.
  size_t avatar_count;      ///< Number of avatars, 1 to STRIDEWIRE_MAX_ITEMS.
  /// 1: feet stand still where they land. 0: feet move as in the examples. After a spawn the value
  /// is 1, unless the server is configured otherwise.
  uint8_t enabled;
} stridewire_planting;

/// Form in which the server sends poses.
typedef enum stridewire_pose_mode {
  STRIDEWIRE_FULL = 0,  ///< The server sends float32 values, without loss.
  /// The server sends compressed poses. With STRIDEWIRE_DETAIL_ALL, the error of each joint and end
  /// site is at most 1 mm.
  STRIDEWIRE_QUANTISED = 1,
  /// The server sends movements, about 150 bytes per step, and the client evaluates the poses. They
  /// equal those of STRIDEWIRE_FULL bit for bit. If the world's library is not in `library_folder`,
  /// the client fetches it from the server. Until the library is available, the client delays the
  /// subscription and all later commands to the world. If the client cannot use the library, the
  /// reply to the subscription is UNSUPPORTED, VERSION_MISMATCH or MALFORMED. An avatar costs the
  /// client about 1 us per tick and up to 16 KiB. The client ignores avatars beyond
  /// `max_pose_bytes` / 16 KiB.
  STRIDEWIRE_MOVEMENT = 2,
  STRIDEWIRE_POSE_MODE_MAX = 0x7fffffff
} stridewire_pose_mode;

/// Selects the joints that STRIDEWIRE_QUANTISED poses contain. Omitted joints have their reference
/// rotations, which are typical rotations in the library.
typedef enum stridewire_pose_detail {
  STRIDEWIRE_DETAIL_ALL = 0,
  /// Omits joints whose omission moves no point of the figure by more than 0.12 m, for example
  /// hands, toes and head.
  STRIDEWIRE_DETAIL_REDUCED = 1,
  STRIDEWIRE_DETAIL_ROOT = 2,  ///< Position and rotation of the root only, 18 bytes per pose.
  STRIDEWIRE_POSE_DETAIL_MAX = 0x7fffffff
} stridewire_pose_detail;

/// A ring of a region. The server sends the poses of the avatars in it every `every_n_ticks` ticks.
typedef struct stridewire_rate_ring {
  /// Outer radius. Must exceed 0 and the outer radius of the previous ring.
  double to_m;
  uint16_t every_n_ticks;  ///< 1 to 3600.
} stridewire_rate_ring;

/// A circle on the ground. An avatar enters the region when its root comes within the radius.
typedef struct stridewire_region {
  double x, z;      ///< Centre in metres.
  double radius_m;  ///< Above 0.
  /// An avatar leaves at a distance of `radius_m` + `leave_m`. Negative: the server chooses.
  double leave_m;
  /// Rings from the inside out. Beyond them, the rate and detail of stridewire_observation apply.
  const stridewire_rate_ring* rings;
  size_t ring_count;  ///< Number of rings, at most STRIDEWIRE_MAX_RATE_RINGS.
  /// Detail of each ring, or NULL for stridewire_observation::detail. Requires
  /// STRIDEWIRE_QUANTISED.
  const stridewire_pose_detail* ring_details;
} stridewire_region;

/// Contents of a subscription: which poses and events a client receives from a world.
typedef struct stridewire_observation {
  stridewire_pose_mode mode;
  uint16_t every_n_ticks;  ///< Interval of poses in ticks, 1 to 3600.
  /// 1: the client also receives the world's events. Controllers always receive them.
  uint8_t with_events;
  /// Ids of the avatars to observe. NULL: all avatars, or those inside `region`.
  const uint32_t* avatars;
  /// Number of ids: 0 if `avatars` is NULL, at most STRIDEWIRE_MAX_ITEMS.
  size_t avatar_count;
  /// Detail of the poses. Values other than 0 require STRIDEWIRE_QUANTISED.
  stridewire_pose_detail detail;
  /// Observes the avatars inside this region, which requires that `avatars` is NULL. NULL: no
  /// region. The events ENTERED and LEFT report changes. A client that observes a region of a world
  /// cannot have other subscriptions to that world (NOT_ALLOWED).
  const stridewire_region* region;
} stridewire_observation;

#ifdef __cplusplus
}
#endif

#endif  // STRIDEWIRE_COMMANDS_H
