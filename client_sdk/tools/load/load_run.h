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

// A run takes at most this much longer than its measurement.
/// Longest time until all observers see all avatars.
inline constexpr double kSetUpTimeoutS = 30.0;
inline constexpr double kGraceS = 1.0;  ///< Longest time for steps in progress at the end.
/// Longest time for each of two reads of the metrics.
inline constexpr double kScrapeTimeoutS = 2.0;

/// Loads a server and returns the measurements. Failures are in `errors` and `failed` of the
/// report. Blocks for `seconds` plus the times above. If `choreography` is null, the avatars
/// wander. `library` is needed in mode movement only. Setting `stop` ends the run early. `progress`
/// receives one line of text per second.
[[nodiscard]] LoadReport RunLoad(const LoadOptions& options, const Choreography* choreography,
                                 std::shared_ptr<const MotionLibrary> library,
                                 const std::atomic<bool>& stop,
                                 const std::function<void(const std::string&)>& progress);

}  // namespace stridewire::load
