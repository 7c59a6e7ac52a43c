// paused_reader STRIDEWIRED [SECONDS [AVATARS [WRITE_TIMEOUT_S]]]
//
// Measures the memory of the server while a WebSocket client stops reading, and what the client
// receives when it continues. Prints one value per line. The exit code is 1 if the memory of the
// server grew by 16 MiB or more, or if the client received no current pose.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <thread>

#include "child_process.h"
#include "ready_line.h"
#include "web_client.h"

namespace stridewire {
namespace {

using Clock = std::chrono::steady_clock;
using test::PortIn;

// Returns the resident memory of a process in KiB, as the operating system reports it.
std::size_t ResidentKiB(const std::string& pid) {
  std::ifstream status("/proc/" + pid + "/status");
  std::string line;
  while (std::getline(status, line)) {
    if (line.starts_with("VmRSS:")) return std::stoul(line.substr(6));
  }
  return 0;
}

std::string OnlyChild() {
  std::ifstream children("/proc/self/task/" + std::to_string(getpid()) + "/children");
  std::string pid;
  children >> pid;
  return pid;
}

int Run(int argc, char** argv) {
  const int seconds = argc > 2 ? std::atoi(argv[2]) : 60;
  const int avatars = argc > 3 ? std::atoi(argv[3]) : 1000;
  const std::string write_timeout_s = argc > 4 ? argv[4] : "30";
  test::ChildProcess server(
      argv[1], {"--listen", "127.0.0.1:0", "--http", "127.0.0.1:0", "--log-level", "warning",
                "--write-timeout-s", write_timeout_s});
  const std::string ready = server.ReadLine().value_or("");
  const std::string pid = OnlyChild();
  RawClient controller("127.0.0.1", PortIn(ready, "listen"));
  controller.SayHello();
  const auto world = controller.Join("w");
  if (!world) return 2;
  std::vector<protocol::SpawnItem> crowd(static_cast<std::size_t>(avatars));
  for (int i = 0; i < avatars; ++i) {
    auto& item = crowd[static_cast<std::size_t>(i)];
    item.avatar = static_cast<protocol::AvatarId>(i + 1);
    item.start.position_m = {2.0 * (i % 40), 0.0, 2.0 * (i / 40)};
  }
  controller.Spawn(world->world, crowd);
  for (int i = 1; i <= avatars; ++i) {
    controller.Request(world->world, Steps(static_cast<protocol::AvatarId>(i), 250, 0.5));
  }
  const auto tick_now = [&] {
    controller.Send(protocol::Ping{.nonce = 1});
    return controller.Await<protocol::Pong>()->tick;
  };

  WebClient observer(PortIn(ready, "http"));
  const auto welcome = observer.SayHello();
  observer.Join("w", protocol::Role::kObserver);
  observer.Observe(world->world, 1, protocol::PoseMode::kQuantised);
  // Wait until the server has allocated all memory that it allocates only once.
  std::uint64_t last_tick = 0;
  std::uint64_t bytes = 0;
  const auto begin = Clock::now();
  while (Clock::now() - begin < std::chrono::seconds(5)) {
    const auto batch = observer.Await<protocol::PoseBatch>();
    if (!batch) return 2;
    last_tick = batch->info.tick;
    bytes += observer.last_frame().size();
  }
  const std::size_t before_kib = ResidentKiB(pid);
  std::printf("streaming          %.2f MB/s\n", static_cast<double>(bytes) / 5e6);
  std::printf("resident before    %zu KiB\n", before_kib);

  std::size_t largest_kib = before_kib;
  for (int second = 0; second < seconds; ++second) {
    for (int i = 0; i < 10; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      largest_kib = std::max(largest_kib, ResidentKiB(pid));
    }
    static_cast<void>(tick_now());  // Prevents the idle timeout of the controller.
  }
  const long grown_kib = static_cast<long>(largest_kib) - static_cast<long>(before_kib);
  std::printf("resident at most   %zu KiB (+%ld) in %d s\n", largest_kib, grown_kib, seconds);

  const std::uint64_t resumed_at = tick_now();
  std::uint64_t stale = 0;
  std::uint64_t stale_bytes = 0;
  std::uint64_t first_fresh = 0;
  const auto resumed = Clock::now();
  bool is_again = false;
  RawClient* reader = &observer;
  std::optional<WebClient> again;
  while (first_fresh == 0) {
    const auto message = reader->Receive(std::chrono::seconds(10));
    if (!message && !is_again && observer.is_closed()) {
      // The server has closed the connection. Resume the session like a client does.
      is_again = true;
      again.emplace(PortIn(ready, "http"));
      reader = &*again;
      const auto back = again->SayHello(welcome->resume_token);
      std::printf("the server closed the connection; resumed: %s\n",
                  back && back->resumed ? "yes" : "no");
      continue;
    }
    if (!message) break;
    const auto* batch = std::get_if<protocol::PoseBatch>(&*message);
    if (batch == nullptr) continue;
    if (batch->info.tick >= resumed_at) {
      first_fresh = batch->info.tick;
    } else {
      ++stale;
      if (!is_again) stale_bytes += observer.last_frame().size();
      last_tick = batch->info.tick;
    }
  }
  const double wait_s = std::chrono::duration<double>(Clock::now() - resumed).count();
  std::printf("tick when resumed  %llu\n", static_cast<unsigned long long>(resumed_at));
  std::printf("old batches first  %llu, %.2f MB, up to tick %llu\n",
              static_cast<unsigned long long>(stale), static_cast<double>(stale_bytes) / 1e6,
              static_cast<unsigned long long>(last_tick));
  std::printf("first fresh tick   %llu, after %.1f ms\n",
              static_cast<unsigned long long>(first_fresh), 1e3 * wait_s);
  return first_fresh != 0 && grown_kib < 16 * 1024 ? 0 : 1;
}

}  // namespace
}  // namespace stridewire

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr,
                 "usage: paused_reader STRIDEWIRED [SECONDS [AVATARS [WRITE_TIMEOUT_S]]]\n");
    return 2;
  }
  return stridewire::Run(argc, argv);
}
