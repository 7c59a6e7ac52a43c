#include "offline/extract/mirror_joints.h"

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include "base/check.h"

namespace stridewire {
namespace {

constexpr std::pair<std::string_view, std::string_view> kSideWords[] = {
    {"Left", "Right"}, {"left", "right"}, {"LEFT", "RIGHT"}};

bool IsUpper(char c) { return c >= 'A' && c <= 'Z'; }
bool IsLower(char c) { return c >= 'a' && c <= 'z'; }
bool IsLetter(char c) { return IsUpper(c) || IsLower(c); }

// A word or letter for left or right in a name, and its counterpart for the other side.
struct SideInName {
  std::size_t at = 0;
  std::size_t length = 0;
  std::string_view other;
};

// Returns true if the letter at `at` is a word of its own, as in "thigh_L", "AnkleL", "J_Bip_L" and
// "LHipJoint", or the first letter of the name.
bool IsWord(std::string_view name, std::size_t at) {
  const bool begins =
      at == 0 || !IsLetter(name[at - 1]) || (IsUpper(name[at]) && IsLower(name[at - 1]));
  const bool ends =
      at == 0 || at + 1 == name.size() || !IsLetter(name[at + 1]) || IsUpper(name[at + 1]);
  return begins && ends && name.size() > 1;
}

// Finds the words for left and right in a name.
std::vector<SideInName> SideWordsOf(std::string_view name) {
  std::vector<SideInName> sides;
  for (const auto& [left, right] : kSideWords) {
    for (const auto& [word, other] : {std::pair(left, right), std::pair(right, left)}) {
      for (std::size_t at = name.find(word); at != std::string_view::npos;
           at = name.find(word, at + 1)) {
        sides.push_back({at, word.size(), other});
      }
    }
  }
  return sides;
}

// Finds the single letters in a name that may stand for left or right.
std::vector<SideInName> SideLettersOf(std::string_view name) {
  constexpr std::string_view kLetters = "LRlr";
  constexpr std::string_view kOthers = "RLrl";
  std::vector<SideInName> sides;
  for (std::size_t at = 0; at < name.size(); ++at) {
    const std::size_t letter = kLetters.find(name[at]);
    if (letter == std::string_view::npos || !IsWord(name, at)) continue;
    sides.push_back({at, 1, kOthers.substr(letter, 1)});
  }
  return sides;
}

// Returns the joint whose name is `name` with one or all of its words for left and right exchanged.
// Returns -1 if there is none.
int JointOfOtherSide(const Skeleton& skeleton, std::string_view name,
                     std::vector<SideInName> sides) {
  for (const SideInName& side : sides) {
    const int joint =
        skeleton.FindJoint(std::string(name).replace(side.at, side.length, side.other));
    if (joint >= 0) return joint;
  }
  std::ranges::sort(sides, std::ranges::greater(), &SideInName::at);
  std::string other(name);
  for (const SideInName& side : sides) other.replace(side.at, side.length, side.other);
  return skeleton.FindJoint(other);
}

// Returns the partner of a joint according to its name. Returns the joint itself if the name
// contains no side, and -1 if there is no joint on the other side.
int PartnerByName(const Skeleton& skeleton, int joint) {
  const std::string& name = skeleton.joints[static_cast<std::size_t>(joint)].name;
  const std::vector<SideInName> words = SideWordsOf(name);
  std::vector<SideInName> letters = SideLettersOf(name);
  if (!words.empty()) {
    if (const int other = JointOfOtherSide(skeleton, name, words); other >= 0) return other;
    std::erase_if(letters, [&](const SideInName& letter) {
      return std::ranges::any_of(words, [&](const SideInName& word) {
        return letter.at >= word.at && letter.at < word.at + word.length;
      });
    });
    letters.insert(letters.end(), words.begin(), words.end());
    return JointOfOtherSide(skeleton, name, letters);
  }
  // A single letter stands for a side only if there is a joint for the other side. The R of "Root"
  // and "Ribs" does not.
  const int other = letters.empty() ? -1 : JointOfOtherSide(skeleton, name, letters);
  return other >= 0 ? other : joint;
}

std::optional<std::vector<int>> PairByName(const Skeleton& skeleton) {
  std::vector<int> partners;
  for (int j = 0; j < skeleton.joint_count(); ++j) {
    const int partner = PartnerByName(skeleton, j);
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
constexpr double kShapeShare = 0.08;  // Relative tolerance for the lengths of a mirrored pair.
constexpr double kShapeM = 0.01;      // Absolute tolerance, added to the relative one.
// Maximum distance between a bone and the mirror image of its partner, as a fraction of the longer
// one. For bones of equal length, the value allows an angle of 60 degrees.
constexpr double kDirectionShare = 1.0;

// Pairs joints by their bones in a pose; x = 0 is the plane of symmetry.
class ShapePairs {
 public:
  ShapePairs(const Skeleton& skeleton, ConstPoseSpan reference)
      : skeleton_(skeleton),
        bones_m_(skeleton.joints.size(), DVec3(0.0)),
        children_(skeleton.joints.size()),
        partners_(skeleton.joints.size()),
        costs_(skeleton.joints.size() * skeleton.joints.size(), -1.0) {
    std::vector<Vec3> positions(skeleton.joints.size());
    std::vector<Quat> rotations(skeleton.joints.size());
    ForwardKinematics(skeleton, reference, positions, rotations);
    for (std::size_t j = 1; j < skeleton.joints.size(); ++j) {
      const auto parent = static_cast<std::size_t>(skeleton.joints[j].parent);
      bones_m_[j] = DVec3(positions[j]) - DVec3(positions[parent]);
      children_[parent].push_back(static_cast<int>(j));
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
  // Returns the distance between the bone to `b` and the mirror image of the bone to `a`. Returns
  // kNoPair if the bones do not match.
  [[nodiscard]] double BoneCost(int a, int b) const {
    if (a == 0 || b == 0) return a == b ? 0.0 : kNoPair;
    const DVec3& u = bones_m_[Index(a)];
    const DVec3& v = bones_m_[Index(b)];
    const double longer = std::max(glm::length(u), glm::length(v));
    const double difference = longer - std::min(glm::length(u), glm::length(v));
    const double apart = glm::length(DVec3(-u.x, u.y, u.z) - v);
    const bool fits =
        difference <= kShapeShare * longer + kShapeM && apart <= kDirectionShare * longer + kShapeM;
    return fits ? apart : kNoPair;
  }

  // Pairs each child of `a` with the best matching child of `b` and returns the total cost. `a` may
  // equal `b`. Returns kNoPair if a child has no partner.
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

  // Returns the cost of pairing `a` with `b` and all joints below them. Costs are memoized.
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
  std::vector<DVec3> bones_m_;  // [joint]: bone from the parent, in world axes.
  std::vector<std::vector<int>> children_;
  std::vector<int> partners_;
  // [a][b]: cost of the pair; negative if it has not been computed yet.
  std::vector<double> costs_;
};

}  // namespace

std::optional<std::vector<int>> FindMirrorJoints(const Skeleton& skeleton,
                                                 ConstPoseSpan reference) {
  STRIDEWIRE_CHECK(reference.rotations.size() == skeleton.joints.size());
  if (auto partners = PairByName(skeleton)) return partners;
  return ShapePairs(skeleton, reference).Run();
}

}  // namespace stridewire
