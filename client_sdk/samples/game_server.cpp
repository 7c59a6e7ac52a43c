// A simulated game server. It spawns a few avatars in a world and requests movements: each avatar
// walks some steps, stands for a while, sometimes jumps, and starts again.
//
//   sample_game_server --connect 127.0.0.1:7420 --world plaza --avatars 4 --seconds 30
//   sample_game_server --world captured --step-m 0.4 0.55 --jump-m 0.8 1.05 --turn-rad 0.2

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "stridewire/client.hpp"

namespace {

using stridewire::client::AllowNearest;
using stridewire::client::Client;
using stridewire::client::Jump;
using stridewire::client::Stand;
using stridewire::client::Step;

struct Settings {
  std::string host = "127.0.0.1";
  std::uint16_t port = 7420;
  std::string world = "plaza";
  std::uint32_t avatars = 4;
  double seconds = 0.0;  // Duration of the run in seconds; 0: until Ctrl-C
  double report_s = 10.0;
  std::uint64_t seed = 1;
  std::array<double, 2> step_m = {0.35, 0.7};
  std::array<double, 2> jump_m = {0.4, 1.2};
  double turn_rad = 0.0;
  // Distance from the middle of the row of spawned avatars beyond which avatars turn back, in
  // metres; 0: no limit
  double home_m = 0.0;
};

volatile std::sig_atomic_t stop_requested = 0;

class GameServer {
 public:
  GameServer(Client& client, const Settings& settings)
      : client_(client),
        settings_(settings),
        random_(settings.seed),
        last_requests_(settings.avatars + 1, 0),
        can_jump_(settings.jump_m[1] > 0.0) {}

  stridewire::client::Result Join() {
    return client_.JoinWorld(settings_.world, STRIDEWIRE_CONTROLLER, world_, &join_command_);
  }

  // Handles an event. Returns false after an error that ends the program.
  bool Handle(const stridewire_event& event) {
    switch (event.type) {
      case STRIDEWIRE_EVENT_WORLD_JOINED:
        // Avatars are spawned only once. After a lost session, the client library spawns them
        // again.
        if (!spawned_) Spawn();
        break;
      case STRIDEWIRE_EVENT_REPLY:
        if (event.status != STRIDEWIRE_OK) {
          std::fprintf(stderr, "%s: %s: %s\n", settings_.world.c_str(),
                       stridewire_status_name(event.status), event.text);
          return event.command != join_command_;
        }
        break;
      case STRIDEWIRE_EVENT_ITEM:
        // NO_MOVEMENT means that the library has no jumps, so the program stops requesting them.
        if (event.status == STRIDEWIRE_NO_MOVEMENT) can_jump_ = false;
        refused_ += event.status != STRIDEWIRE_OK;
        break;
      case STRIDEWIRE_EVENT_SPAWNED: RequestMovements(event); break;
      case STRIDEWIRE_EVENT_ACCEPTED:
        if (IsOurs(event.avatar) && last_requests_[event.avatar] == event.request_id) {
          last_requests_[event.avatar] = 0;
        }
        break;
      case STRIDEWIRE_EVENT_IDLE:
        // Ignores an idle event from before the server accepted the last request.
        if (IsOurs(event.avatar) && last_requests_[event.avatar] == 0) RequestMovements(event);
        break;
      case STRIDEWIRE_EVENT_STARTED:
        jumps_ += event.kind == STRIDEWIRE_KIND_JUMP;
        steps_ += event.kind <= STRIDEWIRE_KIND_STEP_RIGHT;
        break;
      case STRIDEWIRE_EVENT_FOOT_STRIKE: ++foot_strikes_; break;
      case STRIDEWIRE_EVENT_REJECTED:
        refused_ += event.outcome == STRIDEWIRE_OUTCOME_REJECTED;
        break;
      case STRIDEWIRE_EVENT_CONNECTION_LOST:
        std::printf("%s: connection lost, reconnecting\n", settings_.world.c_str());
        break;
      case STRIDEWIRE_EVENT_CLOSED:
        std::fprintf(stderr, "%s: the server closed the connection: %s\n", settings_.world.c_str(),
                     event.text);
        return false;
      default: break;
    }
    return true;
  }

  void Report() const {
    std::printf("%s: %u avatars: %d steps, %d jumps, %d foot strikes, %d refused requests\n",
                settings_.world.c_str(), settings_.avatars, steps_, jumps_, foot_strikes_,
                refused_);
    std::fflush(stdout);
  }

  // Returns whether the server has executed steps and reported foot strikes.
  bool successful() const { return steps_ > 0 && foot_strikes_ > 0; }

 private:
  bool IsOurs(std::uint32_t avatar) const { return avatar >= 1 && avatar <= settings_.avatars; }

  double Random(double from, double to) {
    return from + (to - from) * std::generate_canonical<double, 53>(random_);
  }

  // Spawns the avatars in a row, facing +Z.
  void Spawn() {
    std::vector<stridewire_spawn> spawns;
    for (std::uint32_t avatar = 1; avatar <= settings_.avatars; ++avatar) {
      spawns.push_back({avatar, {1.5 * (avatar - 1), 0.0, 0.0}, 0.0});
    }
    spawned_ = static_cast<bool>(client_.Spawn(world_, spawns));
  }

  // Returns the turn per step for a walk of `steps` steps. It is random, unless the avatar is more
  // than home_m away from the middle of the row in which the avatars were spawned. It then leads
  // back.
  double Turn(const stridewire_event& event, int steps) {
    const double x = 0.75 * (settings_.avatars - 1) - event.base_position_m[0];
    const double z = -event.base_position_m[2];
    if (settings_.home_m <= 0.0 || std::hypot(x, z) < settings_.home_m) {
      return Random(-settings_.turn_rad, settings_.turn_rad);
    }
    const double turn_rad =
        std::remainder(std::atan2(x, z) - event.base_heading_rad, 2.0 * std::numbers::pi);
    return std::clamp(turn_rad / steps, -settings_.turn_rad, settings_.turn_rad);
  }

  // Requests movements for the avatar of an event. The avatar is idle, and `event` contains its
  // base frame.
  void RequestMovements(const stridewire_event& event) {
    const std::uint32_t avatar = event.avatar;
    if (!IsOurs(avatar)) return;
    std::vector<stridewire_movement> movements;
    const int steps = static_cast<int>(Random(4.0, 10.0));
    const double length_m = Random(settings_.step_m[0], settings_.step_m[1]);
    const double turn_rad = Turn(event, steps);
    for (int i = 0; i < steps; ++i) {
      const double varied_m = length_m * Random(0.9, 1.1);
      const double step_m = std::clamp(varied_m, settings_.step_m[0], settings_.step_m[1]);
      // The lengths are random, so the nearest movement of the library is good enough.
      movements.push_back(AllowNearest(Step(avatar, ++request_id_, step_m, turn_rad)));
    }
    movements.push_back(Stand(avatar, ++request_id_, Random(0.3, 1.0)));
    if (can_jump_ && Random(0.0, 1.0) < 0.6) {
      const double jump_m = Random(settings_.jump_m[0], settings_.jump_m[1]);
      movements.push_back(AllowNearest(Jump(avatar, ++request_id_, jump_m)));
      movements.push_back(Stand(avatar, ++request_id_, Random(0.3, 1.0)));
    }
    last_requests_[avatar] = request_id_;
    if (const auto result = client_.Request(world_, movements); !result) {
      std::fprintf(stderr, "%s: %s\n", settings_.world.c_str(), result.text());
    }
  }

  Client& client_;
  const Settings& settings_;
  std::mt19937_64 random_;
  // Last request per avatar, or 0 if it has been accepted.
  std::vector<std::uint64_t> last_requests_;
  stridewire_world world_ = 0;
  std::uint64_t join_command_ = 0;
  std::uint64_t request_id_ = 0;
  bool spawned_ = false;
  bool can_jump_;
  int steps_ = 0;
  int jumps_ = 0;
  int foot_strikes_ = 0;
  int refused_ = 0;
};

int Run(const Settings& settings) {
  stridewire::client::Options options;
  options.client_name = "sample_game_server";
  options.respawn = 1;
  stridewire_status status = STRIDEWIRE_OK;
  auto client = Client::Create(options, &status);
  if (!client) {
    std::fprintf(stderr, "cannot create a client: %s\n", stridewire_status_text(status));
    return 1;
  }
  if (const auto result = client->Connect(settings.host, settings.port); !result) {
    std::fprintf(stderr, "cannot connect: %s\n", result.text());
    return 1;
  }
  GameServer game(*client, settings);
  if (const auto result = game.Join(); !result) {
    std::fprintf(stderr, "cannot join world '%s': %s\n", settings.world.c_str(), result.text());
    return 2;
  }

  using Clock = std::chrono::steady_clock;
  const auto started = Clock::now();
  double next_report_s = settings.report_s;
  for (;;) {
    const double elapsed_s = std::chrono::duration<double>(Clock::now() - started).count();
    if (stop_requested != 0 || (settings.seconds > 0.0 && elapsed_s >= settings.seconds)) break;
    if (elapsed_s >= next_report_s) {
      game.Report();
      next_report_s += settings.report_s;
    }
    client->WaitEvent(0.1);
    stridewire_event event;
    while (client->PollEvent(event)) {
      if (!game.Handle(event)) return 1;
    }
  }
  game.Report();
  if (!game.successful()) {
    std::fprintf(stderr, "%s: no avatar has taken a step. %s\n", settings.world.c_str(),
                 client->LastError().c_str());
    return 1;
  }
  return 0;
}

int RunProgram(int argc, char** argv) {
  Settings settings;
  std::string connect = "127.0.0.1:7420";
  CLI::App app(
      "A simulated game server that lets avatars walk, stand and jump.\n"
      "  sample_game_server --connect 127.0.0.1:7420 --world plaza --avatars 4 --seconds 30");
  app.add_option("--connect", connect, "Address of stridewired, HOST:PORT")->capture_default_str();
  app.add_option("--world", settings.world, "Name of the world")->capture_default_str();
  app.add_option("--avatars", settings.avatars, "Number of avatars")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str();
  app.add_option("--seconds", settings.seconds, "Duration; 0: until Ctrl-C")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  app.add_option("--report-s", settings.report_s, "Interval of status lines")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  app.add_option("--seed", settings.seed, "Seed of the random movements")->capture_default_str();
  app.add_option("--step-m", settings.step_m, "Shortest and longest step")
      ->check(CLI::Range(0.0, 2.0));
  app.add_option("--jump-m", settings.jump_m, "Shortest and longest jump; 0 0: no jumps")
      ->check(CLI::Range(0.0, 5.0));
  app.add_option("--turn-rad", settings.turn_rad, "Largest turn per step")
      ->check(CLI::Range(0.0, 1.6));
  app.add_option("--home-m", settings.home_m,
                 "Distance from the middle of the row of avatars at which they turn back; 0: none")
      ->check(CLI::Range(0.0, 1e4));
  try {
    app.parse(argc, argv);
    const auto colon = connect.rfind(':');
    const std::string port = colon == std::string::npos ? "" : connect.substr(colon + 1);
    if (port.empty() || port.size() > 5 ||
        !std::ranges::all_of(port, [](char c) { return c >= '0' && c <= '9'; }) ||
        std::stoul(port) > std::numeric_limits<std::uint16_t>::max()) {
      throw CLI::ValidationError("--connect", "expected HOST:PORT, not '" + connect + "'");
    }
    settings.host = connect.substr(0, colon);
    settings.port = static_cast<std::uint16_t>(std::stoul(port));
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }

  std::signal(SIGINT, [](int) { stop_requested = 1; });
  std::signal(SIGTERM, [](int) { stop_requested = 1; });
  return Run(settings);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return RunProgram(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "sample_game_server: %s\n", error.what());
    return 1;
  }
}
