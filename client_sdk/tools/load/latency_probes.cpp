#include "latency_probes.h"

#include "base/check.h"

namespace stridewire::load {

void LatencyProbes::Schedule(std::size_t avatar, std::uint64_t request, std::int64_t scheduled_ns,
                             std::int64_t now_ns) {
  Probe& probe = probes_[avatar];
  if (probe.request != 0) Close(probe, now_ns);
  STRIDEWIRE_CHECK(request != 0 && probe.request == 0);
  probe.request = request;
  probe.scheduled_ns = scheduled_ns;
  ++open_count_;
}

void LatencyProbes::Started(std::size_t avatar, std::uint64_t request, std::uint64_t tick) {
  Probe& probe = probes_[avatar];
  if (probe.request != request || request == 0) return;
  if (probe.first_tick >= tick && probe.first_tick != 0) return Close(probe, probe.first_ns);
  if (probe.last_tick >= tick && probe.last_tick != 0) return Close(probe, probe.last_ns);
  probe.started_tick = tick;
}

void LatencyProbes::Rejected(std::size_t avatar, std::uint64_t request) {
  if (probes_[avatar].request == request) Abandon(avatar);
}

void LatencyProbes::Pose(std::size_t avatar, std::uint64_t tick, std::int64_t arrived_ns,
                         bool changed) {
  Probe& probe = probes_[avatar];
  if (probe.request == 0 || !changed) return;
  if (probe.started_tick != 0) {
    if (tick >= probe.started_tick) Close(probe, arrived_ns);
    return;
  }
  if (probe.first_tick == 0) {
    probe.first_tick = tick;
    probe.first_ns = arrived_ns;
  }
  probe.last_tick = tick;
  probe.last_ns = arrived_ns;
}

void LatencyProbes::Abandon(std::size_t avatar) {
  if (probes_[avatar].request == 0) return;
  STRIDEWIRE_CHECK(open_count_ > 0);
  probes_[avatar] = Probe{};
  --open_count_;
}

std::size_t LatencyProbes::Finish(std::int64_t now_ns) {
  std::size_t unfinished = 0;
  for (Probe& probe : probes_) {
    if (probe.request == 0) continue;
    Close(probe, now_ns);
    ++unfinished;
  }
  return unfinished;
}

void LatencyProbes::Close(Probe& probe, std::int64_t moved_ns) {
  STRIDEWIRE_CHECK(probe.request != 0 && open_count_ > 0);
  times_.RecordNs(moved_ns - probe.scheduled_ns);
  probe = Probe{};
  --open_count_;
}

}  // namespace stridewire::load
