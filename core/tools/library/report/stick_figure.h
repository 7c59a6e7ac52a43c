#pragma once

#include <array>
#include <string>
#include <vector>

#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/weights/correction.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

// Colours that colour-blind readers can distinguish (Okabe, Ito). The sides also differ in width.
inline constexpr const char* kLeftColour = "#d55e00";
inline constexpr const char* kRightColour = "#0072b2";

// Draws the skeleton of a library as lines.
class StickFigure {
 public:
  explicit StickFigure(const MotionLibrary& library);

  // World positions of all joints, followed by the end sites.
  [[nodiscard]] std::vector<Vec3> Place(ConstPoseSpan pose) const;

  // Adds the lines of a pose, shifted by `shift_m`. The figure is seen from its right side (forward
  // is right), or from the front (its left is right).
  void Draw(ConstPoseSpan pose, double shift_m, bool from_front = false);

  // Returns the gnuplot data blocks $left, $right and $middle of all poses that were drawn.
  // PlotCommand returns the commands that plot them.
  [[nodiscard]] std::string Blocks() const;
  static const char* PlotCommand();

 private:
  const Skeleton& skeleton_;
  std::vector<int> sides_;  // Side of each joint and end site: 0 left, 1 right, 2 middle.
  std::array<std::string, 3> lines_;
};

// Evaluates single movements of a group.
class MovementPlayer {
 public:
  MovementPlayer(const MotionLibrary& library, int group_index);

  // Starts a movement with these parameters. If `corrected`, corrects its weights first.
  void Start(std::span<const double> parameters, bool corrected);

  [[nodiscard]] const Movement& movement() const { return movement_; }
  [[nodiscard]] ConstPoseSpan At(double time_s);

 private:
  const MotionLibrary& library_;
  int group_index_;
  CorrectionScratch scratch_;
  GridCache cache_;
  Pose pose_;
  Movement movement_;
};

}  // namespace stridewire
