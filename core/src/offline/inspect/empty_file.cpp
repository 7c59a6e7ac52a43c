#include "offline/inspect/empty_file.h"

#include <map>

#include "offline/base/text.h"

namespace stridewire {
namespace {

// Returns the reason with the largest total rejected time. If several have the same time, returns
// the first in alphabetical order.
std::string MainReason(const Extraction& extraction) {
  std::map<std::string, double> seconds;
  for (const RejectedTime& time : extraction.rejected) {
    if (!time.reason.empty()) seconds[time.reason] += time.to_s - time.from_s;
  }
  std::string main;
  double most_s = -1.0;
  for (const auto& [reason, s] : seconds) {
    if (s <= most_s) continue;
    main = reason;
    most_s = s;
  }
  return main;
}

}  // namespace

std::string ReasonForNoMovements(const Extraction& extraction, bool steps, bool jumps) {
  if (!extraction.error.empty()) return extraction.error;
  const int step_count = extraction.steps_left + extraction.steps_right;
  if ((steps && step_count > 0) || (jumps && extraction.jumps > 0)) return {};
  if (step_count > 0) {
    return Text(
        "the file contains %d steps but no jump, and --kinds selects only jumps; add step "
        "to --kinds",
        step_count);
  }
  if (extraction.jumps > 0) {
    return Text(
        "the file contains %d jumps but no step, and --kinds selects only steps; add jump "
        "to --kinds",
        extraction.jumps);
  }
  if (!extraction.no_movement_reason.empty()) return extraction.no_movement_reason;
  return "no usable step or jump; most of the rejected time: " + MainReason(extraction);
}

}  // namespace stridewire
