#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "random.h"
#include "rough_ground.h"
#include "runtime/avatar/avatar_simulation.h"

namespace stridewire {

inline bool Draws(Random& random, double likely) { return random.Draw(0.0, 1.0) < likely; }

/// A random base frame for an avatar.
inline BaseFrame DrawBase(Random& random) {
  return {DVec3(random.Draw(-50.0, 50.0), random.Draw(0.0, 3.0), random.Draw(-50.0, 50.0)),
          random.Draw(-20.0, 20.0)};
}

/// A random request of any kind: steps, steps to footprints, walks, jumps and stands. Some
/// interrupt the current movement, and some exact footprints are out of reach.
inline MovementRequest DrawRequest(Random& random, const AvatarSimulation& avatar) {
  MovementRequest request{.id = 1};
  const double kind = random.Draw(0.0, 1.0);
  if (kind < 0.4) {
    request.movement = StepRequest{.length_m = random.Draw(0.0, 0.9),
                                   .turn_rad = Draws(random, 0.5) ? random.Draw(-0.5, 0.5) : 0.0,
                                   .allow_nearest = true};
  } else if (kind < 0.6) {
    StepRequest step{
        .at =
            FootprintRequest{avatar.base().position_m + RotateYaw(avatar.base().heading_rad,
                                                                  DVec3(random.Draw(-0.4, 0.4), 0.0,
                                                                        random.Draw(-0.1, 0.9))),
                             Draws(random, 0.5)
                                 ? std::optional(avatar.base().heading_rad + random.Draw(-0.5, 0.5))
                                 : std::nullopt},
        .exact_only = Draws(random, 0.5)};
    step.allow_nearest = !step.exact_only;
    request.movement = step;
  } else if (kind < 0.8) {
    request.movement =
        WalkRequest{.position_m = avatar.base().position_m +
                                  DVec3(random.Draw(-3.0, 3.0), 0.0, random.Draw(-3.0, 3.0)),
                    .heading_rad = random.Draw(-3.0, 3.0)};
  } else if (kind < 0.9) {
    request.movement = JumpRequest{.length_m = random.Draw(0.5, 1.0), .allow_nearest = true};
  } else {
    request.movement = StandRequest{Draws(random, 0.3) ? 0.0 : random.Draw(0.0, 0.5)};
  }
  if (Draws(random, 0.4)) {
    request.interrupt = Draws(random, 0.7) ? Interrupt::kNow : Interrupt::kAfterMovement;
  }
  return request;
}

/// Starts or ends a random layer of the library, if it has any.
inline void DrawLayer(Random& random, AvatarSimulation& avatar) {
  const auto layers = static_cast<double>(avatar.library().layers().size());
  if (layers == 0.0) return;
  (void)avatar.SetLayer({.layer = static_cast<int>(random.Draw(0.0, layers)),
                         .enabled = Draws(random, 0.6),
                         .weight = random.Draw(0.1, 1.0),
                         .blend_s = random.Draw(0.0, 1.0),
                         .speed = random.Draw(0.2, 3.0)});
}

/// Avatars that continuously receive random requests and play random layers. Every second avatar is
/// on uneven ground. All requests and poses depend only on `seed`.
class DrawnCrowd {
 public:
  DrawnCrowd(const std::shared_ptr<const MotionLibrary>& library, int size, unsigned seed,
             const AvatarOptions& options = {})
      : random_(seed), plan_scratch_(*library), evaluator_(*library, 1) {
    for (int i = 0; i < size; ++i) {
      AvatarOptions own = options;
      own.seed = static_cast<std::uint64_t>(i);
      if (i % 2 != 0) own.terrain = RoughGround(random_);
      avatars_.emplace_back(library, DrawBase(random_), own);
    }
  }

  /// Advances by a sixtieth of a second, with batches of `at_once` avatars.
  void Advance(std::size_t at_once = 1000) {
    DrawRequests();
    std::vector<AvatarSimulation*> some;
    for (AvatarSimulation& avatar : avatars_) {
      some.push_back(&avatar);
      if (some.size() < at_once && &avatar != &avatars_.back()) continue;
      AvatarSimulation::AdvanceAll(some, 1.0 / 60.0, plan_scratch_, evaluator_);
      some.clear();
    }
  }

  /// Same as Advance, without poses (AvatarSimulation::AdvanceStates).
  void AdvanceStates() {
    DrawRequests();
    std::vector<AvatarSimulation*> all;
    for (AvatarSimulation& avatar : avatars_) all.push_back(&avatar);
    AvatarSimulation::AdvanceStates(all, 1.0 / 60.0, plan_scratch_);
  }

  [[nodiscard]] const std::vector<AvatarSimulation>& avatars() const { return avatars_; }
  [[nodiscard]] std::vector<AvatarSimulation>& avatars() { return avatars_; }

 private:
  void DrawRequests() {
    for (AvatarSimulation& avatar : avatars_) {
      if (Draws(random_, 0.01)) DrawLayer(random_, avatar);
      if (Draws(random_, 0.003)) (void)avatar.SetFootPlanting(!avatar.foot_planting());
      if (avatar.queue_size() == 0 && Draws(random_, 0.2)) {
        (void)avatar.Enqueue(DrawRequest(random_, avatar));
      }
    }
  }

  Random random_;
  PlanScratch plan_scratch_;
  SoaPoseEvaluator evaluator_;
  std::vector<AvatarSimulation> avatars_;
};

}  // namespace stridewire
