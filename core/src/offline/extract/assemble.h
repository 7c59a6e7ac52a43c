#pragma once

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
  bool mirror = false;          ///< Add every step mirrored to the other foot's groups.
  bool unsettled_jumps = true;  ///< Keep jumps that end in motion.
  /// A parameter belongs to a group if its examples spread over it by this, the most extreme example
  /// on either side not counted (from four examples on): what one example spans is an outlier.
  double spread_min_m = 0.05;
  double spread_min_rad = 0.0873;  // 5 degrees
  ExtractOptions extract;          ///< `target` is set by the assembler.
};

/// Puts the examples of captures together, ready for the LibraryBuilder:
///
///   straight step_left, step_right   start_z, end_z                 straight level steps
///   level step_left, step_right      those of x, z, turn spanned    all steps on level ground
///   general step_left, step_right    those of all seven spanned     all steps; if some are not level
///   jump                             length, and what is spanned
///
/// A group that would hold nothing another does not hold is left out, and so are fewer than three straight or
/// level steps, which span no area, where another group has them. The first capture gives the
/// skeleton; those with other bone lengths are fitted to it, those with another joint tree are left
/// out and say so in `Extraction::error`, which names both captures' joints. Recordings differ by centimetres in where their floor
/// is: each is shifted so that balls rest at the same height all over the library.
class LibraryAssembler {
 public:
  explicit LibraryAssembler(AssembleOptions options = {});

  /// Extracts a capture's movements. The reference is valid until the next Add.
  const Extraction& Add(const Capture& capture);

  /// In the order of Add.
  [[nodiscard]] std::span<const Extraction> files() const { return files_; }

  /// kNotFound: no usable movement of the kinds asked for in any capture.
  [[nodiscard]] Expected<RawLibrary> Assemble() const;

 private:
  AssembleOptions options_;
  Skeleton skeleton_;          // of the first usable capture
  std::string skeleton_path_;  // that capture's
  std::vector<Extraction> files_;
};

/// Whether two skeletons have the same joints (names and parents, in order).
[[nodiscard]] bool SameJointTree(const Skeleton& a, const Skeleton& b);

/// How `other` departs from `first`, which is what `first_name` has, as a sentence: "its joint 3 is …".
[[nodiscard]] std::string TreeDifference(const Skeleton& first, const std::string& first_name,
                                         const Skeleton& other);

}  // namespace stridewire
