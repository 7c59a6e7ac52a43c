#pragma once

#include <filesystem>
#include <iosfwd>

#include "stridewire/base/error.h"
#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Writes a clip as BVH that common tools open: metres, y up; the root with six channels (X, Y, Z
/// position, then Z, Y, X rotation), other joints with three (Z, Y, X rotation), one line a frame.
///
/// - Positions and offsets are written so that reading gives back the same floats; angles have six
///   decimals of a degree and run on over +-180 degrees without jumps.
/// - Joints stand depth first, children in the skeleton's order; a skeleton read from a BVH file
///   keeps its order.
/// - A joint without child and End Site gets an End Site of no length. White space and braces in
///   names become `_`.
///
/// Errors: whatever Skeleton::Validate and Clip::Validate find; kShapeMismatch: skeleton and clip
/// differ in joints; kIo: the stream took no more.
[[nodiscard]] Status WriteBvh(const Skeleton& skeleton, const Clip& clip, std::ostream& out);

/// As above, into a file: written beside it first and then renamed, so that `path` holds either
/// what it held before or everything. kIo: `where` names the path.
[[nodiscard]] Status WriteBvh(const Skeleton& skeleton, const Clip& clip,
                              const std::filesystem::path& path);

}  // namespace stridewire
