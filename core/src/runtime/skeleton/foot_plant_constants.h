#pragma once

namespace stridewire {

// Tuning constants of foot planting, shared by the scalar and the SIMD implementation. Names that
// end in M are in metres.

// Planting may extend a leg to kEasyExtension of its length, or as far as in the blended pose if
// that is longer. It never extends a leg beyond kLongestExtension of its length.
inline constexpr double kEasyExtension = 0.995;
inline constexpr double kLongestExtension = 0.9995;
// Planting lowers the root if a leg would exceed that limit. To avoid an abrupt start, it begins to
// lower the root earlier: when the leg would be longer than kFreeExtension and longer than in the
// blended pose, or when it is within kLeastRoom of the limit. All are fractions of the leg's
// length.
inline constexpr double kFreeExtension = 0.965;
inline constexpr double kLeastRoom = 0.001;
// If the legs require the root to be lowered by a and b, it is lowered by a smooth maximum of both,
// (a + b + sqrt((a - b)^2 + kLowerOverlap a b)) / 2.
inline constexpr double kLowerOverlap = 0.1;
// Smoothing distances of SmoothMax. They prevent abrupt changes of speed of the root and the feet
// when a limit becomes active.
inline constexpr double kSoftM = 0.002;
inline constexpr double kSoftGroundM = 0.006;
// A sole below the ground plane of a footprint is lifted out of it completely within a horizontal
// distance of kNearPrintM from the footprint. The lift fades to zero at kFarFromPrintM.
inline constexpr double kNearPrintM = 0.15;
inline constexpr double kFarFromPrintM = 0.35;
// If planting lifts a sole out of the ground, the root rises as well, but by less than this. If
// the root rose as far as the toes of a foot that pushes off, the body would rise and fall
// abruptly. The knee of that leg bends more instead.
inline constexpr double kRootFollowsLiftM = 0.01;
// During a swing, the ground plane that limits the foot changes from that of the old footprint to
// that of the new one. The change begins at kGroundBlendStart and takes kGroundBlendLength, as
// fractions of the swing.
inline constexpr double kGroundBlendStart = 0.3;
inline constexpr double kGroundBlendLength = 0.4;
// A foot that lands lower than it started descends after this fraction of the swing. A foot that
// lands higher finishes its rise by the same fraction before the end of the swing.
inline constexpr double kSinkStart = 0.35;
// The root of a body that steps down descends after this fraction of the movement. If the root
// descended earlier, the knee of the leg that swings above the higher tread would bend.
inline constexpr double kRootSinkStart = 0.25;
// A foot tilts with the slope of the ground on which it stands. From the middle of a swing until
// kLandingTiltStart, it tilts only by this fraction of the slope. Otherwise, the ankle of a bent
// leg would bend too far on ramps.
inline constexpr double kSwingTilt = 0.4;
// Fraction of the swing from which the tilt of the foot increases again, from kSwingTilt to the
// full slope at its footprint. The toes of a landing foot are already raised, so the slope of a
// ramp is added late.
inline constexpr double kLandingTiltStart = 0.75;
// A curve that rises from 0 to 1 between `begin` and `top`, and falls back to 0 between `falls` and
// `end`. All are fractions of the swing.
struct LiftCurve {
  double begin, top, falls, end;
};
// Curves of the additional lifts of a foot early, in the middle and late in its swing. If the foot
// grazes the edge of a tread at the start or end of the swing, a single curve for the whole swing
// would lift it far too high.
inline constexpr LiftCurve kLiftCurves[3] = {
    {0.0, 0.22, 0.22, 0.6}, {0.0, 0.35, 0.65, 1.0}, {0.4, 0.78, 0.78, 1.0}};
// The heading lock turns a standing foot to the heading of its footprint. Up to the flatness
// kHeelUp (LegPose::Flatness) it has no effect, and from kSoleDown on it has its full effect.
inline constexpr double kHeelUp = 0.5;
inline constexpr double kSoleDown = 0.8;
// Minimum duration of each half of a dip of the root (RootDip). Movement records may contain
// shorter ones.
inline constexpr double kLeastDipS = 1e-3;
// Angle between the heading of a standing foot and that of its footprint. Up to kAheadRad, the
// heading lock has its full effect, and from kReversedRad on it has none.
inline constexpr double kAheadRad = 1.0;
inline constexpr double kReversedRad = 2.0;

// If an ankle would be flexed (toes up) by more than kAnkleLimitRad beyond a right angle between
// shank and level sole, the foot turns about its ball, heel up. The turn grows with the excess: it
// begins gently over kAnkleSoftRad and then is kHeelRise times the excess. The factor is larger
// than 1, because a heel that rises also bends the knee, which flexes the ankle further.
inline constexpr double kAnkleLimitRad = 0.7;
inline constexpr double kAnkleSoftRad = 0.1;
inline constexpr double kHeelRise = 1.6;
// Sine and cosine of kAnkleLimitRad.
inline constexpr double kAnkleLimitSine = 0.644217687237691;
inline constexpr double kAnkleLimitCosine = 0.7648421872844885;

// A leg whose thigh or shank is shorter than this cannot be planted.
inline constexpr float kSmallestBoneM = 1e-3f;
// The axis of a knee is the normal of the leg's plane if the sine of the knee's bend exceeds
// kBentSine. A straighter knee has no reliable plane, so the knee's hinge (LegRig::Side::hinge) is
// added to the normal. The weight of the hinge rises from 0 at kBentSine to kReferenceWeight at
// kStraightSine.
inline constexpr float kStraightSine = 0.04f;
inline constexpr float kBentSine = 0.14f;
inline constexpr float kReferenceWeight = 0.1f;

}  // namespace stridewire
