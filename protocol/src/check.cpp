#include "stridewire/protocol/check.h"

#include <algorithm>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "codec_support.h"
#include "message_list.h"
#include "stridewire/protocol/compact_codec.h"

/// Rules between fields, which the schema's attributes cannot express. These checks run only if the
/// generated checks of all single fields have succeeded.
namespace stridewire::protocol {

void Findings::Wrong(ErrorCode code, const char* text, const FieldPath& at, std::int64_t value) {
  if (error_) return;
  error_ = Error{code, text, value, {}};
  for (const FieldPath* path = &at; path != nullptr; path = path->parent) {
    error_->where = std::string(path->name) + (error_->where.empty() ? "" : "." + error_->where);
    if (path->index != FieldPath::kNoIndex) error_->index = static_cast<std::int64_t>(path->index);
  }
}

void CheckMeaning(Findings& found, const FieldPath& at, const Observe& m) {
  const bool has_details = m.mode == PoseMode::kQuantised;
  constexpr auto kNoDetails = "levels of detail require mode 1 (quantised)";
  found.That(m.detail == PoseDetail::kAll || has_details, {&at, "detail"}, kNoDetails,
             ErrorCode::kUnsupported);
  if (!m.region) return;
  found.That(m.avatars.empty(), {&at, "avatars"}, "avatars must be empty if a region is given",
             ErrorCode::kMalformed);
  const FieldPath region{&at, "region"};
  const auto& rings = m.region->rings;
  double before_m = 0.0;
  for (std::size_t i = 0; i < rings.size(); ++i) {
    const FieldPath ring{&region, "rings", i};
    found.That(rings[i].to_m > before_m, {&ring, "to_m"},
               "expected a radius above that of the previous ring");
    before_m = rings[i].to_m;
  }
  const std::size_t details = m.region->ring_details.size();
  if (details == 0) return;
  const FieldPath path{&region, "ring_details"};
  found.That(details == rings.size(), path, "expected one detail per ring", ErrorCode::kMalformed,
             details);
  found.That(has_details, path, kNoDetails, ErrorCode::kUnsupported);
}

void CheckMeaning(Findings& found, const FieldPath& at, const TerrainBoxInfo& m) {
  found.That(m.min_m.x < m.max_m.x && m.min_m.z < m.max_m.z, at, "expected max above min");
}

void CheckMeaning(Findings& found, const FieldPath& at, const SkeletonInfo& m) {
  const std::size_t joint_count = m.joints.size();
  const FieldPath joints{&at, "joints"};
  std::set<std::string_view> names;
  for (std::size_t j = 0; j < joint_count; ++j) {
    const JointInfo& joint = m.joints[j];
    const FieldPath path{&at, "joints", j};
    found.That(j == 0 ? joint.parent == -1 : joint.parent >= 0 && std::cmp_less(joint.parent, j),
               {&path, "parent"}, "expected -1 for joint 0, else a joint that precedes this one",
               ErrorCode::kOutOfRange, joint.parent);
    found.That(names.insert(joint.name).second, {&joints, "name"}, "a name occurs twice",
               ErrorCode::kMalformed);
  }
  for (std::size_t e = 0; e < m.end_sites.size(); ++e) {
    const std::uint16_t joint = m.end_sites[e].joint;
    const FieldPath path{&at, "end_sites", e};
    found.That(joint < joint_count, {&path, "joint"}, "expected the index of a joint",
               ErrorCode::kOutOfRange, joint);
  }
  for (const bool is_right : {false, true}) {
    const LegInfo& leg = m.legs[is_right];
    for (const std::int16_t joint : {leg.hip, leg.knee, leg.ankle, leg.ball}) {
      found.That(joint >= -1 && std::cmp_less(joint, joint_count),
                 {&at, is_right ? "right_leg" : "left_leg"}, "expected the index of a joint, or -1",
                 ErrorCode::kOutOfRange, joint);
    }
  }
}

void CheckMeaning(Findings& found, const FieldPath& at, const WorldInfo& m) {
  const std::size_t count = m.rotation_quantizations.size();
  found.That(count == 0 || count == m.skeleton.joints.size(), {&at, "rotation_quantizations"},
             "expected one quantization per joint", ErrorCode::kShapeMismatch, count);
  found.That(CheckRotationQuantizations(m.rotation_quantizations), {&at, "rotation_quantizations"});
  if (m.reduced_joints.empty()) return;
  std::vector<std::int16_t> parents;
  for (const JointInfo& joint : m.skeleton.joints) parents.push_back(joint.parent);
  // Reduced joints are allowed only with quantizations. If there are none, the parents are removed,
  // so that CheckReducedJoints fails.
  if (count == 0) parents.clear();
  found.That(CheckReducedJoints(m.reduced_joints, parents), {&at, "reduced_joints"});
}

std::optional<std::size_t> CompactPoseBytes(const PoseBatch& batch) {
  const auto uncompressed = static_cast<std::size_t>(std::ranges::count_if(
      batch.flags, [](std::uint8_t flags) { return (flags & kPoseUncompressed) != 0; }));
  const std::size_t uncompressed_bytes =
      uncompressed * PoseBytes(PoseMode::kQuantised, batch.info.joint_count);
  if (uncompressed > batch.avatars.size() || batch.poses.size() < uncompressed_bytes) {
    return std::nullopt;
  }
  const std::size_t compact = batch.avatars.size() - uncompressed;
  const std::size_t compact_bytes = batch.poses.size() - uncompressed_bytes;
  const std::size_t bytes = compact == 0 ? 0 : compact_bytes / compact;
  return bytes * compact == compact_bytes ? std::optional(bytes) : std::nullopt;
}

void CheckMeaning(Findings& found, const FieldPath& at, const PoseBatch& m) {
  const PoseBatchInfo& info = m.info;
  found.That(info.mode != PoseMode::kMovement, {&at, "mode"}, "mode 2 (movement) has no poses",
             ErrorCode::kUnsupported);
  const bool has_all =
      IsCompact(info.mode)
          ? CompactPoseBytes(m).has_value()
          : m.poses.size() == m.avatars.size() * PoseBytes(info.mode, info.joint_count);
  found.That(has_all, {&at, "poses"}, "expected one pose per avatar", ErrorCode::kShapeMismatch,
             m.poses.size());
}

void CheckMeaning(Findings& found, const FieldPath& at, const CurrentMovement& m) {
  const std::size_t count = m.keytimes_s.size();
  for (std::size_t k = 0; k < count; ++k) {
    const double keytime_s = m.keytimes_s[k];
    found.That(k == 0 ? keytime_s == 0.0 : keytime_s >= m.keytimes_s[k - 1], {&at, "keytimes_s", k},
               "expected keytimes that start at 0 and do not decrease");
  }
  found.That(m.generic_time <= static_cast<double>(std::max<std::size_t>(count, 1) - 1),
             {&at, "generic_time"}, "expected a time between 0 and the last keytime");
  found.That(m.sites.empty() || m.sites.size() == m.weights.size() * m.parameter_names.size(),
             {&at, "sites"}, "expected one row of parameters per weight", ErrorCode::kShapeMismatch,
             m.sites.size());
}

void CheckMeaning(Findings& found, const FieldPath& at, const AvatarState& m) {
  found.That(m.queue.size() <= m.queue_size, {&at, "queue"}, "expected at most queue_size requests",
             ErrorCode::kShapeMismatch, m.queue_size);
}

void CheckMeaning(Findings& found, const FieldPath& at, const Movements& m) {
  std::uint32_t before = 0;
  for (std::size_t i = 0; i < m.ends.size(); ++i) {
    found.That(m.ends[i] >= before && m.ends[i] - before <= kMaxRecordBytes, {&at, "ends", i},
               "expected ends that do not decrease and records of at most 64 KiB");
    before = m.ends[i];
  }
  found.That(before == m.records.size(), {&at, "records"},
             "expected as many bytes as the last end states", ErrorCode::kShapeMismatch,
             m.records.size());
}

void CheckMeaning(Findings& found, const FieldPath& at, const LibraryPiece& m) {
  found.That(m.offset <= m.total_bytes && m.bytes.size() <= m.total_bytes - m.offset,
             {&at, "offset"}, "expected a piece inside the library", ErrorCode::kOutOfRange,
             m.offset);
}

template <typename M>
Status Check(const M& message) {
  Findings found;
  CheckFields(found, FieldPath{.name = MessageTypeName(M::kType)}, message);
  return found.Result();
}

#define STRIDEWIRE_INSTANTIATE(Struct, ...) template Status Check(const Struct& message);
STRIDEWIRE_MESSAGES(STRIDEWIRE_INSTANTIATE)
#undef STRIDEWIRE_INSTANTIATE

}  // namespace stridewire::protocol
