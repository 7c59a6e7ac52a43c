#pragma once

#include <string>
#include <vector>

#include "offline/capture/bvh_file.h"
#include "offline/capture/leg_finder.h"
#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/runtime/clip.h"

namespace stridewire {

/// At least this number of frames is sampled to determine the directions and the shape of a figure,
/// or every frame if there are fewer.
inline constexpr int kSampledFrames = 64;

/// A joint below the root whose position channels are replaced with their mean.
struct AveragedJoint {
  int joint = 0;
  double deviation = 0.0;  ///< Largest distance from the mean in any frame, in file units.
};

/// The figure of a BVH file with its motion, in the axes and the unit of the file. ReadBvh
/// describes which joint is its root. The root contains the motion of all joints above it.
struct BvhFigure {
  std::vector<Joint> joints;
  std::vector<EndSite> end_sites;
  std::vector<int> joint_lines;     ///< Line number of each joint's OFFSET.
  std::vector<int> end_site_lines;  ///< Line number of each End Site's OFFSET.
  Clip clip;                        ///< Local rotations; its root positions are not set.
  std::vector<DVec3> roots;         ///< Root position in each frame.
  FoundLegs legs;
  /// Product of the constant rotations above the root, from the top joint down. It ends before the
  /// first joint whose rotation changes. FindFigureAxes determines whether the rest pose stands
  /// upright with or without it.
  DQuat fixed_turn = DQuat(1.0, 0.0, 0.0, 0.0);
  int first_frame = 0;  ///< Number of frames at the start that contain an artificial rest pose.
  std::vector<AveragedJoint> averaged;
  std::vector<std::string> notes;

  /// Returns the direction of the foot in the frame of its ankle: the vector to the toe joint, or
  /// to the farthest tip.
  [[nodiscard]] DVec3 FootVector(const FoundLeg& leg) const;
  /// Returns the offset of the farthest End Site or child of joint `of`, in the frame of the joint.
  [[nodiscard]] DVec3 FarthestTip(int of) const;

  /// Computes the positions and the world rotations of all joints. Frame -1 is the rest pose.
  void ComputePose(int frame, std::vector<DVec3>& positions, std::vector<DQuat>& rotations) const;
};

/// Selects the figure of a file by its legs and merges the joints above its root into the root. The
/// result contains neither other figures nor branches above the root that are no part of the body,
/// such as cameras. Releases the values of `file`. `fps` is the frame rate of the motion.
///
/// Errors: those of FindLegs, with `name` in Error::where. kInvalidArgument or kNotFound for an
/// option, with its name in Error::where.
[[nodiscard]] Expected<BvhFigure> MakeBvhFigure(BvhFile file, const std::string& name, double fps,
                                                const BvhReadOptions& options);

}  // namespace stridewire
