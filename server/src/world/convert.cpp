#include "world/convert.h"

#include <algorithm>
#include <type_traits>
#include <utility>

namespace stridewire::server {
namespace {

protocol::LegInfo LegToWire(const Leg& leg) {
  return {.hip = static_cast<std::int16_t>(leg.hip),
          .knee = static_cast<std::int16_t>(leg.knee),
          .ankle = static_cast<std::int16_t>(leg.ankle),
          .ball = static_cast<std::int16_t>(leg.ball),
          .ball_offset_m = leg.ball_offset_m,
          .toe_tip_offset_m = leg.toe_tip_offset_m};
}

std::vector<protocol::ParameterValue> ParametersToWire(const ParameterValues& values,
                                                       const MotionGroup& group) {
  std::vector<protocol::ParameterValue> wire;
  const int count =
      std::min({values.count, group.parameter_count(), static_cast<int>(protocol::kMaxParameters)});
  for (int i = 0; i < count; ++i) {
    const auto p = static_cast<std::size_t>(i);
    wire.push_back(
        {.value = values.values[p], .name = static_cast<std::uint8_t>(group.parameters[p].name)});
  }
  return wire;
}

protocol::EventType TypeToWire(AvatarEventType type) {
  switch (type) {
    case AvatarEventType::kStarted: return protocol::EventType::kStarted;
    case AvatarEventType::kFootStrike: return protocol::EventType::kFootStrike;
    case AvatarEventType::kFinished: return protocol::EventType::kFinished;
    case AvatarEventType::kIdle: return protocol::EventType::kIdle;
    case AvatarEventType::kRejected:
    case AvatarEventType::kDropped: return protocol::EventType::kRejected;
  }
  return protocol::EventType::kIdle;
}

// The conversions below cast these enums, so both sides must have the same values.
static_assert(static_cast<int>(MovementKind::kStepLeft) ==
              static_cast<int>(protocol::MovementKind::kStepLeft));
static_assert(static_cast<int>(MovementKind::kStand) ==
              static_cast<int>(protocol::MovementKind::kStand));
static_assert(static_cast<int>(RequestOutcome::kCompleted) ==
              static_cast<int>(protocol::RequestOutcome::kCompleted));
static_assert(static_cast<int>(RequestOutcome::kRemoved) ==
              static_cast<int>(protocol::RequestOutcome::kRemoved));
static_assert(static_cast<int>(Foot::kRight) == static_cast<int>(protocol::FootSide::kRight));
static_assert(kMaxWaypoints == protocol::kMaxWaypoints);
static_assert(kMaxTerrainColumns == protocol::kMaxTerrainColumns &&
              kMaxTerrainRows == protocol::kMaxTerrainColumns &&
              kMaxTerrainBoxes == protocol::kMaxTerrainBoxes);
static_assert(static_cast<int>(ParameterName::kHeight) + 1 == protocol::kParameterNames);

}  // namespace

protocol::SkeletonInfo ToWire(const Skeleton& skeleton) {
  protocol::SkeletonInfo info;
  for (const Joint& joint : skeleton.joints) {
    info.joints.push_back({joint.name, static_cast<std::int16_t>(joint.parent), joint.offset_m});
  }
  for (const EndSite& site : skeleton.end_sites) {
    info.end_sites.push_back({static_cast<std::uint16_t>(site.joint), site.offset_m});
  }
  info.legs = {LegToWire(skeleton.leg(Foot::kLeft)), LegToWire(skeleton.leg(Foot::kRight))};
  return info;
}

protocol::Placement ToWire(const BaseFrame& base) { return {base.position_m, base.heading_rad}; }

BaseFrame FromWire(const protocol::Placement& placement) {
  return {placement.position_m, placement.heading_rad};
}

MovementRequest FromWire(const protocol::RequestItem& item) {
  MovementRequest request;
  request.id = item.request_id;
  request.interrupt = static_cast<Interrupt>(item.interrupt);
  std::visit(
      [&]<typename T>(const T& movement) {
        if constexpr (std::is_same_v<T, protocol::StepMovement>) {
          StepRequest step;
          if (movement.foot == protocol::FootChoice::kLeft) step.foot = Foot::kLeft;
          if (movement.foot == protocol::FootChoice::kRight) step.foot = Foot::kRight;
          step.length_m = movement.length_m;
          step.side_m = movement.side_m;
          step.height_m = movement.height_m;
          step.turn_rad = movement.turn_rad;
          if (movement.at_m) step.at = FootprintRequest{*movement.at_m, movement.heading_rad};
          step.exact_only = movement.exact_only;
          step.allow_nearest = movement.allow_nearest;
          request.movement = step;
        } else if constexpr (std::is_same_v<T, protocol::JumpMovement>) {
          request.movement = JumpRequest{movement.length_m, movement.height_m, movement.turn_rad,
                                         movement.allow_nearest};
        } else if constexpr (std::is_same_v<T, protocol::WalkMovement>) {
          request.movement = WalkRequest{movement.at_m, movement.heading_rad, movement.waypoints_m,
                                         movement.speed_m_s};
        } else {
          request.movement = StandRequest{movement.seconds};
        }
      },
      item.movement);
  return request;
}

protocol::RequestItem ToWire(const MovementRequest& request) {
  protocol::RequestItem item;
  item.request_id = request.id;
  item.interrupt = static_cast<protocol::Interrupt>(request.interrupt);
  std::visit(
      [&]<typename T>(const T& movement) {
        if constexpr (std::is_same_v<T, StepRequest>) {
          protocol::StepMovement step;
          if (movement.foot) {
            step.foot = *movement.foot == Foot::kLeft ? protocol::FootChoice::kLeft
                                                      : protocol::FootChoice::kRight;
          }
          step.length_m = movement.length_m;
          step.side_m = movement.side_m;
          step.height_m = movement.height_m;
          step.turn_rad = movement.turn_rad;
          if (movement.at) {
            step.at_m = movement.at->position_m;
            step.heading_rad = movement.at->heading_rad;
          }
          step.exact_only = movement.exact_only;
          step.allow_nearest = movement.allow_nearest;
          item.movement = step;
        } else if constexpr (std::is_same_v<T, JumpRequest>) {
          item.movement = protocol::JumpMovement{movement.length_m, movement.height_m,
                                                 movement.turn_rad, movement.allow_nearest};
        } else if constexpr (std::is_same_v<T, WalkRequest>) {
          item.movement = protocol::WalkMovement{movement.position_m, movement.heading_rad,
                                                 movement.waypoints_m, movement.speed_m_s};
        } else {
          item.movement = protocol::StandMovement{movement.seconds};
        }
      },
      request.movement);
  return item;
}

protocol::TerrainInfo ToWire(const TerrainData& terrain) {
  protocol::TerrainInfo info;
  if (const auto& field = terrain.height_field) {
    info.height_field = {.origin_m = {field->origin_m.x, field->origin_m.z},
                         .cell_m = field->cell_m,
                         .columns = static_cast<std::uint16_t>(field->columns),
                         .rows = static_cast<std::uint16_t>(field->rows),
                         .heights_m = field->heights_m};
  }
  info.boxes.reserve(terrain.boxes.size());
  for (const TerrainBox& box : terrain.boxes) {
    info.boxes.push_back({{box.min_m.x, box.min_m.z}, {box.max_m.x, box.max_m.z}, box.height_m});
  }
  return info;
}

TerrainData FromWire(protocol::TerrainInfo&& terrain) {
  TerrainData data;
  if (auto& field = terrain.height_field) {
    data.height_field = {.origin_m = {field->origin_m.x, field->origin_m.z},
                         .cell_m = field->cell_m,
                         .columns = field->columns,
                         .rows = field->rows,
                         .heights_m = std::move(field->heights_m)};
  }
  data.boxes.reserve(terrain.boxes.size());
  for (const protocol::TerrainBoxInfo& box : terrain.boxes) {
    data.boxes.push_back({{box.min_m.x, box.min_m.z}, {box.max_m.x, box.max_m.z}, box.height_m});
  }
  return data;
}

protocol::Event ToWire(const AvatarEvent& event, const MotionLibrary& library) {
  protocol::Event wire;
  wire.type = TypeToWire(event.type);
  wire.request_id = event.request_id;
  wire.kind = static_cast<protocol::MovementKind>(event.kind);
  wire.group = static_cast<std::int16_t>(event.group);
  if (event.group >= 0) {
    const MotionGroup& group = library.group(event.group);
    wire.requested = ParametersToWire(event.requested, group);
    wire.applied = ParametersToWire(event.applied, group);
  }
  wire.extrapolated = event.extrapolated;
  wire.clamped = event.clamped;
  wire.cut_short = event.is_cut_short;
  wire.foot = static_cast<protocol::FootSide>(event.foot);
  wire.position_m = DVec3(event.position_m);
  wire.base = ToWire(event.base);
  wire.outcome = static_cast<protocol::RequestOutcome>(event.outcome);
  if (event.type == AvatarEventType::kDropped) {
    wire.code = protocol::StatusCode::kDropped;
    wire.reason = event.reason;
  } else if (event.type == AvatarEventType::kRejected) {
    wire.code = ToStatusCode(event.code);
    wire.reason = DescribeRejection(event);
    if (const auto& missed = event.missed) {
      wire.position_m = missed->nearest.position_m;
      wire.missed_m = missed->distance_m;
      wire.missed_rad = missed->turn_rad;
      wire.nearest = {.length_m = missed->reached.length_m,
                      .side_m = missed->reached.side_m,
                      .height_m = missed->reached.height_m,
                      .turn_rad = missed->reached.turn_rad,
                      .heading_rad = missed->nearest.heading_rad};
    }
  }
  wire.speed_m_s = event.speed_m_s;
  return wire;
}

protocol::StatusCode ToStatusCode(ErrorCode code) {
  using protocol::StatusCode;
  switch (code) {
    case ErrorCode::kInvalidArgument: return StatusCode::kInvalidArgument;
    case ErrorCode::kOutOfRange: return StatusCode::kOutOfRange;
    case ErrorCode::kUnsupported: return StatusCode::kNoMovement;
    case ErrorCode::kLimitExceeded: return StatusCode::kQueueFull;
    default: return StatusCode::kInternal;
  }
}

protocol::StatusCode FrameStatusCode(ErrorCode code) {
  using protocol::StatusCode;
  switch (code) {
    case ErrorCode::kLimitExceeded: return StatusCode::kLimitReached;
    case ErrorCode::kVersionMismatch: return StatusCode::kVersionMismatch;
    case ErrorCode::kUnsupported: return StatusCode::kUnsupported;
    default: return StatusCode::kMalformed;
  }
}

CloseCode CloseCodeOf(protocol::StatusCode code) {
  using protocol::StatusCode;
  switch (code) {
    case StatusCode::kShuttingDown: return CloseCode::kGoingAway;
    case StatusCode::kLimitReached: return CloseCode::kTryAgainLater;
    default: return CloseCode::kPolicy;
  }
}

}  // namespace stridewire::server
