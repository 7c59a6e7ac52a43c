#include <algorithm>

#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/runtime/avatar.h"

namespace stridewire {
namespace {

constexpr double kTickS = 1.0 / 30.0;
// Maximum duration of a measured walk: one minute.
constexpr int kMaxTicks = 60 * 30;
// Lengths of the measured walks. They are long enough for steady strides between the first and the
// last steps.
constexpr double kFastWalkM = 8.0;
constexpr double kSlowWalkM = 3.0;

// Returns the speed of a walk straight ahead, or 0 if it has too few steps.
double SpeedOfWalk(const std::shared_ptr<const MotionLibrary>& library, double distance_m,
                   double speed_m_s, PlanScratch& scratch) {
  AvatarSimulation avatar(library, {}, {.idle_motion = false, .stride_variation = false});
  const WalkRequest walk{.position_m = DVec3(0.0, 0.0, distance_m), .speed_m_s = speed_m_s};
  if (!avatar.Enqueue({1, walk})) return 0.0;
  AvatarSimulation* const avatars[] = {&avatar};
  for (int tick = 0; tick < kMaxTicks; ++tick) {
    AvatarSimulation::AdvanceStates(avatars, kTickS, scratch);
    for (const AvatarEvent& event : avatar.events()) {
      const bool is_end = event.type == AvatarEventType::kRejected ||
                          (event.type == AvatarEventType::kFinished && event.group < 0);
      if (is_end) return event.speed_m_s;
    }
  }
  return 0.0;
}

}  // namespace

double WalkSpeeds::Nearest(double speed_m_s) const {
  if (!(fastest_m_s > 0.0)) return 0.0;
  return IsOutside(speed_m_s) ? std::clamp(speed_m_s, slowest_m_s, fastest_m_s) : speed_m_s;
}

bool WalkSpeeds::IsOutside(double speed_m_s) const {
  return fastest_m_s > 0.0 && (speed_m_s > fastest_m_s * (1.0 + kTolerance) ||
                               speed_m_s < slowest_m_s * (1.0 - kTolerance));
}

WalkSpeeds MeasureWalkSpeeds(const std::shared_ptr<const MotionLibrary>& library) {
  PlanScratch scratch(*library);
  const double slow_m_s = SpeedOfWalk(library, kSlowWalkM, kMinWalkSpeedMPerS, scratch);
  const double fast_m_s = SpeedOfWalk(library, kFastWalkM, kMaxWalkSpeedMPerS, scratch);
  if (!(slow_m_s > 0.0 && fast_m_s > 0.0)) return {};
  return {std::min(slow_m_s, fast_m_s), std::max(slow_m_s, fast_m_s)};
}

}  // namespace stridewire
