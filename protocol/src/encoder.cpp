#include "stridewire/protocol/encoder.h"

#include "frame_builder.h"
#include "stridewire/protocol/check.h"

namespace stridewire::protocol {
namespace {

using flatbuffers::FlatBufferBuilder;
using flatbuffers::Offset;

// A builder with a larger buffer frees it after the message.
constexpr std::size_t kKeptBuilderBytes = std::size_t{1} << 20;

wire::Vec3 ToWire(const DVec3& v) { return {v.x, v.y, v.z}; }
wire::Offset ToWire(const Vec3& v) { return {v.x, v.y, v.z}; }
std::uint16_t ToWire(StatusCode code) { return static_cast<std::uint16_t>(code); }

Offset<flatbuffers::Vector<std::uint8_t>> Bytes(FlatBufferBuilder& b,
                                                const std::vector<std::byte>& bytes) {
  return b.CreateVector(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
}

// Omits an empty text.
Offset<flatbuffers::String> Text(FlatBufferBuilder& b, const std::string& text) {
  return text.empty() ? Offset<flatbuffers::String>() : b.CreateString(text);
}

Offset<wire::Hello> Build(FlatBufferBuilder& b, const Hello& m) {
  const auto name = b.CreateString(m.client_name);
  const auto auth = Text(b, m.auth_token);
  const auto resume = m.resume_token.empty() ? Offset<flatbuffers::Vector<std::uint8_t>>()
                                             : Bytes(b, m.resume_token);
  return wire::CreateHello(b, m.protocol_min, m.protocol_max, name, auth, resume,
                           m.last_events_number);
}

Offset<wire::JoinWorld> Build(FlatBufferBuilder& b, const JoinWorld& m) {
  return wire::CreateJoinWorld(b, m.seq, b.CreateString(m.name), static_cast<wire::Role>(m.role));
}

Offset<wire::LeaveWorld> Build(FlatBufferBuilder& b, const LeaveWorld& m) {
  return wire::CreateLeaveWorld(b, m.seq, m.world);
}

Offset<wire::Spawn> Build(FlatBufferBuilder& b, const Spawn& m) {
  std::vector<Offset<wire::SpawnItem>> items;
  items.reserve(m.items.size());
  for (const SpawnItem& item : m.items) {
    const wire::Vec3 position = ToWire(item.start.position_m);
    items.push_back(wire::CreateSpawnItem(b, item.avatar, &position, item.start.heading_rad));
  }
  return wire::CreateSpawn(b, m.seq, m.world, b.CreateVector(items));
}

Offset<wire::Remove> Build(FlatBufferBuilder& b, const Remove& m) {
  return wire::CreateRemove(b, m.seq, m.world, b.CreateVector(m.avatars));
}

// Each type of movement uses some of the fields. flatbuffers::Optional is std::optional.
Offset<wire::RequestItem> Build(FlatBufferBuilder& b, const RequestItem& item) {
  auto type = wire::MovementType::Stand;
  auto foot = wire::FootChoice::Auto;
  double length_m = 0.0, height_m = 0.0, turn_rad = 0.0, seconds = 0.0;
  bool exact_only = false;
  flatbuffers::Optional<double> side_m, heading_rad, speed_m_s;
  std::optional<wire::Vec3> at;
  Offset<flatbuffers::Vector<const wire::Vec3*>> waypoints;
  if (const auto* step = std::get_if<StepMovement>(&item.movement)) {
    type = wire::MovementType::Step;
    foot = static_cast<wire::FootChoice>(step->foot);
    exact_only = step->exact_only;
    if (step->at) {
      at = ToWire(step->at->position_m);
      heading_rad = step->at->heading_rad;
    } else {
      length_m = step->length_m;
      side_m = step->side_m;
      height_m = step->height_m;
      turn_rad = step->turn_rad;
    }
  } else if (const auto* jump = std::get_if<JumpMovement>(&item.movement)) {
    type = wire::MovementType::Jump;
    length_m = jump->length_m;
    height_m = jump->height_m;
    turn_rad = jump->turn_rad;
  } else if (const auto* walk = std::get_if<WalkMovement>(&item.movement)) {
    type = wire::MovementType::Walk;
    std::vector<wire::Vec3> places;
    places.reserve(walk->waypoints_m.size());
    for (const DVec3& place : walk->waypoints_m) places.push_back(ToWire(place));
    if (!places.empty()) waypoints = b.CreateVectorOfStructs(places);
    at = ToWire(walk->position_m);
    heading_rad = walk->heading_rad;
    speed_m_s = walk->speed_m_s;
  } else {
    seconds = std::get<StandMovement>(item.movement).seconds;
  }
  return wire::CreateRequestItem(b, item.avatar, item.request_id, type, foot, length_m, side_m,
                                 height_m, turn_rad, seconds, at ? &*at : nullptr, heading_rad,
                                 waypoints, speed_m_s, static_cast<wire::Takeover>(item.interrupt),
                                 exact_only);
}

Offset<wire::Request> Build(FlatBufferBuilder& b, const Request& m) {
  std::vector<Offset<wire::RequestItem>> items;
  items.reserve(m.items.size());
  for (const RequestItem& item : m.items) items.push_back(Build(b, item));
  return wire::CreateRequest(b, m.seq, m.world, b.CreateVector(items));
}

Offset<wire::CancelQueue> Build(FlatBufferBuilder& b, const CancelQueue& m) {
  return wire::CreateCancelQueue(b, m.seq, m.world, b.CreateVector(m.avatars));
}

Offset<wire::Observe> Build(FlatBufferBuilder& b, const Observe& m) {
  const auto avatars =
      m.avatars.empty() ? Offset<flatbuffers::Vector<std::uint32_t>>() : b.CreateVector(m.avatars);
  Offset<wire::Region> region;
  if (m.region) {
    std::vector<wire::RateRing> rings;
    for (const RateRing& ring : m.region->rings) rings.emplace_back(ring.to_m, ring.every_n_ticks);
    const wire::GroundPoint centre(m.region->centre_m.x, m.region->centre_m.z);
    const auto rings_offset = rings.empty() ? Offset<flatbuffers::Vector<const wire::RateRing*>>()
                                            : b.CreateVectorOfStructs(rings);
    std::vector<std::uint8_t> details;
    for (const PoseDetail detail : m.region->ring_details) {
      details.push_back(static_cast<std::uint8_t>(detail));
    }
    const auto details_offset =
        details.empty() ? Offset<flatbuffers::Vector<std::uint8_t>>() : b.CreateVector(details);
    wire::RegionBuilder builder(b);
    builder.add_centre_m(&centre);
    builder.add_radius_m(m.region->radius_m);
    if (m.region->leave_m) builder.add_leave_m(*m.region->leave_m);
    builder.add_rings(rings_offset);
    builder.add_ring_details(details_offset);
    region = builder.Finish();
  }
  return wire::CreateObserve(b, m.seq, m.world, m.subscription, static_cast<wire::PoseMode>(m.mode),
                             avatars, m.every_n_ticks, m.with_events, region, m.replace,
                             static_cast<wire::PoseDetail>(m.detail));
}

Offset<wire::StopObserving> Build(FlatBufferBuilder& b, const StopObserving& m) {
  return wire::CreateStopObserving(b, m.seq, m.subscription);
}

Offset<wire::Ping> Build(FlatBufferBuilder& b, const Ping& m) {
  return wire::CreatePing(b, m.nonce, m.time_s);
}

Offset<wire::InspectAvatar> Build(FlatBufferBuilder& b, const InspectAvatar& m) {
  return wire::CreateInspectAvatar(b, m.nonce, m.world, m.avatar);
}

Offset<wire::Goodbye> Build(FlatBufferBuilder& b, const Goodbye& m) {
  return wire::CreateGoodbye(b, ToWire(m.code), Text(b, m.text));
}

Offset<wire::Welcome> Build(FlatBufferBuilder& b, const Welcome& m) {
  const ServerLimits& l = m.limits;
  const auto limits = wire::CreateServerLimits(b, l.max_control_bytes, l.max_bulk_bytes,
                                               l.max_items, l.max_avatars_per_world, l.max_queue,
                                               l.reply_memory, l.idle_timeout_s, l.resume_window_s);
  const auto token = m.resume_token.empty() ? Offset<flatbuffers::Vector<std::uint8_t>>()
                                            : Bytes(b, m.resume_token);
  const auto name = Text(b, m.server_name);
  const auto version = Text(b, m.server_version);
  return wire::CreateWelcome(b, m.protocol, m.session, token, m.resumed, m.last_seq, m.tick_hz,
                             name, version, limits);
}

Offset<wire::Leg> Build(FlatBufferBuilder& b, const LegInfo& leg) {
  const wire::Offset ball = ToWire(leg.ball_offset_m);
  const wire::Offset toe = ToWire(leg.toe_tip_offset_m);
  return wire::CreateLeg(b, leg.hip, leg.knee, leg.ankle, leg.ball, &ball, &toe);
}

Offset<wire::WorldInfo> Build(FlatBufferBuilder& b, const WorldInfo& m) {
  std::vector<Offset<wire::Joint>> joints;
  joints.reserve(m.skeleton.joints.size());
  for (const JointInfo& joint : m.skeleton.joints) {
    const wire::Offset offset = ToWire(joint.offset_m);
    joints.push_back(wire::CreateJoint(b, b.CreateString(joint.name), joint.parent, &offset));
  }
  std::vector<Offset<wire::EndSite>> sites;
  sites.reserve(m.skeleton.end_sites.size());
  for (const EndSiteInfo& site : m.skeleton.end_sites) {
    const wire::Offset offset = ToWire(site.offset_m);
    sites.push_back(wire::CreateEndSite(b, site.joint, &offset));
  }
  const auto left = Build(b, m.skeleton.legs[0]);
  const auto right = Build(b, m.skeleton.legs[1]);
  const auto joints_offset = b.CreateVector(joints);
  const auto sites_offset = b.CreateVector(sites);
  const auto skeleton = wire::CreateSkeleton(b, joints_offset, sites_offset, left, right);
  const auto name = b.CreateString(m.name);
  const auto hash = Text(b, m.library_hash);
  std::vector<Offset<wire::Layer>> layer_list;
  layer_list.reserve(m.layers.size());
  for (const std::string& layer : m.layers) {
    layer_list.push_back(wire::CreateLayer(b, b.CreateString(layer)));
  }
  const auto layers = layer_list.empty() ? Offset<flatbuffers::Vector<Offset<wire::Layer>>>()
                                         : b.CreateVector(layer_list);
  std::vector<wire::RotationCode> code_list;
  code_list.reserve(m.rotation_codes.size());
  for (const RotationQuantization& code : m.rotation_codes) {
    const Quat& q = code.reference;
    code_list.emplace_back(wire::Rotation(q.x, q.y, q.z, q.w), ToWire(code.low), ToWire(code.step),
                           code.least_w, code.bits[0], code.bits[1], code.bits[2],
                           code.smallest_three_bits);
  }
  const auto codes = code_list.empty() ? Offset<flatbuffers::Vector<const wire::RotationCode*>>()
                                       : b.CreateVectorOfStructs(code_list);
  const auto fewer = m.reduced_joints.empty() ? Offset<flatbuffers::Vector<std::uint16_t>>()
                                              : b.CreateVector(m.reduced_joints);
  return wire::CreateWorldInfo(b, m.seq, m.world, name, static_cast<wire::Role>(m.role), m.tick,
                               hash, skeleton, layers, codes, fewer);
}

Offset<wire::Reply> Build(FlatBufferBuilder& b, const Reply& m) {
  std::vector<Offset<wire::ReplyItem>> items;
  items.reserve(m.items.size());
  for (const ReplyItem& item : m.items) {
    // Thousands of items can have the same text, so equal texts are stored once.
    const auto text =
        item.text.empty() ? Offset<flatbuffers::String>() : b.CreateSharedString(item.text);
    items.push_back(wire::CreateReplyItem(b, item.index, item.avatar, item.request_id,
                                          ToWire(item.code), text));
  }
  const auto text = Text(b, m.text);
  const auto items_offset = m.items.empty() ? Offset<flatbuffers::Vector<Offset<wire::ReplyItem>>>()
                                            : b.CreateVector(items);
  return wire::CreateReply(b, m.seq, ToWire(m.code), text, m.accepted, items_offset);
}

Offset<wire::PoseBatch> Build(FlatBufferBuilder& b, const PoseBatch& m) {
  return BuildPoseBatch(b, m);
}

Offset<flatbuffers::Vector<const wire::ParameterValue*>> Build(FlatBufferBuilder& b,
                                                               const ParameterSet& set) {
  if (set.count == 0) return {};
  std::array<wire::ParameterValue, kMaxParameters> values;
  for (std::size_t p = 0; p < set.count; ++p) {
    values[p] = wire::ParameterValue(set.values[p], set.names[p]);
  }
  return b.CreateVectorOfStructs(values.data(), set.count);
}

Offset<wire::Event> Build(FlatBufferBuilder& b, const Event& event) {
  const auto requested = Build(b, event.requested);
  const auto applied = Build(b, event.applied);
  const auto reason =
      event.reason.empty() ? Offset<flatbuffers::String>() : b.CreateSharedString(event.reason);
  const wire::Vec3 position = ToWire(event.position_m);
  const wire::Vec3 base = ToWire(event.base.position_m);
  return wire::CreateEvent(b, static_cast<wire::EventType>(event.type), event.avatar,
                           event.request_id, static_cast<wire::MovementKind>(event.kind),
                           event.group, event.tick, event.time_s, requested, applied,
                           event.extrapolated, event.clamped, static_cast<wire::Foot>(event.foot),
                           event.position_m == DVec3(0.0) ? nullptr : &position,
                           event.base.position_m == DVec3(0.0) ? nullptr : &base,
                           event.base.heading_rad, ToWire(event.code), reason, event.cut_short);
}

Offset<wire::Events> Build(FlatBufferBuilder& b, const Events& m) {
  std::vector<Offset<wire::Event>> events;
  events.reserve(m.events.size());
  for (const Event& event : m.events) events.push_back(Build(b, event));
  return wire::CreateEvents(b, m.world, m.number, m.tick, b.CreateVector(events));
}

Offset<wire::Lagging> Build(FlatBufferBuilder& b, const Lagging& m) {
  return wire::CreateLagging(b, m.world, m.dropped_batches, m.dropped_events);
}

Offset<wire::Error> Build(FlatBufferBuilder& b, const ErrorNotice& m) {
  return wire::CreateError(b, ToWire(m.code), Text(b, m.text), m.fatal, m.seq);
}

Offset<wire::Pong> Build(FlatBufferBuilder& b, const Pong& m) {
  return wire::CreatePong(b, m.nonce, m.time_s, m.server_time_s, m.tick);
}

Offset<wire::CurrentMovement> Build(FlatBufferBuilder& b, const CurrentMovement& m) {
  const auto keytimes = b.CreateVector(m.keytimes_s);
  const auto requested = Build(b, m.requested);
  const auto applied = Build(b, m.applied);
  const auto weights = b.CreateVector(m.weights);
  const auto names = b.CreateVector(m.parameter_names);
  const auto sites = b.CreateVector(m.sites);
  std::vector<wire::Landing> landings;
  for (const Landing& l : m.landings) {
    landings.emplace_back(ToWire(l.position_m), l.heading_rad, static_cast<wire::Foot>(l.foot));
  }
  const auto landing_offset = landings.empty() ? Offset<flatbuffers::Vector<const wire::Landing*>>()
                                               : b.CreateVectorOfStructs(landings);
  return wire::CreateCurrentMovement(b, m.request_id, static_cast<wire::MovementKind>(m.kind),
                                     m.group, m.started_s, keytimes, m.generic_time, m.ease_out_s,
                                     requested, applied, m.extrapolated, m.clamped, weights, names,
                                     sites, landing_offset);
}

Offset<wire::AvatarState> Build(FlatBufferBuilder& b, const AvatarState& m) {
  const auto text = Text(b, m.text);
  const auto movement = m.movement ? Build(b, *m.movement) : Offset<wire::CurrentMovement>();
  std::vector<Offset<wire::RequestItem>> queue;
  queue.reserve(m.queue.size());
  for (const RequestItem& item : m.queue) queue.push_back(Build(b, item));
  const auto queue_offset = queue.empty() ? Offset<flatbuffers::Vector<Offset<wire::RequestItem>>>()
                                          : b.CreateVector(queue);
  std::vector<Offset<wire::PlayingLayer>> layers;
  for (const PlayingLayer& layer : m.layers) {
    const auto name = Text(b, layer.layer);
    layers.push_back(wire::CreatePlayingLayer(b, name, layer.weight, layer.time_s, layer.speed,
                                              layer.is_ending));
  }
  const auto layers_offset = layers.empty()
                                 ? Offset<flatbuffers::Vector<Offset<wire::PlayingLayer>>>()
                                 : b.CreateVector(layers);
  const wire::Vec3 base = ToWire(m.base.position_m);
  return wire::CreateAvatarState(b, m.nonce, m.world, m.avatar, ToWire(m.code), text, m.tick,
                                 m.server_time_s, &base, m.base.heading_rad, movement, m.queue_size,
                                 queue_offset, !m.planting_enabled, layers_offset);
}

Offset<wire::Terrain> Build(FlatBufferBuilder& b, const std::optional<TerrainInfo>& terrain) {
  if (!terrain) return {};
  Offset<wire::HeightField> field;
  if (const auto& from = terrain->height_field) {
    const auto heights = b.CreateVector(from->heights_m);
    const wire::GroundPoint origin(from->origin_m.x, from->origin_m.z);
    field = wire::CreateHeightField(b, &origin, from->cell_m, from->columns, from->rows, heights);
  }
  Offset<flatbuffers::Vector<const wire::TerrainBox*>> boxes;
  if (!terrain->boxes.empty()) {
    std::vector<wire::TerrainBox> list;
    list.reserve(terrain->boxes.size());
    for (const TerrainBoxInfo& box : terrain->boxes) {
      list.emplace_back(box.min_m.x, box.min_m.z, box.max_m.x, box.max_m.z, box.height_m);
    }
    boxes = b.CreateVectorOfStructs(list);
  }
  return wire::CreateTerrain(b, field, boxes);
}

Offset<wire::SetTerrain> Build(FlatBufferBuilder& b, const SetTerrain& m) {
  return wire::CreateSetTerrain(b, m.seq, m.world, Build(b, m.terrain));
}

Offset<wire::SetLayers> Build(FlatBufferBuilder& b, const SetLayers& m) {
  std::vector<Offset<wire::LayerItem>> items;
  items.reserve(m.items.size());
  for (const LayerItem& item : m.items) {
    // All avatars of a crowd can play the same layer, so equal names are stored once.
    items.push_back(wire::CreateLayerItem(b, item.avatar, b.CreateSharedString(item.layer),
                                          item.fade_out, item.weight, item.blend_s, item.speed));
  }
  return wire::CreateSetLayers(b, m.seq, m.world, b.CreateVector(items));
}

Offset<wire::SetPlanting> Build(FlatBufferBuilder& b, const SetPlanting& m) {
  return wire::CreateSetPlanting(b, m.seq, m.world, b.CreateVector(m.avatars), !m.enabled);
}

Offset<wire::WorldTerrain> Build(FlatBufferBuilder& b, const WorldTerrain& m) {
  return wire::CreateWorldTerrain(b, m.world, Build(b, m.terrain));
}

Offset<wire::FetchLibrary> Build(FlatBufferBuilder& b, const FetchLibrary& m) {
  return wire::CreateFetchLibrary(b, m.nonce, Text(b, m.hash), m.offset, m.length);
}

Offset<wire::Movements> Build(FlatBufferBuilder& b, const Movements& m) {
  Offset<flatbuffers::Vector<std::uint8_t>> records, flags;
  Offset<flatbuffers::Vector<std::uint32_t>> ends, avatars;
  if (!m.avatars.empty()) {  // Most steps of a small crowd have no changes.
    records = Bytes(b, m.records);
    ends = b.CreateVector(m.ends);
    flags = b.CreateVector(m.flags);
    avatars = b.CreateVector(m.avatars);
  }
  return wire::CreateMovements(b, m.world, m.shard, m.part, m.parts, m.more_steps, m.step, m.tick,
                               m.server_time_s, m.states, avatars, flags, ends, records);
}

Offset<wire::LibraryPiece> Build(FlatBufferBuilder& b, const LibraryPiece& m) {
  const auto text = Text(b, m.text);
  const auto hash = Text(b, m.hash);
  const auto bytes = Bytes(b, m.bytes);
  return wire::CreateLibraryPiece(b, m.nonce, ToWire(m.code), text, hash, m.total_bytes, m.offset,
                                  bytes);
}

}  // namespace

struct Encoder::Impl {
  FrameLimits limits;
  FlatBufferBuilder builder;

  template <typename T>
  Status Encode(const T& message, std::vector<std::byte>& frame) {
    if (Status status = Check(message); !status) return status;
    builder.Clear();
    builder.Finish(Build(builder, message));
    const Status status = AppendFrame(builder, T::kType, limits, frame);
    if (builder.GetSize() > kKeptBuilderBytes) builder.Reset();
    return status;
  }
};

Encoder::Encoder(const FrameLimits& limits) : impl_(std::make_unique<Impl>()) {
  impl_->limits = limits;
}
Encoder::~Encoder() = default;
Encoder::Encoder(Encoder&&) noexcept = default;
Encoder& Encoder::operator=(Encoder&&) noexcept = default;

using Frame = std::vector<std::byte>;
Status Encoder::Encode(const Hello& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const JoinWorld& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const LeaveWorld& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const Spawn& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const Remove& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const Request& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const CancelQueue& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const Observe& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const StopObserving& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const Ping& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const InspectAvatar& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const Goodbye& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const Welcome& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const WorldInfo& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const Reply& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const PoseBatch& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const Events& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const Lagging& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const ErrorNotice& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const Pong& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const AvatarState& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const SetTerrain& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const SetLayers& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const SetPlanting& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const WorldTerrain& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const FetchLibrary& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const Movements& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const LibraryPiece& m, Frame& frame) { return impl_->Encode(m, frame); }
Status Encoder::Encode(const Message& m, Frame& frame) {
  return std::visit([&](const auto& alternative) { return impl_->Encode(alternative, frame); }, m);
}

}  // namespace stridewire::protocol
