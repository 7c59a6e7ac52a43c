#pragma once

#include <vector>

#include "offline/build/library_writer.h"
#include "runtime/library/transition.h"

namespace stridewire {

/// Of a group at most this many examples, spread evenly, are looked at.
inline constexpr int kMaxComparedExamples = 64;

/// How the end of every group meets the start of every other, of itself and the stand:
/// [from * (groups + 1) + to], the stand behind the groups. Of all pairs of an example that ends and one that
/// starts (at most kMaxComparedExamples of a group) the one whose poses are nearest; the stand is its pose,
/// at rest. Same content, same values. Source: method, "Transitions".
[[nodiscard]] std::vector<Transition> FindTransitions(const LibraryContent& content);

}  // namespace stridewire
