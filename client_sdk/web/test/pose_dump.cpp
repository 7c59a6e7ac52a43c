// web_pose_dump HOST PORT WORLD AVATAR POSES MODE
// Prints the poses that the C++ client receives, for comparison with those of the web client. Each
// line has tick, time in seconds, root position in metres and rotations.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <thread>

#include "stridewire/client.hpp"

int main(int argc, char** argv) {
  using namespace stridewire::client;
  if (argc != 7) return 2;
  const auto avatar = static_cast<std::uint32_t>(std::atoi(argv[4]));
  const int wanted = std::atoi(argv[5]);
  auto client = Client::Create(Options{});
  stridewire_world world = 0;
  if (!client || !client->Connect(argv[1], static_cast<std::uint16_t>(std::atoi(argv[2]))) ||
      !client->JoinWorld(argv[3], STRIDEWIRE_OBSERVER, world) ||
      !client->Observe(
          world, std::strcmp(argv[6], "full") == 0 ? STRIDEWIRE_FULL : STRIDEWIRE_QUANTISED)) {
    return 2;
  }
  Pose pose;
  std::uint64_t tick = UINT64_MAX;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(120);
  for (int count = 0; count < wanted;) {
    if (std::chrono::steady_clock::now() > end) {
      std::fprintf(stderr, "web_pose_dump: received only %d of %d poses within 120 s\n", count,
                   wanted);
      return 1;
    }
    if (!client->NextPose(world, avatar, tick, pose) || pose.missing()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      continue;
    }
    tick = pose.tick;
    ++count;
    std::printf("%llu %.17g %.9g %.9g %.9g", static_cast<unsigned long long>(pose.tick),
                pose.time_s, pose.root_position_m[0], pose.root_position_m[1],
                pose.root_position_m[2]);
    for (const Quaternion& q : pose.rotations)
      std::printf(" %.9g %.9g %.9g %.9g", q.x, q.y, q.z, q.w);
    std::printf("\n");
  }
  return 0;
}
