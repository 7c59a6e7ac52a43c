#include "offline/capture/conventions.h"

#include <cmath>

#include "offline/base/text.h"
#include "offline/capture/file_axis.h"

namespace stridewire {
namespace {

constexpr double kShortestAgreedLegM = 0.5;
constexpr double kLongestAgreedLegM = 1.2;
constexpr double kSameUnit = 1e-3;  // Units differ if their ratio differs from 1 by more than this.

bool HasClearUp(const FileConventions& file) {
  return file.up_source == UpSource::kOption || file.up_source == UpSource::kRestPose;
}

// Returns the up axis that most files with the joint names of `of` have. Files whose axis was
// determined by an option or the rest pose take precedence over those whose motion determined it,
// and these over files whose axis was guessed. Earlier files win ties.
BvhAxis UpOfMost(std::span<const FileConventions> files, const FileConventions& of) {
  BvhAxis best = of.up;
  double best_votes = 0.0;
  for (const FileConventions& candidate : files) {
    if (candidate.joint_names != of.joint_names) continue;
    double votes = 0.0;
    for (const FileConventions& file : files) {
      if (file.up != candidate.up || file.joint_names != of.joint_names) continue;
      const double more_than_all = static_cast<double>(files.size()) + 1.0;
      if (HasClearUp(file)) votes += more_than_all * more_than_all;
      if (file.up_source == UpSource::kMotion) votes += more_than_all;
      votes += 1.0;
    }
    if (votes <= best_votes) continue;
    best = candidate.up;
    best_votes = votes;
  }
  return best;
}

}  // namespace

FileConventions ConventionsOf(const Capture& capture) {
  FileConventions file;
  file.path = capture.path;
  file.up = capture.up;
  file.up_source = capture.up_source;
  file.unit_m = capture.unit_m;
  file.unit_is_common = capture.unit_is_common;
  for (const Leg& leg : capture.skeleton.legs) {
    for (int j = leg.ankle; j != leg.hip; j = capture.skeleton.joints[Index(j)].parent) {
      file.leg_m += 0.5 * glm::length(DVec3(capture.skeleton.joints[Index(j)].offset_m));
    }
  }
  for (const Joint& joint : capture.skeleton.joints) file.joint_names.push_back(joint.name);
  return file;
}

std::vector<AgreedConventions> AgreeOnConventions(std::span<const FileConventions> files) {
  std::vector<AgreedConventions> agreed(files.size());
  double first_unit_m = 0.0;
  BvhAxis first_up = BvhAxis::kPlusY;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const FileConventions& file = files[i];
    AgreedConventions& result = agreed[i];
    const BvhAxis up = HasClearUp(file) ? file.up : UpOfMost(files, file);
    if (i == 0) first_up = up;
    if (up != file.up) {
      result.up = up;
      result.notes.push_back(Text(
          "up is taken as %s like in other files with these joints; this file alone suggests %s",
          AxisName(up), AxisName(file.up)));
    } else if (up != first_up) {
      result.notes.push_back(Text("up is %s, but %s in %.200s", AxisName(up), AxisName(first_up),
                                  files[0].path.c_str()));
    }
    double unit_m = file.unit_m;
    for (const FileConventions& other : files) {
      if (file.unit_is_common || !other.unit_is_common || other.joint_names != file.joint_names) {
        continue;
      }
      const double leg_m = file.leg_m / file.unit_m * other.unit_m;
      if (leg_m < kShortestAgreedLegM || leg_m > kLongestAgreedLegM) continue;
      unit_m = other.unit_m;
      result.unit_m = unit_m;
      result.notes.push_back(
          Text("one file unit is taken as %.5g m like in %.200s", unit_m, other.path.c_str()));
      break;
    }
    if (i == 0) first_unit_m = unit_m;
    if (std::fabs(unit_m / first_unit_m - 1.0) > kSameUnit) {
      result.notes.push_back(Text("one file unit is %.5g m, but %.5g m in %.200s", unit_m,
                                  first_unit_m, files[0].path.c_str()));
    }
  }
  return agreed;
}

}  // namespace stridewire
