#pragma once

#include <nlohmann/json.hpp>

#include "offline/build/refine.h"

namespace stridewire {

// What `refine --json` and `report --json` say of a group. `samples`: of the hull, examples not counted.
[[nodiscard]] nlohmann::ordered_json RefinementToJson(const MotionGroup& group,
                                                      const GroupRefinement& refined, int samples);

}  // namespace stridewire
