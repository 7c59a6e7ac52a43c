#include "message_json.h"

#include <stdexcept>
#include <string>

#include "base/check.h"
#include "json_support.h"
#include "message_list.h"
#include "sample_messages.h"
#include "stridewire/protocol/pose_batch_reader.h"

namespace stridewire::protocol {

Json Value(const std::vector<std::byte>& bytes) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::byte b : bytes) {
    text += kDigits[std::to_integer<int>(b) >> 4];
    text += kDigits[std::to_integer<int>(b) & 15];
  }
  return text;
}

Json Fields(const RotationQuantization& m) {
  const Quat& q = m.reference;
  return {{"reference", Json::array({q.x, q.y, q.z, q.w})},
          {"low", Value(m.low)},
          {"step", Value(m.step)},
          {"bits", m.bits},
          {"smallest_three_bits", m.smallest_three_bits},
          {"least_w", m.least_w}};
}

Json Value(const ParameterSet& set) {
  Json json = Json::array();
  for (std::size_t p = 0; p < set.count; ++p) {
    json.push_back({{"name", set.names[p]}, {"value", set.values[p]}});
  }
  return json;
}

Json Fields(const PoseBatch& m) {
  Json poses = Json::array();
  std::vector<Quat> rotations(m.info.joint_count);
  PoseBatchReader reader(m, SampleCodecs().Find(m.info.mode));
  for (std::size_t i = 0; i < m.avatars.size(); ++i) {
    Vec3 root(0.0f);
    reader.Next();
    STRIDEWIRE_CHECK(reader.Decode(root, rotations));
    Json quats = Json::array();
    for (const Quat& q : rotations) quats.push_back(Json::array({q.x, q.y, q.z, q.w}));
    poses.push_back({{"avatar", m.avatars[i]},
                     {"flags", m.flags[i]},
                     {"root_position_m", Value(root)},
                     {"rotations", quats}});
  }
  Json json = {{"world", m.info.world},
               {"shard", m.info.shard},
               {"part", m.info.part},
               {"parts", m.info.parts},
               {"tick", Value(m.info.tick)},
               {"server_time_s", m.info.server_time_s},
               {"mode", Value(m.info.mode)},
               {"joint_count", m.info.joint_count},
               {"poses", poses}};
  if (m.info.is_partial) json["partial"] = true;
  return json;
}

void FromJson(const Json& json, std::vector<std::byte>& out) {
  const auto text = json.get<std::string>();
  out.clear();
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
    out.push_back(static_cast<std::byte>(std::stoi(text.substr(i, 2), nullptr, 16)));
  }
}

void FromJson(const Json& json, RotationQuantization& m) {
  const std::vector<float> q = json.at("reference");
  m.reference = Quat(q.at(3), q.at(0), q.at(1), q.at(2));
  Get(json, "low", m.low);
  Get(json, "step", m.step);
  json.at("bits").get_to(m.bits);
  Get(json, "smallest_three_bits", m.smallest_three_bits);
  Get(json, "least_w", m.least_w);
}

void FromJson(const Json& json, ParameterSet& set) {
  set = {};
  for (const Json& parameter : json) {
    Get(parameter, "name", set.names.at(set.count));
    Get(parameter, "value", set.values.at(set.count++));
  }
}

Json ToJson(const Message& message) {
  return std::visit(
      [](const auto& m) {
        Json json = {{"type", MessageTypeName(m.kType)}, {"type_number", Value(m.kType)}};
        json["fields"] = Fields(m);
        return json;
      },
      message);
}

Message FromJson(const Json& json) {
  const auto name = json.at("type").get<std::string>();
#define STRIDEWIRE_CASE(Struct, Name, ...)            \
  if constexpr (!std::is_same_v<Struct, PoseBatch>) { \
    if (name == #Name) {                              \
      Struct message;                                 \
      FromJson(json.at("fields"), message);           \
      return message;                                 \
    }                                                 \
  }
  STRIDEWIRE_MESSAGES(STRIDEWIRE_CASE)
#undef STRIDEWIRE_CASE
  throw std::invalid_argument("no message \"" + name + "\" can be read from JSON");
}

}  // namespace stridewire::protocol
