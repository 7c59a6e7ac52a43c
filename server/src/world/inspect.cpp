#include "world/inspect.h"

#include <algorithm>

#include "world/convert.h"

namespace stridewire::server {
namespace {

protocol::CurrentMovement CurrentMovementOf(const AvatarSimulation& avatar,
                                            const AvatarEvent& started,
                                            std::size_t max_site_bytes) {
  const protocol::Event event = ToWire(started, avatar.library());
  protocol::CurrentMovement current{.request_id = event.request_id,
                                    .kind = event.kind,
                                    .group = event.group,
                                    .started_s = started.time_s,
                                    .requested = event.requested,
                                    .applied = event.applied,
                                    .extrapolated = event.extrapolated,
                                    .clamped = event.clamped};
  const Movement* movement = avatar.movement();
  if (movement == nullptr) return current;  // A requested stand has no Movement.
  current.keytimes_s = movement->warp.Keytimes();
  current.generic_time = std::clamp(movement->warp.GenericTimeAt(avatar.movement_time_s()), 0.0,
                                    static_cast<double>(movement->warp.interval_count()));
  current.ease_out_s = movement->ease_out_s;
  const std::size_t weight_count = std::min(movement->weights.size(), protocol::kMaxWeights);
  current.weights.assign(movement->weights.begin(),
                         movement->weights.begin() + static_cast<std::ptrdiff_t>(weight_count));
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const FootTrajectory& trajectory = movement->feet.foot(foot);
    if (!movement->feet.is_active || trajectory.land_s == FootTrajectory::kNever ||
        avatar.movement_time_s() >= trajectory.land_s) {
      continue;
    }
    current.landings.push_back(
        {trajectory.to.position_m, trajectory.to.heading_rad,
         foot == Foot::kLeft ? protocol::FootSide::kLeft : protocol::FootSide::kRight});
  }
  const MotionGroup& group = avatar.library().group(movement->group);
  const std::size_t parameter_count = std::min(group.parameters.size(), protocol::kMaxParameters);
  for (std::size_t p = 0; p < parameter_count; ++p) {
    current.parameter_names.push_back(static_cast<std::uint8_t>(group.parameters[p].name));
  }
  if (weight_count * parameter_count * sizeof(float) > max_site_bytes) return current;
  current.sites.reserve(weight_count * parameter_count);
  for (std::size_t row = 0; row < weight_count; ++row) {
    for (const double value : group.row_parameters(static_cast<int>(row)).first(parameter_count)) {
      current.sites.push_back(static_cast<float>(value));
    }
  }
  return current;
}

}  // namespace

protocol::AvatarState Inspect(const AvatarSimulation& avatar, std::size_t max_site_bytes) {
  protocol::AvatarState state;
  state.base = ToWire(avatar.base());
  if (const AvatarEvent* started = avatar.started()) {
    state.movement = CurrentMovementOf(avatar, *started, max_site_bytes);
  }
  state.planting_enabled = avatar.foot_planting();
  for (const LayerStack::Playing& playing : avatar.layers().playing()) {
    state.layers.push_back(
        {.layer =
             std::string(avatar.library().layers()[static_cast<std::size_t>(playing.layer)].name),
         .weight = playing.weight,
         .time_s = playing.time_s,
         .speed = playing.speed,
         .is_ending = playing.is_ending});
  }
  const std::span<const MovementRequest> queue = avatar.queue();
  state.queue_size = static_cast<std::uint32_t>(queue.size());
  for (const MovementRequest& request :
       queue.first(std::min(queue.size(), protocol::kMaxInspectedRequests))) {
    state.queue.push_back(ToWire(request));
  }
  return state;
}

}  // namespace stridewire::server
