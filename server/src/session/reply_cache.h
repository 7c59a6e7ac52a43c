#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

#include "net/shared_frame.h"
#include "stridewire/protocol/messages.h"
#include "world/world.h"

namespace stridewire::server {

/// Knows which commands of a session were taken and what was answered, so that a command sent
/// again is not done again (STATE_MACHINE.md, "Commands").
///
/// Bounded: at most `max_count` commands back, and at most `max_bytes` of answers, the last answer
/// apart; older ones are forgotten, unanswered ones never.
class ReplyCache {
 public:
  enum class Verdict : std::uint8_t {
    kNew,        ///< The next one: take it.
    kPending,    ///< Taken, not answered yet: do nothing.
    kAnswered,   ///< Send the answer again.
    kForgotten,  ///< Done long ago.
    kGap,        ///< One before it is missing.
  };
  struct Answer {
    SharedFrame reply;   ///< Null while pending.
    WorldId joined = 0;  ///< The world of a JoinWorld, else 0.
  };

  ReplyCache(std::size_t max_count, std::size_t max_bytes)
      : max_count_(max_count), max_bytes_(max_bytes) {}

  [[nodiscard]] Verdict Classify(protocol::Seq seq) const;

  /// A command judged kNew is taken.
  void Take(protocol::Seq seq);

  /// It is answered. Returns how many answers were forgotten for it.
  std::size_t Remember(protocol::Seq seq, SharedFrame reply, WorldId joined);

  /// Of a command judged kAnswered.
  [[nodiscard]] const Answer& Find(protocol::Seq seq) const;

  [[nodiscard]] protocol::Seq last_seq() const { return first_ + answers_.size() - 1; }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  std::size_t max_count_;
  std::size_t max_bytes_;
  protocol::Seq first_ = 1;  // seq of answers_[0]
  std::deque<Answer> answers_;
  std::size_t bytes_ = 0;
};

}  // namespace stridewire::server
