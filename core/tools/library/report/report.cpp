#include "report.h"

#include <algorithm>
#include <cmath>

#include "gnuplot.h"
#include "html.h"
#include "offline/base/text.h"
#include "overview.h"

namespace stridewire {
namespace {

// Estimated fractions of the work that are done after refinement, and after planning the figures.
constexpr double kRefined = 0.6;
constexpr double kPlanned = 0.7;

std::string Mm(double m) { return Text("%.2f", 1000.0 * m); }

std::string ParameterList(const MotionGroup& group) {
  std::string text;
  for (const Parameter& parameter : group.parameters) {
    text += (text.empty() ? "" : ", ") + std::string(ParameterText(parameter.name)) + " " +
            Text("%.2f", parameter.min) + " to " + Text("%.2f", parameter.max);
  }
  return text;
}

// Returns tables of the groups and of the errors of their movements.
std::string GroupTables(const Report& report) {
  HtmlTable rows = {{"Group", "Kind", "Examples", "Parameters"}};
  HtmlTable errors = {{"Group", "Kind", "Uncorrected, mm", "Mean, mm", "Corrected, mm",
                       "Iterations", "Sum |w|", "Condition"}};
  HtmlTable refined_errors = {
      {"Group", "Kind", "Pseudoexamples", "Largest error, mm", "Mean, mm", "At them, mm"}};
  const auto groups = report.refinement.library->groups();
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const MotionGroup& group = groups[g];
    const GroupRefinement& refined = report.refinement.groups[g];
    const InterpolationError& plain = report.plain[g];
    const std::string kind(MovementKindName(group.kind));
    rows.push_back(
        {std::to_string(g), kind, std::to_string(group.example_count), ParameterList(group)});
    errors.push_back({std::to_string(g), kind, Mm(refined.before.max_error_m),
                      Mm(refined.before.mean_error_m), Text("%.4f", 1000.0 * plain.corrected_max_m),
                      std::to_string(plain.iterations), Text("%.2f", refined.after.weight_sum_max),
                      Text("%.1f", refined.after.condition)});
    refined_errors.push_back({std::to_string(g), kind,
                              std::to_string(group.site_count - group.example_count),
                              Mm(refined.after.max_error_m), Mm(refined.after.mean_error_m),
                              Text("%.5f", 1000.0 * refined.pseudoexample_error_m)});
  }
  return TableHtml(rows) +
         "<h3>Errors of movements</h3>\n<p>How far the parameters of synthesized movements are "
         "from "
         "the requested ones, over the hull of the examples. Avatars play corrected movements; the "
         "last columns say how many iterations that takes and how extreme the weights "
         "become.</p>\n" +
         TableHtml(errors) +
         "<h3>Errors after refinement</h3>\n<p>The same without correction, after refinement has "
         "added pseudoexamples as in the paper.</p>\n" +
         TableHtml(refined_errors);
}

std::string Cm(double m) { return Text("%.2f", 100.0 * m); }

// Compares synthesized with captured movements.
Section RealismSection(const MotionLibrary& captured, const std::vector<LeaveOneOut>& realism) {
  HtmlTable rows = {{"Group", "Parameters", "Movements", "Method", "Joints, cm", "Trunk", "Head",
                     "Arms", "Legs", "Planted, cm", "Foot, cm", "Keytimes, ms", "Parameters, cm",
                     "Cardinal is nearer"}};
  for (std::size_t g = 0; g < realism.size(); ++g) {
    const MotionGroup& group = captured.groups()[g];
    const LeaveOneOut& left_out = realism[g];
    if (left_out.movements == 0) continue;
    for (std::size_t m = 0; m < left_out.means.size(); ++m) {
      const LeftOutMean& mean = left_out.means[m];
      std::string method(BlendMethodName(static_cast<BlendMethod>(m)));
      std::replace(method.begin(), method.end(), '_', ' ');
      const double gain = 1.0 - left_out.means[0].pose_m / mean.pose_m;
      std::vector<std::string> row = {
          m == 0 ? std::to_string(g) + " " + std::string(MovementKindName(group.kind)) : "",
          m == 0 ? std::to_string(group.parameter_count()) : "",
          m == 0 ? std::to_string(left_out.movements) : "", method, Cm(mean.pose_m)};
      for (const double part_m : mean.part_m) row.push_back(Cm(part_m));
      row.push_back(mean.planted_m > 0.0 ? Cm(mean.planted_m) : "");
      row.push_back(Cm(mean.foot_m));
      row.push_back(Text("%.0f", 1000.0 * mean.keytime_s));
      row.push_back(Cm(mean.parameter_m));
      row.push_back(m == 0 ? ""
                           : Text("%.0f %%", 100.0 * gain) + " on average, for " +
                                 Text("%.0f %%", 100.0 * left_out.wins[m]) + " of movements");
      rows.push_back(std::move(row));
    }
  }
  return {
      "realism", "Realism",
      "<p>Leave-one-out test: each captured movement is synthesized from all "
      "others with its own parameters and compared with the capture by the mean distance of "
      "joints at equal generic times. Parameters outside the hull of the others are moved to "
      "its edge. The column \"Planted\" contains the same distance for steps as avatars display "
      "them, with both feet on the footprints of the captured step. The other methods are the "
      "nearest captured movement without changes, and the "
      "nearest d + 1 blended by inverse distance, as in blend spaces.</p>\n" +
          TableHtml(rows)};
}

bool IsMirrored(const MotionGroup& group) {
  return std::all_of(group.mirrored.begin(), group.mirrored.end(),
                     [](std::uint8_t mirrored) { return mirrored != 0; });
}

// Returns false if a map would be empty, because there is a single example or because the slice
// hardly intersects the hull.
bool IsMap(const ErrorMap& map) {
  const auto spans = [](const std::vector<double>& axis) {
    return axis.size() == 1 || axis.back() - axis.front() > 1e-6;
  };
  const auto inside = std::count_if(map.error_m.begin(), map.error_m.end(),
                                    [](double error_m) { return !std::isnan(error_m); });
  return spans(map.x) && spans(map.y) && inside > 8;
}

// A section with figures that have not been drawn yet.
struct Part {
  std::string id;
  std::string heading;
  std::string text;
  std::vector<Figure> figures;
};

}  // namespace

FigureAxes AxesOf(const MotionGroup& group, const std::vector<std::string>& names) {
  std::vector<int> found;
  const auto take = [&](int l) {
    if (l >= 0 && std::find(found.begin(), found.end(), l) == found.end()) found.push_back(l);
  };
  for (const std::string& name : names) {
    for (int l = 0; l < group.parameter_count(); ++l) {
      if (ParameterText(group.parameters[static_cast<std::size_t>(l)].name) == name) take(l);
    }
  }
  take(group.FindParameter(ParameterName::kStartZ));
  take(group.FindParameter(ParameterName::kEndZ));
  for (int l = 0; l < group.parameter_count(); ++l) take(l);
  return {.x = found[0], .y = found.size() > 1 ? found[1] : -1};
}

Expected<Report> MakeReport(const std::shared_ptr<const MotionLibrary>& library,
                            const ReportOptions& options) {
  for (const std::string& axis : options.axes) {
    const bool is_known = std::any_of(
        library->groups().begin(), library->groups().end(), [&](const MotionGroup& group) {
          return std::any_of(group.parameters.begin(), group.parameters.end(),
                             [&](const Parameter& p) { return ParameterText(p.name) == axis; });
        });
    if (!is_known) {
      return Fail(ErrorCode::kOutOfRange, "no group of this library has this parameter",
                  "--axes: " + axis);
    }
  }
  const auto report_progress = [&](double done) {
    return !options.progress || options.progress(done);
  };
  // Draws an empty figure first, to fail early if gnuplot is not installed.
  if (auto drawn = DrawSvg("plot 0 notitle\n", 10, 10); !drawn)
    return std::unexpected(drawn.error());

  Report report;
  RefineOptions refine = {.max_error_m = options.max_error_m,
                          .max_pseudoexamples = options.max_pseudoexamples};
  refine.progress = [&](double done) { return report_progress(kRefined * done); };
  auto amended = Refine(library, refine);
  if (!amended) return std::unexpected(amended.error());
  refine.progress = nullptr;
  refine.rule = RefineRule::kBare;
  const auto bare = Refine(library, refine);
  if (!bare) return std::unexpected(bare.error());
  // Measures the library without its pseudoexamples.
  refine.max_pseudoexamples = 0;
  refine.samples = 1;
  const auto plain = Refine(library, refine);
  if (!plain) return std::unexpected(plain.error());
  report.refinement = *std::move(amended);

  std::vector<Part> parts;
  for (int g = 0; g < static_cast<int>(library->groups().size()); ++g) {
    if (!report_progress(kRefined + (kPlanned - kRefined) * g /
                                        static_cast<double>(library->groups().size()))) {
      return Fail(ErrorCode::kUnsupported, "stopped");
    }
    report.plain.push_back(MeasureInterpolationError(*plain->library, g));
    const MotionGroup& group = library->group(g);
    Part part{"group-" + std::to_string(g),
              "Group " + std::to_string(g) + ": " + std::string(MovementKindName(group.kind)),
              std::to_string(group.example_count) + " examples; " + ParameterList(group) + ".",
              {}};
    if (group.kind == MovementKind::kStepRight && IsMirrored(group)) {
      part.text += " All of them are mirror images of left steps; see the left group.";
    } else {
      const FigureAxes axes = AxesOf(group, options.axes);
      const auto index = static_cast<std::size_t>(g);
      const auto before = MeasureErrorMap(*plain->library, g, MapOptions(axes));
      if (!before) return std::unexpected(before.error());
      const auto after = MeasureErrorMap(*report.refinement.library, g, MapOptions(axes));
      if (!after) return std::unexpected(after.error());
      // A point of the map may be on a narrow peak that the samples missed.
      GroupRefinement& refined = report.refinement.groups[index];
      refined.before.max_error_m = std::max(refined.before.max_error_m, before->max_error_m);
      refined.after.max_error_m = std::max(refined.after.max_error_m, after->max_error_m);
      if (IsMap(*before)) {
        part.figures = {
            ErrorFigure({*plain->library, *report.refinement.library, g, axes, *before, *after}),
            CurveFigure(*library, g, refined, bare->groups[index])};
      }
      part.figures.push_back(ExamplesFigure(*library, g, axes));
      part.figures.push_back(SitesFigure(*report.refinement.library, g));
      part.figures.push_back(JointFigure(*library, g));
      part.figures.push_back(TimingFigure(*library, g, axes));
    }
    parts.push_back(std::move(part));
  }
  Part walks{"walks",
             "Walks",
             "Synthesized from the library with run-time correction and planted feet.",
             {}};
  for (const Walk& walk : DemonstrationWalks(*library)) {
    auto figure = WalkFigure(library, walk.name, walk.caption, walk.requests);
    if (figure) {
      walks.figures.push_back(*std::move(figure));
    } else {  // The library does not contain a movement that this walk needs.
      walks.text += " Not possible: " + walk.name + " (" + Describe(figure.error()) + ").";
    }
  }
  if (!walks.figures.empty()) parts.insert(parts.begin(), std::move(walks));

  report.summary = Summarize(*library);
  report.self_check = CheckLibrary(library);
  std::vector<Section> sections = {
      SummarySection(report.summary),
      SelfCheckSection(report.self_check),
      {"groups", "Groups of examples",
       "<p>" + std::to_string(library->skeleton().joint_count()) + " joints, " +
           std::to_string(library->bytes().size()) + " bytes, hash " + EscapeHtml(library->hash()) +
           ".</p>\n" + GroupTables(report)}};
  if (options.captured != nullptr) {
    for (int g = 0; g < static_cast<int>(options.captured->groups().size()); ++g) {
      report.realism.push_back(MeasureLeaveOneOut(*options.captured, g));
    }
    sections.push_back(RealismSection(*options.captured, report.realism));
  }
  std::size_t count = 0;
  for (const Part& part : parts) count += part.figures.size();
  for (const Part& part : parts) {
    Section section{part.id, part.heading, "<p>" + EscapeHtml(part.text) + "</p>\n"};
    for (const Figure& figure : part.figures) {
      const double drawn = static_cast<double>(report.pictures.size()) / static_cast<double>(count);
      if (!report_progress(kPlanned + (1.0 - kPlanned) * drawn)) {
        return Fail(ErrorCode::kUnsupported, "stopped");
      }
      auto svg = DrawSvg(figure.script, figure.width, figure.height);
      if (!svg) {
        Error error = svg.error();
        error.where = figure.file + ": " + error.where;
        return std::unexpected(error);
      }
      section.html += PictureHtml(*svg, figure.caption, figure.file);
      report.pictures.push_back({figure.file, *std::move(svg)});
    }
    sections.push_back(std::move(section));
  }
  sections.push_back(TermsSection());
  std::string body = VerdictHtml(report.self_check, report.summary) + ContentsHtml(sections);
  for (const Section& section : sections) body += SectionHtml(section);
  report.html = PageHtml("Stridewire library report: " + options.name, body);
  return report;
}

}  // namespace stridewire
