#pragma once

#include "stridewire/offline/raw_library.h"

namespace stridewire::builtin {

/// Adds the figure's layers: "wave", the right arm raised and its forearm swung to and fro, and "carry",
/// both forearms held ahead as under a box. Both are loops.
void AddGestures(RawLibrary& library);

}  // namespace stridewire::builtin
