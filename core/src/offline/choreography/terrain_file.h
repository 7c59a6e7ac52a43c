#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string_view>

#include "stridewire/base/error.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

/// Maximum size of a terrain file.
inline constexpr std::size_t kMaxTerrainFileBytes = std::size_t{16} << 20;

/// Reads a terrain from a JSON file:
///
///   {"height_field": {"origin_m": [x, z], "cell_m": 0.25, "columns": C, "rows": R,
///                     "heights_m": [C * R numbers, row by row, x fastest]},
///    "boxes": [{"min_m": [x, z], "max_m": [x, z], "height_m": h}]}
///
/// `height_field` and `boxes` are optional, but all keys inside them are required. Unknown and
/// duplicate keys are errors.
///
/// Errors, by what Error::where contains:
///
/// - The file: kNotFound or kIo if it cannot be read, kLimitExceeded if it exceeds
///   kMaxTerrainFileBytes, and kMalformed if the JSON text is not an object.
/// - "file:line:column": the errors of ParseJson.
/// - A field, for example "t.json: boxes[3].max_m", if its value is invalid: kMalformed or the
///   errors of Terrain::Make.
[[nodiscard]] Expected<std::shared_ptr<const Terrain>> ReadTerrain(
    const std::filesystem::path& path);

/// Reads a terrain like ReadTerrain, from text in memory. `name` replaces the path in errors.
[[nodiscard]] Expected<std::shared_ptr<const Terrain>> ParseTerrain(std::string_view text,
                                                                    std::string_view name);

}  // namespace stridewire
