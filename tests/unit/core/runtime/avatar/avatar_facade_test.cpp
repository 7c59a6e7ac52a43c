// The public class Avatar returns what its simulation computes, alone and in a crowd.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/runtime/avatar.h"

namespace stridewire {
namespace {

constexpr double kFrameS = 1.0 / 60;

std::shared_ptr<const MotionLibrary> GeneratedLibrary() { return *OpenLibrary("builtin"); }

bool SameBytes(ConstPoseSpan a, ConstPoseSpan b) {
  return std::memcmp(&a.root_position_m, &b.root_position_m, sizeof(Vec3)) == 0 &&
         std::ranges::equal(a.rotations, b.rotations, [](const Quat& x, const Quat& y) {
           return std::memcmp(&x, &y, sizeof(Quat)) == 0;
         });
}

MovementRequest StepOf(std::uint64_t id, double length_m) {
  return {.id = id, .movement = StepRequest{.length_m = length_m}};
}

TEST(AvatarFacade, ShowsThePosesAndEventsOfTheSimulation) {
  const auto library = GeneratedLibrary();
  Avatar avatar(library, BaseFrame{});
  AvatarSimulation simulation(library, BaseFrame{});
  for (std::uint64_t id = 1; id <= 3; ++id) {
    ASSERT_TRUE(avatar.Enqueue(StepOf(id, 0.5)).has_value());
    ASSERT_TRUE(simulation.Enqueue(StepOf(id, 0.5)).has_value());
  }
  for (int tick = 0; tick < 240; ++tick) {
    avatar.Advance(kFrameS);
    simulation.Advance(kFrameS);
    ASSERT_TRUE(SameBytes(avatar.pose(), simulation.pose())) << "tick " << tick;
    ASSERT_EQ(avatar.events().size(), simulation.events().size()) << "tick " << tick;
    ASSERT_EQ(avatar.idle(), simulation.idle()) << "tick " << tick;
  }
  EXPECT_TRUE(avatar.idle());
  EXPECT_EQ(avatar.base().position_m.z, simulation.base().position_m.z);
}

TEST(AvatarFacade, ReportsTheErrorsOfRequests) {
  Avatar avatar(GeneratedLibrary(), BaseFrame{});
  const Status status = avatar.Enqueue(StepOf(1, 1e9));
  ASSERT_FALSE(status.has_value());
  EXPECT_EQ(status.error().code, ErrorCode::kOutOfRange);
  EXPECT_EQ(avatar.queue_size(), 0);
  ASSERT_TRUE(avatar.Enqueue(StepOf(2, 0.5)).has_value());
  EXPECT_EQ(avatar.CancelQueue(), 1);
}

TEST(AvatarCrowd, GivesEachAvatarThePoseThatItHasAlone) {
  const auto library = GeneratedLibrary();
  std::vector<Avatar> alone;
  std::vector<Avatar> together;
  for (std::uint64_t i = 0; i < 20; ++i) {
    for (std::vector<Avatar>* avatars : {&alone, &together}) {
      Avatar& avatar = avatars->emplace_back(library, BaseFrame{DVec3(2.0 * i, 0.0, 0.0), 0.1 * i});
      for (std::uint64_t id = 1; id <= 4; ++id) {
        ASSERT_TRUE(avatar.Enqueue(StepOf(id, 0.3 + 0.02 * static_cast<double>(i))).has_value());
      }
    }
  }
  std::vector<Avatar*> pointers;
  for (Avatar& avatar : together) pointers.push_back(&avatar);
  AvatarCrowd crowd(library);
  for (int tick = 0; tick < 120; ++tick) {
    crowd.Advance(pointers, kFrameS);
    for (std::size_t i = 0; i < alone.size(); ++i) {
      alone[i].Advance(kFrameS);
      ASSERT_TRUE(SameBytes(alone[i].pose(), together[i].pose()))
          << "tick " << tick << " avatar " << i;
    }
  }
}

}  // namespace
}  // namespace stridewire
