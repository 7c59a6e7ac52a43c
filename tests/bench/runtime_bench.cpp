// Measures the cost of movements, poses and messages on one core, for `builtin` and for each
// library that the command line names:
//   stridewire-bench [--instruction-set=NAME] [--benchmark_...] [LIBRARY.swl ...]
//
// The kernels use the widest vectors of the machine (AVX-512, AVX2, SSE4, NEON), or the named
// instruction set. The lower bounds ("floor") always use the fastest instruction set.
//
// A step is counted as in the paper: weights, blended keytimes and the poses of its whole duration,
// here 30 of them.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <numeric>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "bench_libraries.h"
#include "instruction_sets.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/locomotion_profile.h"
#include "runtime/library/pose_quantization.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/apply_layer.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/weights/correction.h"
#include "stridewire/base/version.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/protocol/compact_codec.h"
#include "stridewire/protocol/pose_codec.h"
#include "stridewire/protocol/pose_rows.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;
using protocol::PoseMode;

constexpr int kFramesAStep = 30;
/// Number of different parameters. There are enough of them that branch predictors cannot learn
/// them.
constexpr int kVariations = 256;
constexpr int kCrowd = 1000;
constexpr double kTickS = 1.0 / 60.0;

/// Returns parameters inside the hull of a group's examples: means of three sites with random
/// weights.
std::vector<std::vector<double>> Parameters(const MotionGroup& group) {
  std::mt19937 random(1);
  std::vector<std::vector<double>> all(kVariations);
  for (std::vector<double>& parameters : all) {
    parameters.assign(static_cast<std::size_t>(group.parameter_count()), 0.0);
    double sum = 0.0;
    for (int corner = 0; corner < 3; ++corner) {
      const double share = 0.05 + static_cast<double>(random() % 1000) / 1000.0;
      const auto site =
          group.site(static_cast<int>(random() % static_cast<unsigned>(group.example_count)));
      for (std::size_t i = 0; i < parameters.size(); ++i) parameters[i] += share * site[i];
      sum += share;
    }
    for (double& value : parameters) value /= sum;
  }
  return all;
}

void AddGroupCounters(benchmark::State& state, const MotionGroup& group) {
  state.counters["examples"] = group.example_count;
  state.counters["parameters"] = group.parameter_count();
}

void StartMovementAlone(benchmark::State& state, const Library& library, int group_index) {
  const MotionGroup& group = library->group(group_index);
  const auto parameters = Parameters(group);
  std::vector<double> scratch(static_cast<std::size_t>(library->max_row_count()));
  Movement movement;
  std::size_t i = 0;
  for (auto _ : state) {
    StartMovement(group, group_index, parameters[i++ % kVariations], {}, scratch, movement);
    benchmark::DoNotOptimize(movement.weights.data());
  }
  state.SetItemsProcessed(state.iterations());
  AddGroupCounters(state, group);
}

/// Starts a movement with run-time correction, as avatars do.
void StartCorrected(benchmark::State& state, const Library& library, int group_index) {
  const MotionGroup& group = library->group(group_index);
  const auto parameters = Parameters(group);
  CorrectionScratch scratch(*library);
  Movement movement;
  Pose pose(library->skeleton().joint_count());
  GridCache cache(library->layout());
  std::size_t i = 0;
  double iterations = 0.0;
  for (auto _ : state) {
    const std::vector<double>& wanted = parameters[i++ % kVariations];
    ParameterValues values{.count = group.parameter_count()};
    std::copy(wanted.begin(), wanted.end(), values.values.begin());
    const Correction correction =
        CorrectWeights(group, values, DefaultCorrectionLimits(group), scratch, movement);
    movement.group = group_index;
    StartWeighted(group, {}, movement);
    iterations += correction.iterations;
    benchmark::DoNotOptimize(movement.weights.data());
  }
  state.SetItemsProcessed(state.iterations());
  state.counters["iterations"] = benchmark::Counter(iterations, benchmark::Counter::kAvgIterations);
  AddGroupCounters(state, group);
}

void SynthesizeStep(benchmark::State& state, const Library& library, int group_index) {
  const MotionGroup& group = library->group(group_index);
  const auto parameters = Parameters(group);
  std::vector<double> scratch(static_cast<std::size_t>(library->max_row_count()));
  Movement movement;
  movement.difference = Pose(library->skeleton().joint_count());
  Pose pose(library->skeleton().joint_count());
  GridCache cache(library->layout());
  std::size_t i = 0;
  for (auto _ : state) {
    StartMovement(group, group_index, parameters[i++ % kVariations], {}, scratch, movement);
    cache.Clear();
    for (int frame = 0; frame < kFramesAStep; ++frame) {
      const double time_s = movement.duration_s() * frame / (kFramesAStep - 1);
      EvaluateMovement(group, library->layout(), movement, time_s, cache, pose);
      benchmark::DoNotOptimize(pose.rotations.data());
    }
  }
  state.SetItemsProcessed(state.iterations());
  AddGroupCounters(state, group);
}

void EvaluatePose(benchmark::State& state, const Library& library, int group_index) {
  const MotionGroup& group = library->group(group_index);
  const auto parameters = Parameters(group);
  std::vector<double> scratch(static_cast<std::size_t>(library->max_row_count()));
  Movement movement;
  movement.difference = Pose(library->skeleton().joint_count());
  Pose pose(library->skeleton().joint_count());
  GridCache cache(library->layout());
  StartMovement(group, group_index, parameters[0], {}, scratch, movement);
  double time_s = 0.0;
  for (auto _ : state) {
    EvaluateMovement(group, library->layout(), movement, time_s, cache, pose);
    benchmark::DoNotOptimize(pose.rotations.data());
    time_s += kTickS;
    if (time_s > movement.duration_s()) {
      time_s = 0.0;
      cache.Clear();
    }
  }
  state.SetItemsProcessed(state.iterations());
  AddGroupCounters(state, group);
}

/// A crowd that walks without end. Its random numbers are the same in every run.
class Crowd {
 public:
  Crowd(const Library& library, int size, const AvatarOptions& options = {})
      : evaluator_(*library, 1), plan_scratch_(*library) {
    for (int i = 0; i < size; ++i) {
      avatars_.emplace_back(library, BaseFrame{.position_m = DVec3(2.0 * i, 0.0, 0.0)}, options);
      Refill(avatars_.back());
      // Each avatar starts at a different point of its walk.
      // AvatarSimulation::Advance is not used, because it would allocate scratch memory per avatar.
      AvatarSimulation* one = &avatars_.back();
      for (int tick = 0; tick < i % 120; ++tick) {
        AvatarSimulation::AdvanceAll({&one, 1}, kTickS, plan_scratch_, evaluator_);
      }
    }
  }

  void Advance() {
    AdvanceStates();
    AvatarSimulation::UpdatePoses(all_, evaluator_);
  }
  /// Advances the avatars without evaluating poses.
  void AdvanceStates() {
    for (AvatarSimulation& avatar : avatars_) {
      if (avatar.queue_size() < 2) Refill(avatar);
    }
    all_.clear();
    for (AvatarSimulation& avatar : avatars_) all_.push_back(&avatar);
    AvatarSimulation::AdvanceStates(all_, kTickS, plan_scratch_);
  }

  [[nodiscard]] const std::vector<AvatarSimulation>& avatars() const { return avatars_; }

 private:
  void Refill(AvatarSimulation& avatar) {
    for (int i = 0; i < 64; ++i) {
      const double length_m = 0.45 + 0.2 * static_cast<double>(random_() % 1000) / 1000.0;
      (void)avatar.Enqueue({.id = 1, .movement = StepRequest{.length_m = length_m}});
    }
  }

  std::mt19937 random_{1};
  std::vector<AvatarSimulation> avatars_;
  std::vector<AvatarSimulation*> all_;
  SoaPoseEvaluator evaluator_;
  PlanScratch plan_scratch_;
};

void AdvanceCrowd(benchmark::State& state, const Library& library, int count, bool plants_feet) {
  Crowd crowd(library, count, {.foot_planting = plants_feet});
  for (auto _ : state) crowd.Advance();
  state.SetItemsProcessed(state.iterations() * count);
}

/// Measures a tick without poses: the ends, plans and starts of movements.
void AdvanceStates(benchmark::State& state, const Library& library, int count) {
  Crowd crowd(library, count);
  for (auto _ : state) crowd.AdvanceStates();
  state.SetItemsProcessed(state.iterations() * count);
}

/// Measures the decision on the next step of walks at various points between start and goal.
void PlanWalkSteps(benchmark::State& state, const Library& library, bool is_rough) {
  std::shared_ptr<const Terrain> terrain;
  if (is_rough) {
    TerrainData data;
    for (int i = 0; i < 400; ++i) {
      const double x = -10.0 + (i % 20);
      const double z = -10.0 + static_cast<double>(i / 20);
      data.boxes.push_back({{x, z}, {x + 0.7, z + 0.7}, 0.03 * (i % 5)});
    }
    terrain = Terrain::Make(std::move(data)).value();
  }
  struct Place {
    WalkRequest walk;
    WalkStance stance;
  };
  const LocomotionProfile& gait = library->locomotion_profile();
  std::mt19937 random(1);
  const auto draw = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() % 1000) / 1000.0;
  };
  std::vector<Place> places(kVariations);
  for (Place& place : places) {
    place.walk.position_m = DVec3(draw(-4.0, 4.0), 0.0, draw(-4.0, 4.0));
    place.walk.heading_rad = draw(-3.0, 3.0);
    // The avatar is in mid-stride with the left foot ahead.
    const double stride_m = draw(0.0, 0.6);
    place.stance.feet[0].position_m = DVec3(0.5 * gait.width_m, 0.0, stride_m);
    place.stance.feet[1].position_m = DVec3(-0.5 * gait.width_m, 0.0, 0.0);
    place.stance.last_moved = Foot::kLeft;
    place.stance.vector.left_from_right_m = DVec3(gait.width_m, 0.0, stride_m);
  }
  std::size_t i = 0;
  int steps = 0;
  for (auto _ : state) {
    const Place& place = places[i++ % kVariations];
    WalkProgress progress{.steps = 1};
    const WalkDecision decision =
        PlanWalkStep(*library, terrain.get(), place.walk, place.stance, progress);
    steps += decision.outcome == WalkOutcome::kStep;
  }
  state.SetItemsProcessed(state.iterations());
  state.counters["steps"] = benchmark::Counter(steps, benchmark::Counter::kAvgIterations);
}

void EncodePose(benchmark::State& state, const Library& library, PoseMode mode) {
  const Crowd crowd(library, 64);
  std::vector<std::byte> bytes(
      protocol::PoseBytes(mode, static_cast<std::size_t>(library->skeleton().joint_count())));
  std::size_t i = 0;
  for (auto _ : state) {
    const ConstPoseSpan pose = crowd.avatars()[i++ % 64].pose();
    if (!protocol::EncodePose(mode, pose.root_position_m, pose.rotations, bytes)) {
      return state.SkipWithError("a pose cannot be encoded");
    }
    benchmark::DoNotOptimize(bytes.data());
  }
  state.SetItemsProcessed(state.iterations());
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(bytes.size()));
}

void DecodePose(benchmark::State& state, const Library& library, PoseMode mode) {
  const Crowd crowd(library, 64);
  const auto joints = static_cast<std::size_t>(library->skeleton().joint_count());
  std::vector<std::vector<std::byte>> bytes(64);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const ConstPoseSpan pose = crowd.avatars()[i].pose();
    bytes[i].resize(protocol::PoseBytes(mode, joints));
    if (!protocol::EncodePose(mode, pose.root_position_m, pose.rotations, bytes[i])) {
      return state.SkipWithError("a pose cannot be encoded");
    }
  }
  Pose pose(static_cast<int>(joints));
  std::size_t i = 0;
  for (auto _ : state) {
    if (!protocol::DecodePose(mode, bytes[i++ % 64], pose.root_position_m, pose.rotations)) {
      return state.SkipWithError("a pose cannot be decoded");
    }
    benchmark::DoNotOptimize(pose.rotations.data());
  }
  state.SetItemsProcessed(state.iterations());
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(bytes[0].size()));
}

protocol::CompactCodec CompactCodecOf(const Library& library) {
  std::vector<std::int16_t> parents;
  for (const Joint& joint : library->skeleton().joints) {
    parents.push_back(static_cast<std::int16_t>(joint.parent));
  }
  return protocol::CompactCodec::Make(ChoosePoseQuantization(*library).joints, parents).value();
}

/// Encodes poses in blocks, as for a batch: copies them in and their bytes out.
void EncodeCompactPose(benchmark::State& state, const Library& library) {
  constexpr auto kBlock = protocol::CompactCodec::kBlock;
  const Crowd crowd(library, 64);
  const protocol::CompactCodec codec = CompactCodecOf(library);
  protocol::CompactCodec::Block block;
  std::vector<std::byte> bytes(kBlock * codec.pose_bytes());
  std::size_t i = 0;
  for (auto _ : state) {
    block.Clear();
    for (std::size_t k = 0; k < kBlock; ++k) {
      const ConstPoseSpan pose = crowd.avatars()[i++ % 64].pose();
      block.Add(pose.root_position_m, pose.rotations);
    }
    codec.Encode(block);
    for (std::size_t k = 0; k < kBlock; ++k) {
      if (!block.fits(k)) return state.SkipWithError("a pose cannot be encoded");
      block.CopyBytes(k, std::span(bytes).subspan(k * codec.pose_bytes(), codec.pose_bytes()));
    }
    benchmark::DoNotOptimize(bytes.data());
  }
  const auto poses = state.iterations() * static_cast<std::int64_t>(kBlock);
  state.SetItemsProcessed(poses);
  state.SetBytesProcessed(poses * static_cast<std::int64_t>(codec.pose_bytes()));
}

void DecodeCompactPose(benchmark::State& state, const Library& library) {
  constexpr auto kBlock = protocol::CompactCodec::kBlock;
  const Crowd crowd(library, kBlock);
  const protocol::CompactCodec codec = CompactCodecOf(library);
  protocol::CompactCodec::Block block;
  for (const AvatarSimulation& avatar : crowd.avatars()) {
    block.Add(avatar.pose().root_position_m, avatar.pose().rotations);
  }
  codec.Encode(block);
  std::vector<std::byte> bytes(kBlock * codec.pose_bytes());
  for (std::size_t k = 0; k < kBlock; ++k) {
    block.CopyBytes(k, std::span(bytes).subspan(k * codec.pose_bytes(), codec.pose_bytes()));
  }
  Pose pose(static_cast<int>(codec.joint_count()));
  std::size_t i = 0;
  for (auto _ : state) {
    const auto one =
        std::span(bytes).subspan(i++ % kBlock * codec.pose_bytes(), codec.pose_bytes());
    if (!codec.Decode(one, pose.root_position_m, pose.rotations)) {
      return state.SkipWithError("a pose cannot be decoded");
    }
    benchmark::DoNotOptimize(pose.rotations.data());
  }
  state.SetItemsProcessed(state.iterations());
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(codec.pose_bytes()));
}

/// Encodes a crowd in one frame that all observers share.
void EncodeBatch(benchmark::State& state, const Library& library, PoseMode mode) {
  const Crowd crowd(library, kCrowd);
  std::vector<protocol::AvatarId> numbers(kCrowd);
  std::iota(numbers.begin(), numbers.end(), 1u);
  const auto avatars = std::make_shared<const std::vector<protocol::AvatarId>>(numbers);
  std::vector<std::uint32_t> all(kCrowd);
  std::iota(all.begin(), all.end(), 0u);
  const auto joints = static_cast<std::uint16_t>(library->skeleton().joint_count());
  protocol::PoseRows rows;
  protocol::PoseBatchComposer composer;
  std::vector<std::byte> frame;
  for (auto _ : state) {
    frame.clear();
    Status status = rows.Begin({1, 0, 0, 1, 1, 0.0, mode, joints}, avatars);
    for (const AvatarSimulation& avatar : crowd.avatars()) {
      if (!status) break;
      status = rows.Add(0, avatar.pose().root_position_m, avatar.pose().rotations);
    }
    if (status) status = composer.Compose(rows, all, {}, frame);
    if (!status) return state.SkipWithError(status.error().text);
    benchmark::DoNotOptimize(frame.data());
  }
  state.SetItemsProcessed(state.iterations() * kCrowd);
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(frame.size()));
}

/// Composes the frame of an observer of 100 out of 10,000 avatars by copying their rows. 50 such
/// observers take turns, so that the rows are as cold in the cache as in a real tick.
void ComposeBatch(benchmark::State& state, const Library& library, PoseMode mode) {
  constexpr std::size_t kRows = 10'000;
  constexpr std::size_t kPicked = 100;
  const Crowd crowd(library, kCrowd);
  std::vector<protocol::AvatarId> numbers(kRows);
  for (std::size_t i = 0; i < kRows; ++i) numbers[i] = static_cast<protocol::AvatarId>(i + 1);
  protocol::PoseRows rows;
  const auto joints = static_cast<std::uint16_t>(library->skeleton().joint_count());
  Status status = rows.Begin({1, 0, 0, 1, 1, 0.0, mode, joints},
                             std::make_shared<const std::vector<protocol::AvatarId>>(numbers));
  for (std::size_t i = 0; i < kRows && status; ++i) {
    const ConstPoseSpan pose = crowd.avatars()[i % kCrowd].pose();
    status = rows.Add(0, pose.root_position_m, pose.rotations);
  }
  std::vector<std::vector<std::uint32_t>> picked(50);
  for (std::size_t observer = 0; observer < picked.size(); ++observer) {
    for (std::size_t i = 0; i < kPicked; ++i) {
      picked[observer].push_back(static_cast<std::uint32_t>(i * (kRows / kPicked) + observer));
    }
  }
  protocol::PoseBatchComposer composer;
  std::size_t turn = 0;
  for (auto _ : state) {
    std::vector<std::byte> frame;
    if (status) status = composer.Compose(rows, picked[turn++ % picked.size()], {}, frame);
    if (!status) return state.SkipWithError(status.error().text);
    benchmark::DoNotOptimize(frame.data());
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(kPicked));
}

/// Reports the size of a library. There are only counters and no meaningful time.
void MeasureLibrary(benchmark::State& state, const Library& library) {
  int examples = 0;
  for (const MotionGroup& group : library->groups()) examples += group.example_count;
  for (auto _ : state) benchmark::DoNotOptimize(examples);
  state.counters["library_bytes"] = static_cast<double>(library->bytes().size());
  state.counters["examples"] = examples;
  state.counters["bytes_per_example"] =
      static_cast<double>(library->bytes().size()) / static_cast<double>(examples);
}

void OpenLibraryAgain(benchmark::State& state, const std::string& name) {
  for (auto _ : state) benchmark::DoNotOptimize(OpenLibrary(name));
}

/// Applies one layer with weight `weight` to a pose.
void ApplyLayerAlone(benchmark::State& state, const Library& library, int index, double weight) {
  const LayerClip& layer = library->layers()[static_cast<std::size_t>(index)];
  Pose pose = library->stand_pose();
  double time_s = 0.0;
  for (auto _ : state) {
    ApplyLayer(layer, time_s += 1.0 / 60.0, weight, pose);
    benchmark::DoNotOptimize(pose.rotations.data());
  }
  state.counters["joints"] = static_cast<double>(layer.joints.size());
}

template <typename... Arguments>
void Register(const std::string& name, Arguments&&... arguments) {
  benchmark::RegisterBenchmark(name.c_str(), std::forward<Arguments>(arguments)...)
      ->Unit(benchmark::kMicrosecond);
}

/// Registers all benchmarks of a library. `path` is its name or path, to open it again.
void RegisterAll(const std::string& path, const Library& library) {
  const std::string name = std::filesystem::path(path).stem().string();
  Register(name + "/library", MeasureLibrary, library);
  Register(name + "/open", OpenLibraryAgain, path);
  for (int i = 0; i < static_cast<int>(library->groups().size()); ++i) {
    const std::string kind =
        std::string(MovementKindName(library->group(i).kind)) + "_" + std::to_string(i);
    Register(name + "/start_movement/" + kind, StartMovementAlone, library, i);
    Register(name + "/start_corrected/" + kind, StartCorrected, library, i);
    Register(name + "/synthesize_step/" + kind, SynthesizeStep, library, i);
    Register(name + "/evaluate_pose/" + kind, EvaluatePose, library, i);
  }
  for (const int count : {1000, 10000}) {
    Register(name + "/advance_crowd/" + std::to_string(count), AdvanceCrowd, library, count, true);
    Register(name + "/advance_states/" + std::to_string(count), AdvanceStates, library, count);
  }
  Register(name + "/advance_crowd_unplanted/1000", AdvanceCrowd, library, kCrowd, false);
  RegisterCrowd(name, library);
  Register(name + "/plan_walk_step/level", PlanWalkSteps, library, false);
  Register(name + "/plan_walk_step/slabs", PlanWalkSteps, library, true);
  for (int i = 0; i < static_cast<int>(library->layers().size()); ++i) {
    const std::string layer = std::string(library->layers()[static_cast<std::size_t>(i)].name);
    Register(name + "/layer/" + layer + "/whole", ApplyLayerAlone, library, i, 1.0);
    Register(name + "/layer/" + layer + "/half", ApplyLayerAlone, library, i, 0.5);
  }
  for (const PoseMode mode : {PoseMode::kFull, PoseMode::kQuantised}) {
    const std::string mode_name = mode == PoseMode::kFull ? "full" : "quantised";
    Register(name + "/encode_pose/" + mode_name, EncodePose, library, mode);
    Register(name + "/encode_batch/" + mode_name, EncodeBatch, library, mode);
    Register(name + "/compose_batch/" + mode_name, ComposeBatch, library, mode);
    Register(name + "/decode_pose/" + mode_name, DecodePose, library, mode);
  }
  Register(name + "/encode_16_poses/compact", EncodeCompactPose, library);
  Register(name + "/decode_pose/compact", DecodeCompactPose, library);
}

/// Selects the instruction set of the kernels: the one with this name, or the widest. Returns an
/// empty text if this machine does not support it.
std::string_view ChooseInstructionSet(std::string_view name) {
  for (const InstructionSet& set : kInstructionSets) {
    if ((hwy::SupportedTargets() & set.target) == 0 || (!name.empty() && name != set.name))
      continue;
    if (!name.empty()) static const OnlyInstructionSet only(set.target);
    return set.name;
  }
  return name.empty() ? "none" : "";
}

int Run(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  std::vector<std::string> names = {"builtin"};
  std::string_view wanted_set;
  constexpr std::string_view kSetOption = "--instruction-set=";
  if (argc > 1 && std::string_view(argv[1]).starts_with(kSetOption)) {
    wanted_set = std::string_view(argv[1]).substr(kSetOption.size());
    --argc;
    ++argv;
  }
  const std::string_view set = ChooseInstructionSet(wanted_set);
  if (set.empty()) {
    std::fprintf(stderr, "stridewire-bench: this machine has no instruction set '%.*s'\n",
                 static_cast<int>(wanted_set.size()), wanted_set.data());
    return 2;
  }
  benchmark::AddCustomContext("stridewire", kVersion);
  benchmark::AddCustomContext("instruction_set", std::string(set));
  for (int i = 1; i < argc; ++i) names.emplace_back(argv[i]);
  for (const std::string& name : names) {
    Expected<Library> library = OpenLibrary(name);
    if (!library) {
      std::fprintf(stderr, "stridewire-bench: %s\n", Describe(library.error()).c_str());
      return 2;
    }
    RegisterAll(name, *library);
    if (name == "builtin") RegisterObservers(name, *library);
  }
  RegisterScaledCrowds();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

}  // namespace
}  // namespace stridewire

int main(int argc, char** argv) { return stridewire::Run(argc, argv); }
