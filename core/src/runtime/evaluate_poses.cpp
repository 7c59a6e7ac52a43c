#include "stridewire/runtime/evaluate_poses.h"

#include <algorithm>
#include <array>

#include "cell_weights.h"
#include "pose_kernels.h"
#include "prefetch.h"

namespace stridewire {
namespace {

using kernels::kBlock;

// Where a pose lies in its movement's grid, and how much is left of the poses before.
struct Place {
  int first_point;               // of the four that are interpolated
  std::array<float, 4> weights;  // of them
  float fraction;                // of the difference that is left
  float slope_s;                 // of its velocity
  double steered;                // EaseOut of the part of the movement behind
  bool is_eased;                 // there is something left of the difference
};

// Works out the places of kBlock poses at a time.
class PlaceFinder {
 public:
  void Set(std::size_t i, const MotionGroup& group, const Movement& movement, double time_s) {
    const TimeWarp::Piece piece = movement.warp.PieceAt(time_s);
    times_.time_s[i] = time_s;
    times_.begin_s[i] = piece.begin_s;
    times_.end_s[i] = piece.end_s;
    times_.begin[i] = piece.begin;
    times_.end[i] = piece.end;
    times_.begin_slope[i] = piece.begin_slope;
    times_.end_slope[i] = piece.end_slope;
    times_.last_cell[i] = group.grid_point_count - 2;
    times_.duration_s[i] = movement.warp.duration_s();
    times_.entered_s[i] = movement.entered_s;
    times_.ease_out_s[i] = movement.ease_out_s;
  }
  void Find(std::size_t count, Place* places) {
    kernels::FindInGrids(count, times_);
    for (std::size_t i = 0; i < count; ++i) {
      places[i] = {.first_point = static_cast<int>(times_.first_point[i]),
                   .weights = {times_.weights[0][i], times_.weights[1][i], times_.weights[2][i],
                               times_.weights[3][i]},
                   .fraction = times_.fraction[i],
                   .slope_s = times_.slope_s[i],
                   .steered = times_.steered[i],
                   .is_eased = times_.eased[i] < 1.0};
    }
  }

 private:
  kernels::GridTimes times_ = {};  // lanes of nobody are worked out, too
};

// Point `k` of a place. One behind the last weighs nothing, but is read.
int PointOf(const MotionGroup& group, const Place& place, int k) {
  return std::min(place.first_point + k, group.grid_point_count - 1);
}

// One pose whose row is blended.
struct BlendedRow {
  const MotionGroup* group;
  const Movement* movement;
  const Place* place;
  float* row;  // and kBlock floats beyond it
  Vec3* root_m;
  Quat* rotations;
};

void BlendRow(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
              const Place& place, GridCache& cache, float* row) {
  std::array<const float*, 4> points;
  for (int k = 0; k < 4; ++k) {
    const int point = PointOf(group, place, k);
    points[static_cast<std::size_t>(k)] = cache.Row(group, movement.weights, point).data();
  }
  kernels::BlendPoints(points.data(), place.weights.data(),
                       static_cast<std::size_t>(layout.row_floats), row);
}

// Of rotations that cancel each other, those of the largest example: it is at least a pose.
void TakeLargest(const GridLayout& layout, const BlendedRow& blend) {
  const auto padded = static_cast<std::size_t>(layout.padded_joints);
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  const std::vector<float>& weights = blend.movement->weights;
  const auto largest =
      static_cast<std::size_t>(std::max_element(weights.begin(), weights.end()) - weights.begin());
  for (std::size_t j = 0; j < static_cast<std::size_t>(layout.joint_count); ++j) {
    float square = 0.0f;
    for (std::size_t c = 0; c < 4; ++c) {
      square += blend.row[c * padded + j] * blend.row[c * padded + j];
    }
    if (square >= kernels::kSmallestNorm * kernels::kSmallestNorm) continue;
    for (std::size_t c = 0; c < 4; ++c) {
      float& sum = blend.row[c * padded + j];
      sum = 0.0f;
      for (int k = 0; k < 4; ++k) {
        const auto examples = static_cast<std::size_t>(PointOf(*blend.group, *blend.place, k)) *
                              static_cast<std::size_t>(blend.group->example_count);
        sum += blend.place->weights[static_cast<std::size_t>(k)] *
               blend.group->grid[(examples + largest) * row_floats + c * padded + j];
      }
    }
  }
}

// Makes rotations unit, adds what is left of the poses before and takes the poses into the world. kBlock of them at most.
void FinishPoses(const GridLayout& layout, std::span<const BlendedRow> blends) {
  std::array<double, 2 * kBlock> angles_rad;  // of the base, and half of the root's
  std::array<double, 2 * kBlock> sines;
  std::array<double, 2 * kBlock> cosines;
  for (std::size_t i = 0; i < blends.size(); ++i) {
    const BlendedRow& blend = blends[i];
    const Movement& movement = *blend.movement;
    const Place& place = *blend.place;
    const bool is_inertial = place.is_eased && movement.is_inertial;
    const kernels::RotationBlend rotations = {
        .row = blend.row,
        .padded = static_cast<std::size_t>(layout.padded_joints),
        .joint_count = static_cast<std::size_t>(layout.joint_count),
        .difference = place.is_eased ? &movement.difference.rotations[0].x : nullptr,
        .fraction = place.fraction,
        .velocity = is_inertial ? &movement.difference_velocity.joints_rad_s[0].x : nullptr,
        .seconds = place.slope_s};
    if (!kernels::BlendRotations(rotations, &blend.rotations[0].x)) {
      TakeLargest(layout, blend);
      (void)kernels::BlendRotations(rotations, &blend.rotations[0].x);
    }
    const double yaw_rad =
        layout.RootOf(blend.row).yaw_rad + movement.steer_rad * (1.0 - place.steered);
    angles_rad[2 * i] = movement.base.heading_rad;
    angles_rad[2 * i + 1] = 0.5 * (movement.base.heading_rad + yaw_rad);
  }
  kernels::SinCos(angles_rad.data(), 2 * blends.size(), sines.data(), cosines.data());
  for (std::size_t i = 0; i < blends.size(); ++i) {
    const BlendedRow& blend = blends[i];
    const Movement& movement = *blend.movement;
    const Place& place = *blend.place;
    const double sine = sines[2 * i];
    const double cosine = cosines[2 * i];
    const DVec3 local = layout.RootOf(blend.row).position_m;
    Vec3& out = *blend.root_m;
    out = Vec3(movement.base.position_m + DVec3(cosine * local.x + sine * local.z, local.y,
                                                cosine * local.z - sine * local.x));
    blend.rotations[0] = Quat(static_cast<float>(cosines[2 * i + 1]), 0.0f,
                              static_cast<float>(sines[2 * i + 1]), 0.0f) *
                         blend.rotations[0];
    if (!place.is_eased) continue;
    out += place.fraction * movement.difference.root_position_m;
    if (movement.is_inertial) out += place.slope_s * movement.difference_velocity.root_m_s;
  }
}

// Room for a blended row, and for what BlendRotations reads beyond it.
using RowScratch = std::array<float, kernels::kMaxRowFloats + kBlock>;

void FinishAlone(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                 const Place& place, RowScratch& row, PoseSpan out) {
  const BlendedRow blend = {
      &group, &movement, &place, row.data(), &out.root_position_m, out.rotations.data()};
  FinishPoses(layout, std::span(&blend, 1));
}

void EvaluateAlone(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                   const Place& place, GridCache& cache, PoseSpan out) {
  RowScratch row;
  BlendRow(group, layout, movement, place, cache, row.data());
  FinishAlone(group, layout, movement, place, row, out);
}

// What PlaceFinder finds, of one pose.
Place PlaceAt(const MotionGroup& group, const Movement& movement, double time_s) {
  const CellWeights cell =
      CellWeightsAt(movement.warp.GridPosition(time_s), group.grid_point_count);
  const double eased = (time_s - movement.entered_s) / movement.ease_out_s;
  return {.first_point = cell.first,
          .weights = cell.weights,
          .fraction = static_cast<float>(EaseOut(eased)),
          .slope_s = static_cast<float>(movement.ease_out_s * EaseOutSlope(eased)),
          .steered = EaseOut(time_s / movement.warp.duration_s()),
          .is_eased = eased < 1.0};
}

}  // namespace

void EvaluateGridPoint(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                       int point, GridCache& cache, PoseSpan out) {
  const Place place = {.first_point = point,
                       .weights = {1.0f, 0.0f, 0.0f, 0.0f},
                       .fraction = 0.0f,
                       .slope_s = 0.0f,
                       .steered = 1.0,
                       .is_eased = false};
  RowScratch row;
  std::ranges::copy(cache.Row(group, movement.weights, point), row.begin());
  FinishAlone(group, layout, movement, place, row, out);
}

void EvaluateBlend(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                   double time_s, GridCache& cache, PoseSpan out) {
  Place place = PlaceAt(group, movement, time_s);
  place.is_eased = false;
  EvaluateAlone(group, layout, movement, place, cache, out);
}

void EvaluateMovement(const MotionGroup& group, const GridLayout& layout, const Movement& movement,
                      double time_s, GridCache& cache, PoseSpan out) {
  EvaluateAlone(group, layout, movement, PlaceAt(group, movement, time_s), cache, out);
}

namespace {

// Where what is read of a job lies, which Prefetch reads.
void PrefetchPlaces(const PoseJob& job) {
  const Movement& movement = *job.movement;
  PrefetchBytes(&movement, offsetof(Movement, warp) + 2 * kCacheLineBytes);
  PrefetchBytes(&movement.feet, offsetof(FootPlan, packed));
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
  PlaceFinder finder;
  std::array<Place, kBlock> places;
  std::array<BlendedRow, kBlock> blends;
  std::array<RowScratch, kBlock> rows;
  std::array<kernels::PlantJob, kBlock> plants;
  for (std::size_t i = 0; i < std::min(kBlock, jobs.size()); ++i) PrefetchPlaces(jobs[i]);
  for (std::size_t i = 0; i < std::min(kAhead, jobs.size()); ++i) Prefetch(jobs[i]);
  while (!jobs.empty()) {
    const std::span<const PoseJob> block = jobs.first(std::min(jobs.size(), kBlock));
    for (std::size_t i = 0; i < block.size(); ++i) {
      finder.Set(i, library.group(block[i].movement->group), *block[i].movement, block[i].time_s);
    }
    finder.Find(block.size(), places.data());
    for (std::size_t i = 0; i < block.size(); ++i) {
      const PoseJob& job = block[i];
      if (i + kBlock < jobs.size()) PrefetchPlaces(jobs[i + kBlock]);
      if (i + kAhead < jobs.size()) Prefetch(jobs[i + kAhead]);
      const MotionGroup& group = library.group(job.movement->group);
      BlendRow(group, layout, *job.movement, places[i], *job.cache, rows[i].data());
      blends[i] = {&group,
                   job.movement,
                   &places[i],
                   rows[i].data(),
                   &job.shown->root_position_m,
                   job.shown->rotations.data()};
    }
    FinishPoses(layout, std::span(blends).first(block.size()));
    std::size_t planted = 0;
    for (const PoseJob& job : block) {
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
    for (const PoseJob& job : block) {
      if (job.movement->feet.is_active) {
        Unsettle(library.leg_rig(), *job.movement, job.time_s, *job.shown);
      }
    }
    jobs = jobs.subspan(block.size());
  }
}

}  // namespace stridewire
