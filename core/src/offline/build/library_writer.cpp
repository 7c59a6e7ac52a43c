#include "offline/build/library_writer.h"

#include <flatbuffers/flatbuffers.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "base/check.h"
#include "motion_library_generated.h"
#include "offline/build/transitions.h"
#include "runtime/library/library_file.h"
#include "runtime/library/transition.h"
#include "runtime/skeleton/layer_clip.h"

namespace stridewire {
namespace {

using Builder = flatbuffers::FlatBufferBuilder;

fb::Vec3 ToFb(const Vec3& v) { return {v.x, v.y, v.z}; }

fb::Leg ToFb(const Leg& leg) {
  return {
      leg.hip, leg.knee, leg.ankle, leg.ball, ToFb(leg.ball_offset_m), ToFb(leg.toe_tip_offset_m)};
}

template <typename T>
flatbuffers::Offset<flatbuffers::Vector<T>> AddVector(Builder& builder, std::span<const T> values) {
  return builder.CreateVector(values.data(), values.size());
}

flatbuffers::Offset<fb::Group> AddGroup(Builder& builder, const MotionGroup& group,
                                        const GridLayout& layout) {
  STRIDEWIRE_CHECK(group.sources.size() == static_cast<std::size_t>(group.example_count));
  STRIDEWIRE_CHECK(group.sites.size() ==
                   static_cast<std::size_t>(group.site_count) * group.parameters.size());
  STRIDEWIRE_CHECK(group.variant_parameters.size() ==
                   static_cast<std::size_t>(group.variant_count) * group.parameters.size());
  STRIDEWIRE_CHECK(group.dilations.size() == static_cast<std::size_t>(group.site_count));
  STRIDEWIRE_CHECK(group.grid.size() == static_cast<std::size_t>(group.grid_point_count) *
                                            static_cast<std::size_t>(group.row_count()) *
                                            static_cast<std::size_t>(layout.row_floats));
  std::vector<flatbuffers::Offset<flatbuffers::String>> sources;
  for (const std::string_view source : group.sources) {
    sources.push_back(builder.CreateString(source.data(), source.size()));
  }
  builder.ForceVectorAlignment(group.grid.size(), sizeof(float), 64);
  const auto grid = AddVector(builder, group.grid);
  std::vector<fb::Parameter> parameters;
  for (const Parameter& p : group.parameters) {
    parameters.emplace_back(p.min, p.max, p.centre, p.scale, static_cast<std::uint8_t>(p.name));
  }
  const auto parameters_offset = builder.CreateVectorOfStructs(parameters);
  const auto sites = AddVector(builder, group.sites);
  const auto site_weights = group.site_weights.empty() ? 0 : AddVector(builder, group.site_weights);
  const auto dilations = AddVector(builder, group.dilations);
  const auto linear = AddVector(builder, group.linear);
  const auto radial = AddVector(builder, group.radial);
  const auto cells = AddVector(builder, group.cells);
  const auto keytimes = AddVector(builder, group.keytimes_s);
  const auto headings = AddVector(builder, group.heading_change_rad);
  const auto sources_offset = builder.CreateVector(sources);
  const auto mirrored = AddVector(builder, group.mirrored);
  const auto variants =
      group.variant_parameters.empty() ? 0 : AddVector(builder, group.variant_parameters);
  return fb::CreateGroup(builder, static_cast<std::uint8_t>(group.kind), parameters_offset,
                         group.example_count, sites, site_weights, dilations, linear, radial, cells,
                         keytimes, headings, grid, sources_offset, mirrored, group.radius_factor,
                         variants);
}

flatbuffers::Offset<fb::Layer> AddLayer(Builder& builder, const LayerClip& layer) {
  const auto name = builder.CreateString(layer.name.data(), layer.name.size());
  const auto source = builder.CreateString(layer.source.data(), layer.source.size());
  const auto joints = AddVector(builder, layer.joints);
  const auto weights = AddVector(builder, layer.weights);
  const auto rotations = AddVector(builder, layer.rotations);
  return fb::CreateLayer(builder, name, source, layer.fps, layer.is_looping, joints, weights,
                         rotations);
}

}  // namespace

Expected<std::shared_ptr<const MotionLibrary>> WriteLibrary(const LibraryContent& content) {
  if (content.groups.empty()) {
    return Fail(ErrorCode::kOutOfRange, "there are no examples to build a library from");
  }
  // Grids are nearly the whole library. If the buffer had to grow, it would copy them several
  // times.
  std::size_t size_estimate = 1 << 18;
  for (const MotionGroup& group : content.groups) {
    size_estimate += group.grid.size() * sizeof(group.grid.front());
  }
  Builder builder(size_estimate);
  std::vector<flatbuffers::Offset<fb::Group>> groups;
  const GridLayout layout(content.skeleton.joint_count());
  for (const MotionGroup& group : content.groups) {
    groups.push_back(AddGroup(builder, group, layout));
  }

  std::vector<flatbuffers::Offset<fb::Joint>> joints;
  for (const Joint& joint : content.skeleton.joints) {
    const fb::Vec3 offset = ToFb(joint.offset_m);
    joints.push_back(
        fb::CreateJoint(builder, builder.CreateString(joint.name), joint.parent, &offset));
  }
  std::vector<fb::EndSite> end_sites;
  for (const EndSite& site : content.skeleton.end_sites) {
    end_sites.emplace_back(site.joint, ToFb(site.offset_m));
  }
  const auto joints_offset = builder.CreateVector(joints);
  const auto end_sites_offset = builder.CreateVectorOfStructs(end_sites);
  const fb::Leg left = ToFb(content.skeleton.leg(Foot::kLeft));
  const fb::Leg right = ToFb(content.skeleton.leg(Foot::kRight));
  const auto skeleton = fb::CreateSkeleton(builder, joints_offset, end_sites_offset, &left, &right);
  std::vector<fb::Quat> stand;
  for (const Quat& q : content.stand_pose.rotations) stand.emplace_back(q.x, q.y, q.z, q.w);
  const fb::Vec3 stand_root = ToFb(content.stand_pose.root_position_m);
  const auto stand_offset = builder.CreateVectorOfStructs(stand);
  const auto groups_offset = builder.CreateVector(groups);
  std::vector<flatbuffers::Offset<fb::Layer>> layers;
  for (const LayerClip& layer : content.layers) layers.push_back(AddLayer(builder, layer));
  // Without layers, the field is omitted. Readers treat an absent field as an empty list.
  const auto layers_offset = layers.empty() ? 0 : builder.CreateVector(layers);
  std::vector<fb::Transition> transitions;
  for (const Transition& t : FindTransitions(content)) {
    transitions.emplace_back(t.distance_m, t.end_example, t.start_example);
  }
  STRIDEWIRE_CHECK(transitions.size() == (content.groups.size() + 1) * (content.groups.size() + 1));
  const auto transitions_offset = builder.CreateVectorOfStructs(transitions);
  fb::FinishMotionLibraryBuffer(
      builder, fb::CreateMotionLibrary(builder, skeleton, &stand_root, stand_offset, groups_offset,
                                       layers_offset, transitions_offset));

  const std::span payload(reinterpret_cast<const std::byte*>(builder.GetBufferPointer()),
                          builder.GetSize());
  const auto header = MakeLibraryHeader(payload);
  std::vector<std::byte> bytes(header.begin(), header.end());
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  return MotionLibrary::FromBytes(bytes);
}

}  // namespace stridewire
