#pragma once

#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Calls `visit(name, value)` for each field that a request uses, with the names of the schema.
/// Omits `must_be_near`, whose member `allow_nearest` is its opposite.
/// `Item` is RequestItem or const RequestItem.
template <typename Item, typename Visit>
void VisitRequest(Item& item, const Visit& visit) {
  const auto visit_change = [&](auto& movement) {
    visit("length_m", movement.length_m);
    if constexpr (requires { movement.side_m; }) visit("side_m", movement.side_m);
    visit("height_m", movement.height_m);
    visit("turn_rad", movement.turn_rad);
  };
  const auto visit_target = [&](auto& target) {
    visit("at_m", target.position_m);
    visit("heading_rad", target.heading_rad);
  };
  visit("avatar", item.avatar);
  visit("request_id", item.request_id);
  const auto type = static_cast<MovementType>(item.movement.index());
  visit("type", type);
  visit("interrupt", item.interrupt);
  if (auto* step = std::get_if<StepMovement>(&item.movement)) {
    visit("foot", step->foot);
    if (step->at) {
      visit_target(*step->at);
    } else {
      visit_change(*step);
    }
    visit("exact_only", step->exact_only);
  } else if (auto* jump = std::get_if<JumpMovement>(&item.movement)) {
    visit_change(*jump);
  } else if (auto* stand = std::get_if<StandMovement>(&item.movement)) {
    visit("seconds", stand->seconds);
  } else if (auto* walk = std::get_if<WalkMovement>(&item.movement)) {
    visit_target(*walk);
    visit("waypoints_m", walk->waypoints_m);
    visit("speed_m_s", walk->speed_m_s);
  }
}

}  // namespace stridewire::protocol
