// Quantized poses: their size and their largest error, over every frame of all captures and over
// avatars with random requests, on every instruction set of this machine.

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include "captured_library.h"
#include "instruction_sets.h"
#include "offline/builtin/builtin_library.h"
#include "random.h"
#include "random_requests.h"
#include "reframing.h"
#include "rough_ground.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/pose_quantization.h"
#include "runtime/library/stand_motion.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/protocol/compact_codec.h"
#include "stridewire/protocol/pose_codec.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;
using protocol::CompactCodec;
using protocol::PoseMode;

constexpr double kLargestErrorM = 0.001;
constexpr double kMostBytes31Joints = 124.0;

std::vector<std::int16_t> ParentsOf(const Skeleton& skeleton) {
  std::vector<std::int16_t> parents;
  for (const Joint& joint : skeleton.joints) {
    parents.push_back(static_cast<std::int16_t>(joint.parent));
  }
  return parents;
}

CompactCodec CodecOf(const Skeleton& skeleton, const PoseQuantization& code) {
  return CompactCodec::Make(code.joints, ParentsOf(skeleton)).value();
}

// Quantizes poses and restores them, in double precision otherwise, and records the errors.
class Passage {
 public:
  Passage(const Skeleton& skeleton, const CompactCodec& codec)
      : skeleton_(skeleton), codec_(codec), in_(skeleton.joints.size()), back_(in_) {
    bytes_.resize(
        std::max(codec.pose_bytes(), protocol::PoseBytes(PoseMode::kQuantised, in_.size())));
  }

  void Send(ConstPoseSpan pose) {
    block_.Add(pose.root_position_m, pose.rotations);
    if (block_.size() == CompactCodec::kBlock) Flush();
  }

  void Flush() {
    codec_.Encode(block_);
    for (std::size_t i = 0; i < block_.size(); ++i) {
      Vec3 root;
      Vec3 root_back;
      block_.Get(i, root, in_);
      Status status;
      std::span<std::byte> bytes = bytes_;
      if (block_.fits(i)) {
        bytes = bytes.first(codec_.pose_bytes());
        block_.CopyBytes(i, bytes);
        status = codec_.Decode(bytes, root_back, back_);
      } else {
        ++wide_;
        bytes = bytes.first(protocol::PoseBytes(PoseMode::kQuantised, in_.size()));
        ASSERT_TRUE(protocol::EncodePose(PoseMode::kQuantised, root, in_, bytes));
        status = protocol::DecodePose(PoseMode::kQuantised, bytes, root_back, back_);
      }
      ASSERT_TRUE(status) << Describe(status.error());
      total_bytes_ += bytes.size();
      ++poses_;
      Measure(root, root_back);
    }
    block_.Clear();
  }

  [[nodiscard]] std::size_t poses() const { return poses_; }
  [[nodiscard]] std::size_t wide() const { return wide_; }
  [[nodiscard]] double mean_bytes() const {
    return static_cast<double>(total_bytes_) / static_cast<double>(poses_);
  }
  [[nodiscard]] double mean_error_m() const { return sum_m_ / static_cast<double>(points_); }
  [[nodiscard]] double largest_error_m() const { return largest_m_; }

  void Print(const std::string& what) const {
    std::cout << what << ": " << skeleton_.joints.size() << " joints, " << poses_ << " poses of "
              << mean_bytes() << " bytes on average, " << codec_.pose_bytes() << " but for "
              << wide_ << "; off by " << 1e3 * mean_error_m() << " mm on average, "
              << 1e3 * largest_m_ << " at most\n";
  }

 private:
  struct Frame {
    std::vector<DVec3> positions;
    std::vector<DQuat> rotations;
  };

  void Place(const Vec3& root, std::span<const Quat> rotations, Frame& frame) const {
    frame.positions.resize(rotations.size());
    frame.rotations.resize(rotations.size());
    for (std::size_t j = 0; j < rotations.size(); ++j) {
      const Joint& joint = skeleton_.joints[j];
      const DQuat local = glm::normalize(DQuat(rotations[j]));
      if (joint.parent < 0) {
        frame.positions[j] = DVec3(root);
        frame.rotations[j] = local;
        continue;
      }
      const auto parent = static_cast<std::size_t>(joint.parent);
      frame.positions[j] =
          frame.positions[parent] + frame.rotations[parent] * DVec3(joint.offset_m);
      frame.rotations[j] = frame.rotations[parent] * local;
    }
  }

  void Measure(const Vec3& root, const Vec3& root_back) {
    Place(root, in_, true_);
    Place(root_back, back_, told_);
    const auto take = [&](const DVec3& a, const DVec3& b) {
      const double error_m = glm::length(a - b);
      sum_m_ += error_m;
      ++points_;
      largest_m_ = std::max(largest_m_, error_m);
    };
    for (std::size_t j = 0; j < in_.size(); ++j) take(true_.positions[j], told_.positions[j]);
    for (const EndSite& site : skeleton_.end_sites) {
      const auto j = static_cast<std::size_t>(site.joint);
      const DVec3 offset(site.offset_m);
      take(true_.positions[j] + true_.rotations[j] * offset,
           told_.positions[j] + told_.rotations[j] * offset);
    }
  }

  const Skeleton& skeleton_;
  const CompactCodec& codec_;
  CompactCodec::Block block_;
  std::vector<Quat> in_;
  std::vector<Quat> back_;
  std::vector<std::byte> bytes_;
  Frame true_;
  Frame told_;
  std::size_t poses_ = 0;
  std::size_t wide_ = 0;
  std::size_t total_bytes_ = 0;
  std::size_t points_ = 0;
  double sum_m_ = 0.0;
  double largest_m_ = 0.0;
};

struct Source {
  const char* name;
  std::vector<std::string> subjects;  // Captured subjects; empty: the built-in library.
};
void PrintTo(const Source& source, std::ostream* out) { *out << source.name; }

class QuantizedAvatars : public testing::TestWithParam<Source> {
 protected:
  void SetUp() override {
    STRIDEWIRE_SKIP_WITHOUT_TAKES(GetParam().subjects);
    library_ = LibraryOf(GetParam().subjects);
    code_ = ChoosePoseQuantization(*library_);
  }
  [[nodiscard]] const Skeleton& skeleton() const { return library_->skeleton(); }

  Library library_;
  PoseQuantization code_;
};
constexpr auto kNameOf = [](const auto& source) { return source.param.name; };
// Subject 01 comes from a Debian package.
const auto kCaptured = testing::Values(
    Source{"DebianTakes", {kDebianTakes}}, Source{"Subject03", {"03"}}, Source{"Subject05", {"05"}},
    Source{"Subject06", {"06"}}, Source{"Subject09", {"09"}}, Source{"Subject14", {"14"}},
    Source{"Subject16", {"16"}}, Source{"Subject29", {"29"}}, Source{"Subject32", {"32"}});
INSTANTIATE_TEST_SUITE_P(Generated, QuantizedAvatars, testing::Values(Source{"Builtin", {}}),
                         kNameOf);
INSTANTIATE_TEST_SUITE_P(Captured, QuantizedAvatars, kCaptured, kNameOf);

class QuantizedCaptures : public QuantizedAvatars {};
INSTANTIATE_TEST_SUITE_P(Captured, QuantizedCaptures, kCaptured, kNameOf);

TEST_P(QuantizedCaptures, KeepAllFramesWithinAMillimetre) {
  EXPECT_LE(code_.largest_error_m, kLargestErrorM);
  const CompactCodec codec = CodecOf(skeleton(), code_);
  Passage passage(skeleton(), codec);
  for (const auto& take : TakesOf(GetParam().subjects)) {
    const Capture capture = ReadBvh(take).value();
    for (int f = 0; f < capture.clip.frame_count(); ++f) passage.Send(capture.clip.frame(f));
  }
  passage.Flush();
  passage.Print(GetParam().name);
  ASSERT_GT(passage.poses(), 0u);
  EXPECT_LE(passage.largest_error_m(), kLargestErrorM);
  EXPECT_LE(passage.mean_bytes(), kMostBytes31Joints);
}

// The shift of joints that are left out must be within the stated limit.
TEST_P(QuantizedCaptures, KeepReducedJointsWithinTheStatedError) {
  const std::vector<std::uint16_t> told = ChooseReducedJoints(*library_);
  const CompactCodec codec = CompactCodec::Make(code_.joints, ParentsOf(skeleton()), told).value();
  Passage passage(skeleton(), codec);
  for (const auto& take : TakesOf(GetParam().subjects)) {
    const Capture capture = ReadBvh(take).value();
    for (int f = 0; f < capture.clip.frame_count(); ++f) passage.Send(capture.clip.frame(f));
  }
  passage.Flush();
  passage.Print(std::string(GetParam().name) + " of " + std::to_string(told.size()) + " joints");
  EXPECT_LE(passage.largest_error_m(), kReducedJointsShiftM + kLargestErrorM);
  EXPECT_LT(codec.pose_bytes(), CodecOf(skeleton(), code_).pose_bytes());
}

TEST_P(QuantizedAvatars, KeepReducedJointsWithinTheStatedError) {
  const std::vector<std::uint16_t> told = ChooseReducedJoints(*library_);
  const CompactCodec codec = CompactCodec::Make(code_.joints, ParentsOf(skeleton()), told).value();
  Passage passage(skeleton(), codec);
  constexpr std::array<std::uint16_t, 1> kRootAlone{0};
  const CompactCodec root =
      CompactCodec::Make(code_.joints, ParentsOf(skeleton()), kRootAlone).value();
  Passage root_passage(skeleton(), root);
  DrawnCrowd crowd(library_, 20, 5);
  for (int tick = 0; tick < 1200; ++tick) {
    crowd.Advance();
    for (const AvatarSimulation& avatar : crowd.avatars()) {
      passage.Send(avatar.pose());
      root_passage.Send(avatar.pose());
    }
  }
  passage.Flush();
  root_passage.Flush();
  const std::string who = std::string("avatars of ") + GetParam().name;
  std::string left_out;
  for (std::size_t j = 0; j < skeleton().joints.size(); ++j) {
    if (!std::ranges::binary_search(told, static_cast<std::uint16_t>(j))) {
      left_out += ' ' + skeleton().joints[j].name;
    }
  }
  passage.Print(who + ", fewer joints, without" + left_out);
  root_passage.Print(who + ", the root");
  EXPECT_LE(passage.largest_error_m(), kReducedJointsShiftM + kLargestErrorM);
  EXPECT_LT(codec.pose_bytes(), CodecOf(skeleton(), code_).pose_bytes());
  EXPECT_EQ(root_passage.wide(), 0u);
  EXPECT_LE(root.pose_bytes(), 20u);
}

TEST_P(QuantizedAvatars, StandWithinTheRangesOfTheirJoints) {
  const CompactCodec codec = CodecOf(skeleton(), code_);
  Passage passage(skeleton(), codec);
  AvatarSimulation avatar(library_, BaseFrame{}, AvatarOptions{});
  for (double time_s = 0.0; time_s < kIdleLoopS + 5.0; time_s += 0.05) {
    avatar.Advance(0.05);
    passage.Send(avatar.pose());
  }
  passage.Flush();
  passage.Print(std::string("standing avatar of ") + GetParam().name);
  EXPECT_EQ(passage.wide(), 0u);
}

TEST_P(QuantizedAvatars, StayWithinAMillimetre) {
  const CompactCodec codec = CodecOf(skeleton(), code_);
  Passage passage(skeleton(), codec);
  DrawnCrowd crowd(library_, 20, 5);
  for (int tick = 0; tick < 1200; ++tick) {
    crowd.Advance();
    for (const AvatarSimulation& avatar : crowd.avatars()) passage.Send(avatar.pose());
  }
  passage.Flush();
  passage.Print(std::string("avatars of ") + GetParam().name);
  EXPECT_LE(passage.largest_error_m(), kLargestErrorM);
  EXPECT_LE(passage.mean_bytes(), kMostBytes31Joints);
}

// Rotations are rounded in the frames of their joints, so the rounding errors and the number of
// bytes depend on the axes of these frames. The bound of the errors does not.
TEST_P(QuantizedAvatars, StayWithinTheBoundInOtherJointFrames) {
  const std::vector<std::string>& subjects = GetParam().subjects;
  const JointFrames frames = RandomFrames(skeleton(), 1);
  RawLibrary raw;
  if (subjects.empty()) {
    raw = Reframed(GenerateBuiltinLibrary(), frames);
  } else {
    LibraryAssembler assembler({.mirror = true});
    for (const auto& take : TakesOf(subjects)) {
      assembler.Add(Reframed(ReadBvh(take).value(), frames));
    }
    raw = assembler.Assemble().value();
  }
  const Library library = LibraryBuilder::Selecting().Build(raw).value();
  const PoseQuantization code = ChoosePoseQuantization(*library);
  EXPECT_LE(code.largest_error_m, kLargestErrorM);
  const CompactCodec codec = CodecOf(library->skeleton(), code);
  const CompactCodec reduced_codec =
      CompactCodec::Make(code.joints, ParentsOf(skeleton()), ChooseReducedJoints(*library)).value();
  Passage all(library->skeleton(), codec);
  Passage reduced(library->skeleton(), reduced_codec);
  DrawnCrowd crowd(library, 20, 5);
  for (int tick = 0; tick < 300; ++tick) {
    crowd.Advance();
    for (const AvatarSimulation& avatar : crowd.avatars()) {
      all.Send(avatar.pose());
      reduced.Send(avatar.pose());
    }
  }
  all.Flush();
  reduced.Flush();
  all.Print(std::string("avatars of ") + GetParam().name + " in other joint frames");
  EXPECT_LE(all.largest_error_m(), kLargestErrorM);
  EXPECT_LE(all.mean_bytes(), 1.1 * kMostBytes31Joints);
  EXPECT_LE(reduced.largest_error_m(), kReducedJointsShiftM + kLargestErrorM);
}

TEST_P(QuantizedAvatars, HaveTheSameBytesOnEveryInstructionSet) {
  const CompactCodec codec = CodecOf(skeleton(), code_);
  DrawnCrowd crowd(library_, 7, 6);  // The last block is not full.
  std::vector<CompactCodec::Block> blocks;
  for (int tick = 0; tick < 120; ++tick) {
    crowd.Advance();
    for (const AvatarSimulation& avatar : crowd.avatars()) {
      if (blocks.empty() || blocks.back().size() == CompactCodec::kBlock) blocks.emplace_back();
      blocks.back().Add(avatar.pose().root_position_m, avatar.pose().rotations);
    }
  }
  std::vector<std::vector<std::byte>> all;
  for (const std::int64_t set : InstructionSets()) {
    const OnlyInstructionSet only(set);
    std::vector<std::byte>& bytes = all.emplace_back();
    std::vector<std::byte> pose(codec.pose_bytes());
    for (CompactCodec::Block& block : blocks) {
      codec.Encode(block);
      for (std::size_t i = 0; i < block.size(); ++i) {
        bytes.push_back(static_cast<std::byte>(block.fits(i)));
        block.CopyBytes(i, pose);
        bytes.insert(bytes.end(), pose.begin(), pose.end());
      }
    }
    EXPECT_TRUE(bytes == all.front()) << hwy::TargetName(set);
  }
}

TEST(PoseQuantization, UsesTheIdentityAsReferenceForSmallRotations) {
  const PoseQuantization code = ChoosePoseQuantization(*LibraryOf({}));
  int as_they_are = 0;
  for (std::size_t j = 1; j < code.joints.size(); ++j) {
    const RotationQuantization& joint = code.joints[j];
    if (joint.smallest_three_bits > 0) continue;
    as_they_are += joint.reference == kIdentityQuat;
    if (joint.reference != kIdentityQuat) {
      EXPECT_LE(std::abs(joint.reference.w), 0.997f) << j;
    }
  }
  // Spine, neck, head, shoulders, hands and toes have small rotations.
  EXPECT_GE(as_they_are, 10);
  // Thighs, knees and arms have larger ones.
  EXPECT_LT(as_they_are, static_cast<int>(code.joints.size()) - 4);
}

// For random skeletons and random ranges, the errors must be within the stated bound.
TEST(PoseQuantization, KeepsItsBoundForRandomSkeletons) {
  const unsigned seed = std::random_device{}();
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  double closest = 0.0;
  for (int round = 0; round < 60; ++round) {
    Skeleton skeleton;
    const int joints = 1 + static_cast<int>(random.Draw(0.0, 60.0));
    const auto offset = [&] {
      return Vec3(random.Draw(-0.3, 0.3), random.Draw(-0.3, 0.3), random.Draw(-0.3, 0.3));
    };
    std::vector<RotationRange> ranges;
    for (int j = 0; j < joints; ++j) {
      const int parent = j == 0 ? -1 : j - 1 - static_cast<int>(random.Draw(0.0, 0.2) * j);
      skeleton.joints.push_back({std::to_string(j), parent, offset()});
      RotationRange range;
      const auto normal = [&] { return static_cast<float>(random.Draw(-1.0, 1.0)); };
      range.reference = Normalise(Quat(normal() + 2.0f, normal(), normal(), normal()));
      // Some joints rotate in any direction, others within a box with sides of up to 0.5.
      if (j > 0 && random.Draw(0.0, 1.0) < 0.9) {
        double squared = 0.0;
        for (int c = 0; c < 3; ++c) {
          range.low[c] = static_cast<float>(random.Draw(-0.5, 0.0));
          range.high[c] = static_cast<float>(random.Draw(0.01, 0.5));
          const double most = std::max(-range.low[c], range.high[c]);
          squared += most * most;
        }
        range.least_w = std::sqrt(1.0 - squared);
      }
      ranges.push_back(range);
    }
    skeleton.end_sites.push_back({joints - 1, offset()});
    const PoseQuantization code = ChoosePoseQuantization(skeleton, ranges, kLargestErrorM);
    const CompactCodec codec = CodecOf(skeleton, code);
    Passage passage(skeleton, codec);
    Pose pose(joints);
    for (int i = 0; i < 200; ++i) {
      for (int j = 0; j < joints; ++j) {
        Quat& q = pose.rotations[static_cast<std::size_t>(j)];
        const RotationRange& range = ranges[static_cast<std::size_t>(j)];
        if (range.least_w < static_cast<double>(RotationQuantization::kMinLeastW)) {
          const auto normal = [&] { return static_cast<float>(random.Draw(-1.0, 1.0)); };
          q = Normalise(Quat(normal() + 0.1f, normal(), normal(), normal()));
          continue;
        }
        // Subtract what the joint has to compensate for the joint above.
        Vec3 v;
        for (int c = 0; c < 3; ++c) {
          v[c] = static_cast<float>(random.Draw(0.99, 1.0) *
                                    random.Draw(static_cast<double>(range.low[c]) + 0.0025,
                                                static_cast<double>(range.high[c]) - 0.0025));
        }
        const float w = std::sqrt(1.0f - (v.x * v.x + v.y * v.y + v.z * v.z));
        q = Normalise(range.reference * Quat(w, v.x, v.y, v.z));
      }
      passage.Send(pose);
    }
    passage.Flush();
    EXPECT_EQ(passage.wide(), 0u) << "seed " << seed << ", round " << round;
    EXPECT_LE(passage.largest_error_m(), code.largest_error_m + 1e-5)
        << "seed " << seed << ", round " << round;
    EXPECT_LE(code.largest_error_m, kLargestErrorM) << "seed " << seed << ", round " << round;
    closest = std::max(closest, passage.largest_error_m() / kLargestErrorM);
  }
  // The bound must not be far too large either.
  EXPECT_GT(closest, 0.3) << "seed " << seed;
}

TEST(PoseQuantization, ReportsTheErrorIfBitsRunOut) {
  Skeleton skeleton;
  skeleton.joints = {{"root", -1, Vec3(0.0f)}, {"far", 0, Vec3(0.0f, 100.0f, 0.0f)}};
  const std::vector<RotationRange> ranges(2);
  const PoseQuantization code = ChoosePoseQuantization(skeleton, ranges, kLargestErrorM);
  EXPECT_EQ(code.joints[0].smallest_three_bits, RotationQuantization::kMaxFreeBits);
  EXPECT_GT(code.largest_error_m, kLargestErrorM);
  EXPECT_TRUE(protocol::CheckRotationQuantizations(code.joints));
}

}  // namespace
}  // namespace stridewire
