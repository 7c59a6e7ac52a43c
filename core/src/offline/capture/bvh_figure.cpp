#include "offline/capture/bvh_figure.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/check.h"
#include "offline/base/text.h"
#include "offline/capture/bvh_motion.h"
#include "offline/capture/file_axis.h"
#include "offline/capture/leg_chain.h"
#include "offline/capture/leg_names.h"

namespace stridewire {
namespace {

constexpr double kFastTurnRadS = 10.5;  // 600 degrees/s.
// A joint above the legs counts as moving if its position varies by more than this fraction of the
// leg length (2 cm for an adult).
constexpr double kMovesShare = 0.024;
// A side branch above the legs with at least this many joints is a part of the body, not a prop.
constexpr int kBodyJoints = 8;

bool IsBelow(const std::vector<BvhJoint>& joints, int j, int ancestor) {
  while (j > ancestor) j = joints[Index(j)].parent;
  return j == ancestor;
}

class FigureBuilder {
 public:
  FigureBuilder(BvhFile file, const std::string& name, double fps, const BvhReadOptions& options)
      : file_(std::move(file)), name_(name), options_(options), motion_(file_) {
    figure_.notes = std::move(file_.notes);
    figure_.clip.fps = fps;
  }

  Expected<BvhFigure> Run() {
    if (Status status = SelectFigure(); !status) return std::unexpected(std::move(status.error()));
    FindRoot();
    FindKept();
    BuildClip();
    BuildJoints();
    file_.values = {};
    return std::move(figure_);
  }

 private:
  void Note(std::string text) { figure_.notes.push_back(std::move(text)); }
  const std::string& NameOf(int j) const { return file_.joints[Index(j)].name; }

  // A joint of the file that belongs to the figure.
  struct KeptJoint {
    int source = 0;
    int parent = -1;  // In the figure.
    // True for a child of the figure's root that the file attaches to a joint above that root.
    bool is_attached = false;
  };

  // Finds the legs of every root of the file, and selects the root of the figure.
  Status SelectFigure() {
    std::vector<int> roots;
    for (int j = 0; j < static_cast<int>(file_.joints.size()); ++j) {
      if (file_.joints[Index(j)].parent < 0) roots.push_back(j);
    }
    roots.push_back(static_cast<int>(file_.joints.size()));
    Status first_error;
    int selected = -1;
    int figures = 0;
    for (std::size_t r = 0; r + 1 < roots.size(); ++r) {
      const FigureShape shape = motion_.ShapeOf(roots[r], roots[r + 1], kSampledFrames);
      Expected<FoundLegs> legs = FindLegsOf(shape);
      if (!legs) {
        if (first_error) first_error = std::unexpected(std::move(legs.error()));
        continue;
      }
      // The first figure is selected, unless only a later one has joint names that identify its
      // legs. Names are more reliable than shapes.
      if (figures++ > 0 && (legs->by_shape || !figure_.legs.by_shape)) continue;
      selected = static_cast<int>(r);
      figure_.legs = *legs;
      leg_length_ = 0.5 * (ChainLength(shape.joints, legs->legs[0].hip, legs->legs[0].ankle) +
                           ChainLength(shape.joints, legs->legs[1].hip, legs->legs[1].ankle));
    }
    if (selected < 0) return first_error;
    begin_ = roots[Index(selected)];
    end_ = roots[Index(selected) + 1];
    for (std::size_t r = 0; r + 1 < roots.size(); ++r) {
      if (roots[r] == begin_) continue;
      Note(Text("the ROOT %.100s is left out, since the ROOT %.100s is the figure",
                NameOf(roots[r]).c_str(), NameOf(begin_).c_str()));
    }
    if (figures > 1) {
      Note("the file contains several figures; export one figure per file to use them all");
    }
    for (FoundLeg& leg : figure_.legs.legs) {
      for (int* joint : {&leg.hip, &leg.knee, &leg.ankle, &leg.ball}) {
        if (*joint >= 0) *joint += begin_;
      }
    }
    figure_.legs.root += begin_;
    if (figure_.legs.by_shape) {
      Note("legs were detected by shape, since the joint names do not identify them");
    }
    return {};
  }

  static int FindJoint(const FigureShape& shape, const std::string& name) {
    for (std::size_t j = 0; j < shape.joints.size(); ++j) {
      if (shape.joints[j].name == name) return static_cast<int>(j);
    }
    return -1;
  }

  // Finds the legs from the options, or else by names and shape.
  Expected<FoundLegs> FindLegsOf(const FigureShape& shape) const {
    FoundLegs legs;
    if (options_.left_ankle.empty() && options_.right_ankle.empty()) {
      Expected<FoundLegs> found = FindLegs(shape);
      if (!found) {
        found.error().where = name_;
        return found;
      }
      legs = *found;
    } else {
      int ankles[2] = {-1, -1};
      for (int side = 0; side < 2; ++side) {
        ankles[side] = FindJoint(shape, side == 0 ? options_.left_ankle : options_.right_ankle);
        if (ankles[side] < 0) {
          return Fail(ErrorCode::kNotFound, "the file has no joint with this name",
                      side == 0 ? "left_ankle" : "right_ankle");
        }
      }
      int side = 0;
      if (!FindLegsAbove(shape, ankles, legs, &side)) {
        return Fail(ErrorCode::kInvalidArgument,
                    ankles[0] == ankles[1] ? "both ankles belong to the same leg"
                                           : "expected a joint with a knee and a hip above it",
                    side == 0 ? "left_ankle" : "right_ankle");
      }
    }
    for (int side = 0; side < 2; ++side) {
      const std::string& ball_name = side == 0 ? options_.left_ball : options_.right_ball;
      if (ball_name.empty()) continue;
      const char* option = side == 0 ? "left_ball" : "right_ball";
      const int ball = FindJoint(shape, ball_name);
      if (ball < 0) {
        return Fail(ErrorCode::kNotFound, "the file has no joint with this name", option);
      }
      int above = ball;
      while (above > legs.legs[side].ankle) above = shape.joints[Index(above)].parent;
      if (above != legs.legs[side].ankle) {
        return Fail(ErrorCode::kInvalidArgument, "expected a joint below the ankle", option);
      }
      legs.legs[side].ball = ball;
    }
    return legs;
  }

  // Returns true if a branch is a part of the body, for example the spine.
  bool IsBody(int branch) const {
    int count = 0;
    for (int j = branch; j < end_; ++j) {
      if (!IsBelow(file_.joints, j, branch)) continue;
      ++count;
      if (IsHelperName(NameOf(j))) continue;
      if (IsTrunkName(NameOf(j)) || IsHandName(NameOf(j))) return true;
    }
    return count >= kBodyJoints;
  }

  // Finds the root of the figure: the highest joint above the legs from which a part of the body
  // branches off. All joints below it on the way to the legs must keep their offsets from their
  // parents, because only the root of a figure can have positions.
  void FindRoot() {
    for (int j = figure_.legs.root; j >= 0; j = file_.joints[Index(j)].parent) chain_.push_back(j);
    std::ranges::reverse(chain_);
    STRIDEWIRE_CHECK(!chain_.empty() && chain_.front() == begin_);
    std::size_t moved = 0;
    for (std::size_t i = 1; i < chain_.size(); ++i) {
      const double deviation = motion_.Deviation(chain_[i], 0, motion_.MeanPosition(chain_[i], 0));
      if (deviation > kMovesShare * leg_length_) moved = i;
    }
    root_ = chain_.size() - 1;
    for (std::size_t i = chain_.size() - 1; i-- > moved;) {
      for (int j = chain_[i] + 1; j < end_; ++j) {
        if (file_.joints[Index(j)].parent == chain_[i] && j != chain_[i + 1] && IsBody(j)) {
          root_ = i;
        }
      }
    }
    if (root_ == 0) return;
    Note(Text("the root of the figure is %.100s; it contains the motion of %.100s%s",
              NameOf(chain_[root_]).c_str(), NameOf(chain_[0]).c_str(),
              root_ > 1 ? " and of the joints between them" : ""));
  }

  void FindKept() {
    std::vector<int> in_figure(file_.joints.size(), -1);
    const auto keep = [&](int branch, bool is_attached) {
      for (int j = branch; j < end_; ++j) {
        if (!IsBelow(file_.joints, j, branch)) continue;
        KeptJoint kept;
        kept.source = j;
        kept.is_attached = is_attached && j == branch;
        kept.parent = kept.is_attached ? 0
                      : kept_.empty()  ? -1
                                       : in_figure[Index(file_.joints[Index(j)].parent)];
        in_figure[Index(j)] = static_cast<int>(kept_.size());
        kept_.push_back(kept);
      }
    };
    keep(chain_[root_], false);
    for (std::size_t i = 0; i < root_; ++i) {
      for (int j = chain_[i] + 1; j < end_; ++j) {
        if (file_.joints[Index(j)].parent != chain_[i] || j == chain_[i + 1]) continue;
        const bool is_body = IsBody(j);
        Note("the joint " + NameOf(j).substr(0, 100) +
             (is_body ? " above the legs is attached to the root of the figure"
                      : " above the legs is left out, since it is no part of the body"));
        if (is_body) keep(j, true);
      }
    }
    for (std::size_t s = 0; s < file_.end_sites.size(); ++s) {
      const BvhEndSite& site = file_.end_sites[s];
      const int joint = in_figure[Index(site.joint)];
      if (joint < 0) continue;
      figure_.end_sites.push_back({joint, Vec3(site.offset)});
      figure_.end_site_lines.push_back(site.line);
    }
    for (FoundLeg& leg : figure_.legs.legs) {
      for (int* joint : {&leg.hip, &leg.knee, &leg.ankle, &leg.ball}) {
        if (*joint >= 0) *joint = in_figure[Index(*joint)];
      }
    }
    figure_.legs.root = in_figure[Index(figure_.legs.root)];
  }

  // The position and rotation of a chain joint in the frame of another one.
  struct Transform {
    DVec3 position = DVec3(0.0);
    DQuat rotation = DQuat(1.0, 0.0, 0.0, 0.0);
  };

  // Returns the transform of chain joint `to` in the frame of chain joint `from`; `from` = -1 is
  // the world.
  Transform ChainTransform(int frame, int from, int to) const {
    Transform transform;
    for (int i = from + 1; i <= to; ++i) {
      const int j = chain_[Index(i)];
      transform.position += transform.rotation * motion_.LocalPosition(frame, j);
      transform.rotation = transform.rotation * motion_.LocalRotation(frame, j);
    }
    return transform;
  }

  int ChainIndex(int joint) const {
    return static_cast<int>(std::ranges::find(chain_, joint) - chain_.begin());
  }

  void BuildClip() {
    Clip& clip = figure_.clip;
    clip.Resize(file_.frame_count, static_cast<int>(kept_.size()));
    figure_.roots.resize(Index(file_.frame_count));
    const int root = static_cast<int>(root_);
    const bool moves = std::any_of(chain_.begin(), chain_.begin() + root + 1,
                                   [&](int j) { return HasPositionChannels(j); });
    if (!moves) Note("the root has no position channels and stays at its OFFSET");
    for (int f = 0; f < file_.frame_count; ++f) {
      const PoseSpan pose = clip.frame(f);
      const Transform transform = ChainTransform(f, -1, root);
      figure_.roots[Index(f)] = transform.position;
      pose.rotations[0] = Quat(glm::normalize(transform.rotation));
      for (std::size_t k = 1; k < kept_.size(); ++k) {
        DQuat rotation = motion_.LocalRotation(f, kept_[k].source);
        if (kept_[k].is_attached) {
          const int above = ChainIndex(file_.joints[Index(kept_[k].source)].parent);
          rotation = glm::conjugate(ChainTransform(f, above, root).rotation) * rotation;
        }
        pose.rotations[k] = Quat(glm::normalize(rotation));
      }
    }
    MakeSignContinuous(clip);
    FindFirstFrame();
    FindFixedTurn();
  }

  bool HasPositionChannels(int j) const {
    return std::ranges::any_of(file_.joints[Index(j)].channels, [](const BvhChannel& channel) {
      return channel.kind == BvhChannelKind::kPosition;
    });
  }

  // Composes the constant rotations above the root, from the top joint down. Stops before the first
  // joint whose rotation changes.
  void FindFixedTurn() {
    for (std::size_t i = 0; i < root_; ++i) {
      const DQuat first = motion_.LocalRotation(figure_.first_frame, chain_[i]);
      for (int f = figure_.first_frame; f < file_.frame_count; ++f) {
        if (AngleBetween(Quat(motion_.LocalRotation(f, chain_[i])), Quat(first)) > 1e-3) return;
      }
      figure_.fixed_turn = glm::normalize(figure_.fixed_turn * first);
    }
  }

  // Returns the number of joints that rotate faster than people can between frames `f` and `f` + 1.
  int FastJoints(int f) const {
    const Clip& clip = figure_.clip;
    int fast = 0;
    for (std::size_t j = 0; j < kept_.size(); ++j) {
      fast += AngleBetween(clip.frame(f).rotations[j], clip.frame(f + 1).rotations[j]) * clip.fps >
              kFastTurnRadS;
    }
    return fast;
  }

  void FindFirstFrame() {
    const Clip& clip = figure_.clip;
    if (clip.frame_count() < 3) return;
    int jumping = 0;
    for (std::size_t j = 0; j < kept_.size(); ++j) {
      const double first = AngleBetween(clip.frame(0).rotations[j], clip.frame(1).rotations[j]);
      const double second = AngleBetween(clip.frame(1).rotations[j], clip.frame(2).rotations[j]);
      jumping += first > std::numbers::pi / 18.0 && first > 8.0 * second;
    }
    // Some programs blend from the artificial pose into the motion. No joint then jumps, but the
    // root starts with exactly the identity rotation, and many joints rotate fast.
    const bool root_at_rest = AngleBetween(clip.frame(0).rotations[0], kIdentityQuat) < 1e-6 &&
                              AngleBetween(clip.frame(1).rotations[0], kIdentityQuat) > 1e-3;
    if (jumping < 4 && !(root_at_rest && FastJoints(0) >= 4)) return;
    int first = 1;
    const int last = std::min(static_cast<int>(0.1 * clip.fps), clip.frame_count() - 2);
    while (first < last && FastJoints(first) >= 2) ++first;
    STRIDEWIRE_CHECK(first >= 1 && first < clip.frame_count());
    figure_.first_frame = first;
    Note(Text("skipped %d frame%s at the start: an artificial pose that %d joints leave too fast",
              first, first == 1 ? "" : "s", std::max(jumping, FastJoints(0))));
  }

  // Adds the joints of the figure. If the position of a joint relative to its parent varies, its
  // mean replaces the OFFSET of the file. This does not apply to the root.
  void BuildJoints() {
    int scaled = 0;
    for (std::size_t k = 0; k < kept_.size(); ++k) {
      const int source = kept_[k].source;
      const BvhJoint& joint = file_.joints[Index(source)];
      figure_.joints.push_back({joint.name, kept_[k].parent, Vec3(0.0f)});
      figure_.joint_lines.push_back(joint.line);
      scaled += std::ranges::any_of(joint.channels, [](const BvhChannel& channel) {
        return channel.kind == BvhChannelKind::kScale;
      });
      if (k == 0) continue;
      AveragedJoint averaged;
      averaged.joint = static_cast<int>(k);
      DVec3 offset = motion_.MeanPosition(source, figure_.first_frame);
      averaged.deviation = motion_.Deviation(source, figure_.first_frame, offset);
      if (kept_[k].is_attached) AttachOffset(source, offset, averaged.deviation);
      figure_.joints.back().offset_m = Vec3(offset);
      if (motion_.HasPositions(source) || kept_[k].is_attached) {
        figure_.averaged.push_back(averaged);
      }
    }
    if (scaled > 0) {
      Note(Text("the scale channels of %d joint%s are ignored", scaled, scaled == 1 ? "" : "s"));
    }
  }

  // Computes the mean position of an attached joint in the frame of the root, and the largest
  // distance from it.
  void AttachOffset(int source, DVec3& offset, double& deviation) const {
    const int above = ChainIndex(file_.joints[Index(source)].parent);
    const auto position = [&](int frame) {
      const Transform root = ChainTransform(frame, above, static_cast<int>(root_));
      return glm::conjugate(root.rotation) * (motion_.LocalPosition(frame, source) - root.position);
    };
    DVec3 sum(0.0);
    for (int f = figure_.first_frame; f < file_.frame_count; ++f) sum += position(f);
    offset = sum / static_cast<double>(file_.frame_count - figure_.first_frame);
    deviation = 0.0;
    for (int f = figure_.first_frame; f < file_.frame_count; ++f) {
      deviation = std::max(deviation, glm::distance(position(f), offset));
    }
  }

  BvhFile file_;
  const std::string& name_;
  const BvhReadOptions& options_;
  BvhMotion motion_;
  BvhFigure figure_;
  int begin_ = 0;  // The joints of the selected root.
  int end_ = 0;
  double leg_length_ = 0.0;
  std::vector<int> chain_;  // Joints from the root of the file to the lowest one above both legs.
  std::size_t root_ = 0;    // Index of the root of the figure in `chain_`.
  std::vector<KeptJoint> kept_;
};

}  // namespace

DVec3 BvhFigure::FootVector(const FoundLeg& leg) const {
  if (leg.ball < 0) return FarthestTip(leg.ankle);
  // Toe joints are below the ankle. Joints between ankle and toe joint are helpers that do not
  // rotate.
  DVec3 v(0.0);
  for (int j = leg.ball; j != leg.ankle; j = joints[Index(j)].parent) {
    v += DVec3(joints[Index(j)].offset_m);
  }
  return v;
}

DVec3 BvhFigure::FarthestTip(int of) const {
  DVec3 tip(0.0);
  const auto take = [&](const Vec3& v) {
    if (glm::length(DVec3(v)) > glm::length(tip)) tip = DVec3(v);
  };
  for (const EndSite& site : end_sites) {
    if (site.joint == of) take(site.offset_m);
  }
  for (const Joint& j : joints) {
    if (j.parent == of) take(j.offset_m);
  }
  return tip;
}

void BvhFigure::ComputePose(int frame, std::vector<DVec3>& positions,
                            std::vector<DQuat>& rotations) const {
  positions.resize(joints.size());
  rotations.resize(joints.size());
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const DQuat local =
        frame < 0 ? DQuat(1.0, 0.0, 0.0, 0.0) : DQuat(clip.frame(frame).rotations[j]);
    if (j == 0) {
      rotations[0] = local;
      positions[0] = frame < 0 ? DVec3(0.0) : roots[Index(frame)];
      continue;
    }
    const std::size_t parent = Index(joints[j].parent);
    rotations[j] = rotations[parent] * local;
    positions[j] = positions[parent] + rotations[parent] * DVec3(joints[j].offset_m);
  }
}

Expected<BvhFigure> MakeBvhFigure(BvhFile file, const std::string& name, double fps,
                                  const BvhReadOptions& options) {
  return FigureBuilder(std::move(file), name, fps, options).Run();
}

}  // namespace stridewire
