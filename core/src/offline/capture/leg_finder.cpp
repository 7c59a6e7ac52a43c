#include "offline/capture/leg_finder.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "base/check.h"
#include "offline/capture/file_axis.h"
#include "offline/capture/leg_chain.h"
#include "offline/capture/leg_names.h"

namespace stridewire {
namespace {

// The lengths of a pair of limbs differ by at most this fraction.
constexpr double kPairTolerance = 0.08;
// The ends of the legs may be above the lowest point of the figure, by at most this fraction of the
// leg length.
constexpr double kFloorShare = 0.15;
// Legs point down if the vectors from the hips to the ends of the legs have a mean downward
// component of at least this fraction of the leg length.
constexpr double kPointsDownShare = 0.3;
// Minimum length of a limb that counts as a third leg, as a fraction of the leg length.
constexpr double kOtherLegShare = 0.5;
// A figure stands if its legs extend downward by at least this fraction of the leg length.
constexpr double kStandsShare = 0.8;
// A trunk is horizontal if its height difference is less than this fraction of its length.
constexpr double kHorizontalShare = 0.5;
// Fraction of the sampled poses that counts as most of them.
constexpr double kMostPoses = 0.9;

using Pose = std::vector<DVec3>;

// The poses from which directions are determined: those of the motion, or else the rest pose.
std::span<const Pose> PosesOf(const FigureShape& figure) {
  return figure.poses.empty() ? std::span(&figure.rest, 1) : std::span(figure.poses);
}

bool IsBelow(const std::vector<Joint>& joints, int j, int ancestor) {
  while (j > ancestor) j = joints[Index(j)].parent;
  return j == ancestor;
}

int Depth(const std::vector<Joint>& joints, int j) {
  int depth = 0;
  for (; joints[Index(j)].parent >= 0; j = joints[Index(j)].parent) ++depth;
  return depth;
}

// Two chains that start at children of the same joint.
struct LimbPair {
  std::vector<int> chains[2];  // Joints of the two chains, from the first to the last.
  double length = 0.0;
  int depth = 0;
};

std::vector<LimbPair> FindLimbPairs(const FigureShape& figure) {
  const std::vector<Joint>& joints = figure.joints;
  const int count = static_cast<int>(joints.size());
  // Length of the longest chain of bones below each joint, without the joint's own offset.
  std::vector<double> reach(joints.size(), 0.0);
  std::vector<int> next(joints.size(), -1);
  for (int j = count - 1; j > 0; --j) {
    if (joints[Index(j)].parent < 0) continue;
    const std::size_t parent = Index(joints[Index(j)].parent);
    const double length = reach[Index(j)] + glm::length(DVec3(joints[Index(j)].offset_m));
    if (next[parent] < 0 || length >= reach[parent]) {
      reach[parent] = length;
      next[parent] = j;
    }
  }
  const auto chain_below = [&](int j) {
    std::vector<int> chain;
    for (; j >= 0; j = next[Index(j)]) chain.push_back(j);
    return chain;
  };
  std::vector<LimbPair> pairs;
  for (int a = 1; a < count; ++a) {
    if (!(reach[Index(a)] > 0.0) || joints[Index(a)].parent < 0) continue;
    for (int b = a + 1; b < count; ++b) {
      if (joints[Index(a)].parent != joints[Index(b)].parent) continue;
      if (std::fabs(reach[Index(a)] - reach[Index(b)]) > kPairTolerance * reach[Index(a)]) continue;
      LimbPair pair;
      pair.chains[0] = chain_below(a);
      pair.chains[1] = chain_below(b);
      if (pair.chains[0].size() < 3 || pair.chains[0].size() != pair.chains[1].size()) continue;
      pair.length = reach[Index(a)];
      pair.depth = Depth(joints, a);
      pairs.push_back(std::move(pair));
    }
  }
  return pairs;
}

bool HasNameOutsideLegs(const FigureShape& figure, const LimbPair& pair) {
  for (const std::vector<int>& chain : pair.chains) {
    for (const int j : chain) {
      if (IsNameOutsideLegs(figure.joints[Index(j)].name)) return true;
    }
  }
  return false;
}

// Returns the lowest height of the joints of a chain. `up` is the up direction.
double LowestOf(const Pose& pose, const std::vector<int>& chain, const DVec3& up) {
  double lowest = INFINITY;
  for (const int j : chain) lowest = std::min(lowest, glm::dot(pose[Index(j)], up));
  return lowest;
}

// Returns the axis from the ends of the legs up to the hips. Returns nullopt if the legs do not
// carry the body: they do not point down, or in most poses other joints are lower than their ends.
std::optional<DVec3> CarryingDirection(const FigureShape& figure, std::span<const Pose> poses,
                                       const LimbPair& pair) {
  DVec3 sum(0.0);
  for (const Pose& pose : poses) {
    for (const std::vector<int>& chain : pair.chains) {
      sum += pose[Index(chain.front())] - pose[Index(chain.back())];
    }
  }
  const DVec3 up = AxisVector(NearestAxis(sum));
  const double most = 2.0 * pair.length * static_cast<double>(poses.size());
  if (!(glm::dot(sum, up) >= kPointsDownShare * most)) return std::nullopt;
  std::size_t carried = 0;
  for (const Pose& pose : poses) {
    double others = INFINITY;
    for (std::size_t j = 0; j < pose.size(); ++j) {
      const int joint = static_cast<int>(j);
      if (IsBelow(figure.joints, joint, pair.chains[0].front()) ||
          IsBelow(figure.joints, joint, pair.chains[1].front())) {
        continue;
      }
      others = std::min(others, glm::dot(pose[j], up));
    }
    const double ends =
        std::min(LowestOf(pose, pair.chains[0], up), LowestOf(pose, pair.chains[1], up));
    carried += ends <= others + kFloorShare * pair.length;
  }
  if (2 * carried < poses.size()) return std::nullopt;
  return up;
}

// Returns true if the ends of `other` are as low as those of `legs`. Compares them in the rest pose
// if the figure stands in it, and otherwise in most poses of the motion.
bool ReachesTheGround(const FigureShape& figure, const LimbPair& legs, const LimbPair& other,
                      const DVec3& up) {
  const auto reaches = [&](const Pose& pose) {
    const double floor =
        std::max(LowestOf(pose, legs.chains[0], up), LowestOf(pose, legs.chains[1], up));
    const double ends =
        std::max(LowestOf(pose, other.chains[0], up), LowestOf(pose, other.chains[1], up));
    return ends <= floor + kFloorShare * legs.length;
  };
  DVec3 rest_legs(0.0);
  for (const std::vector<int>& chain : legs.chains) {
    rest_legs += figure.rest[Index(chain.front())] - figure.rest[Index(chain.back())];
  }
  if (glm::dot(rest_legs, up) >= kStandsShare * 2.0 * legs.length || figure.poses.empty()) {
    return reaches(figure.rest);
  }
  const auto count = std::ranges::count_if(figure.poses, reaches);
  return static_cast<double>(count) >= kMostPoses * static_cast<double>(figure.poses.size());
}

bool IsDisjoint(const FigureShape& figure, const LimbPair& a, const LimbPair& b) {
  for (const std::vector<int>& chain : a.chains) {
    for (const std::vector<int>& other : b.chains) {
      if (IsBelow(figure.joints, chain.front(), other.front()) ||
          IsBelow(figure.joints, other.front(), chain.front())) {
        return false;
      }
    }
  }
  return true;
}

constexpr const char* kManyLegsText =
    "the figure has more than two legs; only figures that walk on two legs are supported. If it "
    "has two, name both ankle joints with options";

Expected<FoundLegs> FindLegsByShape(const FigureShape& figure) {
  const std::vector<LimbPair> pairs = FindLimbPairs(figure);
  const LimbPair* best = nullptr;
  DVec3 up(0.0);
  for (const LimbPair& pair : pairs) {
    if (best != nullptr &&
        (pair.depth > best->depth || (pair.depth == best->depth && pair.length <= best->length))) {
      continue;
    }
    if (HasNameOutsideLegs(figure, pair)) continue;
    std::optional<DVec3> direction = CarryingDirection(figure, PosesOf(figure), pair);
    // If the legs do not carry the figure in the motion, for example because it hangs by its arms,
    // the rest pose determines the direction.
    if (!direction) direction = CarryingDirection(figure, std::span(&figure.rest, 1), pair);
    if (!direction) continue;
    best = &pair;
    up = *direction;
  }
  if (best == nullptr) {
    return Fail(ErrorCode::kUnsupported,
                "no pair of legs was found; name both ankle joints with options");
  }
  for (const LimbPair& pair : pairs) {
    if (IsDisjoint(figure, *best, pair) && pair.length >= kOtherLegShare * best->length &&
        ReachesTheGround(figure, *best, pair, up)) {
      return Fail(ErrorCode::kUnsupported, kManyLegsText);
    }
  }
  FoundLegs legs;
  legs.by_shape = true;
  legs.root = figure.joints[Index(best->chains[0].front())].parent;
  // Votes of the joint names: +1 if a name identifies the first chain as the left one, -1 if it
  // contradicts this.
  int votes = 0;
  for (int side = 0; side < 2; ++side) {
    legs.legs[side] = FindLegInChain(figure, best->chains[side]);
    for (const int j : best->chains[side]) {
      const Side named = ReadSide(figure.joints[Index(j)].name);
      if (named != Side::kNone) votes += (named == Side::kLeft) == (side == 0) ? 1 : -1;
    }
  }
  legs.sides_known = votes != 0;
  if (votes < 0) std::swap(legs.legs[0], legs.legs[1]);
  return legs;
}

std::vector<int> NamedAnkles(const FigureShape& figure, Side side) {
  std::vector<int> ankles;
  for (int j = 0; j < static_cast<int>(figure.joints.size()); ++j) {
    const LegName name = ReadLegName(figure.joints[Index(j)].name);
    if (name.part == LegPart::kAnkle && name.side == side) ankles.push_back(j);
  }
  return ankles;
}

// Returns true if the name of a joint above `ankle` identifies a thigh or shin.
bool HasNamedLeg(const FigureShape& figure, int ankle) {
  for (int j = figure.joints[Index(ankle)].parent; j >= 0; j = figure.joints[Index(j)].parent) {
    const LegPart part = ReadLegName(figure.joints[Index(j)].name).part;
    if (part == LegPart::kKnee || part == LegPart::kHip) return true;
  }
  return false;
}

bool FindLegsByName(const FigureShape& figure, FoundLegs& legs) {
  int best_depth = 0;
  bool found = false;
  for (const int left : NamedAnkles(figure, Side::kLeft)) {
    for (const int right : NamedAnkles(figure, Side::kRight)) {
      const int depth = Depth(figure.joints, left) + Depth(figure.joints, right);
      if (found && depth >= best_depth) continue;
      FoundLegs candidate;
      if (!FindLegsAbove(figure, {left, right}, candidate)) continue;
      legs = candidate;
      best_depth = depth;
      found = true;
    }
  }
  return found;
}

// Returns true if joint names identify a further leg that is not at the same place as one of
// `legs`. Rigs may contain copies of a leg, which do not count.
bool HasFurtherNamedLeg(const FigureShape& figure, const FoundLegs& legs) {
  const Pose& pose = PosesOf(figure).front();
  for (const Side side : {Side::kLeft, Side::kRight}) {
    const FoundLeg& leg = legs.legs[side == Side::kLeft ? 0 : 1];
    const double length = ChainLength(figure.joints, leg.hip, leg.ankle);
    for (const int ankle : NamedAnkles(figure, side)) {
      if (IsBelow(figure.joints, ankle, leg.hip) || !HasNamedLeg(figure, ankle)) continue;
      int top = ankle;  // The uppermost thigh or shin joint of this leg.
      for (int j = ankle; j >= 0; j = figure.joints[Index(j)].parent) {
        const LegPart part = ReadLegName(figure.joints[Index(j)].name).part;
        if (part == LegPart::kKnee || part == LegPart::kHip) top = j;
      }
      if (IsBelow(figure.joints, leg.hip, top)) continue;
      const double apart = glm::distance(pose[Index(ankle)], pose[Index(leg.ankle)]);
      if (apart > kFloorShare * length &&
          ChainLength(figure.joints, top, ankle) >= kOtherLegShare * length) {
        return true;
      }
    }
  }
  return false;
}

// Returns true if the hands are on the ground like the feet and the trunk is horizontal. Checks the
// rest pose if the figure stands in it, and otherwise most poses of the motion. In rigs whose bones
// are all parallel at rest, the figure does not stand in the rest pose, because trunk and legs
// point down.
bool StandsOnHands(const FigureShape& figure, const FoundLegs& legs) {
  int hands[2] = {-1, -1};
  for (int j = 0; j < static_cast<int>(figure.joints.size()); ++j) {
    const std::string& name = figure.joints[Index(j)].name;
    if (!IsHandName(name) || IsHelperName(name)) continue;
    const Side side = ReadSide(name);
    if (side == Side::kNone) continue;
    int& hand = hands[side == Side::kLeft ? 0 : 1];
    if (hand < 0) hand = j;
  }
  if (hands[0] < 0 || hands[1] < 0) return false;
  double length = 0.0;  // Sum of the lengths of both legs.
  for (const FoundLeg& leg : legs.legs) length += ChainLength(figure.joints, leg.hip, leg.ankle);
  const auto legs_up = [&](const Pose& pose) {
    DVec3 sum(0.0);
    for (const FoundLeg& leg : legs.legs) sum += pose[Index(leg.hip)] - pose[Index(leg.ankle)];
    return sum;
  };
  // Returns the vector along the trunk: from the root to the joints at which the arms begin, or to
  // the neck if the arms branch off above it.
  const auto trunk_of = [&](const Pose& pose) {
    DVec3 trunk(0.0);
    for (const int hand : hands) {
      int top = hand;
      for (int j = figure.joints[Index(hand)].parent; j >= 0; j = figure.joints[Index(j)].parent) {
        if (IsNameOutsideLegs(figure.joints[Index(j)].name)) top = j;
      }
      trunk += 0.5 * (pose[Index(top)] - pose[Index(legs.root)]);
    }
    return trunk;
  };
  const auto on_hands = [&](const Pose& pose, const DVec3& up) {
    double lowest_foot = INFINITY;
    double highest_hand = -INFINITY;
    double lowest_hip = INFINITY;
    for (int side = 0; side < 2; ++side) {
      const FoundLeg& leg = legs.legs[side];
      lowest_foot = std::min(lowest_foot, glm::dot(pose[Index(leg.ankle)], up));
      lowest_hip = std::min(lowest_hip, glm::dot(pose[Index(leg.hip)], up));
      highest_hand = std::max(highest_hand, glm::dot(pose[Index(hands[side])], up));
    }
    const DVec3 trunk = trunk_of(pose);
    return highest_hand <= lowest_foot + 0.5 * kFloorShare * length &&
           std::fabs(glm::dot(trunk, up)) < kHorizontalShare * glm::length(trunk) &&
           lowest_hip > lowest_foot;
  };
  const DVec3 rest_up = legs_up(figure.rest);
  const DVec3 rest_axis = AxisVector(NearestAxis(rest_up));
  const DVec3 rest_trunk = trunk_of(figure.rest);
  const bool rest_stands =
      glm::dot(rest_up, rest_axis) >= kStandsShare * length &&
      glm::dot(rest_trunk, rest_axis) > -kHorizontalShare * glm::length(rest_trunk);
  if (rest_stands || figure.poses.empty()) return rest_stands && on_hands(figure.rest, rest_axis);
  DVec3 sum(0.0);
  for (const Pose& pose : figure.poses) sum += legs_up(pose);
  const DVec3 up = AxisVector(NearestAxis(sum));
  const auto count =
      std::ranges::count_if(figure.poses, [&](const Pose& pose) { return on_hands(pose, up); });
  return static_cast<double>(count) >= kMostPoses * static_cast<double>(figure.poses.size());
}

}  // namespace

FigureShape RestShape(std::vector<Joint> joints) {
  FigureShape figure;
  figure.joints = std::move(joints);
  for (const Joint& joint : figure.joints) {
    const DVec3 parent = joint.parent < 0 ? DVec3(0.0) : figure.rest[Index(joint.parent)];
    figure.rest.push_back(parent + DVec3(joint.offset_m));
  }
  return figure;
}

bool FindLegsAbove(const FigureShape& figure, const int (&ankles)[2], FoundLegs& legs, int* side) {
  const std::vector<Joint>& joints = figure.joints;
  legs = FoundLegs{};
  int root = ankles[0];
  while (root >= 0 && !IsBelow(joints, ankles[1], root)) root = joints[Index(root)].parent;
  if (side != nullptr) *side = 1;
  if (root < 0 || root == ankles[0] || root == ankles[1]) return false;
  legs.root = root;
  for (int s = 0; s < 2; ++s) {
    if (side != nullptr) *side = s;
    std::vector<int> chain;
    for (int j = ankles[s]; j != root; j = joints[Index(j)].parent) chain.push_back(j);
    std::ranges::reverse(chain);
    if (chain.size() < 3) return false;
    legs.legs[s] = FindLegAboveAnkle(figure, chain);
  }
  return true;
}

Expected<FoundLegs> FindLegs(const FigureShape& figure) {
  FoundLegs legs;
  if (FindLegsByName(figure, legs)) {
    if (HasFurtherNamedLeg(figure, legs)) return Fail(ErrorCode::kUnsupported, kManyLegsText);
    if (StandsOnHands(figure, legs)) {
      return Fail(ErrorCode::kUnsupported,
                  "the figure stands on hands and feet with a horizontal trunk; only figures that "
                  "walk on two legs are supported");
    }
    return legs;
  }
  Expected<FoundLegs> by_shape = FindLegsByShape(figure);
  const auto has_leg = [&](Side side) {
    return std::ranges::any_of(figure.joints, [&](const Joint& joint) {
      const LegName name = ReadLegName(joint.name);
      return name.side == side && name.part != LegPart::kBall;
    });
  };
  const bool has_left = has_leg(Side::kLeft);
  const bool has_right = has_leg(Side::kRight);
  const bool is_named = by_shape && std::ranges::any_of(by_shape->legs, [&](const FoundLeg& leg) {
                          return HasNamedLeg(figure, leg.ankle);
                        });
  if (has_right && !has_left && !is_named) {
    return Fail(ErrorCode::kUnsupported,
                "the figure has a right leg, but no left leg; export both legs, or name both ankle "
                "joints with options");
  }
  if (has_left && !has_right && !is_named) {
    return Fail(ErrorCode::kUnsupported,
                "the figure has a left leg, but no right leg; export both legs, or name both ankle "
                "joints with options");
  }
  return by_shape;
}

}  // namespace stridewire
