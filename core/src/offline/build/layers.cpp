#include "offline/build/layers.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "base/check.h"
#include "offline/base/text.h"
#include "offline/build/library_writer.h"
#include "offline/extract/assemble.h"
#include "runtime/skeleton/layer_clip.h"

namespace stridewire {
namespace {

constexpr double kMinLayerS = 0.1;

std::vector<int> ChildrenOf(const Skeleton& skeleton, int joint,
                            const std::vector<bool>& left_out) {
  std::vector<int> children;
  for (int j = joint + 1; j < skeleton.joint_count(); ++j) {
    const auto k = static_cast<std::size_t>(j);
    if (skeleton.joints[k].parent == joint && !left_out[k]) children.push_back(j);
  }
  return children;
}

// Returns the trunk: the longest chain of joints from a child of the root, or of a joint between
// root and hips, up to the joint where arms and head branch off. That joint is included.
std::vector<int> TrunkOf(const Skeleton& skeleton, const std::vector<bool>& of_legs) {
  std::vector<int> trunk;
  for (int j = 0; j < skeleton.joint_count(); ++j) {
    if (!of_legs[static_cast<std::size_t>(j)]) continue;
    std::vector<int> chain;
    std::vector<int> next = ChildrenOf(skeleton, j, of_legs);
    while (next.size() == 1) {
      chain.push_back(next.front());
      next = ChildrenOf(skeleton, next.front(), of_legs);
    }
    // A chain that ends without a branch is an arm or a tail.
    if (next.size() > 1 && chain.size() > trunk.size()) trunk = std::move(chain);
  }
  return trunk;
}

std::string Quoted(std::string_view name) { return "layer \"" + std::string(name) + "\""; }

Status CheckLayer(const RawLayer& layer, const Skeleton& skeleton,
                  const std::vector<bool>& of_legs) {
  const auto fail = [&](ErrorCode code, const char* text) {
    return Fail(code, text, Quoted(layer.name));
  };
  if (!IsLayerName(layer.name)) {
    return fail(ErrorCode::kInvalidArgument,
                "expected a name of 1 to 32 characters a-z, A-Z, 0-9, '_', '-' or '.'");
  }
  const std::size_t joints = skeleton.joints.size();
  if (layer.weights.size() != joints || layer.clip.joint_count != skeleton.joint_count()) {
    return fail(ErrorCode::kShapeMismatch, "clip and mask must have the joints of the skeleton");
  }
  if (Status status = layer.clip.Validate(); !status) {
    return fail(status.error().code, status.error().text);
  }
  bool is_empty = true;
  for (std::size_t j = 0; j < joints; ++j) {
    const float weight = layer.weights[j];
    if (!(weight >= 0.0f && weight <= 1.0f)) {
      return fail(ErrorCode::kOutOfRange, "expected weights from 0 to 1 in the mask");
    }
    if (weight > 0.0f && of_legs[j]) {
      return Fail(ErrorCode::kInvalidArgument, "the mask must not contain the root or a leg",
                  Quoted(layer.name) + ", joint " + skeleton.joints[j].name);
    }
    is_empty = is_empty && weight <= 0.0f;
  }
  if (is_empty) return fail(ErrorCode::kInvalidArgument, "the mask contains no joint");
  if (layer.clip.duration_s() * kLayerKeysPerSecond > kMaxLayerFrames - 2) {
    return fail(ErrorCode::kLimitExceeded, "the clip is longer than ten minutes");
  }
  if (layer.is_looping && layer.clip.duration_s() < kMinLayerS) {
    return fail(ErrorCode::kOutOfRange, "the loop is shorter than 0.1 s");
  }
  return {};
}

}  // namespace

std::vector<float> UpperBodyMask(const Skeleton& skeleton) {
  const std::vector<bool> of_legs = JointsOfLegs(skeleton);
  std::vector<float> mask;
  STRIDEWIRE_CHECK(of_legs.size() == skeleton.joints.size());
  for (const bool is_of_leg : of_legs) mask.push_back(is_of_leg ? 0.0f : 1.0f);
  const std::vector<int> trunk = TrunkOf(skeleton, of_legs);
  for (std::size_t k = 0; k < trunk.size(); ++k) {
    mask[static_cast<std::size_t>(trunk[k])] =
        static_cast<float>(k + 1) / static_cast<float>(trunk.size() + 1);
  }
  return mask;
}

Expected<std::vector<float>> MaskOfJoints(const Skeleton& skeleton,
                                          std::span<const std::string> names) {
  const std::vector<bool> of_legs = JointsOfLegs(skeleton);
  std::vector<float> mask(skeleton.joints.size(), 0.0f);
  for (const std::string& name : names) {
    const int joint = skeleton.FindJoint(name);
    if (joint < 0) return Fail(ErrorCode::kNotFound, "the skeleton has no such joint", name);
    if (of_legs[static_cast<std::size_t>(joint)]) {
      return Fail(ErrorCode::kInvalidArgument, "a layer cannot animate the root or a leg", name);
    }
    mask[static_cast<std::size_t>(joint)] = 1.0f;
  }
  for (std::size_t j = 1; j < mask.size(); ++j) {
    const int parent = skeleton.joints[j].parent;
    mask[j] = std::max(mask[j], mask[static_cast<std::size_t>(parent)]);
  }
  return mask;
}

Expected<RawLayer> CutLayer(const Capture& capture, const Skeleton& skeleton, const LayerCut& cut) {
  const std::string where = Quoted(cut.name) + ": " + capture.path;
  if (!SameJointTree(skeleton, capture.skeleton)) {
    return Fail(ErrorCode::kShapeMismatch, "the capture has another skeleton than the library",
                where + ": " + TreeDifference(skeleton, "the library", capture.skeleton));
  }
  const double from_s = cut.from_s.value_or(capture.first_frame / capture.clip.fps);
  const double to_s = cut.to_s.value_or(capture.clip.duration_s());
  // Allows for times that were rounded to two decimals.
  if (!(from_s >= 0.0 && to_s <= capture.clip.duration_s() + 0.01)) {
    return Fail(ErrorCode::kOutOfRange, "the times are outside the capture", where);
  }
  if (!(to_s - from_s >= kMinLayerS)) {
    return Fail(ErrorCode::kOutOfRange, "a layer must take at least 0.1 s", where);
  }
  RawLayer layer;
  layer.name = cut.name;
  layer.is_looping = cut.is_looping;
  layer.weights = UpperBodyMask(skeleton);
  layer.source =
      std::filesystem::path(capture.path).filename().string() + Text(" %.2f-%.2f s", from_s, to_s);

  STRIDEWIRE_CHECK(static_cast<int>(layer.weights.size()) == skeleton.joint_count());
  const double blend_s = cut.is_looping ? std::min(kLoopBlendS, 0.25 * (to_s - from_s)) : 0.0;
  const double duration_s = to_s - from_s - blend_s;
  const int intervals = std::max(1, static_cast<int>(std::lround(duration_s * capture.clip.fps)));
  layer.clip.fps = intervals / duration_s;
  layer.clip.Resize(intervals + 1, skeleton.joint_count());
  Pose tail(skeleton.joint_count());
  for (int f = 0; f <= intervals; ++f) {
    // The last frame of a loop equals its first frame, where the blend begins.
    const double time_s = cut.is_looping && f == intervals ? 0.0 : f / layer.clip.fps;
    PoseSpan frame = layer.clip.frame(f);
    SampleClip(capture.clip, from_s + time_s, frame);
    if (time_s >= blend_s) continue;
    SampleClip(capture.clip, from_s + duration_s + time_s, tail);
    const double u = time_s / blend_s;
    const auto share = static_cast<float>(u * u * (3.0 - 2.0 * u));
    for (std::size_t j = 0; j < tail.rotations.size(); ++j) {
      const Quat& from = tail.rotations[j];
      frame.rotations[j] =
          Normalise(from * SlerpFromIdentity(glm::conjugate(from) * frame.rotations[j], share));
    }
  }
  return layer;
}

Expected<StoredLayers> StoreLayers(std::span<const RawLayer> layers, const Skeleton& skeleton) {
  if (layers.size() > static_cast<std::size_t>(kMaxLayerClips)) {
    return Fail(ErrorCode::kLimitExceeded, "a library may have at most 64 layers",
                static_cast<std::int64_t>(layers.size()));
  }
  const std::vector<bool> of_legs = JointsOfLegs(skeleton);
  StoredLayers stored;
  Pose pose(skeleton.joint_count());
  for (const RawLayer& layer : layers) {
    if (Status status = CheckLayer(layer, skeleton, of_legs); !status) {
      return std::unexpected(status.error());
    }
    for (const LayerClip& other : stored.views_) {
      if (other.name == layer.name) {
        return Fail(ErrorCode::kInvalidArgument, "duplicate name", Quoted(layer.name));
      }
    }
    auto& content = *stored.contents_.emplace_back(std::make_unique<StoredLayers::Content>());
    content.name = layer.name;
    content.source = layer.source;
    for (std::size_t j = 0; j < layer.weights.size(); ++j) {
      if (layer.weights[j] <= 0.0f) continue;
      content.joints.push_back(static_cast<int>(j));
      content.weights.push_back(layer.weights[j]);
    }
    const double duration_s = layer.clip.duration_s();
    const int intervals =
        std::max(1, static_cast<int>(std::lround(duration_s * kLayerKeysPerSecond)));
    const int keys = layer.is_looping ? intervals : intervals + 1;
    for (int key = 0; key < keys; ++key) {
      SampleClip(layer.clip, duration_s * key / intervals, pose);
      for (const int joint : content.joints) {
        const Quat& q = pose.rotations[static_cast<std::size_t>(joint)];
        content.rotations.insert(content.rotations.end(), {q.x, q.y, q.z, q.w});
      }
    }
    stored.views_.push_back({.name = content.name,
                             .source = content.source,
                             .fps = duration_s > 0.0 ? intervals / duration_s : kLayerKeysPerSecond,
                             .is_looping = layer.is_looping,
                             .joints = content.joints,
                             .weights = content.weights,
                             .rotations = content.rotations});
  }
  STRIDEWIRE_CHECK(stored.views_.size() == layers.size() &&
                   stored.contents_.size() == layers.size());
  return stored;
}

Expected<std::shared_ptr<const MotionLibrary>> AddLayers(const MotionLibrary& library,
                                                         std::span<const RawLayer> layers) {
  const Expected<StoredLayers> added = StoreLayers(layers, library.skeleton());
  if (!added) return std::unexpected(added.error());
  std::vector<LayerClip> all;
  for (const LayerClip& layer : library.layers()) {
    const bool is_replaced = std::ranges::any_of(
        added->views(), [&](const LayerClip& other) { return other.name == layer.name; });
    if (!is_replaced) all.push_back(layer);
  }
  all.insert(all.end(), added->views().begin(), added->views().end());
  if (all.size() > static_cast<std::size_t>(kMaxLayerClips)) {
    return Fail(ErrorCode::kLimitExceeded, "a library may have at most 64 layers",
                static_cast<std::int64_t>(all.size()));
  }
  return WriteLibrary({library.skeleton(), library.stand_pose(), library.groups(), all});
}

}  // namespace stridewire
