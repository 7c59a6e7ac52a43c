#include "runtime/plan/foot_sampler.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "base/check.h"
#include "base/trig.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/grid_blend.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {
namespace {
constexpr std::size_t kBlock = kernels::kBlock;
}

// Arrays for evaluating one movement at several times, with one time per lane. SetDifference sets
// `differences`, `ease`, `velocity`, `fastest`, `is_inertial`, `root_ease_m` and `root_ease_m_s`.
struct FootSamplerLanes {
  static constexpr std::size_t kJoints = LegRig::kMaxJointsOfLegs;
  kernels::GridTimes times{};
  kernels::GridSamples samples;
  alignas(64) double base_m[3 * kBlock], heading_rad[kBlock], sine[kBlock], cosine[kBlock],
      extra_turn_rad[kBlock];
  alignas(64) float rows[kBlock][4 * (kJoints + 1)];
  alignas(64) float differences[kJoints * 4 * kBlock];
  alignas(64) float ease[kJoints * kernels::kDifferenceFloats * kBlock];
  alignas(64) float velocity[kJoints * 3 * kBlock];
  alignas(64) float fastest[kBlock], is_inertial[kBlock];
  alignas(64) float root_ease_m[3 * kBlock], root_ease_m_s[3 * kBlock];
  alignas(64) float rotations[kJoints * 4 * kBlock];
};

FootPlanScratch::FootPlanScratch(const MotionLibrary& library)
    : library_(&library),
      cache_(std::make_unique<GridCache>(library.layout())),
      lanes_(std::make_unique<FootSamplerLanes>()) {}
FootPlanScratch::~FootPlanScratch() = default;
FootPlanScratch::FootPlanScratch(FootPlanScratch&&) noexcept = default;
FootPlanScratch& FootPlanScratch::operator=(FootPlanScratch&&) noexcept = default;

namespace {

// Sets all lanes to the same number.
template <typename Number>
void Fill(Number* lanes, Number number) {
  std::fill_n(lanes, kBlock, number);
}

void SampleGrids(const MotionGroup& group, const Movement& movement,
                 std::span<const double> times_s, FootSamplerLanes& lanes) {
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    SetGridTime(group, movement, times_s[i], i, lanes.times);
  }
  kernels::ComputeGridSamples(times_s.size(), lanes.times, lanes.samples);
}

}  // namespace

void FootSampler::SetDifference(const Movement& movement) {
  const Pose& difference = movement.difference;
  const auto& velocity = movement.difference_velocity;
  const std::span<const int> joints = library_.leg_rig().joints;
  FootSamplerLanes& lanes = scratch_.lanes();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const Quat& q = difference.rotations[static_cast<std::size_t>(joints[j])];
    float* to = lanes.differences + j * 4 * kBlock;
    Fill(to, q.x);
    Fill(to + kBlock, q.y);
    Fill(to + 2 * kBlock, q.z);
    Fill(to + 3 * kBlock, q.w);
    if (!movement.is_inertial) continue;
    const Vec3& v = velocity.joints_rad_s[static_cast<std::size_t>(joints[j])];
    for (std::size_t c = 0; c < 3; ++c) {
      Fill(lanes.velocity + (j * 3 + c) * kBlock, v[static_cast<int>(c)]);
    }
  }
  for (std::size_t c = 0; c < 3; ++c) {
    Fill(lanes.root_ease_m + c * kBlock, difference.root_position_m[static_cast<int>(c)]);
    Fill(lanes.root_ease_m_s + c * kBlock,
         movement.is_inertial ? velocity.root_m_s[static_cast<int>(c)] : 0.0f);
  }
  Fill(lanes.is_inertial, movement.is_inertial ? 1.0f : 0.0f);
  kernels::PrepareDifferences(lanes.differences, joints.size(), kBlock, lanes.ease);
  if (movement.is_inertial) {
    kernels::FindLargestVelocities(lanes.velocity, joints.size(), kBlock, lanes.fastest);
  }
}

void FootSampler::Sample(const Movement& movement, std::span<const double> times_s,
                         std::size_t eased) {
  STRIDEWIRE_CHECK(times_s.size() <= kMaxTimes && eased <= times_s.size());
  if (SampleTogether(movement, times_s, eased)) return;
  for (std::size_t i = 0; i < times_s.size(); ++i) SampleOne(movement, times_s[i], i < eased, i);
}

// Returns false if the examples' rotations of a joint may cancel each other out (see
// BlendRotations).
bool FootSampler::SampleTogether(const Movement& movement, std::span<const double> times_s,
                                 std::size_t eased) {
  const MotionGroup& group = library_.group(movement.group);
  const GridLayout& layout = library_.layout();
  const LegRig& rig = library_.leg_rig();
  const std::span<const int> joints = rig.joints;
  FootSamplerLanes& lanes = scratch_.lanes();
  SampleGrids(group, movement, times_s, lanes);
  std::fill(lanes.samples.is_eased + eased, lanes.samples.is_eased + kBlock, 0.0f);
  const bool is_eased = std::ranges::any_of(std::span(lanes.samples.is_eased).first(eased),
                                            [](float lane) { return lane > 0.0f; });

  std::array<const float*, kBlock> rows;
  rows.fill(lanes.rows[0]);
  std::array<float, kMaxRowFloats> row;
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    BlendRow(group, layout, movement, GridSampleOf(lanes.samples, i), scratch_.cache(), row.data());
    float* to = lanes.rows[i];
    rows[i] = to;
    for (const int joint : joints) {
      std::memcpy(to, &row[4 * static_cast<std::size_t>(joint)], 4 * sizeof(float));
      to += 4;
    }
    std::memcpy(to, &row[4 * static_cast<std::size_t>(layout.joint_count)], 4 * sizeof(float));
  }

  for (std::size_t c = 0; c < 3; ++c) {
    Fill(lanes.base_m + c * kBlock, movement.base.position_m[static_cast<int>(c)]);
  }
  Fill(lanes.heading_rad, movement.base.heading_rad);
  Fill(lanes.sine, Sin(movement.base.heading_rad));
  Fill(lanes.cosine, Cos(movement.base.heading_rad));
  Fill(lanes.extra_turn_rad, movement.extra_turn_rad);
  const kernels::FinishPosesJob blend = {
      .rows = rows.data(),
      .joint_count = joints.size(),
      .lanes = times_s.size(),
      .base_m = lanes.base_m,
      .heading_rad = lanes.heading_rad,
      .sine = lanes.sine,
      .cosine = lanes.cosine,
      .extra_turn_rad = lanes.extra_turn_rad,
      .remaining_turn = lanes.samples.remaining_turn,
      .ease = is_eased ? lanes.ease : nullptr,
      .velocity = is_eased && movement.is_inertial ? lanes.velocity : nullptr,
      .fastest = lanes.fastest,
      .root_ease_m = lanes.root_ease_m,
      .root_ease_m_s = lanes.root_ease_m_s,
      .fraction = lanes.samples.fraction,
      .slope_s = lanes.samples.slope_s,
      .is_eased = lanes.samples.is_eased,
      .is_inertial = lanes.is_inertial};
  if (!kernels::FinishPoses(blend, roots_m_[0], lanes.rotations)) return false;
  kernels::ComputeFeet(
      rig, lanes.rotations, times_s.size(),
      {.balls_m = balls_m_[0][0], .ankles_m = ankles_m_[0][0], .toe_tips_m = toe_tips_m_[0][0]});
  return true;
}

void FootSampler::SampleOne(const Movement& movement, double time_s, bool is_eased, std::size_t i) {
  const MotionGroup& group = library_.group(movement.group);
  const LegRig& rig = library_.leg_rig();
  const auto evaluate = is_eased ? EvaluateMovement : EvaluateBlend;
  evaluate(group, library_.layout(), movement, time_s, scratch_.cache(), pose_);
  const auto put = [i](const Vec3& from, float(&to)[3][kMaxTimes]) {
    for (std::size_t c = 0; c < 3; ++c) to[c][i] = from[static_cast<int>(c)];
  };
  put(pose_.root_position_m, roots_m_);
  LegPose leg;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const auto f = static_cast<std::size_t>(foot);
    EvaluateLeg(library_.skeleton(), rig, pose_, foot, leg);
    put(leg.ball_m, balls_m_[f]);
    put(leg.positions_m[static_cast<std::size_t>(rig.side(foot).ankle)], ankles_m_[f]);
    put(leg.toe_tip_m, toe_tips_m_[f]);
  }
}

DVec3 FootSampler::Ball(std::size_t i, Foot foot) const {
  return DVec3(At(roots_m_, i)) + DVec3(At(balls_m_[static_cast<std::size_t>(foot)], i));
}

LegPose FootSampler::LegAt(std::size_t i, Foot foot) const {
  const auto f = static_cast<std::size_t>(foot);
  LegPose leg;
  leg.ball_m = At(balls_m_[f], i);
  leg.toe_tip_m = At(toe_tips_m_[f], i);
  leg.positions_m[static_cast<std::size_t>(library_.leg_rig().side(foot).ankle)] =
      At(ankles_m_[f], i);
  return leg;
}

BlendedFoot FootSampler::FootAt(std::size_t i, Foot foot) const {
  return FootOf(library_.leg_rig(), foot, DVec3(At(roots_m_, i)), LegAt(i, foot));
}

double FootSampler::LowestSole(std::size_t i, Foot foot) const {
  return roots_m_[1][i] + LegAt(i, foot).LowestSole(library_.leg_rig().side(foot));
}

double FootSampler::LowestFlatSole(std::size_t i, Foot foot) const {
  const auto f = static_cast<std::size_t>(foot);
  const LegRig::Side& side = library_.leg_rig().side(foot);
  return roots_m_[1][i] +
         std::min(balls_m_[f][1][i] - side.ball_height_m, ankles_m_[f][1][i] - side.ankle_height_m);
}

double FootSampler::LowestPoint(std::size_t i, Foot foot) const {
  const auto f = static_cast<std::size_t>(foot);
  const double toe_m = toe_tips_m_[f][1][i] - library_.leg_rig().side(foot).toe_height_m;
  return std::min(LowestFlatSole(i, foot), roots_m_[1][i] + toe_m);
}

}  // namespace stridewire
