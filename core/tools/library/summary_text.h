#pragma once

#include "offline/inspect/library_summary.h"
#include "offline/inspect/self_check.h"

namespace stridewire {

// Print on stdout what a library can do and what is missing, and the results of its self-check.
void PrintSummary(const LibrarySummary& summary);
void PrintSelfCheck(const SelfCheck& check);

}  // namespace stridewire
