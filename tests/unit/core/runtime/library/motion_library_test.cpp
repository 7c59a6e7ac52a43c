#include "stridewire/runtime/motion_library.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "runtime/library/cardinal_basis.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "stridewire/offline/library_builder.h"
#include "test_library.h"

namespace stridewire {
namespace {

std::vector<std::byte> Copy(std::span<const std::byte> bytes) {
  return {bytes.begin(), bytes.end()};
}

std::string CodeOf(std::span<const std::byte> bytes) {
  const auto library = MotionLibrary::FromBytes(bytes);
  return library ? "none" : std::string(ErrorCodeName(library.error().code));
}

TEST(MotionLibrary, ContainsWhatTheBuilderWrote) {
  const auto library = MakeTestLibrary();
  ASSERT_EQ(library->groups().size(), 3u);
  EXPECT_EQ(library->skeleton().joints[2].name, "LeftLeg");
  EXPECT_EQ(library->group(0).kind, MovementKind::kStepLeft);
  EXPECT_EQ(library->group(0).example_count, 15);
  EXPECT_EQ(library->group(2).parameters[0].name, ParameterName::kLength);
  EXPECT_EQ(library->group(2).parameters[0].max, 1.2);
  EXPECT_EQ(library->hash().size(), 32u);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(library->group(0).grid.data()) % 64, 0u);
}

TEST(MotionLibrary, BuildsTheSameBytesFromTheSameInput) {
  EXPECT_EQ(Copy(MakeTestLibrary()->bytes()), Copy(MakeTestLibrary()->bytes()));
}

TEST(MotionLibrary, OpensAFile) {
  const auto library = MakeTestLibrary();
  const auto path = std::filesystem::temp_directory_path() /
                    ("motion_library_test_" + std::to_string(::getpid()) + ".swl");
  {
    std::ofstream out(path, std::ios::binary);
    out.write(reinterpret_cast<const char*>(library->bytes().data()),
              static_cast<std::streamsize>(library->bytes().size()));
  }
  const auto opened = MotionLibrary::Open(path);
  ASSERT_TRUE(opened.has_value()) << Describe(opened.error());
  EXPECT_EQ((*opened)->hash(), library->hash());
  std::filesystem::remove(path);
  const auto missing = MotionLibrary::Open(path);
  ASSERT_FALSE(missing.has_value());
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
  EXPECT_NE(Describe(missing.error()).find(path.string()), std::string::npos);
  EXPECT_EQ(MotionLibrary::Open(std::filesystem::temp_directory_path()).error().code,
            ErrorCode::kIo);
}

TEST(MotionLibrary, ReportsDamagedTruncatedAndForeignFiles) {
  const std::vector<std::byte> good = Copy(MakeTestLibrary()->bytes());
  EXPECT_EQ(CodeOf({}), "malformed");
  EXPECT_EQ(CodeOf(std::span(good).first(40)), "malformed");
  EXPECT_EQ(CodeOf(std::span(good).first(good.size() - 1)), "malformed");
  std::vector<std::byte> bytes = good;
  bytes[0] = std::byte{'X'};
  EXPECT_EQ(CodeOf(bytes), "malformed");
  bytes = good;
  bytes[8] = std::byte{MotionLibrary::kFormatVersion + 1};
  EXPECT_EQ(CodeOf(bytes), "version_mismatch");
  bytes = good;
  bytes[bytes.size() / 2] ^= std::byte{1};
  EXPECT_EQ(CodeOf(bytes), "malformed");
  bytes = good;
  bytes.push_back(std::byte{0});
  EXPECT_EQ(CodeOf(bytes), "malformed");
}

TEST(LibraryBuilder, NamesInvalidExamples) {
  const auto refused = [](const auto& spoil) {
    RawLibrary raw = MakeTestRawLibrary();
    spoil(raw);
    LibraryBuilder builder;
    const auto library = builder.Build(raw);
    return library ? std::string() : Describe(library.error());
  };
  EXPECT_NE(refused([](RawLibrary& raw) {
              raw.groups[1].examples[3].keytimes_s[1] = -1.0;
            }).find("step_right example toy step"),
            std::string::npos);
  EXPECT_NE(refused([](RawLibrary& raw) { raw.groups[0].examples[0].parameters.pop_back(); }), "");
  EXPECT_NE(refused([](RawLibrary& raw) { raw.groups[0].examples[0].parameters[0] = NAN; }), "");
  EXPECT_NE(refused([](RawLibrary& raw) { raw.groups[0].examples[0].keytimes_s.back() = 9.0; }),
            "");
  EXPECT_NE(refused([](RawLibrary& raw) { raw.groups[0].examples[0].clip.fps = 0.0; }), "");
  EXPECT_NE(refused([](RawLibrary& raw) { raw.groups.clear(); }), "");
  EXPECT_NE(refused([](RawLibrary& raw) { raw.skeleton.joints[3].parent = 5; }), "");
  EXPECT_NE(refused([](RawLibrary& raw) { raw.stand_pose.rotations.pop_back(); }), "");
}

TEST(LibraryBuilder, AveragesNearDuplicates) {
  RawLibrary raw = MakeTestRawLibrary();
  RawExample twin = raw.groups[0].examples[5];
  twin.parameters[0] += 0.00005;
  raw.groups[0].examples.push_back(twin);
  LibraryBuilder builder;
  const auto library = builder.Build(raw);
  ASSERT_TRUE(library.has_value()) << Describe(library.error());
  EXPECT_EQ((*library)->group(0).example_count, 15);
  ASSERT_FALSE(builder.notes.empty());
  EXPECT_NE(builder.notes[0].text.find("16 examples averaged to 15"), std::string::npos);
}

TEST(LibraryBuilder, StoresTheClips) {
  const RawLibrary raw = MakeTestRawLibrary();
  const auto library = MakeTestLibrary();
  double largest_rad = 0.0;
  for (int g = 0; g < 3; ++g) {
    const MotionGroup& group = library->group(g);
    GridCache cache(library->layout());
    std::vector<double> scratch(15);
    Pose got(7);
    Pose expected(7);
    for (int e = 0; e < group.example_count; ++e) {
      const RawExample& example =
          raw.groups[static_cast<std::size_t>(g)].examples[static_cast<std::size_t>(e)];
      Movement movement;
      movement.difference = Pose(7);
      StartMovement(group, g, group.site(e), {}, scratch, movement);
      cache.Clear();
      for (double t = 0.0; t <= movement.duration_s(); t += 0.011) {
        EvaluateBlend(group, library->layout(), movement, t, cache, got);
        SampleClip(example.clip, t, expected);
        largest_rad = std::max(largest_rad, LargestJointAngle(got, expected));
        // When the jump of the test library takes off, its velocity changes abruptly. Sampling at
        // 30 Hz smooths this change.
        ASSERT_LT(glm::length(got.root_position_m - expected.root_position_m), 0.015f);
      }
    }
  }
  EXPECT_LT(largest_rad, 0.01);
}

}  // namespace
}  // namespace stridewire
