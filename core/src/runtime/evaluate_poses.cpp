#include "stridewire/runtime/evaluate_poses.h"

#include <algorithm>
#include <array>
#include <optional>

#include "pose_kernels.h"
#include "prefetch.h"

namespace stridewire {
namespace {

// One pose of a batch: what BlendPoses needs to know of it, and where it goes.
struct BlendJob {
  const MotionGroup& group;
  const Movement& movement;
  double time_s;
  GridCache& cache;
  bool is_eased;  // with the difference pose
  PoseSpan out;
};

// `count` poses, kernels::kBlock at most; `job_at(i)` tells what they are, `before(i)` is called before the rows of one
// are read. Whatever they are batched with, they are the same bytes.
template <typename JobAt, typename Before>
void BlendPoses(const GridLayout& layout, std::size_t count, JobAt&& job_at, Before&& before) {
  std::array<std::optional<BlendJob>, kernels::kBlock> blends;
  kernels::GridTimes times = {};  // lanes of nobody are worked out, too
  for (std::size_t i = 0; i < count; ++i) {
    const BlendJob& job = blends[i].emplace(job_at(i));
    const Movement& movement = job.movement;
    const TimeWarp::Piece piece = movement.warp.PieceAt(job.time_s);
    times.time_s[i] = job.time_s;
    times.begin_s[i] = piece.begin_s;
    times.end_s[i] = piece.end_s;
    times.begin[i] = piece.begin;
    times.end[i] = piece.end;
    times.begin_slope[i] = piece.begin_slope;
    times.end_slope[i] = piece.end_slope;
    times.last_cell[i] = job.group.grid_point_count - 2;
    times.duration_s[i] = movement.warp.duration_s();
    times.entered_s[i] = movement.entered_s;
    times.ease_out_s[i] = movement.ease_out_s;
  }
  kernels::FindInGrids(count, times);

  std::array<DVec3, kernels::kBlock> positions;
  std::array<double, 2 * kernels::kBlock> angles_rad;  // of the base, and half of the root's
  std::array<double, 2 * kernels::kBlock> sines;
  std::array<double, 2 * kernels::kBlock> cosines;
  for (std::size_t i = 0; i < count; ++i) {
    before(i);
    const BlendJob& job = *blends[i];
    const Movement& movement = job.movement;
    kernels::RotationBlend blend;
    blend.padded = static_cast<std::size_t>(layout.padded_joints);
    blend.joint_count = job.out.rotations.size();
    const int first = static_cast<int>(times.first_point[i]);
    DVec3 position(0.0);
    double yaw_rad = 0.0;
    for (std::size_t k = 0; k < 4; ++k) {
      // One that is not there weighs nothing, but is read.
      const int point = std::min(first + static_cast<int>(k), job.group.grid_point_count - 1);
      const float* row = job.cache.Row(job.group, movement.weights, point).data();
      blend.rows[k] = row;
      blend.weights[k] = times.weights[k][i];
      const double weight = times.weights[k][i];
      const GridLayout::Root root = layout.RootOf(row);
      position += weight * root.position_m;
      yaw_rad += weight * root.yaw_rad;
    }
    yaw_rad += movement.steer_rad * (1.0 - times.steered[i]);
    positions[i] = position;
    angles_rad[2 * i] = movement.base.heading_rad;
    angles_rad[2 * i + 1] = 0.5 * (movement.base.heading_rad + yaw_rad);
    if (job.is_eased && times.eased[i] < 1.0) {
      blend.difference = &movement.difference.rotations[0].x;
      blend.fraction = times.fraction[i];
      if (movement.is_inertial) {
        blend.velocity = &movement.difference_velocity.joints_rad_s[0].x;
        blend.seconds = times.slope_s[i];
      }
    }
    kernels::BlendRotations(blend, &job.out.rotations[0].x);
  }
  kernels::SinCos(angles_rad.data(), 2 * count, sines.data(), cosines.data());
  for (std::size_t i = 0; i < count; ++i) {
    const BlendJob& job = *blends[i];
    const double sine = sines[2 * i];
    const double cosine = cosines[2 * i];
    const DVec3& local = positions[i];
    Vec3& out = job.out.root_position_m;
    out = Vec3(job.movement.base.position_m + DVec3(cosine * local.x + sine * local.z, local.y,
                                                    cosine * local.z - sine * local.x));
    job.out.rotations[0] = Quat(static_cast<float>(cosines[2 * i + 1]), 0.0f,
                                static_cast<float>(sines[2 * i + 1]), 0.0f) *
                           job.out.rotations[0];
    if (!job.is_eased || !(times.eased[i] < 1.0)) continue;
    const Movement& movement = job.movement;
    out += times.fraction[i] * movement.difference.root_position_m;
    if (movement.is_inertial) out += times.slope_s[i] * movement.difference_velocity.root_m_s;
  }
}

}  // namespace

void EvaluateBlend(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                   double time_s, GridCache& cache, PoseSpan out) {
  BlendPoses(
      layout, 1, [&](std::size_t) { return BlendJob{group, movement, time_s, cache, false, out}; },
      [](std::size_t) {});
}

void EvaluateMovement(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                      double time_s, GridCache& cache, PoseSpan out) {
  BlendPoses(
      layout, 1, [&](std::size_t) { return BlendJob{group, movement, time_s, cache, true, out}; },
      [](std::size_t) {});
}

namespace {

// Where what is read of a job lies, which Prefetch reads.
void PrefetchPlaces(const PoseJob& job) {
  const Movement& movement = *job.movement;
  PrefetchBytes(&movement, offsetof(Movement, feet) + offsetof(FootPlan, packed));
  PrefetchBytes(job.cache, sizeof(*job.cache));
  PrefetchBytes(job.shown, sizeof(*job.shown));
}

// What is read of a job, into the nearest cache: its memory lies in several places, each of which would be waited for.
void Prefetch(const PoseJob& job) {
  const Movement& movement = *job.movement;
  job.cache->Prefetch();
  PrefetchBytes(&movement.feet.packed, sizeof(movement.feet.packed));
  PrefetchBytes(job.shown->rotations.data(), job.shown->rotations.size() * sizeof(Quat));
  if (job.time_s < movement.entered_s + movement.ease_out_s) {
    PrefetchBytes(movement.difference.rotations.data(), job.shown->rotations.size() * sizeof(Quat));
    PrefetchBytes(movement.difference_velocity.joints_rad_s.data(),
                  movement.difference_velocity.joints_rad_s.size() * sizeof(Vec3));
  }
}

}  // namespace

void EvaluatePoses(const MotionLibrary& library, std::span<const PoseJob> jobs) {
  // Far enough ahead that memory has come by then, near enough that it has not gone again.
  constexpr std::size_t kAhead = 2;
  const GridLayout& layout = library.layout();
  std::array<kernels::PlantJob, kernels::kBlock> plants;
  for (std::size_t i = 0; i < std::min(kernels::kBlock, jobs.size()); ++i) PrefetchPlaces(jobs[i]);
  for (std::size_t i = 0; i < std::min(kAhead, jobs.size()); ++i) Prefetch(jobs[i]);
  while (!jobs.empty()) {
    const std::size_t count = std::min(jobs.size(), kernels::kBlock);
    std::size_t planted = 0;
    BlendPoses(
        layout, count,
        [&](std::size_t i) {
          const PoseJob& job = jobs[i];
          return BlendJob{library.group(job.movement->group),
                          *job.movement,
                          job.time_s,
                          *job.cache,
                          true,
                          *job.shown};
        },
        [&](std::size_t i) {
          if (i + kernels::kBlock < jobs.size()) PrefetchPlaces(jobs[i + kernels::kBlock]);
          if (i + kAhead < jobs.size()) Prefetch(jobs[i + kAhead]);
        });
    for (const PoseJob& job : jobs.first(count)) {
      if (job.blended != nullptr) *job.blended = *job.shown;  // of the same size: no allocation
      if (!job.movement->feet.is_active) continue;
      const DVec3& base = job.movement->base.position_m;
      float* root = &job.shown->root_position_m.x;
      plants[planted++] = {.plan = job.movement->feet.packed.data(),
                           .time_s = job.time_s,
                           .base_m = {base.x, base.y, base.z},
                           .root_m = root,
                           .rotations = &job.shown->rotations[0].x,
                           .root_out_m = root};
    }
    if (planted > 0) kernels::PlantPoses(library.leg_rig(), plants.data(), planted);
    for (const PoseJob& job : jobs.first(count)) {
      if (job.movement->feet.is_active) {
        Unsettle(library.leg_rig(), *job.movement, job.time_s, *job.shown);
      }
    }
    jobs = jobs.subspan(count);
  }
}

}  // namespace stridewire
