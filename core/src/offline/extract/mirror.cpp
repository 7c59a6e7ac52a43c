#include "offline/extract/mirror.h"

#include <algorithm>
#include <cctype>
#include <string>
#include <utility>
#include <vector>

#include "base/check.h"
#include "runtime/skeleton/foot_vector.h"

namespace stridewire {
namespace {

struct Sides {
  const char* left;
  const char* right;
};
constexpr Sides kSideWords[] = {{"Left", "Right"}, {"left", "right"}, {"LEFT", "RIGHT"}};
constexpr Sides kSideLetters[] = {{"L", "R"}, {"l", "r"}};

// Returns the name of the joint on the other side, or the name itself if it has no side.
std::string OtherSideName(const Skeleton& skeleton, const std::string& name) {
  for (const Sides& words : kSideWords) {
    for (const auto& [from, to] :
         {std::pair(words.left, words.right), std::pair(words.right, words.left)}) {
      if (const std::size_t at = name.find(from); at != std::string::npos) {
        return std::string(name).replace(at, std::char_traits<char>::length(from), to);
      }
    }
  }
  // A single letter counts as a side only if the joint of the other side exists ("Root", "Ribs").
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

std::optional<std::vector<int>> PairByName(const Skeleton& skeleton) {
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
  // Names without sides would make every joint its own partner.
  const int left = skeleton.leg(Foot::kLeft).hip, right = skeleton.leg(Foot::kRight).hip;
  if (left >= 0 && partners[static_cast<std::size_t>(left)] != right) return std::nullopt;
  return partners;
}

constexpr double kNoPair = 1e9;
constexpr double kShapeShare = 0.08;  // Relative tolerance for bones of a mirrored pair.
constexpr double kShapeM = 0.01;      // Absolute tolerance, added to the relative one.

// Pairs joints by their positions at identity rotations; x = 0 is the plane of symmetry.
class ShapePairs {
 public:
  explicit ShapePairs(const Skeleton& skeleton)
      : skeleton_(skeleton),
        children_(skeleton.joints.size()),
        partners_(skeleton.joints.size()),
        costs_(skeleton.joints.size() * skeleton.joints.size(), -1.0) {
    for (std::size_t j = 1; j < skeleton.joints.size(); ++j) {
      children_[static_cast<std::size_t>(skeleton.joints[j].parent)].push_back(static_cast<int>(j));
    }
  }

  [[nodiscard]] std::optional<std::vector<int>> Run() {
    const int left = skeleton_.leg(Foot::kLeft).hip, right = skeleton_.leg(Foot::kRight).hip;
    if (left < 0 || right < 0 || Cost(0, 0) >= kNoPair) return std::nullopt;
    Assign(0, 0);
    if (partners_[static_cast<std::size_t>(left)] != right) return std::nullopt;
    return partners_;
  }

 private:
  // Returns the distance of the bone to `b` from the mirror image of the bone to `a`, or kNoPair.
  [[nodiscard]] double BoneCost(int a, int b) const {
    if (a == 0 || b == 0) return a == b ? 0.0 : kNoPair;
    const DVec3 u(skeleton_.joints[static_cast<std::size_t>(a)].offset_m);
    const DVec3 v(skeleton_.joints[static_cast<std::size_t>(b)].offset_m);
    const double apart = glm::length(DVec3(-u.x, u.y, u.z) - v);
    return apart <= kShapeShare * std::max(glm::length(u), glm::length(v)) + kShapeM ? apart
                                                                                     : kNoPair;
  }

  // Pairs each child of `a` with the best fitting child of `b` (`a` may equal `b`) and returns the
  // total cost. Returns kNoPair if a child remains without partner.
  double PairChildren(int a, int b, std::vector<std::pair<int, int>>* pairs) {
    const std::vector<int>& from = children_[Index(a)];
    const std::vector<int>& to = children_[Index(b)];
    if (from.size() != to.size()) return kNoPair;
    double cost = 0.0;
    std::vector<bool> is_taken(to.size(), false);
    for (std::size_t i = 0; i < from.size(); ++i) {
      if (a == b && is_taken[i]) continue;
      double best_cost = kNoPair;
      std::size_t best = to.size();
      for (std::size_t k = a == b ? i : 0; k < to.size(); ++k) {
        if (is_taken[k]) continue;
        const double here = Cost(from[i], to[k]);
        if (here < best_cost) {
          best_cost = here;
          best = k;
        }
      }
      if (best == to.size()) return kNoPair;
      is_taken[best] = true;
      cost += best_cost;
      if (pairs != nullptr) pairs->emplace_back(from[i], to[best]);
    }
    return cost;
  }

  // Returns the memoized cost of pairing `a` with `b` and all joints below them.
  double Cost(int a, int b) {
    double& known = costs_[Index(a) * skeleton_.joints.size() + Index(b)];
    if (known < 0.0) {
      double cost = BoneCost(a, b);
      if (cost < kNoPair) cost = std::min(kNoPair, cost + PairChildren(a, b, nullptr));
      known = cost;
    }
    return known;
  }

  void Assign(int a, int b) {
    partners_[Index(a)] = b;
    partners_[Index(b)] = a;
    std::vector<std::pair<int, int>> pairs;
    PairChildren(a, b, &pairs);
    for (const auto& [from, to] : pairs) Assign(from, to);
  }

  static std::size_t Index(int joint) { return static_cast<std::size_t>(joint); }

  const Skeleton& skeleton_;
  std::vector<std::vector<int>> children_;
  std::vector<int> partners_;
  // [a][b]: cost of the pair; negative if it has not been computed yet.
  std::vector<double> costs_;
};

}  // namespace

std::optional<std::vector<int>> FindMirrorJoints(const Skeleton& skeleton) {
  if (auto partners = PairByName(skeleton)) return partners;
  return ShapePairs(skeleton).Run();
}

ExtractedExample MirrorExample(const Skeleton& skeleton, const std::vector<int>& partners,
                               std::span<const ParameterName> names,
                               const ExtractedExample& source) {
  STRIDEWIRE_CHECK(names.size() == source.example.parameters.size());
  STRIDEWIRE_CHECK(partners.size() == skeleton.joints.size());
  STRIDEWIRE_CHECK(source.example.clip.joint_count == skeleton.joint_count());
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
