#ifndef STRIDEWIRE_CLIENT_H
#define STRIDEWIRE_CLIENT_H

/// Stridewire's client: commands avatars, hears what became of it, and gives poses to show.
///
/// This C99 header is the only ABI; `stridewire/client.hpp` is a thin C++17 wrapper around it.
///
///   stridewire_client_options options;
///   stridewire_client_options_init(&options, sizeof options);
///   stridewire_client* client = NULL;
///   stridewire_client_create(&options, &client);
///   stridewire_client_connect(client, "127.0.0.1", 7420);
///   stridewire_world world;
///   stridewire_client_join_world(client, "plaza", STRIDEWIRE_CONTROLLER, &world, NULL);
///   for (;;) { poll events; request steps; sample poses at the render time }
///   stridewire_client_destroy(client);
///
/// Threads. A client has one network thread of its own. It never calls you: you poll. Every function
/// may be called from any thread; calls on one client take turns on a lock that is never held across
/// a system call that waits. stridewire_client_destroy is the last call on its client.
///
/// Memory. Whatever you pass is copied before the call returns; whatever you get is written into
/// memory of yours, whose size stands at each function. Handles are opaque; NULL is answered with
/// STRIDEWIRE_INVALID_ARGUMENT.
///
/// Connection. The client connects, and connects again, by itself: 0.1 s after a failure, doubled
/// up to 5 s, each shortened at random by up to half; forever, until the server refuses it for good
/// or you disconnect. Commands given meanwhile wait. Worlds, subscriptions and commands without an
/// answer survive:
///   - the server still held the session: commands without an answer are sent again under their old
///     numbers and done once (STRIDEWIRE_EVENT_CONNECTED with `resumed`);
///   - it did not (restarted, or away for too long): STRIDEWIRE_EVENT_SESSION_LOST. The client
///     joins and observes again, and with `respawn` puts the avatars it had spawned where they last
///     were; commands that had been sent and not answered end with STRIDEWIRE_SESSION_LOST.
///
/// Units: metres, seconds, radians. Right-handed, +Y up, heading 0 looks along +Z, turning left is
/// positive. Quaternions are unit, x, y, z, w.

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Grows when a struct of this header changes; options carry it, and create compares it.
#define STRIDEWIRE_ABI_VERSION 2

#define STRIDEWIRE_MAX_NAME_BYTES 64  /* names of worlds, clients and joints, without the final 0 */
#define STRIDEWIRE_MAX_TEXT_BYTES 160 /* texts in events, final 0 included; longer ones are cut */
#define STRIDEWIRE_MAX_ITEMS 65536    /* spawns, avatars or movements in one call */
#define STRIDEWIRE_MAX_JOINTS 256
#define STRIDEWIRE_MAX_TERRAIN_COLUMNS 1024 /* of a height field; rows as well */
#define STRIDEWIRE_MAX_TERRAIN_BOXES 65536
#define STRIDEWIRE_MAX_PARAMETERS 7

/// What came of a call or a command, in ranges by who can act: 1xx the caller, 2xx whoever made the
/// data, 3xx the network, 4xx the server's operator. x00 to x49 come from the server too (they are
/// the protocol's codes), x50 to x99 only from this library. Append only: treat a code you do not
/// know by its hundred.
///
/// Here and below an enumerator _MAX only keeps the type wide, so that any number can be passed and is
/// checked.
typedef enum stridewire_status {
  STRIDEWIRE_OK = 0,

  STRIDEWIRE_INVALID_ARGUMENT = 100,
  STRIDEWIRE_OUT_OF_RANGE = 101,
  STRIDEWIRE_UNSUPPORTED = 102,
  STRIDEWIRE_VERSION_MISMATCH = 103,
  STRIDEWIRE_UNAUTHORISED = 104,
  STRIDEWIRE_NOT_ALLOWED = 105,
  STRIDEWIRE_NOT_JOINED = 106,
  STRIDEWIRE_NO_SUCH_WORLD = 107,
  STRIDEWIRE_NO_SUCH_AVATAR = 108,
  STRIDEWIRE_AVATAR_EXISTS = 109,
  STRIDEWIRE_NO_SUCH_SUBSCRIPTION = 110,
  STRIDEWIRE_SUBSCRIPTION_EXISTS = 111,
  STRIDEWIRE_BAD_SEQUENCE = 112,
  STRIDEWIRE_FORGOTTEN = 113,
  STRIDEWIRE_UNEXPECTED_MESSAGE = 114,
  STRIDEWIRE_ALREADY_JOINED = 115,
  STRIDEWIRE_BUFFER_TOO_SMALL = 150,
  STRIDEWIRE_COMMANDS_FULL = 151,
  STRIDEWIRE_CLOSED = 152,
  STRIDEWIRE_ALREADY_CONNECTED = 153,
  STRIDEWIRE_CANCELLED = 154,

  STRIDEWIRE_MALFORMED = 200,
  STRIDEWIRE_NO_MOVEMENT = 201,
  STRIDEWIRE_PROTOCOL_ERROR = 250,

  STRIDEWIRE_TIMEOUT = 300,
  STRIDEWIRE_TOO_SLOW = 301,
  STRIDEWIRE_HOST_NOT_FOUND = 350,
  STRIDEWIRE_CONNECT_FAILED = 351,
  STRIDEWIRE_CONNECTION_LOST = 352,
  STRIDEWIRE_SESSION_LOST = 353,
  STRIDEWIRE_NOT_READY = 354,

  STRIDEWIRE_LIMIT_REACHED = 400,
  STRIDEWIRE_QUEUE_FULL = 401,
  STRIDEWIRE_SHUTTING_DOWN = 402,
  STRIDEWIRE_INTERNAL = 403,
  STRIDEWIRE_REPLACED = 404,
  STRIDEWIRE_OUT_OF_MEMORY = 450,
  STRIDEWIRE_STATUS_MAX = 0x7fffffff
} stridewire_status;

/// Stable lower-case name, e.g. "no_such_avatar"; "unknown" for a code this library does not know.
const char* stridewire_status_name(stridewire_status status);

/// One sentence for a person; for an unknown code one by its hundred. Never NULL.
const char* stridewire_status_text(stridewire_status status);

/// Version of the library, e.g. "0.1.0".
const char* stridewire_version(void);

// ---------------------------------------------------------------------------------- the client

typedef struct stridewire_client stridewire_client;

/// A world you joined, numbered by this library from 1; the number stays over reconnects.
typedef uint32_t stridewire_world;

typedef struct stridewire_client_options {
  size_t struct_bytes;    ///< sizeof(stridewire_client_options); set by _init.
  uint32_t abi_version;   ///< STRIDEWIRE_ABI_VERSION; set by _init.
  uint32_t max_events;    ///< Events waiting to be polled, 16 to 2^24; then the oldest goes. 65536.
  uint32_t max_commands;  ///< Commands without an answer, 1 to 2^20; then COMMANDS_FULL. 4096.
  uint32_t pose_history;  ///< Poses kept per avatar, 2 to 4096. 32.
  size_t max_command_bytes;  ///< Memory of those commands, at least 64 KiB. 64 MiB.
  size_t
      max_pose_bytes;  ///< Memory of all pose histories, at least 64 KiB; avatars that do not fit
                       ///< are left out and counted. 256 MiB.
  double render_delay_s;     ///< How far shown poses are behind the newest, 0 to 10. 0.1.
  double connect_timeout_s;  ///< For TCP, and again for the handshake, 0.01 to 600. 5.
  double ping_interval_s;    ///< 0.01 to 600; at most a third of the server's idle limit. 1.
  uint64_t seed;             ///< Of the back-off's jitter; 0: from the machine.
  const char* client_name;   ///< For the server's log, 1 to STRIDEWIRE_MAX_NAME_BYTES bytes.
  const char* auth_token;    ///< NULL or at most 4096 bytes.
  uint8_t respawn;  ///< 1: after a lost session spawn the avatars this client had spawned again, at
                    ///< the last base frame it heard of. 0.
  const char*
      library_folder;  ///< Where libraries fetched for STRIDEWIRE_MOVEMENT are kept for the next
                       ///< time, made if it is not there; NULL: nowhere. At most 4096 bytes.
} stridewire_client_options;

/// Writes the defaults. `struct_bytes` is sizeof(stridewire_client_options).
void stridewire_client_options_init(stridewire_client_options* options, size_t struct_bytes);

/// Makes a client that is not connected, and starts its thread. `options` may be NULL.
/// INVALID_ARGUMENT, OUT_OF_RANGE (an option), VERSION_MISMATCH (another header), OUT_OF_MEMORY.
stridewire_status stridewire_client_create(const stridewire_client_options* options,
                                           stridewire_client** client);

/// Says goodbye if connected (waits at most 1 s for it to go out) and frees the client. NULL is fine.
void stridewire_client_destroy(stridewire_client* client);

/// Begins to connect and returns at once. `host` is a name or address of at most 255 bytes.
/// INVALID_ARGUMENT, ALREADY_CONNECTED (call disconnect first).
stridewire_status stridewire_client_connect(stridewire_client* client, const char* host,
                                            uint16_t port);

/// Ends the session and returns at once: the server forgets it, its avatars live on. Commands
/// without an answer end with STRIDEWIRE_CANCELLED. Worlds and poses are forgotten.
stridewire_status stridewire_client_disconnect(stridewire_client* client);

typedef enum stridewire_client_state {
  STRIDEWIRE_STATE_IDLE = 0,        ///< Never connected, or disconnected by you.
  STRIDEWIRE_STATE_CONNECTING = 1,  ///< Connecting, or waiting to try again.
  STRIDEWIRE_STATE_READY = 2,       ///< The server has welcomed this client.
  STRIDEWIRE_STATE_CLOSED = 3       ///< The server refused for good; connect again if it may help.
} stridewire_client_state;

stridewire_client_state stridewire_client_get_state(stridewire_client* client);

/// Why the last connection attempt or connection failed; STRIDEWIRE_OK if none did. `text` gets at
/// most `text_bytes` bytes, cut, always ended by 0; it may be NULL when `text_bytes` is 0.
stridewire_status stridewire_client_last_error(stridewire_client* client, char* text,
                                               size_t text_bytes);

// ------------------------------------------------------------------------------------ commands
//
// A command is given to the network thread and returns at once. `command`, which may be NULL, gets
// its number; STRIDEWIRE_EVENT_REPLY carries the same number when the answer is there. Bad arguments
// are told at once and nothing is sent. All: INVALID_ARGUMENT, OUT_OF_RANGE, COMMANDS_FULL, CLOSED
// (not connected and not about to), NO_SUCH_WORLD (not a number that join_world gave), NOT_JOINED
// (the server refused, or it was left).

typedef enum stridewire_role {
  STRIDEWIRE_CONTROLLER = 0,  ///< May command avatars; hears all events of the world.
  STRIDEWIRE_OBSERVER = 1,    ///< Only watches.
  STRIDEWIRE_ROLE_MAX = 0x7fffffff
} stridewire_role;

/// `world` gets the number to use at once; commands to it wait until the server has let us in.
/// ALREADY_JOINED: that name is joined already. At most 256 worlds at a time: LIMIT_REACHED.
stridewire_status stridewire_client_join_world(stridewire_client* client, const char* name,
                                               stridewire_role role, stridewire_world* world,
                                               uint64_t* command);

stridewire_status stridewire_client_leave_world(stridewire_client* client, stridewire_world world,
                                                uint64_t* command);

typedef struct stridewire_spawn {
  uint32_t avatar;  ///< Its number in the world; 0: the server chooses, EVENT_ITEM tells.
  double position_m[3];
  double heading_rad;
} stridewire_spawn;

/// `count` is 1 to STRIDEWIRE_MAX_ITEMS, as everywhere below.
stridewire_status stridewire_client_spawn(stridewire_client* client, stridewire_world world,
                                          const stridewire_spawn* spawns, size_t count,
                                          uint64_t* command);

stridewire_status stridewire_client_remove(stridewire_client* client, stridewire_world world,
                                           const uint32_t* avatars, size_t count,
                                           uint64_t* command);

typedef enum stridewire_movement_type {
  STRIDEWIRE_STEP = 0,
  STRIDEWIRE_JUMP = 1,
  STRIDEWIRE_STAND = 2,
  STRIDEWIRE_WALK = 3,  ///< To a place, in as many steps as it takes.
  STRIDEWIRE_MOVEMENT_TYPE_MAX = 0x7fffffff
} stridewire_movement_type;

typedef enum stridewire_foot {
  STRIDEWIRE_FOOT_AUTO = 0,  ///< The other foot than last time.
  STRIDEWIRE_FOOT_LEFT = 1,
  STRIDEWIRE_FOOT_RIGHT = 2,
  STRIDEWIRE_FOOT_MAX = 0x7fffffff
} stridewire_foot;

/// When a movement begins, and what becomes of those before it.
typedef enum stridewire_interrupt {
  STRIDEWIRE_QUEUED = 0,          ///< After all that is queued.
  STRIDEWIRE_AFTER_MOVEMENT = 1,  ///< After the movement under way; the queue is dropped.
  STRIDEWIRE_NOW = 2,             ///< As soon as feet allow; the queue is dropped.
  STRIDEWIRE_TAKEOVER_MAX = 0x7fffffff
} stridewire_interrupt;

typedef struct stridewire_movement {
  uint32_t avatar;      ///< Not 0.
  uint64_t request_id;  ///< Yours, not 0; comes back in events.
  stridewire_movement_type type;
  stridewire_foot foot;  ///< Step.
  double length_m;       ///< Step: forward distance between the feet at its end. Jump.
  double side_m;         ///< Step, if has_side: sideways, towards the moving foot's own side.
  double height_m;       ///< Step, jump.
  double turn_rad;       ///< Step, jump.
  double seconds;        ///< Stand.
  uint8_t has_side;      ///< 0: the server takes a natural one.
  uint8_t has_at;       ///< Step: 1: it lands at `at_m` instead of a length, side, height and turn.
  uint8_t has_heading;  ///< Step, if has_at: 0: the server chooses.
  double at_m[3];       ///< Where the ball of the foot lands, in the world. Walk: where it ends.
  double heading_rad;   ///< Where the foot looks. Walk: the heading at its end.
  const double* waypoints_m;  ///< Walk: x, y, z of each place to pass, 3 * waypoint_count numbers.
  size_t waypoint_count;      ///< At most STRIDEWIRE_MAX_WAYPOINTS.
  uint8_t has_speed;          ///< Walk: 0: as is comfortable.
  double speed_m_s;  ///< Walk, if has_speed: 0.05 to 5, as near as the library's steps come.
  stridewire_interrupt interrupt;
  uint8_t
      exact_only;  ///< Step, only if has_at: 1: when it cannot land there it is REJECTED, not done elsewhere.
} stridewire_movement;

#define STRIDEWIRE_MAX_WAYPOINTS 64

/// Queues movements; an avatar may stand in the list several times, and does them in order. The REPLY
/// is UNSUPPORTED when one of them has `has_at` and the server knows no footprints, or is a walk and it
/// knows no walks, or takes over and it knows no takeovers, or must be met and it knows no refusals. A walk's steps come
/// in events with its request_id; then FINISHED of kind STAND says it has arrived, REJECTED why it goes no further.
stridewire_status stridewire_client_request(stridewire_client* client, stridewire_world world,
                                            const stridewire_movement* movements, size_t count,
                                            uint64_t* command);

/// Drops what these avatars have not started yet.
stridewire_status stridewire_client_cancel(stridewire_client* client, stridewire_world world,
                                           const uint32_t* avatars, size_t count,
                                           uint64_t* command);

/// Heights at the corners of a grid, bilinear between them.
typedef struct stridewire_height_field {
  double origin_m[2];      ///< x and z of the first.
  double cell_m;           ///< From one to the next, 0.01 to 1000.
  uint32_t columns;        ///< Along x, 2 to STRIDEWIRE_MAX_TERRAIN_COLUMNS.
  uint32_t rows;           ///< Along z, the same.
  const float* heights_m;  ///< columns * rows numbers, row by row, x fastest.
} stridewire_height_field;

/// A block with upright sides and a flat top.
typedef struct stridewire_terrain_box {
  double min_m[2];  ///< x and z.
  double max_m[2];
  double height_m;
} stridewire_terrain_box;

/// Gives a world another ground, for all its avatars: the highest of the height field (0 beside it)
/// and the boxes there. `height_field` may be NULL, `box_count` 0; neither: flat at 0. The REPLY is
/// OUT_OF_RANGE or LIMIT_REACHED when the server takes no such ground, UNSUPPORTED when it knows none.
stridewire_status stridewire_client_set_terrain(stridewire_client* client, stridewire_world world,
                                                const stridewire_height_field* height_field,
                                                const stridewire_terrain_box* boxes,
                                                size_t box_count, uint64_t* command);

/// A clip of the library over what an avatar does (waving, carrying); legs do what they do without.
/// stridewire_client_list_layers tells which there are.
typedef struct stridewire_layer {
  uint32_t avatar;   ///< Not 0.
  const char* name;  ///< 1 to STRIDEWIRE_MAX_NAME_BYTES bytes.
  uint8_t off;       ///< 1: eases it out and ends it; weight and speed then mean nothing.
  double weight;     ///< Above 0, up to 1.
  double blend_s;    ///< How long weight and speed take to get there, 0 to 10.
  double speed;      ///< 0.1 to 4; 1: as recorded.
} stridewire_layer;

/// Starts and ends layers; at most four at a time for an avatar. The REPLY is UNSUPPORTED when the
/// server knows none; an ITEM is NO_MOVEMENT when the library has no such layer.
stridewire_status stridewire_client_set_layers(stridewire_client* client, stridewire_world world,
                                               const stridewire_layer* layers, size_t count,
                                               uint64_t* command);

/// Feet stand still where they land (1, as at first) or are where the examples have them (0): of each avatar from the
/// next movement on that it begins. What must be met is refused while they are not planted. The REPLY is UNSUPPORTED
/// when the server knows no such command; an ITEM is NO_MOVEMENT when the library's legs can not be planted.
stridewire_status stridewire_client_set_planting(stridewire_client* client, stridewire_world world,
                                                 const uint32_t* avatars, size_t count, uint8_t on,
                                                 uint64_t* command);

typedef enum stridewire_pose_mode {
  STRIDEWIRE_FULL = 0,  ///< float32: as the server has them.
  /// No joint or end site is off by more than 1 mm (0.00016 rad a joint from servers of before compact poses).
  STRIDEWIRE_QUANTISED = 1,
  /// What avatars begin instead of their poses, which are evaluated here: those of STRIDEWIRE_FULL, bit by
  /// bit, at some 150 bytes a step. The world's library is fetched first, if it is not in library_folder; the Observe and what
  /// is asked of that world behind it wait meanwhile. UNSUPPORTED, MALFORMED: the server has not this mode, or no such library.
  /// An avatar takes a microsecond a tick and up to 16 KiB, at most max_pose_bytes in all; others are left out.
  STRIDEWIRE_MOVEMENT = 2,
  STRIDEWIRE_POSE_MODE_MAX = 0x7fffffff
} stridewire_pose_mode;

/// How much of a pose is told, of QUANTISED ones. The joints that are not told come back as the references of the
/// server's codes: about as the library's figures mostly hold them.
typedef enum stridewire_pose_detail {
  STRIDEWIRE_DETAIL_ALL = 0,
  /// Without those that move nothing by more than 0.12 m: hands, toes, the head; for who is seen from afar.
  STRIDEWIRE_DETAIL_FEWER = 1,
  STRIDEWIRE_DETAIL_ROOT = 2,  ///< Where the figure is and how it is turned, 18 bytes.
  STRIDEWIRE_POSE_DETAIL_MAX = 0x7fffffff
} stridewire_pose_detail;

typedef struct stridewire_observation {
  stridewire_pose_mode mode;
  uint16_t every_n_ticks;   ///< 1 to 3600
  uint8_t with_events;      ///< 1: events of the world, too (controllers get them anyway).
  const uint32_t* avatars;  ///< NULL: all. Poses of others are not kept.
  size_t avatar_count;
  /// INVALID_ARGUMENT beside another mode than QUANTISED; UNSUPPORTED, in the command's REPLY: a server without them.
  stridewire_pose_detail detail;
} stridewire_observation;

/// `subscription` gets the number for stridewire_client_stop_observing. Observing one world twice is
/// possible; of one tick and avatar the pose that came first is kept.
stridewire_status stridewire_client_observe(stridewire_client* client, stridewire_world world,
                                            const stridewire_observation* observation,
                                            uint32_t* subscription, uint64_t* command);

#define STRIDEWIRE_MAX_RATE_RINGS 4

/// Within `to_m` of a region's centre poses come every so many ticks.
typedef struct stridewire_rate_ring {
  double to_m;             ///< Above 0 and above that of the ring before.
  uint16_t every_n_ticks;  ///< 1 to 3600
} stridewire_rate_ring;

/// A circle on the ground. Avatars whose root comes within its radius enter.
typedef struct stridewire_region {
  double x, z;      ///< Its centre, in metres.
  double radius_m;  ///< Above 0.
  double
      leave_m;  ///< Who is inside leaves when further than radius and this; negative: the server chooses.
  const stridewire_rate_ring*
      rings;          ///< From the inner one on; beyond them the observation's rate and detail.
  size_t ring_count;  ///< At most STRIDEWIRE_MAX_RATE_RINGS.
  /// In which detail poses come within each ring, `ring_count` of them; NULL: the observation's, as beyond them. Of
  /// QUANTISED poses only, and of servers as stridewire_observation.detail.
  const stridewire_pose_detail* ring_details;
} stridewire_region;

/// As stridewire_client_observe, of who is in a region: `observation->avatars` is NULL. Who comes and goes is told
/// by events. A region is all that a client observes of a world (NOT_ALLOWED). UNSUPPORTED, in the command's
/// reply: an older server.
stridewire_status stridewire_client_observe_region(stridewire_client* client,
                                                   stridewire_world world,
                                                   const stridewire_observation* observation,
                                                   const stridewire_region* region,
                                                   uint32_t* subscription, uint64_t* command);

/// Puts another region in the place of the one that a subscription observes, as a player walks. Who is in both
/// neither leaves nor enters.
stridewire_status stridewire_client_move_region(stridewire_client* client, uint32_t subscription,
                                                const stridewire_region* region, uint64_t* command);

stridewire_status stridewire_client_stop_observing(stridewire_client* client, uint32_t subscription,
                                                   uint64_t* command);

/// Sends a ping now; STRIDEWIRE_EVENT_PONG tells the round trip. NOT_READY when not connected.
stridewire_status stridewire_client_ping(stridewire_client* client);

// -------------------------------------------------------------------------------------- events

typedef enum stridewire_event_type {
  // This connection.
  STRIDEWIRE_EVENT_CONNECTED = 0,        ///< resumed
  STRIDEWIRE_EVENT_CONNECT_FAILED = 1,   ///< status, text; another attempt follows
  STRIDEWIRE_EVENT_CONNECTION_LOST = 2,  ///< status, text; attempts follow
  STRIDEWIRE_EVENT_SESSION_LOST = 3,     ///< The server knows nothing of us any more.
  STRIDEWIRE_EVENT_CLOSED = 4,           ///< status, text; no attempt follows
  STRIDEWIRE_EVENT_WORLD_JOINED = 5,  ///< world; its skeleton is there. Again after SESSION_LOST.
  STRIDEWIRE_EVENT_REPLY = 6,         ///< command, status, accepted, text
  STRIDEWIRE_EVENT_ITEM =
      7,  ///< command, item_index, avatar, request_id, status, text: an item that
          ///< was refused, or the number the server chose; before its REPLY
  STRIDEWIRE_EVENT_LAGGING = 8,  ///< dropped_batches, dropped_events: we read too slowly
  STRIDEWIRE_EVENT_NOTICE = 9,   ///< status, text: something the server has to say
  STRIDEWIRE_EVENT_PONG = 10,    ///< rtt_s
  STRIDEWIRE_EVENT_TERRAIN =
      11,  ///< world: it has another ground, see stridewire_client_get_terrain

  // A world: world, avatar, tick, time_s.
  STRIDEWIRE_EVENT_ACCEPTED = 32,     ///< request_id was queued
  STRIDEWIRE_EVENT_STARTED = 33,      ///< request_id, kind, group, requested, applied, flags
  STRIDEWIRE_EVENT_FOOT_STRIKE = 34,  ///< foot, position_m
  STRIDEWIRE_EVENT_FINISHED = 35,     ///< request_id, base: the new base frame
  STRIDEWIRE_EVENT_IDLE = 36,         ///< standing with nothing queued; base
  STRIDEWIRE_EVENT_REJECTED =
      37,  ///< request_id turned out impossible: status, text; when it must be met and
           ///< is out of reach also foot, kind, position_m: the nearest in reach
  STRIDEWIRE_EVENT_SPAWNED = 38,  ///< base
  STRIDEWIRE_EVENT_REMOVED = 39,
  STRIDEWIRE_EVENT_ENTERED = 40,  ///< the region observed, see stridewire_client_observe_region
  STRIDEWIRE_EVENT_LEFT = 41      ///< that region, or the world
} stridewire_event_type;

typedef enum stridewire_movement_kind {
  STRIDEWIRE_KIND_STEP_LEFT = 0,
  STRIDEWIRE_KIND_STEP_RIGHT = 1,
  STRIDEWIRE_KIND_JUMP = 2,
  STRIDEWIRE_KIND_STAND = 3
} stridewire_movement_kind;

/// Names: 0 start_x_m, 1 start_y_m, 2 start_z_m, 3 end_x_m, 4 end_y_m, 5 end_z_m, 6 turn_rad,
/// 7 length_m, 8 height_m (moving foot minus fixed foot, in the base frame).
typedef struct stridewire_parameters {
  double values[STRIDEWIRE_MAX_PARAMETERS];
  uint8_t names[STRIDEWIRE_MAX_PARAMETERS];
  uint8_t count;
} stridewire_parameters;

/// Fields that a type does not name are zero.
typedef struct stridewire_event {
  stridewire_event_type type;
  stridewire_status status;
  uint64_t command;
  uint64_t request_id;  ///< 0: the avatar's own doing.
  uint64_t tick;
  double time_s;  ///< On the server's clock, as poses have it.
  stridewire_world world;
  uint32_t avatar;
  uint32_t item_index;
  uint32_t accepted;  ///< How many items of the command were done.
  stridewire_movement_kind kind;
  stridewire_foot foot;
  int32_t group;  ///< -1: none.
  uint8_t resumed;
  uint8_t extrapolated;
  uint8_t clamped;
  uint8_t cut_short;  ///< FINISHED: another movement took over before its end.
  double position_m[3];
  double base_position_m[3];
  double base_heading_rad;
  stridewire_parameters requested;
  stridewire_parameters applied;
  double rtt_s;
  uint64_t dropped_batches;
  uint64_t dropped_events;
  uint64_t events_dropped_before;  ///< Events lost before this one, for `max_events` were waiting.
  char text[STRIDEWIRE_MAX_TEXT_BYTES];
} stridewire_event;

/// Takes the oldest events, at most `capacity` of them. `events` holds `capacity` of them; `count`
/// gets how many were written, 0 when there is none.
stridewire_status stridewire_client_poll_events(stridewire_client* client, stridewire_event* events,
                                                size_t capacity, size_t* count);

/// Waits until an event is there, or for `timeout_s` (0 to 3600). Returns STRIDEWIRE_TIMEOUT then.
stridewire_status stridewire_client_wait_event(stridewire_client* client, double timeout_s);

// --------------------------------------------------------------------------------------- poses

typedef struct stridewire_joint {
  char name[STRIDEWIRE_MAX_NAME_BYTES + 1];
  int32_t parent;  ///< Smaller than its own index; -1 for the root, which comes first.
  float offset_m[3];
} stridewire_joint;

typedef struct stridewire_end_site {
  uint32_t joint;
  float offset_m[3];
} stridewire_end_site;

typedef struct stridewire_leg {
  int32_t hip;  ///< Joints; -1: not known.
  int32_t knee;
  int32_t ankle;
  int32_t ball;
  float ball_offset_m[3];
  float toe_tip_offset_m[3];
} stridewire_leg;

typedef struct stridewire_skeleton {
  uint32_t joint_count;
  uint32_t end_site_count;
  stridewire_leg legs[2];  ///< Left, right.
  double tick_hz;
  char library_hash[STRIDEWIRE_MAX_NAME_BYTES + 1];
} stridewire_skeleton;

/// Describes the figure of a world. Writes at most `joint_capacity` joints and `end_site_capacity`
/// end sites (either array may be NULL with capacity 0); BUFFER_TOO_SMALL when there are more, with
/// the counts in `skeleton`. NOT_READY until STRIDEWIRE_EVENT_WORLD_JOINED.
stridewire_status stridewire_client_get_skeleton(stridewire_client* client, stridewire_world world,
                                                 stridewire_skeleton* skeleton,
                                                 stridewire_joint* joints, size_t joint_capacity,
                                                 stridewire_end_site* end_sites,
                                                 size_t end_site_capacity);

/// One of the layers of a world's library, for stridewire_client_set_layers.
typedef struct stridewire_layer_name {
  char name[STRIDEWIRE_MAX_NAME_BYTES + 1];
} stridewire_layer_name;

/// The layers of a world's library; none where the server knows no layers. Writes at most `capacity` names
/// (`names` may be NULL with capacity 0); `count` gets how many there are, at most 64. BUFFER_TOO_SMALL when there are
/// more. NOT_READY until STRIDEWIRE_EVENT_WORLD_JOINED.
stridewire_status stridewire_client_list_layers(stridewire_client* client, stridewire_world world,
                                                stridewire_layer_name* names, size_t capacity,
                                                size_t* count);

typedef struct stridewire_terrain {
  double origin_m[2];
  double cell_m;
  uint32_t columns;  ///< 0: there is no height field.
  uint32_t rows;
  uint32_t box_count;
} stridewire_terrain;

/// The ground of a world, flat until STRIDEWIRE_EVENT_TERRAIN. Writes at most `height_capacity`
/// heights (of columns * rows, row by row) and `box_capacity` boxes; either array may be NULL with
/// capacity 0. BUFFER_TOO_SMALL when there are more, with the counts in `terrain`.
stridewire_status stridewire_client_get_terrain(stridewire_client* client, stridewire_world world,
                                                stridewire_terrain* terrain, float* heights_m,
                                                size_t height_capacity,
                                                stridewire_terrain_box* boxes, size_t box_capacity);

/// Avatars whose poses arrive, in growing order. Writes at most `capacity` numbers; `count` gets how
/// many there are. BUFFER_TOO_SMALL when there are more (`avatars` may be NULL with capacity 0).
stridewire_status stridewire_client_list_avatars(stridewire_client* client, stridewire_world world,
                                                 uint32_t* avatars, size_t capacity, size_t* count);

/// Time now on the server's clock as poses arrive: the smallest delay of the last seconds is counted
/// as none. NOT_READY until the first pose or pong.
stridewire_status stridewire_client_server_time(stridewire_client* client, double* time_s);

/// The time to show poses at: server time minus `render_delay_s`. Moves evenly, never back but when
/// the clock itself was set anew (a new session, a jump of more than 0.25 s).
stridewire_status stridewire_client_render_time(stridewire_client* client, double* time_s);

typedef enum stridewire_pose_kind {
  STRIDEWIRE_POSE_MISSING = 0,       ///< Nothing known for that time; no other field is set.
  STRIDEWIRE_POSE_INTERPOLATED = 1,  ///< Between two received poses, or exactly one.
  STRIDEWIRE_POSE_HELD = 2,          ///< The last pose before that time, nothing to go on to: none
                                     ///< came since, or the next one is not continuous with it.
  STRIDEWIRE_POSE_RAW = 3            ///< As received.
} stridewire_pose_kind;

typedef struct stridewire_pose {
  stridewire_pose_kind kind;
  uint32_t joint_count;
  uint64_t tick;  ///< Of the received pose at or before the time.
  double time_s;  ///< On the server's clock: of this pose.
  double held_s;  ///< HELD: how long after its last received pose.
  float root_position_m[3];
  uint8_t discontinuity;  ///< RAW: not to be interpolated from the pose before.
  uint8_t standing;       ///< Standing, nothing queued.
  uint8_t detail;         ///< stridewire_pose_detail it was sent with.
} stridewire_pose;

/// Pose of an avatar at a time of the server's clock. `rotations_xyzw` gets 4 numbers a joint, the
/// root's in the world, the others relative to their parent; it holds `joint_capacity` joints.
/// An avatar that is not there is no error: STRIDEWIRE_POSE_MISSING. BUFFER_TOO_SMALL.
stridewire_status stridewire_client_sample_pose(stridewire_client* client, stridewire_world world,
                                                uint32_t avatar, double time_s,
                                                stridewire_pose* pose, float* rotations_xyzw,
                                                size_t joint_capacity);

/// The newest pose received.
stridewire_status stridewire_client_latest_pose(stridewire_client* client, stridewire_world world,
                                                uint32_t avatar, stridewire_pose* pose,
                                                float* rotations_xyzw, size_t joint_capacity);

/// The oldest pose kept whose tick is greater than `after_tick` (UINT64_MAX: the oldest kept). Polled
/// more often than `pose_history` ticks this gives every pose that arrived.
stridewire_status stridewire_client_next_pose(stridewire_client* client, stridewire_world world,
                                              uint32_t avatar, uint64_t after_tick,
                                              stridewire_pose* pose, float* rotations_xyzw,
                                              size_t joint_capacity);

// ---------------------------------------------------------------------------------- statistics

/// Counted since the client was created.
typedef struct stridewire_statistics {
  uint64_t bytes_received;
  uint64_t bytes_sent;
  uint64_t batches_received;
  uint64_t poses_received;
  uint64_t poses_refused;    ///< For no memory was left for that avatar, or its tick was old.
  uint64_t batches_missing;  ///< By gaps in the ticks of a shard.
  uint64_t dropped_batches;  ///< By the server, as it told.
  uint64_t events_received;
  uint64_t events_dropped;  ///< By us, because nobody polled.
  uint64_t commands_sent;
  uint64_t commands_resent;
  uint64_t commands_waiting;  ///< Without an answer now.
  uint64_t connects;          ///< Times that the server welcomed us.
  uint64_t resumes;           ///< Of which with the session still there.
  uint64_t connect_failures;
  uint64_t buffered_bytes;  ///< Memory of poses, events and commands now.
  double rtt_s;             ///< Smallest of the last pings; 0 before the first.
} stridewire_statistics;

stridewire_status stridewire_client_get_statistics(stridewire_client* client,
                                                   stridewire_statistics* statistics);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  // STRIDEWIRE_CLIENT_H
