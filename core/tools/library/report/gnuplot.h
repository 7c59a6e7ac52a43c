#pragma once

#include <string>

#include "stridewire/base/error.h"

namespace stridewire {

// Runs a gnuplot script, data included, and returns the SVG it draws: `width` by `height` pixels, the
// same bytes every time. gnuplot reads no settings of the user's. kUnsupported: gnuplot is not there;
// kIo: it does not draw.
[[nodiscard]] Expected<std::string> DrawSvg(const std::string& script, int width, int height);

// A number as the scripts have it: six digits, "NaN" for what is none.
[[nodiscard]] std::string Number(double value);

// Text in quotes of a script: nothing in it is taken for a command. Markup (^ _ { }) is unless the
// script says noenhanced.
[[nodiscard]] std::string Quoted(const std::string& text);

}  // namespace stridewire
