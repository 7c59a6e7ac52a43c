#include "offline/builtin/builtin_library.h"

#include <array>
#include <utility>

#include "offline/builtin/figure.h"
#include "offline/builtin/general_steps.h"
#include "offline/builtin/gestures.h"
#include "offline/builtin/jump.h"
#include "offline/builtin/step.h"

namespace stridewire {

RawLibrary GenerateBuiltinLibrary() {
  constexpr std::array kJumpLengthsM = {0.3, 0.7, 1.1, 1.5};

  RawLibrary library;
  library.skeleton = builtin::MakeFigure();
  library.stand_pose = Pose(library.skeleton.joint_count());
  builtin::StorePose(builtin::StandingPose(), library.stand_pose);

  builtin::AddStraightSteps(library);
  RawGroup jump{MovementKind::kJump, {ParameterName::kLength}, {}};
  for (const double length_m : kJumpLengthsM) {
    jump.examples.push_back(builtin::MakeJump(library.skeleton, length_m));
  }
  library.groups.push_back(std::move(jump));
  builtin::AddBackwardSteps(library);
  builtin::AddTurningSteps(library);
  builtin::AddSideSteps(library);
  builtin::AddClimbingSteps(library);
  builtin::AddGestures(library);
  return library;
}

}  // namespace stridewire
