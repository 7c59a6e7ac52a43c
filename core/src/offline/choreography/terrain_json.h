#pragma once

#include <memory>

#include "offline/base/json_field.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

/// Reads what stands under "terrain" in a choreography, and is all of a terrain file. Errors name
/// the way from `field` on; codes as those of ParseTerrain.
[[nodiscard]] Expected<std::shared_ptr<const Terrain>> ReadTerrainField(const JsonField& field);

}  // namespace stridewire
