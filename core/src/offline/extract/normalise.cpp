#include "offline/extract/normalise.h"

#include "base/check.h"

namespace stridewire {

Clip NormaliseClip(const Clip& clip, const FrameRange& frames, double heading_rad,
                   double ground_m) {
  STRIDEWIRE_CHECK(frames.begin >= 0 && frames.size() > 0 && frames.end <= clip.frame_count());
  Clip out;
  out.fps = clip.fps;
  out.Resize(frames.size(), clip.joint_count);
  const DVec3 first(clip.root_positions_m[static_cast<std::size_t>(frames.begin)]);
  const DVec3 origin(first.x, ground_m, first.z);
  const Quat turn = YawRotation(-heading_rad);
  for (int f = 0; f < frames.size(); ++f) {
    const ConstPoseSpan from = clip.frame(frames.begin + f);
    const PoseSpan to = out.frame(f);
    to.root_position_m = Vec3(RotateYaw(-heading_rad, DVec3(from.root_position_m) - origin));
    to.rotations[0] = Normalise(turn * from.rotations[0]);
    for (std::size_t j = 1; j < to.rotations.size(); ++j) to.rotations[j] = from.rotations[j];
  }
  MakeSignContinuous(out);
  return out;
}

}  // namespace stridewire
