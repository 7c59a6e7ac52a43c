#include "offline/build/grid_cells.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "offline/build/grid_example.h"
#include "runtime/library/keytimes.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"

namespace stridewire {
namespace {

constexpr int kMinCells = 2;
// Limit per interval. The grid has room for kMaxIntervals times this number.
constexpr int kMaxCells = 400;
constexpr double kGrowth = 1.15;
constexpr int kMaxRounds = 20;
// Values that differ by less count as equal. The duration of an interval is often exactly a whole
// number of cells plus one half, and rounding errors must not decide which way it is rounded.
constexpr double kTie = 1e-5;
constexpr int kSamples = 24;  // Number of samples per interval and example.
static_assert(kMaxCells * kMaxIntervals < MotionLibrary::kMaxGridPoints);

int CellsIn(double length_s, double fps) {
  const double exact = std::clamp(length_s * fps, double{kMinCells}, double{kMaxCells});
  return static_cast<int>(std::ceil(exact - 0.5 - kTie));
}

// Returns the error of the stored example for each interval: the mean over joints and time, in
// radians.
std::vector<double> StoredErrors(const RawExample& example, const std::vector<int>& cells,
                                 const GridLayout& layout, const Quat& stand_root) {
  const GridExample stored = ResampleOnGrid(example, cells, layout, stand_root);
  // A group with only this example, so that the error is that of the code that plays examples.
  MotionGroup alone;
  alone.example_count = 1;
  alone.cells = cells;
  alone.grid = stored.rows;
  alone.grid_point_count =
      static_cast<int>(stored.rows.size() / static_cast<std::size_t>(layout.row_floats));
  Movement movement;
  movement.weights = {1.0f};
  movement.warp = TimeWarp(example.keytimes_s, cells);
  GridCache cache(layout);
  Pose played(example.clip.joint_count);
  Pose captured(example.clip.joint_count);
  std::vector<double> errors(cells.size(), 0.0);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const double from_s = example.keytimes_s[i];
    const double length_s = example.keytimes_s[i + 1] - from_s;
    for (int s = 0; s < kSamples; ++s) {
      const double t = from_s + length_s * (s + 0.5) / kSamples;
      EvaluateBlend(alone, layout, movement, t, cache, played);
      SampleExample(example, t, captured);
      for (std::size_t j = 0; j < played.rotations.size(); ++j) {
        errors[i] += AngleBetween(played.rotations[j], captured.rotations[j]);
      }
    }
    errors[i] /= kSamples * example.clip.joint_count;
  }
  return errors;
}

}  // namespace

std::vector<int> CellsAtRate(const std::vector<std::vector<double>>& keytimes_s, double fps) {
  std::vector<int> cells;
  for (std::size_t i = 0; i + 1 < keytimes_s.front().size(); ++i) {
    double mean_s = 0.0;
    for (const std::vector<double>& keys : keytimes_s) {
      mean_s += (keys[i + 1] - keys[i]) / static_cast<double>(keytimes_s.size());
    }
    cells.push_back(CellsIn(mean_s, fps));
  }
  return cells;
}

std::vector<int> ChooseCells(const RawGroup& group, double fps, const GridLayout& layout,
                             const Quat& stand_root) {
  STRIDEWIRE_CHECK(!group.examples.empty());
  std::vector<std::vector<double>> keytimes_s;
  for (const RawExample& example : group.examples) keytimes_s.push_back(example.keytimes_s);
  std::vector<int> cells = CellsAtRate(keytimes_s, fps);
  // Generated steps are so smooth that they never need more cells.
  if (group.is_completed) return cells;
  double clip_fps = 0.0;
  for (const RawExample& example : group.examples) clip_fps = std::max(clip_fps, example.clip.fps);
  const std::size_t intervals = cells.size();
  std::vector<int> most(intervals);
  for (std::size_t i = 0; i < intervals; ++i) {
    double max_s = 0.0;
    for (const std::vector<double>& keys : keytimes_s) {
      max_s = std::max(max_s, keys[i + 1] - keys[i]);
    }
    most[i] = std::max(cells[i], CellsIn(max_s, clip_fps));
  }
  // Cells are added but never removed, so an example whose error is small is not measured again.
  std::vector<const RawExample*> rough;
  for (const RawExample& example : group.examples) rough.push_back(&example);
  for (int round = 0; round < kMaxRounds; ++round) {
    // If the mean error of an example is too large, adds cells to its intervals with an error above
    // that mean.
    std::vector<bool> grows(intervals, false);
    std::erase_if(rough, [&](const RawExample* example) {
      const std::vector<double> errors = StoredErrors(*example, cells, layout, stand_root);
      const std::vector<double>& keys = example->keytimes_s;
      double mean = 0.0;
      for (std::size_t i = 0; i < intervals; ++i) {
        mean += errors[i] * (keys[i + 1] - keys[i]) / keys.back();
      }
      if (mean <= kStoredErrorRad * (1.0 + kTie)) return true;
      for (std::size_t i = 0; i < intervals; ++i) {
        if (errors[i] >= mean * (1.0 - kTie)) grows[i] = true;
      }
      return false;
    });
    bool changed = false;
    for (std::size_t i = 0; i < intervals; ++i) {
      if (!grows[i] || cells[i] == most[i]) continue;
      cells[i] = std::min(most[i], static_cast<int>(std::ceil(kGrowth * cells[i])));
      changed = true;
    }
    if (!changed) break;
  }
  return cells;
}

}  // namespace stridewire
