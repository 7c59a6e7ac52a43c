#include "overview.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stridewire {
namespace {

using testing::HasSubstr;
using testing::Not;

SelfCheck OneCheck(CheckVerdict verdict) {
  SelfCheck check;
  check.checks = {{.name = "knees",
                   .title = "Knees bend forward",
                   .verdict = verdict,
                   .measured = 75.0,
                   .bound = 60.0,
                   .unit = "degrees",
                   .text = "Knees point <away>.",
                   .advice = verdict == CheckVerdict::kFailed ? "Check the joints." : ""}};
  return check;
}

TEST(Overview, VerdictNamesFailedChecksAndWhatIsMissing) {
  LibrarySummary summary;
  summary.missing = {{"stops", "Record stops."}, {"jumps", "Record jumps."}};
  const std::string html = VerdictHtml(OneCheck(CheckVerdict::kFailed), summary);
  EXPECT_THAT(html, HasSubstr("class=\"verdict failed\""));
  EXPECT_THAT(html, HasSubstr("Knees bend forward: Knees point &lt;away&gt;. Check the joints."));
  EXPECT_THAT(html, HasSubstr("It is missing stops and jumps."));
}

TEST(Overview, VerdictOfAGoodLibraryListsNothing) {
  const std::string html = VerdictHtml(OneCheck(CheckVerdict::kPassed), {});
  EXPECT_THAT(html, HasSubstr("class=\"verdict passed\""));
  EXPECT_THAT(html, Not(HasSubstr("<li>")));
  EXPECT_THAT(html, Not(HasSubstr("missing")));
}

TEST(Overview, ContentsLinkToTheSections) {
  const Section section = SelfCheckSection(OneCheck(CheckVerdict::kFailed));
  EXPECT_THAT(ContentsHtml({section}), HasSubstr("<a href=\"#self-check\">Self-check</a>"));
  EXPECT_THAT(SectionHtml(section), HasSubstr("<h2 id=\"self-check\">Self-check</h2>"));
  EXPECT_THAT(section.html, HasSubstr("75 degrees"));
}

}  // namespace
}  // namespace stridewire
