#include "test_vectors.h"

#include <deque>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "base/check.h"
#include "json_support.h"
#include "message_list.h"
#include "stridewire/protocol/pose_batch_reader.h"

namespace stridewire::protocol {
namespace {

const std::filesystem::path kFolder =
    std::filesystem::path(STRIDEWIRE_SOURCE_DIR) / "protocol" / "vectors";

Message ReadVector(const std::filesystem::path& name) {
  std::ifstream file(kFolder / name);
  STRIDEWIRE_CHECK(file.good());
  return FromJson(Json::parse(file));
}

/// Encodes a pose in the mode of the batch.
std::vector<std::byte> Encode(const PoseBatch& m, std::uint8_t flags, const Vec3& root,
                              const std::vector<Quat>& rotations) {
  const CompactCodec* codec = SampleCodecs().Find(m.info.mode);
  if (codec == nullptr || (flags & kPoseUncompressed) != 0) {
    const PoseMode mode = codec != nullptr ? PoseMode::kQuantised : m.info.mode;
    std::vector<std::byte> bytes(PoseBytes(mode, rotations.size()));
    STRIDEWIRE_CHECK(EncodePose(mode, root, rotations, bytes));
    return bytes;
  }
  std::vector<std::byte> bytes(codec->pose_bytes());
  CompactCodec::Block block;
  block.Add(root, rotations);
  codec->Encode(block);
  STRIDEWIRE_CHECK(block.fits(0));
  block.CopyBytes(0, bytes);
  return bytes;
}

}  // namespace

std::string Hexadecimal(const std::vector<std::byte>& bytes) {
  std::string text;
  for (const std::byte b : bytes) {
    for (const std::byte digit : {b >> 4, b & std::byte{15}}) {
      text += "0123456789abcdef"[std::to_integer<int>(digit)];
    }
  }
  return text;
}

void Get(const Json& json, const char* name, std::uint64_t& out) {
  if (json.contains(name)) out = std::stoull(json[name].get<std::string>());
}

void Get(const Json& json, const char* name, std::vector<std::byte>& out) {
  const auto text = json.value(name, std::string());
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
    out.push_back(static_cast<std::byte>(std::stoi(text.substr(i, 2), nullptr, 16)));
  }
}

Json PosesOf(const PoseBatch& m) {
  Json poses = Json::array();
  std::vector<Quat> rotations(m.info.joint_count);
  PoseBatchReader reader(m, SampleCodecs().Find(m.info.mode));
  for (std::size_t i = 0; i < m.avatars.size(); ++i) {
    Vec3 root(0.0f);
    reader.Next();
    STRIDEWIRE_CHECK(reader.Decode(root, rotations));
    poses.push_back({{"avatar", m.avatars[i]},
                     {"flags", m.flags[i]},
                     {"root_position_m", root},
                     {"rotations", rotations}});
  }
  return poses;
}

void ReadPoses(const Json& json, PoseBatch& m) {
  struct Arrays {
    std::vector<AvatarId> avatars;
    std::vector<std::uint8_t> flags;
    std::vector<std::byte> poses;
  };
  // The batch borrows its arrays. They are never freed, because tests use few batches.
  static std::deque<Arrays> kept;
  auto& [avatars, flags, poses] = kept.emplace_back();
  for (const Json& pose : json.value("poses", Json::array())) {
    avatars.push_back(pose.at("avatar").get<AvatarId>());
    flags.push_back(pose.at("flags").get<std::uint8_t>());
    const auto bytes = Encode(m, flags.back(), pose.at("root_position_m").get<Vec3>(),
                              pose.at("rotations").get<std::vector<Quat>>());
    poses.insert(poses.end(), bytes.begin(), bytes.end());
  }
  m.avatars = avatars;
  m.flags = flags;
  m.poses = poses;
}

Json ToJson(const Message& message) {
  return std::visit(
      [](const auto& m) {
        return Json{{"type", MessageTypeName(m.kType)}, {"type_number", m.kType}, {"fields", m}};
      },
      message);
}

Message FromJson(const Json& json) {
  const auto name = json.at("type").get<std::string>();
#define STRIDEWIRE_CASE(Struct, Name, ...) \
  if (name == #Name) return json.at("fields").get<Struct>();
  STRIDEWIRE_MESSAGES(STRIDEWIRE_CASE)
#undef STRIDEWIRE_CASE
  throw std::invalid_argument("unknown message \"" + name + "\"");
}

const CompactCodecs& SampleCodecs() {
  static const CompactCodecs codecs = [] {
    const auto world = std::get<WorldInfo>(ReadVector("world_info_detail.json"));
    std::vector<std::int16_t> parents;
    for (const JointInfo& joint : world.skeleton.joints) parents.push_back(joint.parent);
    return CompactCodecs::Make(world.rotation_quantizations, parents, world.reduced_joints).value();
  }();
  return codecs;
}

std::map<std::string, Message> SampleMessages() {
  std::map<std::string, Message> samples;
  for (const auto& entry : std::filesystem::directory_iterator(kFolder)) {
    const auto& path = entry.path();
    if (path.extension() == ".json") samples.emplace(path.stem(), ReadVector(path.filename()));
  }
  return samples;
}

}  // namespace stridewire::protocol
