#include "runtime/library/pose_quantization.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "runtime/skeleton/layer_clip.h"

namespace stridewire {
namespace {

// Margin that is added at each end of a component's range: kMarginOfWidth times its width, plus
// kMargin.
constexpr double kMarginOfWidth = 0.2;
constexpr double kMargin = 0.12;
// Replaces kMargin for hips, knees and ankles, because foot planting rotates them. On uneven
// ground, with short legs and in redirected swings, they rotate further than in the examples.
constexpr double kPlantedMargin = 0.3;
// A component that varies by less than kStillWidth counts as constant. Its margin, kStillMargin,
// only has to cover the quantization errors of the joints above it.
constexpr double kStillMargin = 0.0011;
constexpr double kStillWidth = 1e-4;
// Margin for the rotations of standing avatars, which play their loop unchanged. It only has to
// cover quantization errors.
constexpr double kIdleMargin = 0.0022;
// A joint is encoded with "smallest three", which does not limit rotations, if the w of one of its
// rotations in the library, relative to the reference, is below this.
constexpr double kMinBoundedW = 0.4;
// A joint whose mean rotation is below 9 degrees uses the identity as its reference. That saves the
// encoder a multiplication and needs no more bits.
constexpr float kSmallRotationW = 0.997f;

// Maximum error of a joint as an angle. Joints with children have the smaller limit, because their
// children have to compensate for the error.
constexpr double kMaxInnerErrorRad = 0.002;
constexpr double kMaxOuterErrorRad = 0.004;

// Maximum error of a joint relative to the root: 1 mm minus the root's own error (2^-15 m along
// each axis) and a small allowance for single precision.
constexpr double kMaxErrorToRootM = 0.001 - 0.0000529 - 0.00002;

// Calls `callback` with each rotation of a joint that occurs in a group.
template <typename Callback>
void ForEachRotation(const MotionLibrary& library, const MotionGroup& group, std::size_t joint,
                     const Callback& callback) {
  const auto row_floats = static_cast<std::size_t>(library.layout().row_floats);
  for (std::size_t row = 0; row < group.grid.size(); row += row_floats) {
    callback(DQuat(GridLayout::RotationOf(group.grid.data() + row, joint)));
  }
}

// Calls `callback` with each rotation of a joint that occurs in the library.
template <typename Callback>
void ForEachRotation(const MotionLibrary& library, std::size_t joint, const Callback& callback) {
  callback(DQuat(library.stand_pose().rotations[joint]));
  for (const MotionGroup& group : library.groups()) {
    ForEachRotation(library, group, joint, callback);
  }
  for (const LayerClip& layer : library.layers()) {
    const auto place = std::ranges::find(layer.joints, static_cast<int>(joint));
    if (place == layer.joints.end()) continue;
    for (auto at = static_cast<std::size_t>(4 * (place - layer.joints.begin()));
         at < layer.rotations.size(); at += 4 * layer.joints.size()) {
      const float* q = layer.rotations.data() + at;
      callback(DQuat(q[3], q[0], q[1], q[2]));
    }
  }
}

double DotOf(const DQuat& a, const DQuat& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
}

double LengthOf(const Vec3& v) {
  const DVec3 d(v);
  return std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
}

// Returns the hips, knees and ankles. Foot planting rotates them about any axis. It also rotates
// toes when it raises heels (decision 0056), but these have the usual margin.
std::vector<bool> PlantedJoints(const Skeleton& skeleton) {
  std::vector<bool> planted(skeleton.joints.size(), false);
  for (const Leg& leg : skeleton.legs) {
    for (const int joint : {leg.hip, leg.knee, leg.ankle}) {
      if (joint >= 0) planted[static_cast<std::size_t>(joint)] = true;
    }
  }
  return planted;
}

RotationRange RangeOf(const MotionLibrary& library, std::size_t joint, bool is_planted) {
  DQuat sum(0.0, 0.0, 0.0, 0.0);
  ForEachRotation(library, joint, [&](const DQuat& q) {
    const double sign = DotOf(sum, q) < 0.0 ? -1.0 : 1.0;
    sum = DQuat(sum.w + sign * q.w, sum.x + sign * q.x, sum.y + sign * q.y, sum.z + sign * q.z);
  });
  RotationRange range;
  range.reference = Normalise(Quat(static_cast<float>(sum.w), static_cast<float>(sum.x),
                                   static_cast<float>(sum.y), static_cast<float>(sum.z)));
  if (std::abs(range.reference.w) > kSmallRotationW) range.reference = kIdentityQuat;
  const DQuat back = glm::conjugate(DQuat(range.reference));
  DVec3 low(1.0);
  DVec3 high(-1.0);
  double least_w = 1.0;
  ForEachRotation(library, joint, [&](const DQuat& q) {
    const DQuat d = back * q;
    const double sign = d.w < 0.0 ? -1.0 : 1.0;
    const DVec3 v(sign * d.x, sign * d.y, sign * d.z);
    low = glm::min(low, v);
    high = glm::max(high, v);
    least_w = std::min(least_w, sign * d.w);
  });
  const DVec3 width = high - low;
  const double base_margin = is_planted ? kPlantedMargin : kMargin;
  for (int c = 0; c < 3; ++c) {
    const bool is_still = width[c] < kStillWidth && !is_planted;
    const double margin = is_still ? kStillMargin : kMarginOfWidth * width[c] + base_margin;
    range.low[c] = static_cast<float>(std::max(-1.0, low[c] - margin));
    range.high[c] = static_cast<float>(std::min(1.0, high[c] + margin));
  }
  if (least_w < kMinBoundedW) return range;
  const double widest = std::max({width.x, width.y, width.z});
  const bool is_rigid = widest < kStillWidth && !is_planted;
  const auto least_w_of = [](double sine) {
    constexpr auto kLeast = static_cast<double>(RotationQuantization::kMinLeastW);
    return std::sqrt(std::max(kLeast * kLeast, 1.0 - sine * sine));
  };
  range.least_w =
      least_w_of(std::sqrt(std::max(0.0, 1.0 - least_w * least_w)) +
                 (is_rigid ? 2.0 * kStillMargin : kMarginOfWidth * widest + base_margin));

  // The idle motion of standing avatars rotates joints that do not move in any example.
  if (!library.has_stand_motion()) return range;
  ForEachRotation(library, library.group(library.idle_group()), joint, [&](const DQuat& q) {
    const DQuat d = back * q;
    const double sign = d.w < 0.0 ? -1.0 : 1.0;
    const DVec3 v(sign * d.x, sign * d.y, sign * d.z);
    for (int c = 0; c < 3; ++c) {
      range.low[c] = std::min(range.low[c], static_cast<float>(v[c] - kIdleMargin));
      range.high[c] = std::max(range.high[c], static_cast<float>(v[c] + kIdleMargin));
    }
    range.least_w = std::min(range.least_w, least_w_of(glm::length(v) + 2.0 * kIdleMargin));
  });
  return range;
}

// Distributes bits over the components of all joints. Each bit goes to the component for which it
// most reduces the error of the least accurate joint or end site.
class BitAllocator {
 public:
  BitAllocator(const Skeleton& skeleton, std::span<const RotationRange> ranges, double max_error_m)
      : ranges_(ranges), max_error_m_(max_error_m), joints_(ranges.size()) {
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      Joint& joint = joints_[j];
      joint.is_unbounded =
          ranges[j].least_w < static_cast<double>(RotationQuantization::kMinLeastW);
      if (joint.is_unbounded) joint.bits = {RotationQuantization::kMinFreeBits, 0, 0};
      joint.angle_rad = AngleOf(j, joint.bits);
      joint.max_error_rad = kMaxOuterErrorRad;
    }
    for (std::size_t j = 1; j < joints_.size(); ++j) {
      joints_[static_cast<std::size_t>(skeleton.joints[j].parent)].max_error_rad =
          kMaxInnerErrorRad;
    }
    std::vector<bool> has_end(joints_.size(), false);
    for (const EndSite& site : skeleton.end_sites) {
      AddChain(skeleton, site.joint, LengthOf(site.offset_m));
      has_end[static_cast<std::size_t>(site.joint)] = true;
    }
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      if (joints_[j].max_error_rad == kMaxOuterErrorRad && !has_end[j]) {
        AddChain(skeleton, static_cast<int>(j), 0.0);
      }
    }
  }

  void Allocate() {
    while (AddBit()) {
    }
    // Removes unnecessary bits.
    for (std::size_t j = joints_.size(); j-- > 0;) {
      for (std::size_t c = 0; c < 3; ++c) {
        while (RemoveBit(j, c)) {
        }
      }
    }
  }

  [[nodiscard]] PoseQuantization Result() const {
    PoseQuantization code;
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      RotationQuantization& rotation = code.joints.emplace_back();
      if (joints_[j].is_unbounded) {
        rotation.smallest_three_bits = joints_[j].bits[0];
        rotation.least_w = RotationQuantization::kMinLeastW;
        continue;
      }
      const RotationRange& range = ranges_[j];
      rotation.reference = range.reference;
      rotation.bits = joints_[j].bits;
      rotation.least_w = static_cast<float>(range.least_w);
      for (int c = 0; c < 3; ++c) {
        const double step = StepOf(j, c, rotation.bits[static_cast<std::size_t>(c)]);
        rotation.step[c] = static_cast<float>(step);
        rotation.low[c] = static_cast<float>(static_cast<double>(range.low[c]) + 0.5 * step);
      }
    }
    for (const Chain& chain : chains_) {
      code.largest_error_m = std::max(code.largest_error_m, ErrorOf(chain));
    }
    return code;
  }

 private:
  using Bits = std::array<std::uint8_t, 3>;
  struct Joint {
    bool is_unbounded = false;
    Bits bits{};
    double angle_rad = 0.0;
    double max_error_rad = 0.0;
    std::vector<std::size_t> chains;  // Indices of the chains that contain this joint.
  };
  struct Bone {
    std::size_t joint = 0;
    double length_m = 0.0;
  };
  using Chain = std::vector<Bone>;

  void AddChain(const Skeleton& skeleton, int joint, double length_m) {
    Chain& chain = chains_.emplace_back();
    while (joint >= 0) {
      joints_[static_cast<std::size_t>(joint)].chains.push_back(chains_.size() - 1);
      chain.push_back({static_cast<std::size_t>(joint), length_m});
      length_m = LengthOf(skeleton.joints[static_cast<std::size_t>(joint)].offset_m);
      joint = skeleton.joints[static_cast<std::size_t>(joint)].parent;
    }
  }

  [[nodiscard]] double ErrorOf(const Chain& chain) const {
    double sum = 0.0;
    for (const Bone& bone : chain) sum += bone.length_m * joints_[bone.joint].angle_rad;
    return sum;
  }

  [[nodiscard]] double StepOf(std::size_t joint, int component, int bits) const {
    const RotationRange& range = ranges_[joint];
    return (static_cast<double>(range.high[component]) -
            static_cast<double>(range.low[component])) /
           static_cast<double>(1 << bits);
  }

  // Returns the maximum error of a quantized rotation in radians. If components have errors of half
  // a step, then w, which is computed from them, has an error of half a step times |v| / w.
  [[nodiscard]] double AngleOf(std::size_t joint, const Bits& bits) const {
    if (joints_[joint].is_unbounded) {
      // The error is largest if all four components are 0.5. Then each of the three encoded
      // components has an error of half of sqrt(1/2) / (2^(b - 1) - 1), and the fourth has an error
      // of the sum of these.
      return std::sqrt(6.0) / static_cast<double>((1 << (bits[0] - 1)) - 1);
    }
    double squared = 0.0;
    for (int c = 0; c < 3; ++c) {
      const double step = StepOf(joint, c, bits[static_cast<std::size_t>(c)]);
      squared += 0.25 * step * step;
    }
    // The decoded rotation may have a slightly smaller w than the original.
    return 2.0 * std::sqrt(squared) / (ranges_[joint].least_w - 0.005);
  }

  [[nodiscard]] bool CanAddBit(std::size_t j, std::size_t component) const {
    const Joint& joint = joints_[j];
    const int bits = joint.bits[component];
    if (joint.is_unbounded) return component == 0 && bits < RotationQuantization::kMaxFreeBits;
    return bits < RotationQuantization::kMaxBits &&
           StepOf(j, static_cast<int>(component), bits + 1) >=
               static_cast<double>(RotationQuantization::kMinStep);
  }

  // Finds the component whose error decreases most with one more bit. Returns the decrease in
  // radians per bit, or -1 if no component can take more bits.
  double BestComponent(std::size_t j, std::size_t& component) const {
    const Joint& joint = joints_[j];
    double best = -1.0;
    for (std::size_t c = 0; c < 3; ++c) {
      if (!CanAddBit(j, c)) continue;
      Bits more = joint.bits;
      ++more[c];
      const double gain = (joint.angle_rad - AngleOf(j, more)) / (joint.is_unbounded ? 3.0 : 1.0);
      if (gain <= best) continue;
      best = gain;
      component = c;
    }
    return best;
  }

  bool AddBit() {
    std::size_t joint = 0;
    std::size_t component = 0;
    double best = 0.0;
    const Chain* worst = nullptr;
    double worst_m = max_error_m_;
    for (const Chain& chain : chains_) {
      if (const double error_m = ErrorOf(chain); error_m > worst_m) {
        worst = &chain;
        worst_m = error_m;
      }
    }
    const auto consider = [&](std::size_t j, double weight) {
      std::size_t c = 0;
      const double gain = BestComponent(j, c) * weight;
      if (gain <= best) return;
      best = gain;
      joint = j;
      component = c;
    };
    if (worst != nullptr) {
      for (const Bone& bone : *worst) consider(bone.joint, bone.length_m);
    }
    if (best <= 0.0) {
      for (std::size_t j = 0; j < joints_.size(); ++j) {
        if (joints_[j].angle_rad > joints_[j].max_error_rad) consider(j, 1.0);
      }
    }
    if (best <= 0.0) return false;
    ++joints_[joint].bits[component];
    joints_[joint].angle_rad = AngleOf(joint, joints_[joint].bits);
    return true;
  }

  bool RemoveBit(std::size_t j, std::size_t component) {
    Joint& joint = joints_[j];
    const int least = joint.is_unbounded ? int{RotationQuantization::kMinFreeBits} : 0;
    if ((joint.is_unbounded && component > 0) || joint.bits[component] <= least) return false;
    const double before_rad = joint.angle_rad;
    --joint.bits[component];
    joint.angle_rad = AngleOf(j, joint.bits);
    const bool is_enough = joint.angle_rad <= joint.max_error_rad &&
                           std::ranges::all_of(joint.chains, [&](std::size_t c) {
                             return ErrorOf(chains_[c]) <= max_error_m_;
                           });
    if (is_enough) return true;
    ++joint.bits[component];
    joint.angle_rad = before_rad;
    return false;
  }

  std::span<const RotationRange> ranges_;
  double max_error_m_;
  std::vector<Joint> joints_;
  std::vector<Chain> chains_;  // Chains of joints from each leaf to the root.
};

}  // namespace

std::vector<RotationRange> FindRotationRanges(const MotionLibrary& library) {
  std::vector<RotationRange> ranges(static_cast<std::size_t>(library.skeleton().joint_count()));
  const std::vector<bool> planted = PlantedJoints(library.skeleton());
  for (std::size_t j = 1; j < ranges.size(); ++j) ranges[j] = RangeOf(library, j, planted[j]);
  return ranges;
}

PoseQuantization ChoosePoseQuantization(const Skeleton& skeleton,
                                        std::span<const RotationRange> ranges,
                                        double largest_error_m) {
  STRIDEWIRE_CHECK(ranges.size() == skeleton.joints.size());
  BitAllocator allocator(skeleton, ranges, largest_error_m);
  allocator.Allocate();
  return allocator.Result();
}

std::vector<std::uint16_t> ChooseReducedJoints(const Skeleton& skeleton,
                                               std::span<const RotationRange> ranges,
                                               double largest_shift_m) {
  STRIDEWIRE_CHECK(ranges.size() == skeleton.joints.size());
  const std::size_t count = ranges.size();
  std::vector<double> reach_m(count, 0.0);  // Length of the longest chain below each joint.
  for (const EndSite& site : skeleton.end_sites) {
    double& reach = reach_m[static_cast<std::size_t>(site.joint)];
    reach = std::max(reach, LengthOf(site.offset_m));
  }
  std::vector<double> shift_m(count, 0.0);
  std::vector<double> below_m(count, 0.0);  // Maximum shift of any child of each joint.
  for (std::size_t j = count; j-- > 0;) {
    const RotationRange& range = ranges[j];
    double squared = 0.0;
    for (int c = 0; c < 3; ++c) {
      const double largest = std::max(std::abs(static_cast<double>(range.low[c])),
                                      std::abs(static_cast<double>(range.high[c])));
      squared += largest * largest;
    }
    const double sine = std::sqrt(std::min(squared, 1.0 - range.least_w * range.least_w));
    shift_m[j] = 2.0 * sine * reach_m[j] + below_m[j];
    if (j == 0) break;
    const auto parent = static_cast<std::size_t>(skeleton.joints[j].parent);
    reach_m[parent] = std::max(reach_m[parent], LengthOf(skeleton.joints[j].offset_m) + reach_m[j]);
    below_m[parent] = std::max(below_m[parent], shift_m[j]);
  }
  std::vector<std::uint16_t> chosen;
  for (std::size_t j = 0; j < count; ++j) {
    if (j == 0 || shift_m[j] > largest_shift_m) chosen.push_back(static_cast<std::uint16_t>(j));
  }
  return chosen;
}

std::vector<std::uint16_t> ChooseReducedJoints(const MotionLibrary& library) {
  return ChooseReducedJoints(library.skeleton(), FindRotationRanges(library), kReducedJointsShiftM);
}

PoseQuantization ChoosePoseQuantization(const MotionLibrary& library) {
  return ChoosePoseQuantization(library.skeleton(), FindRotationRanges(library), kMaxErrorToRootM);
}

}  // namespace stridewire
