#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/refusal.h"
#include "session/reply_cache.h"
#include "session/session_context.h"
#include "session/session_stream.h"
#include "session/token_bucket.h"

namespace stridewire::server {

/// The part of a session that executes the commands of its client. Each command has a sequence
/// number and gets exactly one Reply.
///
///   Handle ---> pending, until shards or the main thread have replied ---> answered --> forgotten
///          \--- refused, or needs no other thread -----------------------^
///
/// The Reply of a forgotten command is no longer stored (ReplyCache).
class SessionCommands {
 public:
  SessionCommands(SessionContext& context, SessionStream& stream);

  /// True if `Command` is a message type that Handle accepts.
  template <typename Command>
  [[nodiscard]] static constexpr bool IsCommand() {
    return requires(SessionCommands& commands, Command command) {
      commands.Execute(std::move(command));
    };
  }

  /// Executes a command, or repeats its reply if it was executed before. Returns a Refusal if the
  /// client has skipped a command; the connection must then be closed.
  template <typename Command>
  [[nodiscard]] std::optional<Refusal> Handle(Command command) {
    if (!Begin(command.seq)) {
      if (replies_.Classify(command.seq) != ReplyCache::Verdict::kGap) return std::nullopt;
      return Refusal{protocol::StatusCode::kBadSequence, "a command before this one is missing"};
    }
    if (context_.host.is_draining()) {
      Answer(command.seq, protocol::StatusCode::kShuttingDown, "the server is shutting down");
    } else {
      Execute(std::move(command));
    }
    return std::nullopt;
  }

  // Results from shards and from the main thread.
  void OnResult(CommandResult&& result);
  void OnJoined(protocol::Seq seq, Outcome<std::shared_ptr<World>>&& outcome);
  void OnTerrainRefused(protocol::Seq seq, Refusal refusal);

  /// Leaves a world without a reply. The session must be a member.
  void Leave(WorldId world);

  void SendWorldInfo(protocol::Seq seq, const Membership& membership);

  [[nodiscard]] protocol::Seq last_seq() const { return replies_.last_seq(); }
  [[nodiscard]] std::size_t pending_count() const { return pending_.size(); }
  [[nodiscard]] std::size_t pending_items() const { return pending_items_; }
  /// Returns the maximum number of items per command. A Reply that refuses this many items fits
  /// into a frame.
  [[nodiscard]] static std::size_t MaxItems(const Limits& limits);

 private:
  /// A command that waits for results.
  struct Pending {
    int outstanding = 0;  // Number of shards that have not answered.
    std::size_t item_count = 0;
    protocol::Role role = protocol::Role::kController;  // Role that a JoinWorld requested.
    protocol::Reply reply;
  };

  /// Returns true if the command is new. Otherwise repeats the reply, if there is one.
  [[nodiscard]] bool Begin(protocol::Seq seq);
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

  /// Returns the membership if the session may command avatars of this world. Otherwise answers the
  /// command and returns null.
  Membership* FindControlled(protocol::Seq seq, WorldId world);
  /// Returns false and answers the command if it has too many items or exceeds the rate limit.
  [[nodiscard]] bool AcceptItems(protocol::Seq seq, std::size_t item_count);
  /// Sends each part that is not empty to the shard with its index. `pending` contains the items
  /// that are already refused.
  template <typename Part>
  void SubmitParts(protocol::Seq seq, const std::shared_ptr<World>& world,
                   std::vector<Part>&& parts, Pending&& pending);
  /// Executes a command that applies to a list of avatars: checks it, and sends each shard a copy
  /// of `empty` to which the avatars of the shard have been added.
  template <typename Part>
  void SubmitAvatars(protocol::Seq seq, WorldId world, const std::vector<AvatarId>& avatars,
                     const Part& empty = {});
  void MoveRegion(const protocol::Observe& command, const std::shared_ptr<World>& world);
  Pending& AddPending(protocol::Seq seq, Pending&& pending);
  /// Removes a pending command and returns it.
  Pending TakePending(protocol::Seq seq);
  void Answer(protocol::Seq seq, protocol::StatusCode code, std::string text = {});
  void Answer(protocol::Reply&& reply, WorldId joined = 0);

  SessionContext& context_;
  SessionStream& stream_;
  std::map<protocol::Seq, Pending> pending_;
  std::size_t pending_items_ = 0;  // Sum of Pending::item_count of all pending commands.
  ReplyCache replies_;
  TokenBucket request_tokens_;
};

}  // namespace stridewire::server
