#include "message_json.h"

#include <string>

#include "base/check.h"
#include "json_support.h"
#include "sample_messages.h"
#include "stridewire/protocol/pose_batch_reader.h"

namespace stridewire::protocol {

std::string Hex(const std::vector<std::byte>& bytes) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::byte b : bytes) {
    text += kDigits[std::to_integer<int>(b) >> 4];
    text += kDigits[std::to_integer<int>(b) & 15];
  }
  return text;
}

Json Fields(const RotationQuantization& code) {
  const Quat& q = code.reference;
  return {{"reference", Json::array({q.x, q.y, q.z, q.w})},
          {"low", Fields(code.low)},
          {"step", Fields(code.step)},
          {"bits", code.bits},
          {"free_bits", code.smallest_three_bits},
          {"least_w", code.least_w}};
}

Json Fields(const RequestItem& item) {
  Json json = {{"avatar", item.avatar},
               {"request_id", Decimal(item.request_id)},
               {"type", item.movement.index()},
               {"takeover", Number(item.interrupt)}};
  if (const auto* step = std::get_if<StepMovement>(&item.movement)) {
    json["foot"] = Number(step->foot);
    if (step->at) {
      json["at_m"] = Fields(step->at->position_m);
      json["heading_rad"] = step->at->heading_rad ? Json(*step->at->heading_rad) : Json(nullptr);
      json["must_be_met"] = step->exact_only;
      return json;
    }
    json["length_m"] = step->length_m;
    json["side_m"] = step->side_m ? Json(*step->side_m) : Json(nullptr);
    json["height_m"] = step->height_m;
    json["turn_rad"] = step->turn_rad;
  } else if (const auto* jump = std::get_if<JumpMovement>(&item.movement)) {
    json["length_m"] = jump->length_m;
    json["height_m"] = jump->height_m;
    json["turn_rad"] = jump->turn_rad;
  } else if (const auto* stand = std::get_if<StandMovement>(&item.movement)) {
    json["seconds"] = stand->seconds;
  } else {
    const auto& walk = std::get<WalkMovement>(item.movement);
    json["at_m"] = Fields(walk.position_m);
    json["heading_rad"] = walk.heading_rad;
    json["waypoints_m"] = Json::array();
    for (const DVec3& place : walk.waypoints_m) json["waypoints_m"].push_back(Fields(place));
    json["speed_m_s"] = walk.speed_m_s ? Json(*walk.speed_m_s) : Json(nullptr);
  }
  return json;
}

Json ListJson(const ParameterSet& set) {
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
                     {"root_position_m", Fields(root)},
                     {"rotations", quats}});
  }
  Json json = {{"world", m.info.world},
               {"shard", m.info.shard},
               {"part", m.info.part},
               {"parts", m.info.parts},
               {"tick", Decimal(m.info.tick)},
               {"server_time_s", m.info.server_time_s},
               {"mode", Number(m.info.mode)},
               {"joint_count", m.info.joint_count},
               {"poses", poses}};
  if (m.info.is_partial) json["partial"] = true;
  return json;
}

Json ToJson(const Message& message) {
  return std::visit(
      [](const auto& m) {
        Json json = {{"type", MessageTypeName(m.kType)}, {"type_number", Number(m.kType)}};
        json["fields"] = Fields(m);
        return json;
      },
      message);
}

}  // namespace stridewire::protocol
