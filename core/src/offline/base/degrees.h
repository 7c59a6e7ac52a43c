#pragma once

namespace stridewire {

inline constexpr double kDegreesPerRadian = 180.0 / 3.14159265358979323846;

}  // namespace stridewire
