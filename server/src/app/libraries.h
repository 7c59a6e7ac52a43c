#pragma once

#include <map>
#include <memory>
#include <string>

#include "base/config.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/avatar.h"
#include "stridewire/runtime/motion_library.h"
#include "world/pose_quantizations.h"

namespace stridewire::server {

/// The libraries that a configuration names, each loaded once. Immutable after loading.
class Libraries {
 public:
  /// Loads all libraries of a configuration. Errors contain the file.
  [[nodiscard]] static Expected<Libraries> Load(const Config& config);

  /// Adds a library under a name.
  void Add(const std::string& name, std::shared_ptr<const MotionLibrary> library);
  /// Returns null if no library has this name.
  [[nodiscard]] std::shared_ptr<const MotionLibrary> Find(const std::string& name) const;
  /// Returns the compact pose formats of a library, or null if no library has this name.
  [[nodiscard]] std::shared_ptr<const PoseQuantizations> FindQuantizations(
      const std::string& name) const;
  /// Returns the walking speeds of a library, or unknown speeds (0) if no library has this name.
  [[nodiscard]] WalkSpeeds FindWalkSpeeds(const std::string& name) const;
  [[nodiscard]] const std::map<std::string, std::shared_ptr<const MotionLibrary>>& All() const {
    return libraries_;
  }

 private:
  std::map<std::string, std::shared_ptr<const MotionLibrary>> libraries_;
  std::map<std::string, std::shared_ptr<const PoseQuantizations>> quantizations_;
  std::map<std::string, WalkSpeeds> walk_speeds_;
};

}  // namespace stridewire::server
