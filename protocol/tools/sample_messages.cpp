#include "sample_messages.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "base/check.h"
#include "base/trig.h"
#include "message_json.h"

namespace stridewire::protocol {
namespace {

Message ReadSample(const std::filesystem::path& path) {
  std::ifstream file(path);
  STRIDEWIRE_CHECK(file.good());
  return FromJson(nlohmann::ordered_json::parse(file));
}

const std::filesystem::path kFolder =
    std::filesystem::path(STRIDEWIRE_SOURCE_DIR) / "protocol" / "vectors";

/// The world whose poses the batches contain.
const WorldInfo& SampleWorld() {
  static const WorldInfo world =
      std::get<WorldInfo>(ReadSample(kFolder / "world_info_detail.json"));
  return world;
}

// Poses within the range of the rotation codes. Only the second pose is outside: its left knee
// rotates about another axis.
struct CompactArrays {
  PoseBatchInfo info{3, 1, 2, 4, 123'456, 2057.6, PoseMode::kCompact, 8};
  std::vector<AvatarId> avatars = {1, 1001, 2001};
  std::vector<std::uint8_t> flags = {kPoseStanding, kPoseUncompressed, kPoseDiscontinuity};
  std::vector<std::byte> poses;

  explicit CompactArrays(PoseMode mode) {
    info.mode = mode;
    // In this mode a pose contains only its root, which always fits.
    if (mode == PoseMode::kCompactRoot) flags[1] = 0;
    const CompactCodec& codec = *SampleCodecs().Find(mode);
    const std::vector<RotationQuantization>& codes = SampleWorld().rotation_quantizations;
    CompactCodec::Block block;
    for (int a = 0; a < 3; ++a) {
      std::vector<Quat> rotations;
      for (std::size_t j = 0; j < codes.size(); ++j) {
        const double angle = 0.7 * a + 0.45 * static_cast<double>(j);
        Vec3 v(Sin(angle), Cos(1.3 * angle), Sin(0.4 + 2.1 * angle));
        if (codes[j].smallest_three_bits == 0) {
          v *= 0.25f;
          for (int c = 0; c < 3; ++c) {
            if (codes[j].bits[static_cast<std::size_t>(c)] < 8) v[c] = 0.0f;
          }
          if (j == 6) v = Vec3(v.x, 0.4f * v.y, 0.2f * v.z);
          if (a == 1 && j == 2) v.y = 0.25f;
        }
        rotations.push_back(
            Normalise(codes[j].reference * Quat(static_cast<float>(Cos(0.3 * a)), v.x, v.y, v.z)));
      }
      block.Add(Vec3(-1.5f * static_cast<float>(a), 0.9375f, 70'000.25f), rotations);
    }
    codec.Encode(block);
    for (std::size_t a = 0; a < 3; ++a) {
      STRIDEWIRE_CHECK(block.fits(a) == ((flags[a] & kPoseUncompressed) == 0));
      const std::size_t begin = poses.size();
      if (block.fits(a)) {
        poses.resize(begin + codec.pose_bytes());
        block.CopyBytes(a, std::span(poses).subspan(begin));
        continue;
      }
      poses.resize(begin + PoseBytes(PoseMode::kQuantised, 8));
      Vec3 root_position_m;
      std::vector<Quat> rotations(8);
      block.Get(a, root_position_m, rotations);
      STRIDEWIRE_CHECK(EncodePose(PoseMode::kQuantised, root_position_m, rotations,
                                  std::span(poses).subspan(begin)));
    }
  }

  [[nodiscard]] PoseBatch view() const { return {info, avatars, flags, poses}; }
};

/// Arrays of a batch. The rotations cover every dropped component and both signs.
struct BatchArrays {
  PoseBatchInfo info;
  std::vector<AvatarId> avatars;
  std::vector<std::uint8_t> flags;
  std::vector<std::byte> poses;

  BatchArrays(PoseMode mode, std::uint16_t joint_count, int avatar_count) {
    info = {3, 1, 2, 4, 123'456, 2057.6, mode, joint_count};
    const std::size_t bytes = PoseBytes(mode, joint_count);
    poses.resize(bytes * static_cast<std::size_t>(avatar_count));
    for (int a = 0; a < avatar_count; ++a) {
      avatars.push_back(static_cast<AvatarId>(a * 1000 + 1));
      flags.push_back(static_cast<std::uint8_t>(a % 4));
      std::vector<Quat> rotations;
      for (int j = 0; j < joint_count; ++j) {
        const double angle = 0.7 * a + 0.45 * j;
        const double x = Sin(angle), y = Cos(1.3 * angle), z = Sin(0.4 + 2.1 * angle),
                     w = Cos(angle);
        const double length = std::sqrt(x * x + y * y + z * z + w * w);
        rotations.push_back(Quat(static_cast<float>(w / length), static_cast<float>(x / length),
                                 static_cast<float>(y / length), static_cast<float>(z / length)));
      }
      const Vec3 root(1.5f * static_cast<float>(a), 0.9375f, -2.0f + 0.25f * static_cast<float>(a));
      STRIDEWIRE_CHECK(
          EncodePose(mode, root, rotations,
                     std::span(poses).subspan(bytes * static_cast<std::size_t>(a), bytes)));
    }
  }

  [[nodiscard]] PoseBatch view() const { return {info, avatars, flags, poses}; }
};

/// Returns the samples of PoseBatch. Their JSON contains decoded poses, which do not determine the
/// bytes.
std::vector<SampleMessage> Batches() {
  static const BatchArrays full(PoseMode::kFull, 8, 3);
  static const BatchArrays quantised(PoseMode::kQuantised, 8, 3);
  static const BatchArrays nobody(PoseMode::kQuantised, 31, 0);
  static const CompactArrays compact(PoseMode::kCompact);
  static const CompactArrays fewer(PoseMode::kCompactReduced);
  static const CompactArrays root(PoseMode::kCompactRoot);
  PoseBatch partial = quantised.view();
  partial.info.is_partial = true;
  return {{"pose_batch_full", full.view()},       {"pose_batch_quantised", quantised.view()},
          {"pose_batch_empty", nobody.view()},    {"pose_batch_partial", partial},
          {"pose_batch_compact", compact.view()}, {"pose_batch_fewer", fewer.view()},
          {"pose_batch_root", root.view()}};
}

}  // namespace

const CompactCodecs& SampleCodecs() {
  static const CompactCodecs codecs = [] {
    const WorldInfo& world = SampleWorld();
    std::vector<std::int16_t> parents;
    for (const JointInfo& joint : world.skeleton.joints) parents.push_back(joint.parent);
    return CompactCodecs::Make(world.rotation_quantizations, parents, world.reduced_joints).value();
  }();
  return codecs;
}

std::vector<SampleMessage> SampleMessages() {
  std::vector<SampleMessage> samples = Batches();
  for (const auto& entry : std::filesystem::directory_iterator(kFolder)) {
    const std::string name = entry.path().stem().string();
    if (entry.path().extension() != ".json" || name.starts_with("pose_batch")) continue;
    samples.push_back({name, ReadSample(entry.path())});
  }
  std::ranges::sort(samples, {}, &SampleMessage::name);
  return samples;
}

}  // namespace stridewire::protocol
