#pragma once

#include "offline/inspect/library_summary.h"
#include "offline/inspect/self_check.h"

namespace stridewire {

// Prints a summary of a library, including what it lacks, to stdout.
void PrintSummary(const LibrarySummary& summary);
// Prints the results of a self-check to stdout.
void PrintSelfCheck(const SelfCheck& check);

}  // namespace stridewire
