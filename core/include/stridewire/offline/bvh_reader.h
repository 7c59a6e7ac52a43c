#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// A whole recording as read from a file, converted to the conventions of base/math.h: metres, +Y up,
/// facing +Z at identity rotations.
struct Capture {
  std::string path;   ///< As the caller gave it.
  Skeleton skeleton;  ///< With both legs identified.
  Clip clip;
  double unit_m = 1.0;  ///< Length of one file unit in metres, detected or given.
  int first_frame = 0;  ///< Number of frames at the start that hold an artificial rest pose.
  std::vector<std::string> notes;  ///< What the reader assumed or repaired, one sentence each.
};

/// Limits on a BVH file; beyond one of them reading ends with kLimitExceeded. Joints are limited by
/// kMaxJoints. Memory follows what the file really holds, never what it announces.
inline constexpr std::uint64_t kMaxBvhBytes = std::uint64_t{512} << 20;
inline constexpr int kMaxBvhDepth = 128;  ///< Joints nested in each other.
inline constexpr std::int64_t kMaxBvhRotations = std::int64_t{1} << 25;  ///< Frames times joints.
inline constexpr double kMaxBvhNumber = 1e7;  ///< Largest magnitude of any number in the file.

inline constexpr std::size_t kMaxBvhNameBytes = 256;  ///< A joint's name.

enum class BvhAxis : std::uint8_t { kPlusX, kMinusX, kPlusY, kMinusY, kPlusZ, kMinusZ };

/// What the reader would otherwise find out by itself.
struct BvhReadOptions {
  std::optional<double> unit_m;  ///< Length of one file unit, in (0, 1000].
  std::optional<BvhAxis> up;     ///< Which way is up, in the file's axes.
  std::optional<double> fps;     ///< Instead of `Frame Time`, in (0, 10000].
  std::string left_ankle;        ///< Joint names; empty: found. Give both ankles or none.
  std::string right_ankle;
  std::string left_ball;  ///< Toe joints below those ankles; empty: found.
  std::string right_ball;
};

/// Reads a BVH file into our conventions: metres, +Y up, facing +Z at identity rotations, only the
/// root moving. What was assumed or mended is told in `Capture::notes`.
///
/// - Line ends (LF, CRLF, CR) may mix; blank lines, tabs, letter case of keywords and channels, any
///   channel order and a missing last line end do not matter. A joint's name is the rest of its
///   line; a name that stands twice gets a number.
/// - One line after `Frame Time` is one frame. A line with too few or too many numbers is an error;
///   fewer whole lines than `Frames` announces are read, more are left out, each with a note.
/// - Position channels of the root replace its OFFSET. Those of another joint give it their mean
///   as offset, and a note tells the largest deviation (all zero: the OFFSET stays).
/// - `Frame Time` is rounded to a whole number of frames a second where its digits allow it.
/// - Legs are found by names, then by shape: the longest two equal chains nearest to the root.
///   Without a toe joint the ball rides on the ankle: at the foot's End Site if that is nearer
///   than 0.2 leg lengths, else at 2/3 of the way there, at the End Site's height.
/// - Up is the way from ankles to hips, over the motion; the rest pose is turned to face +Z.
/// - The unit is the known one (m, ft, dm, 1/0.45 inch, inch, cm, mm) that makes legs 0.68 to
///   1.0 m long; if none does, the standing hips are put at 0.95 m.
/// - `first_frame` is past an artificial rest pose at the start: four joints or more jump from
///   frame 0 to 1 by over 10 degrees and 8 times what they do next, or rush (600 degrees a second)
///   from a frame whose root is not turned at all. It is left out as long as two joints rush, at
///   most 0.1 s.
/// - A `Frame Time` that makes the feet too slow for people gets a note; `fps` overrides it.
///
/// Errors: kNotFound, kIo; kMalformed, kOutOfRange, kLimitExceeded, kUnsupported with `where` =
/// "file:line", or the file alone when no line is to blame; kInvalidArgument or kNotFound with the
/// option's name in `where` for options.
[[nodiscard]] Expected<Capture> ReadBvh(const std::filesystem::path& path,
                                        const BvhReadOptions& options = {});

/// As above, from text in memory; `name` takes the path's place.
[[nodiscard]] Expected<Capture> ParseBvh(std::string_view text, std::string_view name,
                                         const BvhReadOptions& options = {});

}  // namespace stridewire
