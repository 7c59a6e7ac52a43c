#include "runtime/pose/soa_pose_evaluator.h"

#include <algorithm>
#include <array>

#include "base/check.h"
#include "base/prefetch.h"
#include "runtime/pose/grid_blend.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/pose/pose_kernels.h"

namespace stridewire {

using kernels::kBlock;
static_assert(SoaPose::kLanes == kBlock);

void SoaPose::Get(std::size_t lane, PoseSpan pose) const {
  pose.root_position_m = root_m(lane);
  for (std::size_t j = 0; j < pose.rotations.size(); ++j) {
    const Numbers* q = &numbers_[3 + 4 * j];
    pose.rotations[j] = Quat(q[3].of[lane], q[0].of[lane], q[1].of[lane], q[2].of[lane]);
  }
}

void SoaPose::GetFirst(std::span<Vec3* const> roots_m, std::span<Quat* const> rotations) const {
  STRIDEWIRE_CHECK(rotations.size() <= kLanes && roots_m.size() == rotations.size());
  std::array<float*, kLanes> to;
  for (std::size_t lane = 0; lane < rotations.size(); ++lane) {
    *roots_m[lane] = root_m(lane);
    to[lane] = &rotations[lane]->x;
  }
  kernels::ScatterRotations(this->rotations(), joint_count(), rotations.size(), to.data());
}

void SoaPose::Set(std::size_t lane, ConstPoseSpan pose) {
  for (int c = 0; c < 3; ++c) {
    numbers_[static_cast<std::size_t>(c)].of[lane] = pose.root_position_m[c];
  }
  for (std::size_t j = 0; j < pose.rotations.size(); ++j) {
    const Quat& q = pose.rotations[j];
    Numbers* to = &numbers_[3 + 4 * j];
    to[0].of[lane] = q.x;
    to[1].of[lane] = q.y;
    to[2].of[lane] = q.z;
    to[3].of[lane] = q.w;
  }
}

struct SoaPoseEvaluator::Work {
  struct alignas(64) LaneFloats {
    float of[kBlock] = {};
  };
  struct LaneDoubles {
    alignas(64) double of[kBlock] = {};
  };
  // Maximum number of movements that BlendRows blends together. The weighted sums of this many
  // movements fit into the level-1 cache.
  static constexpr std::size_t kMaxBlended = 8;
  static float* FloatsOf(std::vector<LaneFloats>& lanes) { return lanes.front().of; }

  Work(const MotionLibrary& of_library, int of_max_count)
      : library(of_library),
        joints(static_cast<std::size_t>(of_library.skeleton().joint_count())),
        row_floats(static_cast<std::size_t>(of_library.layout().row_floats)),
        max_count(of_max_count),
        samples(static_cast<std::size_t>(of_max_count)),
        times(static_cast<std::size_t>(of_max_count)),
        ring(kMaxBlended * 4 * row_floats / kBlock),
        rows(static_cast<std::size_t>(of_max_count) * row_floats),
        plan(kPackedPlanFloats),
        transposed(4 * joints),
        ease(kernels::kDifferenceFloats * joints),
        velocity(3 * joints),
        zeros(4 * joints, 0.0f),
        poses(of_library.skeleton().joint_count()),
        scratch(of_library.skeleton().joint_count()) {}

  void SampleGrids();
  void BlendRows();
  void CollectPlans();
  void CollectDifferences();
  void Finish(std::size_t pose);
  void ApplyPlantFade(std::size_t pose);
  [[nodiscard]] float* RowOf(std::size_t pose, std::size_t lane) {
    return FloatsOf(rows) + (pose * kBlock + lane) * row_floats;
  }
  [[nodiscard]] const Movement& movement(std::size_t lane) const { return *runs[lane].movement; }
  [[nodiscard]] const MotionGroup& group(std::size_t lane) const {
    return library.group(movement(lane).group);
  }

  const MotionLibrary& library;
  std::size_t joints;
  std::size_t row_floats;
  int max_count;

  // The members from here to has_plant_fade describe the block that is being evaluated.
  std::array<SampleRun, kBlock> runs;
  std::size_t lanes = 0;
  std::size_t count = 0;
  std::size_t next = 0;
  bool is_planted = false;
  bool is_eased = false;        // True if some lane still has a difference pose at some time.
  bool is_inertial = false;     // True if some lane uses inertialization.
  bool has_plant_fade = false;  // True if some lane has a plant fade.

  std::vector<kernels::GridSamples> samples;  // [pose]
  std::vector<LaneDoubles> times;             // [pose]
  std::vector<LaneFloats> ring;               // [kMaxBlended][4][row_floats]
  std::vector<LaneFloats> rows;               // [pose][lane][row_floats]
  kernels::GridTimes grid_times = {};         // Initialized, because unused lanes are computed too.
  std::array<LaneDoubles, 3> base_m;
  LaneDoubles heading_rad, sine, cosine, extra_turn_rad;
  std::vector<LaneFloats> plan;        // [kPackedPlanFloats]
  std::vector<LaneFloats> transposed;  // [joint][x y z w]: difference poses
  std::vector<LaneFloats> ease;        // [joint][kDifferenceFloats]
  std::vector<LaneFloats> velocity;    // [joint][x y z]
  std::array<LaneFloats, 3> root_ease_m, root_ease_m_s;
  LaneFloats fastest;
  LaneFloats is_inertial_lane;
  std::vector<float> zeros;  // Zeros, for lanes without a difference pose.
  SoaPose poses;
  Pose scratch;  // The pose of one lane, for ApplyPlantFade.
};

// Computes the time of each pose and its GridSamples.
void SoaPoseEvaluator::Work::SampleGrids() {
  kernels::GridTimes& t = grid_times;
  const auto take_piece = [&](std::size_t i) {
    SetWarpPiece(movement(i).warp.PieceAt(t.time_s[i]), i, t);
  };
  for (std::size_t i = 0; i < lanes; ++i) {
    SetGridTime(group(i), movement(i), runs[i].time_s, i, t);
  }
  for (std::size_t pose = 0; pose < count; ++pose) {
    if (pose > 0) {
      for (std::size_t i = 0; i < lanes; ++i) {
        for (int tick = 0; tick < runs[i].ticks_apart; ++tick) {
          t.time_s[i] += runs[i].step_s;
        }
        if (t.time_s[i] >= t.end_s[i]) take_piece(i);
      }
    }
    std::ranges::copy(t.time_s, times[pose].of);
    kernels::ComputeGridSamples(lanes, t, samples[pose]);
  }
}

void SoaPoseEvaluator::Work::BlendRows() {
  std::array<const float*, kBlock> weights;
  for (std::size_t i = 0; i < lanes; ++i) weights[i] = movement(i).weights.data();
  for (std::size_t i = 0; i < lanes;) {
    std::size_t end = i + 1;
    while (end < lanes && end - i < kMaxBlended && movement(end).group == movement(i).group) ++end;
    kernels::BlendRows({.grid = group(i).grid.data(),
                        .examples = static_cast<std::size_t>(group(i).row_count()),
                        .row_floats = row_floats,
                        .point_count = group(i).grid_point_count,
                        .lane = i,
                        .lanes = end - i,
                        .poses = count,
                        .samples = samples.data(),
                        .weights = weights.data(),
                        .ring = FloatsOf(ring),
                        .rows = FloatsOf(rows)});
    i = end;
  }
}

void SoaPoseEvaluator::Work::CollectPlans() {
  has_plant_fade = false;
  std::array<const float*, kBlock> plans;
  for (std::size_t i = 0; i < kBlock; ++i) {
    const FootPlan& feet = movement(i < lanes ? i : 0).feet;
    plans[i] = feet.packed.data();
    has_plant_fade |= feet.plant_fade_s > 0.0;
  }
  kernels::Transpose(plans.data(), kPackedPlanFloats, lanes, FloatsOf(plan));
}

// Collects the difference poses that have not faded out yet.
void SoaPoseEvaluator::Work::CollectDifferences() {
  is_eased = is_inertial = false;
  std::array<const float*, kBlock> differences;
  std::array<const float*, kBlock> velocities;
  differences.fill(zeros.data());
  velocities.fill(zeros.data());
  for (std::size_t i = 0; i < lanes; ++i) {
    const Movement& of = movement(i);
    is_inertial_lane.of[i] = 0.0f;
    // If the difference pose has already faded out at the first pose, no later pose needs it.
    if (samples[0].is_eased[i] == 0.0f) continue;
    is_eased = true;
    differences[i] = &of.difference.rotations[0].x;
    for (std::size_t c = 0; c < 3; ++c) {
      root_ease_m[c].of[i] = of.difference.root_position_m[static_cast<int>(c)];
      root_ease_m_s[c].of[i] =
          of.is_inertial ? of.difference_velocity.root_m_s[static_cast<int>(c)] : 0.0f;
    }
    if (!of.is_inertial) continue;
    is_inertial = true;
    is_inertial_lane.of[i] = 1.0f;
    velocities[i] = &of.difference_velocity.joints_rad_s[0].x;
  }
  if (!is_eased) return;
  kernels::Transpose(differences.data(), 4 * joints, lanes, FloatsOf(transposed));
  kernels::PrepareDifferences(FloatsOf(transposed), joints, lanes, FloatsOf(ease));
  if (!is_inertial) return;
  kernels::Transpose(velocities.data(), 3 * joints, lanes, FloatsOf(velocity));
  kernels::FindLargestVelocities(FloatsOf(velocity), joints, lanes, fastest.of);
}

void SoaPoseEvaluator::Work::Finish(std::size_t pose) {
  std::array<const float*, kBlock> of_lanes;
  for (std::size_t i = 0; i < kBlock; ++i) of_lanes[i] = RowOf(pose, i);
  const kernels::GridSamples& at = samples[pose];
  const kernels::FinishPosesJob blend = {
      .rows = of_lanes.data(),
      .joint_count = joints,
      .lanes = lanes,
      .base_m = base_m[0].of,
      .heading_rad = heading_rad.of,
      .sine = sine.of,
      .cosine = cosine.of,
      .extra_turn_rad = extra_turn_rad.of,
      .remaining_turn = at.remaining_turn,
      .ease = is_eased ? FloatsOf(ease) : nullptr,
      .velocity = is_eased && is_inertial ? FloatsOf(velocity) : nullptr,
      .fastest = fastest.of,
      .root_ease_m = root_ease_m[0].of,
      .root_ease_m_s = root_ease_m_s[0].of,
      .fraction = at.fraction,
      .slope_s = at.slope_s,
      .is_eased = at.is_eased,
      .is_inertial = is_inertial_lane.of};
  if (kernels::FinishPoses(blend, poses.roots_m(), poses.rotations())) return;
  for (std::size_t i = 0; i < lanes; ++i) {
    UseLargestExample(group(i), library.layout(), movement(i), GridSampleOf(samples[pose], i),
                      RowOf(pose, i));
  }
  (void)kernels::FinishPoses(blend, poses.roots_m(), poses.rotations());
}

void SoaPoseEvaluator::Work::ApplyPlantFade(std::size_t pose) {
  for (std::size_t i = 0; i < lanes; ++i) {
    if (movement(i).feet.plant_fade_s == 0.0) continue;
    poses.Get(i, scratch);
    stridewire::ApplyPlantFade(library.leg_rig(), movement(i), times[pose].of[i], scratch);
    poses.Set(i, scratch);
  }
}

SoaPoseEvaluator::SoaPoseEvaluator(const MotionLibrary& library, int max_count)
    : work_(std::make_unique<Work>(library, max_count)) {
  STRIDEWIRE_CHECK(max_count >= 1);
}
SoaPoseEvaluator::~SoaPoseEvaluator() = default;
SoaPoseEvaluator::SoaPoseEvaluator(SoaPoseEvaluator&&) noexcept = default;
SoaPoseEvaluator& SoaPoseEvaluator::operator=(SoaPoseEvaluator&&) noexcept = default;

int SoaPoseEvaluator::max_count() const { return work_->max_count; }

void SoaPoseEvaluator::Begin(std::span<const SampleRun> runs, int count) {
  Work& work = *work_;
  STRIDEWIRE_CHECK(!runs.empty() && runs.size() <= kBlock);
  STRIDEWIRE_CHECK(count >= 1 && count <= work.max_count);
  std::ranges::copy(runs, work.runs.begin());
  work.lanes = runs.size();
  work.count = static_cast<std::size_t>(count);
  work.next = 0;
  work.is_planted = runs.front().movement->feet.is_active;
  for (std::size_t i = 0; i < work.lanes; ++i) {
    const Movement& movement = work.movement(i);
    STRIDEWIRE_CHECK(movement.feet.is_active == work.is_planted);
    STRIDEWIRE_CHECK(movement.group < work.library.group_count());
    for (std::size_t c = 0; c < 3; ++c) {
      work.base_m[c].of[i] = movement.base.position_m[static_cast<int>(c)];
    }
    work.heading_rad.of[i] = movement.base.heading_rad;
    work.extra_turn_rad.of[i] = movement.extra_turn_rad;
  }
  kernels::SinCos(work.heading_rad.of, work.lanes, work.sine.of, work.cosine.of);
  work.SampleGrids();
  work.CollectDifferences();
  if (work.is_planted) work.CollectPlans();
  work.BlendRows();
}

const SoaPose& SoaPoseEvaluator::Next() {
  Work& work = *work_;
  STRIDEWIRE_CHECK(work.next < work.count);
  const std::size_t pose = work.next++;
  work.Finish(pose);
  if (work.is_planted) {
    kernels::PlantPoses(work.library.leg_rig(),
                        {.plan = Work::FloatsOf(work.plan),
                         .time_s = work.times[pose].of,
                         .base_m = work.base_m[0].of,
                         .root_m = work.poses.roots_m(),
                         .rotations = work.poses.rotations()},
                        work.lanes);
    if (work.has_plant_fade) work.ApplyPlantFade(pose);
  }
  return work.poses;
}

void SoaPoseEvaluator::PrefetchTimes(const Movement& movement) {
  PrefetchBytes(&movement, kCacheLineBytes);
  PrefetchBytes(&movement.warp, 2 * kCacheLineBytes);
  PrefetchBytes(&movement.feet, 1);
}

void SoaPoseEvaluator::PrefetchMovement(const Movement& movement) {
  PrefetchBytes(&movement, offsetof(Movement, warp) + 2 * kCacheLineBytes);
  if (movement.feet.is_active) {
    PrefetchBytes(&movement.feet, offsetof(FootPlan, packed) + sizeof(PackedFootPlan));
  }
}

void SoaPoseEvaluator::Prefetch(const SampleRun& run) {
  const Movement& movement = *run.movement;
  PrefetchBytes(movement.weights.data(), movement.weights.size() * sizeof(float));
  if (run.time_s < movement.start_offset_s + movement.ease_out_s) {
    PrefetchBytes(movement.difference.rotations.data(),
                  movement.difference.rotations.size() * sizeof(Quat));
    PrefetchBytes(movement.difference_velocity.joints_rad_s.data(),
                  movement.difference_velocity.joints_rad_s.size() * sizeof(Vec3));
  }
}

void EvaluatePoses(SoaPoseEvaluator& evaluator, std::span<const PoseJob> jobs) {
  // The poses of a block must either all have planted feet or all have none.
  for (const bool is_planted : {false, true}) {
    std::array<SampleRun, kBlock> runs;
    std::array<Pose*, kBlock> outputs;
    std::size_t lanes = 0;
    const auto evaluate = [&] {
      if (lanes == 0) return;
      evaluator.Begin(std::span(runs).first(lanes), 1);
      const SoaPose& poses = evaluator.Next();
      for (std::size_t i = 0; i < lanes; ++i) poses.Get(i, *outputs[i]);
      lanes = 0;
    };
    for (const PoseJob& job : jobs) {
      if (job.movement->feet.is_active != is_planted) continue;
      runs[lanes] = {.movement = job.movement, .time_s = job.time_s};
      outputs[lanes++] = job.pose;
      if (lanes == kBlock) evaluate();
    }
    evaluate();
  }
}

}  // namespace stridewire
