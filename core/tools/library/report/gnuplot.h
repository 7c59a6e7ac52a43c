#pragma once

#include <string>

#include "stridewire/base/error.h"

namespace stridewire {

// Runs a gnuplot script that contains its data and returns the SVG, with `width` by `height`
// pixels. The same script gives the same bytes, since gnuplot does not read the settings of the
// user. Errors: kUnsupported if gnuplot is not installed, kIo if it fails.
[[nodiscard]] Expected<std::string> DrawSvg(const std::string& script, int width, int height);

// Formats a number for a script with six significant digits. Returns "NaN" if it is not finite.
[[nodiscard]] std::string Number(double value);

// Quotes text for a script, so that gnuplot never interprets it as a command. gnuplot still
// interprets markup (^ _ { }) unless the script says noenhanced.
[[nodiscard]] std::string Quoted(const std::string& text);

}  // namespace stridewire
