#pragma once

#include <vector>

#include "offline/build/library_writer.h"
#include "runtime/library/transition.h"

namespace stridewire {

/// Maximum number of examples per group that are compared. Larger groups are sampled evenly.
inline constexpr int kMaxComparedExamples = 64;

/// Finds the best transition from every group to every group: [from * (groups + 1) + to]. The stand
/// pose is an additional group after the others. The best transition leads from the example whose
/// final pose is closest to the initial pose of an example of the other group. At most
/// kMaxComparedExamples per group are compared. The stand pose has velocity 0. Equal content gives
/// equal results. See docs/decisions/0015-transitions-are-computed-when-a-library-is-built.md.
[[nodiscard]] std::vector<Transition> FindTransitions(const LibraryContent& content);

}  // namespace stridewire
