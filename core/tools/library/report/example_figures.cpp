#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "figures.h"
#include "gnuplot.h"
#include "offline/base/text.h"
#include "stick_figure.h"

namespace stridewire {
namespace {

constexpr std::size_t kMaxStrips = 6;
constexpr int kPosesPerExample = 6;
constexpr int kCurvePoints = 48;

// Returns the examples sorted by the sum of their parameters on the axes of the figure.
std::vector<int> InOrder(const MotionGroup& group, const FigureAxes& axes) {
  std::vector<int> order(static_cast<std::size_t>(group.example_count));
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](int e) {
    const std::span<const double> site = group.site(e);
    const auto value = [&](int l) {
      const auto at = static_cast<std::size_t>(l);
      // A step becomes longer as its start position moves further back.
      const bool is_start = group.parameters[at].name <= ParameterName::kStartZ;
      return (is_start ? -site[at] : site[at]) / group.parameters[at].scale;
    };
    return value(axes.x) + (axes.y < 0 ? 0.0 : value(axes.y));
  };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return key(a) < key(b); });
  return order;
}

std::string Values(const MotionGroup& group, int example) {
  std::string text;
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    text += Text("%s%.2f", l == 0 ? "" : ", ", group.site(example)[l]);
  }
  return text;
}

// Returns the angle at `at` by which the bones from-at and at-to deviate from a straight line, in
// degrees.
double Bend(const Vec3& from, const Vec3& at, const Vec3& to) {
  const Vec3 a = at - from;
  const Vec3 b = to - at;
  const double cosine = glm::dot(a, b) / std::max(1e-9f, glm::length(a) * glm::length(b));
  return std::acos(std::clamp(cosine, -1.0, 1.0)) * 180.0 / M_PI;
}

// Returns angles in degrees, left before right: hips (thigh against the vertical, forward
// positive), knees, and ankles (foot against shank).
std::array<double, 6> LegAngles(const Skeleton& skeleton, const std::vector<Vec3>& positions) {
  std::array<double, 6> angles{};
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const Leg& leg = skeleton.leg(foot);
    const Vec3& hip = positions[static_cast<std::size_t>(leg.hip)];
    const Vec3& knee = positions[static_cast<std::size_t>(leg.knee)];
    const Vec3& ankle = positions[static_cast<std::size_t>(leg.ankle)];
    const Vec3& ball = positions[static_cast<std::size_t>(leg.ball)];
    const auto side = static_cast<std::size_t>(foot);
    angles[side] = std::atan2(knee.z - hip.z, hip.y - knee.y) * 180.0 / M_PI;
    angles[2 + side] = Bend(hip, knee, ankle);
    angles[4 + side] = leg.ball == leg.ankle ? 0.0 : Bend(knee, ankle, ball);
  }
  return angles;
}

}  // namespace

std::string AxisLabel(const Parameter& parameter) {
  std::string text(ParameterText(parameter.name));
  const std::size_t unit = text.rfind('_');
  return text.substr(0, unit) + ", " + text.substr(unit + 1);
}

std::string FilePrefix(const MotionLibrary& library, int group_index) {
  return std::to_string(group_index) + "_" +
         std::string(MovementKindName(library.group(group_index).kind)) + "_";
}

Figure ExamplesFigure(const MotionLibrary& library, int group_index, const FigureAxes& axes) {
  const MotionGroup& group = library.group(group_index);
  const std::vector<int> order = InOrder(group, axes);
  const std::size_t shown = std::min(kMaxStrips, order.size());
  const std::size_t rows = (shown + 2) / 3;
  Figure figure{.file = FilePrefix(library, group_index) + "examples.svg",
                .caption =
                    "Examples as strips of poses, from the shortest to the longest (paper, "
                    "Figure 3), with their parameters. Left limbs are thick",
                .width = 1000,
                .height = static_cast<int>(300 * rows)};
  figure.script =
      "set multiplot layout " + std::to_string(rows) +
      ",3 margins 0.02,0.99,0.09,0.93 spacing 0.03,0.12\nunset key\nset border 1\n"
      "set xtics nomirror 0.5\nunset ytics\nset size ratio -1\nset yrange [-0.05:1.95]\n";
  MovementPlayer player(library, group_index);
  for (std::size_t i = 0; i < shown; ++i) {
    const int e = order[shown < 2 ? 0 : i * (order.size() - 1) / (shown - 1)];
    player.Start(group.site(e), false);
    StickFigure stick(library);
    double least = HUGE_VAL;
    double most = -HUGE_VAL;
    // Spreads the poses out if the figure does not move forward.
    const double end_z = player.At(player.movement().duration_s()).root_position_m.z;
    const double apart_m = std::max(0.0, 0.4 - std::fabs(end_z) / (kPosesPerExample - 1));
    for (int k = 0; k < kPosesPerExample; ++k) {
      const ConstPoseSpan pose =
          player.At(player.movement().duration_s() * k / (kPosesPerExample - 1));
      stick.Draw(pose, apart_m * k);
      for (const Vec3& position : stick.Place(pose)) {
        least = std::min(least, position.z + apart_m * k);
        most = std::max(most, position.z + apart_m * k);
      }
    }
    figure.script += stick.Blocks() + "set xrange [" + Number(least - 0.1) + ":" +
                     Number(most + 0.1) + "]\nset title " + Quoted(Values(group, e)) +
                     " noenhanced offset 0,-0.6\nplot " + StickFigure::PlotCommand() +
                     ", 0 lc rgb '#000000' lw 0.5\n";
  }
  figure.script += "unset multiplot\n";
  return figure;
}

Figure SitesFigure(const MotionLibrary& library, int group_index) {
  const MotionGroup& group = library.group(group_index);
  const int d = group.parameter_count();
  const int panels = std::max(1, d - 1);
  const int columns = std::min(3, panels);
  const int rows = (panels + columns - 1) / columns;
  Figure figure{.file = FilePrefix(library, group_index) + "sites.svg",
                .caption = "Parameters of the examples: every parameter against the last one",
                .width = 330 * columns + 10,
                .height = 300 * rows};
  if (d == 1) figure.caption = "Parameters of the examples";
  const auto block = [&](const char* name, int from, int to) {
    figure.script += std::string("$") + name + " << EOD\n";
    for (int s = from; s < to; ++s) {
      for (const double value : group.site(s)) figure.script += Number(value) + " ";
      figure.script += "0\n";
    }
    if (from == to) {
      for (int l = 0; l <= d; ++l) figure.script += "NaN ";
      figure.script += "\n";
    }
    figure.script += "EOD\n";
  };
  block("examples", 0, group.example_count);
  block("pseudo", group.example_count, group.site_count);
  figure.script +=
      "set multiplot layout " + std::to_string(rows) + "," + std::to_string(columns) +
      "\nunset key\nset border 3\nset tics nomirror font ',10'\nset offsets graph 0.06, graph "
      "0.06, graph 0.06, graph 0.06\n";
  if (d == 1) figure.script += "unset ytics\nset border 1\nset yrange [-1:1]\n";
  for (int l = 0; l < panels; ++l) {
    const auto at = static_cast<std::size_t>(l);
    figure.script += "set xlabel " + Quoted(AxisLabel(group.parameters[at])) + " noenhanced\n";
    // gnuplot cannot choose a range if all examples have the same value.
    const auto range = [](const Parameter& p) {
      return p.max - p.min > 1e-6 ? std::string("[*:*]\n")
                                  : "[" + Number(p.min - 0.1) + ":" + Number(p.max + 0.1) + "]\n";
    };
    figure.script += "set xrange " + range(group.parameters[at]);
    if (d > 1) figure.script += "set yrange " + range(group.parameters.back());
    if (d > 1) {
      figure.script += "set ylabel " + Quoted(AxisLabel(group.parameters.back())) + " noenhanced\n";
    }
    const std::string columns_used =
        " u " + std::to_string(l + 1) + ":" + std::to_string(d == 1 ? 2 : d);
    figure.script += "plot $examples" + columns_used +
                     " w p pt 7 ps 0.7 lc rgb '#0072b2' t 'examples', $pseudo" + columns_used +
                     " w p pt 4 ps 0.9 lc rgb '#d55e00' t 'pseudoexamples'\n";
  }
  figure.script += "unset multiplot\n";
  return figure;
}

Figure JointFigure(const MotionLibrary& library, int group_index) {
  const MotionGroup& group = library.group(group_index);
  Figure figure{.file = FilePrefix(library, group_index) + "joints.svg",
                .caption =
                    "Angles of hips, knees and ankles over generic time. Thin lines are examples, "
                    "the thick line is the movement at the centre of their parameters. Whole "
                    "numbers are keytimes",
                .width = 1000,
                .height = 480};
  const StickFigure stick(library);
  MovementPlayer player(library, group_index);
  const int intervals = group.interval_count();
  const auto add_curve = [&](std::string& block) {
    const Movement& movement = player.movement();
    for (int k = 0; k <= kCurvePoints; ++k) {
      const double g = static_cast<double>(intervals) * k / kCurvePoints;
      const int i = std::min(static_cast<int>(g), intervals - 1);
      const double time_s = movement.warp.keytime_s(i) +
                            (g - i) * (movement.warp.keytime_s(i + 1) - movement.warp.keytime_s(i));
      block += Number(g);
      for (const double angle : LegAngles(library.skeleton(), stick.Place(player.At(time_s)))) {
        block.append(" ").append(Number(std::round(10.0 * angle) / 10.0));
      }
      block += "\n";
    }
    block += "\n";
  };
  std::string examples;
  std::vector<double> middle(group.parameters.size());
  const int shown = std::min(group.example_count, 16);
  for (int i = 0; i < shown; ++i) {
    player.Start(group.site(i * group.example_count / shown), false);
    add_curve(examples);
  }
  for (int e = 0; e < group.example_count; ++e) {
    for (std::size_t l = 0; l < middle.size(); ++l) {
      middle[l] += group.site(e)[l] / group.example_count;
    }
  }
  player.Start(middle, true);
  std::string synthesized;
  add_curve(synthesized);
  figure.script = "$examples << EOD\n" + examples + "EOD\n$middle << EOD\n" + synthesized +
                  "EOD\nset multiplot layout 2,3\nunset key\nset border 3\nset tics nomirror\n"
                  "set xtics 1\nset grid x lc rgb '#bbbbbb'\n";
  constexpr std::array kTitles = {"left hip",  "left knee",  "left ankle",
                                  "right hip", "right knee", "right ankle"};
  constexpr std::array kColumns = {2, 4, 6, 3, 5, 7};
  for (std::size_t i = 0; i < kTitles.size(); ++i) {
    const std::string column = std::to_string(kColumns[i]);
    figure.script += std::string("set title '") + kTitles[i] +
                     ", degrees'\nplot $examples u 1:" + column +
                     " w l lw 0.5 lc rgb '#888888', $middle u 1:" + column +
                     " w l lw 2.5 lc rgb '" + (i < 3 ? kLeftColour : kRightColour) + "'\n";
  }
  figure.script += "unset multiplot\n";
  return figure;
}

Figure TimingFigure(const MotionLibrary& library, int group_index, const FigureAxes& axes) {
  const MotionGroup& group = library.group(group_index);
  const bool is_step = IsStep(group.kind);
  Figure figure{.file = FilePrefix(library, group_index) + "timing.svg",
                .caption = is_step ? "Contact timing, one row per example. Between toe-off and "
                                     "heel-strike (thick) the moving foot is off the ground"
                                   : "Timing, one row per example. Marks are keytimes (lowest "
                                     "point, toe-off, landing, lowest point); the flight is thick",
                .width = 800,
                .height = 140 + 9 * group.example_count};
  const auto keys = static_cast<std::size_t>(group.interval_count() + 1);
  // Jumps have an additional keytime between start and toe-off: the lowest point of the crouch.
  const std::size_t off = is_step || keys < 6 ? 1 : 2;
  int row = 0;
  std::string whole = "$whole << EOD\n";
  std::string flight = "$flight << EOD\n";
  std::string marks = "$marks << EOD\n";
  for (const int e : InOrder(group, axes)) {
    const std::span<const double> k =
        group.keytimes_s.subspan(static_cast<std::size_t>(e) * keys, keys);
    ++row;
    whole += "0 " + std::to_string(row) + " " + Number(k[keys - 1]) + " 0\n";
    flight +=
        Number(k[off]) + " " + std::to_string(row) + " " + Number(k[off + 1] - k[off]) + " 0\n";
    for (std::size_t i = 1; i + 1 < keys; ++i) {
      marks += Number(k[i]) + " " + std::to_string(row) + "\n";
    }
  }
  figure.script = whole + "EOD\n" + flight + "EOD\n" + marks + "EOD\n";
  figure.script +=
      "unset key\nset border 1\nset xtics nomirror\nunset ytics\nset xlabel 's'\n"
      "set ylabel 'short to long'\nset yrange [0:" +
      std::to_string(row + 1) +
      "]\nset xrange [0:*]\nplot $whole w vectors nohead lw 1 lc rgb '#555555', "
      "$flight w vectors nohead lw 5 lc rgb '#0072b2', $marks w p pt 2 ps 0.5 lc rgb "
      "'#000000'\n";
  return figure;
}

}  // namespace stridewire
