#include "app/libraries.h"

#include <set>
#include <utility>

#include "stridewire/offline/open_library.h"

namespace stridewire::server {

Expected<Libraries> Libraries::Load(const Config& config) {
  std::set<std::string> names = {config.library};
  for (const auto& [world, settings] : config.worlds) {
    if (!settings.library.empty()) names.insert(settings.library);
  }
  Libraries libraries;
  for (const std::string& name : names) {
    auto library = OpenLibrary(name);
    if (!library) return std::unexpected(library.error());
    libraries.Add(name, *std::move(library));
  }
  return libraries;
}

void Libraries::Add(const std::string& name, std::shared_ptr<const MotionLibrary> library) {
  quantizations_[name] = MakePoseQuantizations(*library);
  walk_speeds_[name] = MeasureWalkSpeeds(library);
  libraries_[name] = std::move(library);
}

std::shared_ptr<const PoseQuantizations> Libraries::FindQuantizations(
    const std::string& name) const {
  const auto it = quantizations_.find(name);
  return it == quantizations_.end() ? nullptr : it->second;
}

WalkSpeeds Libraries::FindWalkSpeeds(const std::string& name) const {
  const auto it = walk_speeds_.find(name);
  return it == walk_speeds_.end() ? WalkSpeeds{} : it->second;
}

std::shared_ptr<const MotionLibrary> Libraries::Find(const std::string& name) const {
  const auto it = libraries_.find(name);
  return it == libraries_.end() ? nullptr : it->second;
}

}  // namespace stridewire::server
