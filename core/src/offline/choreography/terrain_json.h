#pragma once

#include <memory>

#include "offline/base/json_field.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

/// Reads a terrain from a JSON value: the key "terrain" of a choreography, or a whole terrain file.
/// Paths in errors start with that of `field`. The error codes are those of ParseTerrain.
[[nodiscard]] Expected<std::shared_ptr<const Terrain>> ReadTerrainField(const JsonField& field);

}  // namespace stridewire
