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

// Colours that stay apart without colour vision (Okabe, Ito); sides differ in width as well.
inline constexpr const char* kLeftColour = "#d55e00";
inline constexpr const char* kRightColour = "#0072b2";
inline constexpr const char* kMiddleColour = "#555555";

// A skeleton drawn as lines.
class StickFigure {
 public:
  explicit StickFigure(const MotionLibrary& library);

  // World positions of all joints, then of the end sites.
  [[nodiscard]] std::vector<Vec3> Place(ConstPoseSpan pose) const;

  // Adds the lines of a pose moved on by `shift_m`, seen from its right side (ahead is right) or
  // from the front (its left is right).
  void Draw(ConstPoseSpan pose, double shift_m, bool from_front = false);

  // gnuplot data blocks $left, $right and $middle with all that was drawn, and what plots them.
  [[nodiscard]] std::string Blocks() const;
  static const char* PlotCommand();

 private:
  const Skeleton& skeleton_;
  std::vector<int> sides_;  // of joints and end sites: 0 left, 1 right, 2 middle
  std::array<std::string, 3> lines_;
};

// One movement of a group, without any before it.
class MovementPlayer {
 public:
  MovementPlayer(const MotionLibrary& library, int group_index);

  // With exactly these parameters if the run-time correction reaches them.
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
