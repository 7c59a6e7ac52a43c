// The C ABI: checks what callers give, takes the lock, and asks the session.

#include "stridewire/client.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <limits>
#include <memory>
#include <mutex>
#include <new>
#include <random>
#include <string>
#include <system_error>
#include <utility>

#include "network_thread.h"
#include "session.h"
#include "stridewire/protocol/check.h"

using stridewire::DVec3;
using stridewire::Quat;
using stridewire::Vec3;
using stridewire::client::NetworkThread;
using stridewire::client::PoseHistory;
using stridewire::client::PoseStamp;
using stridewire::client::Session;
using stridewire::client::SessionOptions;
using stridewire::client::WorldView;
namespace protocol = stridewire::protocol;

struct stridewire_client {
  explicit stridewire_client(const SessionOptions& options)
      : session(options), network(mutex, changed, session) {}

  std::mutex mutex;
  std::condition_variable changed;
  Session session;
  NetworkThread network;
};

namespace {

constexpr std::size_t kMaxHostBytes = 255;

bool InRange(double value, double least, double most) {  // False for what is not a number.
  return value >= least && value <= most;
}

template <typename T>
bool InRange(T value, T least, T most) {
  return value >= least && value <= most;
}

/// Runs `call` on the session under the lock, and lets the network thread see what came of it. The
/// one place where running out of memory is caught.
template <typename Call>
stridewire_status Command(stridewire_client* client, const Call& call) {
  if (client == nullptr) return STRIDEWIRE_INVALID_ARGUMENT;
  try {
    stridewire_status status;
    {
      const std::lock_guard lock(client->mutex);
      status = call(client->session);
    }
    client->network.Wake();
    return status;
  } catch (const std::bad_alloc&) {
    return STRIDEWIRE_OUT_OF_MEMORY;
  }
}

template <typename Call>
stridewire_status Query(stridewire_client* client, const Call& call) {
  if (client == nullptr) return STRIDEWIRE_INVALID_ARGUMENT;
  try {
    const std::lock_guard lock(client->mutex);
    return call(client->session);
  } catch (const std::bad_alloc&) {
    return STRIDEWIRE_OUT_OF_MEMORY;
  }
}

bool IsList(const void* items, std::size_t count) {
  return items != nullptr && count >= 1 && count <= STRIDEWIRE_MAX_ITEMS;
}

void StoreCommand(std::uint64_t* out, std::uint64_t command) {
  if (out != nullptr) *out = command;
}

void CopyName(const std::string& name, char (&out)[STRIDEWIRE_MAX_NAME_BYTES + 1]) {
  const std::size_t length = std::min(name.size(), sizeof out - 1);
  std::memcpy(out, name.data(), length);
  out[length] = '\0';
}

void CopyVector(const Vec3& v, float (&out)[3]) {
  out[0] = v.x;
  out[1] = v.y;
  out[2] = v.z;
}

stridewire_leg ToLeg(const protocol::LegInfo& info) {
  stridewire_leg leg{};
  leg.hip = info.hip;
  leg.knee = info.knee;
  leg.ankle = info.ankle;
  leg.ball = info.ball;
  CopyVector(info.ball_offset_m, leg.ball_offset_m);
  CopyVector(info.toe_tip_offset_m, leg.toe_tip_offset_m);
  return leg;
}

void WriteRotations(std::span<const Quat> rotations, float* out) {
  for (const Quat& q : rotations) {
    *out++ = q.x;
    *out++ = q.y;
    *out++ = q.z;
    *out++ = q.w;
  }
}

/// Finds the history a pose is asked from; kind stays MISSING when there is none.
template <typename Write>
stridewire_status ReadPose(stridewire_client* client, stridewire_world world, std::uint32_t avatar,
                           stridewire_pose* pose, const float* rotations_xyzw,
                           std::size_t joint_capacity, const Write& write) {
  if (pose == nullptr || (rotations_xyzw == nullptr && joint_capacity > 0)) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  *pose = stridewire_pose{};
  return Query(client, [&](Session& session) {
    const WorldView* view = session.FindWorld(world);
    if (view == nullptr) return STRIDEWIRE_NO_SUCH_WORLD;
    const PoseHistory* history = view->Find(avatar);
    if (history == nullptr || history->size() == 0) return STRIDEWIRE_OK;
    if (joint_capacity < history->joint_count()) {
      pose->joint_count = static_cast<std::uint32_t>(history->joint_count());
      return STRIDEWIRE_BUFFER_TOO_SMALL;
    }
    write(*view, *history);
    if (pose->kind != STRIDEWIRE_POSE_MISSING) {
      pose->joint_count = static_cast<std::uint32_t>(history->joint_count());
    }
    return STRIDEWIRE_OK;
  });
}

void WriteRaw(const PoseHistory& history, std::size_t index, stridewire_pose* pose,
              float* rotations_xyzw) {
  const PoseStamp& stamp = history.stamp(index);
  pose->kind = STRIDEWIRE_POSE_RAW;
  pose->tick = stamp.tick;
  pose->time_s = stamp.time_s;
  pose->discontinuity = stamp.discontinuity ? 1 : 0;
  pose->standing = stamp.standing ? 1 : 0;
  pose->detail = static_cast<std::uint8_t>(stamp.detail);
  CopyVector(history.root_position_m(index), pose->root_position_m);
  WriteRotations(history.rotations(index), rotations_xyzw);
}

}  // namespace

extern "C" {

void stridewire_client_options_init(stridewire_client_options* options, size_t struct_bytes) {
  if (options == nullptr || struct_bytes != sizeof *options) return;
  const SessionOptions defaults;
  *options = stridewire_client_options{};
  options->struct_bytes = sizeof *options;
  options->abi_version = STRIDEWIRE_ABI_VERSION;
  options->max_events = static_cast<std::uint32_t>(defaults.max_events);
  options->max_commands = static_cast<std::uint32_t>(defaults.max_commands);
  options->pose_history = static_cast<std::uint32_t>(defaults.pose_history);
  options->max_command_bytes = defaults.max_command_bytes;
  options->max_pose_bytes = defaults.max_pose_bytes;
  options->render_delay_s = defaults.render_delay_s;
  options->connect_timeout_s = defaults.connect_timeout_s;
  options->ping_interval_s = defaults.ping_interval_s;
  options->client_name = "stridewire-client";
}

stridewire_status stridewire_client_create(const stridewire_client_options* options,
                                           stridewire_client** client) {
  if (client == nullptr) return STRIDEWIRE_INVALID_ARGUMENT;
  *client = nullptr;
  stridewire_client_options o;
  if (options == nullptr) {
    stridewire_client_options_init(&o, sizeof o);
  } else {
    if (options->struct_bytes != sizeof o || options->abi_version != STRIDEWIRE_ABI_VERSION) {
      return STRIDEWIRE_VERSION_MISMATCH;
    }
    o = *options;
  }
  constexpr std::size_t kLeastBytes = std::size_t{64} << 10;
  if (!InRange<std::uint32_t>(o.max_events, 16, 1u << 24) ||
      !InRange<std::uint32_t>(o.max_commands, 1, 1u << 20) ||
      !InRange<std::uint32_t>(o.pose_history, 2, 4096) || o.max_command_bytes < kLeastBytes ||
      o.max_pose_bytes < kLeastBytes || !InRange(o.render_delay_s, 0.0, 10.0) ||
      !InRange(o.connect_timeout_s, 0.01, 600.0) || !InRange(o.ping_interval_s, 0.01, 600.0)) {
    return STRIDEWIRE_OUT_OF_RANGE;
  }
  try {
    SessionOptions s;
    protocol::Hello hello;  // What the server would refuse is refused here.
    hello.client_name = o.client_name != nullptr ? o.client_name : "";
    hello.auth_token = o.auth_token != nullptr ? o.auth_token : "";
    if (!protocol::Check(hello)) return STRIDEWIRE_INVALID_ARGUMENT;
    s.client_name = hello.client_name;
    s.auth_token = hello.auth_token;
    s.max_events = o.max_events;
    s.max_commands = o.max_commands;
    s.max_command_bytes = o.max_command_bytes;
    s.pose_history = o.pose_history;
    s.max_pose_bytes = o.max_pose_bytes;
    s.render_delay_s = o.render_delay_s;
    s.connect_timeout_s = o.connect_timeout_s;
    s.ping_interval_s = o.ping_interval_s;
    s.respawn = o.respawn != 0;
    constexpr std::size_t kMaxFolderBytes = 4096;
    s.library_folder = o.library_folder != nullptr ? o.library_folder : "";
    if (s.library_folder.size() > kMaxFolderBytes) return STRIDEWIRE_INVALID_ARGUMENT;
    s.seed = o.seed;
    if (s.seed == 0) {
      std::random_device device;
      s.seed = (std::uint64_t{device()} << 32) | device();
    }
    *client = new stridewire_client(s);
    return STRIDEWIRE_OK;
  } catch (const std::bad_alloc&) {
    return STRIDEWIRE_OUT_OF_MEMORY;
  } catch (const std::exception&) {  // No thread, no file descriptor.
    return STRIDEWIRE_OUT_OF_MEMORY;
  }
}

void stridewire_client_destroy(stridewire_client* client) {
  if (client == nullptr) return;
  (void)stridewire_client_disconnect(client);
  {
    std::unique_lock lock(client->mutex);
    client->changed.wait_for(lock, std::chrono::duration<double>(2.0 * Session::kGoodbye_s),
                             [&] { return client->session.state() != Session::State::kClosing; });
  }
  delete client;
}

stridewire_status stridewire_client_connect(stridewire_client* client, const char* host,
                                            uint16_t port) {
  if (host == nullptr || *host == '\0' || std::strlen(host) > kMaxHostBytes || port == 0) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  return Command(client, [&](Session& session) {
    const stridewire_status status = session.Open(client->network.Now());
    if (status == STRIDEWIRE_OK) client->network.SetTarget(host, port);
    return status;
  });
}

stridewire_status stridewire_client_disconnect(stridewire_client* client) {
  return Command(client, [&](Session& session) {
    session.Close(client->network.Now());
    return STRIDEWIRE_OK;
  });
}

stridewire_client_state stridewire_client_get_state(stridewire_client* client) {
  if (client == nullptr) return STRIDEWIRE_STATE_IDLE;
  const std::lock_guard lock(client->mutex);
  switch (client->session.state()) {
    case Session::State::kIdle:
    case Session::State::kClosing: return STRIDEWIRE_STATE_IDLE;
    case Session::State::kWaiting:
    case Session::State::kConnecting:
    case Session::State::kGreeting: return STRIDEWIRE_STATE_CONNECTING;
    case Session::State::kReady: return STRIDEWIRE_STATE_READY;
    case Session::State::kClosed: return STRIDEWIRE_STATE_CLOSED;
  }
  return STRIDEWIRE_STATE_IDLE;
}

stridewire_status stridewire_client_last_error(stridewire_client* client, char* text,
                                               size_t text_bytes) {
  if (text == nullptr && text_bytes > 0) return STRIDEWIRE_INVALID_ARGUMENT;
  return Query(client, [&](Session& session) {
    if (text_bytes > 0) {
      const std::string& last = session.last_text();
      const std::size_t length = std::min(last.size(), text_bytes - 1);
      std::memcpy(text, last.data(), length);
      text[length] = '\0';
    }
    return session.last_status();
  });
}

stridewire_status stridewire_client_join_world(stridewire_client* client, const char* name,
                                               stridewire_role role, stridewire_world* world,
                                               uint64_t* command) {
  if (name == nullptr || world == nullptr ||
      (role != STRIDEWIRE_CONTROLLER && role != STRIDEWIRE_OBSERVER)) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  return Command(client, [&](Session& session) {
    std::uint64_t id = 0;
    const auto status = session.JoinWorld(
        name,
        role == STRIDEWIRE_CONTROLLER ? protocol::Role::kController : protocol::Role::kObserver,
        *world, id);
    StoreCommand(command, id);
    return status;
  });
}

stridewire_status stridewire_client_leave_world(stridewire_client* client, stridewire_world world,
                                                uint64_t* command) {
  return Command(client, [&](Session& session) {
    std::uint64_t id = 0;
    const auto status = session.LeaveWorld(world, id);
    StoreCommand(command, id);
    return status;
  });
}

stridewire_status stridewire_client_spawn(stridewire_client* client, stridewire_world world,
                                          const stridewire_spawn* spawns, size_t count,
                                          uint64_t* command) {
  if (!IsList(spawns, count)) return STRIDEWIRE_INVALID_ARGUMENT;
  return Command(client, [&](Session& session) {
    protocol::Spawn message;
    message.items.reserve(count);
    for (const stridewire_spawn& s : std::span(spawns, count)) {
      message.items.push_back(
          {s.avatar, {DVec3(s.position_m[0], s.position_m[1], s.position_m[2]), s.heading_rad}});
    }
    std::uint64_t id = 0;
    const auto status = session.Spawn(world, std::move(message), id);
    StoreCommand(command, id);
    return status;
  });
}

stridewire_status stridewire_client_remove(stridewire_client* client, stridewire_world world,
                                           const uint32_t* avatars, size_t count,
                                           uint64_t* command) {
  if (!IsList(avatars, count)) return STRIDEWIRE_INVALID_ARGUMENT;
  return Command(client, [&](Session& session) {
    std::uint64_t id = 0;
    const auto status = session.Remove(world, {0, 0, {avatars, avatars + count}}, id);
    StoreCommand(command, id);
    return status;
  });
}

stridewire_status stridewire_client_request(stridewire_client* client, stridewire_world world,
                                            const stridewire_movement* movements, size_t count,
                                            uint64_t* command) {
  if (!IsList(movements, count)) return STRIDEWIRE_INVALID_ARGUMENT;
  for (const stridewire_movement& m : std::span(movements, count)) {
    if (m.type < STRIDEWIRE_STEP || m.type > STRIDEWIRE_WALK || m.foot < STRIDEWIRE_FOOT_AUTO ||
        m.foot > STRIDEWIRE_FOOT_RIGHT || m.interrupt < STRIDEWIRE_QUEUED ||
        m.interrupt > STRIDEWIRE_NOW || m.waypoint_count > STRIDEWIRE_MAX_WAYPOINTS ||
        (m.type == STRIDEWIRE_WALK && m.waypoint_count != 0 && m.waypoints_m == nullptr) ||
        (m.exact_only != 0 && (m.type != STRIDEWIRE_STEP || m.has_at == 0))) {
      return STRIDEWIRE_INVALID_ARGUMENT;
    }
  }
  return Command(client, [&](Session& session) {
    protocol::Request message;
    message.items.reserve(count);
    for (const stridewire_movement& m : std::span(movements, count)) {
      protocol::RequestItem item{
          m.avatar, m.request_id, {}, static_cast<protocol::Interrupt>(m.interrupt)};
      switch (m.type) {
        case STRIDEWIRE_STEP: {
          protocol::StepMovement step;
          step.foot = static_cast<protocol::FootChoice>(m.foot);
          if (m.has_at != 0) {
            step.at.emplace().position_m = DVec3(m.at_m[0], m.at_m[1], m.at_m[2]);
            if (m.has_heading != 0) step.at->heading_rad = m.heading_rad;
            step.exact_only = m.exact_only != 0;
            item.movement = step;
            break;
          }
          step.length_m = m.length_m;
          if (m.has_side != 0) step.side_m = m.side_m;
          step.height_m = m.height_m;
          step.turn_rad = m.turn_rad;
          item.movement = step;
          break;
        }
        case STRIDEWIRE_JUMP:
          item.movement = protocol::JumpMovement{m.length_m, m.height_m, m.turn_rad};
          break;
        case STRIDEWIRE_MOVEMENT_TYPE_MAX: break;  // Refused above.
        case STRIDEWIRE_STAND: item.movement = protocol::StandMovement{m.seconds}; break;
        case STRIDEWIRE_WALK: {
          protocol::WalkMovement walk;
          walk.position_m = DVec3(m.at_m[0], m.at_m[1], m.at_m[2]);
          walk.heading_rad = m.heading_rad;
          for (std::size_t w = 0; w < m.waypoint_count; ++w) {
            const double* place = m.waypoints_m + 3 * w;
            walk.waypoints_m.emplace_back(place[0], place[1], place[2]);
          }
          if (m.has_speed != 0) walk.speed_m_s = m.speed_m_s;
          item.movement = std::move(walk);
          break;
        }
      }
      message.items.push_back(item);
    }
    std::uint64_t id = 0;
    const auto status = session.Request(world, std::move(message), id);
    StoreCommand(command, id);
    return status;
  });
}

stridewire_status stridewire_client_cancel(stridewire_client* client, stridewire_world world,
                                           const uint32_t* avatars, size_t count,
                                           uint64_t* command) {
  if (!IsList(avatars, count)) return STRIDEWIRE_INVALID_ARGUMENT;
  return Command(client, [&](Session& session) {
    std::uint64_t id = 0;
    const auto status = session.Cancel(world, {0, 0, {avatars, avatars + count}}, id);
    StoreCommand(command, id);
    return status;
  });
}

stridewire_status stridewire_client_set_terrain(stridewire_client* client, stridewire_world world,
                                                const stridewire_height_field* height_field,
                                                const stridewire_terrain_box* boxes,
                                                size_t box_count, uint64_t* command) {
  if ((boxes == nullptr && box_count > 0) || box_count > STRIDEWIRE_MAX_TERRAIN_BOXES) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  if (height_field != nullptr &&
      (height_field->heights_m == nullptr ||
       !InRange(height_field->columns, 2u, std::uint32_t{STRIDEWIRE_MAX_TERRAIN_COLUMNS}) ||
       !InRange(height_field->rows, 2u, std::uint32_t{STRIDEWIRE_MAX_TERRAIN_COLUMNS}))) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  return Command(client, [&](Session& session) {
    protocol::SetTerrain message;
    if (height_field != nullptr) {
      const std::size_t count = std::size_t{height_field->columns} * height_field->rows;
      message.terrain.emplace().height_field =
          protocol::HeightFieldInfo{{height_field->origin_m[0], height_field->origin_m[1]},
                                    height_field->cell_m,
                                    static_cast<std::uint16_t>(height_field->columns),
                                    static_cast<std::uint16_t>(height_field->rows),
                                    {height_field->heights_m, height_field->heights_m + count}};
    }
    if (box_count > 0) {
      if (!message.terrain) message.terrain.emplace();
      message.terrain->boxes.reserve(box_count);
      for (const stridewire_terrain_box& box : std::span(boxes, box_count)) {
        message.terrain->boxes.push_back(
            {{box.min_m[0], box.min_m[1]}, {box.max_m[0], box.max_m[1]}, box.height_m});
      }
    }
    std::uint64_t id = 0;
    const auto status = session.SetTerrain(world, std::move(message), id);
    StoreCommand(command, id);
    return status;
  });
}

stridewire_status stridewire_client_set_layers(stridewire_client* client, stridewire_world world,
                                               const stridewire_layer* layers, size_t count,
                                               uint64_t* command) {
  if (!IsList(layers, count)) return STRIDEWIRE_INVALID_ARGUMENT;
  for (const stridewire_layer& layer : std::span(layers, count)) {
    if (layer.name == nullptr) return STRIDEWIRE_INVALID_ARGUMENT;
  }
  return Command(client, [&](Session& session) {
    protocol::SetLayers message;
    message.items.reserve(count);
    for (const stridewire_layer& l : std::span(layers, count)) {
      // One byte more than a name may have: a longer one is refused without being copied.
      message.items.push_back({.avatar = l.avatar,
                               .layer = {l.name, strnlen(l.name, protocol::kMaxNameBytes + 1)},
                               .is_off = l.off != 0,
                               .weight = l.weight,
                               .blend_s = l.blend_s,
                               .speed = l.speed});
    }
    std::uint64_t id = 0;
    const auto status = session.SetLayers(world, std::move(message), id);
    StoreCommand(command, id);
    return status;
  });
}

stridewire_status stridewire_client_set_planting(stridewire_client* client, stridewire_world world,
                                                 const uint32_t* avatars, size_t count, uint8_t on,
                                                 uint64_t* command) {
  if (!IsList(avatars, count)) return STRIDEWIRE_INVALID_ARGUMENT;
  return Command(client, [&](Session& session) {
    std::uint64_t id = 0;
    const auto status = session.SetPlanting(world, {0, 0, {avatars, avatars + count}, on == 0}, id);
    StoreCommand(command, id);
    return status;
  });
}

namespace {

bool IsDetail(stridewire_pose_detail detail) {
  return detail >= STRIDEWIRE_DETAIL_ALL && detail <= STRIDEWIRE_DETAIL_ROOT;
}

bool IsRegion(const stridewire_region* region) {
  return region != nullptr && region->ring_count <= STRIDEWIRE_MAX_RATE_RINGS &&
         (region->rings == nullptr) == (region->ring_count == 0) &&
         (region->ring_details == nullptr ||
          std::all_of(region->ring_details, region->ring_details + region->ring_count, IsDetail));
}

protocol::Region ToRegion(const stridewire_region& region) {
  protocol::Region out{{region.x, region.z}, region.radius_m, std::nullopt, {}, {}};
  if (!(region.leave_m < 0.0)) out.leave_m = region.leave_m;
  for (std::size_t i = 0; i < region.ring_count; ++i) {
    out.rings.push_back({region.rings[i].to_m, region.rings[i].every_n_ticks});
    if (region.ring_details == nullptr) continue;
    out.ring_details.push_back(static_cast<protocol::PoseDetail>(region.ring_details[i]));
  }
  return out;
}

stridewire_status Observe(stridewire_client* client, stridewire_world world,
                          const stridewire_observation* observation,
                          const stridewire_region* region, std::uint32_t* subscription,
                          std::uint64_t* command) {
  if (observation == nullptr || observation->mode < STRIDEWIRE_FULL ||
      observation->mode > STRIDEWIRE_MOVEMENT || !IsDetail(observation->detail) ||
      (observation->detail != STRIDEWIRE_DETAIL_ALL && observation->mode != STRIDEWIRE_QUANTISED) ||
      (region != nullptr && region->ring_details != nullptr && region->ring_count > 0 &&
       observation->mode != STRIDEWIRE_QUANTISED) ||
      observation->avatar_count > STRIDEWIRE_MAX_ITEMS ||
      (observation->avatars == nullptr) != (observation->avatar_count == 0)) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  return Command(client, [&](Session& session) {
    protocol::Observe message;
    message.mode = static_cast<protocol::PoseMode>(observation->mode);
    message.detail = static_cast<protocol::PoseDetail>(observation->detail);
    message.every_n_ticks = observation->every_n_ticks;
    message.with_events = observation->with_events != 0;
    message.avatars.assign(observation->avatars, observation->avatars + observation->avatar_count);
    if (region != nullptr) message.region = ToRegion(*region);
    std::uint64_t id = 0;
    std::uint32_t number = 0;
    const auto status = session.Observe(world, std::move(message), number, id);
    if (subscription != nullptr) *subscription = number;
    StoreCommand(command, id);
    return status;
  });
}

}  // namespace

stridewire_status stridewire_client_observe(stridewire_client* client, stridewire_world world,
                                            const stridewire_observation* observation,
                                            uint32_t* subscription, uint64_t* command) {
  return Observe(client, world, observation, nullptr, subscription, command);
}

stridewire_status stridewire_client_observe_region(stridewire_client* client,
                                                   stridewire_world world,
                                                   const stridewire_observation* observation,
                                                   const stridewire_region* region,
                                                   uint32_t* subscription, uint64_t* command) {
  if (!IsRegion(region)) return STRIDEWIRE_INVALID_ARGUMENT;
  return Observe(client, world, observation, region, subscription, command);
}

stridewire_status stridewire_client_move_region(stridewire_client* client, uint32_t subscription,
                                                const stridewire_region* region,
                                                uint64_t* command) {
  if (!IsRegion(region)) return STRIDEWIRE_INVALID_ARGUMENT;
  return Command(client, [&](Session& session) {
    std::uint64_t id = 0;
    const auto status = session.MoveRegion(subscription, ToRegion(*region), id);
    StoreCommand(command, id);
    return status;
  });
}

stridewire_status stridewire_client_stop_observing(stridewire_client* client, uint32_t subscription,
                                                   uint64_t* command) {
  return Command(client, [&](Session& session) {
    std::uint64_t id = 0;
    const auto status = session.StopObserving(subscription, id);
    StoreCommand(command, id);
    return status;
  });
}

stridewire_status stridewire_client_ping(stridewire_client* client) {
  return Command(client, [&](Session& session) { return session.Ping(client->network.Now()); });
}

stridewire_status stridewire_client_poll_events(stridewire_client* client, stridewire_event* events,
                                                size_t capacity, size_t* count) {
  if (count == nullptr || (events == nullptr && capacity > 0)) return STRIDEWIRE_INVALID_ARGUMENT;
  *count = 0;
  return Query(client, [&](Session& session) {
    *count = session.events().Take(std::span(events, capacity));
    return STRIDEWIRE_OK;
  });
}

stridewire_status stridewire_client_wait_event(stridewire_client* client, double timeout_s) {
  if (client == nullptr || !InRange(timeout_s, 0.0, 3600.0)) return STRIDEWIRE_INVALID_ARGUMENT;
  std::unique_lock lock(client->mutex);
  const bool there = client->changed.wait_for(lock, std::chrono::duration<double>(timeout_s),
                                              [&] { return !client->session.events().empty(); });
  return there ? STRIDEWIRE_OK : STRIDEWIRE_TIMEOUT;
}

stridewire_status stridewire_client_get_skeleton(stridewire_client* client, stridewire_world world,
                                                 stridewire_skeleton* skeleton,
                                                 stridewire_joint* joints, size_t joint_capacity,
                                                 stridewire_end_site* end_sites,
                                                 size_t end_site_capacity) {
  if (skeleton == nullptr || (joints == nullptr && joint_capacity > 0) ||
      (end_sites == nullptr && end_site_capacity > 0)) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  *skeleton = stridewire_skeleton{};
  return Query(client, [&](Session& session) {
    const WorldView* view = session.FindWorld(world);
    if (view == nullptr) return STRIDEWIRE_NO_SUCH_WORLD;
    if (!view->has_info()) return STRIDEWIRE_NOT_READY;
    const protocol::SkeletonInfo& info = view->skeleton();
    skeleton->joint_count = static_cast<std::uint32_t>(info.joints.size());
    skeleton->end_site_count = static_cast<std::uint32_t>(info.end_sites.size());
    skeleton->legs[0] = ToLeg(info.legs[0]);
    skeleton->legs[1] = ToLeg(info.legs[1]);
    skeleton->tick_hz = session.tick_hz();
    CopyName(view->library_hash(), skeleton->library_hash);
    for (std::size_t i = 0; i < std::min(joint_capacity, info.joints.size()); ++i) {
      joints[i] = stridewire_joint{};
      CopyName(info.joints[i].name, joints[i].name);
      joints[i].parent = info.joints[i].parent;
      CopyVector(info.joints[i].offset_m, joints[i].offset_m);
    }
    for (std::size_t i = 0; i < std::min(end_site_capacity, info.end_sites.size()); ++i) {
      end_sites[i] = stridewire_end_site{};
      end_sites[i].joint = info.end_sites[i].joint;
      CopyVector(info.end_sites[i].offset_m, end_sites[i].offset_m);
    }
    const bool all =
        info.joints.size() <= joint_capacity && info.end_sites.size() <= end_site_capacity;
    return all ? STRIDEWIRE_OK : STRIDEWIRE_BUFFER_TOO_SMALL;
  });
}

stridewire_status stridewire_client_list_layers(stridewire_client* client, stridewire_world world,
                                                stridewire_layer_name* names, size_t capacity,
                                                size_t* count) {
  if (count == nullptr || (names == nullptr && capacity > 0)) return STRIDEWIRE_INVALID_ARGUMENT;
  *count = 0;
  return Query(client, [&](Session& session) {
    const WorldView* view = session.FindWorld(world);
    if (view == nullptr) return STRIDEWIRE_NO_SUCH_WORLD;
    if (!view->has_info()) return STRIDEWIRE_NOT_READY;
    const std::vector<std::string>& layers = view->layers();
    *count = layers.size();
    for (std::size_t i = 0; i < std::min(capacity, layers.size()); ++i) {
      names[i] = stridewire_layer_name{};
      CopyName(layers[i], names[i].name);
    }
    return layers.size() <= capacity ? STRIDEWIRE_OK : STRIDEWIRE_BUFFER_TOO_SMALL;
  });
}

stridewire_status stridewire_client_get_terrain(stridewire_client* client, stridewire_world world,
                                                stridewire_terrain* terrain, float* heights_m,
                                                size_t height_capacity,
                                                stridewire_terrain_box* boxes,
                                                size_t box_capacity) {
  if (terrain == nullptr || (heights_m == nullptr && height_capacity > 0) ||
      (boxes == nullptr && box_capacity > 0)) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  *terrain = stridewire_terrain{};
  return Query(client, [&](Session& session) {
    if (session.FindWorld(world) == nullptr) return STRIDEWIRE_NO_SUCH_WORLD;
    const std::optional<protocol::TerrainInfo>& info = session.TerrainOf(world);
    if (!info) return STRIDEWIRE_OK;
    bool all = info->boxes.size() <= box_capacity;
    if (const auto& field = info->height_field) {
      terrain->origin_m[0] = field->origin_m.x;
      terrain->origin_m[1] = field->origin_m.z;
      terrain->cell_m = field->cell_m;
      terrain->columns = field->columns;
      terrain->rows = field->rows;
      std::copy_n(field->heights_m.begin(), std::min(height_capacity, field->heights_m.size()),
                  heights_m);
      all = all && field->heights_m.size() <= height_capacity;
    }
    terrain->box_count = static_cast<std::uint32_t>(info->boxes.size());
    for (std::size_t i = 0; i < std::min(box_capacity, info->boxes.size()); ++i) {
      const protocol::TerrainBoxInfo& box = info->boxes[i];
      boxes[i] = {{box.min_m.x, box.min_m.z}, {box.max_m.x, box.max_m.z}, box.height_m};
    }
    return all ? STRIDEWIRE_OK : STRIDEWIRE_BUFFER_TOO_SMALL;
  });
}

stridewire_status stridewire_client_list_avatars(stridewire_client* client, stridewire_world world,
                                                 uint32_t* avatars, size_t capacity,
                                                 size_t* count) {
  if (count == nullptr || (avatars == nullptr && capacity > 0)) return STRIDEWIRE_INVALID_ARGUMENT;
  *count = 0;
  return Query(client, [&](Session& session) {
    const WorldView* view = session.FindWorld(world);
    if (view == nullptr) return STRIDEWIRE_NO_SUCH_WORLD;
    const auto there = view->Avatars();
    *count = there.size();
    std::copy_n(there.begin(), std::min(capacity, there.size()), avatars);
    return there.size() <= capacity ? STRIDEWIRE_OK : STRIDEWIRE_BUFFER_TOO_SMALL;
  });
}

stridewire_status stridewire_client_server_time(stridewire_client* client, double* time_s) {
  if (time_s == nullptr) return STRIDEWIRE_INVALID_ARGUMENT;
  return Query(client, [&](Session& session) {
    if (!session.clock().ready()) return STRIDEWIRE_NOT_READY;
    *time_s = session.clock().ServerTime(client->network.Now());
    return STRIDEWIRE_OK;
  });
}

stridewire_status stridewire_client_render_time(stridewire_client* client, double* time_s) {
  if (time_s == nullptr) return STRIDEWIRE_INVALID_ARGUMENT;
  return Query(client, [&](Session& session) {
    if (!session.clock().ready()) return STRIDEWIRE_NOT_READY;
    *time_s = session.clock().ServerTime(client->network.Now()) - session.render_delay_s();
    return STRIDEWIRE_OK;
  });
}

stridewire_status stridewire_client_sample_pose(stridewire_client* client, stridewire_world world,
                                                uint32_t avatar, double time_s,
                                                stridewire_pose* pose, float* rotations_xyzw,
                                                size_t joint_capacity) {
  if (!std::isfinite(time_s)) return STRIDEWIRE_OUT_OF_RANGE;
  return ReadPose(client, world, avatar, pose, rotations_xyzw, joint_capacity,
                  [&](const WorldView& view, const PoseHistory& history) {
                    Vec3 root_position_m;
                    std::array<Quat, STRIDEWIRE_MAX_JOINTS> rotations;
                    const auto joints = std::span(rotations).first(history.joint_count());
                    const double newest_s = history.stamp(history.size() - 1).time_s;
                    if (time_s > newest_s && view.IsGone(avatar)) return;
                    const auto sampled = history.Sample(time_s, root_position_m, joints);
                    if (!sampled) return;
                    const PoseStamp& stamp = history.stamp(sampled->index);
                    pose->kind =
                        sampled->interpolated ? STRIDEWIRE_POSE_INTERPOLATED : STRIDEWIRE_POSE_HELD;
                    pose->tick = stamp.tick;
                    pose->time_s = time_s;
                    pose->held_s = sampled->interpolated ? 0.0 : time_s - stamp.time_s;
                    pose->standing = stamp.standing ? 1 : 0;
                    pose->detail = static_cast<std::uint8_t>(stamp.detail);
                    CopyVector(root_position_m, pose->root_position_m);
                    WriteRotations(joints, rotations_xyzw);
                  });
}

stridewire_status stridewire_client_latest_pose(stridewire_client* client, stridewire_world world,
                                                uint32_t avatar, stridewire_pose* pose,
                                                float* rotations_xyzw, size_t joint_capacity) {
  return ReadPose(client, world, avatar, pose, rotations_xyzw, joint_capacity,
                  [&](const WorldView&, const PoseHistory& history) {
                    WriteRaw(history, history.size() - 1, pose, rotations_xyzw);
                  });
}

stridewire_status stridewire_client_next_pose(stridewire_client* client, stridewire_world world,
                                              uint32_t avatar, uint64_t after_tick,
                                              stridewire_pose* pose, float* rotations_xyzw,
                                              size_t joint_capacity) {
  return ReadPose(client, world, avatar, pose, rotations_xyzw, joint_capacity,
                  [&](const WorldView&, const PoseHistory& history) {
                    const auto index = after_tick == std::numeric_limits<std::uint64_t>::max()
                                           ? std::optional<std::size_t>(0)
                                           : history.FirstAfterTick(after_tick);
                    if (index) WriteRaw(history, *index, pose, rotations_xyzw);
                  });
}

stridewire_status stridewire_client_get_statistics(stridewire_client* client,
                                                   stridewire_statistics* statistics) {
  if (statistics == nullptr) return STRIDEWIRE_INVALID_ARGUMENT;
  return Query(client, [&](Session& session) {
    *statistics = session.Statistics();
    return STRIDEWIRE_OK;
  });
}

}  // extern "C"
