#pragma once

#include "offline/capture/bvh_figure.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Sets the joints of `leg`, and where the ball and the tip of the toes are. `figure` must be in
/// metres and our axes, with +Y up and root positions in its clip. Adds notes to `figure`.
///
/// A foot without a toe joint gets its ball at two thirds of its length, as high as its tip. A toe
/// joint without a tip is one third of the foot long. Heights are those of a flat sole: in the rest
/// pose, if `rest_stands` and its feet point forward, and otherwise while the ankle is slowest.
void SetFootShape(BvhFigure& figure, bool rest_stands, const FoundLeg& found, Leg& leg);

}  // namespace stridewire
