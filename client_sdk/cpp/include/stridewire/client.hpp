#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stridewire/client.h"

/// C++17 wrapper of `stridewire/client.h`. It owns the handle and resizes buffers. It throws no
/// exception except std::bad_alloc. The C header documents each function.
namespace stridewire::client {

/// Result of a call. Converts to true if the call succeeded.
class [[nodiscard]] Result {
 public:
  // NOLINTNEXTLINE(google-explicit-constructor): functions return a status as their result.
  Result(stridewire_status status = STRIDEWIRE_OK) : status_(status) {}
  explicit operator bool() const { return status_ == STRIDEWIRE_OK; }
  stridewire_status status() const { return status_; }
  const char* name() const { return stridewire_status_name(status_); }
  const char* text() const { return stridewire_status_text(status_); }

 private:
  stridewire_status status_;
};

/// Options of a client. The constructor fills in the defaults.
struct Options : stridewire_client_options {
  Options() { stridewire_client_options_init(this, sizeof(stridewire_client_options)); }
};

/// A position in the world in metres.
struct Position {
  double x_m = 0.0;
  double y_m = 0.0;
  double z_m = 0.0;

  void CopyTo(double (&out)[3]) const {
    out[0] = x_m;
    out[1] = y_m;
    out[2] = z_m;
  }
};

/// Creates a request for a step of height 0. The server chooses the sideways distance.
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
/// Creates a request for a step that places the ball of the foot at a world position. Without
/// `heading_rad` the server chooses the heading of the foot.
inline stridewire_movement StepTo(std::uint32_t avatar, std::uint64_t request_id,
                                  const Position& at,
                                  std::optional<double> heading_rad = std::nullopt,
                                  stridewire_foot foot = STRIDEWIRE_FOOT_AUTO) {
  stridewire_movement m = Step(avatar, request_id, 0.0, 0.0, foot);
  m.has_at = 1;
  at.CopyTo(m.at_m);
  m.has_heading = heading_rad ? 1 : 0;
  m.heading_rad = heading_rad.value_or(0.0);
  return m;
}
/// Returns a copy of a step request with `exact_only` set: the server rejects the step unless the
/// foot can land exactly on the requested footprint.
inline stridewire_movement ExactOnly(stridewire_movement step) {
  step.exact_only = 1;
  return step;
}
/// Returns a copy of a request for a step or jump with `allow_nearest` set: the avatar plays the
/// nearest movement of the library, however far it is from the request.
inline stridewire_movement AllowNearest(stridewire_movement movement) {
  movement.allow_nearest = 1;
  return movement;
}
/// Returns a copy of a request with the interrupt STRIDEWIRE_NOW: it begins as soon as the feet
/// allow it, and drops the queue.
inline stridewire_movement Now(stridewire_movement movement) {
  movement.interrupt = STRIDEWIRE_NOW;
  return movement;
}
/// Creates a request for a walk to a world position and heading. Without `speed_m_s` the server
/// chooses the speed.
inline stridewire_movement WalkTo(std::uint32_t avatar, std::uint64_t request_id,
                                  const Position& destination, double heading_rad,
                                  std::optional<double> speed_m_s = std::nullopt) {
  stridewire_movement m{};
  m.avatar = avatar;
  m.request_id = request_id;
  m.type = STRIDEWIRE_WALK;
  destination.CopyTo(m.at_m);
  m.heading_rad = heading_rad;
  m.has_speed = speed_m_s ? 1 : 0;
  m.speed_m_s = speed_m_s.value_or(0.0);
  return m;
}
/// Creates a request for a jump straight ahead.
inline stridewire_movement Jump(std::uint32_t avatar, std::uint64_t request_id, double length_m) {
  stridewire_movement m{};
  m.avatar = avatar;
  m.request_id = request_id;
  m.type = STRIDEWIRE_JUMP;
  m.length_m = length_m;
  return m;
}
/// Creates a request to stand for a given time.
inline stridewire_movement Stand(std::uint32_t avatar, std::uint64_t request_id, double seconds) {
  stridewire_movement m{};
  m.avatar = avatar;
  m.request_id = request_id;
  m.type = STRIDEWIRE_STAND;
  m.seconds = seconds;
  return m;
}

/// Creates an argument of SetLayers that starts a layer, or changes its weight and speed. `name`
/// must outlive the call to SetLayers.
inline stridewire_layer StartLayer(std::uint32_t avatar, const char* name, double weight = 1.0,
                                   double blend_s = 0.3, double speed = 1.0) {
  return {avatar, name, 0, weight, blend_s, speed};
}
/// Creates an argument of SetLayers that fades a layer out and ends it. `name` must outlive the
/// call to SetLayers.
inline stridewire_layer FadeOutLayer(std::uint32_t avatar, const char* name, double blend_s = 0.3) {
  return {avatar, name, 1, 1.0, blend_s, 1.0};
}

/// A unit quaternion.
struct Quaternion {
  float x;
  float y;
  float z;
  float w;
};
static_assert(sizeof(Quaternion) == 4 * sizeof(float),
              "the C functions write four floats per quaternion");

/// A pose with its rotations. Reuse an object to reuse its memory.
struct Pose : stridewire_pose {
  Pose() : stridewire_pose() {}
  bool missing() const { return kind == STRIDEWIRE_POSE_MISSING; }
  std::vector<Quaternion> rotations;  ///< One rotation per joint; empty if the pose is missing.
};

/// The skeleton of a world, with its joints and end sites.
struct Skeleton : stridewire_skeleton {
  Skeleton() : stridewire_skeleton() {}
  std::vector<stridewire_joint> joints;
  std::vector<stridewire_end_site> end_sites;
};

/// The terrain of a world. It has no height field if `columns` is 0.
struct Terrain : stridewire_terrain {
  Terrain() : stridewire_terrain() {}
  std::vector<float> heights_m;  ///< columns * rows heights, row by row, x fastest.
  std::vector<stridewire_terrain_box> boxes;
};

/// Owns a client handle. Movable, not copyable. All methods may be called from any thread. Methods
/// without a comment have the behaviour of the C function with the same name.
class Client {
 public:
  /// Creates a client that is not connected. On failure, returns nullopt and stores the reason in
  /// `status`, unless that is null.
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

  /// Returns the handle, for C functions without a method here. This object still owns it.
  stridewire_client* get() const { return handle_; }

  Result Connect(const std::string& host, std::uint16_t port) {
    return stridewire_client_connect(handle_, host.c_str(), port);
  }
  /// `addresses` contains the host and port of each server.
  Result ConnectAny(const std::vector<std::pair<std::string, std::uint16_t>>& addresses) {
    std::vector<stridewire_address> list;
    for (const auto& [host, port] : addresses) list.push_back({host.c_str(), port});
    return stridewire_client_connect_any(handle_, list.data(), list.size());
  }
  Result Disconnect() { return stridewire_client_disconnect(handle_); }
  stridewire_client_state state() const { return stridewire_client_get_state(handle_); }
  bool ready() const { return state() == STRIDEWIRE_STATE_READY; }

  /// Returns the text of stridewire_client_last_error, at most 1099 bytes. Empty: no error.
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
  Result Teleport(stridewire_world world, const std::vector<stridewire_spawn>& places,
                  std::uint64_t* command = nullptr) {
    return stridewire_client_teleport(handle_, world, places.data(), places.size(), command);
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
  /// Sends the height field and the boxes; ignores `box_count`. Fails with INVALID_ARGUMENT if
  /// `heights_m` does not have columns * rows elements.
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
    stridewire_terrain_def def{};
    def.height_field = terrain.columns > 0 ? &field : nullptr;
    def.boxes = terrain.boxes.data();
    def.box_count = terrain.boxes.size();
    return stridewire_client_set_terrain(handle_, world, &def, command);
  }
  Result SetLayers(stridewire_world world, const std::vector<stridewire_layer>& layers,
                   std::uint64_t* command = nullptr) {
    return stridewire_client_set_layers(handle_, world, layers.data(), layers.size(), command);
  }
  Result SetPlanting(stridewire_world world, const std::vector<std::uint32_t>& avatars,
                     bool enabled, std::uint64_t* command = nullptr) {
    stridewire_planting planting{};
    planting.avatars = avatars.data();
    planting.avatar_count = avatars.size();
    planting.enabled = enabled ? 1 : 0;
    return stridewire_client_set_planting(handle_, world, &planting, command);
  }
  Result Observe(stridewire_world world, const stridewire_observation& observation,
                 std::uint32_t* subscription = nullptr, std::uint64_t* command = nullptr) {
    return stridewire_client_observe(handle_, world, &observation, subscription, command);
  }
  /// Observes all avatars of a world.
  Result Observe(stridewire_world world, stridewire_pose_mode mode = STRIDEWIRE_QUANTISED,
                 std::uint16_t every_n_ticks = 1) {
    stridewire_observation observation{};
    observation.mode = mode;
    observation.every_n_ticks = every_n_ticks;
    return Observe(world, observation);
  }
  /// Same as Observe with `observation.region` set to `region`.
  Result ObserveRegion(stridewire_world world, stridewire_observation observation,
                       const stridewire_region& region, std::uint32_t* subscription = nullptr,
                       std::uint64_t* command = nullptr) {
    observation.region = &region;
    return Observe(world, observation, subscription, command);
  }
  Result MoveRegion(std::uint32_t subscription, const stridewire_region& region,
                    std::uint64_t* command = nullptr) {
    return stridewire_client_move_region(handle_, subscription, &region, command);
  }
  Result StopObserving(std::uint32_t subscription, std::uint64_t* command = nullptr) {
    return stridewire_client_stop_observing(handle_, subscription, command);
  }
  Result Ping() { return stridewire_client_ping(handle_); }

  /// Removes the oldest event from the queue. Returns false if the queue is empty.
  bool PollEvent(stridewire_event& event) {
    std::size_t count = 0;
    return stridewire_client_poll_events(handle_, &event, 1, &count) == STRIDEWIRE_OK && count == 1;
  }
  /// Waits until the event queue is not empty. Returns false after `timeout_s` seconds.
  bool WaitEvent(double timeout_s) {
    return stridewire_client_wait_event(handle_, timeout_s) == STRIDEWIRE_OK;
  }

  Result GetSkeleton(stridewire_world world, Skeleton& skeleton) const {
    for (;;) {
      stridewire_skeleton_buffers buffers{};
      buffers.joints = skeleton.joints.data();
      buffers.joint_capacity = skeleton.joints.size();
      buffers.end_sites = skeleton.end_sites.data();
      buffers.end_site_capacity = skeleton.end_sites.size();
      const stridewire_status status =
          stridewire_client_get_skeleton(handle_, world, &skeleton, &buffers);
      if (status != STRIDEWIRE_OK && status != STRIDEWIRE_BUFFER_TOO_SMALL) return status;
      skeleton.joints.resize(skeleton.joint_count);
      skeleton.end_sites.resize(skeleton.end_site_count);
      if (status == STRIDEWIRE_OK) return status;
    }
  }
  /// Returns the names of the layers in a world's library. Returns an empty list before the event
  /// WORLD_JOINED.
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
      stridewire_terrain_buffers buffers{};
      buffers.heights_m = terrain.heights_m.data();
      buffers.height_capacity = terrain.heights_m.size();
      buffers.boxes = terrain.boxes.data();
      buffers.box_capacity = terrain.boxes.size();
      const stridewire_status status =
          stridewire_client_get_terrain(handle_, world, &terrain, &buffers);
      if (status != STRIDEWIRE_OK && status != STRIDEWIRE_BUFFER_TOO_SMALL) return status;
      terrain.heights_m.resize(std::size_t{terrain.columns} * terrain.rows);
      terrain.boxes.resize(terrain.box_count);
      if (status == STRIDEWIRE_OK) return status;
    }
  }
  /// Returns the ids of the avatars whose poses the client receives, in ascending order.
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

  /// Returns the estimated server time in seconds. Returns nullopt before the first pose or pong.
  std::optional<double> ServerTime() const {
    double time_s = 0.0;
    if (stridewire_client_server_time(handle_, &time_s) != STRIDEWIRE_OK) return std::nullopt;
    return time_s;
  }
  /// Returns the time at which to sample poses, in seconds. Returns nullopt before the first pose
  /// or pong.
  std::optional<double> RenderTime() const {
    double time_s = 0.0;
    if (stridewire_client_render_time(handle_, &time_s) != STRIDEWIRE_OK) return std::nullopt;
    return time_s;
  }

  Result SamplePose(stridewire_world world, std::uint32_t avatar, double time_s, Pose& pose) const {
    return Fill(
        pose, [&] { return stridewire_client_sample_pose(handle_, world, avatar, time_s, &pose); });
  }
  Result LatestPose(stridewire_world world, std::uint32_t avatar, Pose& pose) const {
    return Fill(pose, [&] { return stridewire_client_latest_pose(handle_, world, avatar, &pose); });
  }
  Result NextPose(stridewire_world world, std::uint32_t avatar, std::uint64_t after_tick,
                  Pose& pose) const {
    return Fill(pose, [&] {
      return stridewire_client_next_pose(handle_, world, avatar, after_tick, &pose);
    });
  }

  /// Returns the delays of the render time and the counts of sampled poses.
  stridewire_playout Playout() const {
    stridewire_playout playout{};
    (void)stridewire_client_get_playout(handle_, &playout);
    return playout;
  }

  stridewire_statistics Statistics() const {
    stridewire_statistics statistics{};
    (void)stridewire_client_get_statistics(handle_, &statistics);
    return statistics;
  }

 private:
  explicit Client(stridewire_client* handle) : handle_(handle) {}

  // Sets the buffer of the pose, calls `call`, and removes the buffer again, so that a copy of the
  // pose does not point to it.
  template <typename Call>
  static Result Fill(Pose& pose, const Call& call) {
    pose.rotations.resize(STRIDEWIRE_MAX_JOINTS);
    pose.rotations_xyzw = reinterpret_cast<float*>(pose.rotations.data());
    pose.joint_capacity = pose.rotations.size();
    const stridewire_status status = call();
    pose.rotations_xyzw = nullptr;
    pose.joint_capacity = 0;
    pose.rotations.resize(pose.joint_count);
    return status;
  }

  stridewire_client* handle_;
};

}  // namespace stridewire::client
