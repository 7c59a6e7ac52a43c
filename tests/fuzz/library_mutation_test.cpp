// Mutated library files: each must be rejected with an error, or result in a library whose groups
// can all be evaluated and used for walking. STRIDEWIRE_FUZZ_COUNT sets the number of mutations
// (500), STRIDEWIRE_FUZZ_SEED repeats a run.

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "offline/build/interpolation_error.h"
#include "offline/build/refine.h"
#include "offline/builtin/builtin_library.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/library_file.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "stridewire/offline/library_builder.h"
#include "test_library.h"

namespace stridewire {
namespace {

using Bytes = std::vector<std::byte>;

// A valid library and the byte ranges of its grids, which make up nearly all of the file.
struct Seed {
  Bytes bytes;
  std::vector<std::pair<std::size_t, std::size_t>> grids;  // [begin, end).

  explicit Seed(const MotionLibrary& library)
      : bytes(library.bytes().begin(), library.bytes().end()) {
    for (const MotionGroup& group : library.groups()) {
      const auto begin = static_cast<std::size_t>(
          reinterpret_cast<const std::byte*>(group.grid.data()) - library.bytes().data());
      grids.emplace_back(begin, begin + group.grid.size_bytes());
    }
  }
  [[nodiscard]] bool IsInGrid(std::size_t at) const {
    return std::any_of(grids.begin(), grids.end(),
                       [&](const auto& grid) { return at >= grid.first && at < grid.second; });
  }
};

class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : random_(seed) {}

  std::size_t Below(std::size_t n) { return static_cast<std::size_t>(random_() % n); }
  double Uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }

  // Damage without a matching hash, as from a disk, a network or a foreign program.
  Bytes Damage(const Seed& seed) {
    Bytes bytes = seed.bytes;
    switch (Below(6)) {
      case 0: bytes[Below(bytes.size())] ^= std::byte(1u << Below(8)); break;
      case 1: bytes.resize(Below(bytes.size())); break;
      case 2: bytes.resize(bytes.size() + 1 + Below(300), std::byte(random_())); break;
      case 3: Extreme(bytes, Below(kLibraryHeaderBytes / 4) * 4, kLibraryHeaderBytes); break;
      case 4: {
        const std::size_t from = Below(bytes.size());
        for (std::size_t i = from; i < std::min(bytes.size(), from + 500); ++i) {
          bytes[i] = std::byte(random_());
        }
        break;
      }
      default: {
        const std::size_t size = Below(3 * kLibraryHeaderBytes);
        std::generate_n(bytes.begin(), size, [&] { return std::byte(random_()); });
      }
    }
    return bytes;
  }

  // Damage with a matching header, which the FlatBuffers verifier and later checks have to detect.
  Bytes Forge(const Seed& seed) {
    Bytes bytes = seed.bytes;
    const std::size_t mutations = Below(2) == 0 ? 1 : 1 + Below(6);
    for (std::size_t i = 0; i < mutations && bytes.size() > kLibraryHeaderBytes; ++i) {
      ForgeOne(seed, bytes);
    }
    const auto header = MakeLibraryHeader(std::span(bytes).subspan(kLibraryHeaderBytes));
    std::copy(header.begin(), header.end(), bytes.begin());
    return bytes;
  }

 private:
  // Prefers positions outside the grids, where every byte has a different meaning.
  std::size_t Place(const Seed& seed, std::size_t size, std::size_t alignment) {
    for (int attempt = 0; attempt < 200; ++attempt) {
      const std::size_t at =
          kLibraryHeaderBytes + Below((size - kLibraryHeaderBytes) / alignment) * alignment;
      if (attempt == 0 ? Below(4) == 0 : !seed.IsInGrid(at)) return at;
    }
    return kLibraryHeaderBytes;
  }

  template <typename T>
  static void Put(Bytes& bytes, std::size_t at, T value) {
    if (at + sizeof(T) <= bytes.size()) std::memcpy(&bytes[at], &value, sizeof(T));
  }

  void Extreme(Bytes& bytes, std::size_t at, std::size_t end) {
    static constexpr std::uint32_t kIntegers[] = {
        0, 1, 2, 7, 0xff, 0x100, 0xffff, 0x10000, 0x7fffffff, 0x80000000, 0xffffffff, 0xfffffffe};
    static constexpr double kNumbers[] = {0.0,
                                          -0.0,
                                          1.0,
                                          -1.0,
                                          1e-310,
                                          1e-12,
                                          1e-7,
                                          1e-3,
                                          0.02,
                                          99.0,
                                          599.0,
                                          1e6,
                                          -1e9,
                                          1e38,
                                          1e300,
                                          -1e308,
                                          std::numeric_limits<double>::infinity(),
                                          -std::numeric_limits<double>::infinity(),
                                          std::numeric_limits<double>::quiet_NaN()};
    const std::size_t room = std::min(end, bytes.size()) - at;
    const double number = kNumbers[Below(std::size(kNumbers))];
    switch (Below(3)) {
      case 0: Put(bytes, at, kIntegers[Below(std::size(kIntegers))]); break;
      case 1: Put(bytes, at, static_cast<float>(number)); break;
      default:
        if (room >= 8) Put(bytes, at, number);
    }
  }

  void ForgeOne(const Seed& seed, Bytes& bytes) {
    switch (Below(9)) {
      case 0: bytes[Place(seed, bytes.size(), 1)] = std::byte(random_()); break;
      case 1: bytes[Place(seed, bytes.size(), 1)] ^= std::byte(1u << Below(8)); break;
      case 2:
      case 3: Extreme(bytes, Place(seed, bytes.size(), 4), bytes.size()); break;
      case 4: {  // Changes a double slightly or strongly.
        const std::size_t at = Place(seed, bytes.size(), 8);
        double value = 0.0;
        if (at + sizeof value > bytes.size()) break;
        std::memcpy(&value, &bytes[at], sizeof value);
        Put(bytes, at, value * (Below(2) == 0 ? 1.0 + 1e-3 * Uniform() : 20.0 * Uniform() - 10.0));
        break;
      }
      case 5: {  // The same for floats.
        const std::size_t at = Place(seed, bytes.size(), 4);
        float value = 0.0f;
        if (at + sizeof value > bytes.size()) break;
        std::memcpy(&value, &bytes[at], sizeof value);
        Put(bytes, at, value * static_cast<float>(4.0 * Uniform() - 2.0));
        break;
      }
      case 6: {  // Changes a count or offset slightly.
        const std::size_t at = Place(seed, bytes.size(), 4);
        std::uint32_t value = 0;
        if (at + sizeof value > bytes.size()) break;
        std::memcpy(&value, &bytes[at], sizeof value);
        Put(bytes, at, value + static_cast<std::uint32_t>(Below(9)) - 4);
        break;
      }
      case 7: {  // Copies bytes from elsewhere.
        const std::size_t from = Place(seed, bytes.size(), 8);
        const std::size_t to = Place(seed, bytes.size(), 8);
        const std::size_t count =
            std::min<std::size_t>(8 * (1 + Below(16)), bytes.size() - std::max(from, to));
        std::memmove(&bytes[to], &bytes[from], count);
        break;
      }
      default:
        if (Below(8) != 0) break;
        if (Below(2) == 0) {
          bytes.resize(kLibraryHeaderBytes + Below(bytes.size() - kLibraryHeaderBytes + 1));
        } else {
          bytes.resize(bytes.size() + 1 + Below(100), std::byte(random_()));
        }
    }
  }

  std::mt19937_64 random_;
};

bool IsFinite(const Vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

void ExpectPose(ConstPoseSpan pose, const char* what) {
  ASSERT_TRUE(IsFinite(pose.root_position_m)) << what;
  for (const Quat& q : pose.rotations) ASSERT_NEAR(glm::length(q), 1.0f, 2e-3f) << what;
}

// Evaluates every group at some sites and at points inside and around their hull, over its time.
void Evaluate(const MotionLibrary& library, Mutator& mutator) {
  const int joints = library.skeleton().joint_count();
  std::vector<double> scratch(static_cast<std::size_t>(library.max_row_count()));
  GridCache cache(library.layout());
  Pose pose(joints);
  Movement movement;
  movement.difference = Pose(joints);
  for (int g = 0; g < static_cast<int>(library.groups().size()); ++g) {
    const MotionGroup& group = library.group(g);
    const std::size_t d = group.parameters.size();
    for (int sample = 0; sample < 6; ++sample) {
      const auto a =
          group.site(static_cast<int>(mutator.Below(static_cast<std::size_t>(group.site_count))));
      const auto b =
          group.site(static_cast<int>(mutator.Below(static_cast<std::size_t>(group.site_count))));
      const double share = sample < 2 ? 0.0 : 1.2 * mutator.Uniform() - 0.1;
      std::vector<double> parameters(d);
      for (std::size_t l = 0; l < d; ++l) parameters[l] = a[l] + share * (b[l] - a[l]);
      StartMovement(group, g, parameters, {{1.0, 0.0, 2.0}, 0.5}, scratch, movement);
      double sum = 0.0;
      double size = 0.0;
      for (const float weight : movement.weights) {
        sum += static_cast<double>(weight);
        size += std::fabs(static_cast<double>(weight));
      }
      ASSERT_NEAR(sum, 1.0, 1e-5 * std::max(1.0, size));
      ASSERT_GT(movement.duration_s(), 0.0);
      ASSERT_LT(movement.duration_s(), 10'000.0);
      cache.Clear();
      EvaluateBlend(group, library.layout(), movement, 0.0, cache, movement.difference);
      Subtract(library.stand_pose(), movement.difference, movement.difference);
      for (int k = -1; k <= 7; ++k) {
        EvaluateMovement(group, library.layout(), movement, movement.duration_s() * k / 6.0, cache,
                         pose);
        ExpectPose(pose, "movement");
      }
    }
    const InterpolationError error = MeasureInterpolationError(library, g, 2);
    ASSERT_TRUE(std::isfinite(error.max_m) && std::isfinite(error.mean_m));
  }
}

// Gives an avatar all requests that the library accepts.
void Walk(const std::shared_ptr<const MotionLibrary>& library, Mutator& mutator) {
  AvatarSimulation avatar(library, {});
  for (int tick = 0; tick < 150; ++tick) {
    if (mutator.Below(8) == 0) {
      MovementRequest request;
      const double length_m = 2.0 * mutator.Uniform() - 0.5;
      switch (mutator.Below(5)) {
        case 0: request.movement = JumpRequest{length_m, 0.0, 0.0}; break;
        case 1: request.movement = StandRequest{0.1}; break;
        case 2: request.movement = StepRequest{Foot::kLeft, length_m, 0.1, 0.2, 1.0}; break;
        default: request.movement = StepRequest{{}, length_m, {}, 0.0, 0.0};
      }
      static_cast<void>(avatar.Enqueue(request));
    }
    if (!library->layers().empty() && mutator.Below(20) == 0) {
      static_cast<void>(
          avatar.SetLayer({.layer = static_cast<int>(mutator.Below(library->layers().size())),
                           .enabled = mutator.Below(3) != 0,
                           .weight = mutator.Uniform(),
                           .blend_s = mutator.Uniform(),
                           .speed = 0.1 + 3.0 * mutator.Uniform()}));
    }
    avatar.Advance(mutator.Below(20) == 0 ? 1.0 : 1.0 / 60.0);
    ASSERT_NO_FATAL_FAILURE(ExpectPose(avatar.pose(), "avatar"));
    ASSERT_TRUE(std::isfinite(avatar.base().heading_rad));
  }
}

TEST(LibraryMutation, EveryFileIsRejectedOrCanBePlayed) {
  const char* count_text = std::getenv("STRIDEWIRE_FUZZ_COUNT");
  const char* seed_text = std::getenv("STRIDEWIRE_FUZZ_SEED");
  const std::uint64_t count = count_text != nullptr ? std::strtoull(count_text, nullptr, 10) : 500;
  const std::uint64_t seed =
      seed_text != nullptr ? std::strtoull(seed_text, nullptr, 10) : std::random_device{}();
  std::cout << "seed " << seed << ", " << count << " files\n";

  LibraryBuilder builder;
  const auto builtin = builder.Build(GenerateBuiltinLibrary());
  ASSERT_TRUE(builtin.has_value());
  const auto refined =
      Refine(MakeTestLibrary(), {.max_error_m = 0.0, .max_pseudoexamples = 3, .samples = 100});
  ASSERT_TRUE(refined.has_value());
  ASSERT_GT(refined->library->group(0).site_count, refined->library->group(0).example_count);
  const std::vector<Seed> seeds = {Seed(*MakeTestLibrary()), Seed(*refined->library),
                                   Seed(**builtin)};
  for (const Seed& good : seeds) ASSERT_TRUE(MotionLibrary::FromBytes(good.bytes).has_value());

  Mutator mutator(seed);
  std::uint64_t accepted = 0;
  std::map<std::string, int> refused;
  for (std::uint64_t i = 0; i < count; ++i) {
    SCOPED_TRACE(testing::Message() << "seed " << seed << ", file " << i);
    // Prefer the small libraries, which allow more mutations per second.
    const Seed& good = seeds[mutator.Below(6) == 0 ? 2 : mutator.Below(2)];
    const bool forged = mutator.Below(4) != 0;
    const Bytes bytes = forged ? mutator.Forge(good) : mutator.Damage(good);
    const auto library = MotionLibrary::FromBytes(bytes);
    if (!library) {
      ASSERT_GT(std::strlen(library.error().text), 5u);
      ASSERT_LT(Describe(library.error()).size(), 200u);
      ++refused[library.error().text];
      continue;
    }
    if (!forged) {
      ASSERT_TRUE(bytes == good.bytes) << "damage went unnoticed";
    }
    ++accepted;
    ASSERT_NO_FATAL_FAILURE(Evaluate(**library, mutator));
    ASSERT_NO_FATAL_FAILURE(Walk(*library, mutator));
  }
  std::cout << accepted << " accepted; refused:\n";
  for (const auto& [text, times] : refused) std::cout << "  " << times << "  " << text << "\n";
  // If the mutations always or never broke a file, or always in the same place, the test would be
  // useless.
  if (count >= 500) {
    EXPECT_GT(accepted, count / 20);
    EXPECT_GT(refused.size(), 8u);
  }
}

}  // namespace
}  // namespace stridewire
