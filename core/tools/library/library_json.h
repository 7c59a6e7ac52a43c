#pragma once

#include <nlohmann/json.hpp>

#include "runtime/movement/movement.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

// `inspect --json`; with `examples` every site, so that anyone can recompute every weight.
[[nodiscard]] nlohmann::ordered_json LibraryToJson(const MotionLibrary& library, bool examples);

// {"start_z_m": …, "end_z_m": …}
[[nodiscard]] nlohmann::ordered_json ParametersToJson(const MotionGroup& group,
                                                      const ParameterValues& values);
[[nodiscard]] nlohmann::ordered_json BaseToJson(const BaseFrame& base);

// Text that came from a file, safe to print as JSON: bytes that are not UTF-8 are replaced.
[[nodiscard]] std::string Dump(const nlohmann::ordered_json& json);

// What layers a library has, for reading by programs and by people.
[[nodiscard]] nlohmann::ordered_json LayersToJson(const MotionLibrary& library);
void PrintLayers(const MotionLibrary& library);

// How its movements go on where others end: of every two groups; people see the best of every two
// kinds, with `examples` between which.
[[nodiscard]] nlohmann::ordered_json TransitionsToJson(const MotionLibrary& library);
void PrintTransitions(const MotionLibrary& library, bool examples);

}  // namespace stridewire
