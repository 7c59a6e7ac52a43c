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

/// A direction along one of the file's own axes.
enum class BvhAxis : std::uint8_t { kPlusX, kMinusX, kPlusY, kMinusY, kPlusZ, kMinusZ };

/// Source of the up axis of a capture. kGuess: the figure stands neither in the rest pose nor in
/// the motion, so the up axis may be wrong.
enum class UpSource : std::uint8_t { kOption, kRestPose, kMotion, kGuess };

/// A complete recording that was read from a file and converted to the conventions of base/math.h:
/// metres, +Y up, facing +Z at identity rotations.
struct Capture {
  std::string path;   ///< Path of the file, as passed by the caller.
  Skeleton skeleton;  ///< Skeleton in which the reader has identified both legs.
  Clip clip;
  double unit_m = 1.0;  ///< Length of one file unit in metres, detected or given.
  /// False: none of the usual units, such as the centimetre, gives legs of plausible length. The
  /// reader has therefore estimated `unit_m` from the length of the legs.
  bool unit_is_common = true;
  BvhAxis up = BvhAxis::kPlusY;  ///< The up axis of the file, detected or given.
  UpSource up_source = UpSource::kOption;
  int first_frame = 0;  ///< Number of frames at the start that contain an artificial rest pose.
  std::vector<std::string> notes;  ///< Assumptions and repairs of the reader, one sentence each.
};

/// Limits on a BVH file. A file that exceeds kMaxBvhNumber is rejected with kOutOfRange. A file
/// that exceeds one of the other limits, or has more than kMaxJoints joints, is rejected with
/// kLimitExceeded. Memory use depends on the data in the file, not on the counts that its header
/// declares.
inline constexpr std::uint64_t kMaxBvhBytes = std::uint64_t{512} << 20;
inline constexpr int kMaxBvhDepth = 128;  ///< Maximum depth of nested joints.
/// Maximum number of frames times joints.
inline constexpr std::int64_t kMaxBvhRotations = std::int64_t{1} << 25;
/// Maximum magnitude of any number in the file, except the number of frames in its header.
inline constexpr double kMaxBvhNumber = 1e7;

/// Maximum length of the name of a joint, in bytes.
inline constexpr std::size_t kMaxBvhNameBytes = 256;

/// Overrides for properties that the reader otherwise detects.
struct BvhReadOptions {
  std::optional<double> unit_m;  ///< Length of one file unit in metres, in (0, 1000].
  std::optional<BvhAxis> up;     ///< The up axis of the file.
  std::optional<double> fps;     ///< Replaces `Frame Time`; frames per second, in (0, 10000].
  /// Name of the left ankle joint; empty: detected. Set both ankles or neither.
  std::string left_ankle;
  std::string right_ankle;  ///< Name of the right ankle joint; empty: detected.
  /// Name of a toe joint below the left ankle; empty: detected.
  std::string left_ball;
  std::string right_ball;  ///< Name of a toe joint below the right ankle; empty: detected.
};

/// Reads a BVH file and converts it to Stridewire's conventions: metres, +Y up, facing +Z at
/// identity rotations, and translation on the root only. `Capture::notes` lists every assumption
/// and repair.
///
/// - The file may mix LF, CRLF and CR line ends. Blank lines, tabs, the letter case of keywords and
///   channels, the order of channels and a missing final line end do not matter. The name of a
///   joint is the rest of its line. Duplicate names get a number appended. Comments that begin with
///   # or // are skipped. Scale channels are ignored.
/// - A frame may continue on further lines, but must end at the end of a line. A frame with too few
///   or too many numbers is an error, except that a truncated last frame is left out. If the number
///   of frames differs from `Frames`, the reader keeps the complete frames, at most `Frames` of
///   them unless that is 0, and adds a note.
/// - Numbers may have decimal commas if no number has a decimal point.
/// - The figure is the first ROOT whose joint names identify two legs or, if there is none, the
///   first ROOT that has legs. Its root is the lowest joint above both legs and the rest of the
///   body, or a lower joint if necessary: all joints between the root and the legs must keep their
///   offsets. The root contains the motion of all joints above it. Parts of the body that branch
///   off above the root are attached to it. Other branches there, such as cameras, are left out.
/// - Position channels of the root replace its OFFSET. For any other joint, the mean of the
///   position channels becomes the offset, unless all of them are zero. A note states the largest
///   deviation from the mean. If a joint of the legs, the trunk or the arms is ever more than 2 cm
///   from its mean position, the file is rejected.
/// - If `Frame Time` agrees with a whole number of frames per second within the precision of its
///   digits, the reader uses that number.
/// - The reader detects legs by joint names that contain the side and the part of the leg. If that
///   fails, it looks for two chains of equal length that start at the same joint and end below the
///   rest of the body. It takes the pair nearest to the root; of several such pairs, the longest. A
///   joint that never bends the leg, such as a twist joint, is part of the thigh or the shin and
///   does not count as the knee. A figure without two legs, or with more than two, is rejected. If
///   there is no toe joint, the ball of the foot is a fixed point in the frame of the ankle. This
///   point is the End Site of the foot if the End Site is within 0.2 leg lengths of the ankle.
///   Otherwise its horizontal distance from the ankle is 2/3 of that of the End Site, and it is as
///   high as the End Site when the sole is flat.
/// - If the figure stands in the rest pose, this pose determines the up axis. If it does not, or if
///   it clearly stands along another axis in the motion, the up axis is the axis nearest to the
///   mean direction from ankles to hips over the motion. If the motion is inconclusive as well, or
///   if the figure lies on the floor, the up axis is a guess (UpSource::kGuess). A rest pose that
///   stands is turned to face +Z. Otherwise the frames of the joints keep their axes, except for
///   the change of the up axis.
/// - The unit is the common unit (m, ft, dm, 1/0.45 inch, inch, cm or mm) for which the legs are
///   0.68 to 1.0 m long. If no unit fits, the motion is scaled so that standing hips are at 0.95 m.
/// - `Capture::first_frame` skips an artificial rest pose at the start. The reader assumes such a
///   pose if at least four joints rotate by more than 10 degrees between frames 0 and 1, and by
///   more than 8 times as much as between frames 1 and 2. It also assumes one if the root is
///   rotated in frame 1 but not in frame 0, and at least four joints rotate at more than 600
///   degrees/s between these frames. Besides frame 0, it skips frames while at least two joints
///   rotate at more than 600 degrees/s, up to 0.1 s in total.
/// - If `Frame Time` implies accelerations of the feet that are too low for a person, the reader
///   adds a note; use `fps` to override `Frame Time`. A file without `Frame Time` needs `fps`.
///
/// Errors: kNotFound or kIo if the file cannot be read. kMalformed, kOutOfRange, kLimitExceeded or
/// kUnsupported for its contents, with "file:line" in `where`, or the file name alone if the error
/// belongs to no line. kInvalidArgument or kNotFound for an option, with its name in `where`.
[[nodiscard]] Expected<Capture> ReadBvh(const std::filesystem::path& path,
                                        const BvhReadOptions& options = {});

/// Same as ReadBvh, for text in memory. `name` replaces the path in errors and in Capture::path.
[[nodiscard]] Expected<Capture> ParseBvh(std::string_view text, std::string_view name,
                                         const BvhReadOptions& options = {});

}  // namespace stridewire
