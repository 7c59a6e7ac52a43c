#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "stridewire/base/error.h"
#include "offline/build/error_map.h"
#include "offline/build/refine.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

// A picture still to be drawn: a gnuplot script with its data, the same text every time.
struct Figure {
  std::string file;  // name of its SVG
  std::string caption;
  std::string script;
  int width = 1000;
  int height = 400;
};

// Parameters a picture of a group shows; `y` is -1 in groups of one.
struct FigureAxes {
  int x = 0;
  int y = -1;
};

// "start_z" in metres: "start_z, m".
[[nodiscard]] std::string AxisLabel(const Parameter& parameter);

// "0_step_left_": what a group's files begin with.
[[nodiscard]] std::string FilePrefix(const MotionLibrary& library, int group_index);

// The error over parameter space, before and after refinement in one scale (paper, Figure 1 left and
// middle). Both libraries have the same groups; the maps are theirs, along `axes`.
[[nodiscard]] ErrorMapOptions MapOptions(const FigureAxes& axes);
[[nodiscard]] Figure ErrorFigure(const MotionLibrary& before, const MotionLibrary& after,
                                 int group_index, const FigureAxes& axes,
                                 const ErrorMap& map_before, const ErrorMap& map_after);

// The largest error against the number of pseudoexamples, by both rules (paper, Figure 1 right).
[[nodiscard]] Figure CurveFigure(const MotionLibrary& library, int group_index,
                                 const GroupRefinement& amended, const GroupRefinement& bare);

// Some examples as strips of poses seen from the side (paper, Figure 3).
[[nodiscard]] Figure ExamplesFigure(const MotionLibrary& library, int group_index,
                                    const FigureAxes& axes);

// Where the examples lie: every parameter against another one.
[[nodiscard]] Figure SitesFigure(const MotionLibrary& library, int group_index);

// Hips, knees and ankles over generic time: examples thin, the movement in their middle thick.
[[nodiscard]] Figure JointFigure(const MotionLibrary& library, int group_index);

// When feet leave the ground and land, an example a row.
[[nodiscard]] Figure TimingFigure(const MotionLibrary& library, int group_index,
                                  const FigureAxes& axes);

// A synthesized walk: a strip from the side over the slabs its steps were asked to land on, and from
// above (paper, Figure 4).
[[nodiscard]] Expected<Figure> WalkFigure(const std::shared_ptr<const MotionLibrary>& library,
                                          const std::string& name, const std::string& caption,
                                          std::span<const MovementRequest> requests);

// Walks that show what a library can do, those it has no parameters for left out.
struct Walk {
  std::string name;
  std::string caption;
  std::vector<MovementRequest> requests;
};
[[nodiscard]] std::vector<Walk> ShownWalks(const MotionLibrary& library);

}  // namespace stridewire
