#include "offline/build/left_out_error.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "runtime/library/convex_hull.h"
#include "runtime/plan/request_plan.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {
namespace {

// Only every other grid point is compared; the points in between are similar.
constexpr std::size_t kEveryPoint = 2;

}  // namespace

std::optional<BlendSet> MakeBlendSet(std::vector<const GridExample*> examples) {
  if (examples.empty()) return std::nullopt;
  BlendSet set;
  set.examples = std::move(examples);
  const std::size_t d = set.examples.front()->parameters.size();
  const auto n = static_cast<double>(set.examples.size());
  std::vector<double> scales(d, 1.0);
  for (std::size_t l = 0; l < d; ++l) {
    double mean = 0.0;
    double square = 0.0;
    for (const GridExample* example : set.examples) mean += example->parameters[l] / n;
    for (const GridExample* example : set.examples) {
      square += (example->parameters[l] - mean) * (example->parameters[l] - mean) / n;
    }
    if (std::sqrt(square) > 1e-6) scales[l] = std::sqrt(square);
  }
  for (const GridExample* example : set.examples) {
    set.sites.insert(set.sites.end(), example->parameters.begin(), example->parameters.end());
  }
  STRIDEWIRE_CHECK(set.sites.size() == set.examples.size() * d);
  Expected<CardinalBasis> basis =
      CardinalBasisFit{
          static_cast<int>(d), static_cast<int>(set.examples.size()), set.sites, {}, scales}
          .Run();
  if (!basis) return std::nullopt;
  set.basis = *std::move(basis);
  return set;
}

std::vector<Vec3> JointPositions(const GridExample& example, const GridLayout& layout,
                                 const Skeleton& skeleton) {
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  const auto joints = static_cast<std::size_t>(skeleton.joint_count());
  std::vector<Vec3> positions;
  std::vector<Quat> rotations(joints);
  const std::span<const float> rows(example.rows);
  for (std::size_t begin = 0; begin < rows.size(); begin += kEveryPoint * row_floats) {
    positions.resize(positions.size() + joints);
    ForwardKinematics(skeleton,
                      PoseOfRow(rows.subspan(begin, row_floats), layout, skeleton.joint_count()),
                      std::span(positions).last(joints), rotations);
  }
  return positions;
}

LeftOutError LeftOutProbe::Measure(const BlendSet& set, const GridExample& target,
                                   std::span<const Vec3> truth) {
  LeftOutError error;
  const std::size_t d = units_.size();
  STRIDEWIRE_CHECK(target.parameters.size() == d && set.sites.size() == set.examples.size() * d);
  applied_.resize(d);
  error.outside_m = ProjectOntoHull(set.sites, units_, 0.0, target.parameters, applied_);
  error.miss_m = ProjectOntoHull(set.sites, units_, kHullGrowth, target.parameters, applied_);
  weights_.resize(set.examples.size());
  const CardinalBasis& basis = set.basis;
  EvaluateWeights(
      {basis.centres, basis.scales, basis.sites, basis.dilations, basis.linear, basis.radial},
      applied_, weights_);

  const auto row_floats = static_cast<std::size_t>(layout_.row_floats);
  blend_.rows.assign(target.rows.size(), 0.0f);
  for (std::size_t e = 0; e < set.examples.size(); ++e) {
    const auto w = static_cast<float>(weights_[e]);
    const std::vector<float>& rows = set.examples[e]->rows;
    for (std::size_t begin = 0; begin < rows.size(); begin += kEveryPoint * row_floats) {
      for (std::size_t i = begin; i < begin + row_floats; ++i) blend_.rows[i] += w * rows[i];
    }
    error.duration_s += weights_[e] * set.examples[e]->keytimes_s.back();
  }
  error.duration_s -= target.keytimes_s.back();
  for (std::size_t begin = 0; begin < blend_.rows.size(); begin += kEveryPoint * row_floats) {
    for (std::size_t j = 0; j < static_cast<std::size_t>(skeleton_.joint_count()); ++j) {
      const std::size_t at = begin + 4 * j;
      float* q = &blend_.rows[at];
      const float norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
      // If the rotations cancel each other out, their mean is undefined. The rotation of the first
      // example is used instead.
      if (norm < 0.1f) {
        for (std::size_t c = 0; c < 4; ++c) {
          q[c] = set.examples.front()->rows[at + c];
        }
        continue;
      }
      for (std::size_t c = 0; c < 4; ++c) q[c] /= norm;
    }
  }
  const std::vector<Vec3> synthesized = JointPositions(blend_, layout_, skeleton_);
  STRIDEWIRE_CHECK(synthesized.size() == truth.size());
  for (std::size_t i = 0; i < synthesized.size(); ++i) {
    error.pose_m += static_cast<double>(glm::length(synthesized[i] - truth[i]));
  }
  error.pose_m /= static_cast<double>(synthesized.size());
  return error;
}

}  // namespace stridewire
