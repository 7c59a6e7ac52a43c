#include "stridewire/offline/open_library.h"

#include "offline/builtin/builtin_library.h"
#include "stridewire/offline/library_builder.h"

namespace stridewire {

Expected<std::shared_ptr<const MotionLibrary>> OpenLibrary(std::string_view name) {
  if (name != "builtin") return MotionLibrary::Open(name);
  static const auto builtin = LibraryBuilder().Build(GenerateBuiltinLibrary());
  return builtin;
}

}  // namespace stridewire
