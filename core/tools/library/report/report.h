#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "figures.h"
#include "offline/build/interpolation_error.h"
#include "offline/build/leave_one_out.h"
#include "offline/build/refine.h"
#include "offline/inspect/library_summary.h"
#include "offline/inspect/self_check.h"
#include "stridewire/base/error.h"

namespace stridewire {

struct ReportOptions {
  std::string name;               // Name of the library, for the title.
  std::vector<std::string> axes;  // Names of at most two parameters for the axes; may be empty.
  double max_error_m = 0.001;     // See RefineOptions.
  int max_pseudoexamples = 16;
  // All usable movements of some captures without averaging, to measure realism. May be null.
  std::shared_ptr<const MotionLibrary> captured;
  // Called repeatedly with the fraction of the work that is done, in [0, 1]. Return false to stop.
  std::function<bool(double)> progress;
};

struct ReportPicture {
  std::string file;
  std::string svg;
};

// A complete report in memory. Files are written only after all figures have been drawn.
struct Report {
  std::string html;
  std::vector<ReportPicture> pictures;
  LibrarySummary summary;
  SelfCheck self_check;
  Refinement refinement;                  // Result of refinement with the amended rule.
  std::vector<InterpolationError> plain;  // [group]: errors without pseudoexamples.
  // [group of ReportOptions::captured]: differences between synthesized and captured movements.
  std::vector<LeaveOneOut> realism;
};

// Chooses the axes of a group's figures: the named parameters if the group has them, then start_z
// and end_z, then its first parameters.
[[nodiscard]] FigureAxes AxesOf(const MotionGroup& group, const std::vector<std::string>& names);

// Measures and refines a library and draws the figures of the paper for it. Errors: kOutOfRange if
// no group has a parameter named in `axes`; kUnsupported if gnuplot is not installed or `progress`
// returned false; kIo if gnuplot fails.
[[nodiscard]] Expected<Report> MakeReport(const std::shared_ptr<const MotionLibrary>& library,
                                          const ReportOptions& options);

}  // namespace stridewire
