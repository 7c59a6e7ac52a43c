#ifndef STRIDEWIRE_LIMITS_H
#define STRIDEWIRE_LIMITS_H

/// Maximum length of the name of a world, client, layer or joint, in bytes without the final 0.
#define STRIDEWIRE_MAX_NAME_BYTES 64
/// Size of the text in an event, including the terminating 0. Longer texts are truncated.
#define STRIDEWIRE_MAX_TEXT_BYTES 160
/// Maximum number of server addresses of a client.
#define STRIDEWIRE_MAX_ADDRESSES 16
/// Maximum number of spawns, avatars or movements per call.
#define STRIDEWIRE_MAX_ITEMS 65536
/// Maximum number of joints of a skeleton.
#define STRIDEWIRE_MAX_JOINTS 256
/// Maximum number of columns, and of rows, of a height field.
#define STRIDEWIRE_MAX_TERRAIN_COLUMNS 1024
/// Maximum number of boxes of a terrain.
#define STRIDEWIRE_MAX_TERRAIN_BOXES 65536
/// Maximum number of parameters of a movement.
#define STRIDEWIRE_MAX_PARAMETERS 7
/// Maximum number of waypoints of a walk.
#define STRIDEWIRE_MAX_WAYPOINTS 64
/// Maximum number of rings of a region.
#define STRIDEWIRE_MAX_RATE_RINGS 4

#endif  // STRIDEWIRE_LIMITS_H
