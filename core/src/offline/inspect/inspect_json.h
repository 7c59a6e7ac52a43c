#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "offline/inspect/library_summary.h"
#include "offline/inspect/refusals.h"
#include "offline/inspect/self_check.h"

namespace stridewire {

/// Converts a summary to JSON: {"sentences": [...], "steps": {...}, "starts": {"left": {...},
/// "right": {...}}, ..., "missing": [{"what": ..., "advice": ...}]}. Each ability contains the
/// numbers of its captured, mirrored, generated and completed examples, and its range or null.
[[nodiscard]] nlohmann::ordered_json SummaryToJson(const LibrarySummary& summary);

/// Returns {"passed": ..., "verdict": ..., "checks": [{"name": ..., "verdict": ..., ...}]}.
[[nodiscard]] nlohmann::ordered_json SelfCheckToJson(const SelfCheck& check);

/// Returns a list of {"request": index in the choreography, "kind": ..., "asked": {...}, "got":
/// {...}, "missed_m": ..., "missed_rad": ..., "reason": ...}.
[[nodiscard]] nlohmann::ordered_json RefusalsToJson(const std::vector<Refusal>& refusals);

}  // namespace stridewire
