#include "ops/libraries.h"

#include <set>

#include "offline/builtin/builtin_library.h"
#include "stridewire/offline/library_builder.h"

namespace stridewire::server {

Expected<std::shared_ptr<const MotionLibrary>> LoadLibrary(const std::string& name) {
  if (name == "builtin") return LibraryBuilder().Build(GenerateBuiltinLibrary());
  return MotionLibrary::Open(name);
}

Expected<Libraries> Libraries::Load(const Config& config) {
  std::set<std::string> names = {config.library};
  for (const auto& [world, settings] : config.worlds) {
    if (!settings.library.empty()) names.insert(settings.library);
  }
  Libraries libraries;
  for (const std::string& name : names) {
    auto library = LoadLibrary(name);
    if (!library) return std::unexpected(library.error());
    libraries.Add(name, *std::move(library));
  }
  return libraries;
}

void Libraries::Add(const std::string& name, std::shared_ptr<const MotionLibrary> library) {
  codes_[name] = MakePoseCodes(*library);
  libraries_[name] = std::move(library);
}

std::shared_ptr<const PoseCodes> Libraries::FindCodes(const std::string& name) const {
  const auto it = codes_.find(name);
  return it == codes_.end() ? nullptr : it->second;
}

std::shared_ptr<const MotionLibrary> Libraries::Find(const std::string& name) const {
  const auto it = libraries_.find(name);
  return it == libraries_.end() ? nullptr : it->second;
}

}  // namespace stridewire::server
