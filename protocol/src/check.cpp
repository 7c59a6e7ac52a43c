#include "stridewire/protocol/check.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>
#include <type_traits>
#include <vector>

#include "stridewire/protocol/compact_codec.h"
#include "utf8.h"

namespace stridewire::protocol {
namespace {

/// Stores the first error.
class Findings {
 public:
  void Wrong(ErrorCode code, const char* text, const char* field, std::int64_t index = -1) {
    if (!error_) error_ = Error{code, text, index, field};
  }

  void That(bool holds, ErrorCode code, const char* text, const char* field,
            std::int64_t index = -1) {
    if (!holds) Wrong(code, text, field, index);
  }

  void Id(std::uint64_t id, const char* field, std::int64_t index = -1) {
    That(id != 0, ErrorCode::kOutOfRange, "id is zero", field, index);
  }

  void Finite(double value, const char* field, std::int64_t index = -1) {
    That(std::isfinite(value), ErrorCode::kOutOfRange, "number is not finite", field, index);
  }

  void NotNegative(double value, const char* field) {
    That(std::isfinite(value) && value >= 0.0, ErrorCode::kOutOfRange,
         "number is negative or not finite", field);
  }

  template <typename V>
  void FiniteVector(const V& v, const char* field, std::int64_t index = -1) {
    That(std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z), ErrorCode::kOutOfRange,
         "number is not finite", field, index);
  }

  void Finite(const Placement& placement, const char* field, std::int64_t index = -1) {
    FiniteVector(placement.position_m, field, index);
    Finite(placement.heading_rad, field, index);
  }

  void Text(std::string_view text, std::size_t max_bytes, const char* field,
            std::int64_t index = -1) {
    if (text.size() > max_bytes) {
      Wrong(ErrorCode::kLimitExceeded, "text is too long", field, index);
    } else if (!IsCleanUtf8(text)) {
      Wrong(ErrorCode::kMalformed, "text is not UTF-8 without control characters", field, index);
    }
  }

  void Name(std::string_view name, const char* field, std::int64_t index = -1) {
    That(!name.empty(), ErrorCode::kMalformed, "name is empty", field, index);
    Text(name, kMaxNameBytes, field, index);
  }

  void Count(std::size_t count, std::size_t min, std::size_t max, const char* field) {
    That(count >= min, ErrorCode::kMalformed, "list is empty", field);
    That(count <= max, ErrorCode::kLimitExceeded, "list is too long", field,
         static_cast<std::int64_t>(count));
  }

  template <typename E>
  void Known(E value, E last, const char* field, std::int64_t index = -1) {
    using U = std::underlying_type_t<E>;
    That(static_cast<U>(value) <= static_cast<U>(last), ErrorCode::kMalformed, "unknown enumerator",
         field, index);
  }

  void Avatars(std::span<const AvatarId> avatars, std::size_t min, const char* field) {
    Count(avatars.size(), min, kMaxItems, field);
    const auto zero = std::find(avatars.begin(), avatars.end(), AvatarId{0});
    if (zero != avatars.end()) {
      Wrong(ErrorCode::kOutOfRange, "id is zero", field, zero - avatars.begin());
    }
  }

  void ResumeToken(std::size_t bytes, const char* field) {
    That(bytes == 0 || (bytes >= kMinResumeTokenBytes && bytes <= kMaxResumeTokenBytes),
         ErrorCode::kLimitExceeded, "token is not 16 to 64 bytes long", field,
         static_cast<std::int64_t>(bytes));
  }

  [[nodiscard]] Status Result() {
    if (error_) return std::unexpected(std::move(*error_));
    return {};
  }

 private:
  std::optional<Error> error_;
};

void CheckParameters(Findings& found, const ParameterSet& set, const char* field,
                     std::int64_t index) {
  if (set.count > kMaxParameters) {
    found.Wrong(ErrorCode::kLimitExceeded, "list is too long", field, index);
    return;
  }
  unsigned seen = 0;
  for (std::size_t p = 0; p < set.count; ++p) {
    if (set.names[p] >= kParameterNames) {
      found.Wrong(ErrorCode::kMalformed, "unknown parameter", field, index);
      return;
    }
    const unsigned bit = 1u << set.names[p];
    found.That((seen & bit) == 0, ErrorCode::kMalformed, "parameter occurs twice", field, index);
    seen |= bit;
    found.Finite(set.values[p], field, index);
  }
}

void CheckRequestItem(Findings& found, const RequestItem& item, std::int64_t index) {
  found.Id(item.avatar, "Request.avatar", index);
  found.Id(item.request_id, "Request.request_id", index);
  found.Known(item.interrupt, Interrupt::kNow, "Request.takeover", index);
  if (const auto* step = std::get_if<StepMovement>(&item.movement)) {
    found.Known(step->foot, FootChoice::kRight, "Request.foot", index);
    found.Finite(step->length_m, "Request.length_m", index);
    found.Finite(step->side_m.value_or(0.0), "Request.side_m", index);
    found.Finite(step->height_m, "Request.height_m", index);
    found.Finite(step->turn_rad, "Request.turn_rad", index);
    if (step->at) {
      found.FiniteVector(step->at->position_m, "Request.at_m", index);
      found.Finite(step->at->heading_rad.value_or(0.0), "Request.heading_rad", index);
    }
    found.That(step->at || !step->exact_only, ErrorCode::kMalformed, "must_be_met requires at_m",
               "Request.at_m", index);
  } else if (const auto* jump = std::get_if<JumpMovement>(&item.movement)) {
    found.Finite(jump->length_m, "Request.length_m", index);
    found.Finite(jump->height_m, "Request.height_m", index);
    found.Finite(jump->turn_rad, "Request.turn_rad", index);
  } else if (const auto* stand = std::get_if<StandMovement>(&item.movement)) {
    found.Finite(stand->seconds, "Request.seconds", index);
  } else if (const auto* walk = std::get_if<WalkMovement>(&item.movement)) {
    found.FiniteVector(walk->position_m, "Request.at_m", index);
    found.Finite(walk->heading_rad, "Request.heading_rad", index);
    found.Count(walk->waypoints_m.size(), 0, kMaxWaypoints, "Request.waypoints_m");
    for (const DVec3& place : walk->waypoints_m) {
      found.FiniteVector(place, "Request.waypoints_m", index);
    }
    found.Finite(walk->speed_m_s.value_or(0.0), "Request.speed_m_s", index);
  }
}

void CheckTerrain(Findings& found, const std::optional<TerrainInfo>& terrain) {
  if (!terrain) return;
  if (const auto& field = terrain->height_field) {
    found.Finite(field->origin_m.x, "Terrain.origin_m");
    found.Finite(field->origin_m.z, "Terrain.origin_m");
    found.That(std::isfinite(field->cell_m) && field->cell_m > 0.0, ErrorCode::kOutOfRange,
               "cell is not above 0", "Terrain.cell_m");
    const auto is_count = [](std::uint16_t n) { return n >= 2 && n <= kMaxTerrainColumns; };
    found.That(is_count(field->columns), ErrorCode::kOutOfRange, "not 2 to 1024", "Terrain.columns",
               field->columns);
    found.That(is_count(field->rows), ErrorCode::kOutOfRange, "not 2 to 1024", "Terrain.rows",
               field->rows);
    found.That(field->heights_m.size() == std::size_t{field->columns} * field->rows,
               ErrorCode::kShapeMismatch, "heights_m does not have columns * rows elements",
               "Terrain.heights_m", static_cast<std::int64_t>(field->heights_m.size()));
    for (std::size_t h = 0; h < field->heights_m.size(); ++h) {
      found.Finite(field->heights_m[h], "Terrain.heights_m", static_cast<std::int64_t>(h));
    }
  }
  found.Count(terrain->boxes.size(), 0, kMaxTerrainBoxes, "Terrain.boxes");
  for (std::size_t b = 0; b < terrain->boxes.size(); ++b) {
    const TerrainBoxInfo& box = terrain->boxes[b];
    const auto index = static_cast<std::int64_t>(b);
    for (const double number : {box.min_m.x, box.min_m.z, box.max_m.x, box.max_m.z, box.height_m}) {
      found.Finite(number, "Terrain.boxes", index);
    }
    found.That(box.min_m.x < box.max_m.x && box.min_m.z < box.max_m.z, ErrorCode::kOutOfRange,
               "max is not above min", "Terrain.boxes", index);
  }
}

void CheckMovement(Findings& found, const CurrentMovement& m) {
  found.Known(m.kind, MovementKind::kStand, "AvatarState.movement.kind");
  found.That(m.group >= -1, ErrorCode::kOutOfRange, "group is below -1",
             "AvatarState.movement.group", m.group);
  found.Finite(m.started_s, "AvatarState.movement.started_s");
  found.Count(m.keytimes_s.size(), 0, kMaxKeytimes, "AvatarState.movement.keytimes_s");
  double before_s = 0.0;
  for (std::size_t k = 0; k < m.keytimes_s.size(); ++k) {
    const double keytime_s = m.keytimes_s[k];
    found.That(std::isfinite(keytime_s) && (k == 0 ? keytime_s == 0.0 : keytime_s >= before_s),
               ErrorCode::kOutOfRange, "keytimes do not start at 0 or decrease",
               "AvatarState.movement.keytimes_s", static_cast<std::int64_t>(k));
    before_s = keytime_s;
  }
  const double last = m.keytimes_s.empty() ? 0.0 : static_cast<double>(m.keytimes_s.size() - 1);
  found.That(m.generic_time >= 0.0 && m.generic_time <= last, ErrorCode::kOutOfRange,
             "generic time is not between 0 and the last keytime",
             "AvatarState.movement.generic_time");
  found.NotNegative(m.ease_out_s, "AvatarState.movement.ease_out_s");
  CheckParameters(found, m.requested, "AvatarState.movement.requested", -1);
  CheckParameters(found, m.applied, "AvatarState.movement.applied", -1);
  found.Count(m.weights.size(), 0, kMaxWeights, "AvatarState.movement.weights");
  for (std::size_t w = 0; w < m.weights.size(); ++w) {
    found.Finite(m.weights[w], "AvatarState.movement.weights", static_cast<std::int64_t>(w));
  }
  found.Count(m.parameter_names.size(), 0, kMaxParameters, "AvatarState.movement.parameter_names");
  unsigned seen = 0;
  for (const std::uint8_t name : m.parameter_names) {
    found.That(name < kParameterNames, ErrorCode::kMalformed, "unknown parameter",
               "AvatarState.movement.parameter_names", name);
    if (name >= kParameterNames) return;
    found.That((seen & (1u << name)) == 0, ErrorCode::kMalformed, "parameter occurs twice",
               "AvatarState.movement.parameter_names", name);
    seen |= 1u << name;
  }
  found.That(m.sites.empty() || m.sites.size() == m.weights.size() * m.parameter_names.size(),
             ErrorCode::kShapeMismatch, "sites does not have one row per weight",
             "AvatarState.movement.sites", static_cast<std::int64_t>(m.sites.size()));
  for (std::size_t s = 0; s < m.sites.size(); ++s) {
    found.Finite(m.sites[s], "AvatarState.movement.sites", static_cast<std::int64_t>(s));
  }
  found.Count(m.landings.size(), 0, kMaxLandings, "AvatarState.movement.landings");
  for (std::size_t l = 0; l < m.landings.size(); ++l) {
    const auto index = static_cast<std::int64_t>(l);
    found.Known(m.landings[l].foot, FootSide::kRight, "AvatarState.movement.landings", index);
    found.FiniteVector(m.landings[l].position_m, "AvatarState.movement.landings", index);
    found.Finite(m.landings[l].heading_rad, "AvatarState.movement.landings", index);
  }
}

void CheckSkeleton(Findings& found, const SkeletonInfo& skeleton) {
  const auto joint_count = static_cast<std::int64_t>(skeleton.joints.size());
  found.Count(skeleton.joints.size(), 1, kMaxJoints, "WorldInfo.skeleton.joints");
  found.Count(skeleton.end_sites.size(), 0, kMaxEndSites, "WorldInfo.skeleton.end_sites");
  std::vector<std::string_view> names;
  names.reserve(skeleton.joints.size());
  for (std::int64_t j = 0; j < joint_count; ++j) {
    const JointInfo& joint = skeleton.joints[static_cast<std::size_t>(j)];
    found.Name(joint.name, "WorldInfo.joint.name", j);
    found.That(j == 0 ? joint.parent == -1 : joint.parent >= 0 && joint.parent < j,
               ErrorCode::kOutOfRange, "parent does not precede its child",
               "WorldInfo.joint.parent", j);
    found.FiniteVector(joint.offset_m, "WorldInfo.joint.offset_m", j);
    names.push_back(joint.name);
  }
  std::sort(names.begin(), names.end());
  found.That(std::adjacent_find(names.begin(), names.end()) == names.end(), ErrorCode::kMalformed,
             "name occurs twice", "WorldInfo.joint.name");
  for (std::size_t e = 0; e < skeleton.end_sites.size(); ++e) {
    const EndSiteInfo& site = skeleton.end_sites[e];
    const auto index = static_cast<std::int64_t>(e);
    found.That(site.joint < joint_count, ErrorCode::kOutOfRange, "no such joint",
               "WorldInfo.end_site.joint", index);
    found.FiniteVector(site.offset_m, "WorldInfo.end_site.offset_m", index);
  }
  for (const LegInfo& leg : skeleton.legs) {
    for (const std::int16_t joint : {leg.hip, leg.knee, leg.ankle, leg.ball}) {
      found.That(joint >= -1 && joint < joint_count, ErrorCode::kOutOfRange, "no such joint",
                 "WorldInfo.leg", joint);
    }
    found.FiniteVector(leg.ball_offset_m, "WorldInfo.leg.ball_offset_m");
    found.FiniteVector(leg.toe_tip_offset_m, "WorldInfo.leg.toe_tip_offset_m");
  }
}

}  // namespace

Status Check(const Hello& m) {
  Findings found;
  found.That(m.protocol_min >= 1 && m.protocol_min <= m.protocol_max, ErrorCode::kOutOfRange,
             "expected 1 <= protocol_min <= protocol_max", "Hello.protocol_min", m.protocol_min);
  found.Name(m.client_name, "Hello.client_name");
  found.Text(m.auth_token, kMaxAuthTokenBytes, "Hello.auth_token");
  found.ResumeToken(m.resume_token.size(), "Hello.resume_token");
  return found.Result();
}

Status Check(const JoinWorld& m) {
  Findings found;
  found.Id(m.seq, "JoinWorld.seq");
  found.Name(m.name, "JoinWorld.name");
  found.Known(m.role, Role::kObserver, "JoinWorld.role");
  return found.Result();
}

Status Check(const LeaveWorld& m) {
  Findings found;
  found.Id(m.seq, "LeaveWorld.seq");
  found.Id(m.world, "LeaveWorld.world");
  return found.Result();
}

Status Check(const Spawn& m) {
  Findings found;
  found.Id(m.seq, "Spawn.seq");
  found.Id(m.world, "Spawn.world");
  found.Count(m.items.size(), 1, kMaxItems, "Spawn.items");
  for (std::size_t i = 0; i < m.items.size(); ++i) {
    found.Finite(m.items[i].start, "Spawn.start", static_cast<std::int64_t>(i));
  }
  return found.Result();
}

Status Check(const Remove& m) {
  Findings found;
  found.Id(m.seq, "Remove.seq");
  found.Id(m.world, "Remove.world");
  found.Avatars(m.avatars, 1, "Remove.avatars");
  return found.Result();
}

Status Check(const Request& m) {
  Findings found;
  found.Id(m.seq, "Request.seq");
  found.Id(m.world, "Request.world");
  found.Count(m.items.size(), 1, kMaxItems, "Request.items");
  for (std::size_t i = 0; i < m.items.size(); ++i) {
    CheckRequestItem(found, m.items[i], static_cast<std::int64_t>(i));
  }
  return found.Result();
}

Status Check(const CancelQueue& m) {
  Findings found;
  found.Id(m.seq, "CancelQueue.seq");
  found.Id(m.world, "CancelQueue.world");
  found.Avatars(m.avatars, 1, "CancelQueue.avatars");
  return found.Result();
}

namespace {

void CheckRegion(Findings& found, const Observe& m) {
  const Region& region = *m.region;
  found.That(m.avatars.empty(), ErrorCode::kMalformed, "avatars must be empty if a region is given",
             "Observe.avatars");
  found.Finite(region.centre_m.x, "Region.centre_m");
  found.Finite(region.centre_m.z, "Region.centre_m");
  found.NotNegative(region.radius_m, "Region.radius_m");
  found.That(region.radius_m != 0.0, ErrorCode::kOutOfRange, "radius is 0", "Region.radius_m");
  if (region.leave_m) found.NotNegative(*region.leave_m, "Region.leave_m");
  found.Count(region.rings.size(), 0, kMaxRateRings, "Region.rings");
  double before_m = 0.0;
  for (std::size_t i = 0; i < region.rings.size(); ++i) {
    const RateRing& ring = region.rings[i];
    const auto index = static_cast<std::int64_t>(i);
    found.Finite(ring.to_m, "RateRing.to_m", index);
    found.That(ring.to_m > before_m, ErrorCode::kOutOfRange,
               "expected a radius above that of the previous ring", "RateRing.to_m", index);
    found.That(ring.every_n_ticks >= 1 && ring.every_n_ticks <= kMaxEveryNTicks,
               ErrorCode::kOutOfRange, "expected 1 to 3600 ticks", "RateRing.every_n_ticks", index);
    before_m = ring.to_m;
  }
  const std::vector<PoseDetail>& details = region.ring_details;
  if (details.empty()) return;
  found.That(details.size() == region.rings.size(), ErrorCode::kMalformed,
             "expected one detail per ring", "Region.ring_details",
             static_cast<std::int64_t>(details.size()));
  found.That(m.mode == PoseMode::kQuantised, ErrorCode::kUnsupported,
             "levels of detail require mode 1 (quantised)", "Region.ring_details");
  for (std::size_t i = 0; i < details.size(); ++i) {
    found.Known(details[i], PoseDetail::kRoot, "Region.ring_details", static_cast<std::int64_t>(i));
  }
}

}  // namespace

Status Check(const Observe& m) {
  Findings found;
  found.Id(m.seq, "Observe.seq");
  found.Id(m.world, "Observe.world");
  found.Id(m.subscription, "Observe.subscription");
  found.Known(m.mode, PoseMode::kMovement, "Observe.mode");
  found.Avatars(m.avatars, 0, "Observe.avatars");
  found.That(m.every_n_ticks >= 1 && m.every_n_ticks <= kMaxEveryNTicks, ErrorCode::kOutOfRange,
             "expected 1 to 3600 ticks", "Observe.every_n_ticks", m.every_n_ticks);
  found.That(m.region.has_value() || !m.replace, ErrorCode::kMalformed, "replace requires a region",
             "Observe.replace");
  found.Known(m.detail, PoseDetail::kRoot, "Observe.detail");
  found.That(m.detail == PoseDetail::kAll || m.mode == PoseMode::kQuantised,
             ErrorCode::kUnsupported, "levels of detail require mode 1 (quantised)",
             "Observe.detail");
  if (m.region) CheckRegion(found, m);
  return found.Result();
}

Status Check(const StopObserving& m) {
  Findings found;
  found.Id(m.seq, "StopObserving.seq");
  found.Id(m.subscription, "StopObserving.subscription");
  return found.Result();
}

Status Check(const Ping& m) {
  Findings found;
  found.Finite(m.time_s, "Ping.time_s");
  return found.Result();
}

Status Check(const InspectAvatar& m) {
  Findings found;
  found.Id(m.world, "InspectAvatar.world");
  found.Id(m.avatar, "InspectAvatar.avatar");
  return found.Result();
}

Status Check(const Goodbye& m) {
  Findings found;
  found.Text(m.text, kMaxTextBytes, "Goodbye.text");
  return found.Result();
}

Status Check(const Welcome& m) {
  Findings found;
  found.Id(m.protocol, "Welcome.protocol");
  found.Id(m.session, "Welcome.session");
  found.ResumeToken(m.resume_token.size(), "Welcome.resume_token");
  found.That(std::isfinite(m.tick_hz) && m.tick_hz > 0.0, ErrorCode::kOutOfRange,
             "tick rate is not above 0", "Welcome.tick_hz");
  found.Text(m.server_name, kMaxNameBytes, "Welcome.server_name");
  found.Text(m.server_version, kMaxNameBytes, "Welcome.server_version");
  found.NotNegative(m.limits.idle_timeout_s, "Welcome.limits.idle_timeout_s");
  found.NotNegative(m.limits.resume_window_s, "Welcome.limits.resume_window_s");
  return found.Result();
}

Status Check(const WorldInfo& m) {
  Findings found;
  found.Id(m.world, "WorldInfo.world");
  found.Name(m.name, "WorldInfo.name");
  found.Known(m.role, Role::kObserver, "WorldInfo.role");
  found.Text(m.library_hash, kMaxNameBytes, "WorldInfo.library_hash");
  CheckSkeleton(found, m.skeleton);
  found.Count(m.layers.size(), 0, kMaxLayerNames, "WorldInfo.layers");
  for (std::size_t l = 0; l < m.layers.size(); ++l) {
    found.Name(m.layers[l], "WorldInfo.layers", static_cast<std::int64_t>(l));
  }
  if (!m.rotation_codes.empty()) {
    found.That(m.rotation_codes.size() == m.skeleton.joints.size(), ErrorCode::kShapeMismatch,
               "expected one code per joint", "WorldInfo.rotation_codes",
               static_cast<std::int64_t>(m.rotation_codes.size()));
  }
  if (const Status status = CheckRotationCodes(m.rotation_codes); !status) {
    const Error& error = status.error();
    found.Wrong(error.code, error.text, "WorldInfo.rotation_codes", error.index);
  }
  if (!m.reduced_joints.empty()) {
    std::vector<std::int16_t> parents;
    for (const JointInfo& joint : m.skeleton.joints) parents.push_back(joint.parent);
    // Reduced joints are allowed only if there are rotation codes.
    if (m.rotation_codes.empty()) parents.clear();
    if (const Status status = CheckReducedJoints(m.reduced_joints, parents); !status) {
      const Error& error = status.error();
      found.Wrong(error.code, error.text, "WorldInfo.fewer_joints", error.index);
    }
  }
  return found.Result();
}

Status Check(const Reply& m) {
  Findings found;
  found.Id(m.seq, "Reply.seq");
  found.Text(m.text, kMaxTextBytes, "Reply.text");
  found.Count(m.items.size(), 0, kMaxItems, "Reply.items");
  for (std::size_t i = 0; i < m.items.size(); ++i) {
    const auto index = static_cast<std::int64_t>(i);
    found.That(m.items[i].index < kMaxItems, ErrorCode::kOutOfRange,
               "index exceeds the largest number of items", "Reply.index", index);
    found.Text(m.items[i].text, kMaxReasonBytes, "Reply.item.text", index);
  }
  return found.Result();
}

std::optional<std::size_t> CompactPoseBytes(const PoseBatch& batch) {
  const auto uncompressed = static_cast<std::size_t>(std::ranges::count_if(
      batch.flags, [](std::uint8_t flags) { return (flags & kPoseUncompressed) != 0; }));
  if (uncompressed > batch.avatars.size()) return std::nullopt;
  const std::size_t uncompressed_bytes =
      uncompressed * PoseBytes(PoseMode::kQuantised, batch.info.joint_count);
  const std::size_t compact = batch.avatars.size() - uncompressed;
  if (compact == 0) {
    return batch.poses.size() == uncompressed_bytes ? std::optional<std::size_t>(0) : std::nullopt;
  }
  if (batch.poses.size() < uncompressed_bytes) return std::nullopt;
  const std::size_t bytes = (batch.poses.size() - uncompressed_bytes) / compact;
  const bool is_whole = bytes * compact + uncompressed_bytes == batch.poses.size();
  return is_whole ? std::optional(bytes) : std::nullopt;
}

Status Check(const PoseBatch& m) {
  Findings found;
  const PoseBatchInfo& info = m.info;
  found.Id(info.world, "PoseBatch.world");
  found.That(info.parts >= 1 && info.parts <= kMaxBatchParts && info.part < info.parts,
             ErrorCode::kOutOfRange, "expected part below parts, and parts from 1 to 1024",
             "PoseBatch.part", info.part);
  found.Finite(info.server_time_s, "PoseBatch.server_time_s");
  found.Known(info.mode, PoseMode::kCompactRoot, "PoseBatch.mode");
  found.That(info.mode != PoseMode::kMovement, ErrorCode::kUnsupported,
             "mode 2 (movement) has no poses", "PoseBatch.mode");
  found.That(info.joint_count >= 1 && info.joint_count <= kMaxJoints, ErrorCode::kOutOfRange,
             "expected 1 to 256 joints", "PoseBatch.joint_count", info.joint_count);
  found.Avatars(m.avatars, 0, "PoseBatch.avatars");
  found.That(m.flags.size() == m.avatars.size(), ErrorCode::kShapeMismatch,
             "expected one flag per avatar", "PoseBatch.flags",
             static_cast<std::int64_t>(m.flags.size()));
  const bool has_all =
      IsCompact(info.mode)
          ? CompactPoseBytes(m).has_value()
          : m.poses.size() == m.avatars.size() * PoseBytes(info.mode, info.joint_count);
  found.That(has_all, ErrorCode::kShapeMismatch, "expected one pose per avatar", "PoseBatch.poses",
             static_cast<std::int64_t>(m.poses.size()));
  return found.Result();
}

Status Check(const Events& m) {
  Findings found;
  found.Id(m.world, "Events.world");
  found.Count(m.events.size(), 1, kMaxItems, "Events.events");
  for (std::size_t i = 0; i < m.events.size(); ++i) {
    const Event& event = m.events[i];
    const auto index = static_cast<std::int64_t>(i);
    found.Known(event.type, EventType::kLeft, "Event.type", index);
    found.Id(event.avatar, "Event.avatar", index);
    found.Known(event.kind, MovementKind::kStand, "Event.kind", index);
    found.That(event.group >= -1, ErrorCode::kOutOfRange, "group is below -1", "Event.group",
               index);
    found.Finite(event.time_s, "Event.time_s", index);
    CheckParameters(found, event.requested, "Event.requested", index);
    CheckParameters(found, event.applied, "Event.applied", index);
    found.Known(event.foot, FootSide::kRight, "Event.foot", index);
    found.FiniteVector(event.position_m, "Event.position_m", index);
    found.Finite(event.base, "Event.base", index);
    found.Text(event.reason, kMaxReasonBytes, "Event.reason", index);
  }
  return found.Result();
}

Status Check(const Lagging& m) {
  Findings found;
  found.Id(m.world, "Lagging.world");
  return found.Result();
}

Status Check(const ErrorNotice& m) {
  Findings found;
  found.Text(m.text, kMaxTextBytes, "Error.text");
  return found.Result();
}

Status Check(const Pong& m) {
  Findings found;
  found.Finite(m.time_s, "Pong.time_s");
  found.Finite(m.server_time_s, "Pong.server_time_s");
  return found.Result();
}

Status Check(const AvatarState& m) {
  Findings found;
  found.Id(m.world, "AvatarState.world");
  found.Id(m.avatar, "AvatarState.avatar");
  found.Text(m.text, kMaxReasonBytes, "AvatarState.text");
  found.Finite(m.server_time_s, "AvatarState.server_time_s");
  found.Finite(m.base, "AvatarState.base");
  if (m.movement) CheckMovement(found, *m.movement);
  found.Count(m.queue.size(), 0, kMaxInspectedRequests, "AvatarState.queue");
  found.That(m.queue.size() <= m.queue_size, ErrorCode::kShapeMismatch,
             "more requests than queue_size", "AvatarState.queue", m.queue_size);
  for (std::size_t i = 0; i < m.queue.size(); ++i) {
    CheckRequestItem(found, m.queue[i], static_cast<std::int64_t>(i));
  }
  found.Count(m.layers.size(), 0, kMaxPlayingLayers, "AvatarState.layers");
  for (std::size_t i = 0; i < m.layers.size(); ++i) {
    const auto index = static_cast<std::int64_t>(i);
    found.Name(m.layers[i].layer, "AvatarState.layers.layer", index);
    found.Finite(m.layers[i].weight, "AvatarState.layers.weight", index);
    found.Finite(m.layers[i].time_s, "AvatarState.layers.time_s", index);
    found.Finite(m.layers[i].speed, "AvatarState.layers.speed", index);
  }
  return found.Result();
}

Status Check(const SetTerrain& m) {
  Findings found;
  found.Id(m.seq, "SetTerrain.seq");
  found.Id(m.world, "SetTerrain.world");
  CheckTerrain(found, m.terrain);
  return found.Result();
}

Status Check(const SetLayers& m) {
  Findings found;
  found.Id(m.seq, "SetLayers.seq");
  found.Id(m.world, "SetLayers.world");
  found.Count(m.items.size(), 1, kMaxItems, "SetLayers.items");
  for (std::size_t i = 0; i < m.items.size(); ++i) {
    const LayerItem& item = m.items[i];
    const auto index = static_cast<std::int64_t>(i);
    found.Id(item.avatar, "SetLayers.avatar", index);
    found.Name(item.layer, "SetLayers.layer", index);
    found.Finite(item.weight, "SetLayers.weight", index);
    found.Finite(item.blend_s, "SetLayers.blend_s", index);
    found.Finite(item.speed, "SetLayers.speed", index);
  }
  return found.Result();
}

Status Check(const SetPlanting& m) {
  Findings found;
  found.Id(m.seq, "SetPlanting.seq");
  found.Id(m.world, "SetPlanting.world");
  found.Avatars(m.avatars, 1, "SetPlanting.avatars");
  return found.Result();
}

Status Check(const WorldTerrain& m) {
  Findings found;
  found.Id(m.world, "WorldTerrain.world");
  CheckTerrain(found, m.terrain);
  return found.Result();
}

Status Check(const FetchLibrary& m) {
  Findings found;
  found.That(m.length >= 1 && m.length <= kMaxPieceBytes, ErrorCode::kOutOfRange,
             "expected 1 byte to 1 MiB", "FetchLibrary.length", m.length);
  found.Name(m.hash, "FetchLibrary.hash");
  found.That(m.offset < kMaxLibraryBytes, ErrorCode::kOutOfRange, "expected an offset below 1 GiB",
             "FetchLibrary.offset", static_cast<std::int64_t>(m.offset));
  return found.Result();
}

Status Check(const Movements& m) {
  Findings found;
  found.Id(m.world, "Movements.world");
  found.That(m.parts >= 1 && m.parts <= kMaxBatchParts && m.part < m.parts, ErrorCode::kOutOfRange,
             "expected part below parts, and parts from 1 to 1024", "Movements.part", m.part);
  found.Finite(m.server_time_s, "Movements.server_time_s");
  found.Avatars(m.avatars, 0, "Movements.avatars");
  found.That(m.flags.size() == m.avatars.size(), ErrorCode::kShapeMismatch,
             "expected one flag per avatar", "Movements.flags",
             static_cast<std::int64_t>(m.flags.size()));
  found.That(m.ends.size() == m.avatars.size(), ErrorCode::kShapeMismatch,
             "expected one end per avatar", "Movements.ends",
             static_cast<std::int64_t>(m.ends.size()));
  std::uint32_t before = 0;
  for (std::size_t i = 0; i < m.ends.size(); ++i) {
    found.That(m.ends[i] >= before && m.ends[i] - before <= kMaxRecordBytes, ErrorCode::kOutOfRange,
               "a record has a negative length or exceeds 64 KiB", "Movements.ends",
               static_cast<std::int64_t>(i));
    before = m.ends[i];
  }
  found.That(before == m.records.size(), ErrorCode::kShapeMismatch,
             "the last end is not the size of records", "Movements.records",
             static_cast<std::int64_t>(m.records.size()));
  return found.Result();
}

Status Check(const LibraryPiece& m) {
  Findings found;
  found.Text(m.text, kMaxReasonBytes, "LibraryPiece.text");
  found.Text(m.hash, kMaxNameBytes, "LibraryPiece.hash");
  found.Count(m.bytes.size(), 0, kMaxPieceBytes, "LibraryPiece.bytes");
  found.That(m.total_bytes <= kMaxLibraryBytes && m.offset <= m.total_bytes &&
                 m.bytes.size() <= m.total_bytes - m.offset,
             ErrorCode::kOutOfRange, "the piece is not inside the library", "LibraryPiece.offset",
             static_cast<std::int64_t>(m.offset));
  return found.Result();
}

}  // namespace stridewire::protocol
