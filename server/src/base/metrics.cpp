#include "base/metrics.h"

#include <prometheus/collectable.h>
#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "stridewire/base/version.h"

namespace stridewire::server {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;

MetricFamily Simple(MetricType type, const char* name, const char* help, double value) {
  MetricFamily family{name, help, type, {}};
  ClientMetric metric;
  (type == MetricType::Counter ? metric.counter.value : metric.gauge.value) = value;
  family.metric.push_back(std::move(metric));
  return family;
}

}  // namespace

void TimeHistogram::Observe(double time_s) {
  const auto bin = std::ranges::lower_bound(kUpperBoundsS, time_s) - kUpperBoundsS.begin();
  const auto time_ns = static_cast<std::uint64_t>(std::llround(std::max(time_s, 0.0) * 1e9));
  bins_[static_cast<std::size_t>(bin)].Add();
  sum_ns_.Add(time_ns);
  if (time_ns > max_ns_.value()) max_ns_.Set(time_ns);
  // A reader may reset this value to 0 at the same time. The loop ensures that the larger value is
  // not lost.
  std::uint64_t recent = recent_max_ns_.load(std::memory_order_relaxed);
  while (recent < time_ns && !recent_max_ns_.compare_exchange_weak(recent, time_ns)) {
  }
}

double TimeHistogram::TakeRecentMax() {
  return 1e-9 * static_cast<double>(recent_max_ns_.exchange(0));
}

Metrics::Metrics(int shard_count) {
  STRIDEWIRE_CHECK(shard_count >= 1);
  for (int i = 0; i <= shard_count; ++i) threads_.push_back(std::make_unique<ThreadMetrics>());
}

Metrics::~Metrics() = default;

ThreadMetrics& Metrics::shard(int index) { return *threads_[static_cast<std::size_t>(index)]; }
ThreadMetrics& Metrics::main() { return *threads_.back(); }

std::uint64_t Metrics::Sum(Count ThreadMetrics::* number) const {
  std::uint64_t sum = 0;
  for (const auto& thread : threads_) sum += ((*thread).*number).value();
  return sum;
}

std::uint64_t Metrics::Sum(Limit limit) const {
  std::uint64_t sum = 0;
  for (const auto& thread : threads_) {
    sum += thread->limits[static_cast<std::size_t>(limit)].value();
  }
  return sum;
}

std::string Metrics::Text() {
  std::vector<MetricFamily> families;
  const auto counter = [&](const char* name, const char* help, Count ThreadMetrics::* number) {
    families.push_back(Simple(MetricType::Counter, name, help, static_cast<double>(Sum(number))));
  };
  const auto gauge = [&](const char* name, const char* help, double value) {
    families.push_back(Simple(MetricType::Gauge, name, help, value));
  };
  const auto histogram = [&](const char* name, const char* help,
                             TimeHistogram ThreadMetrics::* times) {
    MetricFamily family{name, help, MetricType::Histogram, {}};
    ClientMetric metric;
    std::uint64_t cumulative = 0;
    for (std::size_t i = 0; i <= TimeHistogram::kUpperBoundsS.size(); ++i) {
      for (const auto& thread : threads_) cumulative += ((*thread).*times).bin(i);
      const bool is_last = i == TimeHistogram::kUpperBoundsS.size();
      metric.histogram.bucket.push_back(
          {cumulative, is_last ? INFINITY : TimeHistogram::kUpperBoundsS[i]});
    }
    metric.histogram.sample_count = cumulative;
    double max_s = 0.0;
    double recent_max_s = 0.0;
    for (const auto& thread : threads_) {
      metric.histogram.sample_sum += ((*thread).*times).sum_s();
      max_s = std::max(max_s, ((*thread).*times).max_s());
      recent_max_s = std::max(recent_max_s, ((*thread).*times).TakeRecentMax());
    }
    family.metric.push_back(std::move(metric));
    families.push_back(std::move(family));
    const std::string base(name);
    families.push_back(Simple(MetricType::Gauge, (base + "_max").c_str(),
                              "Largest observed value since the server started.", max_s));
    families.push_back(Simple(MetricType::Gauge, (base + "_max_since_scrape").c_str(),
                              "Largest observed value since the previous scrape.", recent_max_s));
  };

  gauge("stridewire_avatars", "Avatars in all worlds.",
        static_cast<double>(Sum(&ThreadMetrics::avatars)));
  gauge("stridewire_worlds", "Worlds.", static_cast<double>(worlds_.value()));
  gauge("stridewire_regions", "Regions that sessions observe.",
        static_cast<double>(Sum(&ThreadMetrics::regions)));
  const auto attached = static_cast<double>(Sum(&ThreadMetrics::sessions_attached));
  const auto detached = static_cast<double>(Sum(&ThreadMetrics::sessions_detached));
  gauge("stridewire_sessions", "Sessions, connected or waiting for their client.",
        attached + detached);
  gauge("stridewire_sessions_detached", "Sessions waiting for their client to reconnect.",
        detached);

  const auto websockets = static_cast<double>(Sum(&ThreadMetrics::sessions_websocket));
  MetricFamily attached_sessions{"stridewire_sessions_attached",
                                 "Sessions that are connected, by transport.",
                                 MetricType::Gauge,
                                 {}};
  for (const auto& [name, count] : {std::pair("tcp", std::max(attached - websockets, 0.0)),
                                    std::pair("websocket", websockets)}) {
    ClientMetric metric;
    metric.label.push_back({"transport", name});
    metric.gauge.value = count;
    attached_sessions.metric.push_back(std::move(metric));
  }
  families.push_back(std::move(attached_sessions));

  counter("stridewire_ticks_total", "Ticks of all shards.", &ThreadMetrics::ticks);
  counter("stridewire_ticks_missed_total", "Ticks that were skipped because a shard was late.",
          &ThreadMetrics::ticks_missed);
  counter("stridewire_ticks_slipped_total",
          "Missed ticks that avatars did not catch up on, because too many were missed at once.",
          &ThreadMetrics::ticks_slipped);
  histogram("stridewire_tick_seconds", "Duration of a tick of a shard.", &ThreadMetrics::tick);
  histogram("stridewire_tick_late_seconds", "Delay between the due time and the start of a tick.",
            &ThreadMetrics::tick_late);

  MetricFamily shards{"stridewire_shard_cpu_seconds_total",
                      "CPU time of the thread of a shard, for ticks and sockets.",
                      MetricType::Counter,
                      {}};
  for (std::size_t i = 0; i + 1 < threads_.size(); ++i) {
    ClientMetric metric;
    metric.label.push_back({"shard", std::to_string(i)});
    metric.counter.value = 1e-9 * static_cast<double>(threads_[i]->cpu_ns.value());
    shards.metric.push_back(std::move(metric));
  }
  families.push_back(std::move(shards));

  counter("stridewire_poses_encoded_total", "Poses encoded.", &ThreadMetrics::poses_encoded);
  counter("stridewire_movements_encoded_total", "Movement records encoded.",
          &ThreadMetrics::movements_encoded);
  counter("stridewire_poses_sent_total", "Poses written to sockets.", &ThreadMetrics::poses_sent);
  counter("stridewire_pose_errors_total", "Poses that could not be encoded.",
          &ThreadMetrics::pose_errors);
  counter("stridewire_batches_composed_total",
          "Frames of pose batches composed for sessions that observe selected avatars or a region.",
          &ThreadMetrics::batches_composed);
  counter("stridewire_batches_sent_total", "Frames of pose batches written to sockets.",
          &ThreadMetrics::batches_sent);
  counter("stridewire_websocket_messages_sent_total",
          "WebSocket messages sent. One message may contain several batches.",
          &ThreadMetrics::websocket_messages_sent);
  counter("stridewire_batches_dropped_total",
          "Frames of poses and movements dropped because an observer was too slow.",
          &ThreadMetrics::batches_dropped);
  counter("stridewire_events_dropped_total",
          "Events dropped because a client was too slow or disconnected too long.",
          &ThreadMetrics::events_dropped);
  counter("stridewire_sent_bytes_total", "Bytes sent to clients.", &ThreadMetrics::bytes_sent);
  counter("stridewire_received_bytes_total", "Bytes received from clients.",
          &ThreadMetrics::bytes_received);
  counter("stridewire_messages_received_total", "Messages received from clients.",
          &ThreadMetrics::messages_received);
  counter("stridewire_requests_accepted_total",
          "Accepted items of Request, SetLayers and SetPlanting.",
          &ThreadMetrics::requests_accepted);
  counter("stridewire_requests_rejected_total",
          "Rejected items of Request, SetLayers and SetPlanting, and of any command beyond "
          "requests_per_s.",
          &ThreadMetrics::requests_rejected);
  counter("stridewire_protocol_errors_total",
          "Connections closed because of invalid or unexpected messages.",
          &ThreadMetrics::protocol_errors);
  counter("stridewire_connections_accepted_total", "Connections accepted.",
          &ThreadMetrics::connections_accepted);
  counter("stridewire_connections_closed_total", "Connections of sessions that were closed.",
          &ThreadMetrics::connections_closed);
  counter("stridewire_sessions_opened_total", "Sessions opened.", &ThreadMetrics::sessions_opened);
  counter("stridewire_sessions_resumed_total", "Sessions resumed over a new connection.",
          &ThreadMetrics::sessions_resumed);
  counter("stridewire_sessions_ended_total", "Sessions ended.", &ThreadMetrics::sessions_ended);
  counter("stridewire_http_requests_total", "HTTP requests answered.",
          &ThreadMetrics::http_requests);
  counter("stridewire_origins_refused_total",
          "WebSocket streams refused because of the origin of the page.",
          &ThreadMetrics::origins_refused);

  MetricFamily limits{
      "stridewire_limit_reached_total", "How often a limit was reached.", MetricType::Counter, {}};
  for (std::size_t i = 0; i < kLimitNames.size(); ++i) {
    ClientMetric metric;
    metric.label.push_back({"limit", std::string(kLimitNames[i])});
    metric.counter.value = static_cast<double>(Sum(static_cast<Limit>(i)));
    limits.metric.push_back(std::move(metric));
  }
  families.push_back(std::move(limits));

  MetricFamily build{"stridewire_build_info", "Version of this build.", MetricType::Gauge, {}};
  ClientMetric version;
  version.label.push_back({"version", kVersion});
  version.gauge.value = 1.0;
  build.metric.push_back(std::move(version));
  families.push_back(std::move(build));

  return prometheus::TextSerializer().Serialize(families);
}

}  // namespace stridewire::server
