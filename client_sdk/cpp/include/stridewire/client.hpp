#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stridewire/client.h"

/// C++17 over the C ABI of `stridewire/client.h`, where everything is explained: this only owns the
/// handle and sizes the buffers. Throws nothing but std::bad_alloc.
namespace stridewire::client {

/// What came of a call; true in a condition when it is well.
class [[nodiscard]] Result {
 public:
  Result(stridewire_status status = STRIDEWIRE_OK) : status_(status) {}  // NOLINT: a status is one.
  explicit operator bool() const { return status_ == STRIDEWIRE_OK; }
  stridewire_status status() const { return status_; }
  const char* name() const { return stridewire_status_name(status_); }
  const char* text() const { return stridewire_status_text(status_); }

 private:
  stridewire_status status_;
};

/// Options with their defaults; change what you like.
struct Options : stridewire_client_options {
  Options() { stridewire_client_options_init(this, sizeof(stridewire_client_options)); }
};

/// `stridewire_movement` made by name; every number not given is 0.
inline stridewire_movement Step(std::uint32_t avatar, std::uint64_t request_id, double length_m,
                                double turn_rad = 0.0,
                                stridewire_foot foot = STRIDEWIRE_FOOT_AUTO) {
  stridewire_movement m{};
  m.avatar = avatar;
  m.request_id = request_id;
  m.type = STRIDEWIRE_STEP;
  m.foot = foot;
  m.length_m = length_m;
  m.turn_rad = turn_rad;
  return m;
}
/// A step whose foot lands in a place, looking where the server chooses unless told.
inline stridewire_movement StepTo(std::uint32_t avatar, std::uint64_t request_id, double x_m,
                                  double y_m, double z_m,
                                  std::optional<double> heading_rad = std::nullopt,
                                  stridewire_foot foot = STRIDEWIRE_FOOT_AUTO) {
  stridewire_movement m = Step(avatar, request_id, 0.0, 0.0, foot);
  m.has_at = 1;
  m.at_m[0] = x_m;
  m.at_m[1] = y_m;
  m.at_m[2] = z_m;
  m.has_heading = heading_rad ? 1 : 0;
  m.heading_rad = heading_rad.value_or(0.0);
  return m;
}
/// The same step, which is rejected rather than done when its place is out of reach.
inline stridewire_movement ExactOnly(stridewire_movement step_to) {
  step_to.exact_only = 1;
  return step_to;
}
/// The same movement, which takes over from what the avatar does.
inline stridewire_movement Now(stridewire_movement movement) {
  movement.interrupt = STRIDEWIRE_NOW;
  return movement;
}
/// A walk to a place and heading.
inline stridewire_movement WalkTo(std::uint32_t avatar, std::uint64_t request_id, double x_m,
                                  double y_m, double z_m, double heading_rad,
                                  std::optional<double> speed_m_s = std::nullopt) {
  stridewire_movement m{};
  m.avatar = avatar;
  m.request_id = request_id;
  m.type = STRIDEWIRE_WALK;
  m.at_m[0] = x_m;
  m.at_m[1] = y_m;
  m.at_m[2] = z_m;
  m.heading_rad = heading_rad;
  m.has_speed = speed_m_s ? 1 : 0;
  m.speed_m_s = speed_m_s.value_or(0.0);
  return m;
}
inline stridewire_movement Jump(std::uint32_t avatar, std::uint64_t request_id, double length_m) {
  stridewire_movement m{};
  m.avatar = avatar;
  m.request_id = request_id;
  m.type = STRIDEWIRE_JUMP;
  m.length_m = length_m;
  return m;
}
inline stridewire_movement Stand(std::uint32_t avatar, std::uint64_t request_id, double seconds) {
  stridewire_movement m{};
  m.avatar = avatar;
  m.request_id = request_id;
  m.type = STRIDEWIRE_STAND;
  m.seconds = seconds;
  return m;
}

/// Starts a clip of the library over what an avatar does.
inline stridewire_layer LayerOn(std::uint32_t avatar, const char* name, double weight = 1.0,
                                double blend_s = 0.3, double speed = 1.0) {
  return {avatar, name, 0, weight, blend_s, speed};
}
inline stridewire_layer LayerOff(std::uint32_t avatar, const char* name, double blend_s = 0.3) {
  return {avatar, name, 1, 1.0, blend_s, 1.0};
}

struct Quaternion {
  float x;
  float y;
  float z;
  float w;
};
static_assert(sizeof(Quaternion) == 4 * sizeof(float), "rotations are written as floats");

/// A pose with its rotations. Reuse one: its memory is kept.
struct Pose : stridewire_pose {
  Pose() : stridewire_pose() {}
  bool missing() const { return kind == STRIDEWIRE_POSE_MISSING; }
  std::vector<Quaternion> rotations;  ///< `joint_count` of them when not missing.
};

struct Skeleton : stridewire_skeleton {
  Skeleton() : stridewire_skeleton() {}
  std::vector<stridewire_joint> joints;
  std::vector<stridewire_end_site> end_sites;
};

/// The ground of a world; `columns` 0: without a height field.
struct Terrain : stridewire_terrain {
  Terrain() : stridewire_terrain() {}
  std::vector<float> heights_m;  ///< columns * rows of them, row by row, x fastest.
  std::vector<stridewire_terrain_box> boxes;
};

/// One client. Movable, not copyable. Threads: as the C ABI.
class Client {
 public:
  /// Empty when it could not be made; `status` tells why.
  static std::optional<Client> Create(const stridewire_client_options& options = Options(),
                                      stridewire_status* status = nullptr) {
    stridewire_client* handle = nullptr;
    const stridewire_status result = stridewire_client_create(&options, &handle);
    if (status != nullptr) *status = result;
    if (result != STRIDEWIRE_OK) return std::nullopt;
    return Client(handle);
  }
  ~Client() { stridewire_client_destroy(handle_); }
  Client(Client&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  Client& operator=(Client&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }

  /// For what this wrapper has no method for.
  stridewire_client* get() const { return handle_; }

  Result Connect(const std::string& host, std::uint16_t port) {
    return stridewire_client_connect(handle_, host.c_str(), port);
  }
  Result Disconnect() { return stridewire_client_disconnect(handle_); }
  stridewire_client_state state() const { return stridewire_client_get_state(handle_); }
  bool ready() const { return state() == STRIDEWIRE_STATE_READY; }

  /// Why the last attempt, connection or call failed.
  std::string LastError() const {
    char text[1100] = {};
    (void)stridewire_client_last_error(handle_, text, sizeof text);
    return text;
  }

  Result JoinWorld(const std::string& name, stridewire_role role, stridewire_world& world,
                   std::uint64_t* command = nullptr) {
    return stridewire_client_join_world(handle_, name.c_str(), role, &world, command);
  }
  Result LeaveWorld(stridewire_world world, std::uint64_t* command = nullptr) {
    return stridewire_client_leave_world(handle_, world, command);
  }
  Result Spawn(stridewire_world world, const std::vector<stridewire_spawn>& spawns,
               std::uint64_t* command = nullptr) {
    return stridewire_client_spawn(handle_, world, spawns.data(), spawns.size(), command);
  }
  Result Remove(stridewire_world world, const std::vector<std::uint32_t>& avatars,
                std::uint64_t* command = nullptr) {
    return stridewire_client_remove(handle_, world, avatars.data(), avatars.size(), command);
  }
  Result Request(stridewire_world world, const std::vector<stridewire_movement>& movements,
                 std::uint64_t* command = nullptr) {
    return stridewire_client_request(handle_, world, movements.data(), movements.size(), command);
  }
  Result Cancel(stridewire_world world, const std::vector<std::uint32_t>& avatars,
                std::uint64_t* command = nullptr) {
    return stridewire_client_cancel(handle_, world, avatars.data(), avatars.size(), command);
  }
  /// `box_count` follows from `boxes`. INVALID_ARGUMENT: heights_m are not columns * rows.
  Result SetTerrain(stridewire_world world, const Terrain& terrain,
                    std::uint64_t* command = nullptr) {
    stridewire_height_field field{};
    field.origin_m[0] = terrain.origin_m[0];
    field.origin_m[1] = terrain.origin_m[1];
    field.cell_m = terrain.cell_m;
    field.columns = terrain.columns;
    field.rows = terrain.rows;
    field.heights_m = terrain.heights_m.data();
    if (terrain.heights_m.size() != std::size_t{terrain.columns} * terrain.rows) {
      return STRIDEWIRE_INVALID_ARGUMENT;
    }
    return stridewire_client_set_terrain(handle_, world, terrain.columns > 0 ? &field : nullptr,
                                         terrain.boxes.data(), terrain.boxes.size(), command);
  }
  Result SetLayers(stridewire_world world, const std::vector<stridewire_layer>& layers,
                   std::uint64_t* command = nullptr) {
    return stridewire_client_set_layers(handle_, world, layers.data(), layers.size(), command);
  }
  Result SetPlanting(stridewire_world world, const std::vector<std::uint32_t>& avatars, bool on,
                     std::uint64_t* command = nullptr) {
    return stridewire_client_set_planting(handle_, world, avatars.data(), avatars.size(),
                                          on ? 1 : 0, command);
  }
  Result Observe(stridewire_world world, const stridewire_observation& observation,
                 std::uint32_t* subscription = nullptr, std::uint64_t* command = nullptr) {
    return stridewire_client_observe(handle_, world, &observation, subscription, command);
  }
  /// All avatars of a world, every tick.
  Result Observe(stridewire_world world, stridewire_pose_mode mode = STRIDEWIRE_QUANTISED,
                 std::uint16_t every_n_ticks = 1) {
    stridewire_observation observation{};
    observation.mode = mode;
    observation.every_n_ticks = every_n_ticks;
    return Observe(world, observation);
  }
  Result ObserveRegion(stridewire_world world, const stridewire_observation& observation,
                       const stridewire_region& region, std::uint32_t* subscription = nullptr,
                       std::uint64_t* command = nullptr) {
    return stridewire_client_observe_region(handle_, world, &observation, &region, subscription,
                                            command);
  }
  Result MoveRegion(std::uint32_t subscription, const stridewire_region& region,
                    std::uint64_t* command = nullptr) {
    return stridewire_client_move_region(handle_, subscription, &region, command);
  }
  Result StopObserving(std::uint32_t subscription, std::uint64_t* command = nullptr) {
    return stridewire_client_stop_observing(handle_, subscription, command);
  }
  Result Ping() { return stridewire_client_ping(handle_); }

  /// Takes the oldest event; false: there is none.
  bool PollEvent(stridewire_event& event) {
    std::size_t count = 0;
    return stridewire_client_poll_events(handle_, &event, 1, &count) == STRIDEWIRE_OK && count == 1;
  }
  /// Waits for an event, at most `timeout_s`; false: none came.
  bool WaitEvent(double timeout_s) {
    return stridewire_client_wait_event(handle_, timeout_s) == STRIDEWIRE_OK;
  }

  Result GetSkeleton(stridewire_world world, Skeleton& skeleton) const {
    for (;;) {
      const stridewire_status status = stridewire_client_get_skeleton(
          handle_, world, &skeleton, skeleton.joints.data(), skeleton.joints.size(),
          skeleton.end_sites.data(), skeleton.end_sites.size());
      if (status != STRIDEWIRE_OK && status != STRIDEWIRE_BUFFER_TOO_SMALL) return status;
      skeleton.joints.resize(skeleton.joint_count);
      skeleton.end_sites.resize(skeleton.end_site_count);
      if (status == STRIDEWIRE_OK) return status;
    }
  }
  /// Names of the layers of a world's library; none before the world is joined.
  std::vector<std::string> ListLayers(stridewire_world world) const {
    std::vector<stridewire_layer_name> names;
    std::size_t count = 0;
    while (stridewire_client_list_layers(handle_, world, names.data(), names.size(), &count) ==
           STRIDEWIRE_BUFFER_TOO_SMALL) {
      names.resize(count);
    }
    std::vector<std::string> layers;
    for (std::size_t i = 0; i < count; ++i) layers.emplace_back(names[i].name);
    return layers;
  }
  Result GetTerrain(stridewire_world world, Terrain& terrain) const {
    for (;;) {
      const stridewire_status status = stridewire_client_get_terrain(
          handle_, world, &terrain, terrain.heights_m.data(), terrain.heights_m.size(),
          terrain.boxes.data(), terrain.boxes.size());
      if (status != STRIDEWIRE_OK && status != STRIDEWIRE_BUFFER_TOO_SMALL) return status;
      terrain.heights_m.resize(std::size_t{terrain.columns} * terrain.rows);
      terrain.boxes.resize(terrain.box_count);
      if (status == STRIDEWIRE_OK) return status;
    }
  }
  std::vector<std::uint32_t> ListAvatars(stridewire_world world) const {
    std::vector<std::uint32_t> avatars;
    std::size_t count = 0;
    while (stridewire_client_list_avatars(handle_, world, avatars.data(), avatars.size(), &count) ==
           STRIDEWIRE_BUFFER_TOO_SMALL) {
      avatars.resize(count);
    }
    avatars.resize(count);
    return avatars;
  }

  /// Empty until the server's clock is known.
  std::optional<double> ServerTime() const {
    double time_s = 0.0;
    if (stridewire_client_server_time(handle_, &time_s) != STRIDEWIRE_OK) return std::nullopt;
    return time_s;
  }
  std::optional<double> RenderTime() const {
    double time_s = 0.0;
    if (stridewire_client_render_time(handle_, &time_s) != STRIDEWIRE_OK) return std::nullopt;
    return time_s;
  }

  Result SamplePose(stridewire_world world, std::uint32_t avatar, double time_s, Pose& pose) const {
    return Fill(pose, [&](float* rotations) {
      return stridewire_client_sample_pose(handle_, world, avatar, time_s, &pose, rotations,
                                           STRIDEWIRE_MAX_JOINTS);
    });
  }
  Result LatestPose(stridewire_world world, std::uint32_t avatar, Pose& pose) const {
    return Fill(pose, [&](float* rotations) {
      return stridewire_client_latest_pose(handle_, world, avatar, &pose, rotations,
                                           STRIDEWIRE_MAX_JOINTS);
    });
  }
  Result NextPose(stridewire_world world, std::uint32_t avatar, std::uint64_t after_tick,
                  Pose& pose) const {
    return Fill(pose, [&](float* rotations) {
      return stridewire_client_next_pose(handle_, world, avatar, after_tick, &pose, rotations,
                                         STRIDEWIRE_MAX_JOINTS);
    });
  }

  stridewire_statistics Statistics() const {
    stridewire_statistics statistics{};
    (void)stridewire_client_get_statistics(handle_, &statistics);
    return statistics;
  }

 private:
  explicit Client(stridewire_client* handle) : handle_(handle) {}

  template <typename Call>
  static Result Fill(Pose& pose, const Call& call) {
    pose.rotations.resize(STRIDEWIRE_MAX_JOINTS);
    const stridewire_status status = call(reinterpret_cast<float*>(pose.rotations.data()));
    pose.rotations.resize(pose.joint_count);
    return status;
  }

  stridewire_client* handle_;
};

}  // namespace stridewire::client
