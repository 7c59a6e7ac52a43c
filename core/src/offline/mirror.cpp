#include "stridewire/offline/mirror.h"

#include <cctype>
#include <string>

#include "stridewire/base/check.h"
#include "stridewire/runtime/foot_vector.h"

namespace stridewire {
namespace {

struct Sides {
  const char* left;
  const char* right;
};
constexpr Sides kSideWords[] = {{"Left", "Right"}, {"left", "right"}, {"LEFT", "RIGHT"}};
constexpr Sides kSideLetters[] = {{"L", "R"}, {"l", "r"}};

// The name of the joint on the other side; the name itself if it names no side.
std::string OtherSideName(const Skeleton& skeleton, const std::string& name) {
  for (const Sides& words : kSideWords) {
    for (const auto& [from, to] :
         {std::pair(words.left, words.right), std::pair(words.right, words.left)}) {
      if (const std::size_t at = name.find(from); at != std::string::npos) {
        return std::string(name).replace(at, std::char_traits<char>::length(from), to);
      }
    }
  }
  // One letter is a side only if the other side's joint exists: "Root" and "Ribs" are none.
  for (const Sides& letters : kSideLetters) {
    for (const auto& [from, to] :
         {std::pair(letters.left, letters.right), std::pair(letters.right, letters.left)}) {
      if (name.size() < 2 || name[0] != from[0]) continue;
      const std::string other = to + name.substr(1);
      if (skeleton.FindJoint(other) >= 0) return other;
    }
  }
  return name;
}

}  // namespace

std::optional<std::vector<int>> FindMirrorJoints(const Skeleton& skeleton) {
  std::vector<int> partners;
  for (const Joint& joint : skeleton.joints) {
    const int partner = skeleton.FindJoint(OtherSideName(skeleton, joint.name));
    if (partner < 0) return std::nullopt;
    partners.push_back(partner);
  }
  for (std::size_t j = 0; j < partners.size(); ++j) {
    const auto partner = static_cast<std::size_t>(partners[j]);
    if (partners[partner] != static_cast<int>(j)) return std::nullopt;
    const int parent = skeleton.joints[j].parent;
    const int expected = parent < 0 ? -1 : partners[static_cast<std::size_t>(parent)];
    if (skeleton.joints[partner].parent != expected) return std::nullopt;
  }
  return partners;
}

ExtractedExample MirrorExample(const Skeleton& skeleton, const std::vector<int>& partners,
                               std::span<const ParameterName> names,
                               const ExtractedExample& source) {
  STRIDEWIRE_CHECK(names.size() == source.example.parameters.size());
  ExtractedExample out = source;
  out.example.mirrored = !source.example.mirrored;
  out.example.heading_change_rad = -source.example.heading_change_rad;
  if (IsStep(source.kind)) out.kind = StepKind(OtherFoot(MovingFoot(source.kind)));
  Clip& clip = out.example.clip;
  for (int f = 0; f < clip.frame_count(); ++f) {
    const ConstPoseSpan from = source.example.clip.frame(f);
    const PoseSpan to = clip.frame(f);
    to.root_position_m.x = -from.root_position_m.x;
    for (std::size_t j = 0; j < partners.size(); ++j) {
      const Quat& q = from.rotations[static_cast<std::size_t>(partners[j])];
      to.rotations[j] = Quat(q.w, q.x, -q.y, -q.z);
    }
  }
  const bool step = IsStep(out.kind);
  const Foot moving = step ? MovingFoot(out.kind) : Foot::kLeft;
  const DVec3 start = FootVector(skeleton, clip.frame(0), moving, 0.0);
  const DVec3 end = FootVector(skeleton, clip.frame(clip.frame_count() - 1), moving,
                               out.example.heading_change_rad);
  for (std::size_t i = 0; i < names.size(); ++i) {
    double& value = out.example.parameters[i];
    switch (names[i]) {
      case ParameterName::kStartX: value = start.x; break;
      case ParameterName::kStartY: value = start.y; break;
      case ParameterName::kStartZ: value = start.z; break;
      case ParameterName::kEndX: value = end.x; break;
      case ParameterName::kEndY: value = end.y; break;
      case ParameterName::kEndZ: value = end.z; break;
      case ParameterName::kTurn: value = -value; break;
      case ParameterName::kLength:
      case ParameterName::kHeight: break;
    }
  }
  return out;
}

}  // namespace stridewire
