#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "crowd_pose.h"
#include "movement_recording.h"
#include "stridewire/protocol/compact_codecs.h"
#include "stridewire/protocol/messages.h"
#include "stridewire/runtime/pose.h"

namespace stridewire::client {

/// The last seconds of a world, for replay. Stores encoded batches and decodes only the sampled
/// ticks.
///
///   stream (shard, or mode and shard of a region)
///     ticks:    oldest ... [info, epoch, parts] ... newest     encoded
///     decoded:  the last ticks that were sampled               poses
class PoseRecording {
 public:
  /// Time after the last batch of its stream for which an avatar can be sampled, in seconds.
  static constexpr double kKeepS = 2.0;

  /// Creates a recording of `length_s` seconds. Batches, movements and decoded ticks take at most
  /// `max_bytes`, and decoded ticks take at most half of that. A call of SampleAll may take more
  /// until it returns. If either argument is 0, nothing is recorded.
  PoseRecording(double length_s, std::size_t max_bytes)
      : length_s_(length_s), max_bytes_(max_bytes) {}

  [[nodiscard]] bool enabled() const { return length_s_ > 0.0 && max_bytes_ > 0; }

  /// Adds a copy of a batch. `codecs` decodes its poses if they are compact. SampleAll does not
  /// interpolate between poses of different epochs. If a tick of a shard arrives in two modes, only
  /// the first one is stored. Regions are an exception: their batches in different modes contain
  /// different avatars. `moving` contains avatars of the tick whose movements were added to
  /// `movements()`.
  void Add(const protocol::PoseBatch& batch, std::uint64_t epoch,
           const std::shared_ptr<const protocol::CompactCodecs>& codecs,
           std::span<const protocol::AvatarId> moving = {});
  [[nodiscard]] MovementRecording& movements() { return movements_; }

  void Clear();

  /// Returns the server time of the oldest recorded pose; NaN if the recording is empty.
  [[nodiscard]] double first_time_s() const;
  [[nodiscard]] double last_time_s() const { return last_time_s_; }
  /// Returns the memory of batches, movements and decoded ticks in bytes.
  [[nodiscard]] std::size_t bytes() const { return bytes_ + movements_.bytes() + DecodedBytes(); }

  /// Computes the poses at `time_s` of all avatars for which `wants` returns true. Before the
  /// recorded time, and more than kKeepS after it, `out` is empty. Like PoseHistory, it does not
  /// interpolate across discontinuities.
  void SampleAll(double time_s, const std::function<bool(protocol::AvatarId)>& wants,
                 CrowdPose& out);

 private:
  struct Part {
    std::uint16_t number = 0;
    std::vector<protocol::AvatarId> avatars;
    std::vector<std::uint8_t> flags;
    std::vector<std::byte> poses;
    std::vector<protocol::AvatarId> moving;  ///< Avatars whose poses `movements_` evaluates.
  };
  struct Tick {
    protocol::PoseBatchInfo info;
    std::uint64_t epoch = 0;
    std::shared_ptr<const protocol::CompactCodecs> codecs;
    std::vector<Part> parts;
    std::size_t bytes = 0;
  };
  /// Decoded poses of a tick. The buffers are reused for other ticks.
  struct Decoded {
    const Tick* source = nullptr;  ///< Null: the buffers contain no poses.
    std::uint64_t last_use = 0;
    CrowdPose poses;  ///< Poses in ascending order of avatar ids.
    [[nodiscard]] bool Find(protocol::AvatarId avatar, std::size_t& index) const;
    [[nodiscard]] ConstPoseSpan pose(std::size_t i) const;
  };
  struct Stream {
    std::deque<Tick> ticks;
    std::vector<std::unique_ptr<Decoded>> decoded;
  };
  /// The ticks of a stream around a time. Poses are interpolated between them. A pointer is null if
  /// the stream has no such tick, or if a discontinuity separates it from the time. All are null if
  /// the time is more than kKeepS after the newest tick.
  struct Neighbours {
    const Decoded* start = nullptr;
    bool exact = false;  ///< True if `start` is exactly at the time. The others are then null.
    const Decoded* end = nullptr;
    const Decoded* before = nullptr;
    const Decoded* beyond = nullptr;
  };
  /// Maximum number of decoded ticks that are kept per stream. Each interpolation needs up to four.
  static constexpr std::size_t kMaxDecoded = 8;

  [[nodiscard]] std::size_t DecodedBytes() const;
  const Decoded* Decode(Stream& stream, const Tick& tick);
  static void Discard(Stream& stream, const Tick& tick);
  [[nodiscard]] Neighbours FindNeighbours(Stream& stream, double time_s);
  static void Interpolate(const Neighbours& around, double time_s, CrowdPose& out);
  void DropOld();

  double length_s_;
  std::size_t max_bytes_;
  std::map<std::int32_t, Stream> streams_;
  MovementRecording movements_;
  std::size_t bytes_ = 0;  ///< Memory of all batches.
  double last_time_s_ = std::numeric_limits<double>::quiet_NaN();
  std::uint64_t use_count_ = 0;
  std::vector<Neighbours> around_;
  std::vector<std::size_t> order_;  // Scratch memory of Decode.
  CrowdPose unsorted_;              // Scratch memory of Decode.
};

}  // namespace stridewire::client
