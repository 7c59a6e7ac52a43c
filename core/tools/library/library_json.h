#pragma once

#include <nlohmann/json.hpp>

#include "runtime/movement/movement.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

// Returns the output of `inspect --json`. With `examples` it contains all sites and weights, so
// that other programs can recompute the interpolation.
[[nodiscard]] nlohmann::ordered_json LibraryToJson(const MotionLibrary& library, bool examples);

// Returns parameters with their units, for example {"start_z_m": ..., "end_z_m": ...}.
[[nodiscard]] nlohmann::ordered_json ParametersToJson(const MotionGroup& group,
                                                      const ParameterValues& values);
[[nodiscard]] nlohmann::ordered_json BaseToJson(const BaseFrame& base);

// Serializes JSON that may contain text from a file; invalid UTF-8 is replaced.
[[nodiscard]] std::string Dump(const nlohmann::ordered_json& json);

// Returns the layers of a library as JSON.
[[nodiscard]] nlohmann::ordered_json LayersToJson(const MotionLibrary& library);
// Prints the layers of a library to stdout.
void PrintLayers(const MotionLibrary& library);

// Returns the transitions of a library as JSON, with one entry per pair of groups.
[[nodiscard]] nlohmann::ordered_json TransitionsToJson(const MotionLibrary& library);
// Prints the best transition per pair of movement kinds to stdout. With `examples`, also prints the
// two examples that each transition connects.
void PrintTransitions(const MotionLibrary& library, bool examples);

}  // namespace stridewire
