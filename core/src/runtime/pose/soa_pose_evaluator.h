#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "runtime/movement/movement.h"
#include "runtime/skeleton/soa_pose.h"

namespace stridewire {

/// Poses of one movement that follow each other. All that can be seen of a movement is settled when
/// it begins, so a server need not come back to it for every tick: what a pose is made of is
/// brought into the cache, blended and unpacked once for several of them.
struct SampleRun {
  const Movement* movement = nullptr;  ///< Its feet, if planted, packed (FootPlan::packed)
  double time_s = 0.0;                 ///< Of the first pose; clamped to the movement
  double step_s = 0.0;  ///< From one tick to the next; times are summed up tick by tick
  int ticks_apart = 1;  ///< From one pose to the next
};

/// Evaluates stretches, up to SoaPose::kLanes side by side: EvaluateMovement's poses with the feet
/// planted, the same bytes whatever else is evaluated with them. Not thread-safe; allocates when it
/// is made and never again.
///
///   evaluator.Begin(stretches, count);
///   for (int i = 0; i < count; ++i) Use(evaluator.Next());
class SoaPoseEvaluator {
 public:
  /// `library` outlives it. `max_count`: poses of a stretch, at least 1.
  SoaPoseEvaluator(const MotionLibrary& library, int max_count);
  ~SoaPoseEvaluator();
  SoaPoseEvaluator(SoaPoseEvaluator&&) noexcept;
  SoaPoseEvaluator& operator=(SoaPoseEvaluator&&) noexcept;

  [[nodiscard]] int max_count() const;

  /// Whose `count` poses come next, at least one stretch; either all of them have their feet
  /// planted or none. What they point to lives until the last of them came.
  void Begin(std::span<const SampleRun> runs, int count);
  /// The next pose of each stretch, in its lane. Other lanes mean nothing.
  [[nodiscard]] const SoaPose& Next();

  /// Asks for the memory that is read of a movement: what SampleRunCount and EvaluationBatcher::Add
  /// look at, then what Begin does, and at last what lies elsewhere.
  static void PrefetchTimes(const Movement& movement);
  static void PrefetchMovement(const Movement& movement);
  static void Prefetch(const SampleRun& run);

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

/// One pose that is wanted of a movement.
struct PoseJob {
  const Movement* movement = nullptr;  ///< Its feet, if planted, packed
  double time_s = 0.0;                 ///< Clamped to the movement
  Pose* pose = nullptr;                ///< With the feet planted
};

/// Single poses, as many side by side as there are lanes. Never allocates.
void EvaluatePoses(SoaPoseEvaluator& evaluator, std::span<const PoseJob> jobs);

}  // namespace stridewire
