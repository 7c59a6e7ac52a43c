#ifndef STRIDEWIRE_CLIENT_H
#define STRIDEWIRE_CLIENT_H

/// Client library of Stridewire. A client connects to a server, commands avatars, receives events
/// and poses, and interpolates poses for display.
///
/// The declarations in this C99 header and the headers that it includes are the only stable ABI.
/// `stridewire/client.hpp` wraps them for C++17.
///
///   stridewire_client_options options;
///   stridewire_client_options_init(&options, sizeof options);
///   stridewire_client* client = NULL;
///   stridewire_client_create(&options, &client);
///   stridewire_client_connect(client, "127.0.0.1", 7420);
///   stridewire_world world;
///   stridewire_client_join_world(client, "plaza", STRIDEWIRE_CONTROLLER, &world, NULL);
///   for (;;) { poll events; request movements; sample poses at the render time }
///   stridewire_client_destroy(client);
///
/// Threads. Each client has one network thread. The library never calls back: the application
/// polls. Every function may be called from any thread. Calls on the same client are serialized by
/// a mutex, which is never held during a blocking system call. stridewire_client_destroy must be
/// the last call on a client.
///
/// Memory. The library copies all arguments before a call returns. It writes results into buffers
/// of the caller, whose sizes are stated at each function. Handles are opaque. A NULL handle yields
/// STRIDEWIRE_INVALID_ARGUMENT.
///
/// Connection. The client connects, and reconnects, in the background. It waits 0.1 s before the
/// first retry. The delay doubles with each failure, up to 5 s, and is shortened by a random amount
/// of up to half. The client retries until it is disconnected or the server refuses it permanently.
/// Commands are queued while there is no connection. If there are several servers, see
/// stridewire_client_connect_any. After a reconnect:
///   - If the server still has the session, it resumes (STRIDEWIRE_EVENT_CONNECTED with `resumed`).
///     The client resends unanswered commands, and the server executes each of them once.
///   - Otherwise the session is lost (STRIDEWIRE_EVENT_SESSION_LOST), for example because the
///     server restarted. The client joins its worlds and observes again. With `respawn` it also
///     spawns its avatars again, each at its last known base frame. If the client had sent a
///     command for avatars or terrain and the server had not answered it, the command ends with
///     STRIDEWIRE_SESSION_LOST.
///
/// Units are metres, seconds and radians. Axes are right-handed with +Y up. Heading 0 faces +Z, and
/// a positive heading turns to the left. Quaternions are unit quaternions stored as x, y, z, w.

#include <stddef.h>
#include <stdint.h>

#include "stridewire/commands.h"
#include "stridewire/limits.h"
#include "stridewire/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Version of the struct layouts in this header. stridewire_client_create rejects other versions.
#define STRIDEWIRE_ABI_VERSION 6

/// Returns the version of the library, for example "0.1.0".
const char* stridewire_version(void);

// ---------------------------------------------------------------------------------- the client

/// A connection to one server at a time, with its worlds, queues and received poses.
typedef struct stridewire_client stridewire_client;

/// Number of a joined world, starting at 1. The library assigns it. It stays valid across
/// reconnects.
typedef uint32_t stridewire_world;

/// Settings of a client. Call stridewire_client_options_init to fill in the defaults.
typedef struct stridewire_client_options {
  /// sizeof(stridewire_client_options); set by stridewire_client_options_init.
  size_t struct_bytes;
  uint32_t abi_version;  ///< STRIDEWIRE_ABI_VERSION; set by stridewire_client_options_init.
  /// Capacity of the event queue, 16 to 2^24. A full queue drops its oldest event. Default 65536.
  uint32_t max_events;
  /// Maximum number of unanswered commands, 1 to 2^20. Further commands fail with COMMANDS_FULL.
  /// Default 4096.
  uint32_t max_commands;
  /// Number of poses stored per avatar, 2 to 4096. Default 32.
  uint32_t pose_history;
  /// Maximum memory for unanswered commands in bytes, at least 64 KiB. Default 64 MiB.
  size_t max_command_bytes;
  /// Maximum memory for all pose histories in bytes, at least 64 KiB. If the history of an avatar
  /// does not fit, its poses are dropped and counted in `poses_refused`. Default 256 MiB.
  size_t max_pose_bytes;
  /// Delay of the render time behind the server time in seconds, at most 10. If it is negative,
  /// which is the default, the client adapts the delay to the connection.
  double render_delay_s;
  /// Timeout in seconds, 0.01 to 600. It applies to the TCP connection and, again, to the
  /// handshake. Default 5.
  double connect_timeout_s;
  /// Interval of pings in seconds, 0.01 to 600. If it exceeds a third of the server's idle timeout,
  /// the client uses that third instead. Default 1.
  double ping_interval_s;
  /// Seed for the random part of reconnect delays. 0: the client chooses a random seed. Default 0.
  uint64_t seed;
  /// Name for the server's log, 1 to STRIDEWIRE_MAX_NAME_BYTES bytes.
  const char* client_name;
  /// Secret that the server may require, at most 4096 bytes, or NULL.
  const char* auth_token;
  /// 1: after a lost session, the client spawns its avatars again, each at its last known base
  /// frame. Default 0.
  uint8_t respawn;
  /// Folder that caches motion libraries fetched for STRIDEWIRE_MOVEMENT, at most 4096 bytes. The
  /// client creates it if necessary. NULL (the default) disables the cache.
  const char* library_folder;
} stridewire_client_options;

/// Writes the default options. `struct_bytes` must be sizeof(stridewire_client_options). If the
/// library was built with another size, the function does nothing.
void stridewire_client_options_init(stridewire_client_options* options, size_t struct_bytes);

/// Creates a client and starts its network thread. The client does not connect yet. `options` may
/// be NULL for the defaults. Fails with OUT_OF_RANGE if a number is out of range, with
/// INVALID_ARGUMENT if `client` is NULL or a text is invalid, with VERSION_MISMATCH if header and
/// library differ, and with OUT_OF_MEMORY.
stridewire_status stridewire_client_create(const stridewire_client_options* options,
                                           stridewire_client** client);

/// Disconnects and frees the client. A connected client waits up to 1 s until its Goodbye message
/// is sent. `client` may be NULL.
void stridewire_client_destroy(stridewire_client* client);

/// Starts to connect and returns at once. `host` is a name or an IP address of at most 255 bytes.
/// `port` must not be 0. Fails with INVALID_ARGUMENT if an argument is invalid, and with
/// ALREADY_CONNECTED if the client is connecting or connected.
stridewire_status stridewire_client_connect(stridewire_client* client, const char* host,
                                            uint16_t port);

/// Address of a server.
typedef struct stridewire_address {
  const char* host;  ///< Name or IP address of at most 255 bytes.
  uint16_t port;     ///< Not 0.
} stridewire_address;

/// Same as stridewire_client_connect, but with the addresses of `count` servers that offer the same
/// worlds, 1 to STRIDEWIRE_MAX_ADDRESSES. The client tries them in order. It waits only after all
/// of them have failed, and after a lost connection. After a lost connection, it first tries the
/// same address again, because only that server can resume the session. After a server has
/// announced its shutdown, the client starts with the next address. If there are several addresses,
/// the texts of CONNECT_FAILED and CONNECTION_LOST begin with the address.
stridewire_status stridewire_client_connect_any(stridewire_client* client,
                                                const stridewire_address* addresses, size_t count);

/// Ends the session and returns at once. The server removes the avatars that this session spawned,
/// except in persistent worlds. Unanswered commands end with STRIDEWIRE_CANCELLED. The client
/// discards its worlds and poses.
stridewire_status stridewire_client_disconnect(stridewire_client* client);

/// State of the connection.
typedef enum stridewire_client_state {
  STRIDEWIRE_STATE_IDLE = 0,        ///< Never connected, or disconnected by the application.
  STRIDEWIRE_STATE_CONNECTING = 1,  ///< Connecting, or waiting for the next attempt.
  STRIDEWIRE_STATE_READY = 2,       ///< The handshake is complete.
  STRIDEWIRE_STATE_CLOSED = 3       ///< The server refused the client permanently.
} stridewire_client_state;

/// Returns the state of the connection. A NULL client is idle.
stridewire_client_state stridewire_client_get_state(stridewire_client* client);

/// Returns the status of the last error, or STRIDEWIRE_OK if there was none since the client
/// started to connect. Errors are lost connections, failed attempts to connect, and failed calls
/// that connect, ping or submit a command. Calls with an invalid pointer, count, enumerator or
/// address, and calls that only read data, do not change the result. Writes a description to
/// `text`, truncated to `text_bytes` bytes including the terminating 0. `text` may be NULL if
/// `text_bytes` is 0.
stridewire_status stridewire_client_last_error(stridewire_client* client, char* text,
                                               size_t text_bytes);

// ------------------------------------------------------------------------------------ commands
//
// A call checks the command, assigns it a number, queues it for the network thread and returns at
// once. It stores the number in `command` unless that is NULL. When the server has answered, the
// event STRIDEWIRE_EVENT_REPLY reports the result with the same number. If the checks fail, the
// call fails and nothing is sent.
//
// Commands can fail with INVALID_ARGUMENT, OUT_OF_RANGE, COMMANDS_FULL, CLOSED (the client is idle
// or closed), NO_SUCH_WORLD (unknown world number) and NOT_JOINED (the server refused the join, or
// the client has left the world).

/// Joins a world. `world` receives a number that further calls may use at once: the client sends
/// their commands when the server has accepted the join. Fails with ALREADY_JOINED if this name is
/// joined, and with LIMIT_REACHED beyond 256 worlds.
stridewire_status stridewire_client_join_world(stridewire_client* client, const char* name,
                                               stridewire_role role, stridewire_world* world,
                                               uint64_t* command);

/// Leaves a world. Its number becomes invalid. The server removes the avatars that this session
/// spawned in the world, unless the world is persistent.
stridewire_status stridewire_client_leave_world(stridewire_client* client, stridewire_world world,
                                                uint64_t* command);

/// Spawns `count` avatars, 1 to STRIDEWIRE_MAX_ITEMS.
stridewire_status stridewire_client_spawn(stridewire_client* client, stridewire_world world,
                                          const stridewire_spawn* spawns, size_t count,
                                          uint64_t* command);

/// Moves `count` existing avatars, 1 to STRIDEWIRE_MAX_ITEMS, without animation. They drop their
/// movements and requests, and stand. The next pose of each has the flag `discontinuity`. Fails
/// with INVALID_ARGUMENT if the id of an avatar is 0.
stridewire_status stridewire_client_teleport(stridewire_client* client, stridewire_world world,
                                             const stridewire_spawn* places, size_t count,
                                             uint64_t* command);

/// Removes `count` avatars, 1 to STRIDEWIRE_MAX_ITEMS.
stridewire_status stridewire_client_remove(stridewire_client* client, stridewire_world world,
                                           const uint32_t* avatars, size_t count,
                                           uint64_t* command);

/// Requests movements. An avatar may appear several times and executes its movements in order.
/// Steps of a walk appear in events with the request id of the walk. A walk ends with FINISHED of
/// kind STAND when the avatar has arrived, or with REJECTED if it cannot continue. Steps and jumps
/// that are out of reach end with REJECTED, which contains the nearest one within reach. Requests
/// that are dropped before they are completed also end with REJECTED; see `outcome` of
/// stridewire_event.
///
/// If the library cannot walk at a requested speed, REPLY has the status OK and a `text` that
/// states the possible speeds. ACCEPTED then has `clamped` and the nearest possible speed.
stridewire_status stridewire_client_request(stridewire_client* client, stridewire_world world,
                                            const stridewire_movement* movements, size_t count,
                                            uint64_t* command);

/// Drops all requested movements of these avatars that have not started. Walks in progress end
/// after their current step.
stridewire_status stridewire_client_cancel(stridewire_client* client, stridewire_world world,
                                           const uint32_t* avatars, size_t count,
                                           uint64_t* command);

/// Replaces the terrain of a world for all its avatars. The server replies OUT_OF_RANGE or
/// LIMIT_REACHED if it cannot use the terrain.
stridewire_status stridewire_client_set_terrain(stridewire_client* client, stridewire_world world,
                                                const stridewire_terrain_def* terrain,
                                                uint64_t* command);

/// Starts, changes and ends layers. An avatar plays at most 4 layers. An ITEM event reports
/// NO_MOVEMENT if the library has no layer of that name.
stridewire_status stridewire_client_set_layers(stridewire_client* client, stridewire_world world,
                                               const stridewire_layer* layers, size_t count,
                                               uint64_t* command);

/// Enables or disables foot planting from the next movement of each avatar on. Without planting,
/// the server rejects steps with `exact_only`. If the skeleton does not support planting, enabling
/// it fails with NO_MOVEMENT in an ITEM event.
stridewire_status stridewire_client_set_planting(stridewire_client* client, stridewire_world world,
                                                 const stridewire_planting* planting,
                                                 uint64_t* command);

/// Subscribes to poses and events of a world. `subscription`, unless NULL, receives the number of
/// the subscription. If several subscriptions include an avatar, the client stores the first pose
/// that it receives for each tick. Fails with LIMIT_REACHED beyond 256 subscriptions to one world.
stridewire_status stridewire_client_observe(stridewire_client* client, stridewire_world world,
                                            const stridewire_observation* observation,
                                            uint32_t* subscription, uint64_t* command);

/// Replaces the region of a subscription, for example when the player walks. Avatars inside both
/// regions neither leave nor enter. Fails with NO_SUCH_SUBSCRIPTION if no subscription with a
/// region has this number.
stridewire_status stridewire_client_move_region(stridewire_client* client, uint32_t subscription,
                                                const stridewire_region* region, uint64_t* command);

/// Ends a subscription. Fails with NO_SUCH_SUBSCRIPTION if no subscription has this number.
stridewire_status stridewire_client_stop_observing(stridewire_client* client, uint32_t subscription,
                                                   uint64_t* command);

/// Sends a ping. STRIDEWIRE_EVENT_PONG reports the round-trip time. Fails with NOT_READY without a
/// connection, and with COMMANDS_FULL if 64 pings are unanswered.
stridewire_status stridewire_client_ping(stridewire_client* client);

// -------------------------------------------------------------------------------------- events

/// Type of an event. The comments list the fields of stridewire_event that the type uses.
typedef enum stridewire_event_type {
  // Events about the connection.
  /// Uses resumed and text. The handshake is complete. `text` is the address of the server.
  STRIDEWIRE_EVENT_CONNECTED = 0,
  STRIDEWIRE_EVENT_CONNECT_FAILED = 1,   ///< Uses status, text. The client tries again.
  STRIDEWIRE_EVENT_CONNECTION_LOST = 2,  ///< Uses status, text. The client reconnects.
  STRIDEWIRE_EVENT_SESSION_LOST = 3,     ///< The server no longer has the session of this client.
  /// Uses status, text. The client does not try again. The status is OK if the application has
  /// disconnected.
  STRIDEWIRE_EVENT_CLOSED = 4,
  /// Uses world. The skeleton is available. Repeated after SESSION_LOST.
  STRIDEWIRE_EVENT_WORLD_JOINED = 5,
  /// Uses world, command, status, accepted, text. The status is OK only if the server has executed
  /// all items. If the server has accepted the command but refused some of its items, the status
  /// is that of the first refused item.
  STRIDEWIRE_EVENT_REPLY = 6,
  /// Uses world, command, item_index, avatar, request_id, status, text. Reports an item that the
  /// server refused, or the id that it chose for a spawned avatar. Precedes the REPLY.
  STRIDEWIRE_EVENT_ITEM = 7,
  /// Uses world, dropped_batches, dropped_events. The server has dropped messages because this
  /// client reads too slowly. If dropped_events has increased, events of avatars that entered or
  /// left an observed region may be missing. End such a subscription and observe the region again.
  STRIDEWIRE_EVENT_LAGGING = 8,
  /// Uses status, text, and command and world if they are known. Reports an error that the server
  /// has sent without ending the connection, or the failure of a command with which the client
  /// restores a lost session.
  STRIDEWIRE_EVENT_NOTICE = 9,
  STRIDEWIRE_EVENT_PONG = 10,  ///< Uses rtt_s, tick, time_s.
  /// Uses world. Its terrain has changed; see stridewire_client_get_terrain.
  STRIDEWIRE_EVENT_TERRAIN = 11,

  // Events about an avatar. All of them also use world, avatar, tick and time_s.
  /// Uses request_id and, for a walk with a speed, also clamped and speed_m_s. The server has
  /// queued the request.
  STRIDEWIRE_EVENT_ACCEPTED = 32,
  /// Uses request_id, kind, group, requested, applied, extrapolated, clamped. A movement has
  /// started.
  STRIDEWIRE_EVENT_STARTED = 33,
  STRIDEWIRE_EVENT_FOOT_STRIKE = 34,  ///< Uses foot, position_m. A foot has landed.
  /// Uses request_id, kind, base, cut_short, outcome, and at the end of a walk also speed_m_s. A
  /// movement has ended. `base` is the new base frame.
  STRIDEWIRE_EVENT_FINISHED = 35,
  STRIDEWIRE_EVENT_IDLE = 36,  ///< Uses base. The avatar stands and its queue is empty.
  /// Uses request_id, status, text, outcome. The avatar could not execute a queued request, or the
  /// request was dropped before it was completed (DROPPED). If a step or jump is out of reach
  /// (OUT_OF_RANGE), also uses foot, kind, position_m (the nearest point within reach), missed_m,
  /// missed_rad and nearest_*. At the end of a walk, also uses speed_m_s.
  STRIDEWIRE_EVENT_REJECTED = 37,
  STRIDEWIRE_EVENT_SPAWNED = 38,  ///< Uses base. The avatar was spawned.
  STRIDEWIRE_EVENT_REMOVED = 39,
  STRIDEWIRE_EVENT_ENTERED = 40,  ///< The avatar has entered the observed region.
  STRIDEWIRE_EVENT_LEFT = 41      ///< The avatar has left the observed region or the world.
} stridewire_event_type;

/// Kind of a movement that an avatar executes.
typedef enum stridewire_movement_kind {
  STRIDEWIRE_KIND_STEP_LEFT = 0,
  STRIDEWIRE_KIND_STEP_RIGHT = 1,
  STRIDEWIRE_KIND_JUMP = 2,
  STRIDEWIRE_KIND_STAND = 3
} stridewire_movement_kind;

/// Parameters of a movement. The names are 0 start_x_m, 1 start_y_m, 2 start_z_m, 3 end_x_m,
/// 4 end_y_m, 5 end_z_m, 6 turn_rad, 7 length_m, 8 height_m. Names 0 to 5 are the position of the
/// moving foot relative to the fixed foot, before and after a step.
typedef struct stridewire_parameters {
  double values[STRIDEWIRE_MAX_PARAMETERS];
  uint8_t names[STRIDEWIRE_MAX_PARAMETERS];
  uint8_t count;  ///< Number of valid entries in `values` and `names`.
} stridewire_parameters;

/// How a requested movement ended. Comments begin with the type of the event that reports it.
typedef enum stridewire_outcome {
  STRIDEWIRE_OUTCOME_NONE = 0,  ///< The event does not end a request.
  /// FINISHED: the movement was played to its end, or the walk has arrived.
  STRIDEWIRE_OUTCOME_COMPLETED = 1,
  STRIDEWIRE_OUTCOME_REJECTED = 2,  ///< REJECTED: the avatar could not execute the request.
  /// REJECTED: stridewire_client_cancel or a teleport dropped the request.
  STRIDEWIRE_OUTCOME_CANCELLED = 3,
  /// REJECTED or FINISHED: a request with an interrupt dropped this request, or cut its movement
  /// short.
  STRIDEWIRE_OUTCOME_REPLACED = 4,
  STRIDEWIRE_OUTCOME_REMOVED = 5,  ///< REJECTED: the avatar was removed.
  STRIDEWIRE_OUTCOME_MAX = 0x7fffffff
} stridewire_outcome;

/// An event. Ignore the fields that its type does not use.
typedef struct stridewire_event {
  stridewire_event_type type;
  stridewire_status status;
  uint64_t command;  ///< Number of the command that caused the event.
  /// Request to which the event belongs. 0 for a movement that the server inserted.
  uint64_t request_id;
  uint64_t tick;
  double time_s;  ///< Server time of the tick.
  stridewire_world world;
  uint32_t avatar;
  uint32_t item_index;  ///< Index in the array that was passed to the command.
  uint32_t accepted;    ///< Number of items that the server executed.
  stridewire_movement_kind kind;
  stridewire_foot foot;
  int32_t group;         ///< Index of the motion group in the library, or -1.
  uint8_t resumed;       ///< 1: the session survived the reconnect.
  uint8_t extrapolated;  ///< 1: `applied` lies outside the convex hull of the examples.
  /// STARTED: `requested` is out of reach and was clamped. ACCEPTED: the library's steps do not
  /// permit the requested walking speed.
  uint8_t clamped;
  uint8_t cut_short;  ///< 1: another request interrupted the movement.
  double position_m[3];
  double base_position_m[3];
  double base_heading_rad;
  stridewire_parameters requested;  ///< Parameters as requested.
  stridewire_parameters applied;    ///< Parameters of the synthesized movement.
  double rtt_s;                     ///< Round-trip time of a ping.
  uint64_t dropped_batches;         ///< Pose batches that the server has dropped since the join.
  uint64_t dropped_events;          ///< Events that the server has dropped since the join.
  /// Number of events dropped directly before this one because the queue was full.
  uint64_t events_dropped_before;
  char text[STRIDEWIRE_MAX_TEXT_BYTES];
  /// Distance between the requested place and the nearest one within reach, in metres.
  double missed_m;
  /// Angle between the requested and the nearest direction, or between the headings, whichever is
  /// larger.
  double missed_rad;
  /// The members nearest_* describe the nearest step or jump within reach, like those of
  /// stridewire_movement.
  double nearest_length_m;
  double nearest_side_m;
  double nearest_height_m;
  double nearest_turn_rad;
  double nearest_heading_rad;  ///< Heading of the foot at `position_m`, or of the avatar (jump).
  /// ACCEPTED: the possible walking speed that is closest to the requested one. End of a walk: its
  /// mean speed without the first and the last steps. 0: unknown.
  double speed_m_s;
  /// How the request ended. The last event of every accepted request contains its outcome; all
  /// other events contain NONE. The application may miss the last event if the session is lost, or
  /// if it reads events too slowly (LAGGING, `events_dropped_before`).
  stridewire_outcome outcome;
} stridewire_event;

/// Moves up to `capacity` of the oldest events from the queue to `events`. `count` receives the
/// number of events written, which is 0 if the queue is empty.
stridewire_status stridewire_client_poll_events(stridewire_client* client, stridewire_event* events,
                                                size_t capacity, size_t* count);

/// Waits until the event queue is not empty. Returns STRIDEWIRE_TIMEOUT after `timeout_s` seconds
/// (0 to 3600).
stridewire_status stridewire_client_wait_event(stridewire_client* client, double timeout_s);

// --------------------------------------------------------------------------------------- poses

/// A joint of a skeleton.
typedef struct stridewire_joint {
  char name[STRIDEWIRE_MAX_NAME_BYTES + 1];
  int32_t parent;  ///< Index of the parent, below the joint's own index. -1 for the root, joint 0.
  float offset_m[3];  ///< Position relative to the parent.
} stridewire_joint;

/// The end of a chain of joints, for example a fingertip.
typedef struct stridewire_end_site {
  uint32_t joint;     ///< Index of the last joint of the chain.
  float offset_m[3];  ///< Position relative to that joint.
} stridewire_end_site;

/// Joints of a leg. An index is -1 if the library does not define the joint.
typedef struct stridewire_leg {
  int32_t hip;
  int32_t knee;
  int32_t ankle;
  int32_t ball;
  float ball_offset_m[3];     ///< Bottom of the ball of the foot, relative to `ball`.
  float toe_tip_offset_m[3];  ///< Tip of the toes, relative to `ball`.
} stridewire_leg;

/// Skeleton of all avatars of a world.
typedef struct stridewire_skeleton {
  uint32_t joint_count;
  uint32_t end_site_count;
  stridewire_leg legs[2];  ///< Left leg, then right leg.
  double tick_hz;          ///< Ticks per second of the server.
  /// Hash of the motion library in hexadecimal digits.
  char library_hash[STRIDEWIRE_MAX_NAME_BYTES + 1];
} stridewire_skeleton;

/// Arrays that receive the parts of a skeleton. An array may be NULL if its capacity is 0.
typedef struct stridewire_skeleton_buffers {
  stridewire_joint* joints;
  size_t joint_capacity;
  stridewire_end_site* end_sites;
  size_t end_site_capacity;
} stridewire_skeleton_buffers;

/// Gets the skeleton of a world. `buffers` may be NULL. Returns BUFFER_TOO_SMALL if an array is too
/// small; `skeleton` then has the required counts. Returns NOT_READY before the event WORLD_JOINED.
stridewire_status stridewire_client_get_skeleton(stridewire_client* client, stridewire_world world,
                                                 stridewire_skeleton* skeleton,
                                                 const stridewire_skeleton_buffers* buffers);

/// Name of a layer, for stridewire_client_set_layers.
typedef struct stridewire_layer_name {
  char name[STRIDEWIRE_MAX_NAME_BYTES + 1];
} stridewire_layer_name;

/// Lists the layers of a world's library. Writes up to `capacity` names, and `count` receives the
/// total, at most 64. `names` may be NULL if `capacity` is 0. Returns BUFFER_TOO_SMALL if the total
/// exceeds `capacity`, and NOT_READY before the event WORLD_JOINED.
stridewire_status stridewire_client_list_layers(stridewire_client* client, stridewire_world world,
                                                stridewire_layer_name* names, size_t capacity,
                                                size_t* count);

/// Position and size of a world's terrain, without its heights and boxes.
typedef struct stridewire_terrain {
  double origin_m[2];  ///< World x and z of the first height sample.
  double cell_m;       ///< Distance between neighbouring samples.
  uint32_t columns;    ///< Number of samples along x. 0: the terrain has no height field.
  uint32_t rows;       ///< Number of samples along z.
  uint32_t box_count;
} stridewire_terrain;

/// Arrays that receive the parts of a terrain. An array may be NULL if its capacity is 0.
typedef struct stridewire_terrain_buffers {
  float* heights_m;  ///< Receives columns * rows heights, row by row, x fastest.
  size_t height_capacity;
  stridewire_terrain_box* boxes;
  size_t box_capacity;
} stridewire_terrain_buffers;

/// Gets the terrain of a world. It is flat until the event TERRAIN. `buffers` may be NULL. Returns
/// BUFFER_TOO_SMALL if an array is too small; `terrain` then has the required counts.
stridewire_status stridewire_client_get_terrain(stridewire_client* client, stridewire_world world,
                                                stridewire_terrain* terrain,
                                                const stridewire_terrain_buffers* buffers);

/// Lists the avatars whose poses the client receives, in ascending order of their ids. Writes up to
/// `capacity` ids; `count` receives the total. `avatars` may be NULL if `capacity` is 0. Returns
/// BUFFER_TOO_SMALL if the total exceeds `capacity`.
stridewire_status stridewire_client_list_avatars(stridewire_client* client, stridewire_world world,
                                                 uint32_t* avatars, size_t capacity, size_t* count);

/// Estimates the current server time minus the smallest network delay of the last seconds. Fails
/// with NOT_READY before the first pose or pong.
stridewire_status stridewire_client_server_time(stridewire_client* client, double* time_s);

/// Gets the time at which to sample poses: the server time minus a delay. Fails with NOT_READY
/// before the first pose or pong. Unless `render_delay_s` sets the delay, the client chooses the
/// smallest delay with which poses arrive in time, and changes it smoothly: render time runs at
/// most 5 % faster or slower than the server. It jumps only
///   - in a new session,
///   - if the server's clock has changed by more than 0.25 s,
///   - if all poses of the last second arrived more than 0.25 s too late, or
///   - if, for one second, the delay has been more than 0.5 s longer than necessary.
/// A jump starts a new segment of poses.
stridewire_status stridewire_client_render_time(stridewire_client* client, double* time_s);

/// Describes how the render time adapts to the connection. Times that are not known yet are 0.
typedef struct stridewire_playout {
  double delay_s;            ///< Delay of the render time behind the server time.
  double target_delay_s;     ///< The delay that `delay_s` approaches.
  double interval_s;         ///< Longest interval between observed poses, at most 0.25 s.
  double jitter_s;           ///< Mean lateness of pose messages relative to the fastest one.
  double worst_jitter_s;     ///< Largest lateness of the last 4 s.
  double newest_age_s;       ///< Server time that has passed since the newest pose message.
  uint64_t displayed_poses;  ///< Number of sampled poses.
  /// Number of poses that were sampled after the newest pose and extrapolated from it. The motion
  /// slows down and stops within 0.25 s.
  uint64_t extrapolated_poses;
  /// Number of poses that were sampled after the newest pose without extrapolation, because the
  /// extrapolated motion had stopped or because there was no motion to extrapolate.
  uint64_t held_poses;
  uint64_t jumps;  ///< Jumps of the render time within a session.
} stridewire_playout;

/// Gets the delays of the render time and the counts of sampled poses.
stridewire_status stridewire_client_get_playout(stridewire_client* client,
                                                stridewire_playout* playout);

/// How a pose was obtained.
typedef enum stridewire_pose_kind {
  STRIDEWIRE_POSE_MISSING = 0,  ///< No pose is known for that time. Other fields are 0.
  /// Interpolated between two received poses, or equal to a received pose.
  STRIDEWIRE_POSE_INTERPOLATED = 1,
  /// A pose that does not change with time: the last pose before a discontinuity, the only pose, or
  /// the pose at the end of the extrapolation.
  STRIDEWIRE_POSE_HELD = 2,
  STRIDEWIRE_POSE_RAW = 3,  ///< A received pose, unchanged.
  /// The pose after the newest one has not arrived. The motion continues and slows down, until it
  /// stops after 0.25 s.
  STRIDEWIRE_POSE_EXTRAPOLATED = 4
} stridewire_pose_kind;

/// A pose. The caller sets `rotations_xyzw` and `joint_capacity` before a call; the call writes all
/// other fields.
typedef struct stridewire_pose {
  stridewire_pose_kind kind;
  uint32_t joint_count;
  uint64_t tick;  ///< Tick of the last received pose at or before `time_s`.
  double time_s;  ///< Server time of this pose.
  double held_s;  ///< HELD and EXTRAPOLATED: seconds since the pose of `tick`.
  float root_position_m[3];
  /// RAW: 1 if clients must not interpolate between the previous pose and this one.
  uint8_t discontinuity;
  uint8_t standing;  ///< 1: the avatar stands and its queue is empty.
  uint8_t detail;    ///< The received pose's detail, a stridewire_pose_detail.
  /// Set by the caller. Receives 4 numbers per joint. The root's rotation is relative to the world,
  /// all others are relative to the parent joint. May be NULL if `joint_capacity` is 0.
  float* rotations_xyzw;
  size_t joint_capacity;  ///< Set by the caller: number of joints that `rotations_xyzw` can hold.
  /// Poses with equal segments belong to one continuous motion. If a pose and the one displayed
  /// before have different segments, the application must not blend them. A new segment begins, for
  /// example, if the avatar has teleported, the client has reconnected, the render time has jumped,
  /// or poses arrived after the extrapolation had ended.
  uint32_t segment;
} stridewire_pose;

/// Samples the pose of an avatar at a server time. The result for an unknown avatar is
/// STRIDEWIRE_POSE_MISSING, not an error. Returns BUFFER_TOO_SMALL if `joint_capacity` is too
/// small; `joint_count` then has the required capacity. Returns OUT_OF_RANGE if `time_s` is not
/// finite.
stridewire_status stridewire_client_sample_pose(stridewire_client* client, stridewire_world world,
                                                uint32_t avatar, double time_s,
                                                stridewire_pose* pose);

/// Gets the newest received pose of an avatar. Errors are those of stridewire_client_sample_pose.
stridewire_status stridewire_client_latest_pose(stridewire_client* client, stridewire_world world,
                                                uint32_t avatar, stridewire_pose* pose);

/// Gets the oldest stored pose whose tick is above `after_tick`, or the oldest stored pose if
/// `after_tick` is UINT64_MAX. The result is STRIDEWIRE_POSE_MISSING if there is none. An
/// application that calls it more often than every `pose_history` ticks gets every received pose.
/// Errors are those of stridewire_client_sample_pose.
stridewire_status stridewire_client_next_pose(stridewire_client* client, stridewire_world world,
                                              uint32_t avatar, uint64_t after_tick,
                                              stridewire_pose* pose);

// ---------------------------------------------------------------------------------- statistics

/// Counters since the client was created.
typedef struct stridewire_statistics {
  uint64_t bytes_received;
  uint64_t bytes_sent;
  uint64_t batches_received;  ///< Number of pose batches and movement messages.
  uint64_t poses_received;
  /// Poses dropped because memory was exhausted or because they were not newer than the last one.
  uint64_t poses_refused;
  /// Number of missing batches, estimated from gaps in the ticks of each shard.
  uint64_t batches_missing;
  uint64_t dropped_batches;  ///< Batches that the server reported as dropped.
  uint64_t events_received;
  uint64_t events_dropped;  ///< Events dropped because the event queue was full.
  uint64_t commands_sent;
  uint64_t commands_resent;   ///< Commands sent again after a resume.
  uint64_t commands_waiting;  ///< Commands that are unanswered now.
  uint64_t connects;          ///< Completed handshakes.
  uint64_t resumes;           ///< Completed handshakes that resumed a session.
  uint64_t connect_failures;
  uint64_t buffered_bytes;  ///< Memory used by poses, events, commands, terrains and buffers now.
  double rtt_s;             ///< Smallest round-trip time of the last 16 pings; 0 before the first.
} stridewire_statistics;

/// Gets the statistics of a client.
stridewire_status stridewire_client_get_statistics(stridewire_client* client,
                                                   stridewire_statistics* statistics);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  // STRIDEWIRE_CLIENT_H
