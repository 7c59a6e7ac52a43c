#include "offline/capture/leg_chain.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "base/check.h"
#include "offline/capture/file_axis.h"
#include "offline/capture/leg_names.h"

namespace stridewire {
namespace {

constexpr double kRadPerDegree = std::numbers::pi / 180.0;
// A joint separates two segments of a chain if it bends the chain by more than a limit. The limit
// is this fraction of the chain's largest bend, clamped to the following range. Twist joints do not
// bend a chain, so they never separate segments.
constexpr double kBendShare = 0.3;
constexpr double kLeastBendRad = 2.0 * kRadPerDegree;
constexpr double kMostBendRad = 10.0 * kRadPerDegree;
// A segment longer than this fraction of the chain is assumed to contain both thigh and shin of a
// leg that stays straight.
constexpr double kLongestSegmentShare = 0.6;

LegPart PartOf(const FigureShape& figure, int j) {
  return ReadLegName(figure.joints[Index(j)].name).part;
}

bool IsHelper(const FigureShape& figure, int j) {
  return IsHelperName(figure.joints[Index(j)].name);
}

// The joints of a leg chain, one per position. Of coincident joints, the chain keeps the one whose
// name identifies a part of the leg, preferably the ankle. If no name does, it keeps the lowest
// joint that is not a helper.
class Chain {
 public:
  Chain(const FigureShape& figure, const std::vector<int>& joints) : figure_(figure) {
    double length = 0.0;
    for (std::size_t i = 1; i < joints.size(); ++i) length += BoneLength(joints[i]);
    for (const int j : joints) {
      if (!nodes_.empty() && BoneLength(j) <= 1e-6 * length) {
        int& kept = nodes_.back();
        const bool keeps = PartOf(figure, kept) != LegPart::kNone || IsHelper(figure, j);
        if (!keeps || PartOf(figure, j) == LegPart::kAnkle) kept = j;
        continue;
      }
      nodes_.push_back(j);
      starts_.push_back(nodes_.size() == 1 ? 0.0 : starts_.back() + BoneLength(j));
    }
    FindSegments();
  }

  [[nodiscard]] const std::vector<int>& nodes() const { return nodes_; }
  // Indices of the nodes that separate the segments, including the first and the last node.
  [[nodiscard]] const std::vector<std::size_t>& ends() const { return ends_; }

  // Returns the total length of the segments above and below end `k`.
  [[nodiscard]] double LengthAround(std::size_t k) const {
    return starts_[ends_[k + 1]] - starts_[ends_[k - 1]];
  }

 private:
  [[nodiscard]] double BoneLength(int j) const {
    return glm::length(DVec3(figure_.joints[Index(j)].offset_m));
  }

  // Returns the 95th percentile over all poses of the angle between the bones at node `i`.
  [[nodiscard]] double Bend(std::size_t i) const {
    std::vector<double> angles;
    const auto add = [&](const std::vector<DVec3>& pose) {
      const DVec3 above = pose[Index(nodes_[i])] - pose[Index(nodes_[i - 1])];
      const DVec3 below = pose[Index(nodes_[i + 1])] - pose[Index(nodes_[i])];
      angles.push_back(std::atan2(glm::length(glm::cross(above, below)), glm::dot(above, below)));
    };
    if (figure_.poses.empty()) add(figure_.rest);
    for (const std::vector<DVec3>& pose : figure_.poses) add(pose);
    const auto p95 =
        angles.begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(angles.size() - 1));
    std::ranges::nth_element(angles, p95);
    return *p95;
  }

  void FindSegments() {
    const std::size_t last = nodes_.size() - 1;
    std::vector<double> bends(nodes_.size(), 0.0);
    double largest = 0.0;
    for (std::size_t i = 1; i < last; ++i) {
      bends[i] = Bend(i);
      largest = std::max(largest, bends[i]);
    }
    const double least = std::clamp(kBendShare * largest, kLeastBendRad, kMostBendRad);
    ends_.push_back(0);
    for (std::size_t i = 1; i < last; ++i) {
      if (bends[i] > least) ends_.push_back(i);
    }
    if (last > 0) ends_.push_back(last);
    for (std::size_t k = 1; k < ends_.size(); ++k) {
      const std::size_t from = ends_[k - 1];
      const std::size_t to = ends_[k];
      if (to - from < 2) continue;
      if (starts_[to] - starts_[from] <= kLongestSegmentShare * starts_[last]) continue;
      // The knee of a leg that stays straight is near its middle.
      const double middle = 0.5 * (starts_[from] + starts_[to]);
      std::size_t knee = from + 1;
      for (std::size_t i = from + 2; i < to; ++i) {
        if (std::fabs(starts_[i] - middle) < std::fabs(starts_[knee] - middle)) knee = i;
      }
      ends_.insert(ends_.begin() + static_cast<std::ptrdiff_t>(k), knee);
      return;
    }
  }

  const FigureShape& figure_;
  std::vector<int> nodes_;
  std::vector<double> starts_;  // Distance of each node from the first one, along the chain.
  std::vector<std::size_t> ends_;
};

// Finds the toe joint below an ankle: the nearest joint with a matching name, or else the only
// child if its bone is not of zero length. Parents precede their children, so the first match is
// one of the nearest.
int FindBall(const std::vector<Joint>& joints, int ankle) {
  int only = -1;
  int children = 0;
  for (int j = ankle + 1; j < static_cast<int>(joints.size()); ++j) {
    int above = j;
    while (above > ankle) above = joints[Index(above)].parent;
    if (above != ankle) continue;
    if (ReadLegName(joints[Index(j)].name).part == LegPart::kBall) return j;
    if (joints[Index(j)].parent == ankle) {
      ++children;
      only = j;
    }
  }
  if (children != 1 || !(glm::length(joints[Index(only)].offset_m) > 0.0f)) return -1;
  return IsHelperName(joints[Index(only)].name) ? -1 : only;
}

}  // namespace

double ChainLength(const std::vector<Joint>& joints, int top, int joint) {
  double length = 0.0;
  for (int j = joint; j != top; j = joints[Index(j)].parent) {
    STRIDEWIRE_CHECK(j > top);
    length += glm::length(DVec3(joints[Index(j)].offset_m));
  }
  return length;
}

FoundLeg FindLegAboveAnkle(const FigureShape& figure, const std::vector<int>& joints) {
  STRIDEWIRE_CHECK(joints.size() >= 3);
  const int ankle = joints.back();
  FoundLeg leg{joints[0], joints[1], ankle, FindBall(figure.joints, ankle)};
  const Chain chain(figure, joints);
  const std::vector<int>& nodes = chain.nodes();
  if (nodes.size() < 3) return leg;  // With fewer nodes, no other joint can be the knee.
  const std::size_t last = nodes.size() - 1;
  const bool is_named = std::any_of(nodes.begin() + 1, nodes.end() - 1,
                                    [&](int j) { return PartOf(figure, j) == LegPart::kKnee; });
  const auto may_be_knee = [&](std::size_t i) {
    return is_named ? PartOf(figure, nodes[i]) == LegPart::kKnee : !IsHelper(figure, nodes[i]);
  };
  // Of several joints with a matching name, the knee is the one that bends the leg.
  std::size_t knee = 0;
  double longest = 0.0;
  for (std::size_t k = 1; k + 1 < chain.ends().size(); ++k) {
    if (!may_be_knee(chain.ends()[k]) || chain.LengthAround(k) <= longest) continue;
    knee = chain.ends()[k];
    longest = chain.LengthAround(k);
  }
  for (std::size_t i = 1; i < last && knee == 0; ++i) {
    if (may_be_knee(i)) knee = i;
  }
  if (knee == 0) knee = 1;
  // The thigh may consist of several collinear joints. Its upper end is the first of
  // these joints whose name belongs to the leg.
  std::size_t thigh = 0;
  for (const std::size_t end : chain.ends()) {
    if (end < knee) thigh = end;
  }
  std::size_t hip = thigh;
  bool has_name = false;
  for (std::size_t i = 0; i < knee; ++i) {
    const LegPart part = PartOf(figure, nodes[i]);
    const bool is_above_a_knee = part == LegPart::kKnee && i == thigh;
    if (part != LegPart::kHip && !is_above_a_knee) continue;
    if (!has_name || hip < thigh) hip = i;
    has_name = true;
  }
  leg.hip = nodes[hip];
  leg.knee = nodes[knee];
  STRIDEWIRE_CHECK(leg.hip < leg.knee && leg.knee < ankle);
  return leg;
}

FoundLeg FindLegInChain(const FigureShape& figure, const std::vector<int>& joints) {
  STRIDEWIRE_CHECK(joints.size() >= 3);
  const Chain chain(figure, joints);
  const std::vector<int>& nodes = chain.nodes();
  FoundLeg leg{joints[0], joints[1], joints[2], joints.size() > 3 ? joints[3] : -1};
  double longest = 0.0;
  for (std::size_t k = 1; k + 1 < chain.ends().size(); ++k) {
    if (chain.LengthAround(k) <= longest) continue;
    longest = chain.LengthAround(k);
    const std::size_t ankle = chain.ends()[k + 1];
    leg = {nodes[chain.ends()[k - 1]], nodes[chain.ends()[k]], nodes[ankle],
           ankle + 1 < nodes.size() ? nodes[ankle + 1] : -1};
  }
  STRIDEWIRE_CHECK(leg.hip < leg.knee && leg.knee < leg.ankle);
  return leg;
}

}  // namespace stridewire
