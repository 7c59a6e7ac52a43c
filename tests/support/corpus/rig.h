#pragma once

#include <array>
#include <string>
#include <vector>

#include "corpus/figure.h"
#include "random.h"

namespace stridewire::test {

/// The position channels of a joint in a BVH file.
enum class Channels { kRotation, kPositionAndRotation };

struct RigJoint {
  std::string name;
  int named_after = -1;  ///< The part of the figure that NameJoints derives the name from, or -1.
  std::string suffix;    ///< Part of the derived name: "Twist", "Index1"; empty for parts.
  int parent = -1;       ///< -1: a ROOT.
  DVec3 offset = DVec3(0.0);     ///< In the frame of the parent.
  std::vector<DQuat> rotations;  ///< Relative to the parent, one per frame.
  std::vector<DVec3> positions;  ///< One per frame; empty: the joint stays at its offset.
  std::vector<DVec3> end_sites;  ///< In the frame of the joint.
  Channels channels = Channels::kRotation;
};

/// The motion of a figure, represented by the joints of a character rig. The functions below change
/// the representation. They change world positions of the figure's joints only if their comments
/// say so.
struct Rig {
  double fps = 30.0;
  std::vector<RigJoint> joints;       ///< Parents first.
  std::array<int, kPartCount> parts;  ///< Joint of each part of the figure; -1: none.

  [[nodiscard]] int frame_count() const {
    return static_cast<int>(joints.front().rotations.size());
  }
  [[nodiscard]] RigJoint& Of(Part part) {
    return joints[static_cast<std::size_t>(parts[static_cast<std::size_t>(part)])];
  }
  /// World positions of all joints in one frame.
  [[nodiscard]] std::vector<DVec3> Positions(int frame) const;
};

/// Returns a rig with one joint per part of the figure, whose root is the pelvis.
[[nodiscard]] Rig MakeRig(const Figure& figure, const FigureMotion& motion);

/// Places in which AddTwistJoints inserts joints.
enum class TwistPlace {
  kInside,  ///< Between hip and knee and between knee and ankle.
  kBeside   ///< As additional children of the leg joints, without children of their own.
};
/// Adds joints that only twist. If they are inside the leg, they receive half of its twist.
void AddTwistJoints(TwistPlace place, Rig& rig);

void RemoveToes(bool with_end_site, Rig& rig);
/// Adds two fingers of three joints to each hand.
void AddFingers(Rig& rig);
/// Removes a leg and everything below it.
void RemoveLeg(int foot, Rig& rig);

/// Joints that AddRoots adds above the hips.
enum class Roots {
  kStatic,      ///< A joint that never moves.
  kRotated,     ///< A joint that never moves, rotated by -90 degrees about x, at some offset.
  kTrajectory,  ///< A joint that moves along the floor; the hips move relative to it.
  kSplit        ///< Three joints: one for the position, one for the heading, one for the rest.
};
void AddRoots(Roots roots, Rig& rig);

/// Adds a joint below the right hand, or a second ROOT that moves on its own.
void AddPropInHand(Rig& rig);
void AddSecondRoot(Rig& rig);

/// Constant rotations by which ReFrame turns the frames of joints.
enum class Frames {
  kLegsDown,    ///< Leg joints turned by 180 degrees about z: legs point up in the rest pose.
  kLegsAside,   ///< Leg joints turned by 90 degrees about y.
  kAlongBones,  ///< The x axis of each joint points along its bone.
  kQuarters,    ///< Random turns by multiples of 90 degrees.
  kRandom       ///< Any random rotation.
};
/// Multiplies each joint's frame by a constant rotation. Changes the rest pose, not the motion.
void ReFrame(Frames frames, Random& random, Rig& rig);

/// Turns the whole world: positions become `turn` times their old value, and the rest pose turns as
/// well.
void TurnWorld(const DQuat& turn, Rig& rig);
/// Shifts the whole motion in the world.
void Translate(const DVec3& by_m, Rig& rig);
/// Multiplies all lengths.
void Scale(double factor, Rig& rig);
/// Inserts frames in the rest pose at the origin.
void InsertRestFrames(int count, Rig& rig);
/// Adds smooth random rotations of this amplitude to all joints except the hips. Moves the feet by
/// millimetres.
void AddNoise(double amplitude_rad, Random& random, Rig& rig);
/// Turns a forearm by 120 degrees for a single frame.
void FlipForearm(int frame, Rig& rig);

}  // namespace stridewire::test
