#include "stridewire/protocol/decode.h"

#include <bit>
#include <cstdint>
#include <optional>
#include <type_traits>

#include "stridewire/protocol/check.h"
#include "stridewire_generated.h"

namespace stridewire::protocol {
namespace {

static_assert(std::endian::native == std::endian::little, "batches are read in place");

// Largest number of tables in a payload. It exceeds the valid counts a little, so that a list that
// is slightly too long gets its own error. Beyond it the verifier fails.
constexpr std::size_t kFewTables = 1024;
constexpr std::size_t kCrowdTables = kMaxItems + 1024;

/// Copies a message from verified bytes. It checks lengths before it copies, because many
/// FlatBuffers offsets can refer to the same bytes, so that the decoded message is larger than its
/// payload.
class Unpacker {
 public:
  [[nodiscard]] std::optional<Error>& error() { return error_; }

  void Wrong(ErrorCode code, const char* text, const char* field, std::int64_t index = -1) {
    if (!error_) error_ = stridewire::Error{code, text, index, field};
  }

  /// Returns the number of entries to read. Without a list it is 0. A list that is too long or not
  /// aligned is an error and also yields 0.
  template <typename T>
  std::size_t Count(const flatbuffers::Vector<T>* list, std::size_t max, const char* field) {
    if (list == nullptr) return 0;
    // The verifier checks only the alignment of the length field, which is 4 bytes.
    if (reinterpret_cast<std::uintptr_t>(list->Data()) % alignof(std::remove_pointer_t<T>) != 0) {
      Wrong(ErrorCode::kMalformed, "list is not aligned", field);
      return 0;
    }
    if (list->size() <= max) return list->size();
    Wrong(ErrorCode::kLimitExceeded, "list is too long", field, list->size());
    return 0;
  }

  void Text(const flatbuffers::String* text, std::size_t max_bytes, std::string& out,
            const char* field, std::int64_t index = -1) {
    if (text == nullptr) return;
    if (text->size() > max_bytes) {
      Wrong(ErrorCode::kLimitExceeded, "text is too long", field, index);
      return;
    }
    out.assign(text->data(), text->size());
  }

  void Bytes(const flatbuffers::Vector<std::uint8_t>* bytes, std::size_t max, const char* field,
             std::vector<std::byte>& out) {
    if (const std::size_t count = Count(bytes, max, field); count > 0) {
      const auto* data = reinterpret_cast<const std::byte*>(bytes->data());
      out.assign(data, data + count);
    }
  }

  void Avatars(const flatbuffers::Vector<std::uint32_t>* avatars, const char* field,
               std::vector<AvatarId>& out) {
    if (const std::size_t count = Count(avatars, kMaxItems, field); count > 0) {
      out.assign(avatars->data(), avatars->data() + count);
    }
  }

  template <typename T>
  void Numbers(const flatbuffers::Vector<T>* list, std::size_t max, const char* field,
               std::vector<T>& out) {
    if (const std::size_t count = Count(list, max, field); count > 0) {
      out.assign(list->data(), list->data() + count);
    }
  }

  void Parameters(const flatbuffers::Vector<const wire::ParameterValue*>* list, const char* field,
                  ParameterSet& out) {
    const std::size_t count = Count(list, kMaxParameters, field);
    for (std::size_t p = 0; p < count; ++p) {
      const auto* value = list->Get(static_cast<flatbuffers::uoffset_t>(p));
      out.names[p] = value->name();
      out.values[p] = value->value();
    }
    out.count = static_cast<std::uint8_t>(count);
  }

 private:
  std::optional<stridewire::Error> error_;
};

DVec3 FromWire(const wire::Vec3* v) {
  return v == nullptr ? DVec3(0.0) : DVec3(v->x(), v->y(), v->z());
}

Vec3 FromWire(const wire::Offset* v) {
  return v == nullptr ? Vec3(0.0f) : Vec3(v->x(), v->y(), v->z());
}

void Unpack(Unpacker& u, const wire::Hello& w, Hello& m) {
  m.protocol_min = w.protocol_min();
  m.protocol_max = w.protocol_max();
  u.Text(w.client_name(), kMaxNameBytes, m.client_name, "Hello.client_name");
  u.Text(w.auth_token(), kMaxAuthTokenBytes, m.auth_token, "Hello.auth_token");
  u.Bytes(w.resume_token(), kMaxResumeTokenBytes, "Hello.resume_token", m.resume_token);
  m.last_events_number = w.last_events_number();
}

void Unpack(Unpacker& u, const wire::JoinWorld& w, JoinWorld& m) {
  m.seq = w.seq();
  u.Text(w.name(), kMaxNameBytes, m.name, "JoinWorld.name");
  m.role = static_cast<Role>(w.role());
}

void Unpack(Unpacker&, const wire::LeaveWorld& w, LeaveWorld& m) {
  m.seq = w.seq();
  m.world = w.world();
}

void Unpack(Unpacker& u, const wire::Spawn& w, Spawn& m) {
  m.seq = w.seq();
  m.world = w.world();
  m.items.resize(u.Count(w.items(), kMaxItems, "Spawn.items"));
  for (std::size_t i = 0; i < m.items.size(); ++i) {
    const auto* item = w.items()->Get(static_cast<flatbuffers::uoffset_t>(i));
    m.items[i].avatar = item->avatar();
    m.items[i].start = {FromWire(item->position_m()), item->heading_rad()};
  }
}

void Unpack(Unpacker& u, const wire::Remove& w, Remove& m) {
  m.seq = w.seq();
  m.world = w.world();
  u.Avatars(w.avatars(), "Remove.avatars", m.avatars);
}

void Unpack(Unpacker& u, const wire::RequestItem& w, RequestItem& item, const char* type_field,
            std::size_t index) {
  item.avatar = w.avatar();
  item.request_id = w.request_id();
  item.interrupt = static_cast<Interrupt>(w.takeover());
  switch (w.type()) {
    case wire::MovementType::Step: {
      StepMovement step{static_cast<FootChoice>(w.foot()), w.length_m(), std::nullopt, w.height_m(),
                        w.turn_rad()};
      if (const auto side = w.side_m()) step.side_m = *side;
      if (w.at_m() != nullptr) {
        step = {.foot = step.foot, .at = Footprint{FromWire(w.at_m()), std::nullopt}};
        if (const auto heading = w.heading_rad()) step.at->heading_rad = *heading;
      }
      step.exact_only = w.must_be_met();
      item.movement = step;
      break;
    }
    case wire::MovementType::Jump:
      item.movement = JumpMovement{w.length_m(), w.height_m(), w.turn_rad()};
      break;
    case wire::MovementType::Stand: item.movement = StandMovement{w.seconds()}; break;
    case wire::MovementType::Walk: {
      WalkMovement walk;
      if (w.at_m() == nullptr || !w.heading_rad()) {
        u.Wrong(ErrorCode::kMalformed, "a walk requires at_m and heading_rad", type_field,
                static_cast<std::int64_t>(index));
        break;
      }
      walk.position_m = FromWire(w.at_m());
      walk.heading_rad = *w.heading_rad();
      walk.waypoints_m.resize(u.Count(w.waypoints_m(), kMaxWaypoints, "Request.waypoints_m"));
      for (std::size_t i = 0; i < walk.waypoints_m.size(); ++i) {
        walk.waypoints_m[i] =
            FromWire(w.waypoints_m()->Get(static_cast<flatbuffers::uoffset_t>(i)));
      }
      if (const auto speed = w.speed_m_s()) walk.speed_m_s = *speed;
      item.movement = std::move(walk);
      break;
    }
    default:
      u.Wrong(ErrorCode::kMalformed, "unknown enumerator", type_field,
              static_cast<std::int64_t>(index));
  }
}

void Unpack(Unpacker& u, const wire::Request& w, Request& m) {
  m.seq = w.seq();
  m.world = w.world();
  m.items.resize(u.Count(w.items(), kMaxItems, "Request.items"));
  for (std::size_t i = 0; i < m.items.size(); ++i) {
    Unpack(u, *w.items()->Get(static_cast<flatbuffers::uoffset_t>(i)), m.items[i], "Request.type",
           i);
  }
}

void Unpack(Unpacker& u, const wire::CancelQueue& w, CancelQueue& m) {
  m.seq = w.seq();
  m.world = w.world();
  u.Avatars(w.avatars(), "CancelQueue.avatars", m.avatars);
}

void Unpack(Unpacker& u, const wire::Observe& w, Observe& m) {
  m.seq = w.seq();
  m.world = w.world();
  m.subscription = w.subscription();
  m.mode = static_cast<PoseMode>(w.mode());
  u.Avatars(w.avatars(), "Observe.avatars", m.avatars);
  m.every_n_ticks = w.every_n_ticks();
  m.with_events = w.with_events();
  m.replace = w.replace();
  m.detail = static_cast<PoseDetail>(w.detail());
  if (const wire::Region* from = w.region()) {
    Region& region = m.region.emplace();
    if (const auto* centre = from->centre_m()) region.centre_m = {centre->x(), centre->z()};
    region.radius_m = from->radius_m();
    if (const auto leave_m = from->leave_m()) region.leave_m = *leave_m;
    region.rings.resize(u.Count(from->rings(), kMaxRateRings, "Region.rings"));
    for (std::size_t i = 0; i < region.rings.size(); ++i) {
      const wire::RateRing* ring = from->rings()->Get(static_cast<flatbuffers::uoffset_t>(i));
      region.rings[i] = {ring->to_m(), ring->every_n_ticks()};
    }
    region.ring_details.resize(u.Count(from->ring_details(), kMaxRateRings, "Region.ring_details"));
    for (std::size_t i = 0; i < region.ring_details.size(); ++i) {
      region.ring_details[i] = static_cast<PoseDetail>(
          from->ring_details()->Get(static_cast<flatbuffers::uoffset_t>(i)));
    }
  }
}

void Unpack(Unpacker&, const wire::StopObserving& w, StopObserving& m) {
  m.seq = w.seq();
  m.subscription = w.subscription();
}

void Unpack(Unpacker&, const wire::Ping& w, Ping& m) {
  m.nonce = w.nonce();
  m.time_s = w.time_s();
}

void Unpack(Unpacker&, const wire::InspectAvatar& w, InspectAvatar& m) {
  m.nonce = w.nonce();
  m.world = w.world();
  m.avatar = w.avatar();
}

void Unpack(Unpacker& u, const wire::Goodbye& w, Goodbye& m) {
  m.code = static_cast<StatusCode>(w.code());
  u.Text(w.text(), kMaxTextBytes, m.text, "Goodbye.text");
}

void Unpack(Unpacker& u, const wire::Welcome& w, Welcome& m) {
  m.protocol = w.protocol();
  m.session = w.session();
  u.Bytes(w.resume_token(), kMaxResumeTokenBytes, "Welcome.resume_token", m.resume_token);
  m.resumed = w.resumed();
  m.last_seq = w.last_seq();
  m.tick_hz = w.tick_hz();
  u.Text(w.server_name(), kMaxNameBytes, m.server_name, "Welcome.server_name");
  u.Text(w.server_version(), kMaxNameBytes, m.server_version, "Welcome.server_version");
  if (const auto* limits = w.limits()) {
    m.limits = {limits->max_control_bytes(),     limits->max_bulk_bytes(), limits->max_items(),
                limits->max_avatars_per_world(), limits->max_queue(),      limits->reply_memory(),
                limits->idle_timeout_s(),        limits->resume_window_s()};
  }
}

void Unpack(const wire::Leg* w, LegInfo& leg) {
  if (w == nullptr) return;
  leg = {w->hip(),
         w->knee(),
         w->ankle(),
         w->ball(),
         FromWire(w->ball_offset_m()),
         FromWire(w->toe_tip_offset_m())};
}

void Unpack(Unpacker& u, const wire::WorldInfo& w, WorldInfo& m) {
  m.seq = w.seq();
  m.world = w.world();
  u.Text(w.name(), kMaxNameBytes, m.name, "WorldInfo.name");
  m.role = static_cast<Role>(w.role());
  m.tick = w.tick();
  u.Text(w.library_hash(), kMaxNameBytes, m.library_hash, "WorldInfo.library_hash");
  const auto* skeleton = w.skeleton();
  if (skeleton == nullptr) return;  // Check reports the missing joints.
  m.skeleton.joints.resize(u.Count(skeleton->joints(), kMaxJoints, "WorldInfo.skeleton.joints"));
  for (std::size_t j = 0; j < m.skeleton.joints.size(); ++j) {
    const auto* from = skeleton->joints()->Get(static_cast<flatbuffers::uoffset_t>(j));
    JointInfo& joint = m.skeleton.joints[j];
    u.Text(from->name(), kMaxNameBytes, joint.name, "WorldInfo.joint.name",
           static_cast<std::int64_t>(j));
    joint.parent = from->parent();
    joint.offset_m = FromWire(from->offset_m());
  }
  m.skeleton.end_sites.resize(
      u.Count(skeleton->end_sites(), kMaxEndSites, "WorldInfo.skeleton.end_sites"));
  for (std::size_t e = 0; e < m.skeleton.end_sites.size(); ++e) {
    const auto* from = skeleton->end_sites()->Get(static_cast<flatbuffers::uoffset_t>(e));
    m.skeleton.end_sites[e] = {from->joint(), FromWire(from->offset_m())};
  }
  Unpack(skeleton->left_leg(), m.skeleton.legs[0]);
  Unpack(skeleton->right_leg(), m.skeleton.legs[1]);
  m.layers.resize(u.Count(w.layers(), kMaxLayerNames, "WorldInfo.layers"));
  for (std::size_t l = 0; l < m.layers.size(); ++l) {
    u.Text(w.layers()->Get(static_cast<flatbuffers::uoffset_t>(l))->name(), kMaxNameBytes,
           m.layers[l], "WorldInfo.layers", static_cast<std::int64_t>(l));
  }
  m.rotation_codes.resize(u.Count(w.rotation_codes(), kMaxJoints, "WorldInfo.rotation_codes"));
  for (std::size_t j = 0; j < m.rotation_codes.size(); ++j) {
    const wire::RotationCode& from =
        *w.rotation_codes()->Get(static_cast<flatbuffers::uoffset_t>(j));
    const wire::Rotation& reference = from.reference();
    m.rotation_codes[j] = {
        .reference = Quat(reference.w(), reference.x(), reference.y(), reference.z()),
        .low = FromWire(&from.low()),
        .step = FromWire(&from.step()),
        .bits = {from.bits_x(), from.bits_y(), from.bits_z()},
        .smallest_three_bits = from.free_bits(),
        .least_w = from.least_w()};
  }
  m.reduced_joints.resize(u.Count(w.fewer_joints(), kMaxJoints, "WorldInfo.fewer_joints"));
  for (std::size_t i = 0; i < m.reduced_joints.size(); ++i) {
    m.reduced_joints[i] = w.fewer_joints()->Get(static_cast<flatbuffers::uoffset_t>(i));
  }
}

void Unpack(Unpacker& u, const wire::Reply& w, Reply& m) {
  m.seq = w.seq();
  m.code = static_cast<StatusCode>(w.code());
  u.Text(w.text(), kMaxTextBytes, m.text, "Reply.text");
  m.accepted = w.accepted();
  m.items.resize(u.Count(w.items(), kMaxItems, "Reply.items"));
  for (std::size_t i = 0; i < m.items.size(); ++i) {
    const auto* from = w.items()->Get(static_cast<flatbuffers::uoffset_t>(i));
    ReplyItem& item = m.items[i];
    item.index = from->index();
    item.avatar = from->avatar();
    item.request_id = from->request_id();
    item.code = static_cast<StatusCode>(from->code());
    u.Text(from->text(), kMaxReasonBytes, item.text, "Reply.item.text",
           static_cast<std::int64_t>(i));
  }
}

void Unpack(Unpacker&, const wire::PoseBatch& w, PoseBatch& m) {
  m.info = {w.world(),
            w.shard(),
            w.part(),
            w.parts(),
            w.tick(),
            w.server_time_s(),
            static_cast<PoseMode>(w.mode()),
            w.joint_count(),
            w.partial()};
  if (const auto* avatars = w.avatars()) m.avatars = {avatars->data(), avatars->size()};
  if (const auto* flags = w.flags()) m.flags = {flags->data(), flags->size()};
  if (const auto* poses = w.poses()) {
    m.poses = {reinterpret_cast<const std::byte*>(poses->data()), poses->size()};
  }
}

void Unpack(Unpacker& u, const wire::Events& w, Events& m) {
  m.world = w.world();
  m.number = w.number();
  m.tick = w.tick();
  m.events.resize(u.Count(w.events(), kMaxItems, "Events.events"));
  for (std::size_t i = 0; i < m.events.size(); ++i) {
    const auto* from = w.events()->Get(static_cast<flatbuffers::uoffset_t>(i));
    Event& event = m.events[i];
    event.type = static_cast<EventType>(from->type());
    event.avatar = from->avatar();
    event.request_id = from->request_id();
    event.kind = static_cast<MovementKind>(from->kind());
    event.group = from->group();
    event.tick = from->tick();
    event.time_s = from->time_s();
    u.Parameters(from->requested(), "Event.requested", event.requested);
    u.Parameters(from->applied(), "Event.applied", event.applied);
    event.extrapolated = from->extrapolated();
    event.clamped = from->clamped();
    event.cut_short = from->cut_short();
    event.foot = static_cast<FootSide>(from->foot());
    event.position_m = FromWire(from->position_m());
    event.base = {FromWire(from->base_position_m()), from->base_heading_rad()};
    event.code = static_cast<StatusCode>(from->code());
    u.Text(from->reason(), kMaxReasonBytes, event.reason, "Event.reason",
           static_cast<std::int64_t>(i));
  }
}

void Unpack(Unpacker&, const wire::Lagging& w, Lagging& m) {
  m.world = w.world();
  m.dropped_batches = w.dropped_batches();
  m.dropped_events = w.dropped_events();
}

void Unpack(Unpacker& u, const wire::Error& w, ErrorNotice& m) {
  m.code = static_cast<StatusCode>(w.code());
  u.Text(w.text(), kMaxTextBytes, m.text, "Error.text");
  m.fatal = w.fatal();
  m.seq = w.seq();
}

void Unpack(Unpacker&, const wire::Pong& w, Pong& m) {
  m.nonce = w.nonce();
  m.time_s = w.time_s();
  m.server_time_s = w.server_time_s();
  m.tick = w.tick();
}

void Unpack(Unpacker& u, const wire::CurrentMovement& w, CurrentMovement& m) {
  m.request_id = w.request_id();
  m.kind = static_cast<MovementKind>(w.kind());
  m.group = w.group();
  m.started_s = w.started_s();
  u.Numbers(w.keytimes_s(), kMaxKeytimes, "AvatarState.movement.keytimes_s", m.keytimes_s);
  m.generic_time = w.generic_time();
  m.ease_out_s = w.ease_out_s();
  u.Parameters(w.requested(), "AvatarState.movement.requested", m.requested);
  u.Parameters(w.applied(), "AvatarState.movement.applied", m.applied);
  m.extrapolated = w.extrapolated();
  m.clamped = w.clamped();
  u.Numbers(w.weights(), kMaxWeights, "AvatarState.movement.weights", m.weights);
  u.Numbers(w.parameter_names(), kMaxParameters, "AvatarState.movement.parameter_names",
            m.parameter_names);
  u.Numbers(w.sites(), kMaxWeights * kMaxParameters, "AvatarState.movement.sites", m.sites);
  m.landings.resize(u.Count(w.landings(), kMaxLandings, "AvatarState.movement.landings"));
  for (std::size_t l = 0; l < m.landings.size(); ++l) {
    const auto* from = w.landings()->Get(static_cast<flatbuffers::uoffset_t>(l));
    m.landings[l] = {static_cast<FootSide>(from->foot()), FromWire(&from->position_m()),
                     from->heading_rad()};
  }
}

void Unpack(Unpacker& u, const wire::AvatarState& w, AvatarState& m) {
  m.nonce = w.nonce();
  m.world = w.world();
  m.avatar = w.avatar();
  m.code = static_cast<StatusCode>(w.code());
  u.Text(w.text(), kMaxReasonBytes, m.text, "AvatarState.text");
  m.tick = w.tick();
  m.server_time_s = w.server_time_s();
  m.base = {FromWire(w.base_position_m()), w.base_heading_rad()};
  if (w.movement() != nullptr) Unpack(u, *w.movement(), m.movement.emplace());
  m.queue_size = w.queue_size();
  m.queue.resize(u.Count(w.queue(), kMaxInspectedRequests, "AvatarState.queue"));
  for (std::size_t i = 0; i < m.queue.size(); ++i) {
    Unpack(u, *w.queue()->Get(static_cast<flatbuffers::uoffset_t>(i)), m.queue[i],
           "AvatarState.queue.type", i);
  }
  m.planting_enabled = !w.planting_off();
  m.layers.resize(u.Count(w.layers(), kMaxPlayingLayers, "AvatarState.layers"));
  for (std::size_t i = 0; i < m.layers.size(); ++i) {
    const auto* from = w.layers()->Get(static_cast<flatbuffers::uoffset_t>(i));
    PlayingLayer& layer = m.layers[i];
    u.Text(from->layer(), kMaxNameBytes, layer.layer, "AvatarState.layers.layer",
           static_cast<std::int64_t>(i));
    layer.weight = from->weight();
    layer.time_s = from->time_s();
    layer.speed = from->speed();
    layer.is_ending = from->ending();
  }
}

void Unpack(Unpacker& u, const wire::Terrain* w, std::optional<TerrainInfo>& terrain) {
  if (w == nullptr) return;
  TerrainInfo& info = terrain.emplace();
  if (const auto* from = w->height_field()) {
    HeightFieldInfo& field = info.height_field.emplace();
    if (const auto* origin = from->origin_m()) field.origin_m = {origin->x(), origin->z()};
    field.cell_m = from->cell_m();
    field.columns = from->columns();
    field.rows = from->rows();
    u.Numbers(from->heights_m(), std::size_t{kMaxTerrainColumns} * kMaxTerrainColumns,
              "Terrain.heights_m", field.heights_m);
  }
  info.boxes.resize(u.Count(w->boxes(), kMaxTerrainBoxes, "Terrain.boxes"));
  for (std::size_t b = 0; b < info.boxes.size(); ++b) {
    const auto* box = w->boxes()->Get(static_cast<flatbuffers::uoffset_t>(b));
    info.boxes[b] = {{box->min_x(), box->min_z()}, {box->max_x(), box->max_z()}, box->height_m()};
  }
}

void Unpack(Unpacker& u, const wire::SetTerrain& w, SetTerrain& m) {
  m.seq = w.seq();
  m.world = w.world();
  Unpack(u, w.terrain(), m.terrain);
}

void Unpack(Unpacker& u, const wire::SetLayers& w, SetLayers& m) {
  m.seq = w.seq();
  m.world = w.world();
  m.items.resize(u.Count(w.items(), kMaxItems, "SetLayers.items"));
  for (std::size_t i = 0; i < m.items.size(); ++i) {
    const auto* from = w.items()->Get(static_cast<flatbuffers::uoffset_t>(i));
    LayerItem& item = m.items[i];
    item.avatar = from->avatar();
    u.Text(from->layer(), kMaxNameBytes, item.layer, "SetLayers.layer",
           static_cast<std::int64_t>(i));
    item.fade_out = from->off();
    item.weight = from->weight();
    item.blend_s = from->blend_s();
    item.speed = from->speed();
  }
}

void Unpack(Unpacker& u, const wire::SetPlanting& w, SetPlanting& m) {
  m.seq = w.seq();
  m.world = w.world();
  u.Avatars(w.avatars(), "SetPlanting.avatars", m.avatars);
  m.enabled = !w.off();
}

void Unpack(Unpacker& u, const wire::WorldTerrain& w, WorldTerrain& m) {
  m.world = w.world();
  Unpack(u, w.terrain(), m.terrain);
}

void Unpack(Unpacker& u, const wire::FetchLibrary& w, FetchLibrary& m) {
  m.nonce = w.nonce();
  u.Text(w.hash(), kMaxNameBytes, m.hash, "FetchLibrary.hash");
  m.offset = w.offset();
  m.length = w.length();
}

void Unpack(Unpacker& u, const wire::Movements& w, Movements& m) {
  m.world = w.world();
  m.shard = w.shard();
  m.part = w.part();
  m.parts = w.parts();
  m.more_steps = w.more_steps();
  m.step = w.step();
  m.tick = w.tick();
  m.server_time_s = w.server_time_s();
  m.states = w.states();
  u.Avatars(w.avatars(), "Movements.avatars", m.avatars);
  u.Numbers(w.flags(), kMaxItems, "Movements.flags", m.flags);
  u.Numbers(w.ends(), kMaxItems, "Movements.ends", m.ends);
  u.Bytes(w.records(), kMaxBulkBytes, "Movements.records", m.records);
}

void Unpack(Unpacker& u, const wire::LibraryPiece& w, LibraryPiece& m) {
  m.nonce = w.nonce();
  m.code = static_cast<StatusCode>(w.code());
  u.Text(w.text(), kMaxReasonBytes, m.text, "LibraryPiece.text");
  u.Text(w.hash(), kMaxNameBytes, m.hash, "LibraryPiece.hash");
  m.total_bytes = w.total_bytes();
  m.offset = w.offset();
  u.Bytes(w.bytes(), kMaxPieceBytes, "LibraryPiece.bytes", m.bytes);
}

template <typename Wire, typename T>
Expected<Message> Decode(std::span<const std::byte> payload) {
  flatbuffers::Verifier::Options options;
  options.max_depth = kMaxDepth;
  options.max_tables =
      static_cast<flatbuffers::uoffset_t>(IsBulk(T::kType) ? kCrowdTables : kFewTables);
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(payload.data());
  flatbuffers::Verifier verifier(bytes, payload.size(), options);
  if (!verifier.VerifyBuffer<Wire>(nullptr)) {
    return Fail(ErrorCode::kMalformed, "the payload is not a valid FlatBuffers message",
                std::string(MessageTypeName(T::kType)));
  }
  T message;
  Unpacker unpacker;
  Unpack(unpacker, *flatbuffers::GetRoot<Wire>(bytes), message);
  if (unpacker.error()) return std::unexpected(std::move(*unpacker.error()));
  if (Status status = Check(message); !status) return std::unexpected(std::move(status.error()));
  return Message(std::move(message));
}

}  // namespace

Expected<Message> DecodeMessage(const FrameView& frame) {
  if (reinterpret_cast<std::uintptr_t>(frame.payload.data()) % kPayloadAlignment != 0) {
    return Fail(ErrorCode::kInvalidArgument, "the payload is not aligned to 8 bytes");
  }
  if (frame.payload.size() > MaxPayloadBytes(frame.type)) {
    return Fail(ErrorCode::kLimitExceeded, "the payload exceeds the cap of its type",
                std::string(MessageTypeName(frame.type)),
                static_cast<std::int64_t>(frame.payload.size()));
  }
  switch (frame.type) {
    case MessageType::kHello: return Decode<wire::Hello, Hello>(frame.payload);
    case MessageType::kJoinWorld: return Decode<wire::JoinWorld, JoinWorld>(frame.payload);
    case MessageType::kLeaveWorld: return Decode<wire::LeaveWorld, LeaveWorld>(frame.payload);
    case MessageType::kSpawn: return Decode<wire::Spawn, Spawn>(frame.payload);
    case MessageType::kRemove: return Decode<wire::Remove, Remove>(frame.payload);
    case MessageType::kRequest: return Decode<wire::Request, Request>(frame.payload);
    case MessageType::kCancelQueue: return Decode<wire::CancelQueue, CancelQueue>(frame.payload);
    case MessageType::kObserve: return Decode<wire::Observe, Observe>(frame.payload);
    case MessageType::kStopObserving:
      return Decode<wire::StopObserving, StopObserving>(frame.payload);
    case MessageType::kPing: return Decode<wire::Ping, Ping>(frame.payload);
    case MessageType::kInspectAvatar:
      return Decode<wire::InspectAvatar, InspectAvatar>(frame.payload);
    case MessageType::kGoodbye: return Decode<wire::Goodbye, Goodbye>(frame.payload);
    case MessageType::kWelcome: return Decode<wire::Welcome, Welcome>(frame.payload);
    case MessageType::kWorldInfo: return Decode<wire::WorldInfo, WorldInfo>(frame.payload);
    case MessageType::kReply: return Decode<wire::Reply, Reply>(frame.payload);
    case MessageType::kPoseBatch: return Decode<wire::PoseBatch, PoseBatch>(frame.payload);
    case MessageType::kEvents: return Decode<wire::Events, Events>(frame.payload);
    case MessageType::kLagging: return Decode<wire::Lagging, Lagging>(frame.payload);
    case MessageType::kError: return Decode<wire::Error, ErrorNotice>(frame.payload);
    case MessageType::kPong: return Decode<wire::Pong, Pong>(frame.payload);
    case MessageType::kAvatarState: return Decode<wire::AvatarState, AvatarState>(frame.payload);
    case MessageType::kSetTerrain: return Decode<wire::SetTerrain, SetTerrain>(frame.payload);
    case MessageType::kSetLayers: return Decode<wire::SetLayers, SetLayers>(frame.payload);
    case MessageType::kSetPlanting: return Decode<wire::SetPlanting, SetPlanting>(frame.payload);
    case MessageType::kWorldTerrain: return Decode<wire::WorldTerrain, WorldTerrain>(frame.payload);
    case MessageType::kFetchLibrary: return Decode<wire::FetchLibrary, FetchLibrary>(frame.payload);
    case MessageType::kMovements: return Decode<wire::Movements, Movements>(frame.payload);
    case MessageType::kLibraryPiece: return Decode<wire::LibraryPiece, LibraryPiece>(frame.payload);
  }
  return Fail(ErrorCode::kUnsupported, "unknown message type", "frame.type",
              static_cast<std::int64_t>(frame.type));
}

}  // namespace stridewire::protocol
