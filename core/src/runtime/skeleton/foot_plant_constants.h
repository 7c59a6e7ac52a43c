#pragma once

namespace stridewire {

// What planting is tuned by, shared by the plain and the fast code.

// A leg may always be as long as the blend has it, and anyway this part of its length.
inline constexpr double kEasyExtension = 0.995;
inline constexpr double kLongestExtension = 0.999;
// Roundness of maxima: the root goes down softly.
inline constexpr double kSoftM = 0.002;
inline constexpr double kSoftLowerM = 0.01;
inline constexpr double kSoftGroundM = 0.006;
// A foot this near to a print is kept out of its ground wholly, and this far from it not at all.
inline constexpr double kNearPrintM = 0.15;
inline constexpr double kFarFromPrintM = 0.35;
// The ground left gives way to the ground landed on from this part of the swing, over this part of it.
inline constexpr double kGroundFrom = 0.3;
inline constexpr double kGroundOver = 0.4;
// A foot that sinks does so from this part of the swing on; one that rises has risen so much before its end.
inline constexpr double kSinkFrom = 0.35;
// What a foot is lifted by comes and goes in this part of the swing at either end.
inline constexpr double kLiftEnds = 0.35;
// How flat a standing foot is (LegPose::Flatness) whose heading is held not at all, and wholly.
inline constexpr double kHeelUp = 0.5;
inline constexpr double kSoleDown = 0.8;

inline constexpr float kSmallestBoneM = 1e-3f;
// Below the smaller sine of the knee's bend its plane says nothing and the figure's own left-right axis takes over;
// above the larger the plane alone counts.
inline constexpr float kStraightSine = 0.04f;
inline constexpr float kBentSine = 0.14f;
inline constexpr float kReferenceWeight = 0.1f;

}  // namespace stridewire
