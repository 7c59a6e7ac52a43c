#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

#include "net/shared_frame.h"
#include "stridewire/protocol/messages.h"
#include "world/world.h"

namespace stridewire::server {

/// Stores the replies to the last commands of a session. A client that has lost its connection
/// sends unanswered commands again. The server then repeats the reply instead of executing the
/// command a second time (STATE_MACHINE.md, "Commands").
///
///   forgotten <- first_seq ... answered or pending ... last_seq -> new
///
/// If there are more than `max_count` commands or `max_bytes` of replies, the oldest replies are
/// discarded ("forgotten"), except the last one and those after an unanswered command.
class ReplyCache {
 public:
  enum class Verdict : std::uint8_t {
    kNew,        ///< The next command; the session executes it.
    kPending,    ///< The command was accepted, but not answered yet; the session ignores it.
    kAnswered,   ///< The command was answered; the session sends the stored reply again.
    kForgotten,  ///< The command was executed, but its reply is no longer stored.
    kGap,        ///< A command before this one was not received.
  };
  struct Answer {
    SharedFrame reply;   ///< The encoded Reply; null while the command is pending.
    WorldId joined = 0;  ///< The world of a successful JoinWorld, otherwise 0.
  };

  ReplyCache(std::size_t max_count, std::size_t max_bytes)
      : max_count_(max_count), max_bytes_(max_bytes) {}

  [[nodiscard]] Verdict Classify(protocol::Seq seq) const;

  /// Accepts a command that is kNew. It becomes kPending.
  void Begin(protocol::Seq seq);

  /// Stores the reply to a command that is kPending. The command becomes kAnswered. Returns how
  /// many older replies were discarded.
  std::size_t Store(protocol::Seq seq, SharedFrame reply, WorldId joined);

  /// Returns the reply to a command that is kAnswered.
  [[nodiscard]] const Answer& Find(protocol::Seq seq) const;

  [[nodiscard]] protocol::Seq last_seq() const { return first_seq_ + answers_.size() - 1; }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  std::size_t max_count_;
  std::size_t max_bytes_;
  protocol::Seq first_seq_ = 1;  // Sequence number of answers_[0].
  std::deque<Answer> answers_;
  std::size_t bytes_ = 0;  // Size of all stored replies.
};

}  // namespace stridewire::server
