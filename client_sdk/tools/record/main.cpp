// stridewire-record: records the motion of one avatar over the network as BVH.

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>

#include "recorder.h"
#include "stridewire/base/version.h"
#include "stridewire/offline/bvh_writer.h"

namespace stridewire::record {
namespace {

constexpr int kExitFailure = 1;
constexpr int kExitBadUsage = 2;

int PrintError(const std::string& sentence, int exit_code) {
  std::fprintf(stderr, "stridewire-record: %s\n", sentence.c_str());
  return exit_code;
}

/// Parses HOST:PORT or [ADDRESS]:PORT. Returns false if the text is neither.
bool ParseAddress(const std::string& text, Options& options) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return false;
  std::string host = text.substr(0, colon);
  if (host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  } else if (host.find(':') != std::string::npos) {
    return false;  // An IPv6 address without brackets is ambiguous.
  }
  const char* first = text.data() + colon + 1;
  const char* last = text.data() + text.size();
  unsigned port = 0;
  const auto [end, failed] = std::from_chars(first, last, port);
  if (failed != std::errc() || end != last || port < 1 || port > 65535) return false;
  if (host.empty() || host.size() > 255) return false;
  options.host = host;
  options.port = static_cast<std::uint16_t>(port);
  return true;
}

/// Checks, before recording, whether the file can be written. Returns the problem, or an empty text
/// if it can.
std::string OutputError(const std::filesystem::path& path) {
  std::error_code ignored;
  const auto status = std::filesystem::status(path, ignored);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    return "exists and is not a regular file";
  }
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  if (!std::filesystem::is_directory(folder, ignored)) return "the folder does not exist";
  if (::access(folder.c_str(), W_OK | X_OK) != 0) return "the folder is not writable";
  return {};
}

int Run(int argc, char** argv) {
  CLI::App app{"Records the motion of one avatar over the network and writes it as BVH."};
  app.name("stridewire-record");
  app.set_version_flag("--version", std::string("stridewire-record ") + kVersion);
  app.footer(
      "Example: record ten seconds of avatar 1 of world \"plaza\" without loss\n"
      "  stridewire-record --connect 127.0.0.1:7420 --world plaza --avatar 1 --seconds 10 "
      "--out walk.bvh\n"
      "Exit code: 0 success; 2 invalid options; 1 any other error. If the recording ends early, "
      "the\n"
      "file contains the frames up to then. If the server restarts, the recording continues when "
      "the\n"
      "avatar is back within --timeout-s, and the frames between repeat the last pose.\n");

  Options options;
  std::string address;
  std::string mode = "full";
  std::string out;
  bool json = false;
  app.add_option("--connect", address, "Address of the server, HOST:PORT")->required();
  app.add_option("--world", options.world, "Name of the world")->required();
  app.add_option("--avatar", options.avatar, "Id of the avatar in its world")->required();
  app.add_option("--seconds", options.seconds, "Duration from the first pose on (up to 3600)")
      ->required();
  app.add_option("--out", out, "BVH file to write")->required();
  app.add_option("--mode", mode, "How the server sends poses: full, quantised or movement")
      ->capture_default_str();
  app.add_option("--library-folder", options.library_folder,
                 "Folder that caches the libraries that --mode movement fetches");
  app.add_option("--timeout-s", options.timeout_s,
                 "Longest wait for the server, the avatar and each pose (0.1 to 600)")
      ->capture_default_str();
  app.add_option("--token", options.token, "Auth token, if the server requires one")
      ->envname("STRIDEWIRE_TOKEN");
  app.add_flag("--json", json, "Print a report as one JSON object");
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::CallForVersion& version) {
    return app.exit(version);
  } catch (const CLI::ParseError& error) {
    // Reports an unknown option in preference to a missing one. Does not use the text of
    // CLI::ExtrasError, which lists the arguments in reverse order.
    if (const auto surplus = app.remaining(); !surplus.empty()) {
      return PrintError(surplus.front() + ": unknown option or surplus argument (see --help)",
                        kExitBadUsage);
    }
    return PrintError(std::string(error.what()) + " (see --help)", kExitBadUsage);
  }

  if (!ParseAddress(address, options)) {
    return PrintError("--connect: \"" + address + "\": expected HOST:PORT", kExitBadUsage);
  }
  if (options.world.empty() || options.world.size() > STRIDEWIRE_MAX_NAME_BYTES) {
    return PrintError("--world: expected a name of 1 to 64 bytes", kExitBadUsage);
  }
  if (options.avatar == 0) return PrintError("--avatar: expected an id above 0", kExitBadUsage);
  if (!(options.seconds > 0.0 && options.seconds <= 3600.0)) {
    return PrintError("--seconds: expected a number above 0 and up to 3600", kExitBadUsage);
  }
  if (!(options.timeout_s >= 0.1 && options.timeout_s <= 600.0)) {
    return PrintError("--timeout-s: expected a number from 0.1 to 600", kExitBadUsage);
  }
  if (mode == "full") {
    options.mode = STRIDEWIRE_FULL;
  } else if (mode == "quantised") {
    options.mode = STRIDEWIRE_QUANTISED;
  } else if (mode == "movement") {
    options.mode = STRIDEWIRE_MOVEMENT;
  } else {
    return PrintError("--mode: \"" + mode + "\": expected full, quantised or movement",
                      kExitBadUsage);
  }
  if (const std::string wrong = out.empty() ? "is empty" : OutputError(out); !wrong.empty()) {
    return PrintError("--out: " + out + ": " + wrong, kExitBadUsage);
  }

  const bool terminal = ::isatty(STDERR_FILENO) != 0;
  const auto recording = Record(options, [&](double recorded_s) {
    if (terminal) std::fprintf(stderr, "\rrecorded %.1f of %g s", recorded_s, options.seconds);
  });
  if (terminal) std::fputs("\r\033[K", stderr);
  if (!recording) {
    return PrintError(Describe(recording.error()),
                      recording.error().code == ErrorCode::kIo ? kExitFailure : kExitBadUsage);
  }
  if (Status written = WriteBvh(recording->skeleton, recording->clip, std::filesystem::path(out));
      !written) {
    return PrintError(Describe(written.error()), kExitFailure);
  }

  const int frames = recording->clip.frame_count();
  if (json) {
    nlohmann::ordered_json gaps = nlohmann::ordered_json::array();
    for (const Gap& gap : recording->gaps) gaps.push_back({gap.first_frame, gap.frames});
    nlohmann::ordered_json restarts = nlohmann::ordered_json::array();
    for (const Restart& restart : recording->restarts) {
      restarts.push_back({{"frame", restart.frame}, {"away_s", restart.away_s}});
    }
    const nlohmann::ordered_json report = {
        {"world", options.world},
        {"avatar", options.avatar},
        {"mode", mode},
        {"out", out},
        {"frames", frames},
        {"fps", recording->clip.fps},
        {"seconds", frames / recording->clip.fps},
        {"joints", recording->clip.joint_count},
        {"library_hash", recording->library_hash},
        {"first_tick", recording->first_tick},
        {"ticks_missing", recording->ticks_missing},
        {"gaps", gaps},
        {"discontinuities", recording->discontinuities},
        {"restarts", restarts},
        {"bytes_received", recording->bytes_received},
        {"cut_short", recording->cut_short.empty() ? nlohmann::ordered_json()
                                                   : nlohmann::ordered_json(recording->cut_short)}};
    std::printf("%s\n",
                report.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
  } else {
    std::printf("%s: %d frames at %g per second, %d joints, mode %s, from tick %llu\n", out.c_str(),
                frames, recording->clip.fps, recording->clip.joint_count, mode.c_str(),
                static_cast<unsigned long long>(recording->first_tick));
    if (recording->ticks_missing > 0) {
      std::printf("%llu ticks did not arrive and were interpolated from their neighbours\n",
                  static_cast<unsigned long long>(recording->ticks_missing));
    }
  }
  if (!json) {
    for (const Restart& restart : recording->restarts) {
      std::printf("the server restarted before frame %d; no poses arrived for %.1f s\n",
                  restart.frame, restart.away_s);
    }
  }
  if (!recording->cut_short.empty()) {
    return PrintError("the recording is incomplete: " + recording->cut_short, kExitFailure);
  }
  return 0;
}

}  // namespace
}  // namespace stridewire::record

int main(int argc, char** argv) {
  try {
    return stridewire::record::Run(argc, argv);
  } catch (const std::exception& error) {
    return stridewire::record::PrintError(error.what(), stridewire::record::kExitFailure);
  }
}
