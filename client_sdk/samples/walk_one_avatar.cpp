// Lets one avatar walk: walk_one_avatar [HOST [PORT [SECONDS]]]. Survives a restart of the server.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "stridewire/client.hpp"

int main(int argc, char** argv) {
  using namespace stridewire::client;
  const char* host = argc > 1 ? argv[1] : "127.0.0.1";
  const auto port = static_cast<std::uint16_t>(argc > 2 ? std::atoi(argv[2]) : 7420);
  const double seconds = argc > 3 ? std::atof(argv[3]) : 30.0;
  const std::uint32_t avatar = 1;

  Options options;
  options.client_name = "walk_one_avatar";
  options.respawn = 1;  // After a restart of the server, spawn the avatar again.
  auto client = Client::Create(options);
  stridewire_world world = 0;
  if (!client || !client->Connect(host, port) ||
      !client->JoinWorld("sample", STRIDEWIRE_CONTROLLER, world)) {
    std::fprintf(stderr, "walk_one_avatar: cannot connect to %s:%d\n", host, port);
    return 2;
  }
  // The client queues these commands until it is connected.
  (void)client->Spawn(world, {{avatar, {0.0, 0.0, 0.0}, 0.0}});
  (void)client->Observe(world, STRIDEWIRE_QUANTISED);

  std::uint64_t request = 0;
  Pose pose;
  stridewire_event event;
  const auto start = std::chrono::steady_clock::now();
  const auto end = start + std::chrono::duration<double>(seconds);
  for (auto next = start; next < end; next += std::chrono::milliseconds(100)) {
    double wait_s = 0.0;
    do {  // Handles events for a tenth of a second.
      while (client->PollEvent(event)) {
        std::printf("event %d: %s\n", event.type,
                    event.text[0] != '\0' ? event.text : stridewire_status_name(event.status));
        // Waits until the avatar is idle, and then requests more movements.
        if (event.type != STRIDEWIRE_EVENT_IDLE) continue;
        std::vector<stridewire_movement> movements;  // Four steps and a pause.
        for (int i = 0; i < 4; ++i) movements.push_back(Step(avatar, ++request, 0.55));
        movements.push_back(Stand(avatar, ++request, 0.5));
        (void)client->Request(world, movements);
      }
      wait_s = std::chrono::duration<double>(next - std::chrono::steady_clock::now()).count();
    } while (wait_s > 0.0 && (client->WaitEvent(wait_s), true));
    if (const auto time_s = client->RenderTime();
        time_s && client->SamplePose(world, avatar, *time_s, pose) && !pose.missing()) {
      std::printf("root %.3f %.3f %.3f\n", pose.root_position_m[0], pose.root_position_m[1],
                  pose.root_position_m[2]);
      std::fflush(stdout);
    }
  }
  return 0;
}
