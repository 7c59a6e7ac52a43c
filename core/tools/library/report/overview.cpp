#include "overview.h"

#include <algorithm>

#include "html.h"
#include "offline/base/text.h"

namespace stridewire {
namespace {

struct Term {
  const char* name;
  const char* meaning;
};
constexpr Term kTerms[] = {
    {"Example", "One captured or generated movement in the library."},
    {"Group",
     "All examples of one kind of movement with the same parameters. Movements are blended "
     "from the examples of one group."},
    {"Parameters",
     "The numbers that describe an example. start_x_m, start_y_m and start_z_m are the position of "
     "the moving foot relative to the other foot in the first pose: to the left, up and forward, "
     "in metres. end_x_m, end_y_m and end_z_m are the same in the last pose. turn_rad is the "
     "change of heading to the left. Jumps have a length and a height."},
    {"Hull", "The region of parameters between the examples of a group."},
    {"Error",
     "The largest difference between the requested parameters of a movement and those "
     "measured on it. A radian counts as 0.5 m."},
    {"Correction",
     "When a movement starts, its weights are changed until it has the parameters "
     "that were requested."},
    {"Weights", "The shares of the examples in a movement. They sum to 1 and may be negative."},
    {"Sum |w|",
     "The largest sum of the absolute weights. Values above 2.5 exaggerate differences "
     "between examples."},
    {"Condition",
     "The condition number of the equations for the weights. Values above 1000 mean "
     "that examples are too similar."},
    {"Cardinal", "The method of this library: weights from cardinal basis functions."},
    {"Pseudoexample",
     "Parameters with known weights, for which the library stores no motion. "
     "Refinement adds them where the error is largest."},
    {"Keytimes", "The times of the events of a movement: start, toe-off, heel-strike and end."},
    {"Generic time",
     "Time counted in intervals between keytimes, so that equal phases of "
     "different examples coincide."},
    {"Captured, mirrored, generated",
     "Where an example comes from: a recording, the mirror image of a recording, or formulas."},
    {"Completed",
     "Origin of an example that was generated in the posture and cadence of the recordings, "
     "because "
     "they lack such a movement."},
    {"Stand pose", "The pose in which an avatar stands."},
};

const char* VerdictText(CheckVerdict verdict) {
  switch (verdict) {
    case CheckVerdict::kPassed: return "passed";
    case CheckVerdict::kFailed: return "failed";
    case CheckVerdict::kNotApplicable: break;
  }
  return "not applicable";
}

// Formats a measured value with a precision that suits its unit.
std::string FigureText(double value, const std::string& unit) {
  return Text(unit == "m" ? "%.3f " : "%.0f ", value) + unit;
}

}  // namespace

std::string VerdictHtml(const SelfCheck& check, const LibrarySummary& summary) {
  std::string html = std::string("<div class=\"verdict ") + (check.passed() ? "passed" : "failed") +
                     "\">\n<p><strong>" + EscapeHtml(DescribeVerdict(check)) + "</strong>";
  html += check.passed() ? " The movements played for it show no fault."
                         : " Avatars will show these faults with this library:";
  html += "</p>\n";
  if (!check.passed()) {
    html += "<ul>\n";
    for (const CheckResult& result : check.checks) {
      if (result.verdict != CheckVerdict::kFailed) continue;
      html +=
          "<li>" + EscapeHtml(result.title + ": " + result.text + " " + result.advice) + "</li>\n";
    }
    html += "</ul>\n";
  }
  html += Text("<p>The library has %d steps and %d jumps.", summary.steps.total(),
               summary.jumps.origins.total());
  if (!summary.missing.empty()) {
    html += " It is missing ";
    for (std::size_t i = 0; i < summary.missing.size(); ++i) {
      html += std::string(i == 0                            ? ""
                          : i + 1 == summary.missing.size() ? " and "
                                                            : ", ") +
              EscapeHtml(summary.missing[i].what);
    }
    html += ".";
  }
  return html + "</p>\n</div>\n";
}

std::string ContentsHtml(const std::vector<Section>& sections) {
  std::string html = "<nav aria-label=\"Contents\">\n<h2>Contents</h2>\n<ul>\n";
  for (const Section& section : sections) {
    html += "<li><a href=\"#" + EscapeHtml(section.id) + "\">" + EscapeHtml(section.heading) +
            "</a></li>\n";
  }
  return html + "</ul>\n</nav>\n";
}

std::string SectionHtml(const Section& section) {
  return "<h2 id=\"" + EscapeHtml(section.id) + "\">" + EscapeHtml(section.heading) + "</h2>\n" +
         section.html;
}

Section SummarySection(const LibrarySummary& summary) {
  std::string html = "<ul>\n";
  for (const std::string& sentence : DescribeSummary(summary)) {
    html += "<li>" + EscapeHtml(sentence) + "</li>\n";
  }
  html += "</ul>\n";
  if (!summary.missing.empty()) {
    HtmlTable rows = {{"Missing", "What to do"}};
    for (const MissingAbility& missing : summary.missing) {
      rows.push_back({missing.what, missing.advice});
    }
    html += TableHtml(rows);
  }
  return {"summary", "What this library can do", html};
}

Section SelfCheckSection(const SelfCheck& check) {
  HtmlTable rows = {{"Check", "Verdict", "Measured", "At most", "Explanation"}};
  for (const CheckResult& result : check.checks) {
    rows.push_back({result.title, VerdictText(result.verdict),
                    result.measured ? FigureText(*result.measured, result.unit) : "",
                    FigureText(result.bound, result.unit),
                    result.text + (result.advice.empty() ? "" : " " + result.advice)});
  }
  return {
      "self-check", "Self-check",
      "<p>An avatar plays three steps, a stop and a walk on level ground.</p>\n" + TableHtml(rows)};
}

Section TermsSection() {
  std::string html = "<dl>\n";
  for (const auto& [term, meaning] : kTerms) {
    html += "<dt>" + EscapeHtml(term) + "</dt>\n<dd>" + EscapeHtml(meaning) + "</dd>\n";
  }
  return {"terms", "Terms", html + "</dl>\n"};
}

}  // namespace stridewire
