#pragma once

#include "corpus/figure.h"

namespace stridewire::test {

/// Motions that contain no step. Each lasts `seconds`.
[[nodiscard]] FigureMotion StandStill(const Figure& figure, double fps, double seconds);
/// Stands on the right foot while the left foot slowly moves through the air.
[[nodiscard]] FigureMotion DanceOnOneLeg(const Figure& figure, double fps, double seconds);
[[nodiscard]] FigureMotion Sit(const Figure& figure, double fps, double seconds);
/// Lies on the back and rolls slowly from side to side.
[[nodiscard]] FigureMotion Lie(const Figure& figure, double fps, double seconds);
/// Moves on hands and knees.
[[nodiscard]] FigureMotion Crawl(const Figure& figure, double fps, double seconds);
/// Hangs from a bar; the legs swing.
[[nodiscard]] FigureMotion Hang(const Figure& figure, double fps, double seconds);
/// Stands with stretched arms like the rest pose.
[[nodiscard]] FigurePose RestPose(const Figure& figure);

/// Stands, crouches, jumps ahead with a flight of 0.4 s, lands with both feet and stands again.
[[nodiscard]] FigureMotion StandingJump(const Figure& figure, double fps, double length_m);

/// Removes the horizontal travel of the pelvis, as in animations that are played in place.
void StayInPlace(FigureMotion& motion);

}  // namespace stridewire::test
