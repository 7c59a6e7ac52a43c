#pragma once

#include "offline/capture/bvh_figure.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Sets the joints of `leg`, its ball and its toe tip. `figure` must be in metres and have +Y up,
/// with root positions in its clip. Adds notes to `figure`.
///
/// If there is no toe joint, the End Site of the foot is the toe tip. The ball is then placed at
/// two thirds of the horizontal distance from the ankle to the toe tip, at the height of the tip.
/// An End Site within 0.2 leg lengths of the ankle is the ball instead. In this case, and if a toe
/// joint has no tip, the toe tip is placed beyond the ball, at half the horizontal distance from
/// the ankle to the ball. A foot with neither a toe joint nor an End Site gets a toe tip at a
/// typical distance from the ankle.
///
/// Heights are those of a flat sole. The sole is flat in the rest pose if `rest_stands` and the
/// foot points forward. Otherwise, it is assumed to be flat while the ankle is slowest.
void SetFootShape(BvhFigure& figure, bool rest_stands, const FoundLeg& found, Leg& leg);

}  // namespace stridewire
