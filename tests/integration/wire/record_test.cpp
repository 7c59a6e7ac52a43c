// Compares poses received over the network with offline synthesis (offline/synthesis.h). Uses
// stridewired, stridewire-record and a game server with real sockets.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "child_process.h"
#include "raw_client.h"
#include "ready_line.h"
#include "scratch_folder.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/choreography.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/offline/synthesis.h"

namespace stridewire {
namespace {

constexpr double kFps = 60.0;
constexpr double kDegrees = 180.0 / M_PI;

// Walking, stopping, jumping and starting again.
std::vector<MovementRequest> Choreography() {
  return {
      {1, StepRequest{.length_m = 0.5}}, {2, StepRequest{.length_m = 0.7}},
      {3, StepRequest{.length_m = 0.4}}, {4, StandRequest{.seconds = 0.25}},
      {5, JumpRequest{.length_m = 0.8}}, {6, StepRequest{.foot = Foot::kRight, .length_m = 0.6}},
      {7, StepRequest{.length_m = 0.55}}};
}

std::vector<protocol::RequestItem> OnTheWire(protocol::AvatarId avatar) {
  std::vector<protocol::RequestItem> items;
  for (const MovementRequest& request : Choreography()) {
    protocol::RequestItem item;
    item.avatar = avatar;
    item.request_id = request.id;
    if (const auto* step = std::get_if<StepRequest>(&request.movement)) {
      protocol::StepMovement wire;
      wire.length_m = step->length_m;
      if (step->foot) {
        wire.foot =
            *step->foot == Foot::kLeft ? protocol::FootChoice::kLeft : protocol::FootChoice::kRight;
      }
      item.movement = wire;
    } else if (const auto* jump = std::get_if<JumpRequest>(&request.movement)) {
      protocol::JumpMovement wire;
      wire.length_m = jump->length_m;
      item.movement = wire;
    } else {
      protocol::StandMovement wire;
      wire.seconds = std::get<StandRequest>(request.movement).seconds;
      item.movement = wire;
    }
    items.push_back(item);
  }
  return items;
}

struct Seen {
  Clip clip;
  std::vector<bool> received;  // [frame]: false if it was missed and interpolated.
};

// Returns the frame of the recording at which the choreography starts: the shift with the best
// match. Empty if the recording is shorter than the choreography.
std::optional<int> ShiftOf(const Seen& seen, const Clip& truth) {
  double best_rad = std::numeric_limits<double>::infinity();
  std::optional<int> best;
  for (int shift = 0; shift + truth.frame_count() <= seen.clip.frame_count(); ++shift) {
    double largest_rad = 0.0;
    for (int f = 0; f < truth.frame_count() && largest_rad < best_rad; ++f) {
      if (!seen.received[static_cast<std::size_t>(f + shift)]) continue;
      largest_rad =
          std::max(largest_rad, LargestJointAngle(seen.clip.frame(f + shift), truth.frame(f)));
    }
    if (largest_rad < best_rad) {
      best_rad = largest_rad;
      best = shift;
    }
  }
  return best;
}

// Records one avatar that executes the choreography. On a busy machine the server misses ticks.
// Returns an empty result if the recording started too late, or if less than 90 % of the frames
// were received.
std::optional<Seen> RecordOnce(RawClient& game, std::uint16_t port, protocol::WorldId world,
                               protocol::AvatarId avatar, const Clip& truth, double lead_s) {
  EXPECT_TRUE(game.Spawn(world, {{.avatar = avatar}}));
  const test::ScratchFolder folder;
  const std::string out = folder.File("seen.bvh");
  const double seconds = lead_s + truth.duration_s() + 1.0;
  test::ChildProcess record(
      STRIDEWIRE_RECORD, {"--connect", "127.0.0.1:" + std::to_string(port), "--world", "w",
                          "--avatar", std::to_string(avatar), "--seconds", std::to_string(seconds),
                          "--mode", "full", "--out", out, "--json"});
  std::this_thread::sleep_for(std::chrono::duration<double>(lead_s));
  EXPECT_TRUE(game.Request(world, OnTheWire(avatar)));
  const std::string line = record.ReadLine(seconds + 60.0).value_or("{}");
  if (record.Wait() != 0) return std::nullopt;
  const auto report = nlohmann::json::parse(line, nullptr, false);
  const auto capture = ReadBvh(out, {.unit_m = 1.0, .up = BvhAxis::kPlusY});
  if (!capture || !report.contains("gaps")) return std::nullopt;
  Seen seen{capture->clip,
            std::vector<bool>(static_cast<std::size_t>(capture->clip.frame_count()), true)};
  for (const auto& gap : report["gaps"]) {
    std::fill_n(seen.received.begin() + gap[0].get<std::ptrdiff_t>(), gap[1].get<int>(), false);
  }
  const auto missed = std::ranges::count(seen.received, false);
  EXPECT_EQ(missed, report["ticks_missing"].get<int>());
  std::printf("avatar %u: %d frames, %d of them missed\n", avatar, seen.clip.frame_count(),
              static_cast<int>(missed));
  if (10 * missed > seen.clip.frame_count()) return std::nullopt;
  if (LargestJointAngle(seen.clip.frame(0), truth.frame(0)) > 1e-3) return std::nullopt;
  return seen;
}

// Starts a server without idle motion, which differs between avatars.
test::ChildProcess StartServer(int shards) {
  return test::ChildProcess(
      STRIDEWIRE_STRIDEWIRED,
      {"--listen", "127.0.0.1:0", "--http", "127.0.0.1:0", "--shards", std::to_string(shards),
       "--max-catch-up-ticks", "1000", "--idle-motion=false"});
}

class RecordTest : public testing::TestWithParam<int> {};

TEST_P(RecordTest, EqualsOfflineSynthesis) {
  const auto library = OpenLibrary("builtin").value();
  test::ChildProcess server = StartServer(GetParam());
  const std::uint16_t port =
      test::PortIn(server.ReadLineThatBegins("ready ").value_or(""), "listen");
  ASSERT_NE(port, 0);
  RawClient game("127.0.0.1", port);
  ASSERT_TRUE(game.SayHello());
  const auto world = game.Join("w");
  ASSERT_TRUE(world);

  Expected<Synthesis> truth;
  std::optional<Seen> seen;
  std::optional<int> shift;
  for (protocol::AvatarId avatar = 1; avatar <= 5 && !shift; ++avatar) {
    // The id of an avatar is the seed of its variation of steps.
    truth =
        Synthesize({.library = library,
                    .requests = Choreography(),
                    .fps = kFps,
                    .options = {.idle_motion = false, .stride_variation = true, .seed = avatar}});
    ASSERT_TRUE(truth.has_value()) << Describe(truth.error());
    seen = RecordOnce(game, port, world->world, avatar, truth->clip, 1.0 + 0.5 * avatar);
    if (seen) shift = ShiftOf(*seen, truth->clip);
  }
  ASSERT_TRUE(shift) << "five recordings in a row were not whole: is this machine too busy?";

  const auto joints = static_cast<std::size_t>(library->skeleton().joint_count());
  ASSERT_EQ(seen->clip.joint_count, library->skeleton().joint_count());
  std::vector<Vec3> seen_m(joints);
  std::vector<Vec3> truth_m(joints);
  std::vector<Quat> rotations(joints);
  double largest_rad = 0.0;
  float largest_m = 0.0f;
  for (int f = 0; f < truth->clip.frame_count(); ++f) {
    if (!seen->received[static_cast<std::size_t>(f + *shift)]) continue;
    const ConstPoseSpan a = seen->clip.frame(f + *shift);
    const ConstPoseSpan b = truth->clip.frame(f);
    largest_rad = std::max(largest_rad, LargestJointAngle(a, b));
    ForwardKinematics(library->skeleton(), a, seen_m, rotations);
    ForwardKinematics(library->skeleton(), b, truth_m, rotations);
    for (std::size_t j = 0; j < joints; ++j) {
      largest_m = std::max(largest_m, glm::length(seen_m[j] - truth_m[j]));
    }
  }
  std::printf("%d shards: %d frames, joints within %.5f deg and %.6f m\n", GetParam(),
              truth->clip.frame_count(), largest_rad * kDegrees, static_cast<double>(largest_m));
  EXPECT_LE(largest_rad * kDegrees, 0.05);
  EXPECT_LE(largest_m, 0.001f);
}

// Poses that the recorder evaluates equal the full poses that the server sends. The recorder
// fetches the library in the first round, reads it from its folder in the second, and fetches it
// again in the third, because the file is damaged.
TEST(RecordMovements, EqualFullPosesBitForBit) {
  test::ChildProcess server = StartServer(2);
  const std::uint16_t port =
      test::PortIn(server.ReadLineThatBegins("ready ").value_or(""), "listen");
  ASSERT_NE(port, 0);
  RawClient game("127.0.0.1", port);
  ASSERT_TRUE(game.SayHello());
  const auto world = game.Join("w");
  ASSERT_TRUE(world);
  ASSERT_TRUE(game.Spawn(world->world, {{.avatar = 1}}));
  const test::ScratchFolder folder;
  const std::string libraries = folder.File("libraries");
  const std::string library = libraries + "/" + world->library_hash + ".swl";
  const auto start = [&](const std::string& mode) {
    return test::ChildProcess(
        STRIDEWIRE_RECORD, {"--connect", "127.0.0.1:" + std::to_string(port), "--world", "w",
                            "--avatar", "1", "--seconds", "4", "--mode", mode, "--library-folder",
                            libraries, "--out", folder.File(mode + ".bvh"), "--json"});
  };
  for (int round = 0; round < 3; ++round) {
    SCOPED_TRACE(round);
    if (round == 2) std::ofstream(library, std::ios::binary | std::ios::in).write("damage", 6);
    test::ChildProcess full = start("full");
    test::ChildProcess movement = start("movement");
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    ASSERT_TRUE(game.Request(world->world, OnTheWire(1)));
    const auto told = nlohmann::json::parse(movement.ReadLine(60.0).value_or("{}"), nullptr, false);
    const auto sent = nlohmann::json::parse(full.ReadLine(60.0).value_or("{}"), nullptr, false);
    ASSERT_EQ(movement.Wait(), 0);
    ASSERT_EQ(full.Wait(), 0);
    EXPECT_TRUE(OpenLibrary(library).has_value());
    const auto a = ReadBvh(folder.File("full.bvh"), {.unit_m = 1.0, .up = BvhAxis::kPlusY});
    const auto b = ReadBvh(folder.File("movement.bvh"), {.unit_m = 1.0, .up = BvhAxis::kPlusY});
    ASSERT_TRUE(a && b);
    const auto first_a = sent["first_tick"].get<std::int64_t>();
    const auto first_b = told["first_tick"].get<std::int64_t>();
    const auto is_there = [](const nlohmann::json& report, int frame) {
      return std::ranges::none_of(report["gaps"], [&](const auto& gap) {
        const int begin = gap[0];
        return frame >= begin && frame < begin + gap[1].template get<int>();
      });
    };
    int compared = 0;
    double largest_rad = 0.0;
    float largest_m = 0.0f;
    for (int f = 0; f < a->clip.frame_count(); ++f) {
      const auto g = static_cast<int>(first_a + f - first_b);
      if (g < 0 || g >= b->clip.frame_count() || !is_there(sent, f) || !is_there(told, g)) continue;
      const ConstPoseSpan x = a->clip.frame(f);
      const ConstPoseSpan y = b->clip.frame(g);
      largest_rad = std::max(largest_rad, LargestJointAngle(x, y));
      largest_m = std::max(largest_m, glm::length(x.root_position_m - y.root_position_m));
      ++compared;
    }
    std::printf("%d frames compared; %d KB sent as poses, %d KB as movements\n", compared,
                sent["bytes_received"].get<int>() / 1000, told["bytes_received"].get<int>() / 1000);
    EXPECT_GT(compared, 100);
    // Equal poses can differ by whole turns in the Euler angles of BVH.
    EXPECT_LE(largest_rad, 1e-6);
    EXPECT_EQ(largest_m, 0.0f);
    // The library has more than 1 MB, movements have less.
    const auto bytes = told["bytes_received"].get<int>();
    EXPECT_EQ(bytes > 1'000'000, round != 1) << bytes;
  }
}

INSTANTIATE_TEST_SUITE_P(Shards, RecordTest, testing::Values(1, 4));

}  // namespace
}  // namespace stridewire
