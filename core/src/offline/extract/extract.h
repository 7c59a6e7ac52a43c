#pragma once

#include <optional>
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
  /// Straight steps: the stride heading turns by no more than this,
  double straight_turn_max_rad = 0.0698;  // 4 degrees
  /// the root goes where the heading points within this (else a side or backward step),
  double straight_drift_max_rad = 0.262;  // 15 degrees
  /// the ground under the feet differs by no more than this,
  double level_rise_max_m = 0.05;
  /// and the moving foot stays on its own side within this of the fixed one.
  double straight_side_max_m = 0.35;
  /// From this distance on the direction of the root tells the heading better than the pelvis.
  double displacement_heading_min_m = 0.2;
  /// Skeleton the examples are for; must have the same joint tree. Null: the capture's own. Bones of
  /// other lengths: contacts and segments are found on the capture's own figure, then the root path
  /// is scaled by the ratio of leg lengths and everything is measured again.
  const Skeleton* target = nullptr;
};

/// A usable movement of a capture, normalised, with every parameter its kind can have.
struct ExtractedExample {
  MovementKind kind = MovementKind::kStepLeft;
  RawExample example;
  bool settled = true;  ///< Jumps: comes to rest at its end.
  bool level = true;    ///< Steps: the ground below all three footholds is one (within 5 cm).
};

/// A stretch of a capture that was left out, seconds from its first frame.
struct RejectedTime {
  double from_s = 0.0;
  double to_s = 0.0;
  std::string reason;
};

/// What a capture holds.
struct Extraction {
  std::string path;
  int frames = 0;
  double fps = 0.0;
  double unit_m = 1.0;
  int steps_left = 0;
  int steps_right = 0;
  int jumps = 0;
  std::vector<RejectedTime> rejected;
  std::vector<std::string> notes;  ///< The reader's, and joint flips mended
  std::string error;               ///< Not empty: the file as a whole could not be used.

  Skeleton skeleton;                             ///< Of the examples
  std::vector<ExtractedExample> straight_steps;  ///< start_z, end_z; heading change 0
  std::vector<ExtractedExample> general_steps;   ///< The seven of a general step; straight ones too
  std::vector<ExtractedExample> jump_examples;   ///< length, height, turn
  double ball_height_m[2] = {0.0, 0.0};  ///< Of resting balls above the floor y = 0 (by foot)
  bool has_contacts = false;             ///< Whether a foot ever stood: else the above is 0.

  struct Stand {
    Pose pose;            ///< x = z = 0, heading 0, y above the ground
    double unrest = 0.0;  ///< How far from quiet, upright standing; smaller is better
  };
  std::optional<Stand> stand;  ///< Stillest moment with both feet on the same ground
};

inline constexpr ParameterName kGeneralStepParameters[] = {
    ParameterName::kStartX, ParameterName::kStartY, ParameterName::kStartZ, ParameterName::kEndX,
    ParameterName::kEndY,   ParameterName::kEndZ,   ParameterName::kTurn};
inline constexpr ParameterName kStraightStepParameters[] = {ParameterName::kStartZ,
                                                            ParameterName::kEndZ};
inline constexpr ParameterName kJumpParameters[] = {ParameterName::kLength, ParameterName::kHeight,
                                                    ParameterName::kTurn};

/// Finds the steps and standing jumps of a capture and cuts them out as normalised examples.
///
/// A step keeps the capture's frame rate, has keytimes start, toe-off, heel-strike, end, and starts
/// in the stride heading at its start; its y is measured from the ground under the fixed foot. A
/// jump has keytimes start, lowest point, toe-off, landing, lowest point, end. Parameters are
/// measured at the balls in the first and last pose (paper, Section 6). Straight steps and jumps
/// have one heading from start to end, so that a row of them does not veer.
/// Never fails: what is unusable is in `rejected`, a whole unusable capture in `error`.
[[nodiscard]] Extraction Extract(const Capture& capture, const ExtractOptions& options = {});

}  // namespace stridewire
