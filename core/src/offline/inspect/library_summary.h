#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Number of examples of each origin. An averaged example counts once.
struct ExampleOrigins {
  int captured = 0;   ///< Cut from a capture.
  int mirrored = 0;   ///< Mirror image of a captured example.
  int generated = 0;  ///< Generated without a capture.
  int completed = 0;  ///< Generated because the captures lack such a movement.

  [[nodiscard]] int total() const { return captured + mirrored + generated + completed; }
};

/// Smallest and largest value. Both are 0 if there are no values.
struct ValueRange {
  double min = 0.0;
  double max = 0.0;
};

/// The examples of one class of movements, and the range that they cover.
struct Ability {
  ExampleOrigins origins;
  ValueRange range;  ///< Unit: see LibrarySummary.
  [[nodiscard]] bool is_available() const { return origins.total() > 0; }
};

/// Something that a library cannot do.
struct MissingAbility {
  std::string what;    ///< Missing movements, for example "turns to the right".
  std::string advice;  ///< Sentence that states which recording or option adds them.
};

/// Describes what avatars can do with a library.
///
/// The comment of a member states, after a semicolon, which quantity its Ability::range covers.
///
/// Steps are classified by the positions of the feet in the first and last pose of each example. An
/// example that is stored in several groups counts once. Pairs are indexed by Foot. The index is
/// the moving foot for starts, stops, strides, backward steps and height differences, and the
/// direction for turns and side steps.
struct LibrarySummary {
  using Sides = std::array<Ability, 2>;

  ExampleOrigins steps;  ///< All steps.
  Sides starts;          ///< Steps from feet together to feet apart; length in metres.
  /// Steps from feet apart to feet together; length of the previous stride in metres.
  Sides stops;
  Sides strides;             ///< Steps forward; distance between the feet at the end in metres.
  Sides turns;               ///< Steps that turn; degrees, always positive.
  Sides side_steps;          ///< Steps to the side; sideways movement of the foot in metres.
  Sides back_steps;          ///< Steps backward; distance between the feet at the end in metres.
  Sides climbs;              ///< Steps up; height of the moving foot above the fixed foot, metres.
  Sides descents;            ///< Steps down; depth of the moving foot below the fixed foot, metres.
  ValueRange speed_m_s;      ///< Speed of the body in `strides`.
  Ability jumps;             ///< Jumps; length in metres.
  ValueRange jump_up_m;      ///< Height of the landing above the start.
  ValueRange jump_turn_deg;  ///< Change of heading in jumps; positive is left.
  /// Distance between the feet in the stand pose, measured along the heading.
  double stand_stride_m = 0.0;
  std::vector<MissingAbility> missing;

  /// The feet are together if their distance along the heading is at most this.
  static constexpr double kTogetherM = 0.12;
  /// Returns true if the feet of the stand pose are together.
  [[nodiscard]] bool has_stand() const { return stand_stride_m <= kTogetherM; }
  [[nodiscard]] bool has_steps_of(Foot foot) const {
    return feet[static_cast<std::size_t>(foot)] > 0;
  }
  std::array<int, 2> feet{};  ///< [Foot]: number of steps in which this foot moves.
};

/// Summarizes a library. The time is proportional to the number of examples.
[[nodiscard]] LibrarySummary Summarize(const MotionLibrary& library);

/// Describes the abilities, with one sentence per class of movements. Does not describe `missing`.
[[nodiscard]] std::vector<std::string> DescribeSummary(const LibrarySummary& summary);

}  // namespace stridewire
