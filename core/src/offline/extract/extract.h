#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "offline/extract/contacts.h"
#include "offline/extract/segment.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

struct ExtractOptions {
  ContactOptions contacts;
  SegmentOptions segments;
  // A step is straight if it leads forward and is within the following four limits.
  /// Limit on the change of the heading (StrideHeading); 4 degrees.
  double straight_turn_max_rad = 0.0698;
  /// Limit on the angle between the motion of the feet and the heading; 15 degrees. Steps with a
  /// larger angle lead sideways or backward.
  double straight_drift_max_rad = 0.262;
  /// Limit on the difference between the heights of the ground under the two feet.
  double level_rise_max_m = 0.05;
  /// Limit on the sideways distance from the fixed to the moving foot, positive towards the moving
  /// foot's side.
  double straight_side_max_m = 0.3;
  /// If the centre of the feet moves farther than this in a straight step or jump, the heading is
  /// the direction of that motion, which is more accurate than the direction of the pelvis.
  double displacement_heading_min_m = 0.3;
  /// True: the root of a figure that walks on the spot is moved so that its supporting foot stands
  /// still. False: such captures are rejected.
  bool derive_root_motion = false;
  /// Skeleton of the examples, with the same joint tree as the capture. If null, examples get the
  /// skeleton of the capture. If bone lengths differ, contacts and segments are still detected on
  /// the capture's own figure. The path of the root is then scaled by the ratio of leg lengths, and
  /// everything is measured again.
  const Skeleton* target = nullptr;
};

/// A usable movement of a capture, relative to its base frame, with all parameters of its kind.
struct ExtractedExample {
  MovementKind kind = MovementKind::kStepLeft;
  RawExample example;
  bool settled = true;  ///< Jumps: false if the figure is still moving at the end of the example.
  /// Steps: true if the heights of the ground at all three footholds are equal within 5 cm.
  bool level = true;
  /// [foot][0 before its swing, 1 after it]: height of the captured ground at each foothold, minus
  /// the expected height. The expected height is the same for all footholds of a level step, for
  /// both feet before a jump, and for both feet after it. In steps between different heights the
  /// difference is 0.
  std::array<std::array<double, 2>, 2> ground_m{};
};

/// A time span of a capture that is not usable, in seconds since its first frame.
struct RejectedTime {
  double from_s = 0.0;
  double to_s = 0.0;
  std::string reason;
};

/// All movements extracted from one capture.
struct Extraction {
  std::string path;
  int frames = 0;
  double fps = 0.0;
  double unit_m = 1.0;
  int steps_left = 0;
  int steps_right = 0;
  int jumps = 0;
  std::vector<RejectedTime> rejected;
  /// Notes of the BVH reader, and notes of the extraction, for example on repaired joint flips,
  /// smoothed joints and excluded frames.
  std::vector<std::string> notes;
  /// If the capture contains no step and no jump: the reason, and what the user can do about it.
  /// Empty if `rejected` already contains the reasons.
  std::string no_movement_reason;
  std::string error;  ///< Why the whole capture is unusable. Empty if it is usable.

  Skeleton skeleton;  ///< Skeleton of the examples.
  /// Straight steps with the parameters start_z and end_z. Their heading change is 0.
  std::vector<ExtractedExample> straight_steps;
  /// All steps, with the seven parameters of a general step.
  std::vector<ExtractedExample> general_steps;
  /// Jumps, with the parameters length, height and turn.
  std::vector<ExtractedExample> jump_examples;
  double ball_height_m[2] = {0.0, 0.0};  ///< [foot]: height of the resting ball above the floor.
  /// True if a foot ever stands on the ground. Otherwise, the heights are 0.
  bool has_contacts = false;

  struct Stand {
    /// Standing pose. The root is at x = z = 0 with heading 0, and y is its height above the
    /// ground.
    Pose pose;
    /// Deviation from standing still and upright: the mean speed of the joints in m/s, plus
    /// penalties for feet that are tilted or not side by side, for crouching and for leaning.
    double unrest = 0.0;
    double tilt_m = 0.0;  ///< See RawLibrary::stand_tilt_m.
  };
  /// The moment closest to standing still and upright, with both feet at the same height.
  std::optional<Stand> stand;
};

inline constexpr ParameterName kGeneralStepParameters[] = {
    ParameterName::kStartX, ParameterName::kStartY, ParameterName::kStartZ, ParameterName::kEndX,
    ParameterName::kEndY,   ParameterName::kEndZ,   ParameterName::kTurn};
inline constexpr ParameterName kStraightStepParameters[] = {ParameterName::kStartZ,
                                                            ParameterName::kEndZ};
inline constexpr ParameterName kJumpParameters[] = {ParameterName::kLength, ParameterName::kHeight,
                                                    ParameterName::kTurn};

/// Measures the parameters `names` of a step in the first and last frame of its clip.
void MeasureStepParameters(const Skeleton& skeleton, std::span<const ParameterName> names,
                           Foot moving, RawExample& step);

/// Finds the steps and standing jumps of a capture and cuts them out as examples, each relative to
/// the base frame in which it starts.
///
/// Examples keep the frame rate of the capture. Parameters are measured at the balls in the first
/// and last pose (paper, Section 6).
///
/// - The keytimes of steps are start, toe-off, heel-strike and end. General steps start in the
///   stride heading of their first frame. Heights are relative to the ground under the fixed foot.
/// - The keytimes of jumps are start, lowest point, toe-off, landing, lowest point and end. Heights
///   are relative to the mean height of the ground under both feet at the start.
/// - Straight steps, and jumps that turn by at most 20 degrees, keep one heading from start to end,
///   so that sequences of them do not veer.
///
/// Never fails. `rejected` lists unusable time spans, and `error` is set if the capture is
/// unusable. If nothing is found, `rejected` or `no_movement_reason` contains the reason.
[[nodiscard]] Extraction Extract(const Capture& capture, const ExtractOptions& options = {});

}  // namespace stridewire
