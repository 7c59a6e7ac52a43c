#include "stridewire/offline/library_builder.h"

#include <flatbuffers/flatbuffers.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "example_clusters.h"
#include "grid_cells.h"
#include "grid_example.h"
#include "library_file.h"
#include "motion_library_generated.h"
#include "stridewire/runtime/cardinal_basis.h"
#include "stridewire/runtime/measure.h"

namespace stridewire {
namespace {

fb::Vec3 ToFb(const Vec3& v) { return {v.x, v.y, v.z}; }

fb::Leg ToFb(const Leg& leg) {
  return {
      leg.hip, leg.knee, leg.ankle, leg.ball, ToFb(leg.ball_offset_m), ToFb(leg.toe_tip_offset_m)};
}

std::string Where(const RawGroup& group, const RawExample& example) {
  return std::string(MovementKindName(group.kind)) + " example " + example.source;
}

Status ValidateExample(const RawGroup& group, const RawExample& example, int joint_count) {
  const auto failed = [&](ErrorCode code, const char* text) {
    return Fail(code, text, Where(group, example));
  };
  if (Status status = example.clip.Validate(); !status) {
    return failed(status.error().code, status.error().text);
  }
  if (example.clip.joint_count != joint_count) {
    return failed(ErrorCode::kShapeMismatch, "the clip has another joint count than the skeleton");
  }
  if (Status status = ValidateKeytimes(example.keytimes_s); !status) {
    return failed(status.error().code, status.error().text);
  }
  if (example.keytimes_s.size() != group.examples.front().keytimes_s.size()) {
    return failed(ErrorCode::kShapeMismatch, "another number of keytimes than the group");
  }
  if (example.keytimes_s.back() > example.clip.duration_s() + 1e-6) {
    return failed(ErrorCode::kOutOfRange, "the last keytime lies behind the end of the clip");
  }
  if (example.parameters.size() != group.parameters.size()) {
    return failed(ErrorCode::kShapeMismatch, "another number of parameters than the group");
  }
  for (const double parameter : example.parameters) {
    if (!std::isfinite(parameter))
      return failed(ErrorCode::kOutOfRange, "a parameter is not finite");
  }
  if (!std::isfinite(example.heading_change_rad)) {
    return failed(ErrorCode::kOutOfRange, "the heading change is not finite");
  }
  return {};
}

struct ParameterRange {
  double min = HUGE_VAL;
  double max = -HUGE_VAL;
  double spread = 0.0;
};

ParameterRange RangeOf(const std::vector<GridExample>& examples, std::size_t l) {
  ParameterRange range;
  double mean = 0.0;
  const auto count = static_cast<double>(examples.size());
  for (const GridExample& example : examples) {
    range.min = std::min(range.min, example.parameters[l]);
    range.max = std::max(range.max, example.parameters[l]);
    mean += example.parameters[l] / count;
  }
  for (const GridExample& example : examples) {
    range.spread += (example.parameters[l] - mean) * (example.parameters[l] - mean) / count;
  }
  range.spread = std::sqrt(range.spread);
  return range;
}

}  // namespace

Expected<std::shared_ptr<const MotionLibrary>> LibraryBuilder::Build(const RawLibrary& raw) {
  notes.clear();
  if (Status status = raw.skeleton.Validate(); !status) return std::unexpected(status.error());
  const int joint_count = raw.skeleton.joint_count();
  if (static_cast<int>(raw.stand_pose.rotations.size()) != joint_count) {
    return Fail(ErrorCode::kShapeMismatch, "the stand pose does not fit the skeleton");
  }
  const GridLayout layout(joint_count);

  flatbuffers::FlatBufferBuilder builder(1 << 20);
  std::vector<flatbuffers::Offset<fb::Group>> groups;
  for (std::size_t g = 0; g < raw.groups.size(); ++g) {
    const RawGroup& group = raw.groups[g];
    if (group.examples.empty()) continue;
    const auto note = [&](std::string text) {
      notes.push_back({static_cast<int>(g), std::move(text)});
    };
    for (const RawExample& example : group.examples) {
      if (Status status = ValidateExample(group, example, joint_count); !status) {
        return std::unexpected(status.error());
      }
    }

    const std::vector<int> cells = ChooseCells(group, grid_fps, layout);
    std::vector<GridExample> examples;
    examples.reserve(group.examples.size());
    for (const RawExample& example : group.examples) {
      examples.push_back(ResampleOnGrid(example, cells, layout));
    }
    AlignHemispheres(examples, layout, joint_count);

    // Near duplicates are spikes in the weights: average them at equal generic times.
    std::vector<double> units(group.parameters.size(), 1.0);
    for (std::size_t l = 0; l < units.size(); ++l) {
      if (group.parameters[l] == ParameterName::kTurn) units[l] = kMetresPerRadian;
    }
    const double diameter = std::max(cluster_diameter, 10.0 * kMinSiteDistance);
    const std::vector<std::vector<int>> clusters = CompleteLinkage(examples, units, diameter);
    if (clusters.size() < examples.size()) {
      note(std::to_string(examples.size()) + " examples averaged to " +
           std::to_string(clusters.size()));
      std::vector<GridExample> averaged;
      for (const std::vector<int>& cluster : clusters) {
        averaged.push_back(AverageExamples(examples, cluster, layout, raw.skeleton, group));
      }
      examples = std::move(averaged);
    }

    const std::size_t n = examples.size();
    const std::size_t d = group.parameters.size();
    std::vector<double> scales(d);
    std::vector<ParameterRange> ranges(d);
    for (std::size_t l = 0; l < d; ++l) {
      ranges[l] = RangeOf(examples, l);
      scales[l] = ranges[l].spread > 1e-6 ? ranges[l].spread : 1.0;
      if (n > 1 && ranges[l].spread <= 1e-6) {
        note(std::string(ParameterText(group.parameters[l])) +
             " is the same in every example: asking for another value has no effect");
      }
    }
    std::vector<double> sites;
    std::vector<double> keytimes;
    std::vector<double> heading_changes;
    std::vector<std::uint8_t> mirrored;
    std::vector<flatbuffers::Offset<flatbuffers::String>> sources;
    for (const GridExample& example : examples) {
      sites.insert(sites.end(), example.parameters.begin(), example.parameters.end());
      keytimes.insert(keytimes.end(), example.keytimes_s.begin(), example.keytimes_s.end());
      heading_changes.push_back(example.heading_change_rad);
      mirrored.push_back(example.mirrored ? 1 : 0);
      sources.push_back(builder.CreateString(example.source));
    }
    Expected<CardinalBasis> basis =
        CardinalBasisFit{static_cast<int>(d), static_cast<int>(n), sites, {}, scales}.Run();
    if (!basis) {
      Error error = basis.error();
      error.where = "group " + std::string(MovementKindName(group.kind));
      return std::unexpected(error);
    }

    const std::size_t row_floats = static_cast<std::size_t>(layout.row_floats);
    const std::size_t points = examples.front().rows.size() / row_floats;
    builder.ForceVectorAlignment(points * n * row_floats, sizeof(float), 64);
    float* grid = nullptr;
    const auto grid_offset = builder.CreateUninitializedVector(points * n * row_floats, &grid);
    for (std::size_t p = 0; p < points; ++p) {
      for (std::size_t e = 0; e < n; ++e) {
        std::memcpy(grid + (p * n + e) * row_floats, &examples[e].rows[p * row_floats],
                    row_floats * sizeof(float));
      }
    }

    std::vector<fb::Parameter> parameters;
    for (std::size_t l = 0; l < d; ++l) {
      parameters.emplace_back(ranges[l].min, ranges[l].max, basis->centres[l], scales[l],
                              static_cast<std::uint8_t>(group.parameters[l]));
    }
    const auto parameters_offset = builder.CreateVectorOfStructs(parameters);
    const auto sites_offset = builder.CreateVector(basis->sites);
    const auto dilations_offset = builder.CreateVector(basis->dilations);
    const auto linear_offset = builder.CreateVector(basis->linear);
    const auto radial_offset = builder.CreateVector(basis->radial);
    const auto cells_offset = builder.CreateVector(cells);
    const auto keytimes_offset = builder.CreateVector(keytimes);
    const auto heading_offset = builder.CreateVector(heading_changes);
    const auto sources_offset = builder.CreateVector(sources);
    const auto mirrored_offset = builder.CreateVector(mirrored);
    groups.push_back(fb::CreateGroup(
        builder, static_cast<std::uint8_t>(group.kind), parameters_offset, static_cast<int>(n),
        sites_offset, 0, dilations_offset, linear_offset, radial_offset, cells_offset,
        keytimes_offset, heading_offset, grid_offset, sources_offset, mirrored_offset));
  }
  if (groups.empty()) return Fail(ErrorCode::kOutOfRange, "there is no example to build from");

  std::vector<flatbuffers::Offset<fb::Joint>> joints;
  for (const Joint& joint : raw.skeleton.joints) {
    const fb::Vec3 offset = ToFb(joint.offset_m);
    joints.push_back(
        fb::CreateJoint(builder, builder.CreateString(joint.name), joint.parent, &offset));
  }
  std::vector<fb::EndSite> end_sites;
  for (const EndSite& site : raw.skeleton.end_sites) {
    end_sites.emplace_back(site.joint, ToFb(site.offset_m));
  }
  const auto joints_offset = builder.CreateVector(joints);
  const auto end_sites_offset = builder.CreateVectorOfStructs(end_sites);
  const fb::Leg left = ToFb(raw.skeleton.leg(Foot::kLeft));
  const fb::Leg right = ToFb(raw.skeleton.leg(Foot::kRight));
  const auto skeleton = fb::CreateSkeleton(builder, joints_offset, end_sites_offset, &left, &right);
  std::vector<fb::Quat> stand;
  for (const Quat& q : raw.stand_pose.rotations) stand.emplace_back(q.x, q.y, q.z, q.w);
  const fb::Vec3 stand_root = ToFb(raw.stand_pose.root_position_m);
  const auto stand_offset = builder.CreateVectorOfStructs(stand);
  const auto groups_offset = builder.CreateVector(groups);
  fb::FinishMotionLibraryBuffer(builder, fb::CreateMotionLibrary(builder, skeleton, &stand_root,
                                                                 stand_offset, groups_offset));

  const std::span payload(reinterpret_cast<const std::byte*>(builder.GetBufferPointer()),
                          builder.GetSize());
  const auto header = MakeLibraryHeader(payload);
  std::vector<std::byte> bytes(header.begin(), header.end());
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  return MotionLibrary::FromBytes(bytes);
}

}  // namespace stridewire
