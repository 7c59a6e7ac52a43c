#include "runtime/avatar/avatar_replica.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include "base/check.h"
#include "base/prefetch.h"
#include "runtime/avatar/record_fields.h"
#include "runtime/pose/plant_feet.h"

namespace stridewire {
namespace {

// AdvanceAll prefetches the replica that is this many places ahead in the list.
constexpr std::size_t kPrefetched = 4;

// Limits on the numbers in a record, in metres, seconds or radians, and on weights.
constexpr double kMaxNumber = 1e9;
constexpr float kMaxWeight = 1e3f;
// Tolerance for the squared length of unit quaternions and normals. Rounding changes the lengths of
// products of quaternions.
constexpr float kUnitTolerance = 0.02f;

}  // namespace

// Reads the fields of a record. Keeps the first error. All fields read after it are 0.
class AvatarReplica::Reader {
 public:
  explicit Reader(std::span<const std::byte> record) : record_(record) {}

  [[nodiscard]] const Status& status() const { return status_; }
  [[nodiscard]] bool ok() const { return status_.has_value(); }
  void Reject(const char* text) {
    if (ok()) status_ = Fail(ErrorCode::kMalformed, text, static_cast<std::int64_t>(at_));
  }
  void Finish() {
    if (at_ != record_.size()) Reject("a movement record has extra bytes at its end");
  }

  void F64(double& value) { Number(value); }
  void F32(float& value) { Number(value); }
  [[nodiscard]] unsigned Flags() {
    std::uint16_t flags = 0;
    Take(&flags, sizeof flags);
    return flags;
  }
  void Index(int& value) {
    std::uint8_t index = 0;
    Take(&index, sizeof index);
    value = index;
  }
  void Bool(bool& value) {
    std::uint8_t byte = 0;
    Take(&byte, sizeof byte);
    value = byte == 1;
    if (byte > 1) Reject("a flag of a movement record is neither 0 nor 1");
  }
  void CheckUnit(Quat& q) {
    if (std::fabs(Dot(q, q) - 1.0f) <= kUnitTolerance) return;
    Reject("a rotation in a movement record is not of unit length");
    q = kIdentityQuat;
  }
  void CheckUnit(Vec3& v) {
    if (std::fabs(glm::dot(v, v) - 1.0f) <= kUnitTolerance && v.y > 0.0f) return;
    Reject("a normal in a movement record is not of unit length or does not point up");
    v = Vec3(0.0f, 1.0f, 0.0f);
  }

 private:
  template <typename T>
  void Number(T& value) {
    value = 0;
    Take(&value, sizeof value);
    if (std::fabs(value) <= static_cast<T>(kMaxNumber)) return;
    Reject("a number in a movement record is not finite or is too large");
    value = 0;
  }
  void Take(void* value, std::size_t bytes) {
    if (!ok()) return;
    if (record_.size() - at_ < bytes) {
      Reject("a movement record is truncated");
      return;
    }
    std::memcpy(value, record_.data() + at_, bytes);
    at_ += bytes;
  }

  std::span<const std::byte> record_;
  std::size_t at_ = 0;
  Status status_;
};

namespace {

template <typename Reader>
void ReadLayers(const MotionLibrary& library, LayerStack& layers, Reader& reader) {
  int count = 0;
  reader.Index(count);
  std::array<LayerStack::Playing, LayerStack::kMaxLayers> playing{};
  if (count > static_cast<int>(playing.size())) {
    reader.Reject("a movement record contains too many layers");
    return;
  }
  const auto layers_read = std::span(playing).first(static_cast<std::size_t>(count));
  for (LayerStack::Playing& p : layers_read) record::LayerFields(reader, p);
  if (reader.ok() && !layers.Restore(library, layers_read)) {
    reader.Reject("a movement record contains an invalid layer");
  }
}

template <typename Reader>
void ReadWeights(const MotionLibrary& library, bool plants_feet, Movement& movement,
                 Reader& reader) {
  int group = 0;
  reader.Index(group);
  if (!reader.ok()) return;
  if (group >= library.group_count()) {
    reader.Reject("a movement record refers to a group that the library does not have");
    return;
  }
  if (library.group(group).kind == MovementKind::kStand && !plants_feet) {
    reader.Reject("a movement record contains a stand without planted feet");
    return;
  }
  movement.group = group;
  movement.weights.resize(static_cast<std::size_t>(library.group(group).row_count()));
  double sum = 0.0;
  double magnitude = 0.0;
  for (float& weight : movement.weights) {
    reader.F32(weight);
    sum += static_cast<double>(weight);
    magnitude = std::max(magnitude, std::fabs(static_cast<double>(weight)));
  }
  if (!(std::fabs(sum - 1.0) <= 1e-3) || magnitude > kMaxWeight) {
    reader.Reject("weights of a movement record do not sum to 1");
  }
}

// Rejects playback speeds that no avatar uses. Keytimes are divided by the speed, so 0 or NaN would
// make them invalid.
template <typename Reader>
void CheckRate(double rate, Reader& reader) {
  if (!(rate >= kMinRate && rate <= kMaxRate)) {
    reader.Reject("a movement record contains a playback speed that is out of range");
  }
}

// Sets the release and landing times, the root weights and the height locks of the feet, which
// follow from the kind and the keytimes of the movement.
void SetTimes(MovementKind kind, Movement& movement) {
  const SwingTimes times = SwingTimesOf(kind, movement);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    FootTrajectory& trajectory = movement.feet.foot(foot);
    const bool moves = kind != MovementKind::kStand && (!IsStep(kind) || foot == MovingFoot(kind));
    trajectory.release_s = moves ? times.release_s : FootTrajectory::kNever;
    trajectory.land_s = moves ? times.land_s : FootTrajectory::kNever;
    trajectory.root_weight = !IsStep(kind) ? 0.5 : moves ? 0.0 : 1.0;
    trajectory.locks_height = kind == MovementKind::kStand;
  }
}

}  // namespace

ReplicaEvaluator::ReplicaEvaluator(const MotionLibrary& library)
    : evaluator_(library, static_cast<int>(AvatarReplica::kPosesAhead)) {
  batcher_.Reserve(kBatch);
}

AvatarReplica::AvatarReplica(std::shared_ptr<const MotionLibrary> library)
    : ahead_rotations_(kPosesAhead * static_cast<std::size_t>(library->skeleton().joint_count())),
      body_(std::move(library)) {
  body_.layered_pose = body_.pose;
  body_.layers.Reserve();
}

bool AvatarReplica::IsState(std::span<const std::byte> record) {
  return !record.empty() && (std::to_integer<unsigned>(record[0]) & record::kIsState) != 0;
}

Status AvatarReplica::Apply(std::span<const std::byte> record, FootPlanScratch& scratch) {
  STRIDEWIRE_CHECK(&scratch.library() == &library());
  Reader reader(record);
  const unsigned flags = reader.Flags();
  if ((flags & (record::kIsState | record::kLeft | record::kMoves)) != 0) {
    ahead_count_ = 0;
    ++movement_number_;
    previous_end_s_ = -1.0;
  }
  if ((flags & record::kIsState) != 0) {
    ReadState(flags, reader);
  } else if (!is_known_) {
    return Fail(ErrorCode::kNotFound, "a change record arrived before the first state record");
  } else {
    ReadChange(flags, reader, scratch);
  }
  may_have_layers_ |= !body_.layers.empty();
  is_known_ = reader.ok();
  is_idle_ = (flags & record::kIsIdle) != 0;
  return reader.status();
}

void AvatarReplica::ReadChange(unsigned flags, Reader& reader, FootPlanScratch& scratch) {
  // Each part of the record is checked before it is applied, because its effects cannot be undone.
  Movement& movement = body_.movement;
  const bool has_left = (flags & record::kLeft) != 0;
  const bool has_begun = (flags & record::kMoves) != 0;
  if (has_left && !is_moving_) {
    reader.Reject("a movement record ends a movement, but none is in progress");
    return;
  }
  if (has_begun && is_moving_ && !has_left) {
    reader.Reject("a movement record begins a movement before the current one ends");
    return;
  }
  if (has_begun && ((flags & record::kPlants) != 0) != body_.plants_feet) {
    reader.Reject("a movement record does not agree with the state about foot planting");
    return;
  }
  if (has_left) {
    double left_s = movement.duration_s();
    if ((flags & record::kLeftAtEnd) == 0) reader.F64(left_s);
    if (!(left_s >= 0.0 && left_s <= movement.duration_s())) {
      reader.Reject("a movement record ends a movement at a time outside its duration");
    }
    if (!reader.ok()) return;
    STRIDEWIRE_CHECK(is_moving_ && is_known_);
    body_.CaptureBlendSource(left_s, (flags & record::kLeftKeepsSpeed) != 0);
    if (movement.feet.is_active && (flags & record::kIsRedirected) == 0)
      body_.CaptureFootLocks(left_s);
    is_moving_ = false;
    previous_end_s_ = left_s;
  }
  if (has_begun) {
    double time_s = 0.0;
    double start_offset_s = 0.0;
    double rate = 1.0;
    BaseFrame base;
    LandingDecision decision{.is_on_terrain = (flags & record::kOnTerrain) != 0};
    reader.F64(time_s);
    ReadWeights(*body_.library, body_.plants_feet, movement, reader);
    reader.F64(base.heading_rad);
    if ((flags & record::kHasRate) != 0) reader.F64(rate);
    if ((flags & record::kIsEntered) != 0) reader.F64(start_offset_s);
    CheckRate(rate, reader);
    if (!reader.ok()) return;
    if (body_.plants_feet) {
      record::DecisionFields(reader, flags, body_.group().kind, decision);
    } else {
      record::Vector(reader, base.position_m);
    }
    if (!reader.ok()) return;
    body_.StartWeighted(base, rate);
    if (!(start_offset_s >= 0.0 && start_offset_s < movement.duration_s() &&
          time_s >= start_offset_s)) {
      reader.Reject("a movement record begins a movement at a time outside its duration");
      return;
    }
    body_.SetStartOffset(start_offset_s);
    body_.BlendIn(decision, (flags & record::kKeepsSpeed) != 0, scratch);
    body_.begins_planting = false;
    movement_time_s_ = time_s;
    is_moving_ = is_time_set_ = true;
  }
  if ((flags & record::kLayers) != 0) {
    ReadLayers(*body_.library, body_.layers, reader);
    are_layers_set_ = true;
  }
  reader.Finish();
}

void AvatarReplica::ReadState(unsigned flags, Reader& reader) {
  Movement& movement = body_.movement;
  movement.feet = {};
  body_.plants_feet = (flags & record::kPlants) != 0;
  body_.begins_planting = (flags & record::kBeginsPlanting) != 0;
  is_moving_ = (flags & record::kMoves) != 0;
  if (body_.plants_feet && !body_.library->leg_rig().is_usable) {
    reader.Reject("a movement record plants feet, but the library does not support it");
    return;
  }
  if (body_.plants_feet) record::FootLockFields(reader, body_.locks);
  if (is_moving_) {
    BaseFrame base;
    double rate = 1.0;
    double start_offset_s = 0.0;
    double extra_turn_rad = 0.0;
    reader.F64(movement_time_s_);
    ReadWeights(*body_.library, body_.plants_feet, movement, reader);
    record::Vector(reader, base.position_m);
    reader.F64(base.heading_rad);
    reader.F64(rate);
    reader.F64(start_offset_s);
    reader.F64(extra_turn_rad);
    CheckRate(rate, reader);
    if (!reader.ok()) return;
    body_.StartWeighted(base, rate);
    movement.extra_turn_rad = extra_turn_rad;
    if (!(start_offset_s >= 0.0 && start_offset_s < movement.duration_s() &&
          movement_time_s_ >= start_offset_s)) {
      reader.Reject("a movement record begins a movement at a time outside its duration");
      return;
    }
    body_.SetStartOffset(start_offset_s);
    if (record::NeedsDifference(movement, movement_time_s_)) {
      record::DifferenceFields(reader, movement);
    }
    if (body_.plants_feet) {
      movement.feet.is_active = true;
      SetTimes(body_.group().kind, movement);
      record::PlanFields(reader, movement.feet);
      for (const FootResidual& residual : movement.feet.residuals) {
        if (!(residual.over_s > 0.0))
          reader.Reject("a foot residual in a movement record has no duration");
      }
      if (movement.feet.root_dip.depth_m != 0.0 && !IsStep(body_.group().kind))
        reader.Reject("a movement record contains a root dip, but its movement is not a step");
      movement.feet.packed = PackFootPlan(movement);
    }
  } else {
    record::PoseFields(reader, body_.pose);
    record::PoseFields(reader, body_.blended_pose);
    record::CorrectionFields(reader, body_.earlier_feet[0]);
    if ((flags & record::kKeepsSpeed) != 0) {
      record::PoseFields(reader, body_.earlier_pose);
      record::CorrectionFields(reader, body_.earlier_feet[1]);
    }
  }
  if ((flags & record::kLayers) != 0) {
    ReadLayers(*body_.library, body_.layers, reader);
  } else {
    body_.layers.Clear();
  }
  is_time_set_ = are_layers_set_ = true;
  reader.Finish();
}

void AvatarReplica::SkipTicks(std::uint64_t ticks, double length_s) {
  STRIDEWIRE_CHECK(is_known_ && is_moving_ && !is_time_set_ && !may_have_layers_);
  ahead_count_ = 0;
  // The time is summed tick by tick, as in AdvanceAll, so that rounding gives the same bits.
  for (std::uint64_t tick = 0; tick < ticks; ++tick) movement_time_s_ += length_s;
}

void AvatarReplica::PrefetchPose() const {
  if (!is_moving_) return;
  const ConstPoseSpan pose = AheadPose();
  PrefetchBytes(&pose.root_position_m, sizeof(Vec3));
  PrefetchBytes(pose.rotations.data(), pose.rotations.size_bytes());
}

void AvatarReplica::AdvanceAll(std::span<AvatarReplica* const> replicas, const Tick& tick,
                               ReplicaEvaluator& evaluator) {
  STRIDEWIRE_CHECK(tick.ticks_apart >= 1);
  const auto ticks_apart = static_cast<std::size_t>(tick.ticks_apart);
  for (std::size_t begin = 0; begin < replicas.size(); begin += ReplicaEvaluator::kBatch) {
    const auto batch =
        replicas.subspan(begin, std::min(replicas.size() - begin, ReplicaEvaluator::kBatch));
    const MotionLibrary& library = batch.front()->library();
    for (std::size_t i = 0; i < batch.size(); ++i) {
      if (i + kPrefetched < batch.size()) PrefetchBytes(batch[i + kPrefetched], kCacheLineBytes);
      AvatarReplica& replica = *batch[i];
      STRIDEWIRE_CHECK(&replica.library() == &library);
      if (!replica.is_known_ || !replica.is_moving_) continue;
      if (!replica.is_time_set_) replica.movement_time_s_ += tick.length_s;
      ++replica.ahead_tick_;
      if (!tick.has_poses || replica.HasAheadPose()) continue;
      if (tick.only_layered && !replica.may_have_layers_) continue;
      const Movement& movement = replica.body_.movement;
      // Replicas that are next to each other evaluate poses in the same tick, so that they can be
      // evaluated side by side. Different groups of replicas do so in different ticks, to
      // distribute the load.
      const std::size_t phase = (tick.number / ticks_apart + i / SoaPose::kLanes) % kPosesAhead;
      const int count = SampleRunCount(movement, replica.movement_time_s_, tick.length_s,
                                       tick.ticks_apart, static_cast<int>(kPosesAhead - phase));
      evaluator.batcher_.Add({&movement, replica.movement_time_s_, tick.length_s, tick.ticks_apart},
                             count, static_cast<std::uint32_t>(i));
      replica.ahead_count_ = static_cast<std::uint32_t>(count);
      replica.ahead_ticks_apart_ = static_cast<std::uint32_t>(ticks_apart);
      replica.ahead_tick_ = 0;
    }
    evaluator.batcher_.Evaluate(
        evaluator.evaluator_,
        [&](std::span<const EvaluationBatcher::Item> items, int pose, const SoaPose& poses) {
          std::array<Vec3*, SoaPose::kLanes> roots_m;
          std::array<Quat*, SoaPose::kLanes> rotations;
          std::size_t lanes = 0;
          // Items are sorted by length, longest first, so all items before the first one without
          // this pose have it.
          for (; lanes < items.size() && pose < items[lanes].count; ++lanes) {
            AvatarReplica& replica = *batch[items[lanes].tag];
            const auto at = static_cast<std::size_t>(pose);
            roots_m[lanes] = &replica.ahead_roots_m_[at];
            rotations[lanes] = &replica.ahead_rotations_[at * poses.joint_count()];
          }
          poses.GetFirst(std::span(roots_m).first(lanes), std::span(rotations).first(lanes));
        });
    for (AvatarReplica* replica : batch) {
      if (!replica->is_known_) continue;
      replica->is_time_set_ = false;
      const bool are_layers_set = std::exchange(replica->are_layers_set_, false);
      if (!replica->may_have_layers_) continue;
      AvatarBody& body = replica->body_;
      if (!are_layers_set) body.layers.Advance(library, tick.length_s);
      if (!tick.has_poses) continue;
      if (replica->is_moving_ && !body.layers.empty()) {
        const ConstPoseSpan pose = replica->AheadPose();
        body.pose.root_position_m = pose.root_position_m;
        std::ranges::copy(pose.rotations, body.pose.rotations.begin());
      }
      body.ApplyLayers();
      replica->may_have_layers_ = body.has_layers;
    }
  }
}

}  // namespace stridewire
