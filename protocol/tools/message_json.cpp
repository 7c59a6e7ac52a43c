#include "message_json.h"

#include <string>

#include "base/check.h"
#include "sample_messages.h"
#include "stridewire/protocol/pose_batch_reader.h"

namespace stridewire::protocol {
namespace {

using Json = nlohmann::ordered_json;

std::string Decimal(std::uint64_t value) { return std::to_string(value); }

template <typename E>
int Number(E e) {
  return static_cast<int>(e);
}

template <typename V>
Json Vector(const V& v) {
  return Json::array({v.x, v.y, v.z});
}

std::string Hex(const std::vector<std::byte>& bytes) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::byte b : bytes) {
    text += kDigits[std::to_integer<int>(b) >> 4];
    text += kDigits[std::to_integer<int>(b) & 15];
  }
  return text;
}

Json Fields(const Hello& m) {
  return {
      {"protocol_min", m.protocol_min},      {"protocol_max", m.protocol_max},
      {"client_name", m.client_name},        {"auth_token", m.auth_token},
      {"resume_token", Hex(m.resume_token)}, {"last_events_number", Decimal(m.last_events_number)}};
}

Json Fields(const JoinWorld& m) {
  return {{"seq", Decimal(m.seq)}, {"name", m.name}, {"role", Number(m.role)}};
}

Json Fields(const LeaveWorld& m) { return {{"seq", Decimal(m.seq)}, {"world", m.world}}; }

Json Fields(const Spawn& m) {
  Json items = Json::array();
  for (const SpawnItem& item : m.items) {
    items.push_back({{"avatar", item.avatar},
                     {"position_m", Vector(item.start.position_m)},
                     {"heading_rad", item.start.heading_rad}});
  }
  return {{"seq", Decimal(m.seq)}, {"world", m.world}, {"items", items}};
}

Json Fields(const Remove& m) {
  return {{"seq", Decimal(m.seq)}, {"world", m.world}, {"avatars", m.avatars}};
}

Json Item(const RequestItem& item) {
  Json json = {{"avatar", item.avatar},
               {"request_id", Decimal(item.request_id)},
               {"type", item.movement.index()},
               {"takeover", Number(item.interrupt)}};
  if (const auto* step = std::get_if<StepMovement>(&item.movement)) {
    json["foot"] = Number(step->foot);
    if (step->at) {
      json["at_m"] = Vector(step->at->position_m);
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
    json["at_m"] = Vector(walk.position_m);
    json["heading_rad"] = walk.heading_rad;
    json["waypoints_m"] = Json::array();
    for (const DVec3& place : walk.waypoints_m) json["waypoints_m"].push_back(Vector(place));
    json["speed_m_s"] = walk.speed_m_s ? Json(*walk.speed_m_s) : Json(nullptr);
  }
  return json;
}

Json Items(const std::vector<RequestItem>& items) {
  Json json = Json::array();
  for (const RequestItem& item : items) json.push_back(Item(item));
  return json;
}

Json Fields(const Request& m) {
  return {{"seq", Decimal(m.seq)}, {"world", m.world}, {"items", Items(m.items)}};
}

Json Fields(const CancelQueue& m) {
  return {{"seq", Decimal(m.seq)}, {"world", m.world}, {"avatars", m.avatars}};
}

Json Fields(const Observe& m) {
  Json json = {{"seq", Decimal(m.seq)},          {"world", m.world},
               {"subscription", m.subscription}, {"mode", Number(m.mode)},
               {"avatars", m.avatars},           {"every_n_ticks", m.every_n_ticks},
               {"with_events", m.with_events}};
  if (m.detail != PoseDetail::kAll) json["detail"] = Number(m.detail);
  if (!m.region) return json;
  const Region& region = *m.region;
  Json rings = Json::array();
  for (const RateRing& ring : region.rings) {
    rings.push_back({{"to_m", ring.to_m}, {"every_n_ticks", ring.every_n_ticks}});
  }
  json["region"] = {{"centre_m", {{"x", region.centre_m.x}, {"z", region.centre_m.z}}},
                    {"radius_m", region.radius_m},
                    {"leave_m", region.leave_m ? Json(*region.leave_m) : Json(nullptr)},
                    {"rings", rings}};
  if (!region.ring_details.empty()) {
    Json& details = json["region"]["ring_details"] = Json::array();
    for (const PoseDetail detail : region.ring_details) details.push_back(Number(detail));
  }
  json["replace"] = m.replace;
  return json;
}

Json Fields(const StopObserving& m) {
  return {{"seq", Decimal(m.seq)}, {"subscription", m.subscription}};
}

Json Fields(const Ping& m) { return {{"nonce", Decimal(m.nonce)}, {"time_s", m.time_s}}; }

Json Fields(const InspectAvatar& m) {
  return {{"nonce", Decimal(m.nonce)}, {"world", m.world}, {"avatar", m.avatar}};
}

Json Fields(const Goodbye& m) { return {{"code", Number(m.code)}, {"text", m.text}}; }

Json Fields(const Welcome& m) {
  return {{"protocol", m.protocol},
          {"session", Decimal(m.session)},
          {"resume_token", Hex(m.resume_token)},
          {"resumed", m.resumed},
          {"last_seq", Decimal(m.last_seq)},
          {"tick_hz", m.tick_hz},
          {"server_name", m.server_name},
          {"server_version", m.server_version},
          {"limits",
           {{"max_control_bytes", m.limits.max_control_bytes},
            {"max_bulk_bytes", m.limits.max_bulk_bytes},
            {"max_items", m.limits.max_items},
            {"max_avatars_per_world", m.limits.max_avatars_per_world},
            {"max_queue", m.limits.max_queue},
            {"reply_memory", m.limits.reply_memory},
            {"idle_timeout_s", m.limits.idle_timeout_s},
            {"resume_window_s", m.limits.resume_window_s}}}};
}

Json Leg(const LegInfo& leg) {
  return {{"hip", leg.hip},
          {"knee", leg.knee},
          {"ankle", leg.ankle},
          {"ball", leg.ball},
          {"ball_offset_m", Vector(leg.ball_offset_m)},
          {"toe_tip_offset_m", Vector(leg.toe_tip_offset_m)}};
}

Json Fields(const RotationQuantization& code) {
  const Quat& q = code.reference;
  return {{"reference", Json::array({q.x, q.y, q.z, q.w})},
          {"low", Vector(code.low)},
          {"step", Vector(code.step)},
          {"bits", code.bits},
          {"free_bits", code.smallest_three_bits},
          {"least_w", code.least_w}};
}

Json Fields(const WorldInfo& m) {
  Json joints = Json::array();
  for (const JointInfo& joint : m.skeleton.joints) {
    joints.push_back(
        {{"name", joint.name}, {"parent", joint.parent}, {"offset_m", Vector(joint.offset_m)}});
  }
  Json end_sites = Json::array();
  for (const EndSiteInfo& site : m.skeleton.end_sites) {
    end_sites.push_back({{"joint", site.joint}, {"offset_m", Vector(site.offset_m)}});
  }
  Json codes = Json::array();
  for (const RotationQuantization& code : m.rotation_codes) codes.push_back(Fields(code));
  Json json = {{"seq", Decimal(m.seq)},
               {"world", m.world},
               {"name", m.name},
               {"role", Number(m.role)},
               {"tick", Decimal(m.tick)},
               {"library_hash", m.library_hash},
               {"skeleton",
                {{"joints", joints},
                 {"end_sites", end_sites},
                 {"left_leg", Leg(m.skeleton.legs[0])},
                 {"right_leg", Leg(m.skeleton.legs[1])}}},
               {"layers", m.layers},
               {"rotation_codes", codes}};
  if (!m.reduced_joints.empty()) json["fewer_joints"] = m.reduced_joints;
  return json;
}

Json Fields(const Reply& m) {
  Json items = Json::array();
  for (const ReplyItem& item : m.items) {
    items.push_back({{"index", item.index},
                     {"avatar", item.avatar},
                     {"request_id", Decimal(item.request_id)},
                     {"code", Number(item.code)},
                     {"text", item.text}});
  }
  return {{"seq", Decimal(m.seq)},
          {"code", Number(m.code)},
          {"text", m.text},
          {"accepted", m.accepted},
          {"items", items}};
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
                     {"root_position_m", Vector(root)},
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

Json Parameters(const ParameterSet& set) {
  Json json = Json::array();
  for (std::size_t p = 0; p < set.count; ++p) {
    json.push_back({{"name", set.names[p]}, {"value", set.values[p]}});
  }
  return json;
}

Json Fields(const Events& m) {
  Json events = Json::array();
  for (const Event& event : m.events) {
    events.push_back({{"type", Number(event.type)},
                      {"avatar", event.avatar},
                      {"request_id", Decimal(event.request_id)},
                      {"kind", Number(event.kind)},
                      {"group", event.group},
                      {"tick", Decimal(event.tick)},
                      {"time_s", event.time_s},
                      {"requested", Parameters(event.requested)},
                      {"applied", Parameters(event.applied)},
                      {"extrapolated", event.extrapolated},
                      {"clamped", event.clamped},
                      {"cut_short", event.cut_short},
                      {"foot", Number(event.foot)},
                      {"position_m", Vector(event.position_m)},
                      {"base_position_m", Vector(event.base.position_m)},
                      {"base_heading_rad", event.base.heading_rad},
                      {"code", Number(event.code)},
                      {"reason", event.reason}});
  }
  return {{"world", m.world},
          {"number", Decimal(m.number)},
          {"tick", Decimal(m.tick)},
          {"events", events}};
}

Json Fields(const Lagging& m) {
  return {{"world", m.world},
          {"dropped_batches", Decimal(m.dropped_batches)},
          {"dropped_events", Decimal(m.dropped_events)}};
}

Json Fields(const ErrorNotice& m) {
  return {{"code", Number(m.code)}, {"text", m.text}, {"fatal", m.fatal}, {"seq", Decimal(m.seq)}};
}

Json Fields(const Pong& m) {
  return {{"nonce", Decimal(m.nonce)},
          {"time_s", m.time_s},
          {"server_time_s", m.server_time_s},
          {"tick", Decimal(m.tick)}};
}

Json Movement(const CurrentMovement& m) {
  Json landings = Json::array();
  for (const Landing& landing : m.landings) {
    landings.push_back({{"foot", Number(landing.foot)},
                        {"position_m", Vector(landing.position_m)},
                        {"heading_rad", landing.heading_rad}});
  }
  return {{"request_id", Decimal(m.request_id)},
          {"kind", Number(m.kind)},
          {"group", m.group},
          {"started_s", m.started_s},
          {"keytimes_s", m.keytimes_s},
          {"generic_time", m.generic_time},
          {"ease_out_s", m.ease_out_s},
          {"requested", Parameters(m.requested)},
          {"applied", Parameters(m.applied)},
          {"extrapolated", m.extrapolated},
          {"clamped", m.clamped},
          {"weights", m.weights},
          {"parameter_names", m.parameter_names},
          {"sites", m.sites},
          {"landings", landings}};
}

Json Fields(const AvatarState& m) {
  Json layers = Json::array();
  for (const PlayingLayer& layer : m.layers) {
    layers.push_back({{"layer", layer.layer},
                      {"weight", layer.weight},
                      {"time_s", layer.time_s},
                      {"speed", layer.speed},
                      {"ending", layer.is_ending}});
  }
  return {{"nonce", Decimal(m.nonce)},
          {"world", m.world},
          {"avatar", m.avatar},
          {"code", Number(m.code)},
          {"text", m.text},
          {"tick", Decimal(m.tick)},
          {"server_time_s", m.server_time_s},
          {"base_position_m", Vector(m.base.position_m)},
          {"base_heading_rad", m.base.heading_rad},
          {"movement", m.movement ? Movement(*m.movement) : Json(nullptr)},
          {"queue_size", m.queue_size},
          {"queue", Items(m.queue)},
          {"planting_off", !m.planting_enabled},
          {"layers", layers}};
}

Json Terrain(const std::optional<TerrainInfo>& terrain) {
  if (!terrain) return nullptr;
  Json json = {{"height_field", nullptr}, {"boxes", Json::array()}};
  if (const auto& field = terrain->height_field) {
    json["height_field"] = {{"origin_m", {field->origin_m.x, field->origin_m.z}},
                            {"cell_m", field->cell_m},
                            {"columns", field->columns},
                            {"rows", field->rows},
                            {"heights_m", field->heights_m}};
  }
  for (const TerrainBoxInfo& box : terrain->boxes) {
    json["boxes"].push_back({{"min_x", box.min_m.x},
                             {"min_z", box.min_m.z},
                             {"max_x", box.max_m.x},
                             {"max_z", box.max_m.z},
                             {"height_m", box.height_m}});
  }
  return json;
}

Json Fields(const SetTerrain& m) {
  return {{"seq", Decimal(m.seq)}, {"world", m.world}, {"terrain", Terrain(m.terrain)}};
}

Json Fields(const SetLayers& m) {
  Json items = Json::array();
  for (const LayerItem& item : m.items) {
    items.push_back({{"avatar", item.avatar},
                     {"layer", item.layer},
                     {"off", item.fade_out},
                     {"weight", item.weight},
                     {"blend_s", item.blend_s},
                     {"speed", item.speed}});
  }
  return {{"seq", Decimal(m.seq)}, {"world", m.world}, {"items", items}};
}

Json Fields(const SetPlanting& m) {
  return {{"seq", Decimal(m.seq)}, {"world", m.world}, {"avatars", m.avatars}, {"off", !m.enabled}};
}

Json Fields(const FetchLibrary& m) {
  return {{"nonce", Decimal(m.nonce)},
          {"hash", m.hash},
          {"offset", Decimal(m.offset)},
          {"length", m.length}};
}

Json Fields(const Movements& m) {
  return {{"world", m.world},
          {"shard", m.shard},
          {"part", m.part},
          {"parts", m.parts},
          {"more_steps", m.more_steps},
          {"step", Decimal(m.step)},
          {"tick", Decimal(m.tick)},
          {"server_time_s", m.server_time_s},
          {"states", m.states},
          {"avatars", m.avatars},
          {"flags", m.flags},
          {"ends", m.ends},
          {"records", Hex(m.records)}};
}

Json Fields(const LibraryPiece& m) {
  return {{"nonce", Decimal(m.nonce)},
          {"code", Number(m.code)},
          {"text", m.text},
          {"hash", m.hash},
          {"total_bytes", Decimal(m.total_bytes)},
          {"offset", Decimal(m.offset)},
          {"bytes", Hex(m.bytes)}};
}

Json Fields(const WorldTerrain& m) { return {{"world", m.world}, {"terrain", Terrain(m.terrain)}}; }

}  // namespace

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
