#include "stridewire/runtime/skeleton.h"

#include <cmath>
#include <unordered_set>

namespace stridewire {
namespace {

bool IsOffset(const Vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z) &&
         std::fabs(v.x) <= kMaxOffsetM && std::fabs(v.y) <= kMaxOffsetM &&
         std::fabs(v.z) <= kMaxOffsetM;
}

}  // namespace

int Skeleton::FindJoint(std::string_view name) const {
  for (int j = 0; j < joint_count(); ++j) {
    if (joints[static_cast<std::size_t>(j)].name == name) return j;
  }
  return -1;
}

Status Skeleton::Validate() const {
  const int count = joint_count();
  if (count < 1) return Fail(ErrorCode::kOutOfRange, "a skeleton has no joints");
  if (count > kMaxJoints) return Fail(ErrorCode::kOutOfRange, "too many joints", count);
  std::unordered_set<std::string_view> names;
  for (int j = 0; j < count; ++j) {
    const Joint& joint = joints[static_cast<std::size_t>(j)];
    if (j == 0 ? joint.parent != -1 : joint.parent < 0 || joint.parent >= j) {
      return Fail(ErrorCode::kOutOfRange, "a joint's parent must precede it", j);
    }
    if (!IsOffset(joint.offset_m)) {
      return Fail(ErrorCode::kInvalidArgument, "a joint's offset is not finite or is too large", j);
    }
    if (joint.name.empty() || !names.insert(joint.name).second) {
      return Fail(ErrorCode::kInvalidArgument, "a joint's name is empty or a duplicate", j);
    }
  }
  for (const EndSite& site : end_sites) {
    if (site.joint < 0 || site.joint >= count) {
      return Fail(ErrorCode::kOutOfRange, "an end site refers to a joint that does not exist",
                  site.joint);
    }
    if (!IsOffset(site.offset_m)) {
      return Fail(ErrorCode::kInvalidArgument, "an end site's offset is not finite or is too large",
                  site.joint);
    }
  }
  for (const Leg& leg : legs) {
    for (const int joint : {leg.hip, leg.knee, leg.ankle, leg.ball}) {
      if (joint < 0 || joint >= count) {
        return Fail(ErrorCode::kOutOfRange, "a leg refers to a joint that does not exist", joint);
      }
    }
    if (!IsOffset(leg.ball_offset_m) || !IsOffset(leg.toe_tip_offset_m)) {
      return Fail(ErrorCode::kInvalidArgument, "a foot's offset is not finite or is too large");
    }
  }
  return {};
}

}  // namespace stridewire
