#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "figures.h"
#include "stridewire/base/error.h"
#include "offline/build/interpolation_error.h"
#include "offline/build/leave_one_out.h"
#include "offline/build/refine.h"

namespace stridewire {

struct ReportOptions {
  std::string name;               // of the library, as people know it
  std::vector<std::string> axes;  // none, or the names of the one or two parameters the maps show
  double max_error_m = 0.001;     // refinement, see RefineOptions
  int max_pseudoexamples = 16;
  // Every usable movement of some captures, none averaged: what realism is measured on. May be null.
  std::shared_ptr<const MotionLibrary> captured;
  // Told from time to time how much is done, 0 to 1; false ends it.
  std::function<bool(double)> progress;
};

struct ReportPicture {
  std::string file;
  std::string svg;
};

// What a report says, all of it in memory: nothing is written before everything is there.
struct Report {
  std::string html;
  std::vector<ReportPicture> pictures;
  Refinement refinement;                  // by the amended rule
  std::vector<InterpolationError> plain;  // of the groups without pseudoexamples
  std::vector<LeaveOneOut> realism;       // of the groups of `captured`
};

// The axes of a group's pictures: those named, as far as the group has them, else start_z and end_z, else
// its first ones.
[[nodiscard]] FigureAxes AxesOf(const MotionGroup& group, const std::vector<std::string>& names);

// Measures a library, refines it and draws the paper's figures of it. kOutOfRange: no group has such an
// axis; kUnsupported: no gnuplot, or "stopped".
[[nodiscard]] Expected<Report> MakeReport(const std::shared_ptr<const MotionLibrary>& library,
                                          const ReportOptions& options);

}  // namespace stridewire
