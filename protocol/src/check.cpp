#include "stridewire/protocol/check.h"

#include <algorithm>
#include <cmath>
#include <string_view>
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
    if (path->index >= 0) error_->index = path->index;
  }
}

namespace {

/// Checks the name of a parameter. `seen` has a bit for each previous name.
void CheckName(Findings& found, const FieldPath& at, std::uint8_t name, unsigned& seen) {
  found.That(name < kParameterNames, at, name, "expected a parameter name from 0 to 8",
             ErrorCode::kMalformed);
  const unsigned bit = 1u << (name % kParameterNames);
  found.That((seen & bit) == 0, at, name, "a parameter occurs twice", ErrorCode::kMalformed);
  seen |= bit;
}

void CheckRings(Findings& found, const FieldPath& at, const Observe& m) {
  const Region& region = *m.region;
  const FieldPath rings = At(at, "rings");
  double before_m = 0.0;
  for (std::size_t i = 0; i < region.rings.size(); ++i) {
    const double to_m = region.rings[i].to_m;
    found.That(std::isfinite(to_m) && to_m > before_m, ErrorCode::kOutOfRange,
               "expected a radius above that of the previous ring", At(Entry(rings, i), "to_m"));
    before_m = to_m;
  }
  const std::size_t details = region.ring_details.size();
  if (details == 0) return;
  found.That(details == region.rings.size(), At(at, "ring_details"), details,
             "expected one detail per ring", ErrorCode::kMalformed);
  found.That(m.mode == PoseMode::kQuantised, ErrorCode::kUnsupported,
             "levels of detail require mode 1 (quantised)", At(at, "ring_details"));
}

}  // namespace

void CheckList(Findings& found, const std::vector<ParameterValue>& list, const Bounds& bounds,
               const FieldPath& at) {
  found.Count(list.size(), bounds, at);
  unsigned seen = 0;
  for (const ParameterValue& parameter : list) {
    CheckName(found, at, parameter.name, seen);
    found.That(std::isfinite(parameter.value), ErrorCode::kOutOfRange, "expected a finite number",
               at);
  }
}

void CheckMeaning(Findings& found, const FieldPath& at, const Observe& m) {
  found.That(m.detail == PoseDetail::kAll || m.mode == PoseMode::kQuantised,
             ErrorCode::kUnsupported, "levels of detail require mode 1 (quantised)",
             At(at, "detail"));
  if (!m.region) return;
  found.That(m.avatars.empty(), ErrorCode::kMalformed, "avatars must be empty if a region is given",
             At(at, "avatars"));
  CheckRings(found, At(at, "region"), m);
}

void CheckMeaning(Findings& found, const FieldPath& at, const HeightFieldInfo& m) {
  found.That(m.heights_m.size() == std::size_t{m.columns} * m.rows, At(at, "heights_m"),
             m.heights_m.size(), "expected columns * rows heights", ErrorCode::kShapeMismatch);
}

void CheckMeaning(Findings& found, const FieldPath& at, const TerrainBoxInfo& m) {
  found.That(m.min_m.x < m.max_m.x && m.min_m.z < m.max_m.z, ErrorCode::kOutOfRange,
             "expected max above min", at);
}

void CheckMeaning(Findings& found, const FieldPath& at, const SkeletonInfo& m) {
  const auto joint_count = static_cast<std::int64_t>(m.joints.size());
  const FieldPath joints = At(at, "joints");
  std::vector<std::string_view> names;
  names.reserve(m.joints.size());
  for (std::int64_t j = 0; j < joint_count; ++j) {
    const JointInfo& joint = m.joints[static_cast<std::size_t>(j)];
    found.That(j == 0 ? joint.parent == -1 : joint.parent >= 0 && joint.parent < j,
               At(Entry(joints, static_cast<std::size_t>(j)), "parent"), joint.parent,
               "expected -1 for joint 0, else a joint that precedes this one");
    names.push_back(joint.name);
  }
  std::sort(names.begin(), names.end());
  found.That(std::adjacent_find(names.begin(), names.end()) == names.end(), ErrorCode::kMalformed,
             "a name occurs twice", At(joints, "name"));
  const FieldPath end_sites = At(at, "end_sites");
  for (std::size_t e = 0; e < m.end_sites.size(); ++e) {
    found.That(m.end_sites[e].joint < joint_count, At(Entry(end_sites, e), "joint"),
               m.end_sites[e].joint, "expected the index of a joint");
  }
  for (const bool is_right : {false, true}) {
    const LegInfo& leg = m.legs[is_right];
    for (const std::int16_t joint : {leg.hip, leg.knee, leg.ankle, leg.ball}) {
      found.That(joint >= -1 && joint < joint_count, At(at, is_right ? "right_leg" : "left_leg"),
                 joint, "expected the index of a joint, or -1");
    }
  }
}

void CheckMeaning(Findings& found, const FieldPath& at, const WorldInfo& m) {
  const FieldPath codes = At(at, "rotation_quantizations");
  found.That(m.rotation_quantizations.empty() ||
                 m.rotation_quantizations.size() == m.skeleton.joints.size(),
             codes, m.rotation_quantizations.size(), "expected one quantization per joint",
             ErrorCode::kShapeMismatch);
  if (const Status status = CheckRotationQuantizations(m.rotation_quantizations); !status) {
    found.Wrong(status.error().code, status.error().text, codes, status.error().index);
  }
  if (m.reduced_joints.empty()) return;
  std::vector<std::int16_t> parents;
  for (const JointInfo& joint : m.skeleton.joints) parents.push_back(joint.parent);
  // Reduced joints are allowed only with quantizations. Without parents, CheckReducedJoints fails.
  if (m.rotation_quantizations.empty()) parents.clear();
  if (const Status status = CheckReducedJoints(m.reduced_joints, parents); !status) {
    found.Wrong(status.error().code, status.error().text, At(at, "reduced_joints"),
                status.error().index);
  }
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

void CheckMeaning(Findings& found, const FieldPath& at, const PoseBatch& m) {
  const PoseBatchInfo& info = m.info;
  found.That(info.mode != PoseMode::kMovement, ErrorCode::kUnsupported,
             "mode 2 (movement) has no poses", At(at, "mode"));
  const bool has_all =
      IsCompact(info.mode)
          ? CompactPoseBytes(m).has_value()
          : m.poses.size() == m.avatars.size() * PoseBytes(info.mode, info.joint_count);
  found.That(has_all, At(at, "poses"), m.poses.size(), "expected one pose per avatar",
             ErrorCode::kShapeMismatch);
}

void CheckMeaning(Findings& found, const FieldPath& at, const CurrentMovement& m) {
  const FieldPath keytimes = At(at, "keytimes_s");
  double before_s = 0.0;
  for (std::size_t k = 0; k < m.keytimes_s.size(); ++k) {
    const double keytime_s = m.keytimes_s[k];
    found.That(k == 0 ? keytime_s == 0.0 : keytime_s >= before_s, ErrorCode::kOutOfRange,
               "expected keytimes that start at 0 and do not decrease", Entry(keytimes, k));
    before_s = keytime_s;
  }
  const double last = m.keytimes_s.empty() ? 0.0 : static_cast<double>(m.keytimes_s.size() - 1);
  found.That(m.generic_time <= last, ErrorCode::kOutOfRange,
             "expected a time between 0 and the last keytime", At(at, "generic_time"));
  unsigned seen = 0;
  for (const std::uint8_t name : m.parameter_names) {
    CheckName(found, At(at, "parameter_names"), name, seen);
  }
  found.That(m.sites.empty() || m.sites.size() == m.weights.size() * m.parameter_names.size(),
             At(at, "sites"), m.sites.size(), "expected one row of parameters per weight",
             ErrorCode::kShapeMismatch);
}

void CheckMeaning(Findings& found, const FieldPath& at, const AvatarState& m) {
  found.That(m.queue.size() <= m.queue_size, At(at, "queue"), m.queue_size,
             "expected at most queue_size requests", ErrorCode::kShapeMismatch);
}

void CheckMeaning(Findings& found, const FieldPath& at, const Movements& m) {
  const FieldPath ends = At(at, "ends");
  std::uint32_t before = 0;
  for (std::size_t i = 0; i < m.ends.size(); ++i) {
    found.That(m.ends[i] >= before && m.ends[i] - before <= kMaxRecordBytes, ErrorCode::kOutOfRange,
               "expected ends that do not decrease and records of at most 64 KiB", Entry(ends, i));
    before = m.ends[i];
  }
  found.That(before == m.records.size(), At(at, "records"), m.records.size(),
             "expected as many bytes as the last end states", ErrorCode::kShapeMismatch);
}

void CheckMeaning(Findings& found, const FieldPath& at, const LibraryPiece& m) {
  found.That(m.offset <= m.total_bytes && m.bytes.size() <= m.total_bytes - m.offset,
             At(at, "offset"), m.offset, "expected a piece inside the library");
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
