#include "movement_evaluator.h"

#include <array>

namespace stridewire::client {

void MovementEvaluator::Add(const Movement& movement,
                            const EvaluationBatcher::Similarity& similarity, double time_s,
                            Vec3& root_position_m, std::span<Quat> rotations) {
  batcher_.Add({.movement = &movement, .time_s = time_s}, similarity, 1,
               static_cast<std::uint32_t>(outputs_.size()));
  outputs_.push_back({&root_position_m, rotations.data()});
}

void MovementEvaluator::Evaluate() {
  if (outputs_.empty()) return;
  batcher_.Evaluate(evaluator_, [this](std::span<const EvaluationBatcher::Item> items, int,
                                       const SoaPose& poses) {
    std::array<Vec3*, SoaPose::kLanes> roots_m;
    std::array<Quat*, SoaPose::kLanes> rotations;
    for (std::size_t lane = 0; lane < items.size(); ++lane) {
      roots_m[lane] = outputs_[items[lane].tag].root_position_m;
      rotations[lane] = outputs_[items[lane].tag].rotations;
    }
    poses.GetFirst(std::span(roots_m).first(items.size()),
                   std::span(rotations).first(items.size()));
  });
  outputs_.clear();
}

}  // namespace stridewire::client
