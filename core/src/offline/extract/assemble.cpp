#include "offline/extract/assemble.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "base/check.h"
#include "offline/base/statistics.h"
#include "offline/extract/level_feet.h"
#include "offline/extract/mirror.h"
#include "runtime/library/knee_hinges.h"

namespace stridewire {
namespace {

constexpr std::size_t kExamplesPerParameter = 3;
constexpr std::size_t kMinForAnArea = std::size(kStraightStepParameters) + 1;
// With at least this many examples, the lowest and the highest value of a parameter are ignored
// because they may be outliers.
constexpr std::size_t kOutlierFreeMin = 4;
// Steps that turn by more than this are not added to groups without the turn parameter, if other
// steps remain.
constexpr double kStraightTurnMaxRad = 0.6;

// Examples of one kind with all their parameters, before they become a group.
struct Pool {
  MovementKind kind = MovementKind::kStepLeft;
  std::span<const ParameterName> names;
  std::vector<RawExample> examples;
};

bool IsHeight(ParameterName name) {
  return name == ParameterName::kStartY || name == ParameterName::kEndY ||
         name == ParameterName::kHeight;
}

// Returns the range of a parameter in a pool. If there are enough examples, the lowest and the
// highest value are ignored. The range of a height parameter always includes 0 and every example,
// so that it is not 0 if only one example climbs, or if all climb by the same height.
double Spread(const Pool& pool, std::size_t parameter) {
  std::vector<double> values;
  for (const RawExample& example : pool.examples) values.push_back(example.parameters[parameter]);
  if (values.empty()) return 0.0;
  const bool is_height = IsHeight(pool.names[parameter]);
  if (is_height) values.push_back(0.0);
  std::ranges::sort(values);
  const std::size_t skip = values.size() >= kOutlierFreeMin && !is_height ? 1 : 0;
  return values[values.size() - 1 - skip] - values[skip];
}

// Returns true if a pool has enough examples to keep the heights that vary in it as parameters,
// besides `always`. If climbing and level examples were averaged instead, the figure would sink
// into level ground. n parameters require at least n + 1 examples.
bool CanKeepHeights(const Pool& pool, std::span<const ParameterName> always,
                    const AssembleOptions& options) {
  std::size_t needed = always.size() + 1;
  bool is_varied = false;
  for (std::size_t i = 0; i < pool.names.size(); ++i) {
    if (!IsHeight(pool.names[i]) || Spread(pool, i) < options.spread_min_m) continue;
    ++needed;
    is_varied = true;
  }
  return !is_varied || pool.examples.size() >= needed;
}

// Returns the indices of the parameters of a group: `always` and those in which the pool varies. If
// `with_height`, all heights that vary are included. The number of the others is limited by the
// number of examples.
std::vector<std::size_t> SpannedParameters(const Pool& pool, std::span<const ParameterName> always,
                                           bool with_height, const AssembleOptions& options) {
  struct Candidate {
    std::size_t index;
    double spread;  // Range of the values relative to the smallest range that counts.
    bool fixed;
  };
  std::vector<Candidate> candidates;
  std::size_t fixed_count = 0;
  for (std::size_t i = 0; i < pool.names.size(); ++i) {
    const ParameterName name = pool.names[i];
    if (IsHeight(name) && !with_height) continue;
    const double least =
        name == ParameterName::kTurn ? options.spread_min_rad : options.spread_min_m;
    const double spread = Spread(pool, i) / least;
    const bool fixed =
        std::ranges::find(always, name) != always.end() || (IsHeight(name) && spread >= 1.0);
    if (!fixed && spread < 1.0) continue;
    candidates.push_back({i, spread, fixed});
    fixed_count += fixed ? 1 : 0;
  }
  std::ranges::stable_sort(candidates, [](const Candidate& a, const Candidate& b) {
    return std::pair(a.fixed, a.spread) > std::pair(b.fixed, b.spread);
  });
  const std::size_t most = std::max(fixed_count, pool.examples.size() / kExamplesPerParameter);
  if (candidates.size() > most) candidates.resize(most);
  std::vector<std::size_t> indices;
  for (const Candidate& candidate : candidates) indices.push_back(candidate.index);
  STRIDEWIRE_CHECK(indices.size() >= always.size());
  std::ranges::sort(indices);
  return indices;
}

RawGroup MakeGroup(Pool pool, const std::vector<std::size_t>& parameters) {
  RawGroup group;
  group.kind = pool.kind;
  for (const std::size_t i : parameters) group.parameters.push_back(pool.names[i]);
  for (RawExample& example : pool.examples) {
    std::vector<double> kept;
    for (const std::size_t i : parameters) kept.push_back(example.parameters[i]);
    example.parameters = std::move(kept);
    STRIDEWIRE_CHECK(example.parameters.size() == group.parameters.size());
    group.examples.push_back(std::move(example));
  }
  return group;
}

void Raise(Pose& pose, double by_m) { pose.root_position_m.y += static_cast<float>(by_m); }

void Raise(Clip& clip, double by_m) {
  for (Vec3& position : clip.root_positions_m) position.y += static_cast<float>(by_m);
}

// Combines the examples of several captures.
class Assembler {
 public:
  Assembler(const AssembleOptions& options, const Skeleton& skeleton,
            std::span<const Extraction> files)
      : options_(options), skeleton_(skeleton), files_(files) {
    if (options.mirror)
      mirror_ = FindSkeletonMirror(skeleton, MeasurePosture(skeleton, Examples()));
    for (int f = 0; f < 2; ++f) {
      std::vector<double> heights;
      for (const Extraction& file : files) {
        if (file.error.empty() && file.has_contacts) heights.push_back(file.ball_height_m[f]);
      }
      ball_height_m_[f] = Median(std::move(heights));
    }
    if (const auto examples = Examples(); !examples.empty()) {
      std::vector<const Clip*> clips;
      for (const ExtractedExample* example : examples) clips.push_back(&example->example.clip);
      const ConstPoseSpan first = clips.front()->frame(0);
      leveller_.emplace(skeleton, first, LearnKneeHinges(skeleton, first, clips), ball_height_m_);
    }
  }

  Expected<RawLibrary> Run() {
    if (options_.mirror && !mirror_) {
      return Fail(ErrorCode::kUnsupported,
                  "cannot mirror: neither names nor positions of the joints pair left with right",
                  "--mirror");
    }
    RawLibrary library;
    library.skeleton = skeleton_;
    const bool has_dropped_climbs = options_.steps && AddStepGroups(library);
    if (options_.jumps) AddJumpGroup(library);
    if (library.groups.empty()) {
      return Fail(ErrorCode::kNotFound,
                  has_dropped_climbs
                      ? "the captures contain climbing steps only, and too few of them: "
                        "at least 5 of one foot are needed, or level steps"
                      : "the captures contain no usable step or jump");
    }
    SetStandPose(library);
    return library;
  }

 private:
  // Returns all steps and jumps of the usable captures.
  [[nodiscard]] std::vector<const ExtractedExample*> Examples() const {
    std::vector<const ExtractedExample*> examples;
    for (const Extraction& file : files_) {
      if (!file.error.empty()) continue;
      for (const ExtractedExample& step : file.general_steps) examples.push_back(&step);
      for (const ExtractedExample& jump : file.jump_examples) examples.push_back(&jump);
    }
    return examples;
  }

  // Returns the vertical shift that brings the balls of a capture's standing feet to the height of
  // the library. Misplaced markers may displace a foot by up to 2 cm, so the shift is that of the
  // foot with the smaller difference.
  [[nodiscard]] double Shift(const Extraction& file) const {
    if (!file.has_contacts) return 0.0;
    const double left = ball_height_m_[0] - file.ball_height_m[0];
    const double right = ball_height_m_[1] - file.ball_height_m[1];
    return std::fabs(left) < std::fabs(right) ? left : right;
  }

  void Append(ExtractedExample example, const Extraction& file, Pool& pool) const {
    if (example.kind != pool.kind) return;
    STRIDEWIRE_CHECK(leveller_.has_value());
    leveller_->Level(example, pool.names);
    Raise(example.example.clip, Shift(file));
    pool.examples.push_back(std::move(example.example));
  }

  template <typename Member, typename Keep>
  [[nodiscard]] Pool Gather(MovementKind kind, std::span<const ParameterName> names, Member member,
                            Keep keep) const {
    Pool pool{kind, names, {}};
    for (const Extraction& file : files_) {
      if (!file.error.empty()) continue;
      for (const ExtractedExample& example : file.*member) {
        if (!keep(example)) continue;
        Append(example, file, pool);
        if (mirror_ && IsStep(kind)) {
          Append(MirrorExample(skeleton_, *mirror_, names, example), file, pool);
        }
      }
    }
    return pool;
  }

  // Adds the groups of steps to `library`. Returns true if there are climbing steps, but too few
  // for a group.
  bool AddStepGroups(RawLibrary& library) const {
    bool has_dropped_climbs = false;
    constexpr Foot kFeet[] = {Foot::kLeft, Foot::kRight};
    const auto all = [](const ExtractedExample&) { return true; };
    const auto level = [](const ExtractedExample& e) { return e.level; };
    std::array<Pool, 2> straight_steps;  // Pools of straight steps, indexed by foot.
    std::array<Pool, 2> level_steps;
    std::array<Pool, 2> all_steps;
    for (std::size_t f = 0; f < 2; ++f) {
      const MovementKind kind = StepKind(kFeet[f]);
      straight_steps[f] = Gather(kind, kStraightStepParameters, &Extraction::straight_steps, all);
      level_steps[f] = Gather(kind, kGeneralStepParameters, &Extraction::general_steps, level);
      all_steps[f] = Gather(kind, kGeneralStepParameters, &Extraction::general_steps, all);
      const std::size_t straight_count = straight_steps[f].examples.size();
      const std::size_t level_count = level_steps[f].examples.size();
      const bool has_climbs = all_steps[f].examples.size() > level_count;
      const bool keeps_heights = CanKeepHeights(all_steps[f], kStraightStepParameters, options_);
      if (has_climbs && !keeps_heights) has_dropped_climbs = true;
      if (!has_climbs || !keeps_heights) all_steps[f].examples.clear();
      if (level_count <= straight_count) level_steps[f].examples.clear();
      // Omits small groups if another group has their steps. Two examples, for instance, could
      // reproduce only parameters on the line between them.
      const bool has_all = !all_steps[f].examples.empty();
      if (has_all && level_count < kMinForAnArea) level_steps[f].examples.clear();
      if ((has_all || !level_steps[f].examples.empty()) && straight_count < kMinForAnArea) {
        straight_steps[f].examples.clear();
      }
    }
    for (Pool& pool : straight_steps) {
      if (!pool.examples.empty()) library.groups.push_back(MakeGroup(std::move(pool), {0, 1}));
    }
    for (Pool& pool : level_steps) AddGeneral(std::move(pool), false, library);
    for (Pool& pool : all_steps) AddGeneral(std::move(pool), true, library);
    return has_dropped_climbs;
  }

  void AddGeneral(Pool pool, bool with_height, RawLibrary& library) const {
    if (pool.examples.empty()) return;
    const auto spanned_of = [&] {
      return SpannedParameters(pool, kStraightStepParameters, with_height, options_);
    };
    std::vector<std::size_t> spanned = spanned_of();
    const auto turn = static_cast<std::size_t>(std::ranges::find(pool.names, ParameterName::kTurn) -
                                               pool.names.begin());
    if (std::ranges::find(spanned, turn) == spanned.end()) {
      // In a group without the turn parameter, requests treat all steps as straight.
      const auto turns = [&](const RawExample& example) {
        return std::fabs(example.parameters[turn]) > kStraightTurnMaxRad;
      };
      if (!std::ranges::all_of(pool.examples, turns)) std::erase_if(pool.examples, turns);
      spanned = spanned_of();
    }
    library.groups.push_back(MakeGroup(std::move(pool), spanned));
  }

  void AddJumpGroup(RawLibrary& library) const {
    Pool pool =
        Gather(MovementKind::kJump, kJumpParameters, &Extraction::jump_examples,
               [&](const ExtractedExample& e) { return e.settled || options_.unsettled_jumps; });
    if (pool.examples.empty()) return;
    constexpr ParameterName kAlways[] = {ParameterName::kLength};
    if (!CanKeepHeights(pool, kAlways, options_)) KeepOneHeight(pool);
    const std::vector<std::size_t> spanned = SpannedParameters(pool, kAlways, true, options_);
    library.groups.push_back(MakeGroup(std::move(pool), spanned));
  }

  // Keeps the jumps that land at the same height as the first one.
  void KeepOneHeight(Pool& pool) const {
    const auto i = static_cast<std::size_t>(std::ranges::find(pool.names, ParameterName::kHeight) -
                                            pool.names.begin());
    const double height_m = pool.examples.front().parameters[i];
    std::erase_if(pool.examples, [&](const RawExample& example) {
      return std::fabs(example.parameters[i] - height_m) >= options_.spread_min_m;
    });
  }

  // Sets the stand pose to the stillest standing pose of all captures or, if there is none, to the
  // first pose of the first example.
  void SetStandPose(RawLibrary& library) const {
    STRIDEWIRE_CHECK(!library.groups.empty() && !library.groups.front().examples.empty());
    const Extraction* best = nullptr;
    for (const Extraction& file : files_) {
      if (!file.error.empty() || !file.stand) continue;
      if (best == nullptr || file.stand->unrest < best->stand->unrest) best = &file;
    }
    Pose& pose = library.stand_pose;
    if (best != nullptr) {
      pose = best->stand->pose;
      Raise(pose, Shift(*best));
      leveller_->Level(PoseSpan(pose));
      library.stand_tilt_m = best->stand->tilt_m;
      return;
    }
    const ConstPoseSpan first = library.groups.front().examples.front().clip.frame(0);
    pose.root_position_m = first.root_position_m;
    pose.rotations.assign(first.rotations.begin(), first.rotations.end());
  }

  const AssembleOptions& options_;
  const Skeleton& skeleton_;
  std::span<const Extraction> files_;
  std::optional<SkeletonMirror> mirror_;
  std::array<double, 2> ball_height_m_{};  // [foot]
  std::optional<FeetLeveller> leveller_;   // Set if there is any example.
};

bool SameOffsets(const Skeleton& a, const Skeleton& b) {
  for (std::size_t j = 1; j < a.joints.size(); ++j) {
    if (glm::length(a.joints[j].offset_m - b.joints[j].offset_m) > 1e-5f) return false;
  }
  // The ball of a foot without a toe joint depends on the motion of each capture.
  for (std::size_t f = 0; f < 2; ++f) {
    const Leg& one = a.legs[f];
    const Leg& other = b.legs[f];
    if (glm::length(one.ball_offset_m - other.ball_offset_m) > 1e-5f) return false;
    if (glm::length(one.toe_tip_offset_m - other.toe_tip_offset_m) > 1e-5f) return false;
  }
  return true;
}

}  // namespace

LibraryAssembler::LibraryAssembler(AssembleOptions options) : options_(std::move(options)) {}

const Extraction& LibraryAssembler::Add(const Capture& capture) {
  const bool first = skeleton_.joints.empty();
  if (!first && !SameJointTree(skeleton_, capture.skeleton)) {
    Extraction& file = files_.emplace_back();
    file.path = capture.path;
    file.frames = capture.clip.frame_count();
    file.fps = capture.clip.fps;
    file.unit_m = capture.unit_m;
    file.notes = capture.notes;
    file.skeleton = capture.skeleton;
    file.error = TreeDifference(skeleton_, skeleton_path_, capture.skeleton);
    return file;
  }
  ExtractOptions extract = options_.extract;
  extract.target = first || SameOffsets(skeleton_, capture.skeleton) ? nullptr : &skeleton_;
  Extraction& file = files_.emplace_back(Extract(capture, extract));
  if (first && file.error.empty()) {
    skeleton_ = capture.skeleton;
    skeleton_path_ = capture.path;
  }
  return file;
}

void LibraryAssembler::AddNotes(std::size_t file, std::span<const std::string> notes) {
  STRIDEWIRE_CHECK(file < files_.size());
  files_[file].notes.insert(files_[file].notes.end(), notes.begin(), notes.end());
}

Expected<RawLibrary> LibraryAssembler::Assemble() const {
  return Assembler(options_, skeleton_, files_).Run();
}

std::string TreeDifference(const Skeleton& first, const std::string& first_name,
                           const Skeleton& other) {
  const auto parent = [](const Skeleton& skeleton, std::size_t j) {
    const int index = skeleton.joints[j].parent;
    return index < 0 ? std::string("no joint")
                     : skeleton.joints[static_cast<std::size_t>(index)].name;
  };
  for (std::size_t j = 0; j < std::min(first.joints.size(), other.joints.size()); ++j) {
    const Joint& a = first.joints[j];
    const Joint& b = other.joints[j];
    if (a.name != b.name) {
      return "its joint " + std::to_string(j) + " is " + b.name + " where " + first_name + " has " +
             a.name;
    }
    if (a.parent != b.parent) {
      return "its joint " + b.name + " has the parent " + parent(other, j) + " where in " +
             first_name + " the parent is " + parent(first, j);
    }
  }
  return "it has " + std::to_string(other.joints.size()) + " joints, " + first_name + " has " +
         std::to_string(first.joints.size());
}

bool SameJointTree(const Skeleton& a, const Skeleton& b) {
  return std::ranges::equal(a.joints, b.joints, [](const Joint& x, const Joint& y) {
    return x.name == y.name && x.parent == y.parent;
  });
}

}  // namespace stridewire
