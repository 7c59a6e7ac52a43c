#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/pose/evaluation_batcher.h"

namespace stridewire::client {

/// A movement of an avatar, and data to determine whether it directly follows the previous one.
struct PlayedMovement {
  Movement movement;
  std::uint32_t number = 0;  ///< AvatarReplica::movement_number()
  /// AvatarReplica::previous_end_s(): the time in the previous movement at which it ended. Negative
  /// if this movement did not begin at the end of another one.
  double previous_end_s = -1.0;
};

/// Evaluates single poses of many movements. Groups similar poses and evaluates each group with
/// SIMD.
class MovementEvaluator {
 public:
  explicit MovementEvaluator(std::shared_ptr<const MotionLibrary> library)
      : library_(std::move(library)), evaluator_(*library_, 1) {}

  [[nodiscard]] const std::shared_ptr<const MotionLibrary>& library() const { return library_; }

  /// Adds a pose to evaluate. The movement and the memory of the pose must exist until Evaluate
  /// returns.
  void Add(const Movement& movement, double time_s, Vec3& root_position_m,
           std::span<Quat> rotations) {
    Add(movement, EvaluationBatcher::SimilarityOf(movement), time_s, root_position_m, rotations);
  }
  void Add(const Movement& movement, const EvaluationBatcher::Similarity& similarity, double time_s,
           Vec3& root_position_m, std::span<Quat> rotations);

  /// Evaluates all added poses and removes them.
  void Evaluate();

 private:
  struct Output {
    Vec3* root_position_m;
    Quat* rotations;
  };

  std::shared_ptr<const MotionLibrary> library_;
  SoaPoseEvaluator evaluator_;
  EvaluationBatcher batcher_;
  std::vector<Output> outputs_;
};

}  // namespace stridewire::client
