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

/// Limits on a choreography. A file that exceeds one of these three is rejected with
/// kLimitExceeded.
inline constexpr std::size_t kMaxChoreographyBytes = std::size_t{4} << 20;
inline constexpr std::size_t kMaxChoreographyMovements = 65'536;
inline constexpr int kMaxChoreographyDepth = 16;  ///< Maximum depth of nested JSON values.
/// Maximum magnitude of every coordinate in a choreography, except in its terrain. Larger ones are
/// rejected with kOutOfRange.
inline constexpr double kMaxChoreographyPositionM = 1e5;
/// Maximum magnitude of every heading in a choreography. Larger ones are rejected with kOutOfRange.
inline constexpr double kMaxChoreographyHeadingRad = 1e4;

/// A start position and a list of movements that an avatar plays one after the other. As JSON:
///
///   {"start": {"position_m": [0, 0, 0], "heading_rad": 0},
///    "terrain": {"boxes": [{"min_m": [1, 1], "max_m": [2, 3], "height_m": 0.2}]},
///    "movements": [
///      {"step": {"length_m": 0.6}},
///      {"step": {"foot": "left", "length_m": 0.5, "side_m": 0.1, "height_m": 0.15,
///                "turn_rad": 0.3}},
///      {"step": {"foot": "right", "at_m": [0, 0, 2], "heading_rad": 0, "exact_only": true}},
///      {"walk_to": {"position_m": [3, 0, 5], "heading_rad": 1.6, "waypoints_m": [[0, 0, 4]],
///                   "speed_m_s": 1}},
///      {"jump": {"length_m": 0.9, "height_m": 0, "turn_rad": 0}},
///      {"layer": {"name": "wave", "weight": 0.8, "blend_s": 0.5, "speed": 1}},
///      {"layer": {"name": "wave", "enabled": false}},
///      {"stand": {"seconds": 1.5}}]}
///
/// `movements` is required. `start` and its fields are optional (default: the origin, heading 0),
/// and so is `terrain` (default: flat at y = 0). Unknown and duplicate keys are errors.
///
/// - terrain: `boxes` and `height_field` are optional. A height field requires `origin_m` ([x, z]),
///   `cell_m`, `columns`, `rows` and `heights_m` (row by row, x fastest).
/// - step: requires either `length_m`, with optional `side_m`, `height_m` and `turn_rad`, or
///   `at_m`, the world position where the ball of the foot lands. With `at_m`, the heading of the
///   footprint, `heading_rad`, is optional. With `exact_only`, the step is skipped if the foot
///   cannot land exactly at the requested place. `exact_only` and `allow_nearest` cannot be
///   combined.
/// - step and jump: skipped if the nearest movement of the library misses the request by more than
///   0.2 m or 60 degrees. With `"allow_nearest": true`, that movement is played.
/// - walk_to: requires `position_m` and `heading_rad`.
/// - jump: requires `length_m`.
/// - stand: requires `seconds`.
/// - layer: requires `name`. This entry takes no time. It starts, changes or (with
///   `"enabled": false`) stops the layer when the following movement begins.
struct Choreography {
  BaseFrame start;
  std::shared_ptr<const Terrain> terrain;  ///< Terrain of the world; null: flat ground.
  /// At least one entry and, together with `layers`, at most kMaxChoreographyMovements. The id of a
  /// request is its position in the JSON list, counted from 1 and including layers.
  std::vector<MovementRequest> movements;
  std::vector<LayerCue> layers;
};

/// Reads a choreography. Checks numbers against the limits in movement_request.h, but not whether a
/// library supports the movements. For that, use ValidateRequest.
///
/// Errors, by what Error::where contains:
///
/// - The file: kNotFound or kIo if it cannot be read, kLimitExceeded if it is too large, and
///   kMalformed if the JSON text is not an object.
/// - "file:line:column": kMalformed if the text is not JSON or contains a duplicate key,
///   kOutOfRange if a number is too large for a double, kLimitExceeded if values are nested too
///   deeply.
/// - A field, for example "c.json: movements[3].step.length_m", if its value is invalid:
///   kMalformed, kOutOfRange, kShapeMismatch or kLimitExceeded.
[[nodiscard]] Expected<Choreography> ReadChoreography(const std::filesystem::path& path);

/// Same as ReadChoreography, for text in memory. `name` replaces the path in errors.
[[nodiscard]] Expected<Choreography> ParseChoreography(std::string_view text,
                                                       std::string_view name);

}  // namespace stridewire
