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
struct StandMotion;
struct Transition;

enum class MovementKind : std::uint8_t {
  kStepLeft = 0,   ///< The left foot moves.
  kStepRight = 1,  ///< The right foot moves.
  kJump = 2,
  kStand = 3,  ///< Standing. Only the groups that are generated for standing have this kind.
};

/// Returns the name of a kind, for example "step_left".
[[nodiscard]] std::string_view MovementKindName(MovementKind kind);
[[nodiscard]] constexpr bool IsStep(MovementKind kind) { return kind <= MovementKind::kStepRight; }
[[nodiscard]] constexpr MovementKind StepKind(Foot foot) {
  return foot == Foot::kLeft ? MovementKind::kStepLeft : MovementKind::kStepRight;
}
[[nodiscard]] constexpr Foot MovingFoot(MovementKind step) {
  return step == MovementKind::kStepLeft ? Foot::kLeft : Foot::kRight;
}

/// Parameters that a group may have. General steps have the first seven in this order (paper,
/// Section 6): the vector from the fixed to the moving foot in the first pose, the same vector in
/// the last pose, and the change of heading. Each vector is in the heading frame of its pose and is
/// measured between the balls of the feet.
enum class ParameterName : std::uint8_t {
  kStartX = 0,
  kStartY = 1,
  kStartZ = 2,
  kEndX = 3,
  kEndY = 4,
  kEndZ = 5,
  kTurn = 6,
  kLength = 7,  ///< Jump: forward distance between the midpoints of the feet before and after it.
  kHeight = 8,  ///< Jump: height of the landing place above the start.
};
inline constexpr int kParameterNameCount = 9;
inline constexpr int kMaxParameters = 7;

/// Returns the name of a parameter with its unit, for example "start_z_m" or "turn_rad".
[[nodiscard]] std::string_view ParameterText(ParameterName name);

struct Parameter {
  ParameterName name = ParameterName::kStartZ;
  double min = 0.0;  ///< Minimum over the examples.
  double max = 0.0;  ///< Maximum over the examples.
  /// Mean over the examples. It is subtracted from the parameter before the linear part of the
  /// weights is evaluated.
  double centre = 0.0;
  double scale = 1.0;  ///< Divisor of the values when distances are computed; > 0.
};

/// Layout of a grid row, which stores the pose of one example at one grid point as floats:
///   [joint] x y z w,  root x y z, root yaw,  zeros up to a multiple of 16.
/// The root rotation r is split into r = q_yaw * rest. The quaternion of joint 0 is `rest`, and the
/// yaw is stored as an angle. It is not wrapped, so examples may differ by more than half a turn.
/// Positions and yaw are relative to the base frame.
struct GridLayout {
  int joint_count = 0;
  int row_floats = 0;
  explicit constexpr GridLayout(int joints = 0)
      : joint_count(joints), row_floats((4 * (joints + 1) + 15) / 16 * 16) {}
  /// Returns the rotation of a joint. It has unit length in a row of an example, but not in a
  /// weighted sum of rows.
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

/// Number of floats in the longest possible grid row.
inline constexpr std::size_t kMaxRowFloats = GridLayout(kMaxJoints).row_floats;

/// The entries of MotionGroup::sources begin with this prefix for examples that were generated
/// because the captures lack such movements.
inline constexpr std::string_view kCompletedSource = "completed";

/// Maximum time over which a difference pose fades out (T in Section 5 of the paper), in seconds.
/// Applies to the groups of a library file; groups of standing avatars have longer times
/// (MotionGroup::ease_out_s).
inline constexpr double kEaseOutS = 0.2;

/// Examples that can be blended with each other. They have the same kind, parameters, number of
/// keytimes and grid. Keytimes are the times of corresponding events, such as toe-off and landing.
/// All spans point into memory of the library.
///
/// Sites are the points in parameter space where weights are prescribed: first the examples, then
/// the pseudoexamples. n is the number of examples, m the number of sites and d the number of
/// parameters.
///
/// Variants are captured steps that are not examples: each is one of the steps from which the
/// examples were averaged or smoothed. Only varied steps blend them (see StrideVariation). v is the
/// number of variants. A *row* is an example or a variant: row i < n is example i, and row n + i is
/// variant i.
struct MotionGroup {
  MovementKind kind = MovementKind::kStepLeft;
  std::vector<Parameter> parameters;  ///< d parameters.
  int example_count = 0;              ///< n.
  int site_count = 0;                 ///< m >= n.
  int variant_count = 0;              ///< v, 0 to kMaxVariants.
  /// [variant][parameter]: parameters of the variants, in metres or radians.
  std::span<const double> variant_parameters;
  /// [site][parameter]: parameters of the sites, in metres or radians.
  std::span<const double> sites;
  std::span<const double> site_weights;  ///< [site - n][example]: weights of pseudoexamples.
  /// [site]: radius of influence, in units of Parameter::scale.
  std::span<const double> dilations;
  double radius_factor = 1.0;  ///< Factor by which the `dilations` of the examples were multiplied.
  /// [1 + d][example]: coefficients a of the linear part. Row 0 is the constant.
  std::span<const double> linear;
  /// [site][example]: coefficients r of the radial functions.
  std::span<const double> radial;
  std::span<const int> cells;  ///< [interval]: number of grid cells of the keytime interval.
  int grid_point_count = 0;    ///< Sum of `cells`, plus 1.
  /// [row][interval + 1]: keytimes in seconds since the start. The first one is 0.
  std::span<const double> keytimes_s;
  /// [row]: heading at the end, relative to the start.
  std::span<const double> heading_change_rad;
  /// [grid point][row][row_floats]: poses at the grid points (see GridLayout), 64-byte aligned.
  std::span<const float> grid;
  /// [example]: origin, for example "16_21.bvh 0.93-1.47 s".
  std::vector<std::string_view> sources;
  std::span<const std::uint8_t> mirrored;  ///< [example]: 1 if it is a mirrored copy, else 0.
  double ease_out_s = kEaseOutS;           ///< Maximum time over which difference poses fade out.
  /// True if the sources of all examples begin with kCompletedSource. Requests prefer other groups
  /// that fit nearly as well.
  bool is_completed = false;

  /// Number of examples and variants, n + v.
  [[nodiscard]] int row_count() const { return example_count + variant_count; }
  [[nodiscard]] int parameter_count() const { return static_cast<int>(parameters.size()); }
  [[nodiscard]] int interval_count() const { return static_cast<int>(cells.size()); }
  /// Returns the index of a parameter in this group, or -1.
  [[nodiscard]] int FindParameter(ParameterName name) const;
  [[nodiscard]] std::span<const double> site(int s) const {
    return sites.subspan(static_cast<std::size_t>(s) * parameters.size(), parameters.size());
  }
  /// Returns the parameters [d] of a variant.
  [[nodiscard]] std::span<const double> variant(int i) const {
    return variant_parameters.subspan(static_cast<std::size_t>(i) * parameters.size(),
                                      parameters.size());
  }
  /// Returns the parameters [d] of a row: of an example or a variant.
  [[nodiscard]] std::span<const double> row_parameters(int row) const {
    return row < example_count ? site(row) : variant(row - example_count);
  }
};

/// An immutable library of examples. It is a view of verified bytes, either a mapped `.swl` file or
/// memory. Threads may share it.
///
/// The file has a 64-byte header (magic, version, payload size, XXH3-128 hash of the payload) and a
/// payload, which is one FlatBuffers table (`core/schema/motion_library.fbs`). Its float arrays are
/// aligned to 64 bytes.
class MotionLibrary {
 public:
  static constexpr int kFormatVersion = 3;
  static constexpr std::size_t kMaxFileBytes = std::size_t{1} << 30;
  /// Maximum number of groups in a file. Movement records store the index of a group in one byte.
  static constexpr int kMaxGroups = 254;
  static constexpr int kMaxExamples = 4096;    ///< Per group.
  static constexpr int kMaxVariants = 8;       ///< Per group.
  static constexpr int kMaxGridPoints = 4096;  ///< Per group.

  /// Opens a library file. Verifies its header, hash and FlatBuffers structure and validates all
  /// values before it uses any. Errors, with the file in Error::where: kNotFound or kIo if the file
  /// cannot be read; kMalformed, kVersionMismatch or kLimitExceeded if its contents are invalid;
  /// kOutOfRange or kInvalidArgument if its skeleton is invalid (Skeleton::Validate); kUnsupported
  /// in WebAssembly, which cannot open files.
  [[nodiscard]] static Expected<std::shared_ptr<const MotionLibrary>> Open(
      const std::filesystem::path& path);

  /// Same as Open, for bytes in memory. Copies the bytes. Error::where is empty.
  [[nodiscard]] static Expected<std::shared_ptr<const MotionLibrary>> FromBytes(
      std::span<const std::byte> bytes);

  ~MotionLibrary();
  MotionLibrary(const MotionLibrary&) = delete;
  MotionLibrary& operator=(const MotionLibrary&) = delete;

  [[nodiscard]] const Skeleton& skeleton() const { return skeleton_; }
  [[nodiscard]] const GridLayout& layout() const { return layout_; }
  /// The groups of the library file.
  [[nodiscard]] std::span<const MotionGroup> groups() const {
    return std::span(groups_).first(file_group_count_);
  }
  /// Returns a group by its index: a group of the file, settle_group() or idle_group().
  [[nodiscard]] const MotionGroup& group(int index) const {
    return groups_[static_cast<std::size_t>(index)];
  }
  /// Number of groups including those that are generated for standing avatars.
  [[nodiscard]] int group_count() const { return static_cast<int>(groups_.size()); }
  /// True if the library has motion for standing avatars. It is generated from the stand pose if
  /// feet can be planted (LegRig::is_usable).
  [[nodiscard]] bool has_stand_motion() const { return stand_motion_ != nullptr; }
  /// Index of the group that contains the stand pose. Avatars blend into this pose after their last
  /// step. The group exists only if has_stand_motion().
  [[nodiscard]] int settle_group() const { return static_cast<int>(file_group_count_); }
  /// Index of the group with the loop that standing avatars play. The group exists only if
  /// has_stand_motion().
  [[nodiscard]] int idle_group() const { return static_cast<int>(file_group_count_) + 1; }
  /// Clips that can be played over movements, at most kMaxLayerClips. Their names are unique.
  [[nodiscard]] std::span<const LayerClip> layers() const;
  /// Returns the index of the layer with this name, or -1.
  [[nodiscard]] int FindLayer(std::string_view name) const;
  /// Transitions between movements as a table [from][to]. Index i is group i of the file; the
  /// index after the last group is the stand. Empty if the file contains no transitions.
  [[nodiscard]] std::span<const Transition> transitions() const;
  /// Returns an entry of transitions(): how well a movement of group `to` can follow one of group
  /// `from`. Returns null if the file contains no transitions.
  [[nodiscard]] const Transition* FindTransition(std::size_t from, std::size_t to) const;
  /// Pose of an avatar that has just been spawned, relative to its base frame. The root is at
  /// x = z = 0 with heading 0, and y is its height above the ground.
  [[nodiscard]] const Pose& stand_pose() const { return stand_pose_; }
  /// Geometry of the skeleton's legs, for foot planting.
  [[nodiscard]] const LegRig& leg_rig() const { return *leg_rig_; }
  /// Typical lengths and widths of the library's steps, used to plan walks.
  [[nodiscard]] const LocomotionProfile& locomotion_profile() const { return *locomotion_profile_; }
  /// XXH3-128 hash of the payload, as 32 lower-case hexadecimal digits.
  [[nodiscard]] const std::string& hash() const { return hash_; }
  /// Content of the library file, including its header.
  [[nodiscard]] std::span<const std::byte> bytes() const { return bytes_; }
  /// Maximum of MotionGroup::row_count() over the groups. It determines the size of scratch memory.
  [[nodiscard]] int max_row_count() const { return max_row_count_; }

 private:
  MotionLibrary();
  [[nodiscard]] Status Load();
  [[nodiscard]] Status LoadContent();
  void AddStandMotion();
  [[nodiscard]] Status LoadTransitions(const std::vector<Transition>& transitions);

  Skeleton skeleton_;
  GridLayout layout_;
  std::vector<MotionGroup> groups_;  // The groups of the file, followed by those of stand_motion_.
  std::size_t file_group_count_ = 0;
  std::vector<LayerClip> layers_;
  std::vector<Transition> transitions_;
  Pose stand_pose_;
  std::unique_ptr<const LegRig> leg_rig_;
  std::unique_ptr<const LocomotionProfile> locomotion_profile_;
  std::unique_ptr<const StandMotion> stand_motion_;
  std::string hash_;
  int max_row_count_ = 0;
  std::span<const std::byte> bytes_;  // Mapped or allocated memory, 64-byte aligned.
  bool is_mapped_ = false;
};

}  // namespace stridewire
