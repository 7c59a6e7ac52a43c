#pragma once

#include <map>
#include <memory>
#include <string>

#include "ops/config.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire::server {

/// The terrain files a configuration names, each read once. Immutable afterwards.
class Terrains {
 public:
  /// Errors name the file and what is wrong in it; kLimitExceeded: it could not be told to clients
  /// within max_bulk_bytes.
  [[nodiscard]] static Expected<Terrains> Load(const Config& config);

  /// Takes a terrain made elsewhere as the one of that file.
  void Add(const std::string& file, std::shared_ptr<const Terrain> terrain) {
    terrains_[file] = std::move(terrain);
  }
  /// Null for a file no configuration had.
  [[nodiscard]] std::shared_ptr<const Terrain> Find(const std::string& file) const;

 private:
  std::map<std::string, std::shared_ptr<const Terrain>> terrains_;
};

}  // namespace stridewire::server
