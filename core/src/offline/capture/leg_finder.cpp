#include "offline/capture/leg_finder.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace stridewire {
namespace {

bool IsUpper(char c) { return c >= 'A' && c <= 'Z'; }
bool IsLower(char c) { return c >= 'a' && c <= 'z'; }

const Joint& At(const std::vector<Joint>& joints, int j) {
  return joints[static_cast<std::size_t>(j)];
}

// Splits a name into lower-case words: "mixamorig:LeftUpLeg" -> left, up, leg; "LHipJoint" -> l,
// hip, joint.
std::vector<std::string> Words(std::string_view name) {
  name.remove_prefix(name.find_last_of(":|") + 1);  // npos + 1 is 0
  std::vector<std::string> words;
  bool open = false;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const char c = name[i];
    if (!IsUpper(c) && !IsLower(c)) {
      open = false;
      continue;
    }
    const bool next_is_lower = i + 1 < name.size() && IsLower(name[i + 1]);
    const bool starts = IsUpper(c) && (i == 0 || IsLower(name[i - 1]) || next_is_lower);
    if (!open || starts) words.emplace_back();
    open = true;
    words.back() += IsUpper(c) ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return words;
}

LegPart PartOf(const std::string& word) {
  const auto has = [&](std::initializer_list<std::string_view> parts) {
    return std::any_of(parts.begin(), parts.end(),
                       [&](std::string_view part) { return word.find(part) != std::string::npos; });
  };
  // Ignores helper joints of rigs and tips.
  if (has({"ik", "pole", "target", "ctrl", "roll", "twist", "heel"})) return LegPart::kNone;
  if (has({"toe", "ball"})) return has({"end", "tip", "nub"}) ? LegPart::kNone : LegPart::kBall;
  if (has({"end", "tip", "nub", "index", "hand", "arm"})) return LegPart::kNone;
  if (has({"upleg", "upperleg", "legupper", "thigh", "femur"}) || word == "hip" || word == "uleg") {
    return LegPart::kHip;
  }
  if (has({"knee", "shin", "calf", "tibia", "lowleg", "lowerleg", "leglower"}) || word == "leg" ||
      word == "lleg") {
    return LegPart::kKnee;
  }
  if (has({"ankle"}) || word == "foot") return LegPart::kAnkle;
  return LegPart::kNone;
}

float Length(const std::vector<Joint>& joints, int j) {
  return glm::length(At(joints, j).offset_m);
}

int Depth(const std::vector<Joint>& joints, int j) {
  int depth = 0;
  for (; At(joints, j).parent >= 0; j = At(joints, j).parent) ++depth;
  return depth;
}

bool IsBelow(const std::vector<Joint>& joints, int j, int ancestor) {
  while (j > ancestor) j = At(joints, j).parent;
  return j == ancestor;
}

// Finds the toe joint below an ankle: the nearest joint with a matching name, or else the only
// child if its bone has a length. Joints are sorted parents first, so the first match is a nearest
// one.
int FindBall(const std::vector<Joint>& joints, int ankle) {
  int only = -1;
  int children = 0;
  for (int j = ankle + 1; j < static_cast<int>(joints.size()); ++j) {
    if (!IsBelow(joints, j, ankle)) continue;
    if (ReadLegName(At(joints, j).name).part == LegPart::kBall) return j;
    if (At(joints, j).parent == ankle) {
      ++children;
      only = j;
    }
  }
  if (children != 1 || !(Length(joints, only) > 0.0f)) return -1;
  const std::vector<std::string> words = Words(At(joints, only).name);
  const bool is_tip = std::any_of(words.begin(), words.end(), [](const std::string& word) {
    return word == "end" || word == "tip" || word == "nub";
  });
  return is_tip ? -1 : only;
}

}  // namespace

LegName ReadLegName(std::string_view name) {
  std::vector<std::string> words = Words(name);
  LegName result;
  const auto side_of = [](const std::string& word) {
    if (word == "left" || word == "l" || word == "lft") return Side::kLeft;
    if (word == "right" || word == "r" || word == "rgt" || word == "rt") return Side::kRight;
    return Side::kNone;
  };
  std::string rest;
  for (std::string& word : words) {
    if (const Side side = side_of(word); side != Side::kNone && result.side == Side::kNone) {
      result.side = side;
    } else if (word != "joint" && word != "jnt" && word != "bone" && word != "bip" &&
               word != "def") {
      rest += word;
    }
  }
  result.part = PartOf(rest);
  // Names such as "lfemur" or "leftfoot" begin with the side without a separator.
  if (result.side == Side::kNone) {
    for (const std::string_view prefix : {"left", "right", "l", "r"}) {
      if (!rest.starts_with(prefix)) continue;
      const LegPart part = PartOf(rest.substr(prefix.size()));
      if (part == LegPart::kNone) continue;
      result.side = prefix[0] == 'l' ? Side::kLeft : Side::kRight;
      result.part = part;
      break;
    }
  }
  if (result.side == Side::kNone) result.part = LegPart::kNone;
  return result;
}

bool FindLegAbove(const std::vector<Joint>& joints, int ankle, FoundLeg& leg) {
  leg = FoundLeg{};
  leg.ankle = ankle;
  const auto nearest_above = [&](int from, LegPart part) {
    for (int j = At(joints, from).parent; j > 0; j = At(joints, j).parent) {
      if (ReadLegName(At(joints, j).name).part == part) return j;
    }
    // Without a matching name, takes the next joint up that has a bone of non-zero length below it.
    int child = from;
    for (int j = At(joints, from).parent; j >= 0; child = j, j = At(joints, j).parent) {
      if (Length(joints, child) > 0.0f) return j;
    }
    return -1;
  };
  leg.knee = nearest_above(ankle, LegPart::kKnee);
  if (leg.knee <= 0) return false;
  leg.hip = nearest_above(leg.knee, LegPart::kHip);
  if (leg.hip <= 0) return false;
  leg.ball = FindBall(joints, ankle);
  return true;
}

bool FindLegsByName(const std::vector<Joint>& joints, FoundLegs& legs) {
  for (int side = 0; side < 2; ++side) {
    int best = -1;
    int best_depth = 0;
    FoundLeg found;
    for (int j = 0; j < static_cast<int>(joints.size()); ++j) {
      const LegName name = ReadLegName(At(joints, j).name);
      if (name.part != LegPart::kAnkle || name.side != (side == 0 ? Side::kLeft : Side::kRight)) {
        continue;
      }
      const int depth = Depth(joints, j);
      FoundLeg leg;
      if ((best < 0 || depth < best_depth) && FindLegAbove(joints, j, leg)) {
        best = j;
        best_depth = depth;
        found = leg;
      }
    }
    if (best < 0) return false;
    legs.legs[side] = found;
  }
  legs.sides_known = true;
  return legs.legs[0].hip != legs.legs[1].hip;
}

bool FindLegsByShape(const std::vector<Joint>& joints, FoundLegs& legs) {
  const int count = static_cast<int>(joints.size());
  // Longest chain of bones below each joint, without its own offset.
  std::vector<float> reach(joints.size(), 0.0f);
  std::vector<int> next(joints.size(), -1);
  for (int j = count - 1; j > 0; --j) {
    const auto parent = static_cast<std::size_t>(At(joints, j).parent);
    const float length = reach[static_cast<std::size_t>(j)] + Length(joints, j);
    if (next[parent] < 0 || length >= reach[parent]) {
      reach[parent] = length;
      next[parent] = j;
    }
  }
  const auto chain_below = [&](int j) {
    std::vector<int> chain;
    for (; j >= 0; j = next[static_cast<std::size_t>(j)]) chain.push_back(j);
    return chain;
  };
  int best[2] = {-1, -1};
  int best_depth = 0;
  float best_length = 0.0f;
  for (int a = 1; a < count; ++a) {
    const float length_a = reach[static_cast<std::size_t>(a)];
    for (int b = a + 1; b < count; ++b) {
      if (At(joints, a).parent != At(joints, b).parent) continue;
      const float length_b = reach[static_cast<std::size_t>(b)];
      if (!(length_a > 0.0f) || std::fabs(length_a - length_b) > 0.08f * length_a) continue;
      const std::size_t joints_a = chain_below(a).size();
      if (joints_a < 3 || joints_a != chain_below(b).size()) continue;
      const int depth = Depth(joints, a);
      if (best[0] < 0 || depth < best_depth || (depth == best_depth && length_a > best_length)) {
        best[0] = a;
        best[1] = b;
        best_depth = depth;
        best_length = length_a;
      }
    }
  }
  if (best[0] < 0) return false;
  for (int side = 0; side < 2; ++side) {
    const std::vector<int> chain = chain_below(best[side]);
    std::size_t knee = 1;
    float longest = -1.0f;
    for (std::size_t k = 1; k + 1 < chain.size(); ++k) {
      const float length = Length(joints, chain[k]) + Length(joints, chain[k + 1]);
      if (length > longest) {
        longest = length;
        knee = k;
      }
    }
    FoundLeg& leg = legs.legs[side];
    leg.hip = chain[knee - 1];
    leg.knee = chain[knee];
    leg.ankle = chain[knee + 1];
    leg.ball = knee + 2 < chain.size() ? chain[knee + 2] : -1;
  }
  legs.sides_known = false;
  return true;
}

}  // namespace stridewire
