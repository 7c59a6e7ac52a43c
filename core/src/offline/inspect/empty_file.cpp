#include "offline/inspect/empty_file.h"

#include <map>

#include "offline/base/text.h"

namespace stridewire {
namespace {

// Returns the reason that covers most of the rejected time; the first one of equals.
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
  if (const std::string main = MainReason(extraction); !main.empty()) {
    return "no usable step or jump; most of the rejected time: " + main;
  }
  if (extraction.frames <= 1) {
    return "the file has a single frame, so nothing moves; record whole walks or jumps";
  }
  const double duration_s = extraction.fps > 0.0 ? extraction.frames / extraction.fps : 0.0;
  if (!extraction.has_contacts) {
    return Text(
        "no foot stands still on the ground in %.1f s; check the frame rate (--fps) and "
        "the up axis (--up)",
        duration_s);
  }
  return Text(
      "no foot leaves the ground and lands again between two moments with both feet on the "
      "ground in %.1f s; record walks from a stand to a stand",
      duration_s);
}

}  // namespace stridewire
