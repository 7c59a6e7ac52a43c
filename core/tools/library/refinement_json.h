#pragma once

#include <nlohmann/json.hpp>

#include "offline/build/refine.h"

namespace stridewire {

// Returns the JSON of one group in `refine --json` and `report --json`. `samples` is the number of
// points sampled in the hull, without the examples.
[[nodiscard]] nlohmann::ordered_json RefinementToJson(const MotionGroup& group,
                                                      const GroupRefinement& refined, int samples);

}  // namespace stridewire
