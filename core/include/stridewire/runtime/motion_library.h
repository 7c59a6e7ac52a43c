#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/pose.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

struct LayerClip;
struct LegRig;
struct LocomotionProfile;
struct Transition;

enum class MovementKind : std::uint8_t {
  kStepLeft = 0,   ///< The left foot moves.
  kStepRight = 1,  ///< The right foot moves.
  kJump = 2,
  kStand = 3,  ///< Holding a pose; has no group.
};

[[nodiscard]] std::string_view MovementKindName(MovementKind kind);  ///< "step_left", …
[[nodiscard]] constexpr bool IsStep(MovementKind kind) { return kind <= MovementKind::kStepRight; }
[[nodiscard]] constexpr MovementKind StepKind(Foot foot) {
  return foot == Foot::kLeft ? MovementKind::kStepLeft : MovementKind::kStepRight;
}
[[nodiscard]] constexpr Foot MovingFoot(MovementKind step) {
  return step == MovementKind::kStepLeft ? Foot::kLeft : Foot::kRight;
}

/// Parameters a group may have. The first seven are a general step's, in this order (method,
/// Section 6): moving foot minus fixed foot at the start in the start's heading frame, the same at
/// the end in the end's heading frame, heading change. Feet are measured at the balls.
enum class ParameterName : std::uint8_t {
  kStartX = 0,
  kStartY = 1,
  kStartZ = 2,
  kEndX = 3,
  kEndY = 4,
  kEndZ = 5,
  kTurn = 6,
  kLength = 7,  ///< Jump: forward distance between the feet's centres before and after.
  kHeight = 8,  ///< Jump: height of the landing above the start.
};
inline constexpr int kParameterNameCount = 9;
inline constexpr int kMaxParameters = 7;

/// With its unit: "start_z_m", "turn_rad", "length_m".
[[nodiscard]] std::string_view ParameterText(ParameterName name);

struct Parameter {
  ParameterName name = ParameterName::kStartZ;
  double min = 0.0;
  double max = 0.0;
  double centre = 0.0;  ///< Subtracted before the linear part (Section 3: rank deficiency).
  double scale = 1.0;   ///< Parameters are divided by it before distances are taken; > 0.
};

/// Grid row: one example's pose at one grid point, as floats
///   [joint] x y z w,  root x y z, root yaw,  zeros up to a multiple of 16.
/// Joint 0's quaternion is the root rotation with its yaw taken off on the left (r = q_yaw * rest); the yaw is an
/// unwrapped scalar, so examples may differ by more than half a turn. Positions and yaw are relative to the base frame.
struct GridLayout {
  int joint_count = 0;
  int row_floats = 0;
  explicit constexpr GridLayout(int joints = 0)
      : joint_count(joints), row_floats((4 * (joints + 1) + 15) / 16 * 16) {}
  /// Of a row of an example it is unit; of a sum of rows it need not be.
  [[nodiscard]] static Quat RotationOf(const float* row, std::size_t joint) {
    const float* q = row + 4 * joint;
    return {q[3], q[0], q[1], q[2]};
  }
  static void SetRotation(float* row, std::size_t joint, const Quat& rotation) {
    float* q = row + 4 * joint;
    q[0] = rotation.x;
    q[1] = rotation.y;
    q[2] = rotation.z;
    q[3] = rotation.w;
  }
  struct Root {
    DVec3 position_m;
    double yaw_rad;
  };
  [[nodiscard]] Root RootOf(const float* row) const {
    const float* x = row + 4 * joint_count;
    return {DVec3(x[0], x[1], x[2]), x[3]};
  }
  void SetRoot(float* row, const Root& root) const {
    float* x = row + 4 * joint_count;
    x[0] = static_cast<float>(root.position_m.x);
    x[1] = static_cast<float>(root.position_m.y);
    x[2] = static_cast<float>(root.position_m.z);
    x[3] = static_cast<float>(root.yaw_rad);
  }
};

/// The longest row of a grid.
inline constexpr std::size_t kMaxRowFloats = GridLayout(kMaxJoints).row_floats;

/// Examples that can be blended with each other: one kind, one set of parameters, the same number
/// of keytimes, one grid. All spans point into the library's bytes.
///
/// Sites are the examples, then the pseudoexamples; everything about weights is in site order.
struct MotionGroup {
  MovementKind kind = MovementKind::kStepLeft;
  std::vector<Parameter> parameters;     ///< d of them
  int example_count = 0;                 ///< n
  int site_count = 0;                    ///< m >= n
  std::span<const double> sites;         ///< [site][parameter], in physical units
  std::span<const double> site_weights;  ///< [site - n][example]: rows D of the pseudoexamples
  std::span<const double> dilations;     ///< [site], scaled units
  double radius_factor = 1.0;            ///< Of the examples' dilations; refinement starts from it
  std::span<const double> linear;        ///< [1 + d][example]: a, row 0 the constant
  std::span<const double> radial;        ///< [site][example]: r
  std::span<const int> cells;            ///< [interval]: grid cells of each keytime interval
  int grid_point_count = 0;              ///< sum of cells + 1
  std::span<const double> keytimes_s;    ///< [example][interval + 1], K_0 = 0
  std::span<const double> heading_change_rad;  ///< [example]: stride heading at the end
  std::span<const float> grid;             ///< [grid point][example][row_floats], 64-byte aligned
  std::vector<std::string_view> sources;   ///< [example]: "16_21.bvh 0.93-1.47 s"
  std::span<const std::uint8_t> mirrored;  ///< [example]: 1 if made by mirroring

  [[nodiscard]] int parameter_count() const { return static_cast<int>(parameters.size()); }
  [[nodiscard]] int interval_count() const { return static_cast<int>(cells.size()); }
  /// Index of a parameter in this group, -1 if the group does not have it.
  [[nodiscard]] int FindParameter(ParameterName name) const;
  [[nodiscard]] std::span<const double> site(int s) const {
    return sites.subspan(static_cast<std::size_t>(s) * parameters.size(), parameters.size());
  }
};

/// An immutable library of examples: a view of verified bytes (a mapped `.swl` file or memory).
/// Shared between threads by `shared_ptr<const>`.
///
/// File: a 64-byte header (magic, version, payload size, XXH3-128 of the payload), then one
/// FlatBuffers table (`core/schema/motion_library.fbs`) whose float arrays are 64-byte aligned.
class MotionLibrary {
 public:
  static constexpr int kFormatVersion = 3;
  static constexpr std::size_t kMaxFileBytes = std::size_t{1} << 30;
  static constexpr int kMaxGroups = 256;
  static constexpr int kMaxExamples = 4096;    ///< A group.
  static constexpr int kMaxGridPoints = 4096;  ///< A group.

  /// Verifies header, hash, FlatBuffers structure and meaning before anything is used.
  /// kMalformed, kVersionMismatch, kLimitExceeded, kIo; `where` names the file.
  [[nodiscard]] static Expected<std::shared_ptr<const MotionLibrary>> Open(
      const std::filesystem::path& path);

  /// The same on bytes in memory; copies them.
  [[nodiscard]] static Expected<std::shared_ptr<const MotionLibrary>> FromBytes(
      std::span<const std::byte> bytes);

  ~MotionLibrary();
  MotionLibrary(const MotionLibrary&) = delete;
  MotionLibrary& operator=(const MotionLibrary&) = delete;

  [[nodiscard]] const Skeleton& skeleton() const { return skeleton_; }
  [[nodiscard]] const GridLayout& layout() const { return layout_; }
  [[nodiscard]] std::span<const MotionGroup> groups() const { return groups_; }
  [[nodiscard]] const MotionGroup& group(int index) const {
    return groups_[static_cast<std::size_t>(index)];
  }
  /// Clips to be played over the movement, names all different; kMaxLayerClips at most.
  [[nodiscard]] std::span<const LayerClip> layers() const;
  /// Index of the layer of that name, -1 if there is none.
  [[nodiscard]] int FindLayer(std::string_view name) const;
  /// How movements go on where others ended: [from][to] of all groups and, behind them, the stand. Empty in a
  /// library made before there were any.
  [[nodiscard]] std::span<const Transition> transitions() const;
  /// One of them; `from` and `to` are groups, or as many as there are groups: the stand. Null if the library
  /// has none.
  [[nodiscard]] const Transition* FindTransition(std::size_t from, std::size_t to) const;
  /// Pose avatars stand in when they are put into a world: base frame at the root, y above ground.
  [[nodiscard]] const Pose& stand_pose() const { return stand_pose_; }
  /// The skeleton's legs, for planting.
  [[nodiscard]] const LegRig& leg_rig() const { return *leg_rig_; }
  /// How its examples walk, for walks to a place.
  [[nodiscard]] const LocomotionProfile& locomotion_profile() const { return *locomotion_profile_; }
  /// 32 lower-case hex digits: XXH3-128 of the payload.
  [[nodiscard]] const std::string& hash() const { return hash_; }
  /// The whole file, header included: what `Open` read and what may be written elsewhere.
  [[nodiscard]] std::span<const std::byte> bytes() const { return bytes_; }
  /// Largest example count over the groups; sizes scratch memory.
  [[nodiscard]] int max_example_count() const { return max_example_count_; }

 private:
  MotionLibrary();
  [[nodiscard]] Status Load();
  [[nodiscard]] Status LoadTransitions(const std::vector<Transition>& transitions);

  Skeleton skeleton_;
  GridLayout layout_;
  std::vector<MotionGroup> groups_;
  std::vector<LayerClip> layers_;
  std::vector<Transition> transitions_;
  Pose stand_pose_;
  std::unique_ptr<const LegRig> leg_rig_;
  std::unique_ptr<const LocomotionProfile> locomotion_profile_;
  std::string hash_;
  int max_example_count_ = 0;
  std::span<const std::byte> bytes_;  // mapped or allocated, 64-byte aligned
  bool is_mapped_ = false;
};

}  // namespace stridewire
