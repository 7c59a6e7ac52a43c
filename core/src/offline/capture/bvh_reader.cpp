#include "stridewire/offline/bvh_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/mat3x3.hpp>
#include <numbers>
#include <system_error>

#include "base/check.h"
#include "base/trig.h"
#include "offline/base/text.h"
#include "offline/capture/bvh_file.h"
#include "offline/capture/leg_finder.h"

// Conversion from the axes and the unit of a file to ours. Let W be the rotation of the world that
// turns up to +Y, and B the rotation of the joint frames that makes the resting figure face +Z:
//
//   root'    = unit W root        R_root' = W R_root B^-1
//   offset'  = unit B offset      R_joint' = B R_joint B^-1
//
// Every world position is then the position in the file, rotated by W and scaled to metres.

namespace stridewire {
namespace {

constexpr double kSnapCos = 0.906;  // Directions within 25 degrees of an axis snap to it.
// Number of frames that are sampled to determine directions.
constexpr int kSampledFrames = 64;
constexpr double kFastTurnRadS = 10.5;   // 600 degrees/s.
constexpr double kStandingHipsM = 0.95;  // Hip height of a standing adult.
constexpr double kSlowestFeetMS2 = 6.0;  // See NoteSlowMotion.
constexpr double kMinTravelM = 0.15;
// An End Site nearer than this to the ankle is the ball of the foot; in leg lengths.
constexpr double kFootEndIsBall = 0.2;
constexpr double kBallShare = 2.0 / 3.0;  // Position of the ball between ankle and toe tip.

struct KnownUnit {
  double m;
  const char* name;
};
constexpr KnownUnit kKnownUnits[] = {
    {1.0, "1 m"},       {0.3048, "1 foot"}, {0.1, "1 dm"},  {0.0254 / 0.45, "1/0.45 inch"},
    {0.0254, "1 inch"}, {0.01, "1 cm"},     {0.001, "1 mm"}};
constexpr double kTypicalLegM = 0.83;
constexpr double kShortestLegM = 0.68;
constexpr double kLongestLegM = 1.0;

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

DVec3 AxisVector(BvhAxis axis) {
  DVec3 v(0.0);
  const int i = static_cast<int>(axis);
  v[i / 2] = i % 2 == 0 ? 1.0 : -1.0;
  return v;
}

// Returns the signed axis nearest to `v`.
DVec3 NearestAxis(const DVec3& v) {
  int largest = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::fabs(v[i]) > std::fabs(v[largest])) largest = i;
  }
  DVec3 axis(0.0);
  axis[largest] = v[largest] < 0.0 ? -1.0 : 1.0;
  return axis;
}

const char* AxisName(const DVec3& v) {
  static constexpr const char* kNames[] = {"+x", "-x", "+y", "-y", "+z", "-z"};
  for (int i = 0; i < 3; ++i) {
    if (v[i] > 0.999) return kNames[2 * i];
    if (v[i] < -0.999) return kNames[2 * i + 1];
  }
  return "an oblique axis";
}

DVec3 Unit(const DVec3& v) {
  const double length = glm::length(v);
  return length > 1e-12 ? v / length : DVec3(0.0);
}

DVec3 SnapAxis(const DVec3& v) {
  const DVec3 axis = NearestAxis(v);
  return glm::dot(Unit(v), axis) >= kSnapCos ? axis : Unit(v);
}

DQuat AxisTurn(int axis, double degrees) {
  // remainder() is exact and reduces the argument to the range of our trigonometry.
  const double half = std::remainder(degrees, 720.0) * (0.5 * std::numbers::pi / 180.0);
  DQuat q(Cos(half), 0.0, 0.0, 0.0);
  (axis == 0 ? q.x : axis == 1 ? q.y : q.z) = Sin(half);
  return q;
}

// Returns the rotation that takes `left`, `up` and `left` x `up` to +X, +Y and +Z.
DQuat TurnToOurAxes(const DVec3& left, const DVec3& up) {
  const DVec3 forward = glm::cross(left, up);
  return glm::normalize(glm::quat_cast(glm::transpose(glm::dmat3(left, up, forward))));
}

class Reader {
 public:
  Reader(BvhFile file, std::string name, const BvhReadOptions& options)
      : file_(std::move(file)), name_(std::move(name)), options_(options) {}

  Expected<Capture> Run() {
    capture_.path = name_;
    capture_.notes = std::move(file_.notes);
    for (const auto step :
         {&Reader::SetFrameRate, &Reader::BuildSkeleton, &Reader::BuildClip, &Reader::FindLegs,
          &Reader::FindAxes, &Reader::FindUnit, &Reader::Convert}) {
      if (Status status = (this->*step)(); !status)
        return std::unexpected(std::move(status.error()));
    }
    return std::move(capture_);
  }

 private:
  std::string LineOf(int line) const { return name_ + ':' + std::to_string(line); }
  void Note(std::string text) { capture_.notes.push_back(std::move(text)); }
  const std::vector<Joint>& joints() const { return capture_.skeleton.joints; }
  const Joint& joint(int j) const { return joints()[Index(j)]; }

  Status SetFrameRate() {
    if (options_.fps) {
      if (!(*options_.fps > 0.0 && *options_.fps <= 10000.0)) {
        return Fail(ErrorCode::kInvalidArgument,
                    "expected a number of frames per second above 0 and at most 10000", "fps");
      }
      capture_.clip.fps = *options_.fps;
      return {};
    }
    const double frame_time = file_.frame_time_s;
    if (!(frame_time >= 1e-4 && frame_time <= 10.0)) {
      return Fail(ErrorCode::kOutOfRange, "Frame Time: expected 0.0001 to 10 seconds",
                  LineOf(file_.frame_time_line));
    }
    double fps = 1.0 / frame_time;
    const double whole = std::nearbyint(fps);
    if (whole >= 1.0 && std::fabs(1.0 / whole - frame_time) < file_.frame_time_digit_s &&
        std::fabs(fps - whole) < 2e-3 * whole) {
      fps = whole;
    }
    capture_.clip.fps = std::min(fps, 10000.0);
    return {};
  }

  Status BuildSkeleton() {
    for (const BvhJoint& source : file_.joints) {
      capture_.skeleton.joints.push_back({source.name, source.parent, Vec3(source.offset)});
    }
    capture_.skeleton.joints[0].offset_m = Vec3(0.0f);
    for (const BvhEndSite& site : file_.end_sites) {
      capture_.skeleton.end_sites.push_back({site.joint, Vec3(site.offset)});
    }
    // Replaces the offsets of joints other than the root by the mean of their position channels.
    for (std::size_t j = 1; j < file_.joints.size(); ++j) {
      const BvhJoint& source = file_.joints[j];
      DVec3 mean = source.offset;
      DVec3 largest(0.0);
      double deviation = 0.0;
      bool has_positions = false;
      for (std::size_t c = 0; c < source.channels.size(); ++c) {
        if (source.channels[c].is_rotation) continue;
        has_positions = true;
        const int axis = source.channels[c].axis;
        double sum = 0.0;
        for (int f = 0; f < file_.frame_count; ++f) {
          const double value = ValueAt(f, source.first_channel + static_cast<int>(c));
          sum += value;
          largest[axis] = std::max(largest[axis], std::fabs(value));
        }
        mean[axis] = sum / file_.frame_count;
        for (int f = 0; f < file_.frame_count; ++f) {
          const double value = ValueAt(f, source.first_channel + static_cast<int>(c));
          deviation = std::max(deviation, std::fabs(value - mean[axis]));
        }
      }
      if (!has_positions || largest == DVec3(0.0)) continue;
      capture_.skeleton.joints[j].offset_m = Vec3(mean);
      ++positioned_joints_;
      if (deviation > position_deviation_) {
        position_deviation_ = deviation;
        position_joint_ = static_cast<int>(j);
      }
    }
    return {};
  }

  double ValueAt(int frame, int channel) const {
    return file_.values[Index(frame) * Index(file_.channel_count) + Index(channel)];
  }

  // The clip is still in the axes and the unit of the file.
  Status BuildClip() {
    Clip& clip = capture_.clip;
    clip.Resize(file_.frame_count, static_cast<int>(file_.joints.size()));
    roots_.resize(Index(file_.frame_count));
    bool root_moves = false;
    for (const BvhChannel& channel : file_.joints[0].channels) root_moves |= !channel.is_rotation;
    if (!root_moves) Note("the root has no position channels and stays at its OFFSET");
    for (int f = 0; f < file_.frame_count; ++f) {
      const PoseSpan pose = clip.frame(f);
      DVec3& root = roots_[Index(f)];
      root = file_.joints[0].offset;
      for (std::size_t j = 0; j < file_.joints.size(); ++j) {
        const BvhJoint& source = file_.joints[j];
        DQuat rotation(1.0, 0.0, 0.0, 0.0);
        for (std::size_t c = 0; c < source.channels.size(); ++c) {
          const double value = ValueAt(f, source.first_channel + static_cast<int>(c));
          const BvhChannel& channel = source.channels[c];
          if (channel.is_rotation) {
            rotation = rotation * AxisTurn(channel.axis, value);
          } else if (j == 0) {
            root[channel.axis] = value;
          }
        }
        pose.rotations[j] = Quat(glm::normalize(rotation));
      }
    }
    file_.values = {};
    MakeSignContinuous(clip);
    FindFirstFrame();
    return {};
  }

  // Returns the number of joints that turn between frames `f` and `f` + 1 faster than people can.
  int FastJoints(int f) const {
    const Clip& clip = capture_.clip;
    int fast = 0;
    for (std::size_t j = 0; j < joints().size(); ++j) {
      fast += AngleBetween(clip.frame(f).rotations[j], clip.frame(f + 1).rotations[j]) * clip.fps >
              kFastTurnRadS;
    }
    return fast;
  }

  void FindFirstFrame() {
    const Clip& clip = capture_.clip;
    if (clip.frame_count() < 3) return;
    int jumping = 0;
    for (std::size_t j = 0; j < joints().size(); ++j) {
      const double first = AngleBetween(clip.frame(0).rotations[j], clip.frame(1).rotations[j]);
      const double second = AngleBetween(clip.frame(1).rotations[j], clip.frame(2).rotations[j]);
      jumping += first > std::numbers::pi / 18.0 && first > 8.0 * second;
    }
    // Some programs blend from the artificial pose into the motion. Then no joint jumps, but the
    // root starts with exactly no rotation and many joints turn fast.
    const bool root_at_rest = AngleBetween(clip.frame(0).rotations[0], kIdentityQuat) < 1e-6 &&
                              AngleBetween(clip.frame(1).rotations[0], kIdentityQuat) > 1e-3;
    if (jumping < 4 && !(root_at_rest && FastJoints(0) >= 4)) return;
    int first = 1;
    const int last = std::min(static_cast<int>(0.1 * clip.fps), clip.frame_count() - 2);
    while (first < last && FastJoints(first) >= 2) ++first;
    STRIDEWIRE_CHECK(first >= 1 && first < clip.frame_count());
    capture_.first_frame = first;
    Note(Text("skipped %d frame%s at the start: an artificial pose that %d joints leave too fast",
              first, first == 1 ? "" : "s", std::max(jumping, FastJoints(0))));
  }

  Status FindLegs() {
    const bool given = !options_.left_ankle.empty() || !options_.right_ankle.empty();
    if (given) {
      for (int side = 0; side < 2; ++side) {
        const char* option = side == 0 ? "left_ankle" : "right_ankle";
        const std::string& ankle_name = side == 0 ? options_.left_ankle : options_.right_ankle;
        const int ankle = capture_.skeleton.FindJoint(ankle_name);
        if (ankle < 0)
          return Fail(ErrorCode::kNotFound, "the file has no joint with this name", option);
        if (!FindLegAbove(joints(), ankle, found_.legs[side])) {
          return Fail(ErrorCode::kInvalidArgument,
                      "expected a joint with a knee and a hip above it", option);
        }
      }
      if (found_.legs[0].hip == found_.legs[1].hip) {
        return Fail(ErrorCode::kInvalidArgument, "both ankles belong to the same leg",
                    "right_ankle");
      }
    } else if (FindLegsByName(joints(), found_)) {
      // Detection by shape gets a note; detection by names is the normal case and needs none.
    } else if (FindLegsByShape(joints(), found_)) {
      Note("legs were detected by shape, since the joint names do not identify them");
    } else {
      return Fail(ErrorCode::kUnsupported,
                  "no pair of legs was found; name both ankle joints with options", name_);
    }
    for (int side = 0; side < 2; ++side) {
      const std::string& ball_name = side == 0 ? options_.left_ball : options_.right_ball;
      if (ball_name.empty()) continue;
      const char* option = side == 0 ? "left_ball" : "right_ball";
      const int ball = capture_.skeleton.FindJoint(ball_name);
      if (ball < 0) {
        return Fail(ErrorCode::kNotFound, "the file has no joint with this name", option);
      }
      int above = ball;
      while (above > found_.legs[side].ankle) above = joint(above).parent;
      if (above != found_.legs[side].ankle) {
        return Fail(ErrorCode::kInvalidArgument, "expected a joint below the ankle", option);
      }
      found_.legs[side].ball = ball;
    }
    return {};
  }

  // Computes the positions of all joints; frame -1 is the rest pose with identity rotations.
  void ComputePositions(int frame, std::vector<DVec3>& positions) {
    positions.resize(joints().size());
    world_.resize(joints().size());
    for (std::size_t j = 0; j < joints().size(); ++j) {
      const DQuat local =
          frame < 0 ? DQuat(1.0, 0.0, 0.0, 0.0) : DQuat(capture_.clip.frame(frame).rotations[j]);
      if (j == 0) {
        world_[0] = local;
        positions[0] = frame < 0 ? DVec3(0.0) : roots_[Index(frame)];
        continue;
      }
      const std::size_t parent = Index(joints()[j].parent);
      world_[j] = world_[parent] * local;
      positions[j] = positions[parent] + world_[parent] * DVec3(joints()[j].offset_m);
    }
  }

  // Returns the direction of the foot in the frame of its ankle: the vector to the toe joint, or to
  // the farthest tip.
  DVec3 FootVector(const FoundLeg& leg) const {
    if (leg.ball >= 0) {
      DVec3 v(0.0);
      for (int j = leg.ball; j != leg.ankle; j = joint(j).parent) v += DVec3(joint(j).offset_m);
      return v;
    }
    return FarthestTip(leg.ankle);
  }

  DVec3 FarthestTip(int of) const {
    DVec3 tip(0.0);
    const auto take = [&](const Vec3& v) {
      if (glm::length(DVec3(v)) > glm::length(tip)) tip = DVec3(v);
    };
    for (const EndSite& site : capture_.skeleton.end_sites) {
      if (site.joint == of) take(site.offset_m);
    }
    for (const Joint& j : joints()) {
      if (j.parent == of) take(j.offset_m);
    }
    return tip;
  }

  Status FindAxes() {
    std::vector<DVec3> p;
    const auto legs_up = [&] {
      DVec3 sum(0.0);
      for (const FoundLeg& leg : found_.legs) sum += p[Index(leg.hip)] - p[Index(leg.ankle)];
      return Unit(sum);
    };

    ComputePositions(-1, p);
    const DVec3 rest_direction = legs_up();
    DVec3 rest_up = NearestAxis(rest_direction);
    // The rest pose determines the up axis if its legs hang straight and the rest of the body is
    // above them.
    const DVec3 hips = 0.5 * (p[Index(found_.legs[0].hip)] + p[Index(found_.legs[1].hip)]);
    DVec3 body(0.0);
    for (int j = 1; j < static_cast<int>(joints().size()); ++j) {
      int top = j;
      while (top > 0 && top != found_.legs[0].hip && top != found_.legs[1].hip)
        top = joint(top).parent;
      if (top <= 0) body += p[Index(j)] - hips;
    }
    const bool rest_stands =
        glm::dot(rest_direction, rest_up) >= 0.8 && glm::dot(body, rest_up) >= 0.0;

    // The motion determines the up axis if the legs are below the hips on average.
    const int frames = capture_.clip.frame_count() - capture_.first_frame;
    DVec3 motion_sum(0.0);
    const int step = std::max(1, frames / kSampledFrames);
    int sampled = 0;
    for (int f = capture_.first_frame; f < capture_.clip.frame_count(); f += step, ++sampled) {
      ComputePositions(f, p);
      motion_sum += legs_up();
    }
    const DVec3 motion_direction = motion_sum / static_cast<double>(sampled);
    const DVec3 motion_up = NearestAxis(motion_direction);

    DVec3 world_up(0.0, 1.0, 0.0);
    if (options_.up) {
      world_up = AxisVector(*options_.up);
    } else if (glm::dot(motion_direction, motion_up) >= 0.85) {
      world_up = motion_up;
    } else if (rest_stands) {
      world_up = rest_up;
      Note(Text("up is taken as %s from the rest pose; the motion is inconclusive",
                AxisName(rest_up)));
    } else {
      Note("up is taken as +y; rest pose and motion are inconclusive");
    }
    if (!options_.up && world_up != DVec3(0.0, 1.0, 0.0)) {
      Note(Text("the up axis of the file is %s; the motion was turned to +y", AxisName(world_up)));
    }
    if (!rest_stands) {
      // In rigs whose bones are all parallel at rest, up is the mean world up in the frame of the
      // root over the motion.
      DVec3 sum(0.0);
      for (int f = capture_.first_frame; f < capture_.clip.frame_count(); f += step) {
        sum += glm::conjugate(DQuat(capture_.clip.frame(f).rotations[0])) * world_up;
      }
      rest_up = SnapAxis(sum);
      if (rest_up == DVec3(0.0)) rest_up = world_up;
      Note(
          "the rest pose does not stand; the upright direction of the root is taken from the "
          "motion");
    }
    return TurnAxes(world_up, rest_up);
  }

  Status TurnAxes(const DVec3& world_up, const DVec3& rest_up) {
    STRIDEWIRE_CHECK(std::fabs(glm::length(world_up) - 1.0) < 1e-6 &&
                     std::fabs(glm::length(rest_up) - 1.0) < 1e-6);
    std::vector<DVec3> p;
    ComputePositions(-1, p);
    const auto level = [&](const DVec3& v) { return v - glm::dot(v, rest_up) * rest_up; };
    DVec3 feet(0.0);
    for (const FoundLeg& leg : found_.legs) feet += Unit(level(FootVector(leg)));
    const DVec3 hips = level(p[Index(found_.legs[0].hip)] - p[Index(found_.legs[1].hip)]);
    if (!found_.sides_known) {
      // If forward is the direction of the feet, left is up x forward.
      const DVec3 left = glm::cross(rest_up, feet);
      if (glm::length(feet) < 0.5) {
        Note("left and right are guessed, since the feet have no clear direction");
      }
      if (glm::dot(hips, left) < 0.0) std::swap(found_.legs[0], found_.legs[1]);
    }
    DVec3 left = found_.sides_known || glm::length(feet) < 0.5 ? hips : glm::cross(rest_up, feet);
    if (glm::length(left) < 1e-9) left = glm::cross(rest_up, feet);
    if (glm::length(left) < 1e-9) {
      return Fail(ErrorCode::kUnsupported,
                  "cannot determine left and right; name both ankle joints with options", name_);
    }
    left = Unit(level(SnapAxis(left)));
    if (glm::dot(glm::cross(left, rest_up), feet) < 0.0) {
      Note("the feet point backwards; left and right may be swapped");
    }
    joint_turn_ = TurnToOurAxes(left, rest_up);
    if (glm::dot(world_up, rest_up) > 0.999) {
      world_turn_ = joint_turn_;
    } else {
      const DVec3 other = std::fabs(world_up.x) > 0.9 ? DVec3(0, 0, 1) : DVec3(1, 0, 0);
      world_turn_ = TurnToOurAxes(Unit(other - glm::dot(other, world_up) * world_up), world_up);
    }
    return {};
  }

  double LegLength(const FoundLeg& leg) const {
    double length = 0.0;
    for (int j = leg.ankle; j != leg.hip; j = joint(j).parent) {
      length += glm::length(DVec3(joint(j).offset_m));
    }
    return length;
  }

  Status FindUnit() {
    const double leg = 0.5 * (LegLength(found_.legs[0]) + LegLength(found_.legs[1]));
    if (options_.unit_m) {
      if (!(*options_.unit_m > 0.0 && *options_.unit_m <= 1000.0)) {
        return Fail(ErrorCode::kInvalidArgument, "expected a unit above 0 and at most 1000 metres",
                    "unit_m");
      }
      capture_.unit_m = *options_.unit_m;
      return {};
    }
    if (!(leg > 1e-9)) return Fail(ErrorCode::kOutOfRange, "the legs have length zero", name_);
    double best = 0.0;
    for (const KnownUnit& unit : kKnownUnits) {
      const double leg_m = leg * unit.m;
      if (leg_m < kShortestLegM || leg_m > kLongestLegM) continue;
      const double miss = std::fabs(std::log(leg_m / kTypicalLegM));
      if (best > 0.0 && miss >= best) continue;
      best = std::max(miss, 1e-12);
      capture_.unit_m = unit.m;
      unit_name_ = unit.name;
    }
    if (best > 0.0) {
      Note(Text("one file unit is taken as %s: the legs are then %.2f m long", unit_name_,
                leg * capture_.unit_m));
      return {};
    }
    // Estimates the height of standing hips from the bones: root above hips, legs, ankle above
    // ball.
    std::vector<DVec3> p;
    ComputePositions(-1, p);
    double standing = leg;
    for (const FoundLeg& found : found_.legs) {
      standing -= 0.5 * (joint_turn_ * p[Index(found.hip)]).y;
      standing -= 0.5 * std::min(0.0, (joint_turn_ * FootVector(found)).y);
    }
    if (!(standing > 0.5 * leg)) standing = leg;
    capture_.unit_m = kStandingHipsM / standing;
    Note(
        Text("no common unit gives legs of 0.68 to 1.0 m; a unit of %.5g m puts the hips of the "
             "standing figure at %.2f m",
             capture_.unit_m, kStandingHipsM));
    return {};
  }

  Status Convert() {
    const double unit = capture_.unit_m;
    STRIDEWIRE_CHECK(unit > 0.0);
    STRIDEWIRE_CHECK(roots_.size() == Index(capture_.clip.frame_count()));
    const DQuat identity(1.0, 0.0, 0.0, 0.0);
    const bool turns = joint_turn_ != identity;
    const auto point = [&](Vec3& v) { v = Vec3(unit * (joint_turn_ * DVec3(v))); };
    for (Joint& j : capture_.skeleton.joints) point(j.offset_m);
    for (EndSite& site : capture_.skeleton.end_sites) point(site.offset_m);
    for (std::size_t j = 1; j < joints().size(); ++j) {
      if (glm::length(joints()[j].offset_m) > kMaxOffsetM) {
        return Fail(ErrorCode::kOutOfRange, "the OFFSET of the joint is too large",
                    LineOf(file_.joints[j].line));
      }
    }
    for (std::size_t i = 0; i < file_.end_sites.size(); ++i) {
      if (glm::length(capture_.skeleton.end_sites[i].offset_m) > kMaxOffsetM) {
        return Fail(ErrorCode::kOutOfRange, "the OFFSET of the End Site is too large",
                    LineOf(file_.end_sites[i].line));
      }
    }
    Clip& clip = capture_.clip;
    for (int f = 0; f < clip.frame_count(); ++f) {
      const PoseSpan pose = clip.frame(f);
      pose.root_position_m = Vec3(unit * (world_turn_ * roots_[Index(f)]));
      if (!turns && world_turn_ == identity) continue;
      for (std::size_t j = 0; j < joints().size(); ++j) {
        const DQuat& before = j == 0 ? world_turn_ : joint_turn_;
        pose.rotations[j] =
            Quat(glm::normalize(before * DQuat(pose.rotations[j]) * glm::conjugate(joint_turn_)));
      }
    }
    MakeSignContinuous(clip);
    for (int side = 0; side < 2; ++side) SetFoot(found_.legs[side], capture_.skeleton.legs[side]);
    NoteSlowMotion();
    if (positioned_joints_ > 0) {
      Note(Text(
          "%d joints besides the root have position channels; their means replace the OFFSETs "
          "(largest deviation %.4f m, %.100s)",
          positioned_joints_, position_deviation_ * unit, joint(position_joint_).name.c_str()));
    }
    if (Status status = capture_.skeleton.Validate(); !status) {
      status.error().where = name_;
      return status;
    }
    if (Status status = clip.Validate(); !status) {
      status.error().where = name_;
      return status;
    }
    return {};
  }

  DVec3 AnklePosition(int frame, int ankle) const {
    const ConstPoseSpan pose = capture_.clip.frame(frame);
    DVec3 position(0.0);
    for (int j = ankle; j >= 0; j = joint(j).parent) {
      position = DQuat(pose.rotations[Index(j)]) * position;
      position += DVec3(j == 0 ? pose.root_position_m : joint(j).offset_m);
    }
    return position;
  }

  // Some conversions declare 30 Hz for motion that was captured at 120 Hz. This is detected by the
  // acceleration of the ankles over 50 ms. Its 99th percentile is 17 m/s^2 in the slowest walk of
  // our captures and 68 in the fastest. Playback at a quarter of the speed reduces that to 1 to 4.
  void NoteSlowMotion() {
    const Clip& clip = capture_.clip;
    const int half = std::max(1, static_cast<int>(std::lround(0.025 * clip.fps)));
    const int count = clip.frame_count() - capture_.first_frame;
    if (options_.fps || count < 8 * half) return;
    std::vector<double> accelerations;
    double travel_m = 0.0;
    for (const FoundLeg& leg : found_.legs) {
      std::vector<DVec3> path(Index(count));
      for (int f = 0; f < count; ++f) {
        path[Index(f)] = AnklePosition(capture_.first_frame + f, leg.ankle);
        travel_m = std::max(travel_m, glm::length(path[Index(f)] - path[0]));
      }
      const double scale = clip.fps * clip.fps / (half * half);
      for (int f = half; f + half < count; ++f) {
        const DVec3 d = path[Index(f + half)] - 2.0 * path[Index(f)] + path[Index(f - half)];
        accelerations.push_back(glm::length(d) * scale);
      }
    }
    // A figure that stands still does not reveal its frame rate.
    if (travel_m < kMinTravelM) return;
    const auto p99 =
        accelerations.begin() +
        static_cast<std::ptrdiff_t>(0.99 * static_cast<double>(accelerations.size() - 1));
    std::nth_element(accelerations.begin(), p99, accelerations.end());
    if (*p99 >= kSlowestFeetMS2) return;
    Note(Text(
        "the feet accelerate by %.1f m/s^2 at most, which is too slow for a person (17 or more): "
        "Frame Time %.6g s may be too long; most captures have 120 frames per second",
        *p99, file_.frame_time_s));
  }

  // Sets the foot of `leg`, in metres and our axes.
  void SetFoot(const FoundLeg& found, Leg& leg) {
    STRIDEWIRE_CHECK(found.hip >= 0 && found.hip < found.knee && found.knee < found.ankle);
    STRIDEWIRE_CHECK(found.ball < 0 || found.ball >= found.ankle);
    leg.hip = found.hip;
    leg.knee = found.knee;
    leg.ankle = found.ankle;
    if (found.ball >= 0) {
      leg.ball = found.ball;
      const DVec3 tip = FarthestTip(found.ball);
      const DVec3 foot = FootVector(found);
      leg.toe_tip_offset_m = glm::length(tip) > 0.0
                                 ? Vec3(tip)
                                 : Vec3(DVec3(foot.x, 0.0, foot.z) * (1.0 / kBallShare - 1.0));
      return;
    }
    leg.ball = found.ankle;
    const double leg_m = LegLength(found);
    DVec3 tip = FarthestTip(found.ankle);
    if (glm::length(tip) < 1e-6) {
      tip = DVec3(0.0, -0.07, 0.24) * leg_m;
      Note(
          "a foot has neither a toe joint nor an End Site; its length is taken as 0.24 leg "
          "lengths");
    } else if (glm::length(tip) < kFootEndIsBall * leg_m) {
      leg.ball_offset_m = Vec3(tip);
      leg.toe_tip_offset_m = Vec3(tip.x / kBallShare, tip.y, tip.z / kBallShare);
      return;
    }
    leg.ball_offset_m = Vec3(tip.x * kBallShare, tip.y, tip.z * kBallShare);
    leg.toe_tip_offset_m = Vec3(tip);
  }

  BvhFile file_;
  std::string name_;
  const BvhReadOptions& options_;
  Capture capture_;
  FoundLegs found_;
  std::vector<DVec3> roots_;  // Root positions, in file axes and units.
  std::vector<DQuat> world_;  // World rotations, scratch of ComputePositions.
  DQuat world_turn_ = DQuat(1.0, 0.0, 0.0, 0.0);
  DQuat joint_turn_ = DQuat(1.0, 0.0, 0.0, 0.0);
  const char* unit_name_ = "";
  int positioned_joints_ = 0;
  int position_joint_ = 0;
  double position_deviation_ = 0.0;
};

}  // namespace

Expected<Capture> ParseBvh(std::string_view text, std::string_view name,
                           const BvhReadOptions& options) {
  if (text.size() > kMaxBvhBytes) {
    return Fail(ErrorCode::kLimitExceeded, "the file is larger than the limit of 512 MiB",
                std::string(name));
  }
  Expected<BvhFile> file = ParseBvhFile(text, name);
  if (!file) return std::unexpected(std::move(file.error()));
  return Reader(std::move(*file), std::string(name), options).Run();
}

Expected<Capture> ReadBvh(const std::filesystem::path& path, const BvhReadOptions& options) {
  const std::string name = path.string();
  std::error_code code;
  const std::filesystem::file_status status = std::filesystem::status(path, code);
  if (status.type() == std::filesystem::file_type::not_found) {
    return Fail(ErrorCode::kNotFound, "there is no such file", name);
  }
  if (code) return Fail(ErrorCode::kIo, "cannot open the file", name);
  if (!std::filesystem::is_regular_file(status)) {
    return Fail(ErrorCode::kIo, "expected a regular file", name);
  }
  const std::uintmax_t size = std::filesystem::file_size(path, code);
  if (code) return Fail(ErrorCode::kIo, "cannot open the file", name);
  if (size > kMaxBvhBytes) {
    return Fail(ErrorCode::kLimitExceeded, "the file is larger than the limit of 512 MiB", name);
  }
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return Fail(ErrorCode::kIo, "cannot open the file", name);
  std::string text(static_cast<std::size_t>(size), '\0');
  stream.read(text.data(), static_cast<std::streamsize>(size));
  // The file may have become shorter since file_size.
  text.resize(static_cast<std::size_t>(stream.gcount()));
  if (stream.bad()) return Fail(ErrorCode::kIo, "cannot read the file", name);
  return ParseBvh(text, name, options);
}

}  // namespace stridewire
