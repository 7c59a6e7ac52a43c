// The functions of the WebAssembly module, which the web client calls. src/native.ts declares them.
//
// WebSocket messages consist of frames (protocol/STANDARD.md): the web client passes a received
// message to `on_message`, which verifies it, and then reads the fields from the frame. For a
// message that the web client has made, it passes the type and the payload.
//
// Numbers that a function returns besides its result are in `results`; the comment of each function
// lists them after "results:", each with its index. If a function sets "the text", results[kTextAt]
// is its address and results[kTextBytes] its size in bytes (SetText).

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "session.h"
#include "stridewire/protocol/check.h"
#include "stridewire/protocol/decode.h"
#include "stridewire/protocol/pose_batch_reader.h"

// NOLINTNEXTLINE(cppcoreguidelines-macro-usage): an attribute with an argument.
#define STRIDEWIRE_EXPORT(name) extern "C" __attribute__((export_name(#name), used))

namespace stridewire::client {
namespace {

namespace protocol = stridewire::protocol;

// The web client reads positions and rotations as arrays of floats.
static_assert(sizeof(Vec3) == 12 && sizeof(Quat) == 16);
static_assert(std::is_standard_layout_v<Quat> && offsetof(Quat, x) == 0 && offsetof(Quat, w) == 12);

/// A session, and the results of its last calls.
struct Client {
  explicit Client(const SessionOptions& options) : session(options) {}
  Session session;
  std::vector<std::byte> output;
  CrowdPose crowd;
  std::vector<Quat> rotations;
  Vec3 root_position_m = Vec3(0.0f);
  std::vector<protocol::AvatarId> avatars;
  bool has_library_cache = false;
  std::vector<std::string> libraries_to_load;  ///< Hashes for take_library_request.
  std::vector<std::string> loading_libraries;  ///< Hashes for on_library.
  std::vector<LibraryTask> libraries_to_store;
  LibraryTask stored_library;  ///< The file of the last take_library_request.
};

constexpr std::size_t kTextAt = 14;
constexpr std::size_t kTextBytes = 15;
std::array<double, 32> results;
std::string text;
// Memory for arguments. Its elements have 8 bytes, because frames must be aligned to 8 bytes.
std::vector<std::uint64_t> input_words;

/// Stores a text and its address in `results`, from which JavaScript reads it.
void SetText(std::string_view value) {
  text = value;
  results[kTextAt] = static_cast<double>(reinterpret_cast<std::uintptr_t>(text.data()));
  results[kTextBytes] = static_cast<double>(text.size());
}

template <typename T>
double Address(const std::vector<T>& list) {
  return static_cast<double>(reinterpret_cast<std::uintptr_t>(list.data()));
}

std::span<const std::byte> Input(std::size_t bytes) {
  return std::as_bytes(std::span(input_words)).first(bytes);
}

/// Decodes a frame. On error, passes a description to SetText and returns nullopt.
std::optional<protocol::Message> Decode(const Expected<protocol::FrameView>& frame) {
  auto message = frame ? protocol::DecodeMessage(*frame) : std::unexpected(frame.error());
  if (message) return *std::move(message);
  SetText(Describe(message.error()));
  return std::nullopt;
}

/// Decodes a message whose payload is in `input`. On error, passes a description to SetText and
/// returns nullopt.
std::optional<protocol::Message> DecodeInput(std::uint32_t type, std::size_t bytes) {
  return Decode(protocol::FrameView{static_cast<protocol::MessageType>(type), Input(bytes)});
}

/// Opens the file of a library. Fails if its hash is not `hash`.
Expected<std::shared_ptr<const MotionLibrary>> OpenLibrary(std::span<const std::byte> file,
                                                           const std::string& hash) {
  auto library = MotionLibrary::FromBytes(file);
  if (library && (*library)->hash() != hash) {
    return Fail(ErrorCode::kMalformed, "the library has another hash than requested");
  }
  return library;
}

/// Checks received libraries, and collects requests to the cache. In native clients, the network
/// thread does this.
void RunLibraryTasks(Client& client) {
  while (auto task = client.session.TakeLibraryTask()) {
    if (!task->file.empty()) {
      auto library = OpenLibrary(task->file, task->hash);
      if (library && client.has_library_cache) client.libraries_to_store.push_back(*task);
      client.session.OnLibraryTask(task->hash, std::move(library));
    } else if (client.has_library_cache) {
      client.libraries_to_load.push_back(task->hash);
    } else {
      client.session.OnLibraryTask(task->hash, Fail(ErrorCode::kNotFound, "there is no cache"));
    }
  }
}

/// Stores the number of a command in `results`. If the command was refused, also sets the text.
std::uint32_t Report(Client& client, stridewire_status status, std::uint64_t command) {
  results[0] = static_cast<double>(command);
  if (status != STRIDEWIRE_OK) SetText(client.session.last_text());
  RunLibraryTasks(client);
  return status;
}

/// Sends a message as a command. Each overload is one command of SessionCommands.
struct Submit {
  Session& session;
  stridewire_world world;
  std::uint64_t& command;

  stridewire_status operator()(protocol::JoinWorld& m) const {
    stridewire_world joined = 0;
    const stridewire_status status = session.JoinWorld(m.name, m.role, joined, command);
    results[1] = joined;
    return status;
  }
  stridewire_status operator()(protocol::LeaveWorld&) const {
    return session.LeaveWorld(world, command);
  }
  stridewire_status operator()(protocol::Spawn& m) const {
    return session.Spawn(world, std::move(m), command);
  }
  stridewire_status operator()(protocol::Remove& m) const {
    return session.Remove(world, std::move(m), command);
  }
  stridewire_status operator()(protocol::Request& m) const {
    return session.Request(world, std::move(m), command);
  }
  stridewire_status operator()(protocol::CancelQueue& m) const {
    return session.Cancel(world, std::move(m), command);
  }
  stridewire_status operator()(protocol::SetTerrain& m) const {
    return session.SetTerrain(world, std::move(m), command);
  }
  stridewire_status operator()(protocol::SetLayers& m) const {
    return session.SetLayers(world, std::move(m), command);
  }
  stridewire_status operator()(protocol::SetPlanting& m) const {
    return session.SetPlanting(world, std::move(m), command);
  }
  stridewire_status operator()(protocol::Observe& m) const {
    if (m.replace && m.region) {
      return session.MoveRegion(m.subscription, *std::move(m.region), command);
    }
    std::uint32_t subscription = 0;
    const stridewire_status status = session.Observe(world, std::move(m), subscription, command);
    results[1] = subscription;
    return status;
  }
  stridewire_status operator()(protocol::StopObserving& m) const {
    return session.StopObserving(m.subscription, command);
  }
  stridewire_status operator()(protocol::InspectAvatar& m) const {
    return session.Inspect(world, m.avatar, command);
  }
  template <typename Message>
  stridewire_status operator()(const Message&) const {
    return STRIDEWIRE_UNSUPPORTED;
  }
};

void SetCrowdResults(const CrowdPose& crowd) {
  results[0] = static_cast<double>(crowd.joint_count);
  results[1] = Address(crowd.avatars);
  results[2] = Address(crowd.flags);
  results[3] = Address(crowd.roots_m);
  results[4] = Address(crowd.rotations);
}

}  // namespace

/// Returns the address of `results`, an array of 32 doubles.
STRIDEWIRE_EXPORT(results) double* Results() { return results.data(); }

/// Returns memory for arguments of the next call. It is aligned to 8 bytes.
STRIDEWIRE_EXPORT(input) std::uint64_t* InputMemory(std::size_t bytes) {
  const std::size_t words = (bytes + 7) / 8;
  if (input_words.size() < words) input_words.resize(words);
  return input_words.data();
}

/// Checks the frame in `input`. Returns 1 if it is valid. Otherwise sets the text.
STRIDEWIRE_EXPORT(check_frame) bool CheckFrame(std::size_t bytes, bool from_client) {
  const auto sender = from_client ? protocol::Sender::kClient : protocol::Sender::kServer;
  return Decode(protocol::ParseFrame(Input(bytes), sender)).has_value();
}

/// Encodes the message in `input` as the native libraries do, and returns the size of the frame in
/// bytes. results: 0 the address of the frame. If the message is invalid, returns 0 and sets the
/// text.
STRIDEWIRE_EXPORT(encode_frame) std::size_t EncodeFrame(std::uint32_t type, std::size_t bytes) {
  static std::vector<std::byte> frame;
  frame.clear();
  const auto message = DecodeInput(type, bytes);
  if (!message) return 0;
  if (const Status status = protocol::Encoder().Encode(*message, frame); !status) {
    SetText(Describe(status.error()));
    return 0;
  }
  results[0] = Address(frame);
  return frame.size();
}

/// Decodes the poses of a batch. `input` contains the frame of the WorldInfo of its world, and then
/// the frame of the batch. The WorldInfo is necessary for compact poses only. Without it,
/// `info_bytes` is 0. Returns the number of poses, or -1 and sets the text if something is invalid.
/// results: as in sample_all.
STRIDEWIRE_EXPORT(decode_poses)
std::int32_t DecodePoses(std::size_t info_bytes, std::size_t bytes) {
  static CrowdPose crowd;
  std::shared_ptr<const protocol::CompactCodecs> codecs;
  if (info_bytes > 0) {
    const auto message = Decode(protocol::ParseFrame(Input(info_bytes), protocol::Sender::kServer));
    if (!message) return -1;
    const auto* info = std::get_if<protocol::WorldInfo>(&*message);
    if (info == nullptr) {
      SetText("expected a WorldInfo");
      return -1;
    }
    codecs = WorldView::MakeCodecs(*info);
  }
  const auto message = Decode(protocol::ParseFrame(Input(info_bytes + bytes).subspan(info_bytes),
                                                   protocol::Sender::kServer));
  if (!message) return -1;
  const auto* batch = std::get_if<protocol::PoseBatch>(&*message);
  if (batch == nullptr) {
    SetText("expected a PoseBatch");
    return -1;
  }
  const std::size_t joints = batch->info.joint_count;
  crowd.Resize(batch->avatars.size(), joints);
  protocol::PoseBatchReader reader(*batch, codecs ? codecs->Find(batch->info.mode) : nullptr);
  for (std::size_t i = 0; i < crowd.avatars.size(); ++i) {
    crowd.avatars[i] = batch->avatars[i];
    crowd.flags[i] = batch->flags[i];
    reader.Next();
    const auto rotations = std::span(crowd.rotations).subspan(i * joints, joints);
    if (const Status status = reader.Decode(crowd.roots_m[i], rotations); !status) {
      SetText(Describe(status.error()));
      return -1;
    }
  }
  SetCrowdResults(crowd);
  return static_cast<std::int32_t>(crowd.avatars.size());
}

/// Sets the text to the description of a status, or with `name` to its name.
STRIDEWIRE_EXPORT(describe_status) void DescribeStatus(stridewire_status status, bool name) {
  SetText(name ? stridewire_status_name(status) : stridewire_status_text(status));
}

// ---- a client

/// Creates a client. `input` contains 12 numbers, in the order of src/session_options.ts, and then
/// the client's name and token. Returns null and sets the text if a text is invalid.
STRIDEWIRE_EXPORT(create) Client* Create(std::size_t name_bytes, std::size_t token_bytes) {
  std::array<double, 12> numbers;
  const auto input = Input(sizeof numbers + name_bytes + token_bytes);
  std::memcpy(numbers.data(), input.data(), sizeof numbers);
  const auto* texts = reinterpret_cast<const char*>(input.data() + sizeof numbers);
  protocol::Hello hello;
  hello.client_name.assign(texts, name_bytes);
  hello.auth_token.assign(texts + name_bytes, token_bytes);
  if (const Status status = protocol::Check(hello); !status) {
    SetText(Describe(status.error()));
    return nullptr;
  }
  SessionOptions options;
  options.client_name = hello.client_name;
  options.auth_token = hello.auth_token;
  options.max_commands = static_cast<std::size_t>(numbers[0]);
  // When a session ends, one call adds the replies of all unanswered commands. The event queue must
  // hold them all, because no reply may be lost.
  options.max_events += options.max_commands + Session::kMaxInspections;
  options.pose_history = static_cast<std::size_t>(numbers[1]);
  // An address has 32 bits here.
  constexpr double kMaxBytes = 4294967295.0;
  options.max_pose_bytes = static_cast<std::size_t>(std::min(numbers[2], kMaxBytes));
  options.recording_s = numbers[3];
  options.max_recording_bytes = static_cast<std::size_t>(std::min(numbers[4], kMaxBytes));
  options.connect_timeout_s = numbers[5];
  options.ping_interval_s = numbers[6];
  options.render_delay_s = numbers[7];
  options.seed = static_cast<std::uint64_t>(numbers[8]);
  // The module does not use numbers[9], the maximum number of recorded events.
  options.respawn = numbers[10] != 0.0;
  options.keep_worlds = true;
  options.detailed_events = false;
  options.evaluation = WorldView::Evaluation::kWhenSampled;
  auto client = std::make_unique<Client>(options);
  client->has_library_cache = numbers[11] != 0.0;
  return client.release();
}

STRIDEWIRE_EXPORT(destroy) void Destroy(Client* client) { delete client; }

/// Starts to connect. `input` contains the addresses of the servers, each followed by a line feed.
STRIDEWIRE_EXPORT(open) void Open(Client* client, std::size_t bytes, double now_s) {
  std::vector<std::string> addresses;
  std::string address;
  for (const std::byte byte : Input(bytes)) {
    const char character = static_cast<char>(byte);
    if (character != '\n') {
      address += character;
    } else {
      addresses.push_back(std::exchange(address, {}));
    }
  }
  (void)client->session.Open(now_s, std::move(addresses));
}
STRIDEWIRE_EXPORT(close) void Close(Client* client, double now_s) { client->session.Close(now_s); }

/// Returns the state, a Session::State. results: 0 the next time at which to call advance, 1
/// whether to start an attempt to connect, 2 whether the state needs a socket, 3 the number of the
/// connection, 4 the number of unsent bytes, 5 the index of the address.
STRIDEWIRE_EXPORT(state) std::uint32_t State(Client* client, double now_s) {
  const Session& session = client->session;
  results[0] = session.NextTime();
  results[1] = session.ConnectDue(now_s);
  results[2] = session.NeedsSocket();
  results[3] = static_cast<double>(session.connection_number());
  results[4] = static_cast<double>(session.output_bytes());
  results[5] = static_cast<double>(session.address_index());
  return static_cast<std::uint32_t>(session.state());
}

STRIDEWIRE_EXPORT(start_connecting) void StartConnecting(Client* client, double now_s) {
  client->session.StartConnecting(now_s);
}
STRIDEWIRE_EXPORT(on_connected) void OnConnected(Client* client, double now_s) {
  client->session.OnConnected(now_s);
}
/// Handles the WebSocket message in `input`. Returns the command that it answers, or 0.
STRIDEWIRE_EXPORT(on_message) double OnMessage(Client* client, std::size_t bytes, double now_s) {
  client->session.OnMessage(Input(bytes), now_s);
  RunLibraryTasks(*client);
  return static_cast<double>(client->session.answered_command());
}

/// Returns 1 if the library whose hash is in the text should be loaded from the cache. In this
/// case, call on_library. Returns 2 if a file should be stored in the cache under the hash in the
/// text, and 0 if there is nothing to do. results: 0 the address of the file, 1 its size. The file
/// is valid until the next call.
STRIDEWIRE_EXPORT(take_library_request) std::uint32_t TakeLibraryRequest(Client* client) {
  client->stored_library = {};
  if (!client->libraries_to_load.empty()) {
    SetText(client->libraries_to_load.back());
    client->loading_libraries.push_back(std::move(client->libraries_to_load.back()));
    client->libraries_to_load.pop_back();
    return 1;
  }
  if (client->libraries_to_store.empty()) return 0;
  client->stored_library = std::move(client->libraries_to_store.back());
  client->libraries_to_store.pop_back();
  SetText(client->stored_library.hash);
  results[0] = Address(client->stored_library.file);
  results[1] = static_cast<double>(client->stored_library.file.size());
  return 2;
}
/// Handles a file that the cache has loaded. `input` contains the hash, followed by the file, which
/// is empty if the cache does not contain the library. Returns 1 if the file is the library with
/// this hash. If it is not, the client fetches the library from the server.
STRIDEWIRE_EXPORT(on_library)
bool OnLibrary(Client* client, std::size_t hash_bytes, std::size_t bytes) {
  const auto input = Input(hash_bytes + bytes);
  const std::string hash(reinterpret_cast<const char*>(input.data()), hash_bytes);
  if (std::erase(client->loading_libraries, hash) == 0) return false;
  auto library = bytes == 0 ? Fail(ErrorCode::kNotFound, "the cache does not contain the library")
                            : OpenLibrary(input.subspan(hash_bytes), hash);
  const bool is_valid = library.has_value();
  client->session.OnLibraryTask(hash, std::move(library));
  RunLibraryTasks(*client);
  return is_valid;
}

/// Calls Session::OnLost. `input` contains its text, whose length `bytes` may be 0.
STRIDEWIRE_EXPORT(on_lost)
void OnLost(Client* client, stridewire_status status, std::size_t bytes, double now_s) {
  const auto input = Input(bytes);
  client->session.OnLost(status, {reinterpret_cast<const char*>(input.data()), bytes}, now_s);
}
STRIDEWIRE_EXPORT(advance) void Advance(Client* client, double now_s) {
  client->session.AdvanceTime(now_s);
}
/// Moves the pending frames into Client::output and returns their size in bytes. results: 0 the
/// address of the frames.
STRIDEWIRE_EXPORT(take_output) std::size_t TakeOutput(Client* client) {
  if (!client->session.TakeOutput(client->output)) return 0;
  results[0] = Address(client->output);
  return client->output.size();
}
STRIDEWIRE_EXPORT(on_output_written) void OnOutputWritten(Client* client) {
  client->session.OnOutputWritten();
}

/// Removes the oldest event from the queue and returns its type, or -1 if the queue is empty. Sets
/// the text to that of the event. results: 0 world, 1 status, 2 command, 3 accepted, 4 resumed,
/// 5 dropped batches, 6 dropped events.
STRIDEWIRE_EXPORT(next_event) std::int32_t NextEvent(Client* client) {
  stridewire_event event;
  if (client->session.events().Take(std::span(&event, 1)) == 0) return -1;
  results[0] = event.world;
  results[1] = event.status;
  results[2] = static_cast<double>(event.command);
  results[3] = event.accepted;
  results[4] = event.resumed;
  results[5] = static_cast<double>(event.dropped_batches);
  results[6] = static_cast<double>(event.dropped_events);
  SetText(event.text);
  return event.type;
}

/// Sets the text to the reason of the last failure.
STRIDEWIRE_EXPORT(last_error) void LastError(Client* client) {
  SetText(client->session.last_text());
}

/// Sends the message in `input` as a command for a world, and returns a status. JoinWorld ignores
/// `world`. Sets the text if the status is not OK. results: 0 the number of the command, or the
/// nonce of an InspectAvatar; 1 the number of a new world or subscription.
STRIDEWIRE_EXPORT(command)
std::uint32_t Command(Client* client, stridewire_world world, std::uint32_t type,
                      std::size_t bytes) {
  auto message = DecodeInput(type, bytes);
  if (!message) return STRIDEWIRE_INVALID_ARGUMENT;
  std::uint64_t command = 0;
  const stridewire_status status = std::visit(Submit{client->session, world, command}, *message);
  if (status == STRIDEWIRE_NO_SUCH_WORLD) {  // The client has left the world.
    SetText(stridewire_status_text(STRIDEWIRE_NOT_JOINED));
    return STRIDEWIRE_NOT_JOINED;
  }
  return Report(*client, status, command);
}

/// Returns the address of a stridewire_statistics, directly followed by a stridewire_playout. The
/// next call overwrites both.
STRIDEWIRE_EXPORT(statistics) const void* Statistics(Client* client, double now_s) {
  static struct {
    stridewire_statistics statistics;
    stridewire_playout playout;
  } result;
  result = {client->session.Statistics(), client->session.Playout(now_s)};
  return &result;
}

STRIDEWIRE_EXPORT(tick_hz) double TickHz(Client* client) { return client->session.tick_hz(); }

/// Returns the server time at `now_s`; NaN if it is not known yet.
STRIDEWIRE_EXPORT(server_time) double ServerTime(Client* client, double now_s) {
  const ClockMap& clock = client->session.clock();
  return clock.ready() ? clock.ServerTime(now_s) : std::numeric_limits<double>::quiet_NaN();
}

/// Returns the server time to display at `now_s`; NaN if it is not known yet.
STRIDEWIRE_EXPORT(render_time) double RenderTime(Client* client, double now_s) {
  const Session& session = client->session;
  return session.clock().ready() ? session.RenderTime(now_s)
                                 : std::numeric_limits<double>::quiet_NaN();
}

// ---- worlds

/// Returns the world with this id of the server, or 0.
STRIDEWIRE_EXPORT(find_world) stridewire_world FindWorld(Client* client, std::uint32_t id) {
  return client->session.FindHandle(id);
}

/// Returns the state of a world, a Session::WorldState; -1 if there is no such world. results:
/// 0 the revision of its avatars, 1 the time of its newest pose, 2 the bytes of its recording,
/// 3 and 4 the first and the last time of the recording.
STRIDEWIRE_EXPORT(world_state) std::int32_t WorldState(Client* client, stridewire_world world) {
  const auto state = client->session.FindWorldState(world);
  if (!state) return -1;
  WorldView& view = *client->session.FindWorld(world);
  results[0] = static_cast<double>(view.revision());
  results[1] = view.newest_time_s();
  results[2] = static_cast<double>(view.recording().bytes());
  results[3] = view.recording().first_time_s();
  results[4] = view.recording().last_time_s();
  return static_cast<std::int32_t>(*state);
}

STRIDEWIRE_EXPORT(clear_recording) void ClearRecording(Client* client, stridewire_world world) {
  if (WorldView* view = client->session.FindWorld(world)) view->recording().Clear();
}

/// Returns the number of avatars of a world that are not gone. results: 0 the address of their ids.
STRIDEWIRE_EXPORT(avatars) std::size_t Avatars(Client* client, stridewire_world world) {
  const WorldView* view = client->session.FindWorld(world);
  client->avatars = view == nullptr ? std::vector<protocol::AvatarId>() : view->Avatars();
  results[0] = Address(client->avatars);
  return client->avatars.size();
}

/// Samples one avatar. Returns 0 if its pose is missing, 1 if it is interpolated, 2 if it is held
/// and 3 if it is extrapolated. results: 0 number of joints, 1 address of the root's position,
/// 2 address of the rotations, 3 tick, 4 flags (CrowdFlags), 5 time since the pose of this tick if
/// the result is not 1, 6 segment.
STRIDEWIRE_EXPORT(sample)
std::uint32_t Sample(Client* client, stridewire_world world, protocol::AvatarId avatar,
                     double time_s) {
  WorldView* view = client->session.FindWorld(world);
  PoseHistory* history = view == nullptr ? nullptr : view->Find(avatar);
  if (history == nullptr || history->size() == 0) return 0;
  const bool is_after_newest = time_s > history->stamp(history->size() - 1).time_s;
  if (view->IsGone(avatar) && is_after_newest) return 0;
  client->rotations.resize(history->joint_count());
  const auto sampled = history->Display(time_s, client->root_position_m, client->rotations);
  if (!sampled) return 0;
  const PoseStamp& stamp = history->stamp(sampled->index);
  client->session.displayed().Add(*sampled, is_after_newest);
  results[0] = static_cast<double>(history->joint_count());
  results[1] = static_cast<double>(reinterpret_cast<std::uintptr_t>(&client->root_position_m));
  results[2] = Address(client->rotations);
  results[3] = static_cast<double>(stamp.tick);
  results[4] = CrowdFlagsOf(stamp);
  results[5] = sampled->interpolated ? 0.0 : time_s - stamp.time_s;
  results[6] = stamp.segment;
  return sampled->interpolated ? 1 : sampled->extrapolated ? 3 : 2;
}

/// Samples all avatars of a world, from its recording if `recorded`. Returns their number. results:
/// 0 number of joints, 1 address of the ids, 2 of the flags, 3 of the roots, 4 of the rotations.
/// The memory is valid until the next call of this function.
STRIDEWIRE_EXPORT(sample_all)
std::size_t SampleAll(Client* client, stridewire_world world, double time_s, bool recorded) {
  WorldView* view = client->session.FindWorld(world);
  CrowdPose& crowd = client->crowd;
  if (view == nullptr) {
    crowd.Resize(0, 0);
  } else if (recorded) {
    view->recording().SampleAll(
        time_s, [view](protocol::AvatarId avatar) { return view->Admits(avatar); }, crowd);
  } else {
    view->SampleAll(time_s, crowd, client->session.displayed());
  }
  SetCrowdResults(crowd);
  return crowd.avatars.size();
}

}  // namespace stridewire::client

/// Replaces the function from which the allocator of the C library gets memory. Engines may copy
/// the whole memory when it grows, so it grows by a quarter of its size (4 to 64 MiB) instead of 64
/// KiB at a time.
// NOLINTNEXTLINE(readability-identifier-naming): the name of the C library.
extern "C" void* sbrk(std::intptr_t increment) {
  constexpr std::size_t kPageBytes = std::size_t{64} << 10;
  constexpr std::size_t kLeastPages = 64;
  constexpr std::size_t kMostPages = 1024;
  static std::size_t end = __builtin_wasm_memory_size(0) * kPageBytes;
  const std::size_t size = __builtin_wasm_memory_size(0) * kPageBytes;
  const auto wanted = static_cast<std::size_t>(increment);
  if (increment < 0) return reinterpret_cast<void*>(std::intptr_t{-1});
  if (wanted > size - end) {
    const std::size_t least = (wanted - (size - end) + kPageBytes - 1) / kPageBytes;
    const std::size_t pages =
        std::max(least, std::clamp(size / kPageBytes / 4, kLeastPages, kMostPages));
    if (__builtin_wasm_memory_grow(0, pages) == SIZE_MAX &&
        __builtin_wasm_memory_grow(0, least) == SIZE_MAX) {
      return reinterpret_cast<void*>(std::intptr_t{-1});
    }
  }
  const std::size_t start = end;
  end += wanted;
  return reinterpret_cast<void*>(start);
}
