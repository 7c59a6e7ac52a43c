#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>

#include "base/config.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire::server {

/// The terrain files that a configuration names, each read once. Immutable after loading.
class Terrains {
 public:
  /// Reads all terrains of a configuration. Errors contain the file and the invalid member. Fails
  /// with kLimitExceeded if a terrain does not fit into a message of max_bulk_bytes.
  [[nodiscard]] static Expected<Terrains> Load(const Config& config);

  /// Adds a terrain under the name of a file.
  void Add(const std::string& file, std::shared_ptr<const Terrain> terrain) {
    terrains_[file] = std::move(terrain);
  }
  /// Returns null if the configuration does not name this file.
  [[nodiscard]] std::shared_ptr<const Terrain> Find(const std::string& file) const;

 private:
  std::map<std::string, std::shared_ptr<const Terrain>> terrains_;
};

}  // namespace stridewire::server
