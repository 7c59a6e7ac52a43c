#pragma once

#include <string>
#include <vector>

#include "offline/inspect/library_summary.h"
#include "offline/inspect/self_check.h"

namespace stridewire {

// A section of the page. `html` does not contain the heading.
struct Section {
  std::string id;  // Anchor of the heading.
  std::string heading;
  std::string html;
};

// The box at the top of the page: whether the library works, and what to do first if it does not.
[[nodiscard]] std::string VerdictHtml(const SelfCheck& check, const LibrarySummary& summary);

// A list of links to the sections.
[[nodiscard]] std::string ContentsHtml(const std::vector<Section>& sections);

[[nodiscard]] std::string SectionHtml(const Section& section);

// Describes what the library can do, and what is missing.
[[nodiscard]] Section SummarySection(const LibrarySummary& summary);

[[nodiscard]] Section SelfCheckSection(const SelfCheck& check);

// The terms that the report uses.
[[nodiscard]] Section TermsSection();

}  // namespace stridewire
