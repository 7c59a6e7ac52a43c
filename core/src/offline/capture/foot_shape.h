#pragma once

#include "offline/capture/bvh_figure.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Sets the joints of `leg`, its ball and its toe tip. `figure` must be in metres and have +Y up,
/// with root positions in its clip. Adds notes to `figure`.
///
/// If there is no toe joint, the ball is placed at two thirds of the foot's length, at the height
/// of the toe tip. If a toe joint has no tip, one third of the foot's length is added. Heights are
/// those of a flat sole. The sole is flat in the rest pose if `rest_stands` and its feet point
/// forward. Otherwise, it is assumed to be flat while the ankle is slowest.
void SetFootShape(BvhFigure& figure, bool rest_stands, const FoundLeg& found, Leg& leg);

}  // namespace stridewire
