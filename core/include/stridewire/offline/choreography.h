#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/offline/synthesis.h"
#include "stridewire/runtime/avatar.h"
#include "stridewire/runtime/movement_request.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

/// Limits on a choreography; beyond one of them reading ends with kLimitExceeded.
inline constexpr std::size_t kMaxChoreographyBytes = std::size_t{4} << 20;
inline constexpr std::size_t kMaxChoreographyMovements = 65'536;
inline constexpr int kMaxChoreographyDepth = 16;  ///< Arrays and objects nested in each other.
inline constexpr double kMaxChoreographyPositionM = 1e5;   ///< Each coordinate of the start.
inline constexpr double kMaxChoreographyHeadingRad = 1e4;  ///< Of the start, either sign.

/// Movements asked for one after the other, and where the avatar stands before the first.
///
///   {"start":{"position_m":[0,0,0],"heading_rad":0},
///    "terrain":{…as in terrain_file.h…},
///    "movements":[{"step":{"length_m":0.6}},
///                 {"step":{"foot":"left","length_m":0.5,"side_m":0.1,"height_m":0.15,"turn_rad":0.3}},
///                 {"step":{"foot":"right","at_m":[0,0,2],"heading_rad":0,"exact_only":true}},
///                 {"walk_to":{"position_m":[3,0,5],"heading_rad":1.6,"waypoints_m":[[0,0,4]],"speed_m_s":1}},
///                 {"jump":{"length_m":0.9,"height_m":0,"turn_rad":0}},
///                 {"layer":{"name":"wave","weight":0.8,"blend_s":0.5,"speed":1}},
///                 {"layer":{"name":"wave","off":true}},
///                 {"stand":{"seconds":1.5}}]}
///
/// `start` and what is in it may be left out (the origin, heading 0), and so may `terrain` (flat at
/// y = 0). A step and a jump need `length_m`, a stand `seconds`; the rest may be left out. A key
/// that is not listed here is an error, so is one that stands twice. A step's `at_m`, where the ball
/// of its foot lands in the world, stands instead of length, side, height and turn; the `heading_rad`
/// of that footprint may be left out, and so may `exact_only`, with which the step is left out if that is out of
/// reach. A `walk_to` needs position and heading. A `layer` takes no time: it begins, changes or (`off`) ends when the
/// movement after it begins; it needs a `name`.
struct Choreography {
  BaseFrame start;
  std::shared_ptr<const Terrain> terrain;  ///< Null: flat ground.
  /// 1 to kMaxChoreographyMovements with the layers; an id is 1 more than the place in the list: 1, 2, 3, … without.
  std::vector<MovementRequest> movements;
  std::vector<LayerCue> layers;
};

/// Reads a choreography. Numbers are checked against the limits of requests (movement_request.h);
/// whether a library has such movements is for ValidateRequest to say.
///
/// Errors: kNotFound, kIo with `where` = file; kMalformed with "file:line:column" where the text is
/// not JSON; kMalformed, kOutOfRange, kShapeMismatch, kUnsupported with the field, e.g.
/// "c.json: movements[3].step.length_m"; kLimitExceeded with file or field.
[[nodiscard]] Expected<Choreography> ReadChoreography(const std::filesystem::path& path);

/// As above, from text in memory; `name` takes the path's place.
[[nodiscard]] Expected<Choreography> ParseChoreography(std::string_view text,
                                                       std::string_view name);

}  // namespace stridewire
