#pragma once

#include <memory>
#include <span>

#include "runtime/skeleton/layer_clip.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// What a library holds: views of whatever holds it meanwhile.
struct LibraryContent {
  const Skeleton& skeleton;
  const Pose& stand_pose;
  std::span<const MotionGroup> groups;
  std::span<const LayerClip> layers = {};
};

/// Puts a library together: the bytes of its file, opened again and so checked. Same content, same
/// bytes. kOutOfRange: no group; else as MotionLibrary::FromBytes.
[[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> WriteLibrary(
    const LibraryContent& content);

}  // namespace stridewire
