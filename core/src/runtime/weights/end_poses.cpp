#include "runtime/weights/end_poses.h"

#include <algorithm>
#include <cmath>

#include "base/trig.h"
#include "runtime/pose/pose_kernels.h"
#include "runtime/weights/end_measures.h"

namespace stridewire {
namespace {

DVec3 Turn(double sine, double cosine, const DVec3& v) {
  return {cosine * v.x + sine * v.z, v.y, cosine * v.z - sine * v.x};
}

}  // namespace

void EndPoses::Gradient::Add(int joint, const DVec3& by_xyz, double by_w) {
  const auto j = static_cast<std::size_t>(joint);
  // The chains of the two legs share the joints near the root, so an entry may already exist.
  std::size_t i = 0;
  while (i < joint_count_ && joints_[i].joint != j) ++i;
  if (i == joint_count_) joints_[joint_count_++] = {j, {}};
  Parts& parts = joints_[i];
  parts.by[0] += by_xyz.x;
  parts.by[1] += by_xyz.y;
  parts.by[2] += by_xyz.z;
  parts.by[3] += by_w;
}

void EndPoses::Gradient::AddTo(const float* rows, std::size_t row_floats,
                               std::span<double> slopes) const {
  // The loop over joints is outside the loop over examples, so that the compiler vectorizes the
  // loop over components. Each sum still adds the joints in order.
  constexpr std::size_t kBlock = 16;
  for (std::size_t first = 0; first < slopes.size(); first += kBlock) {
    const std::size_t count = std::min(kBlock, slopes.size() - first);
    std::array<std::array<double, 4>, kBlock> sums{};
    for (std::size_t i = 0; i < joint_count_; ++i) {
      const std::array<double, 4> by = joints_[i].by;
      const float* at = rows + first * row_floats + 4 * joints_[i].joint;
      for (std::size_t e = 0; e < count; ++e, at += row_floats) {
        for (std::size_t c = 0; c < 4; ++c) sums[e][c] += by[c] * at[c];
      }
    }
    for (std::size_t e = 0; e < count; ++e) {
      slopes[first + e] += (sums[e][0] + sums[e][1]) + (sums[e][2] + sums[e][3]);
    }
  }
}

EndPoses::EndPoses(const Skeleton& skeleton, const GridLayout& layout)
    : skeleton_(skeleton), layout_(layout) {
  for (std::size_t f = 0; f < 2; ++f) {
    for (int j = skeleton.legs[f].ball; j >= 0;
         j = skeleton.joints[static_cast<std::size_t>(j)].parent) {
      chains_[f].push_back(j);
    }
    for (End& end : ends_) end.links[f].resize(chains_[f].size());
  }
  gradient_.SetCapacity(chains_[0].size() + chains_[1].size() + 1);
}

void EndPoses::SetGroup(const MotionGroup& group) {
  group_ = &group;
  sign_ = group.kind == MovementKind::kStepRight ? -1.0 : 1.0;
}

const float* EndPoses::Rows(bool is_end) const {
  const std::size_t point = is_end ? static_cast<std::size_t>(group_->grid_point_count - 1) : 0;
  return &group_->grid[point * static_cast<std::size_t>(group_->row_count()) *
                       static_cast<std::size_t>(layout_.row_floats)];
}

void EndPoses::Blend(const Movement& movement) {
  heading_change_rad_ = movement.heading_change_rad;
  sine_ = Sin(heading_change_rad_);
  cosine_ = Cos(heading_change_rad_);
  BlendEnd(movement, false);
  BlendEnd(movement, true);
}

void EndPoses::BlendEnd(const Movement& movement, bool is_end) {
  const auto row_floats = static_cast<std::size_t>(layout_.row_floats);
  const float* rows = Rows(is_end);
  std::array<float, kMaxRowFloats> sum;
  kernels::SumRows(rows, movement.weights.data(), movement.weights.size(), row_floats, sum.data());

  End& end = ends_[is_end ? 1 : 0];
  const auto [position, yaw_rad] = layout_.RootOf(sum.data());
  end.root_m = position;
  end.sine = Sin(yaw_rad);
  end.cosine = Cos(yaw_rad);
  for (std::size_t f = 0; f < 2; ++f) {
    DVec3 arm(skeleton_.legs[f].ball_offset_m);
    for (std::size_t i = 0; i < chains_[f].size(); ++i) {
      const auto j = static_cast<std::size_t>(chains_[f][i]);
      Link& link = end.links[f][i];
      DQuat blended(GridLayout::RotationOf(sum.data(), j));
      double norm = std::sqrt(glm::dot(blended, blended));
      link.per_norm = 1.0 / norm;
      // A sum of rotations that is too short has no direction. It is handled as in EvaluateBlend.
      if (norm < kernels::kSmallestNorm) {
        const auto largest = static_cast<std::size_t>(
            std::max_element(movement.weights.begin(), movement.weights.end()) -
            movement.weights.begin());
        blended = DQuat(GridLayout::RotationOf(rows + largest * row_floats, j));
        norm = std::sqrt(glm::dot(blended, blended));
        // The derivative is 0, because this rotation does not depend smoothly on the weights.
        link.per_norm = 0.0;
      }
      link.rotation = blended * (1.0 / norm);
      link.arm = arm;
      link.ball = link.rotation * arm;
      arm = DVec3(skeleton_.joints[j].offset_m) + link.ball;
    }
    end.arms_m[f] = Turn(end.sine, end.cosine, end.links[f][chains_[f].size() - 1].ball);
  }
}

ParameterValues EndPoses::Measure() const {
  return ParametersOf(*group_,
                      {.start_m = sign_ * (ends_[0].Ball(0) - ends_[0].Ball(1)),
                       .end_m = sign_ * Turn(-sine_, cosine_, ends_[1].Ball(0) - ends_[1].Ball(1)),
                       .travel_m = 0.5 * (ends_[1].Ball(0) + ends_[1].Ball(1) - ends_[0].Ball(0) -
                                          ends_[0].Ball(1)),
                       .heading_change_rad = heading_change_rad_});
}

// Adds the derivative of dot(along, ball), where `ball` is the position of a foot's ball relative
// to the base frame.
//
// The loop runs from the root to the ball. g is the direction in the axes of the parent of the
// current joint. With the arm v (the vector from the joint to the ball) and the joint's rotation q
// = (u, w), the rotated arm is
//
//   R(q) v = (w w - u u) v + 2 (u v) u + 2 w (u x v)
//
// The part of the derivative of R(q) v that results from a change of the length of q is subtracted,
// because rotations are normalized.
void EndPoses::AddGradient(const End& end, std::size_t foot, const DVec3& along,
                           Gradient& gradient) const {
  const DVec3& arm = end.arms_m[foot];
  gradient.Add(layout_.joint_count, along, along.x * arm.z - along.z * arm.x);
  DVec3 g = Turn(-end.sine, end.cosine, along);
  for (std::size_t i = chains_[foot].size(); i-- > 0;) {
    const Link& link = end.links[foot][i];
    const DVec3 u(link.rotation.x, link.rotation.y, link.rotation.z);
    const double w = link.rotation.w;
    const DVec3& v = link.arm;
    const double vg = glm::dot(v, g);
    const double ug = glm::dot(u, g);
    const double uv = glm::dot(u, v);
    const double longer = glm::dot(link.ball, g);
    const double scale = 2.0 * link.per_norm;
    gradient.Add(chains_[foot][i],
                 scale * (v * ug - u * (vg + longer) + g * uv + w * glm::cross(v, g)),
                 scale * (w * (vg - longer) + glm::dot(glm::cross(u, v), g)));
    g = glm::conjugate(link.rotation) * g;
  }
}

void EndPoses::MeasureSlopes(std::span<double> slopes) {
  const auto n = static_cast<std::size_t>(group_->example_count);
  const auto row_floats = static_cast<std::size_t>(layout_.row_floats);
  const DVec3 apart = sign_ * Turn(-sine_, cosine_, ends_[1].Ball(0) - ends_[1].Ball(1));
  // Changing the weights also rotates the heading frame in which the end is measured.
  const DVec3 by_heading(-apart.z, 0.0, apart.x);
  for (std::size_t l = 0; l < group_->parameters.size(); ++l) {
    const std::span<double> out = slopes.subspan(l * n, n);
    std::fill(out.begin(), out.end(), 0.0);
    const auto add = [&](bool is_end, const DVec3& left, const DVec3& right) {
      gradient_.Clear();
      AddGradient(ends_[is_end ? 1 : 0], 0, left, gradient_);
      AddGradient(ends_[is_end ? 1 : 0], 1, right, gradient_);
      gradient_.AddTo(Rows(is_end), row_floats, out);
    };
    const auto add_start = [&](const DVec3& axis) { add(false, sign_ * axis, -sign_ * axis); };
    const auto add_end = [&](const DVec3& axis) {
      const DVec3 along = sign_ * Turn(sine_, cosine_, axis);
      add(true, along, -along);
      const double by = glm::dot(axis, by_heading);
      for (std::size_t e = 0; e < n; ++e) out[e] += by * group_->heading_change_rad[e];
    };
    const auto add_travel = [&](const DVec3& axis) {
      add(false, -0.5 * axis, -0.5 * axis);
      add(true, 0.5 * axis, 0.5 * axis);
    };
    const DVec3 x(1.0, 0.0, 0.0);
    const DVec3 y(0.0, 1.0, 0.0);
    const DVec3 z(0.0, 0.0, 1.0);
    switch (group_->parameters[l].name) {
      case ParameterName::kStartX: add_start(x); break;
      case ParameterName::kStartY: add_start(y); break;
      case ParameterName::kStartZ: add_start(z); break;
      case ParameterName::kEndX: add_end(x); break;
      case ParameterName::kEndY: add_end(y); break;
      case ParameterName::kEndZ: add_end(z); break;
      case ParameterName::kTurn:
        std::copy_n(group_->heading_change_rad.begin(), n, out.begin());
        break;
      case ParameterName::kLength: add_travel(z); break;
      case ParameterName::kHeight: add_travel(y); break;
    }
  }
}

}  // namespace stridewire
