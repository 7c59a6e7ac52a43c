#include "corpus/draw_rig.h"

#include <utility>

#include "corpus/draw.h"
#include "corpus/rig_names.h"

namespace stridewire::test {
namespace {

struct Unit {
  double m;
  const char* name;
};
constexpr Unit kUnits[] = {{1.0, "m"},    {0.01, "cm"},     {0.01, "cm"},
                           {0.001, "mm"}, {0.0254, "inch"}, {0.0254 / 0.45, "CMU unit"}};

struct Orientation {
  const char* name;
  DQuat turn;
};

// Returns the rotation of the world from +Y up to the axes of the file.
Orientation DrawOrientation(Random& random) {
  const double quarter = 90.0 * kDegree;
  const Orientation up[] = {
      {"y up", AboutX(0.0)},          {"y up", AboutX(0.0)},      {"y up", AboutX(0.0)},
      {"z up", AboutX(quarter)},      {"z up", AboutX(quarter)},  {"-z up", AboutX(-quarter)},
      {"-y up", AboutX(2 * quarter)}, {"x up", AboutZ(-quarter)}, {"-x up", AboutZ(quarter)}};
  Orientation drawn = up[Below(random, std::size(up))];
  // Most rigs face the same direction. Some are turned about the up axis.
  if (Chance(random, 0.3)) drawn.turn = drawn.turn * AboutY(quarter * Below(random, 4));
  return drawn;
}

void DrawExtraJoints(bool is_anonymous, Random& random, Rig& rig, std::string& text) {
  // Legs without names can be found only by their shape, so their joints stay as they are.
  if (!is_anonymous && Chance(random, 0.2)) {
    const bool inside = Chance(random, 0.6);
    AddTwistJoints(inside ? TwistPlace::kInside : TwistPlace::kBeside, rig);
    text += inside ? "; twist joints inside the legs" : "; twist joints beside the legs";
  }
  if (!is_anonymous && Chance(random, 0.2)) {
    const bool with_end_site = Chance(random, 0.8);
    RemoveToes(with_end_site, rig);
    text += with_end_site ? "; no toes" : "; no toes, no End Site";
  }
  if (Chance(random, 0.3)) {
    AddFingers(rig);
    text += "; fingers";
  }
  if (!is_anonymous && Chance(random, 0.1)) {
    AddPropInHand(rig);
    text += "; a sword in the hand";
  }
}

void DrawRoots(bool rest_must_stand, Random& random, Rig& rig, std::string& text) {
  if (!Chance(random, 0.35)) return;
  static constexpr std::pair<Roots, const char*> kRoots[] = {
      {Roots::kStatic, "; static root"},
      {Roots::kRotated, "; rotated root"},
      {Roots::kTrajectory, "; trajectory root"},
      {Roots::kSplit, "; motion split over three roots"}};
  const auto& [roots, name] = kRoots[Below(random, std::size(kRoots))];
  if (rest_must_stand && roots == Roots::kRotated) return;
  AddRoots(roots, rig);
  text += name;
}

void DrawFrames(Random& random, Rig& rig, std::string& text) {
  if (!Chance(random, 0.35)) return;
  static constexpr std::pair<Frames, const char*> kFrames[] = {
      {Frames::kLegsDown, "; leg frames turned by 180 degrees"},
      {Frames::kLegsAside, "; leg frames turned by 90 degrees"},
      {Frames::kAlongBones, "; frames along bones"},
      {Frames::kQuarters, "; frames turned by quarters"},
      {Frames::kRandom, "; random frames"}};
  const auto& [frames, name] = kFrames[Below(random, std::size(kFrames))];
  ReFrame(frames, random, rig);
  text += name;
}

}  // namespace

std::string DrawRig(Movement movement, Random& random, Rig& rig) {
  std::string text;
  const NameStyle& style =
      NameStyles()[static_cast<std::size_t>(Below(random, NameStyles().size()))];
  text += std::string("; names of ") + style.label;
  DrawExtraJoints(style.is_anonymous(), random, rig, text);
  if (Chance(random, 0.15) && rig.frame_count() > 20) {
    AddNoise(random.Draw(0.1, 0.4) * kDegree, random, rig);
    text += "; noise";
  }
  if (movement == Movement::kWalk && Chance(random, 0.05)) {
    FlipForearm(rig.frame_count() / 2, rig);
    text += "; a forearm flips";
  }
  if (Chance(random, 0.2)) {
    Translate(DVec3(random.Draw(-40, 40), random.Draw(-0.2, 0.2), random.Draw(-40, 40)), rig);
    text += "; far from the origin";
  }
  // If the figure never stands, only a rest pose that stands shows which way is up.
  const bool rest_must_stand = movement == Movement::kSit || movement == Movement::kLie ||
                               movement == Movement::kCrawl || movement == Movement::kHang;
  DrawRoots(rest_must_stand, random, rig, text);
  if (movement == Movement::kWalk && Chance(random, 0.12)) {
    InsertRestFrames(1, rig);
    text += "; rest pose in frame 0";
  }
  if (!rest_must_stand && !style.is_anonymous()) DrawFrames(random, rig, text);
  const Orientation orientation = DrawOrientation(random);
  TurnWorld(orientation.turn, rig);
  const Unit& unit = kUnits[Below(random, std::size(kUnits))];
  Scale(1.0 / unit.m, rig);
  text += Text("; %s; %s", orientation.name, unit.name);
  NameJoints(style, rig);
  if (Chance(random, 0.05)) {
    AddSecondRoot(rig);
    text += "; a second ROOT";
  }
  return text;
}

DrawnNotation DrawNotation(Random& random, int frame_count) {
  DrawnNotation drawn;
  BvhNotation& notation = drawn.notation;
  std::string& text = drawn.description;
  const auto shuffle = [&](std::array<int, 3>& order) {
    for (std::size_t i = 2; i > 0; --i) {
      std::swap(order[i], order[static_cast<std::size_t>(Below(random, i + 1))]);
    }
  };
  if (Chance(random, 0.7)) shuffle(notation.rotation_order);
  if (Chance(random, 0.2)) shuffle(notation.position_order);
  notation.rotations_first = Chance(random, 0.1);
  notation.positions_everywhere = Chance(random, 0.25);
  text += "; channels ";
  for (const int axis : notation.rotation_order) text += "xyz"[axis];
  if (notation.positions_everywhere) text += ", positions everywhere";
  if (Chance(random, 0.08)) {
    notation.scales = true;
    text += ", scales";
  }
  if (Chance(random, 0.3)) notation.line_end = "\r\n";
  if (Chance(random, 0.2)) notation.separator = "\t";
  if (Chance(random, 0.3)) notation.indent = "\t";
  notation.last_line_end = !Chance(random, 0.2);
  notation.byte_order_mark = Chance(random, 0.05);
  if (Chance(random, 0.07)) {
    notation.numbers_per_line = 5 + Below(random, 30);
    text += "; wrapped rows";
  }
  if (Chance(random, 0.07)) {
    notation.decimal_comma = true;
    text += "; decimal commas";
  }
  if (Chance(random, 0.07)) {
    notation.comment = "# exported by a program";
    text += "; comment";
  }
  notation.frame_time_digits = 5 + Below(random, 4);
  if (Chance(random, 0.15)) {
    const std::string counts[] = {"0", std::to_string(frame_count + 7),
                                  std::to_string(frame_count) + ".0"};
    notation.frames_text = counts[Below(random, std::size(counts))];
    text += "; Frames: " + notation.frames_text + " for " + std::to_string(frame_count) + " rows";
  }
  return drawn;
}

}  // namespace stridewire::test
