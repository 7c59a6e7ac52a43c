#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>

#include "load_options.h"
#include "load_report.h"
#include "stridewire/offline/choreography.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire::load {

/// How long a run may take beyond its measured window.
inline constexpr double kSetUpTimeoutS = 30.0;  ///< Until all avatars are there and seen.
inline constexpr double kGraceS = 1.0;          ///< For poses and steps under way at the end.
inline constexpr double kScrapeTimeoutS = 2.0;  ///< Twice.

/// Loads a server and reports what was measured; what went wrong is in `errors` and `failed`. Blocks
/// for at most kSetUpTimeoutS + seconds + some seconds. `choreography` null: the avatars wander. `library` is the
/// worlds', in mode movement.
/// `stop` set from elsewhere ends the run early; `progress` is told a line a second.
[[nodiscard]] LoadReport RunLoad(const LoadOptions& options, const Choreography* choreography,
                                 std::shared_ptr<const MotionLibrary> library,
                                 const std::atomic<bool>& stop,
                                 const std::function<void(const std::string&)>& progress);

}  // namespace stridewire::load
