#pragma once

#include <map>
#include <memory>
#include <string>

#include "ops/config.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"
#include "world/pose_quantizations.h"

namespace stridewire::server {

/// Loads one library: "builtin" is generated, anything else is a file.
[[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> LoadLibrary(const std::string& name);

/// The libraries a configuration names, each loaded once. Immutable afterwards.
class Libraries {
 public:
  /// Errors name the file.
  [[nodiscard]] static Expected<Libraries> Load(const Config& config);

  /// Takes a library made elsewhere as the one of that name.
  void Add(const std::string& name, std::shared_ptr<const MotionLibrary> library);
  /// Null for a name no configuration had.
  [[nodiscard]] std::shared_ptr<const MotionLibrary> Find(const std::string& name) const;
  /// The same of how its poses are told.
  [[nodiscard]] std::shared_ptr<const PoseCodes> FindCodes(const std::string& name) const;
  [[nodiscard]] const std::map<std::string, std::shared_ptr<const MotionLibrary>>& All() const {
    return libraries_;
  }

 private:
  std::map<std::string, std::shared_ptr<const MotionLibrary>> libraries_;
  std::map<std::string, std::shared_ptr<const PoseCodes>> codes_;
};

}  // namespace stridewire::server
