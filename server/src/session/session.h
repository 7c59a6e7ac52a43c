#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "net/connection.h"
#include "session/encode_frame.h"
#include "session/event_replay.h"
#include "session/movement_feed.h"
#include "session/refusal.h"
#include "session/reply_cache.h"
#include "session/session_host.h"
#include "session/subscriptions.h"
#include "session/token_bucket.h"

namespace stridewire::server {

/// Features this server has.
inline constexpr std::uint64_t kServerFeatures =
    protocol::kFeatureResume | protocol::kFeatureEventReplay | protocol::kFeatureQuantised |
    protocol::kFeatureInspect | protocol::kFeatureTerrain | protocol::kFeatureFootprints |
    protocol::kFeatureWalks | protocol::kFeatureTakeovers | protocol::kFeatureLayers |
    protocol::kFeatureRefusals | protocol::kFeaturePlanting | protocol::kFeatureMovementMode |
    protocol::kFeatureCompact | protocol::kFeatureDetail | protocol::kFeatureRegions;

/// Who a session is; made when it begins, the same for its whole life.
struct SessionIdentity {
  SessionId id = 0;
  std::vector<std::byte> token;
  std::string address;
};

/// Events of one delivery as frames without number, encoded when the first session asks.
class SharedEvents {
 public:
  SharedEvents(const EventDelivery& delivery, protocol::Encoder& encoder)
      : delivery_(delivery), encoder_(encoder) {}
  [[nodiscard]] const std::vector<SharedFrame>& frames();
  [[nodiscard]] const EventDelivery& delivery() const { return delivery_; }

 private:
  const EventDelivery& delivery_;
  protocol::Encoder& encoder_;
  std::vector<SharedFrame> frames_;
};

/// Movements of one delivery as frames, encoded when the first session asks.
class SharedMovements {
 public:
  SharedMovements(const MovementDelivery& delivery, protocol::Encoder& encoder)
      : delivery_(delivery), encoder_(encoder) {}
  [[nodiscard]] const MovementDelivery& delivery() const { return delivery_; }
  /// The steps of all avatars.
  [[nodiscard]] const std::vector<SharedFrame>& frames();
  /// The `i`th with no avatar in it; `empty` says so.
  [[nodiscard]] const SharedFrame& Empty(std::size_t i, const protocol::Movements& empty);

 private:
  const MovementDelivery& delivery_;
  protocol::Encoder& encoder_;
  std::vector<SharedFrame> frames_;
  std::vector<SharedFrame> empty_;  // null: nobody has asked
};

/// Poses of one delivery and the batches made of them for several sessions.
class SharedPoses {
 public:
  SharedPoses(const PoseDelivery& delivery, protocol::PoseBatchComposer& composer,
              ThreadMetrics& metrics)
      : delivery_(delivery), composer_(composer), metrics_(metrics) {}
  [[nodiscard]] const PoseDelivery& delivery() const { return delivery_; }
  /// A batch with those rows.
  [[nodiscard]] PoseDelivery Compose(std::span<const std::uint32_t> rows, bool is_partial);
  /// A partial one, the same for all who ask for the same.
  [[nodiscard]] const PoseDelivery& ComposeShared(std::span<const std::uint32_t> rows);

 private:
  const PoseDelivery& delivery_;
  protocol::PoseBatchComposer& composer_;
  ThreadMetrics& metrics_;
  struct RowsHash {
    std::size_t operator()(const std::vector<std::uint32_t>& rows) const {
      return std::hash<std::string_view>()(
          {reinterpret_cast<const char*>(rows.data()), rows.size() * sizeof(rows[0])});
    }
  };
  std::unordered_map<std::vector<std::uint32_t>, PoseDelivery, RowsHash> shared_;
};

/// One client: worlds joined, subscriptions, commands under way and answered. Lives on one shard
/// and outlives its connection for the resume window (STATE_MACHINE.md).
///
/// Memory: what Limits allow (reply_memory_bytes + event_replay_bytes + twice control_buffer_bytes + the
/// connection), whatever the client does.
class Session : private ConnectionHandler {
 public:
  using Clock = Connection::Clock;

  Session(SessionIdentity identity, SessionHost& host);
  ~Session() override;
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Takes a connection whose client said `hello`; the one before is closed. `received` came
  /// behind the Hello.
  void Attach(std::shared_ptr<Connection> connection, const protocol::Hello& hello, bool resumed,
              std::span<const std::byte> received);

  void OnResult(CommandResult&& result);
  void OnJoined(protocol::Seq seq, Outcome<std::shared_ptr<World>>&& outcome);
  void OnInspected(const protocol::AvatarState& state);
  void OnTerrainRefused(protocol::Seq seq, Refusal refusal);
  /// The ground of a world has changed.
  void OnGround(WorldId world, const SharedFrame& frame);
  void OnPoses(SharedPoses& poses);
  void OnMovements(SharedMovements& movements);
  void OnStates(const StatesAnswer& answer);
  void OnEvents(SharedEvents& events);

  /// Now and then: what is due by time.
  void Housekeep(Clock::time_point now);

  /// The server goes down: tells the client, which may come back later, once nothing it asked for
  /// is still under way.
  void Drain();

  /// Leaves all worlds and closes. Afterwards it may be destroyed.
  void End();

  [[nodiscard]] const SessionIdentity& identity() const { return identity_; }
  [[nodiscard]] bool is_ended() const { return is_ended_; }
  [[nodiscard]] bool is_attached() const { return connection_ != nullptr; }
  [[nodiscard]] bool is_attached(TransportKind kind) const {
    return connection_ != nullptr && connection_->kind() == kind;
  }

  // What this session wants of a world, for the shard to sum up.
  [[nodiscard]] bool WantsEvents(WorldId world) const;
  [[nodiscard]] bool WantsMovements(WorldId world) const {
    return connection_ != nullptr && subscriptions_.Watches(world, protocol::PoseMode::kMovement);
  }
  /// Where avatars are, too, for a region whose movements it wants.
  [[nodiscard]] bool WantsMovementPlaces(WorldId world) const {
    return WantsMovements(world) && subscriptions_.HasRegion(world);
  }
  [[nodiscard]] PoseInterest::Every EveryOf(WorldId world, protocol::PoseMode mode) const;
  [[nodiscard]] std::span<const AvatarId> Named(WorldId world, protocol::PoseMode mode) const;
  [[nodiscard]] std::optional<RegionFilter> ReachOf(WorldId world, protocol::PoseMode mode) const;
  [[nodiscard]] std::size_t region_count() const { return subscriptions_.region_count(); }

 private:
  struct Membership {
    std::shared_ptr<World> world;
    protocol::Role role = protocol::Role::kController;
    std::uint64_t dropped_batches = 0;
    std::uint64_t dropped_events = 0;
    std::uint64_t told_dropped = 0;  // sum of the two when Lagging was last sent
  };
  struct Pending {
    int outstanding = 0;  // shards that have not answered
    std::size_t item_count = 0;
    protocol::Role role = protocol::Role::kController;  // of a JoinWorld
    protocol::Reply reply;
  };

  void OnMessage(protocol::Message&& message) override;
  void OnBadFrame(const Error& error) override;
  void OnSent() override;
  void OnIdle() override;
  void OnStuck() override;
  void OnClosed() override;

  template <typename Command>
  void Handle(Command command);
  void Execute(protocol::JoinWorld&& command);
  void Execute(protocol::LeaveWorld&& command);
  void Execute(protocol::Spawn&& command);
  void Execute(protocol::Remove&& command);
  void Execute(protocol::Request&& command);
  void Execute(protocol::CancelQueue&& command);
  void Execute(protocol::SetTerrain&& command);
  void Execute(protocol::SetLayers&& command);
  void Execute(protocol::SetPlanting&& command);
  void Execute(protocol::Observe&& command);
  void Execute(protocol::StopObserving&& command);

  void Inspect(const protocol::InspectAvatar& question);
  void Fetch(const protocol::FetchLibrary& question);

  void WatchMovements(const std::shared_ptr<World>& world);
  void EndMovements(WorldId world);
  void AskForStates();
  void SendMovements(WorldId world, int shard, MovementFeed& feed, const SharedFrame& frame);

  /// The membership a controller's command needs; answers and returns null if there is none.
  Membership* Commanding(protocol::Seq seq, WorldId world);
  bool Affords(protocol::Seq seq, std::size_t item_count);
  /// Of one command.
  [[nodiscard]] static std::size_t MaxItems(const Limits& limits);
  template <typename Part>
  void SubmitParts(protocol::Seq seq, const std::shared_ptr<World>& world,
                   std::vector<Part>&& parts, Pending&& pending);
  /// `empty`: a part without avatars.
  template <typename Part>
  void SubmitAvatars(protocol::Seq seq, WorldId world, const std::vector<AvatarId>& avatars,
                     const Part& empty = {});
  void Leave(WorldId id);

  void Answer(protocol::Seq seq, protocol::StatusCode code, std::string text = {});
  void Answer(protocol::Reply&& reply, WorldId joined = 0);
  void SendWorldInfo(protocol::Seq seq, const Membership& membership);
  /// The world's ground, if it has one or if it is wanted all the same.
  void SendTerrain(const World& world, bool also_flat);
  void SendLagging(Membership& membership);
  void SendPoses(const PoseDelivery& delivery);
  void MoveRegion(const protocol::Observe& command, const std::shared_ptr<World>& world);
  void TellRegion(WorldId world, std::uint64_t tick, const RegionMembers::Change& change);
  /// Numbers and sends it, or keeps it for a client that is away. Returns how many events were lost.
  std::uint64_t SendNumbered(protocol::Events&& message);
  void CountDropped(WorldId world, std::uint64_t events);
  template <typename Message>
  void Send(const Message& message) {
    if (connection_ == nullptr) return;
    if (auto frame = EncodeFrame(host_.encoder(), message)) {
      connection_->SendControl(std::move(frame));
    }
  }
  /// Says why and lets the connection go; the session waits for its client.
  void Fail(protocol::StatusCode code, std::string text, protocol::Seq seq = 0);
  void Detach();
  void UpdatePause();

  SessionIdentity identity_;
  SessionHost& host_;
  std::shared_ptr<Connection> connection_;
  std::string client_name_;
  std::uint64_t features_ = 0;
  bool is_ended_ = false;
  Clock::time_point detached_since_;

  std::map<WorldId, Membership> worlds_;
  Subscriptions subscriptions_;
  std::map<std::pair<WorldId, int>, MovementFeed> movement_feeds_;  // by world and avatars' shard
  std::uint32_t states_nonce_ = 0;
  std::map<protocol::Seq, Pending> pending_;
  std::size_t pending_items_ = 0;
  int pending_questions_ = 0;
  ReplyCache replies_;
  EventReplay event_replay_;
  std::uint64_t events_number_ = 0;
  TokenBucket request_tokens_;
  TokenBucket message_tokens_;
};

}  // namespace stridewire::server
