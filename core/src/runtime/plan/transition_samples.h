#pragma once

#include <array>
#include <cstddef>

#include "runtime/movement/movement.h"
#include "runtime/plan/foot_sampler.h"
#include "runtime/plan/swing_times.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {

/// The feet of a movement at its start and around its contacts, before planting. The foot planner
/// and PlanRootApproach need them. One call of FootSampler samples all of them, because its cost
/// depends mostly on the number of calls.
class TransitionSamples {
 public:
  /// Fractions of the time from the start of the movement to the release of the moving foot.
  static constexpr std::array<double, 2> kReleaseSamples{0.6, 0.8};
  /// Fractions of the swing, shortly before the landing.
  static constexpr std::array<double, 3> kLandingSamples{0.9, 0.94, 0.97};
  /// Fractions of the blend-in, in which the difference pose fades out.
  static constexpr std::array<double, 7> kSettleSamples{0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8};

  // Indices of the first sample of each kind.
  static constexpr std::size_t kRelease = 0;
  static constexpr std::size_t kLanding = kRelease + kReleaseSamples.size();
  /// Two samples: at the start of the movement, and start_step_s() later.
  static constexpr std::size_t kStart = kLanding + kLandingSamples.size();
  /// Samples of the blend-in. They exist only if Sample was called with `settles`.
  static constexpr std::size_t kSettle = kStart + 2;

  /// Borrows both arguments, as FootSampler does.
  TransitionSamples(FootPlanScratch& scratch, PoseSpan pose) : feet_(scratch, pose) {}

  /// Samples a movement whose base and difference pose are set.
  void Sample(const Movement& movement, const SwingTimes& swing, bool settles);

  [[nodiscard]] const FootSampler& feet() const { return feet_; }
  [[nodiscard]] double time_s(std::size_t i) const { return times_s_[i]; }
  /// Returns the index of the first of two samples without the difference pose. They are at the
  /// start of the movement and start_step_s() later.
  [[nodiscard]] std::size_t blended_start() const { return blended_start_; }
  /// Returns true if the samples of the blend-in exist.
  [[nodiscard]] bool has_settle_samples() const { return blended_start_ > kSettle; }
  [[nodiscard]] double start_step_s() const { return start_step_s_; }

 private:
  FootSampler feet_;
  std::size_t blended_start_ = 0;
  double start_step_s_ = 0.0;
  std::array<double, kSettle + kSettleSamples.size() + 2> times_s_;
  static_assert(std::tuple_size_v<decltype(times_s_)> <= FootSampler::kMaxTimes);
};

}  // namespace stridewire
