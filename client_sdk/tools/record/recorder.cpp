#include "recorder.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

namespace stridewire::record {

namespace {

using Clock = std::chrono::steady_clock;
constexpr auto kPollInterval = std::chrono::milliseconds(10);

Vec3 ToVec3(const float (&v)[3]) { return {v[0], v[1], v[2]}; }

Skeleton ToSkeleton(const client::Skeleton& s) {
  Skeleton skeleton;
  for (const stridewire_joint& j : s.joints) {
    skeleton.joints.push_back({j.name, j.parent, ToVec3(j.offset_m)});
  }
  for (const stridewire_end_site& e : s.end_sites) {
    skeleton.end_sites.push_back({static_cast<int>(e.joint), ToVec3(e.offset_m)});
  }
  for (int side = 0; side < 2; ++side) {
    const stridewire_leg& leg = s.legs[side];
    skeleton.legs[side] = {leg.hip,
                           leg.knee,
                           leg.ankle,
                           leg.ball,
                           ToVec3(leg.ball_offset_m),
                           ToVec3(leg.toe_tip_offset_m)};
  }
  return skeleton;
}

class Recorder {
 public:
  Recorder(const Options& options, client::Client client)
      : options_(options), client_(std::move(client)) {}

  Expected<Recording> Run(const std::function<void(double)>& progress) {
    if (Status status = Subscribe(); !status) return std::unexpected(status.error());
    received_ = Clock::now();
    while (!done_ && recording_.cut_short.empty()) {
      if (Status status = HandleEvents(); !status) return std::unexpected(status.error());
      if (Status status = TakePoses(); !status) return std::unexpected(status.error());
      if (Clock::now() - received_ > std::chrono::duration<double>(options_.timeout_s)) {
        if (Status status = OnSilence(); !status) return std::unexpected(status.error());
      }
      if (progress && frame_count() > 0) progress(frame_count() / hz_);
      if (!done_) std::this_thread::sleep_for(kPollInterval);
    }
    recording_.clip.fps = hz_;
    recording_.bytes_received = client_.Statistics().bytes_received;
    return std::move(recording_);
  }

 private:
  [[nodiscard]] int frame_count() const { return recording_.clip.frame_count(); }

  [[nodiscard]] std::string Where() const {
    return options_.host + ":" + std::to_string(options_.port);
  }

  Status Subscribe() {
    if (!client_.Connect(options_.host, options_.port)) {
      return Fail(ErrorCode::kInvalidArgument, "invalid address", Where());
    }
    stridewire_observation observation{};
    observation.mode = options_.mode;
    observation.every_n_ticks = 1;
    observation.avatars = &options_.avatar;
    observation.avatar_count = 1;
    if (!client_.JoinWorld(options_.world, STRIDEWIRE_OBSERVER, world_) ||
        !client_.Observe(world_, observation)) {
      return Fail(ErrorCode::kInvalidArgument, "invalid world name or avatar id",
                  client_.LastError());
    }
    return {};
  }

  Status HandleEvents() {
    stridewire_event event;
    while (client_.PollEvent(event)) {
      const std::string text =
          event.text[0] != '\0' ? event.text : stridewire_status_text(event.status);
      switch (event.type) {
        case STRIDEWIRE_EVENT_CONNECT_FAILED:
          if (!was_ready_) return Fail(ErrorCode::kIo, "cannot connect", Where() + ": " + text);
          break;
        case STRIDEWIRE_EVENT_CONNECTED: was_ready_ = true; break;
        case STRIDEWIRE_EVENT_CLOSED: return End("the server closed the connection: " + text);
        case STRIDEWIRE_EVENT_REPLY:
          if (event.status != STRIDEWIRE_OK) return End("the server refused: " + text);
          break;
        // Ticks of a new session are unrelated to those of the recording.
        case STRIDEWIRE_EVENT_SESSION_LOST: is_new_session_ = frame_count() > 0; break;
        default: break;
      }
    }
    return {};
  }

  /// Ends the recording early. Returns an error if nothing was recorded.
  Status End(std::string why) {
    if (frame_count() == 0) return Fail(ErrorCode::kIo, "nothing was recorded", std::move(why));
    recording_.cut_short = std::move(why);
    return {};
  }

  Status OnSilence() {
    const std::string avatar =
        "avatar " + std::to_string(options_.avatar) + " of world \"" + options_.world + "\"";
    char seconds[32];
    std::snprintf(seconds, sizeof seconds, "%g s", options_.timeout_s);
    if (!was_ready_) return End(Where() + " did not answer within " + seconds);
    if (frame_count() == 0) return End(avatar + " sent no pose within " + seconds);
    return End("no pose of " + avatar + " arrived for " + seconds);
  }

  Status Describe() {
    client::Skeleton skeleton;
    if (!client_.GetSkeleton(world_, skeleton)) {
      return Fail(ErrorCode::kIo, "the server did not send the skeleton", Where());
    }
    recording_.skeleton = ToSkeleton(skeleton);
    recording_.library_hash = skeleton.library_hash;
    recording_.clip.joint_count = recording_.skeleton.joint_count();
    hz_ = skeleton.tick_hz;
    const double frames = std::max(1.0, std::round(options_.seconds * hz_));
    // The limit is necessary because the number of frames depends on the server's tick rate.
    if (frames > kMaxFrames) {
      return Fail(ErrorCode::kLimitExceeded, "too many frames", "--seconds",
                  static_cast<std::int64_t>(frames));
    }
    target_frames_ = static_cast<int>(frames);
    return {};
  }

  Status TakePoses() {
    for (;;) {
      if (is_new_session_) last_tick_ = UINT64_MAX;
      if (!client_.NextPose(world_, options_.avatar, last_tick_, pose_) || pose_.missing()) break;
      if (!is_new_session_) {
        // The client reports a new session before its first pose.
        if (Status status = HandleEvents(); !status) return status;
        if (!recording_.cut_short.empty()) break;
        if (is_new_session_) continue;
      }
      if (frame_count() == 0) {
        if (Status status = Describe(); !status) return status;
        recording_.first_tick = pose_.tick;
      } else if (is_new_session_) {
        if (Status status = OnRestart(); !status) return status;
        if (!recording_.cut_short.empty()) break;
      } else {
        Fill(pose_.tick - last_tick_);
      }
      if (frame_count() < target_frames_) Append();
      last_tick_ = pose_.tick;
      received_ = Clock::now();
      if (frame_count() >= target_frames_) {
        done_ = true;
        break;
      }
    }
    return {};
  }

  void Append() {
    if (pose_.discontinuity != 0 && frame_count() > 0) ++recording_.discontinuities;
    Clip& clip = recording_.clip;
    clip.root_positions_m.push_back(ToVec3(pose_.root_position_m));
    for (const client::Quaternion& q : pose_.rotations)
      clip.rotations.emplace_back(q.w, q.x, q.y, q.z);
  }

  /// Continues the recording with the first pose of a new session.
  Status OnRestart() {
    is_new_session_ = false;
    client::Skeleton skeleton;
    if (!client_.GetSkeleton(world_, skeleton)) {
      return Fail(ErrorCode::kIo, "the server did not send the skeleton", Where());
    }
    if (skeleton.library_hash != recording_.library_hash || skeleton.tick_hz != hz_) {
      return End("the restarted server has another library or tick rate");
    }
    const double away_s = std::chrono::duration<double>(Clock::now() - received_).count();
    pose_.discontinuity = 1;
    Fill(static_cast<std::uint64_t>(std::max(1.0, std::round(away_s * hz_))));
    recording_.restarts.push_back({frame_count(), away_s});
    return {};
  }

  /// Adds frames for the time between the last pose and this one, which is `ticks` later. They are
  /// interpolated linearly. Before a discontinuity, they repeat the last pose.
  void Fill(std::uint64_t ticks) {
    Clip& clip = recording_.clip;
    const int from = frame_count() - 1;
    const std::uint64_t filled =
        std::min(ticks - 1, static_cast<std::uint64_t>(target_frames_ - frame_count()));
    recording_.ticks_missing += filled;
    if (filled > 0 && recording_.gaps.size() < kMaxGaps) {
      recording_.gaps.push_back({from + 1, static_cast<int>(filled)});
    }
    for (std::uint64_t i = 1; i <= filled; ++i) {
      const float u = pose_.discontinuity != 0
                          ? 0.0f
                          : static_cast<float>(static_cast<double>(i) / static_cast<double>(ticks));
      const Vec3 root_m = clip.root_positions_m[static_cast<std::size_t>(from)];
      clip.root_positions_m.push_back(root_m + u * (ToVec3(pose_.root_position_m) - root_m));
      for (std::size_t j = 0; j < pose_.rotations.size(); ++j) {
        const Quat a = clip.frame(from).rotations[j];
        const client::Quaternion& q = pose_.rotations[j];
        Quat b(q.w, q.x, q.y, q.z);
        if (Dot(a, b) < 0.0f) b = -b;
        clip.rotations.push_back(Normalise(a + (b - a) * u));
      }
    }
  }

  static constexpr double kMaxFrames = 1e6;

  const Options& options_;
  client::Client client_;
  stridewire_world world_ = 0;
  bool was_ready_ = false;
  bool is_new_session_ = false;  ///< True from a lost session to the next pose.
  bool done_ = false;
  double hz_ = 60.0;
  int target_frames_ = 1;
  std::uint64_t last_tick_ = UINT64_MAX;
  Clock::time_point received_;
  client::Pose pose_;
  Recording recording_;
};

}  // namespace

Expected<Recording> Record(const Options& options, const std::function<void(double)>& progress) {
  client::Options client_options;
  client_options.client_name = "stridewire-record";
  client_options.auth_token = options.token.empty() ? nullptr : options.token.c_str();
  client_options.library_folder =
      options.library_folder.empty() ? nullptr : options.library_folder.c_str();
  client_options.pose_history = 2048;
  client_options.connect_timeout_s = options.timeout_s;
  stridewire_status status = STRIDEWIRE_OK;
  auto client = client::Client::Create(client_options, &status);
  if (!client) {
    return Fail(ErrorCode::kInvalidArgument, "cannot create a client",
                std::string(stridewire_status_text(status)));
  }
  return Recorder(options, std::move(*client)).Run(progress);
}

}  // namespace stridewire::record
