#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stridewire/protocol/compact_codecs.h"
#include "stridewire/protocol/encoder.h"
#include "stridewire/protocol/messages.h"
#include "stridewire/protocol/pose_rows.h"

/// Messages of a small fictitious server and world, for tests of clients.
namespace stridewire::test_world {

inline constexpr int kJoints = 3;
inline constexpr double kTickHz = 60.0;

inline protocol::Welcome Welcome(bool resumed = false) {
  protocol::Welcome welcome;
  welcome.session = 7;
  welcome.resume_token = std::vector<std::byte>(16, std::byte{0x5a});
  welcome.resumed = resumed;
  welcome.tick_hz = kTickHz;
  welcome.server_name = "test";
  welcome.server_version = "0";
  welcome.limits.max_avatars_per_world = 1000;
  welcome.limits.max_queue = 64;
  welcome.limits.idle_timeout_s = 30.0;
  welcome.limits.resume_window_s = 60.0;
  return welcome;
}

/// Hips and head rotate about any axis, the spine does not rotate.
inline std::vector<RotationQuantization> RotationQuantizations() {
  std::vector<RotationQuantization> codes(kJoints);
  codes[0].smallest_three_bits = 12;
  codes[1].step = Vec3(0.02f);
  codes[2].smallest_three_bits = 14;
  return codes;
}
/// With reduced joints, the rotation of the head is omitted.
inline std::vector<std::uint16_t> FewerJoints() { return {0, 1}; }
inline protocol::CompactCodecs Codecs() {
  return protocol::CompactCodecs::Make(RotationQuantizations(),
                                       std::array<std::int16_t, kJoints>{-1, 0, 1}, FewerJoints())
      .value();
}

inline protocol::WorldInfo WorldInfo(protocol::Seq seq, protocol::WorldId world,
                                     const std::string& name) {
  protocol::WorldInfo info;
  info.seq = seq;
  info.world = world;
  info.name = name;
  info.library_hash = "0123456789abcdef";
  info.skeleton.joints = {{"hips", -1, Vec3(0.0f)},
                          {"spine", 0, Vec3(0.0f, 0.2f, 0.0f)},
                          {"head", 1, Vec3(0.0f, 0.4f, 0.0f)}};
  info.skeleton.end_sites = {{2, Vec3(0.0f, 0.1f, 0.0f)}};
  info.rotation_quantizations = RotationQuantizations();
  info.reduced_joints = FewerJoints();
  return info;
}

inline protocol::Reply Ok(protocol::Seq seq, std::uint32_t accepted = 1) {
  protocol::Reply reply;
  reply.seq = seq;
  reply.accepted = accepted;
  return reply;
}

inline double TickTime(std::uint64_t tick) { return static_cast<double>(tick) / kTickHz; }

/// Root position of an avatar that walks along +z at 1.5 m/s. RotationsAt turns its head at 1
/// rad/s.
inline Vec3 RootAt(double time_s, std::uint32_t avatar = 1) {
  return {static_cast<float>(avatar), 1.0f, static_cast<float>(1.5 * time_s)};
}
inline std::vector<Quat> RotationsAt(double time_s) {
  return {kIdentityQuat, kIdentityQuat, YawRotation(time_s)};
}

struct AvatarAt {
  std::uint32_t avatar = 1;
  std::uint8_t flags = 0;
  std::optional<Vec3> root_position_m = {};  ///< Default: the position that RootAt returns.
};

/// Returns the frame of one batch.
inline std::vector<std::byte> PoseFrame(protocol::WorldId world, std::uint64_t tick,
                                        const std::vector<AvatarAt>& avatars,
                                        protocol::PoseMode mode = protocol::PoseMode::kFull,
                                        std::uint16_t shard = 0, int joints = kJoints,
                                        bool is_partial = false) {
  protocol::PoseBatchInfo info;
  info.world = world;
  info.shard = shard;
  info.tick = tick;
  info.server_time_s = TickTime(tick);
  info.mode = mode;
  info.joint_count = static_cast<std::uint16_t>(joints);
  auto rotations = RotationsAt(info.server_time_s);
  rotations.resize(static_cast<std::size_t>(joints), kIdentityQuat);
  std::vector<protocol::AvatarId> numbers;
  std::vector<std::uint32_t> all;
  for (const AvatarAt& a : avatars) {
    all.push_back(static_cast<std::uint32_t>(numbers.size()));
    numbers.push_back(a.avatar);
  }
  const protocol::CompactCodecs codecs = Codecs();
  protocol::PoseRows rows;
  (void)rows.Begin(info, std::make_shared<const std::vector<protocol::AvatarId>>(numbers),
                   codecs.Find(mode));
  for (const AvatarAt& a : avatars) {
    (void)rows.Add(a.flags, a.root_position_m.value_or(RootAt(info.server_time_s, a.avatar)),
                   rotations);
  }
  std::vector<std::byte> frame;
  (void)protocol::PoseBatchComposer().Compose(rows, all, {.is_partial = is_partial}, frame);
  return frame;
}

}  // namespace stridewire::test_world
