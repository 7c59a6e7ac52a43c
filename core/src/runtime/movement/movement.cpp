#include "runtime/movement/movement.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "runtime/library/cardinal_basis.h"
#include "runtime/library/keytimes.h"

namespace stridewire {

void SetWeights(const MotionGroup& group, int group_index, std::span<const double> parameters,
                std::span<double> weight_scratch, Movement& movement) {
  const auto n = static_cast<std::size_t>(group.example_count);
  movement.group = group_index;
  movement.parameters.count = static_cast<int>(parameters.size());
  std::copy(parameters.begin(), parameters.end(), movement.parameters.values.begin());
  const std::span<double> weights = weight_scratch.first(n);
  if (n == 1) {
    weights[0] = 1.0;
  } else {
    std::array<double, kMaxParameters> centres{};
    std::array<double, kMaxParameters> scales{};
    for (std::size_t l = 0; l < group.parameters.size(); ++l) {
      centres[l] = group.parameters[l].centre;
      scales[l] = group.parameters[l].scale;
    }
    const std::size_t d = group.parameters.size();
    EvaluateWeights({std::span(centres).first(d), std::span(scales).first(d), group.sites,
                     group.dilations, group.linear, group.radial},
                    parameters, weights);
  }
  ApplyWeights(group, weights, movement);
}

void ApplyWeights(const MotionGroup& group, std::span<const double> weights, Movement& movement) {
  STRIDEWIRE_CHECK(weights.size() == static_cast<std::size_t>(group.example_count));
  movement.weights.assign(static_cast<std::size_t>(group.row_count()), 0.0f);
  movement.heading_change_rad = 0.0;
  for (std::size_t e = 0; e < weights.size(); ++e) {
    movement.weights[e] = static_cast<float>(weights[e]);
    movement.heading_change_rad += weights[e] * group.heading_change_rad[e];
  }
}

void AddVariant(const MotionGroup& group, int variant, double weight, Movement& movement) {
  STRIDEWIRE_CHECK(variant >= 0 && variant < group.variant_count);
  const std::size_t row =
      static_cast<std::size_t>(group.example_count) + static_cast<std::size_t>(variant);
  movement.weights[row] += static_cast<float>(weight);
  movement.heading_change_rad += weight * group.heading_change_rad[row];
}

void StartMovement(const MotionGroup& group, int group_index, std::span<const double> parameters,
                   const BaseFrame& base, std::span<double> weight_scratch, Movement& movement) {
  SetWeights(group, group_index, parameters, weight_scratch, movement);
  StartWeighted(group, base, movement);
}

void StartWeighted(const MotionGroup& group, const BaseFrame& base, Movement& movement,
                   double rate) {
  STRIDEWIRE_CHECK(movement.weights.size() == static_cast<std::size_t>(group.row_count()));
  STRIDEWIRE_CHECK(rate > 0.0);
  movement.base = base;
  movement.extra_turn_rad = 0.0;
  movement.start_offset_s = 0.0;
  movement.is_inertial = false;
  movement.rate = rate;
  std::array<double, kMaxIntervals + 1> scratch;
  const auto keytimes = std::span(scratch).first(group.cells.size() + 1);
  BlendKeytimes(group.keytimes_s, movement.weights, keytimes);
  for (double& keytime_s : keytimes) keytime_s /= rate;
  movement.warp = TimeWarp(keytimes, group.cells);
  movement.ease_out_s = std::min(group.ease_out_s, movement.duration_s());
}

BaseFrame BaseAfter(const Movement& movement, ConstPoseSpan end_pose) {
  BaseFrame base = movement.base;
  base.position_m.x = end_pose.root_position_m.x;
  base.position_m.z = end_pose.root_position_m.z;
  base.heading_rad += movement.heading_change_rad + movement.extra_turn_rad;
  return base;
}

}  // namespace stridewire
