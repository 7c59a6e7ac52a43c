#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "offline/build/error_map.h"
#include "offline/build/refine.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

// A figure that has not been drawn yet: a gnuplot script with its data. The same input gives the
// same text.
struct Figure {
  std::string file;  // Name of the SVG file.
  std::string caption;
  std::string script;
  int width = 1000;
  int height = 400;
};

// The parameters on the axes of a group's figures, by index. `y` is -1 for groups with one
// parameter.
struct FigureAxes {
  int x = 0;
  int y = -1;
};

// Returns the label of a parameter with its unit, for example "start_z, m".
[[nodiscard]] std::string AxisLabel(const Parameter& parameter);

// Returns the beginning of a group's file names, for example "0_step_left_".
[[nodiscard]] std::string FilePrefix(const MotionLibrary& library, int group_index);

// Both libraries must have the same groups. The maps must have been measured with MapOptions(axes).
struct ErrorFigureInput {
  const MotionLibrary& before;
  const MotionLibrary& after;
  int group_index = 0;
  FigureAxes axes;
  const ErrorMap& map_before;
  const ErrorMap& map_after;
};
[[nodiscard]] ErrorMapOptions MapOptions(const FigureAxes& axes);
// Maps the error over parameter space before and after refinement, in one colour scale (paper,
// Figure 1 left and middle).
[[nodiscard]] Figure ErrorFigure(const ErrorFigureInput& input);

// Plots the largest error against the number of pseudoexamples for both refinement rules (paper,
// Figure 1 right).
[[nodiscard]] Figure CurveFigure(const MotionLibrary& library, int group_index,
                                 const GroupRefinement& amended, const GroupRefinement& bare);

// Draws some examples as strips of poses, seen from the side (paper, Figure 3).
[[nodiscard]] Figure ExamplesFigure(const MotionLibrary& library, int group_index,
                                    const FigureAxes& axes);

// Plots the parameters of the examples: every parameter against the last one.
[[nodiscard]] Figure SitesFigure(const MotionLibrary& library, int group_index);

// Plots hip, knee and ankle angles over generic time: examples as thin lines, the movement at the
// centre of their parameters as a thick line.
[[nodiscard]] Figure JointFigure(const MotionLibrary& library, int group_index);

// Draws when feet leave the ground and land, with one row per example.
[[nodiscard]] Figure TimingFigure(const MotionLibrary& library, int group_index,
                                  const FigureAxes& axes);

// Draws a synthesized walk from the side and from above, with the requested landing positions of
// its steps (paper, Figure 4).
[[nodiscard]] Expected<Figure> WalkFigure(const std::shared_ptr<const MotionLibrary>& library,
                                          const std::string& name, const std::string& caption,
                                          std::span<const MovementRequest> requests);

// A sequence of requests for WalkFigure.
struct Walk {
  std::string name;
  std::string caption;
  std::vector<MovementRequest> requests;
};
// Returns walks that demonstrate a library, without those whose parameters it does not have.
[[nodiscard]] std::vector<Walk> DemonstrationWalks(const MotionLibrary& library);

}  // namespace stridewire
