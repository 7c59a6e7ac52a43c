#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "runtime/movement/movement.h"
#include "runtime/skeleton/soa_pose.h"

namespace stridewire {

/// Successive poses of one movement. A movement does not change after it has begun, so a server can
/// evaluate several ticks at once. The data of the movement is then loaded, blended and transposed
/// only once.
struct SampleRun {
  /// Movement to evaluate. If its feet are planted, its FootPlan::packed must be set.
  const Movement* movement = nullptr;
  double time_s = 0.0;  ///< Time of the first pose; clamped to the movement.
  /// Length of a tick in seconds. The times of poses are summed tick by tick, as in a server, so
  /// that rounding is the same.
  double step_s = 0.0;
  int ticks_apart = 1;  ///< Number of ticks from one pose to the next.
};

/// Evaluates up to SoaPose::kLanes sample runs side by side, with difference poses and planted
/// feet. The bytes of a pose do not depend on the other poses that are evaluated with it. Not
/// thread-safe. Allocates only in its constructor.
///
///   evaluator.Begin(runs, count);
///   for (int i = 0; i < count; ++i) Use(evaluator.Next());
class SoaPoseEvaluator {
 public:
  /// `library` must outlive the evaluator. `max_count` is the maximum number of poses per run, >=
  /// 1.
  SoaPoseEvaluator(const MotionLibrary& library, int max_count);
  ~SoaPoseEvaluator();
  SoaPoseEvaluator(SoaPoseEvaluator&&) noexcept;
  SoaPoseEvaluator& operator=(SoaPoseEvaluator&&) noexcept;

  [[nodiscard]] int max_count() const;

  /// Starts the evaluation of `count` poses of each run, 1 to max_count(). There must be 1 to
  /// SoaPose::kLanes runs, and either all or none of their movements have planted feet. The
  /// movements must exist until the last pose has been evaluated.
  void Begin(std::span<const SampleRun> runs, int count);
  /// Returns the next pose of each run; lane i contains the pose of runs[i]. Other lanes are
  /// undefined. The result is valid until the next call. Call it at most `count` times per Begin.
  [[nodiscard]] const SoaPose& Next();

  /// These functions prefetch memory that evaluation reads. PrefetchTimes: the members that
  /// SampleRunCount and EvaluationBatcher::Add read. PrefetchMovement: the movement itself.
  /// Prefetch: the arrays to which the movement points.
  static void PrefetchTimes(const Movement& movement);
  static void PrefetchMovement(const Movement& movement);
  static void Prefetch(const SampleRun& run);

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

/// A request for a single pose of a movement.
struct PoseJob {
  /// Movement to evaluate. If its feet are planted, its FootPlan::packed must be set.
  const Movement* movement = nullptr;
  double time_s = 0.0;   ///< Time of the pose; clamped to the movement.
  Pose* pose = nullptr;  ///< Output.
};

/// Evaluates single poses, up to SoaPose::kLanes at a time. Never allocates.
void EvaluatePoses(SoaPoseEvaluator& evaluator, std::span<const PoseJob> jobs);

}  // namespace stridewire
