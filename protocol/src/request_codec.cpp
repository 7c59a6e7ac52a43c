#include <concepts>
#include <optional>

#include "codec_support.h"
#include "request_fields.h"

/// Encodes, decodes and checks what the schema's attributes cannot express: requested movements,
/// whose type determines the used fields; sets of parameters; and lists of movement records.
namespace stridewire::protocol {

namespace {

constexpr Bounds kWaypoints = {0, kMaxWaypoints, "expected at most 64 entries"};

void CheckValue(Findings& found, const FieldPath& at, std::unsigned_integral auto id) {
  found.NonZero(id, at);
}
void CheckValue(Findings&, const FieldPath&, bool) {}
void CheckValue(Findings& found, const FieldPath& at, double value) { found.Finite(value, at); }
void CheckValue(Findings& found, const FieldPath& at, const std::optional<double>& value) {
  found.Finite(value.value_or(0.0), at);
}
void CheckValue(Findings& found, const FieldPath& at, const DVec3& value) {
  CheckFields(found, at, value);
}
void CheckValue(Findings& found, const FieldPath& at, const std::vector<DVec3>& waypoints_m) {
  CheckList(found, waypoints_m, kWaypoints, at);
}
template <typename E>
  requires std::is_enum_v<E>
void CheckValue(Findings& found, const FieldPath& at, E value) {
  found.Known(value, std::is_same_v<E, MovementType> ? 3 : 2, at, "expected a number from 0 to 2");
}

}  // namespace

void CheckFields(Findings& found, const FieldPath& at, const RequestItem& m) {
  VisitRequest(
      m, [&](const char* name, const auto& value) { CheckValue(found, At(at, name), value); });
  const auto* step = std::get_if<StepMovement>(&m.movement);
  found.That(step == nullptr || !step->exact_only || !step->allow_nearest, ErrorCode::kMalformed,
             "exact_only excludes allow_nearest", At(at, "exact_only"));
}

void Unpack(Unpacker& u, const FieldPath& at, const wire::RequestItem& w, RequestItem& m) {
  m.avatar = w.avatar();
  m.request_id = w.request_id();
  m.interrupt = static_cast<Interrupt>(w.interrupt());
  switch (w.type()) {
    case wire::MovementType::Step: {
      StepMovement step{.foot = static_cast<FootChoice>(w.foot()),
                        .exact_only = w.exact_only(),
                        .allow_nearest = !w.exact_only() && !w.must_be_near()};
      if (const wire::Vec3* place = w.at_m()) {
        Unpack(u, at, *place, step.at.emplace().position_m);
        step.at->heading_rad = w.heading_rad();
      } else {
        step.length_m = w.length_m();
        step.side_m = w.side_m();
        step.height_m = w.height_m();
        step.turn_rad = w.turn_rad();
      }
      m.movement = step;
      break;
    }
    case wire::MovementType::Jump:
      m.movement = JumpMovement{w.length_m(), w.height_m(), w.turn_rad(), !w.must_be_near()};
      break;
    case wire::MovementType::Stand: m.movement = StandMovement{w.seconds()}; break;
    case wire::MovementType::Walk: {
      if (w.at_m() == nullptr || !w.heading_rad()) {
        u.Wrong(ErrorCode::kMalformed, "a walk requires at_m and heading_rad", At(at, "type"));
        break;
      }
      WalkMovement walk{.heading_rad = *w.heading_rad(), .speed_m_s = w.speed_m_s()};
      Unpack(u, at, *w.at_m(), walk.position_m);
      UnpackList(u, w.waypoints_m(), kWaypoints, At(at, "waypoints_m"), walk.waypoints_m);
      m.movement = std::move(walk);
      break;
    }
    default: u.Known(w.type(), 3, At(at, "type"), "expected a number from 0 to 3");
  }
}

// flatbuffers::Optional is std::optional.
Offset<wire::RequestItem> Build(FlatBufferBuilder& b, const RequestItem& m) {
  const auto* step = std::get_if<StepMovement>(&m.movement);
  const auto* jump = std::get_if<JumpMovement>(&m.movement);
  const auto* stand = std::get_if<StandMovement>(&m.movement);
  const auto* walk = std::get_if<WalkMovement>(&m.movement);
  const auto foot = step ? step->foot : FootChoice::kAuto;
  const bool is_placed = step && step->at;
  // exact_only includes must_be_near.
  const bool must_be_near = step   ? !step->exact_only && !step->allow_nearest
                            : jump ? !jump->allow_nearest
                                   : false;
  double length_m = 0.0, height_m = 0.0, turn_rad = 0.0;
  std::optional<double> side_m, heading_rad;
  std::optional<wire::Vec3> at;
  Offset<flatbuffers::Vector<const wire::Vec3*>> waypoints;
  if (is_placed) {
    at = ToWire(step->at->position_m);
    heading_rad = step->at->heading_rad;
  } else if (step) {
    length_m = step->length_m;
    side_m = step->side_m;
    height_m = step->height_m;
    turn_rad = step->turn_rad;
  } else if (jump) {
    length_m = jump->length_m;
    height_m = jump->height_m;
    turn_rad = jump->turn_rad;
  } else if (walk) {
    waypoints = StructList(b, walk->waypoints_m, false);
    at = ToWire(walk->position_m);
    heading_rad = walk->heading_rad;
  }
  return wire::CreateRequestItem(
      b, m.avatar, m.request_id, static_cast<wire::MovementType>(m.movement.index()),
      static_cast<wire::FootChoice>(foot), length_m, side_m, height_m, turn_rad,
      stand ? stand->seconds : 0.0, at ? &*at : nullptr, heading_rad, waypoints,
      walk ? walk->speed_m_s : std::nullopt, static_cast<wire::Interrupt>(m.interrupt),
      step && step->exact_only, must_be_near);
}

// ---- sets of parameters

void CheckList(Findings& found, const ParameterSet& set, const Bounds& bounds,
               const FieldPath& at) {
  found.Count(set.count, bounds, at);
  unsigned seen = 0;
  for (std::size_t p = 0; p < set.count && found.ok(); ++p) {
    found.Known(set.names[p], kParameterNames - 1, at, "expected a parameter name from 0 to 8");
    if (!found.ok()) return;
    const unsigned bit = 1u << set.names[p];
    found.That((seen & bit) == 0, ErrorCode::kMalformed, "a parameter occurs twice", at);
    seen |= bit;
    found.Finite(set.values[p], at);
  }
}

void UnpackList(Unpacker& u, const WireParameters* list, const Bounds& bounds, const FieldPath& at,
                ParameterSet& out) {
  out.count = static_cast<std::uint8_t>(u.CountOf(list, bounds, at));
  for (std::size_t p = 0; p < out.count; ++p) {
    const auto* value = list->Get(static_cast<flatbuffers::uoffset_t>(p));
    out.names[p] = value->name();
    out.values[p] = value->value();
  }
}

Offset<WireParameters> StructList(FlatBufferBuilder& b, const ParameterSet& set, bool) {
  if (set.count == 0) return {};
  std::array<wire::ParameterValue, kMaxParameters> values;
  for (std::size_t p = 0; p < set.count; ++p) {
    values[p] = wire::ParameterValue(set.values[p], set.names[p]);
  }
  return b.CreateVectorOfStructs(values.data(), set.count);
}

// ---- movement records

Offset<wire::Movements> Build(FlatBufferBuilder& b, const Movements& m) {
  // Most steps of a small crowd have no changes, and then all lists are omitted. Otherwise the
  // records are written even if they are empty, because all avatars are gone.
  const auto records = ScalarList(b, m.records, !m.avatars.empty());
  const auto ends = ScalarList(b, m.ends, false);
  const auto flags = ScalarList(b, m.flags, false);
  const auto avatars = ScalarList(b, m.avatars, false);
  return wire::CreateMovements(b, m.world, m.shard, m.part, m.parts, m.more_steps, m.step, m.tick,
                               m.server_time_s, m.states, avatars, flags, ends, records);
}

}  // namespace stridewire::protocol
