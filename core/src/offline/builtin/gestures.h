#pragma once

#include "stridewire/offline/raw_library.h"

namespace stridewire::builtin {

/// Adds two looping layers. "wave" raises the right arm and swings its forearm. "carry" holds both
/// forearms forward as if under a box.
void AddGestures(RawLibrary& library);

}  // namespace stridewire::builtin
