#include "offline/capture/leg_names.h"

#include <algorithm>
#include <initializer_list>
#include <string>
#include <vector>

namespace stridewire {
namespace {

using Words = std::vector<std::string>;

bool IsUpper(char c) { return c >= 'A' && c <= 'Z'; }
bool IsLower(char c) { return c >= 'a' && c <= 'z'; }

bool IsOneOf(std::string_view word, std::initializer_list<std::string_view> words) {
  return std::ranges::find(words, word) != words.end();
}

// Splits a name into lower-case words: "mixamorig:LeftUpLeg" -> left, up, leg; "LHipJoint" -> l,
// hip, joint.
Words SplitWords(std::string_view name) {
  name.remove_prefix(name.find_last_of(":|") + 1);  // npos + 1 is 0
  Words words;
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

Side SideOf(std::string_view word) {
  if (IsOneOf(word, {"left", "l", "lft", "lt"})) return Side::kLeft;
  if (IsOneOf(word, {"right", "r", "rgt", "rt"})) return Side::kRight;
  return Side::kNone;
}

// Words that programs add to the names of ordinary joints.
bool IsFiller(std::string_view word) {
  return IsOneOf(word, {"joint", "jnt", "jt", "bone", "bn", "bind", "def", "skin", "fk"});
}

bool IsHelper(std::string_view word) {
  return IsOneOf(word, {"ik",    "pole",   "target", "ctrl", "control", "roll",    "heel",
                        "pivot", "helper", "end",    "tip",  "nub",     "site",    "effector",
                        "eff",   "leaf",   "mch",    "aim",  "null",    "locator", "corrective"}) ||
         word.find("twist") != std::string_view::npos || word.ends_with("roll");
}

bool IsOutsideLegs(std::string_view word) {
  return IsOneOf(word, {"arm",   "forearm",  "upperarm", "lowerarm", "hand",   "wrist",  "elbow",
                        "palm",  "shoulder", "clavicle", "collar",   "finger", "thumb",  "index",
                        "pinky", "wing",     "ear",      "eye",      "hair",   "tail",   "breast",
                        "skirt", "cloth",    "cape",     "coat",     "sleeve", "weapon", "prop"});
}

LegPart PartOf(std::string_view word) {
  if (IsOneOf(word, {"upleg", "upperleg", "legupper", "legup", "uleg", "thigh", "femur", "hip"})) {
    return LegPart::kHip;
  }
  if (IsOneOf(word, {"knee", "shin", "shank", "calf", "tibia", "lowleg", "lowerleg", "leglower",
                     "leglow", "leg", "lleg"})) {
    return LegPart::kKnee;
  }
  if (IsOneOf(word, {"ankle", "foot"})) return LegPart::kAnkle;
  if (IsOneOf(word, {"toe", "toes", "toebase", "toesbase", "ball", "forefoot"})) {
    return LegPart::kBall;
  }
  return LegPart::kNone;
}

// Maximum number of words in the name of a leg part, for example "upper leg".
constexpr std::size_t kMostWords = 2;

// Reads the leg part at the end of `words`. Longer names come first, because "up leg" ends with
// "leg" but is another part.
LegPart PartAtEnd(const Words& words) {
  for (std::size_t count = std::min(kMostWords, words.size()); count > 0; --count) {
    std::string joined;
    for (std::size_t i = words.size() - count; i < words.size(); ++i) joined += words[i];
    if (const LegPart part = PartOf(joined); part != LegPart::kNone) return part;
  }
  return LegPart::kNone;
}

bool AnyWord(std::string_view name, bool (*test)(std::string_view)) {
  return std::ranges::any_of(SplitWords(name), [&](const std::string& word) { return test(word); });
}

// Reads names without a separator between side and part: "lfemur", "leftfoot", "footright".
LegName ReadJoinedName(Words words) {
  if (words.empty()) return {};
  const std::string last = words.back();
  struct Affix {
    std::string_view text;
    Side side;
  };
  for (const auto& [text, side] : {Affix{"left", Side::kLeft}, Affix{"right", Side::kRight},
                                   Affix{"l", Side::kLeft}, Affix{"r", Side::kRight}}) {
    if (last.starts_with(text)) {
      const LegPart part = PartOf(std::string_view(last).substr(text.size()));
      if (part != LegPart::kNone) return {side, part};
    }
    if (text.size() > 1 && last.ends_with(text)) {
      words.back() = last.substr(0, last.size() - text.size());
      if (const LegPart part = PartAtEnd(words); part != LegPart::kNone) return {side, part};
    }
  }
  return {};
}

}  // namespace

LegName ReadLegName(std::string_view name) {
  Words rest;
  Side side = Side::kNone;
  for (std::string& word : SplitWords(name)) {
    if (IsHelper(word) || IsOutsideLegs(word)) return {};
    if (const Side found = SideOf(word); found != Side::kNone) {
      // If several words match a side, the last one decides, because prefixes may look like a side.
      side = found;
    } else if (!IsFiller(word)) {
      rest.push_back(std::move(word));
    }
  }
  if (side == Side::kNone) return ReadJoinedName(std::move(rest));
  const LegPart part = PartAtEnd(rest);
  return part == LegPart::kNone ? LegName{} : LegName{side, part};
}

Side ReadSide(std::string_view name) {
  Side side = Side::kNone;
  for (const std::string& word : SplitWords(name)) {
    if (const Side found = SideOf(word); found != Side::kNone) side = found;
  }
  return side;
}

bool IsHelperName(std::string_view name) { return AnyWord(name, IsHelper); }

bool IsNameOutsideLegs(std::string_view name) { return AnyWord(name, IsOutsideLegs); }

bool IsHandName(std::string_view name) {
  return AnyWord(name, [](std::string_view word) {
    return IsOneOf(word, {"hand", "lhand", "rhand", "wrist", "lwrist", "rwrist", "paw"});
  });
}

bool IsTrunkName(std::string_view name) {
  return AnyWord(name, [](std::string_view word) {
    return word.starts_with("spine") || word.ends_with("spine") ||
           IsOneOf(word, {"chest", "thorax", "torso", "abdomen", "neck", "head", "back",
                          "lowerback", "upperback"});
  });
}

}  // namespace stridewire
