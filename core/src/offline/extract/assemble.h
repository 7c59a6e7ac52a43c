#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "offline/extract/extract.h"
#include "stridewire/base/error.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

struct AssembleOptions {
  bool steps = true;
  bool jumps = true;
  bool mirror = false;  ///< True: also add the mirror image of every step, for the other foot.
  bool unsettled_jumps = true;  ///< True: keep jumps after which the figure continues to move.
  /// A group gets a parameter only if its examples cover at least this range. With four or more
  /// examples, the lowest and the highest value are ignored, because they may be outliers. For
  /// heights, no value is ignored, and the range always includes 0.
  double spread_min_m = 0.05;
  double spread_min_rad = 0.0873;  ///< The same for parameters that are angles; 5 degrees.
  ExtractOptions extract;          ///< Options of the extraction. The assembler sets `target`.
};

/// Combines the examples of several captures into a RawLibrary with these groups:
///
///   straight step_left, step_right: straight level steps with start_z and end_z
///   level step_left, step_right: all steps on level ground with start_z and end_z, and with those
///     other x, z and turn parameters that vary
///   general step_left, step_right: all steps, if some are not level, with start_z and end_z, and
///     with those other parameters of a general step that vary
///   jump: length, and height and turn if they vary
///
/// A group has at most one parameter per three examples. However, start_z, end_z, length and
/// heights that vary are always parameters, even if they exceed that number. If there are too few
/// examples even for the heights, the general group is omitted, and only jumps to one height are
/// kept. Otherwise, blends of climbing and level examples would sink into level ground. A group
/// without the turn parameter contains no steps with sharp turns, unless all its steps have them.
///
/// A group without examples of its own is omitted. Straight or level groups with fewer than three
/// steps cannot span an area of parameters. They are omitted if another group contains their steps.
///
/// The first usable capture determines the skeleton. Captures with other bone lengths are
/// retargeted. Captures with another joint tree are rejected; `Extraction::error` names the
/// differing joints. The floors of recordings differ by centimetres. Each capture is therefore
/// shifted so that balls rest at the same height in the whole library.
class LibraryAssembler {
 public:
  explicit LibraryAssembler(AssembleOptions options = {});

  /// Extracts the movements of a capture. The reference is valid until the next call of Add.
  const Extraction& Add(const Capture& capture);

  /// Appends notes to the result of a capture. `file` is the index of the capture in the order of
  /// Add.
  void AddNotes(std::size_t file, std::span<const std::string> notes);

  /// The results in the order of Add.
  [[nodiscard]] std::span<const Extraction> files() const { return files_; }

  /// Fails with kNotFound if no capture contains a usable movement of the requested kinds, or if
  /// there are only climbing steps, but too few for a group. Fails with kUnsupported if
  /// `AssembleOptions::mirror` is set but left joints cannot be paired with right ones.
  [[nodiscard]] Expected<RawLibrary> Assemble() const;

 private:
  AssembleOptions options_;
  Skeleton skeleton_;          // Skeleton of the first usable capture.
  std::string skeleton_path_;  // Path of that capture.
  std::vector<Extraction> files_;
};

/// Returns true if two skeletons have joints with the same names and parents, in the same order.
[[nodiscard]] bool SameJointTree(const Skeleton& a, const Skeleton& b);

/// Describes the first difference between the joints of `first` and `other`. The text calls `first`
/// by the name `first_name`. Example: "its joint 3 is Neck where a.bvh has Head".
[[nodiscard]] std::string TreeDifference(const Skeleton& first, const std::string& first_name,
                                         const Skeleton& other);

}  // namespace stridewire
