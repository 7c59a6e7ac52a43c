#pragma once

#include <memory>
#include <span>

#include "runtime/skeleton/layer_clip.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// The contents of a library, as views that the caller must keep alive.
struct LibraryContent {
  const Skeleton& skeleton;
  const Pose& stand_pose;
  std::span<const MotionGroup> groups;
  std::span<const LayerClip> layers;
};

/// Writes the bytes of a library file and opens them again, which validates them. Equal content
/// gives equal bytes. Errors: kOutOfRange if there are no groups, and those of
/// MotionLibrary::FromBytes.
[[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> WriteLibrary(
    const LibraryContent& content);

}  // namespace stridewire
