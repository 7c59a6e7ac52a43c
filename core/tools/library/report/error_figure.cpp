#include <algorithm>
#include <array>
#include <cmath>

#include "figures.h"
#include "gnuplot.h"
#include "offline/base/text.h"
#include "offline/build/error_map.h"

namespace stridewire {
namespace {

// The colour map Cividis: lightness increases evenly, and the hues remain distinct for colour-blind
// readers.
constexpr const char* kPalette =
    "set palette defined (0 '#00224e', 0.25 '#414d6b', 0.5 '#7c7b78', 0.75 '#bcae6c', "
    "1 '#fee838')\n";

std::string MapBlock(const std::string& name, const ErrorMap& map) {
  std::string block = "$" + name + " << EOD\n";
  for (std::size_t r = 0; r < map.y.size(); ++r) {
    for (std::size_t c = 0; c < map.x.size(); ++c) {
      const double error_m = map.error_m[r * map.x.size() + c];
      block += Number(map.x[c]) + " " + Number(map.y[r]) + " " + Number(1000.0 * error_m) + "\n";
    }
    block += "\n";
  }
  return block + "EOD\n";
}

// Returns gnuplot data blocks with the examples and pseudoexamples, projected on the axes of the
// figure.
std::string SiteBlocks(const MotionGroup& group, const FigureAxes& axes,
                       const std::string& suffix) {
  std::array<std::string, 2> blocks;
  for (int s = 0; s < group.site_count; ++s) {
    const std::span<const double> site = group.site(s);
    blocks[s < group.example_count ? 0 : 1] +=
        Number(site[static_cast<std::size_t>(axes.x)]) + " " +
        Number(axes.y < 0 ? 0.0 : site[static_cast<std::size_t>(axes.y)]) + "\n";
  }
  // gnuplot rejects an empty data block.
  if (blocks[1].empty()) blocks[1] = "NaN NaN\n";
  return "$examples_" + suffix + " << EOD\n" + blocks[0] + "EOD\n$pseudo_" + suffix + " << EOD\n" +
         blocks[1] + "EOD\n";
}

std::string HeldAt(const MotionGroup& group, const FigureAxes& axes, const ErrorMap& map) {
  std::string text;
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    if (static_cast<int>(l) == axes.x || static_cast<int>(l) == axes.y) continue;
    text += (text.empty() ? "; fixed: " : ", ") +
            std::string(ParameterText(group.parameters[l].name)) + Text(" %.2f", map.others[l]);
  }
  return text;
}

Figure LineFigure(const ErrorFigureInput& input) {
  const FigureAxes& axes = input.axes;
  const MotionGroup& group = input.after.group(input.group_index);
  Figure figure{.file = FilePrefix(input.after, input.group_index) + "error.svg", .height = 360};
  figure.script = MapBlock("before", input.map_before) + MapBlock("after", input.map_after) +
                  SiteBlocks(group, axes, "after");
  figure.script += "set xlabel " +
                   Quoted(AxisLabel(group.parameters[static_cast<std::size_t>(axes.x)])) +
                   " noenhanced\nset ylabel 'error, mm'\nset border 3\nset tics nomirror\nset "
                   "yrange [0:0.01<*]\n"
                   "plot $before u 1:3 w l lw 2 dt 2 lc rgb '#d55e00' t 'before', "
                   "$after u 1:3 w l lw 2 lc rgb '#0072b2' t 'after', "
                   "$examples_after u 1:2 w p pt 7 ps 0.8 lc rgb '#000000' t 'examples', "
                   "$pseudo_after u 1:2 w p pt 4 ps 1 lc rgb '#000000' t 'pseudoexamples'\n";
  return figure;
}

}  // namespace

ErrorMapOptions MapOptions(const FigureAxes& axes) {
  return {.axis_x = axes.x, .axis_y = axes.y, .columns = axes.y < 0 ? 201 : 61, .rows = 61};
}

Figure ErrorFigure(const ErrorFigureInput& input) {
  const auto& [before, after, group_index, axes, map_before, map_after] = input;
  const MotionGroup& group = after.group(group_index);
  Figure figure;
  if (axes.y < 0) {
    figure = LineFigure(input);
  } else {
    figure = {.file = FilePrefix(after, group_index) + "error.svg", .width = 1000, .height = 480};
    const double top_mm = 1000.0 * std::max({map_before.max_error_m, map_after.max_error_m, 1e-6});
    const Parameter& x = group.parameters[static_cast<std::size_t>(axes.x)];
    const Parameter& y = group.parameters[static_cast<std::size_t>(axes.y)];
    figure.script = MapBlock("before", map_before) + MapBlock("after", map_after) +
                    SiteBlocks(before.group(group_index), axes, "before") +
                    SiteBlocks(group, axes, "after") + kPalette;
    // Contour lines keep the figure readable without colour.
    figure.script += "set contour base\nunset surface\nset cntrparam levels incremental 0," +
                     Number(top_mm / 8.0) + "," + Number(top_mm) +
                     "\nset table $lines_before\nsplot $before u 1:2:3\nset table $lines_after\n"
                     "splot $after u 1:2:3\nunset table\n";
    const auto range = [](const Parameter& p) {
      const double margin = 0.05 * (p.max - p.min);
      return std::string("[")
          .append(Number(p.min - margin))
          .append(":")
          .append(Number(p.max + margin))
          .append("]");
    };
    figure.script += "set xrange " + range(x) + "\nset yrange " + range(y) + "\nset xlabel " +
                     Quoted(AxisLabel(x)) + " noenhanced\nset ylabel " + Quoted(AxisLabel(y)) +
                     " noenhanced\nset cbrange [0:" + Number(top_mm) +
                     "]\nset cblabel 'error, mm'\nset tics out nomirror\nset key below\n"
                     "set multiplot layout 1,2\n";
    for (const char* name : {"before", "after"}) {
      const double max_m = name[0] == 'b' ? map_before.max_error_m : map_after.max_error_m;
      figure.script +=
          "set title " +
          Quoted(std::string(name) + " refinement: at most " + Text("%.2f mm", 1000.0 * max_m)) +
          "\n";
      const std::string n = name;
      figure.script += "plot $" + n + " u 1:2:3 w image notitle, $lines_" + n +
                       " w l lw 0.7 lc rgb '#ffffff' notitle, $examples_" + n +
                       " w p pt 7 ps 0.7 lc rgb '#000000' t 'examples', $examples_" + n +
                       " w p pt 6 ps 0.7 lc rgb '#ffffff' notitle, $pseudo_" + n +
                       " w p pt 5 ps 0.9 lc rgb '#ffffff' notitle, $pseudo_" + n +
                       " w p pt 4 ps 0.9 lc rgb '#d00000' t 'pseudoexamples'\n";
    }
    figure.script += "unset multiplot\n";
  }
  figure.caption =
      "Error of synthesized movements before and after refinement, over the hull of the examples "
      "(paper, Figure 1 left and middle)" +
      HeldAt(group, axes, map_before);
  return figure;
}

Figure CurveFigure(const MotionLibrary& library, int group_index, const GroupRefinement& amended,
                   const GroupRefinement& bare) {
  Figure figure{.file = FilePrefix(library, group_index) + "pseudoexamples.svg",
                .caption =
                    "Largest error against the number of pseudoexamples (paper, Figure 1 right), "
                    "for the amended rule and for the rule of the paper, under which an "
                    "additional pseudoexample may increase the error",
                .width = 700,
                .height = 360};
  const auto block = [&](const char* name, const std::vector<double>& curve) {
    figure.script += std::string("$") + name + " << EOD\n";
    for (std::size_t i = 0; i < curve.size(); ++i) {
      figure.script += std::to_string(i) + " " + Number(1000.0 * curve[i]) + "\n";
    }
    figure.script += "EOD\n";
  };
  block("amended", amended.max_error_curve_m);
  block("bare", bare.max_error_curve_m);
  figure.script +=
      "set xlabel 'pseudoexamples'\nset ylabel 'largest error, mm'\nset border 3\n"
      "set tics nomirror\nset xtics 2\nset yrange [0:*]\nset xrange [-0.3:*]\n"
      "plot $bare w lp dt 2 lw 1.5 pt 4 lc rgb '#d55e00' t 'rule from the paper', "
      "$amended w lp lw 2 pt 7 lc rgb '#0072b2' t 'amended'\n";
  return figure;
}

}  // namespace stridewire
