// AvatarSimulation: motion of a standing avatar.
//
//   last movement -> settle (0.5 s: blends into the stand pose) -> idle -> idle -> ... -> movement
//
// Settle and idle are movements with a separate group (StandMotion), so that evaluation, planting,
// blends, replicas and caches treat them like steps. To the caller, the avatar stands: these
// movements cause no events, and a step, jump or walk that begins ends them at once.

#include <array>
#include <cmath>
#include <cstdint>

#include "base/check.h"
#include "base/scramble.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/stand_motion.h"

namespace stridewire {
namespace {

// Returns the time in the idle loop at which an avatar with this seed starts, in seconds.
double LoopStart(std::uint64_t seed) { return kIdleLoopS * FractionOf(Scramble(seed)); }

}  // namespace

// Advances the idle motion of a standing avatar, and starts it if necessary.
void AvatarSimulation::AdvanceIdleMotion(double by_s, PlanScratch& scratch) {
  STRIDEWIRE_CHECK(!is_moving_);
  if (is_idling_ && movement_time_s_ + by_s > body_.movement.duration_s()) {
    is_settled_ = true;
    EndIdleMotion();
  }
  if (!is_idling_) BeginIdleMotion(by_s, scratch);
  if (is_idling_) movement_time_s_ += by_s;
}

// Starts the settle or the idle motion. The caller then advances it by `left_s` in this tick.
void AvatarSimulation::BeginIdleMotion(double left_s, PlanScratch& scratch) {
  const MotionLibrary& library = *body_.library;
  if (!options_.idle_motion || !body_.plants_feet || !library.has_stand_motion()) return;
  const bool settles =
      !is_settled_ && left_s < library.group(library.settle_group()).keytimes_s.back();
  Movement& movement = body_.movement;
  movement.group = settles ? library.settle_group() : library.idle_group();
  movement.parameters = {};
  ApplyWeights(group(), std::array{1.0}, movement);
  body_.StartWeighted(base_, 1.0);
  // The position in the loop depends only on the seed and the time, so that the motion continues
  // after a short interruption.
  const double place_s = std::fmod(LoopStart(options_.seed) + time_s_, kIdleLoopS);
  if (!settles) body_.SetStartOffset(place_s);
  body_.BlendIn(LandingDecision{.is_on_terrain = options_.terrain != nullptr}, keeps_speed(),
                scratch.feet);
  body_.begins_planting = false;
  is_idling_ = true;
  movement_time_s_ = movement.start_offset_s;
  ++revision_;
  change_.has_begun = true;
  change_.begun_keeps_speed = keeps_speed();
}

// Ends the settle or idle motion, if the avatar plays one. The next movement blends from it.
void AvatarSimulation::EndIdleMotion() {
  if (!is_idling_) return;
  CaptureBlendSource(movement_time_s_);
  body_.CaptureFootLocks(movement_time_s_);
  RecordLeaving(movement_time_s_, false);
  is_idling_ = false;
  ++revision_;
}

}  // namespace stridewire
