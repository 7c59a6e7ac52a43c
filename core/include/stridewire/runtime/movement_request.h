#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <variant>

#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// One step: where the moving foot lands relative to the fixed one.
struct StepRequest {
  std::optional<Foot> foot;      ///< Left out: the other foot than last time.
  double length_m = 0.0;         ///< Forward distance between the feet at the end; 0 closes.
  std::optional<double> side_m;  ///< Fixed to moving foot, positive to the moving foot's own side.
  double height_m = 0.0;         ///< Moving above fixed foot at the end.
  double turn_rad = 0.0;         ///< Change of heading, left positive.
};

struct JumpRequest {
  double length_m = 0.0;
  double height_m = 0.0;
  double turn_rad = 0.0;
};

/// Stands for a while; a walking avatar closes its feet first.
struct StandRequest {
  double seconds = 0.0;
};

struct MovementRequest {
  std::uint64_t id = 0;  ///< The caller's; comes back in events.
  std::variant<StepRequest, JumpRequest, StandRequest> movement;
};

/// Limits on what may be asked for, far outside what any library spans: meaning, not taste.
inline constexpr double kMaxRequestLengthM = 10.0;  ///< Lengths, sides and heights, either sign.
inline constexpr double kMaxRequestTurnRad = 3.2;
inline constexpr double kMaxStandS = 3600.0;

/// kOutOfRange: a number not finite or beyond its limit; kUnsupported: the library has no movement
/// of that kind.
[[nodiscard]] Status ValidateRequest(const MotionLibrary& library, const MovementRequest& request);

/// Parameter values in the order of the group they belong to; `count` = its parameter count.
struct ParameterValues {
  std::array<double, kMaxParameters> values{};
  int count = 0;
};

}  // namespace stridewire
