// Benchmarks of the work of a tick for a crowd: poses are evaluated together, planted and encoded.
// The argument is the number of avatars. For comparison, the same run measures a lower bound for
// this machine ("floor"), the reference implementation, and sampling each example separately.

#include <benchmark/benchmark.h>

#include <memory>
#include <numeric>
#include <random>
#include <span>
#include <vector>

#include "bench_libraries.h"
#include "reference_evaluation.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/pose_quantization.h"
#include "runtime/pose/evaluation_batcher.h"
#include "runtime/weights/correction.h"
#include "scaled_library.h"
#include "stridewire/protocol/pose_rows.h"
#include "world/encoded_pose_cache.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;

constexpr double kTickS = 1.0 / 60.0;
// Number of different steps. There are enough of them that branch predictors cannot learn them.
constexpr int kKinds = 240;

// Avatars that repeat steps of real walks. Each starts at a different time within its step.
class Steps {
 public:
  struct Walker {
    const Movement* movement;
    double time_s;
    double duration_s;
    std::uint32_t number;
    std::uint32_t revision = 1;
  };

  Steps(const Library& library, int count, bool plants_feet) {
    std::mt19937 random(1);
    std::vector<Movement> kinds;
    AvatarSimulation avatar(library, {}, {.foot_planting = plants_feet});
    while (kinds.size() < kKinds) {
      if (avatar.queue_size() < 2) {
        const double length_m = 0.45 + 0.2 * static_cast<double>(random() % 1000) / 1000.0;
        (void)avatar.Enqueue({.id = 1, .movement = StepRequest{.length_m = length_m}});
        continue;
      }
      avatar.Advance(kTickS);
      for (const AvatarEvent& event : avatar.events()) {
        if (event.type == AvatarEventType::kStarted) kinds.push_back(*avatar.movement());
      }
    }
    examples_ = static_cast<double>(library->group(kinds.back().group).example_count);
    walkers_.reserve(static_cast<std::size_t>(count));
    movements_.reserve(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) {
      const Movement& movement =
          movements_.emplace_back(kinds[static_cast<std::size_t>(i) % kKinds]);
      const double part = static_cast<double>(random() % 1000) / 1000.0;
      walkers_.push_back({&movement, part * movement.duration_s(), movement.duration_s(),
                          static_cast<std::uint32_t>(i)});
    }
  }

  // Advances all walkers to the next tick.
  void Advance() {
    for (Walker& walker : walkers_) {
      walker.time_s += kTickS;
      if (walker.time_s > walker.duration_s) {
        walker.time_s -= walker.duration_s;
        ++walker.revision;
      }
    }
  }
  [[nodiscard]] std::span<const Walker> walkers() const { return walkers_; }
  [[nodiscard]] double examples() const { return examples_; }

 private:
  double examples_ = 0.0;
  std::vector<Movement> movements_;
  std::vector<Walker> walkers_;
};

void Count(benchmark::State& state, const Steps& steps, int count) {
  state.SetItemsProcessed(state.iterations() * count);
  state.counters["examples"] = steps.examples();
}

// Evaluates the poses of each tick, some ticks ahead as the server does (server::EncodedPoseCache),
// and discards them.
void EvaluateCrowd(benchmark::State& state, const Library& library, bool plants_feet) {
  // The crowd is distributed over shards: threads that share only the library.
  const int count = static_cast<int>(state.range(0)) / state.threads();
  Steps steps(library, count, plants_feet);
  const auto phases = static_cast<int>(server::EncodedPoseCache::PhasesOf(steps.walkers().size()));
  struct Ahead {
    std::uint32_t revision = 0;
    int left = 0;
  };
  std::vector<Ahead> ahead(steps.walkers().size());
  std::vector<const Steps::Walker*> due;
  SoaPoseEvaluator evaluator(*library, phases);
  EvaluationBatcher queue;
  std::uint32_t tick = 0;
  for (auto _ : state) {
    ++tick;
    steps.Advance();
    for (const Steps::Walker& walker : steps.walkers()) {
      Ahead& poses = ahead[walker.number];
      if (poses.revision == walker.revision && --poses.left > 0) continue;
      SoaPoseEvaluator::PrefetchTimes(*walker.movement);
      due.push_back(&walker);
    }
    for (const Steps::Walker* walker : due) {
      const int most = phases - static_cast<int>(tick + walker->number) % phases;
      const int wanted = SampleRunCount(*walker->movement, walker->time_s, kTickS, 1, most);
      ahead[walker->number] = {walker->revision, wanted};
      queue.Add({walker->movement, walker->time_s, kTickS}, wanted, walker->number);
    }
    due.clear();
    queue.Evaluate(evaluator, [](auto&&, int, const SoaPose& poses) {
      benchmark::DoNotOptimize(poses.rotations());
      benchmark::ClobberMemory();
    });
  }
  Count(state, steps, count);
}

// Does all the work of a tick for each pose: evaluates, plants and quantises it, and copies it into
// the frame that observers share.
void WholePose(benchmark::State& state, const Library& library) {
  const auto count = static_cast<int>(state.range(0));
  Steps steps(library, count, true);
  std::vector<std::int16_t> parents;
  for (const Joint& joint : library->skeleton().joints) {
    parents.push_back(static_cast<std::int16_t>(joint.parent));
  }
  const auto codecs =
      protocol::CompactCodecs::Make(ChoosePoseQuantization(*library).joints, parents, {}).value();
  server::EncodedPoseCache cache(std::make_shared<server::PoseScratch>(library), &codecs);
  constexpr auto kMode = protocol::PoseMode::kCompact;
  cache.SetModes(std::array{kMode}, 1);
  std::vector<server::EncodedPoseCache::Slot> slots(steps.walkers().size());
  std::vector<protocol::AvatarId> numbers(steps.walkers().size());
  std::iota(numbers.begin(), numbers.end(), 1u);
  const auto avatars = std::make_shared<const std::vector<protocol::AvatarId>>(numbers);
  std::vector<std::uint32_t> all(numbers.size());
  std::iota(all.begin(), all.end(), 0u);
  protocol::PoseRows rows;
  protocol::PoseBatchComposer composer;
  protocol::PoseBatchInfo info;
  info.world = 1;
  info.mode = kMode;
  info.joint_count = static_cast<std::uint16_t>(parents.size());
  std::vector<std::byte> frame;
  const auto tick = [&]() -> Status {
    ++info.tick;
    steps.Advance();
    cache.BeginStep(info.tick, kTickS, slots.size());
    for (const Steps::Walker& walker : steps.walkers()) {
      if (cache.Contains(slots[walker.number], walker.revision)) continue;
      cache.Schedule(slots[walker.number], walker.revision, *walker.movement, walker.time_s);
    }
    cache.FinishStep();
    Status status = rows.Begin(info, avatars, codecs.Find(kMode));
    for (std::size_t i = 0; i < slots.size(); ++i) {
      const server::EncodedPoseCache::Encoded encoded = cache.Find(slots[i].number(), kMode);
      rows.AddEncoded(0, encoded.is_uncompressed, encoded.bytes);
    }
    std::span<const std::uint32_t> left = all;
    while (!left.empty() && status) {
      const auto part = left.first(composer.CountThatFit(rows, left));
      frame.clear();
      status = composer.Compose(rows, part, {}, frame);
      left = left.subspan(part.size());
      benchmark::DoNotOptimize(frame.data());
    }
    return status;
  };
  // Warm up until each walker has been evaluated in its phase.
  for (std::size_t i = 0; i < 2 * server::EncodedPoseCache::kMaxTicksAhead; ++i) (void)tick();
  for (auto _ : state) {
    if (const Status status = tick(); !status) return state.SkipWithError(status.error().text);
    if (rows.pose_count() != slots.size()) return state.SkipWithError("poses are missing");
  }
  Count(state, steps, count);
}

// Synthesizes whole steps, sixteen side by side: corrects the parameters, computes the weights and
// evaluates thirty frames.
void MakeSteps(benchmark::State& state, const Library& library) {
  constexpr std::size_t kSteps = 16;
  constexpr int kFrames = 30;
  const MotionGroup& group = library->group(0);
  const auto d = static_cast<std::size_t>(group.parameter_count());
  std::mt19937 random(1);
  std::vector<ParameterValues> wanted(kKinds);
  for (ParameterValues& parameters : wanted) {
    parameters.count = static_cast<int>(d);
    // Use parameters half-way between two examples.
    for (int corner = 0; corner < 2; ++corner) {
      const auto site =
          group.site(static_cast<int>(random() % static_cast<unsigned>(group.example_count)));
      for (std::size_t l = 0; l < d; ++l) parameters.values[l] += 0.5 * site[l];
    }
  }
  CorrectionScratch scratch(*library);
  Pose measured(library->skeleton().joint_count());
  std::vector<Movement> movements(kSteps);
  for (Movement& movement : movements) movement.difference = measured;
  SoaPoseEvaluator evaluator(*library, kFrames);
  std::array<SampleRun, kSteps> runs;
  std::size_t next = 0;
  for (auto _ : state) {
    for (std::size_t i = 0; i < kSteps; ++i) {
      CorrectWeights(group, wanted[next++ % kKinds], DefaultCorrectionLimits(group), scratch,
                     movements[i]);
      movements[i].group = 0;
      StartWeighted(group, {}, movements[i]);
      runs[i] = {&movements[i], 0.0, movements[i].duration_s() / (kFrames - 1)};
    }
    evaluator.Begin(runs, kFrames);
    for (int frame = 0; frame < kFrames; ++frame) {
      benchmark::DoNotOptimize(evaluator.Next().roots_m());
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(kSteps));
  state.counters["examples"] = static_cast<double>(group.example_count);
}

// Computes y += w x over floats, with the widest vectors of the machine.
[[gnu::target_clones("avx512f", "avx2", "default")]] void MultiplyAdd(const float* x, float w,
                                                                      float* y, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) y[i] += w * x[i];
}

// An array of zeros that begins at a cache line. Otherwise results would depend on the addresses
// that the allocator returns.
class LineAligned {
 public:
  explicit LineAligned(std::size_t count) : floats_(count + kLineFloats) {
    void* at = floats_.data();
    std::size_t bytes = floats_.size() * sizeof(float);
    begin_ = static_cast<float*>(
        std::align(kLineFloats * sizeof(float), count * sizeof(float), at, bytes));
  }
  [[nodiscard]] float* data() { return begin_; }

 private:
  static constexpr std::size_t kLineFloats = 16;
  std::vector<float> floats_;
  float* begin_;
};

// Measures a lower bound: touches only the bytes that are necessary for several poses of a
// movement, with one multiply-add per float. At 30 cells per second, a run of eight poses passes
// seven grid points, and a run of sixteen passes eleven. Each grid point has a row per example. A
// pose combines four of their sums, and its quantised form is a quarter of a row. The foot plan and
// the difference pose are read once.
void Floor(benchmark::State& state, const Library& library) {
  const auto count = static_cast<std::size_t>(state.range(0));
  const std::size_t poses = server::EncodedPoseCache::PhasesOf(count);
  const std::size_t passed = poses / 2 + 3;
  const MotionGroup& group = library->group(0);
  const auto row = static_cast<std::size_t>(library->layout().row_floats);
  const auto examples = static_cast<std::size_t>(group.row_count());
  const std::size_t points = static_cast<std::size_t>(group.grid_point_count) - passed;
  // The foot plan and the difference pose also occupy whole cache lines.
  const std::size_t plan = (sizeof(PackedFootPlan) / sizeof(float) + 15) / 16 * 16;
  const std::size_t own = plan + row;
  LineAligned owns(count * own);
  LineAligned told(count * poses * row / 4);
  LineAligned sums(passed * row);
  LineAligned pose(std::max(own, row));
  std::size_t tick = 0;
  for (auto _ : state) {
    ++tick;
    for (std::size_t i = tick % poses; i < count; i += poses) {
      const std::size_t first = (i + tick) % points;
      for (std::size_t p = 0; p < passed; ++p) {
        for (std::size_t e = 0; e < examples; ++e) {
          MultiplyAdd(&group.grid[((first + p) * examples + e) * row], 1e-3f, sums.data() + p * row,
                      row);
        }
      }
      MultiplyAdd(owns.data() + i * own, 0.25f, pose.data(), own);
      for (std::size_t k = 0; k < poses; ++k) {
        for (std::size_t j = 0; j < 4; ++j) {
          MultiplyAdd(sums.data() + (k / 2 + j) * row, 0.25f, pose.data(), row);
        }
        MultiplyAdd(pose.data(), 0.25f, told.data() + (i * poses + k) * row / 4, row / 4);
      }
    }
    benchmark::DoNotOptimize(told.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(count));
}

// Evaluates the same poses one by one with the reference implementation.
void ReferencePoses(benchmark::State& state, const Library& library, bool samples_examples) {
  const auto count = static_cast<int>(state.range(0));
  Steps steps(library, count, false);
  Pose shown(library->skeleton().joint_count());
  for (auto _ : state) {
    for (const Steps::Walker& walker : steps.walkers()) {
      const MotionGroup& group = library->group(walker.movement->group);
      (samples_examples ? EvaluateMovementBySampling : EvaluateMovementByReference)(
          group, library->layout(), *walker.movement, walker.time_s, shown);
    }
  }
  Count(state, steps, count);
}

template <typename... Arguments>
void Register(const std::string& name, Arguments&&... arguments) {
  for (const int count : {100, 1000, 10000, 100000}) {
    benchmark::RegisterBenchmark(name.c_str(), std::forward<Arguments>(arguments)...)
        ->Arg(count)
        ->Unit(benchmark::kMicrosecond);
  }
}

}  // namespace

void RegisterCrowd(const std::string& name, const Library& library) {
  Register(name + "/crowd/floor", Floor, library);
  Register(name + "/crowd/evaluate", EvaluateCrowd, library, false);
  Register(name + "/crowd/evaluate_and_plant", EvaluateCrowd, library, true);
  Register(name + "/crowd/whole_pose", WholePose, library);
  benchmark::RegisterBenchmark((name + "/shards/evaluate_and_plant").c_str(), EvaluateCrowd,
                               library, true)
      ->Arg(10000)
      ->Threads(1)
      ->Threads(2)
      ->UseRealTime()
      ->Unit(benchmark::kMicrosecond);
  benchmark::RegisterBenchmark((name + "/crowd/steps").c_str(), MakeSteps, library)
      ->Unit(benchmark::kMicrosecond);
  for (const bool samples : {false, true}) {
    benchmark::RegisterBenchmark((name + (samples ? "/crowd/sampled" : "/crowd/reference")).c_str(),
                                 ReferencePoses, library, samples)
        ->Arg(1000)
        ->Unit(benchmark::kMicrosecond);
  }
}

void RegisterScaledCrowds() {
  const auto add = [](const std::string& name, int examples, int joints) {
    const Library library = MakeScaledLibrary(examples, joints);
    for (const int count : {1000, 10000}) {
      const auto set = [&](benchmark::internal::Benchmark* bench) {
        bench->Arg(count)->Unit(benchmark::kMicrosecond);
      };
      set(benchmark::RegisterBenchmark((name + "/crowd/floor").c_str(), Floor, library));
      set(benchmark::RegisterBenchmark((name + "/crowd/evaluate").c_str(), EvaluateCrowd, library,
                                       false));
      set(benchmark::RegisterBenchmark((name + "/crowd/whole_pose").c_str(), WholePose, library));
    }
  };
  for (const int examples : {4, 8, 15, 30, 60}) {
    add("examples_" + std::to_string(examples), examples, 31);
  }
  for (const int joints : {64, 128}) add("joints_" + std::to_string(joints), 15, joints);
}

}  // namespace stridewire
