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

/// Maximum time for spawning the avatars. It applies again, plus 10 ms per observer, until all
/// observers receive all avatars.
inline constexpr double kSetUpTimeoutS = 30.0;
inline constexpr double kGraceS = 1.0;  ///< Maximum time for steps in progress at the end.
/// Maximum time for each of two reads of the metrics.
inline constexpr double kScrapeTimeoutS = 2.0;

/// Generates load on a server and returns the measurements. Failures are in `errors` and `failed`
/// of the report. Blocks until the run has ended. If `choreography` is null, the avatars wander.
/// `library` is needed only in movement mode. Setting `stop` ends the run early. `progress` is
/// called with one line of text per second.
[[nodiscard]] LoadReport RunLoad(const LoadOptions& options, const Choreography* choreography,
                                 std::shared_ptr<const MotionLibrary> library,
                                 const std::atomic<bool>& stop,
                                 const std::function<void(const std::string&)>& progress);

}  // namespace stridewire::load
