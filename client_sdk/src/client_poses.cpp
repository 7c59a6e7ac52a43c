// Functions of the C API that read worlds and poses.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client_handle.h"

using stridewire::Quat;
using stridewire::Vec3;
using stridewire::client::PoseHistory;
using stridewire::client::PoseStamp;
using stridewire::client::Query;
using stridewire::client::Session;
using stridewire::client::WorldView;
namespace protocol = stridewire::protocol;

namespace {

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

/// Resets `pose` to MISSING and, if the avatar has a history, calls
/// `write(session, is_gone, history)`.
template <typename Write>
stridewire_status ReadPose(stridewire_client* client, stridewire_world world, std::uint32_t avatar,
                           stridewire_pose* pose, const Write& write) {
  if (pose == nullptr || (pose->rotations_xyzw == nullptr && pose->joint_capacity > 0)) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  float* const rotations_xyzw = pose->rotations_xyzw;
  const std::size_t joint_capacity = pose->joint_capacity;
  *pose = stridewire_pose{};
  pose->rotations_xyzw = rotations_xyzw;
  pose->joint_capacity = joint_capacity;
  return Query(client, [&](Session& session) {
    WorldView* view = session.FindWorld(world);
    if (view == nullptr) return STRIDEWIRE_NO_SUCH_WORLD;
    PoseHistory* history = view->Find(avatar);
    if (history == nullptr || history->size() == 0) return STRIDEWIRE_OK;
    if (joint_capacity < history->joint_count()) {
      pose->joint_count = static_cast<std::uint32_t>(history->joint_count());
      return STRIDEWIRE_BUFFER_TOO_SMALL;
    }
    write(session, view->IsGone(avatar), *history);
    if (pose->kind != STRIDEWIRE_POSE_MISSING) {
      pose->joint_count = static_cast<std::uint32_t>(history->joint_count());
    }
    return STRIDEWIRE_OK;
  });
}

void WriteRaw(const PoseHistory& history, std::size_t index, stridewire_pose* pose) {
  const PoseStamp& stamp = history.stamp(index);
  pose->kind = STRIDEWIRE_POSE_RAW;
  pose->tick = stamp.tick;
  pose->time_s = stamp.time_s;
  pose->discontinuity = stamp.discontinuity ? 1 : 0;
  pose->standing = stamp.standing ? 1 : 0;
  pose->detail = static_cast<std::uint8_t>(stamp.detail);
  pose->segment = stamp.segment;
  CopyVector(history.root_position_m(index), pose->root_position_m);
  WriteRotations(history.rotations(index), pose->rotations_xyzw);
}

}  // namespace

extern "C" {

stridewire_status stridewire_client_get_skeleton(stridewire_client* client, stridewire_world world,
                                                 stridewire_skeleton* skeleton,
                                                 const stridewire_skeleton_buffers* buffers) {
  const stridewire_skeleton_buffers out =
      buffers != nullptr ? *buffers : stridewire_skeleton_buffers{};
  if (skeleton == nullptr || (out.joints == nullptr && out.joint_capacity > 0) ||
      (out.end_sites == nullptr && out.end_site_capacity > 0)) {
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
    for (std::size_t i = 0; i < std::min(out.joint_capacity, info.joints.size()); ++i) {
      out.joints[i] = stridewire_joint{};
      CopyName(info.joints[i].name, out.joints[i].name);
      out.joints[i].parent = info.joints[i].parent;
      CopyVector(info.joints[i].offset_m, out.joints[i].offset_m);
    }
    for (std::size_t i = 0; i < std::min(out.end_site_capacity, info.end_sites.size()); ++i) {
      out.end_sites[i] = stridewire_end_site{};
      out.end_sites[i].joint = info.end_sites[i].joint;
      CopyVector(info.end_sites[i].offset_m, out.end_sites[i].offset_m);
    }
    const bool all =
        info.joints.size() <= out.joint_capacity && info.end_sites.size() <= out.end_site_capacity;
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
                                                stridewire_terrain* terrain,
                                                const stridewire_terrain_buffers* buffers) {
  const stridewire_terrain_buffers out =
      buffers != nullptr ? *buffers : stridewire_terrain_buffers{};
  if (terrain == nullptr || (out.heights_m == nullptr && out.height_capacity > 0) ||
      (out.boxes == nullptr && out.box_capacity > 0)) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  *terrain = stridewire_terrain{};
  return Query(client, [&](Session& session) {
    if (session.FindWorld(world) == nullptr) return STRIDEWIRE_NO_SUCH_WORLD;
    const std::optional<protocol::TerrainInfo>& info = session.TerrainOf(world);
    if (!info) return STRIDEWIRE_OK;
    bool all = info->boxes.size() <= out.box_capacity;
    if (const auto& field = info->height_field) {
      terrain->origin_m[0] = field->origin_m.x;
      terrain->origin_m[1] = field->origin_m.z;
      terrain->cell_m = field->cell_m;
      terrain->columns = field->columns;
      terrain->rows = field->rows;
      std::copy_n(field->heights_m.begin(), std::min(out.height_capacity, field->heights_m.size()),
                  out.heights_m);
      all = all && field->heights_m.size() <= out.height_capacity;
    }
    terrain->box_count = static_cast<std::uint32_t>(info->boxes.size());
    for (std::size_t i = 0; i < std::min(out.box_capacity, info->boxes.size()); ++i) {
      const protocol::TerrainBoxInfo& box = info->boxes[i];
      out.boxes[i] = {{box.min_m.x, box.min_m.z}, {box.max_m.x, box.max_m.z}, box.height_m};
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
    *time_s = session.RenderTime(client->network.Now());
    return STRIDEWIRE_OK;
  });
}

stridewire_status stridewire_client_get_playout(stridewire_client* client,
                                                stridewire_playout* playout) {
  if (playout == nullptr) return STRIDEWIRE_INVALID_ARGUMENT;
  return Query(client, [&](Session& session) {
    *playout = session.Playout(client->network.Now());
    return STRIDEWIRE_OK;
  });
}

stridewire_status stridewire_client_sample_pose(stridewire_client* client, stridewire_world world,
                                                uint32_t avatar, double time_s,
                                                stridewire_pose* pose) {
  if (!std::isfinite(time_s)) return STRIDEWIRE_OUT_OF_RANGE;
  return ReadPose(client, world, avatar, pose,
                  [&](Session& session, bool is_gone, PoseHistory& history) {
                    Vec3 root_position_m;
                    std::array<Quat, STRIDEWIRE_MAX_JOINTS> rotations;
                    const auto joints = std::span(rotations).first(history.joint_count());
                    const bool is_after_newest = time_s > history.stamp(history.size() - 1).time_s;
                    if (is_after_newest && is_gone) return;
                    const auto sampled = history.Display(time_s, root_position_m, joints);
                    if (!sampled) return;
                    session.displayed().Add(*sampled, is_after_newest);
                    const PoseStamp& stamp = history.stamp(sampled->index);
                    pose->kind = sampled->interpolated   ? STRIDEWIRE_POSE_INTERPOLATED
                                 : sampled->extrapolated ? STRIDEWIRE_POSE_EXTRAPOLATED
                                                         : STRIDEWIRE_POSE_HELD;
                    pose->tick = stamp.tick;
                    pose->time_s = time_s;
                    pose->held_s = sampled->interpolated ? 0.0 : time_s - stamp.time_s;
                    pose->standing = stamp.standing ? 1 : 0;
                    pose->detail = static_cast<std::uint8_t>(stamp.detail);
                    pose->segment = stamp.segment;
                    CopyVector(root_position_m, pose->root_position_m);
                    WriteRotations(joints, pose->rotations_xyzw);
                  });
}

stridewire_status stridewire_client_latest_pose(stridewire_client* client, stridewire_world world,
                                                uint32_t avatar, stridewire_pose* pose) {
  return ReadPose(client, world, avatar, pose, [&](Session&, bool, const PoseHistory& history) {
    WriteRaw(history, history.size() - 1, pose);
  });
}

stridewire_status stridewire_client_next_pose(stridewire_client* client, stridewire_world world,
                                              uint32_t avatar, uint64_t after_tick,
                                              stridewire_pose* pose) {
  return ReadPose(client, world, avatar, pose, [&](Session&, bool, const PoseHistory& history) {
    const auto index = after_tick == std::numeric_limits<std::uint64_t>::max()
                           ? std::optional<std::size_t>(0)
                           : history.FirstAfterTick(after_tick);
    if (index) WriteRaw(history, *index, pose);
  });
}

}  // extern "C"
