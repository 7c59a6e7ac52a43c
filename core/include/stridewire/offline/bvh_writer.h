#pragma once

#include <filesystem>
#include <iosfwd>

#include "stridewire/base/error.h"
#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Writes a clip as BVH in metres with y up. The root has six channels (X, Y, Z position, then
/// Z, Y, X rotation), other joints have three (Z, Y, X rotation). Each frame is one line.
///
/// - Positions and offsets are written with enough digits to restore the same floats. Angles have
///   six decimals, in degrees. They are continuous over time and may therefore exceed +-180.
/// - Joints are written depth first, with the children of a joint in the order of the skeleton.
///   A skeleton that was read from a BVH file keeps its order.
/// - A joint without a child or End Site gets an End Site of length zero. White space and braces in
///   names become `_`.
///
/// Errors: those of Skeleton::Validate and Clip::Validate. kShapeMismatch if skeleton and clip
/// differ in their number of joints. kIo if writing to the stream fails.
[[nodiscard]] Status WriteBvh(const Skeleton& skeleton, const Clip& clip, std::ostream& out);

/// Does the same for a file. Writes a temporary file in the same folder and renames it, so that
/// `path` contains either its previous content or the complete clip. Errors: the same, and kIo if
/// the file cannot be created or renamed. Error::where is the path.
[[nodiscard]] Status WriteBvh(const Skeleton& skeleton, const Clip& clip,
                              const std::filesystem::path& path);

}  // namespace stridewire
