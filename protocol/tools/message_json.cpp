#include "message_json.h"

#include <deque>
#include <stdexcept>
#include <string>

#include "base/check.h"
#include "json_support.h"
#include "message_list.h"
#include "sample_messages.h"
#include "stridewire/protocol/pose_batch_reader.h"

namespace stridewire::protocol {

std::string Hexadecimal(const std::vector<std::byte>& bytes) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::byte b : bytes) {
    text += kDigits[std::to_integer<int>(b) >> 4];
    text += kDigits[std::to_integer<int>(b) & 15];
  }
  return text;
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

void Get(const Json& json, const char* name, std::uint64_t& out) {
  if (json.contains(name)) out = std::stoull(json[name].get<std::string>());
}

void Get(const Json& json, const char* name, std::vector<std::byte>& out) {
  const auto text = json.value(name, std::string());
  out.clear();
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
    out.push_back(static_cast<std::byte>(std::stoi(text.substr(i, 2), nullptr, 16)));
  }
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
  const CompactCodec* codec = SampleCodecs().Find(m.info.mode);
  for (const Json& pose : json.contains("poses") ? json["poses"] : Json()) {
    Get(pose, "avatar", avatars.emplace_back());
    Get(pose, "flags", flags.emplace_back());
    Vec3 root(0.0f);
    std::vector<Quat> rotations;
    Get(pose, "root_position_m", root);
    Get(pose, "rotations", rotations);
    std::vector<std::byte> bytes;
    if (codec != nullptr && (flags.back() & kPoseUncompressed) == 0) {
      CompactCodec::Block block;
      block.Add(root, rotations);
      codec->Encode(block);
      STRIDEWIRE_CHECK(block.fits(0));
      bytes.resize(codec->pose_bytes());
      block.CopyBytes(0, bytes);
    } else {
      const PoseMode mode = codec != nullptr ? PoseMode::kQuantised : m.info.mode;
      bytes.resize(PoseBytes(mode, rotations.size()));
      STRIDEWIRE_CHECK(EncodePose(mode, root, rotations, bytes));
    }
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
  if (name == #Name) {                     \
    Struct message;                        \
    json.at("fields").get_to(message);     \
    return message;                        \
  }
  STRIDEWIRE_MESSAGES(STRIDEWIRE_CASE)
#undef STRIDEWIRE_CASE
  throw std::invalid_argument("unknown message \"" + name + "\"");
}

}  // namespace stridewire::protocol
