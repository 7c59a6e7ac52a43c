#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string_view>

#include "stridewire/base/error.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

inline constexpr std::size_t kMaxTerrainFileBytes = std::size_t{16} << 20;

/// Reads ground that is written down as JSON:
///
///   {"height_field":{"origin_m":[x,z],"cell_m":0.25,"columns":C,"rows":R,
///                    "heights_m":[…C·R numbers row by row, x fastest]},
///    "boxes":[{"min_m":[x,z],"max_m":[x,z],"height_m":h}]}
///
/// Either may be left out; everything within them is needed. Any other key is an error.
///
/// Errors: kNotFound, kIo with `where` = file; kMalformed with "file:line:column" where the text is
/// not JSON; with the field, e.g. "t.json: boxes[3].max_m", kMalformed (not a number, a key missing
/// or too many) and those of Terrain::Make; kLimitExceeded: kMaxTerrainFileBytes.
[[nodiscard]] Expected<std::shared_ptr<const Terrain>> ReadTerrain(
    const std::filesystem::path& path);

/// As above, from text in memory; `name` takes the path's place.
[[nodiscard]] Expected<std::shared_ptr<const Terrain>> ParseTerrain(std::string_view text,
                                                                    std::string_view name);

}  // namespace stridewire
