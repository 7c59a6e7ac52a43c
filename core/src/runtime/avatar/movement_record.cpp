#include "runtime/avatar/movement_record.h"

#include <bit>
#include <cstring>

#include "base/check.h"
#include "runtime/avatar/record_fields.h"

namespace stridewire {
namespace {

static_assert(std::endian::native == std::endian::little);

class RecordWriter {
 public:
  explicit RecordWriter(std::vector<std::byte>& out) : out_(out) {}
  void F64(double value) { Add(&value, sizeof value); }
  void F32(float value) { Add(&value, sizeof value); }
  void Flags(unsigned flags) {
    const auto value = static_cast<std::uint16_t>(flags);
    Add(&value, sizeof value);
  }
  void Index(int value) {
    STRIDEWIRE_CHECK(value >= 0 && value < 256);
    out_.push_back(static_cast<std::byte>(value));
  }
  void Bool(bool value) { out_.push_back(static_cast<std::byte>(value)); }
  template <typename Unit>
  void CheckUnit(const Unit&) {}

 private:
  void Add(const void* value, std::size_t bytes) {
    const auto* data = static_cast<const std::byte*>(value);
    out_.insert(out_.end(), data, data + bytes);
  }
  std::vector<std::byte>& out_;
};

unsigned CommonFlags(const AvatarSimulation& avatar) {
  return (avatar.idle() ? unsigned{record::kIsIdle} : 0u) |
         (avatar.body().plants_feet ? unsigned{record::kPlants} : 0u);
}

void WriteLayers(const LayerStack& layers, RecordWriter& writer) {
  writer.Index(static_cast<int>(layers.playing().size()));
  for (const LayerStack::Playing& playing : layers.playing()) record::LayerFields(writer, playing);
}

void WriteWeights(const Movement& movement, RecordWriter& writer) {
  writer.Index(movement.group);
  for (const float weight : movement.weights) writer.F32(weight);
}

void WriteBegun(const AvatarSimulation& avatar, unsigned flags, const LandingDecision& decision,
                RecordWriter& writer) {
  const AvatarBody& body = avatar.body();
  const Movement& movement = body.movement;
  writer.F64(avatar.movement_time_s());
  WriteWeights(movement, writer);
  writer.F64(movement.base.heading_rad);
  if ((flags & record::kHasRate) != 0) writer.F64(movement.rate);
  if ((flags & record::kIsEntered) != 0) writer.F64(movement.start_offset_s);
  if (body.plants_feet) {
    record::DecisionFields(writer, flags, body.group().kind, decision);
  } else {
    record::Vector(writer, movement.base.position_m);
  }
}

}  // namespace

bool AppendChange(const AvatarSimulation& avatar, std::vector<std::byte>& out) {
  const AvatarChange& change = avatar.change();
  if (change.needs_state) {
    AppendState(avatar, out);
    return true;
  }
  const bool is_any =
      change.has_left || change.has_begun || change.has_layers || change.idle_changed;
  if (!is_any) return false;

  const AvatarBody& body = avatar.body();
  unsigned flags = CommonFlags(avatar);
  if (change.has_layers) flags |= record::kLayers;
  LandingDecision decision;
  if (change.has_left) {
    flags |= record::kLeft;
    if (change.is_left_at_end) flags |= record::kLeftAtEnd;
    if (change.is_redirected) flags |= record::kIsRedirected;
    if (change.left_keeps_speed) flags |= record::kLeftKeepsSpeed;
  }
  if (change.has_begun) {
    flags |= record::kMoves;
    if (change.begun_keeps_speed) flags |= record::kKeepsSpeed;
    if (body.movement.rate != 1.0) flags |= record::kHasRate;
    if (body.movement.start_offset_s != 0.0) flags |= record::kIsEntered;
    if (body.plants_feet) {
      decision = DecisionOf(body.group().kind, body.movement);
      if (decision.extra_turn_rad != 0.0) flags |= record::kIsSteered;
      if (decision.is_on_terrain) flags |= record::kOnTerrain;
      if (decision.mid_swing_offset_m != DVec3(0.0)) flags |= record::kMidSwingOffset;
      if (decision.root_shift_m != DVec3(0.0)) flags |= record::kRootShift;
    }
  }
  RecordWriter writer(out);
  writer.Flags(flags);
  STRIDEWIRE_CHECK(!change.has_begun || avatar.displayed_movement() != nullptr);
  if (change.has_left && !change.is_left_at_end) writer.F64(change.left_s);
  if (change.has_begun) WriteBegun(avatar, flags, decision, writer);
  if (change.has_layers) WriteLayers(body.layers, writer);
  return true;
}

void AppendState(const AvatarSimulation& avatar, std::vector<std::byte>& out) {
  const AvatarBody& body = avatar.body();
  const bool is_moving = avatar.displayed_movement() != nullptr;
  unsigned flags = CommonFlags(avatar) | record::kIsState;
  if (is_moving) flags |= record::kMoves;
  if (!body.layers.empty()) flags |= record::kLayers;
  if (!is_moving && avatar.keeps_speed()) flags |= record::kKeepsSpeed;
  if (!is_moving && body.begins_planting) flags |= record::kBeginsPlanting;
  RecordWriter writer(out);
  writer.Flags(flags);
  if (body.plants_feet) record::FootLockFields(writer, body.locks);
  if (is_moving) {
    const Movement& movement = body.movement;
    writer.F64(avatar.movement_time_s());
    WriteWeights(movement, writer);
    record::Vector(writer, movement.base.position_m);
    writer.F64(movement.base.heading_rad);
    writer.F64(movement.rate);
    writer.F64(movement.start_offset_s);
    writer.F64(movement.extra_turn_rad);
    if (record::NeedsDifference(movement, avatar.movement_time_s())) {
      record::DifferenceFields(writer, movement);
    }
    if (movement.feet.is_active) record::PlanFields(writer, movement.feet);
  } else {
    record::PoseFields(writer, body.pose);
    record::PoseFields(writer, body.blended_pose);
    record::CorrectionFields(writer, body.earlier_feet[0]);
    if (avatar.keeps_speed()) {
      record::PoseFields(writer, body.earlier_pose);
      record::CorrectionFields(writer, body.earlier_feet[1]);
    }
  }
  if (!body.layers.empty()) WriteLayers(body.layers, writer);
}

std::size_t MaxRecordBytes(const MotionLibrary& library) {
  // The plan, foot locks, corrections and four layers take about 1,700 bytes. A record contains at
  // most three poses of 16 bytes per joint, or one pose and its velocity.
  return 2000 + 48 * static_cast<std::size_t>(library.skeleton().joint_count()) +
         4 * static_cast<std::size_t>(library.max_row_count());
}

}  // namespace stridewire
