#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace stridewire {

// The header of a `.swl` file: the 64 bytes before its payload, little-endian.
//
//   0  8  magic "STRDWSWL"      16  8  payload bytes
//   8  4  format version        24 16  XXH3-128 of the payload, high half first
//  12  4  header bytes (64)     40 24  zero
inline constexpr std::size_t kLibraryHeaderBytes = 64;
inline constexpr char kLibraryMagic[9] = "STRDWSWL";

/// XXH3-128 of a library's payload. It identifies the library.
struct LibraryHash {
  std::uint64_t high = 0;
  std::uint64_t low = 0;
  bool operator==(const LibraryHash&) const = default;
};

[[nodiscard]] LibraryHash HashPayload(std::span<const std::byte> payload);
/// Returns the hash as 32 lower-case hexadecimal digits.
[[nodiscard]] std::string HashText(const LibraryHash& hash);
/// Returns the header for a payload, in the current format version.
[[nodiscard]] std::array<std::byte, kLibraryHeaderBytes> MakeLibraryHeader(
    std::span<const std::byte> payload);

}  // namespace stridewire
