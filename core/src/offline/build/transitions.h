#pragma once

#include <vector>

#include "offline/build/library_writer.h"
#include "runtime/library/transition.h"

namespace stridewire {

/// Maximum number of examples per group that are compared. Larger groups are sampled evenly.
inline constexpr int kMaxComparedExamples = 64;

/// Finds the best transition from every group to every group: [from * (groups + 1) + to]. The stand
/// pose is an additional group after the others. A transition leads from the end of an example of
/// one group to the start of an example of another or the same group. The best one has the smallest
/// distance in positions and velocities of the joints (Transition::distance_m). At most
/// kMaxComparedExamples per group are compared. The stand pose has velocity 0. Equal content gives
/// equal results. See docs/decisions/0015-transitions-are-computed-when-a-library-is-built.md.
[[nodiscard]] std::vector<Transition> FindTransitions(const LibraryContent& content);

}  // namespace stridewire
