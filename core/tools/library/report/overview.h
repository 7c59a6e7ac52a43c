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

// Returns the box at the top of the page. It states whether the library passes the self-check, what
// to do about each failure, and which movements are missing.
[[nodiscard]] std::string VerdictHtml(const SelfCheck& check, const LibrarySummary& summary);

// Returns a list of links to the sections.
[[nodiscard]] std::string ContentsHtml(const std::vector<Section>& sections);

[[nodiscard]] std::string SectionHtml(const Section& section);

// Describes what the library can do and what it lacks.
[[nodiscard]] Section SummarySection(const LibrarySummary& summary);

[[nodiscard]] Section SelfCheckSection(const SelfCheck& check);

// Explains the terms that the report uses.
[[nodiscard]] Section TermsSection();

}  // namespace stridewire
