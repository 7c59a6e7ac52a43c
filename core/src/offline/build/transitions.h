#pragma once

#include <vector>

#include "offline/build/library_writer.h"
#include "runtime/library/transition.h"

namespace stridewire {

/// Largest number of examples per group that are compared; larger groups are sampled evenly.
inline constexpr int kMaxComparedExamples = 64;

/// Finds the best transition from every group to every group, where the standing pose counts as an
/// additional group after the others: [from * (groups + 1) + to]. The best transition connects the
/// example whose final pose is nearest to the initial pose of another (at most kMaxComparedExamples
/// per group). The standing pose has velocity 0. The same content gives the same values.
/// See docs/decisions/0015-transitions-are-computed-when-a-library-is-built.md.
[[nodiscard]] std::vector<Transition> FindTransitions(const LibraryContent& content);

}  // namespace stridewire
