#include "runtime/plan/swing_times.h"

#include <algorithm>

#include "runtime/library/contact_keytimes.h"
#include "runtime/library/keytimes.h"

namespace stridewire {
namespace {

// In captures, the ball of a foot leaves the ground kBallLeavesS before toe-off and comes to rest
// kBallRestsS after heel-strike, at the playback speed of the captures.
constexpr double kBallLeavesS = 0.06;
constexpr double kBallRestsS = 0.08;
constexpr double kShortestSwingS = 0.05;

}  // namespace

SwingTimes SwingTimesOf(MovementKind kind, const Movement& movement) {
  const double duration_s = movement.duration_s();
  if (movement.warp.interval_count() < 3) return {0.25 * duration_s, 0.9 * duration_s};
  const ContactKeytimes contact = ContactKeytimesOf(kind, movement.warp.interval_count());
  const double off_s = movement.warp.keytime_s(contact.toe_off);
  SwingTimes times;
  times.release_s = std::max(off_s - kBallLeavesS / movement.rate, 0.5 * off_s);
  times.land_s =
      std::min(movement.warp.keytime_s(contact.landing) + kBallRestsS / movement.rate, duration_s);
  times.release_s = std::min(times.release_s, times.land_s - kShortestSwingS);
  return times;
}

double TimeAtPhase(const SwingTimes& swing, double phase) {
  return phase <= 1.0 ? phase * swing.release_s
                      : swing.release_s + (phase - 1.0) * (swing.land_s - swing.release_s);
}

}  // namespace stridewire
