#include "runtime/library/library_file.h"

#include <xxhash.h>

#include <bit>
#include <cstdio>
#include <cstring>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

static_assert(
    std::endian::native == std::endian::little,
    "library files are read in place and are little-endian; other machines need a conversion");

LibraryHash HashPayload(std::span<const std::byte> payload) {
  const XXH128_hash_t hash = XXH3_128bits(payload.data(), payload.size());
  return {hash.high64, hash.low64};
}

std::string HashText(const LibraryHash& hash) {
  char text[33];
  std::snprintf(text, sizeof(text), "%016llx%016llx", static_cast<unsigned long long>(hash.high),
                static_cast<unsigned long long>(hash.low));
  return text;
}

std::array<std::byte, kLibraryHeaderBytes> MakeLibraryHeader(std::span<const std::byte> payload) {
  std::array<std::byte, kLibraryHeaderBytes> header{};
  const auto version = static_cast<std::uint32_t>(MotionLibrary::kFormatVersion);
  const auto header_bytes = static_cast<std::uint32_t>(kLibraryHeaderBytes);
  const auto payload_bytes = static_cast<std::uint64_t>(payload.size());
  const LibraryHash hash = HashPayload(payload);
  std::memcpy(header.data(), kLibraryMagic, 8);
  std::memcpy(header.data() + 8, &version, 4);
  std::memcpy(header.data() + 12, &header_bytes, 4);
  std::memcpy(header.data() + 16, &payload_bytes, 8);
  std::memcpy(header.data() + 24, &hash.high, 8);
  std::memcpy(header.data() + 32, &hash.low, 8);
  return header;
}

}  // namespace stridewire
