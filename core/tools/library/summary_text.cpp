#include "summary_text.h"

#include <cstdio>
#include <string>

namespace stridewire {

void PrintSummary(const LibrarySummary& summary) {
  std::printf("\nWhat this library can do:\n");
  for (const std::string& sentence : DescribeSummary(summary)) {
    std::printf("  %s\n", sentence.c_str());
  }
  if (summary.missing.empty()) return;
  std::printf("What is missing:\n");
  for (const MissingAbility& missing : summary.missing) {
    std::printf("  %s: %s\n", missing.what.c_str(), missing.advice.c_str());
  }
}

void PrintSelfCheck(const SelfCheck& check) {
  std::printf("\n%s%s\n", check.passed() ? "" : "Warning: ", DescribeVerdict(check).c_str());
  for (const CheckResult& result : check.checks) {
    const char* const verdict = result.verdict == CheckVerdict::kPassed   ? "passed"
                                : result.verdict == CheckVerdict::kFailed ? "FAILED"
                                                                          : "not applicable";
    std::printf("  %s (%s): %s\n", result.title.c_str(), verdict, result.text.c_str());
    if (!result.advice.empty()) std::printf("    %s\n", result.advice.c_str());
  }
}

}  // namespace stridewire
