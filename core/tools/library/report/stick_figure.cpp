#include "stick_figure.h"

#include <cmath>

#include "gnuplot.h"
#include "offline/build/parameter_scales.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/weights/correction.h"

namespace stridewire {
namespace {

// Sides are determined by positions, not by names: in the stand pose, a left or right joint is at
// least this far to that side of the root.
constexpr float kSideMinM = 0.04f;

}  // namespace

StickFigure::StickFigure(const MotionLibrary& library) : skeleton_(library.skeleton()) {
  for (const Vec3& position : Place(library.stand_pose())) {
    const float side_m = position.x - library.stand_pose().root_position_m.x;
    sides_.push_back(side_m > kSideMinM ? 0 : side_m < -kSideMinM ? 1 : 2);
  }
}

std::vector<Vec3> StickFigure::Place(ConstPoseSpan pose) const {
  const auto joints = static_cast<std::size_t>(skeleton_.joint_count());
  std::vector<Vec3> positions(joints);
  std::vector<Quat> rotations(joints);
  ForwardKinematics(skeleton_, pose, positions, rotations);
  for (const EndSite& site : skeleton_.end_sites) {
    const auto joint = static_cast<std::size_t>(site.joint);
    positions.push_back(positions[joint] + rotations[joint] * site.offset_m);
  }
  return positions;
}

void StickFigure::Draw(ConstPoseSpan pose, double shift_m, bool from_front) {
  const int across = from_front ? 0 : 2;
  const std::vector<Vec3> positions = Place(pose);
  const auto joints = static_cast<std::size_t>(skeleton_.joint_count());
  for (std::size_t i = 1; i < positions.size(); ++i) {
    const auto parent = static_cast<std::size_t>(
        i < joints ? skeleton_.joints[i].parent : skeleton_.end_sites[i - joints].joint);
    const double dx = positions[i][across] - positions[parent][across];
    const double dy = positions[i].y - positions[parent].y;
    if (std::hypot(dx, dy) < 0.002) continue;
    std::string& lines = lines_[static_cast<std::size_t>(sides_[i])];
    for (const Vec3& end : {positions[parent], positions[i]}) {
      // Millimetres are precise enough for a figure.
      lines += Number(std::round(1000.0 * (end[across] + shift_m)) / 1000.0) + " " +
               Number(std::round(1000.0 * end.y) / 1000.0) + "\n";
    }
    lines += "\n";
  }
}

std::string StickFigure::Blocks() const {
  return "$left << EOD\n" + lines_[0] + "EOD\n$right << EOD\n" + lines_[1] +
         "EOD\n$middle << EOD\n" + lines_[2] + "EOD\n";
}

const char* StickFigure::PlotCommand() {
  return "$right w l lc rgb '#0072b2' lw 1, $middle w l lc rgb '#555555' lw 1, "
         "$left w l lc rgb '#d55e00' lw 2";
}

MovementPlayer::MovementPlayer(const MotionLibrary& library, int group_index)
    : library_(library),
      group_index_(group_index),
      scratch_(library),
      cache_(library.layout()),
      pose_(library.skeleton().joint_count()) {}

void MovementPlayer::Start(std::span<const double> parameters, bool corrected) {
  const MotionGroup& group = library_.group(group_index_);
  if (corrected) {
    CorrectWeights(group, ValuesOf(parameters), DefaultCorrectionLimits(group), scratch_,
                   movement_);
    movement_.group = group_index_;
  } else {
    SetWeights(group, group_index_, parameters, scratch_.weights(group), movement_);
  }
  StartWeighted(group, {}, movement_);
  cache_.Clear();
}

ConstPoseSpan MovementPlayer::At(double time_s) {
  EvaluateBlend(library_.group(group_index_), library_.layout(), movement_, time_s, cache_, pose_);
  return pose_;
}

}  // namespace stridewire
