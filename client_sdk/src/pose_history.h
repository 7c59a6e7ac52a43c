#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "movement_evaluator.h"
#include "pose_stamp.h"
#include "stridewire/base/math.h"
#include "stridewire/runtime/pose.h"

namespace stridewire::client {

/// Four poses for cubic interpolation in an interval: the pose before it, its start, its end, and
/// the pose after it. If there is no pose before or after the interval, `before` must be the start,
/// or `beyond` the end.
struct PoseKeys {
  std::array<double, 4> times_s;
  ConstPoseSpan before;
  ConstPoseSpan start;
  ConstPoseSpan end;
  ConstPoseSpan beyond;
  /// True: the slope at the start is that of the interval before it. False: it is the secant from
  /// `before` to `end`.
  bool start_slope_is_before = false;
};

/// Computes the pose at `time_s` inside the interval by cubic Hermite interpolation, which is
/// continuous in its first derivative and exact at the keys. Rotations are interpolated in one
/// hemisphere and normalized.
void InterpolatePose(const PoseKeys& keys, double time_s, Vec3& root_position_m,
                     std::span<Quat> rotations);

/// Jitter buffer: the last poses of one avatar, oldest first. A full buffer drops its oldest pose.
///
/// A pose is either stored, or it is determined by a movement and evaluated when it is first read.
/// Between two poses that are determined by the same movement, or by successive ones, the displayed
/// pose is that of the movement instead of an interpolated one. After construction, only the list
/// of movements allocates memory. The history keeps a movement while it has poses of it.
///
/// The displayed motion is continuous, no matter when poses arrive:
/// - A curve through the poses is not changed after its display has begun. The slope at a pose is
///   that of the secant through both neighbours. If an interval is displayed before the next pose
///   has arrived, the slope at its end remains that of the interval's own secant.
/// - After the newest pose, and after the last pose before a gap, the motion continues and slows
///   down until it stops, within kMaxExtrapolationS.
/// - If a pose arrives after its time was displayed, its difference from the displayed pose fades
///   within kCorrectionS.
class PoseHistory {
 public:
  static constexpr double kMaxExtrapolationS = 0.25;
  static constexpr double kCorrectionS = 0.3;

  /// `capacity` (in poses) and `joint_count` must be above 0.
  PoseHistory(std::size_t capacity, std::size_t joint_count);

  /// Returns the memory of a history in bytes, without movements.
  [[nodiscard]] static std::size_t Bytes(std::size_t capacity, std::size_t joint_count);

  /// Adds a pose. Returns false and does nothing unless its tick and its time exceed those of the
  /// newest pose.
  bool Push(const PoseStamp& stamp, const Vec3& root_position_m, std::span<const Quat> rotations);

  /// Adds a pose that is evaluated when it is read. `time_s` is its time in the movement.
  /// `evaluator` must exist until EvaluateAll has been called or the history is destroyed.
  bool Push(const PoseStamp& stamp, const std::shared_ptr<const PlayedMovement>& movement,
            double time_s, MovementEvaluator& evaluator);

  /// The pose of a movement at some time.
  struct MovementTime {
    const PlayedMovement* movement = nullptr;  ///< Null: there is no movement.
    double time_s = 0.0;
  };
  /// Returns the movement of the newest pose, unless the pose is stored or the history is empty.
  [[nodiscard]] MovementTime NewestMovement() const;

  /// Returns true if a late pose changes the motion that Display returns at `time_s` or later.
  [[nodiscard]] bool IsCorrected(double time_s) const {
    return correction_.state != Correction::State::kNone &&
           time_s - correction_.start_s < kCorrectionS;
  }
  /// Returns true if the newest displayed pose is after the newest pose of the history.
  [[nodiscard]] bool IsDisplayedAfterNewest() const {
    return size_ > 0 && displayed_s_ > stamp(size_ - 1).time_s;
  }
  /// Returns true if `time_s` is between two poses and Display evaluates their movement at this
  /// time instead of interpolating the poses.
  [[nodiscard]] bool IsMovementAt(double time_s) const {
    return FindCurve(time_s).kind == Curve::Kind::kMovement;
  }
  /// Call it if the caller has computed and displayed the pose at `time_s` itself.
  void SetDisplayed(double time_s) { displayed_s_ = time_s; }

  /// Evaluates all poses. The history then refers to no movement and no evaluator.
  void EvaluateAll();

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t joint_count() const { return joint_count_; }
  [[nodiscard]] const PoseStamp& stamp(std::size_t i) const { return entries_[Slot(i)].stamp; }
  [[nodiscard]] const Vec3& root_position_m(std::size_t i) const { return pose(i).root_position_m; }
  [[nodiscard]] std::span<const Quat> rotations(std::size_t i) const { return pose(i).rotations; }

  /// Prefetches what Display will probably read. Call it first with `is_near` false, which
  /// prefetches the newest entry. A later call with `is_near` true reads that entry to find the
  /// poses, and prefetches them.
  void Prefetch(double time_s, bool is_near) const;
  /// Prefetches what Push will probably read and write.
  void PrefetchPush() const;

  /// Returns the index of the oldest pose with a tick above `tick`, if any.
  [[nodiscard]] std::optional<std::size_t> FirstAfterTick(std::uint64_t tick) const;

  /// Returns true if the next pose cannot continue the displayed motion, because the extrapolation
  /// of the newest pose has ended, or because the displayed poses are no longer stored.
  [[nodiscard]] bool IsInterrupted() const;

  /// Changes the segment of a stored pose.
  void SetSegment(std::size_t i, std::uint32_t segment) {
    entries_[Slot(i)].stamp.segment = segment;
  }

  /// Describes how Sample computed a pose.
  struct Sampled {
    std::size_t index = 0;  ///< Index of the newest pose at or before the sampled time.
    /// True if the pose was interpolated, or evaluated from a movement between two poses, or if
    /// `time_s` is exactly the time of pose `index`.
    bool interpolated = false;
    /// True if the pose continues the motion after the newest pose. If this and `interpolated` are
    /// both false, the pose is held: it is pose `index`, or the end of the extrapolation.
    bool extrapolated = false;
  };

  /// Computes the pose at `time_s`: evaluates the movement if one determines the pose, otherwise
  /// interpolates between poses (InterpolatePose). After the newest pose, extrapolates. In the
  /// interval before a discontinuity, returns the pose at the interval's start, or extrapolates if
  /// this interval is more than 1.5 times as long as the previous one. Returns nullopt before the
  /// oldest pose.
  [[nodiscard]] std::optional<Sampled> Sample(double time_s, Vec3& root_position_m,
                                              std::span<Quat> rotations) const;

  /// Same as Sample, for poses that are displayed. Poses that arrive later continue the displayed
  /// motion.
  std::optional<Sampled> Display(double time_s, Vec3& root_position_m, std::span<Quat> rotations);

  /// Prepares the next call of Display, which must have the same arguments: adds the poses that it
  /// needs to the evaluator. Evaluating the poses of many avatars together is faster than
  /// evaluating those of each one in Display. Returns false if Display will return nullopt.
  bool Prepare(double time_s, Vec3& root_position_m, std::span<Quat> rotations);

 private:
  [[nodiscard]] std::size_t Slot(std::size_t i) const {
    const std::size_t slot = first_ + i;
    return slot < entries_.size() ? slot : slot - entries_.size();
  }
  /// A pose that Prepare has added to the evaluator.
  struct Prepared {
    MovementTime at;
    Vec3* root_position_m = nullptr;
    Quat* rotations = nullptr;
  };
  /// Describes how the pose at a time is computed.
  struct Curve {
    enum class Kind : std::uint8_t { kNone, kPose, kInterpolated, kMovement, kExtrapolated };
    Kind kind = Kind::kNone;
    std::size_t i = 0;  ///< Index of the newest pose at or before the time.
    bool is_exact = false;
    MovementTime movement = {};  ///< Set if the kind is kMovement.
  };

  [[nodiscard]] ConstPoseSpan pose(std::size_t i) const;
  [[nodiscard]] std::span<Quat> RotationsAt(std::size_t slot) const {
    return std::span(rotations_).subspan(slot * joint_count_, joint_count_);
  }
  /// Does what both versions of Push have in common. Returns the slot of the new entry, if any.
  std::optional<std::size_t> PushStamp(const PoseStamp& stamp);
  void DropOldest();
  void AddMovement(const std::shared_ptr<const PlayedMovement>& movement);
  /// Returns the movement that determines the pose between poses `i` and `i` + 1, if any.
  [[nodiscard]] MovementTime MovementAt(std::size_t i, double time_s) const;
  void EvaluateMovement(const MovementTime& at, Vec3& root_position_m,
                        std::span<Quat> rotations) const;
  /// Returns the indices of the pose before `i` and of the pose after `i` + 1, for interpolation. A
  /// missing one is replaced with `i` or `i` + 1.
  [[nodiscard]] std::pair<std::size_t, std::size_t> NeighboursOf(std::size_t i) const;
  [[nodiscard]] Curve FindCurve(double time_s) const;
  /// Adds the poses that the curve needs to the evaluator.
  void PrepareCurve(const Curve& curve, Vec3& root_position_m, std::span<Quat> rotations);
  void PreparePose(std::size_t i);

  /// Returns the index of the oldest pose after `time_s`, or size().
  [[nodiscard]] std::size_t FirstAfterTime(double time_s) const;

  /// Does the same as Sample, without the correction.
  [[nodiscard]] std::optional<Sampled> SampleCurve(double time_s, Vec3& root_position_m,
                                                   std::span<Quat> rotations) const;
  /// Continues the motion after pose `j`.
  void Extrapolate(std::size_t j, double time_s, Vec3& root_position_m,
                   std::span<Quat> rotations) const;
  void ResolveCorrection();

  static constexpr double kNever = -std::numeric_limits<double>::infinity();

  /// Everything about a pose except its rotations, in one cache line.
  struct alignas(64) Entry {
    PoseStamp stamp;
    const PlayedMovement* movement = nullptr;  ///< Null: the pose is stored.
    double movement_time_s = 0.0;
    Vec3 root_position_m = Vec3(0.0f);
    bool slope_is_before = false;  ///< The slope at the pose is that of the interval before it.
    bool is_evaluated = false;     ///< The pose of the movement has been evaluated.
  };
  static_assert(sizeof(Entry) == 64);

  /// Hides the jump that occurs if a pose arrives after its time was displayed by extrapolation:
  /// the difference between the displayed pose and the new curve fades out.
  struct Correction {
    enum class State : std::uint8_t {
      kNone,
      kPending,  ///< The members below contain the pose displayed at `start_s`.
      kActive,   ///< They contain the difference of that pose from the curve.
    };
    State state = State::kNone;
    double start_s = 0.0;
    Vec3 root_m = Vec3(0.0f);
    std::vector<Quat> rotations;
    Vec3 curve_root_m = Vec3(0.0f);  ///< Scratch memory.
  };

  std::size_t joint_count_;
  std::size_t first_ = 0;
  std::size_t size_ = 0;
  // Mutable, because poses of movements are evaluated when they are first read.
  mutable std::vector<Entry> entries_;
  mutable std::vector<Quat> rotations_;
  std::vector<std::shared_ptr<const PlayedMovement>> movements_;  ///< Oldest first.
  MovementEvaluator* evaluator_ = nullptr;
  std::array<Prepared, 2> prepared_;
  std::size_t prepared_count_ = 0;
  double displayed_s_ = kNever;  ///< Time of the last Display.
  Correction correction_;
  std::vector<Quat> displayed_;  ///< Scratch memory.
};

}  // namespace stridewire::client
