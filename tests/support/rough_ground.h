#pragma once

#include <memory>
#include <utility>

#include "random.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

/// Low boxes, scattered over 100 m by 120 m.
inline std::shared_ptr<const Terrain> RoughGround(Random& random) {
  TerrainData data;
  for (int i = 0; i < 200; ++i) {
    const double x = random.Draw(-20.0, 80.0);
    const double z = random.Draw(-60.0, 60.0);
    data.boxes.push_back({{x, z}, {x + 1.0, z + 1.0}, random.Draw(0.0, 0.15)});
  }
  return Terrain::Make(std::move(data)).value();
}

}  // namespace stridewire
