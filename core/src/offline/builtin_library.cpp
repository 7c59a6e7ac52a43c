#include "stridewire/offline/builtin_library.h"

#include <array>

#include "builtin/figure.h"
#include "builtin/jump.h"
#include "builtin/mirror.h"
#include "builtin/step.h"

namespace stridewire {

RawLibrary GenerateBuiltinLibrary() {
  constexpr std::array kStepLengthsM = {0.0, 0.35, 0.55, 0.75};
  constexpr std::array kJumpLengthsM = {0.3, 0.7, 1.1, 1.5};

  RawLibrary library;
  library.skeleton = builtin::MakeFigure();
  library.stand_pose = Pose(library.skeleton.joint_count());
  builtin::StorePose(builtin::StandingPose(), library.stand_pose);

  RawGroup left{MovementKind::kStepLeft, {ParameterName::kStartZ, ParameterName::kEndZ}, {}};
  RawGroup right{MovementKind::kStepRight, left.parameters, {}};
  for (const double start_m : kStepLengthsM) {
    for (const double end_m : kStepLengthsM) {
      if (start_m == 0.0 && end_m == 0.0) continue;
      left.examples.push_back(builtin::MakeStep(library.skeleton, Foot::kLeft, start_m, end_m));
      right.examples.push_back(builtin::Mirrored(left.examples.back()));
    }
  }
  RawGroup jump{MovementKind::kJump, {ParameterName::kLength}, {}};
  for (const double length_m : kJumpLengthsM) {
    jump.examples.push_back(builtin::MakeJump(library.skeleton, length_m));
  }
  library.groups = {std::move(left), std::move(right), std::move(jump)};
  return library;
}

}  // namespace stridewire
