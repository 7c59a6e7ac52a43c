#include "app/shard.h"

#include <pthread.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <ctime>
#include <utility>

#include "base/check.h"

namespace stridewire::server {
namespace {

namespace asio = boost::asio;
using protocol::PoseMode;
using Clock = TickClock::Clock;

constexpr std::chrono::milliseconds kHousekeepingInterval{100};

std::uint64_t ThreadCpuTimeNs() {
  timespec time{};
  if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time) != 0) return 0;
  return static_cast<std::uint64_t>(time.tv_sec) * 1'000'000'000u +
         static_cast<std::uint64_t>(time.tv_nsec);
}

}  // namespace

Shard::Shard(int index, const Config& config, AvatarBudget& budget, ThreadMetrics& metrics,
             ServerThread& server)
    : index_(index),
      config_(config),
      budget_(budget),
      metrics_(metrics),
      server_(server),
      clock_(Clock::time_point{}, config.tick_hz),
      work_(context_.get_executor()),
      tick_timer_(context_),
      housekeeping_timer_(context_),
      inbox_(static_cast<std::size_t>(config.limits.spawns_per_tick)),
      interests_(index, sessions_,
                 [this](const Interest& interest) {
                   for (int shard = 0; shard < shard_count(); ++shard) SendToShard(shard, interest);
                 }),
      encoder_({config.limits.max_control_bytes, config.limits.max_bulk_bytes}),
      composer_({config.limits.max_control_bytes, config.limits.max_bulk_bytes}) {}

Shard::~Shard() { Stop(); }

void Shard::Prepare(const TickClock& clock, std::vector<Shard*> shards) {
  STRIDEWIRE_CHECK(!thread_.joinable());
  clock_ = clock;
  shards_ = std::move(shards);
  STRIDEWIRE_CHECK(shards_.at(static_cast<std::size_t>(index_)) == this);
}

void Shard::Start() {
  STRIDEWIRE_CHECK(!thread_.joinable() && !shards_.empty());
  tick_ = clock_.TickAt(Clock::now());
  ScheduleTick();
  ScheduleHousekeeping();
  thread_ = std::jthread([this] {
    pthread_setname_np(pthread_self(), ("shard " + std::to_string(index_)).c_str());
    context_.run();
  });
}

void Shard::Stop() {
  context_.stop();
  if (thread_.joinable()) thread_.join();
}

void Shard::CloseConnections() {
  STRIDEWIRE_CHECK(!thread_.joinable());
  tick_timer_.cancel();
  housekeeping_timer_.cancel();
  // Pending reads must end here: the read of a closed WebSocket belongs to the io_context in which
  // it was created. A connection that a handler adopts meanwhile is closed in the next round.
  context_.restart();
  do {
    for (const auto& weak : connections_) {
      if (const auto connection = weak.lock()) {
        connection->set_handler(nullptr);
        connection->Close();
      }
    }
  } while (context_.poll() > 0);
}

// ---- ticks

void Shard::ScheduleTick() {
  tick_timer_.expires_at(clock_.Due(tick_ + 1));
  tick_timer_.async_wait([this](const boost::system::error_code& error) {
    if (error) return;
    Tick();
    ScheduleTick();
  });
}

void Shard::Tick() {
  const auto begin = Clock::now();
  const std::uint64_t tick = clock_.TickAt(begin);
  if (tick <= tick_) return;  // The timer has fired slightly early.
  metrics_.tick_late.Observe(std::chrono::duration<double>(begin - clock_.Due(tick)).count());

  // A late tick is published once. Avatars catch up on the missed time, up to a limit. Time beyond
  // the limit is lost, because catching up on it would delay the following ticks as well.
  const std::uint64_t missed = tick - tick_ - 1;
  const std::uint64_t caught_up =
      std::min(missed, static_cast<std::uint64_t>(config_.max_catch_up_ticks));
  metrics_.ticks_missed.Add(missed);
  metrics_.ticks_slipped.Add(missed - caught_up);
  tick_ = tick;

  interests_.SendChangedSelections();
  const std::size_t delayed_spawns = inbox_.Run(
      [this](const WorldCommand& command) {
        return WorldOf(command.world).Execute(command, tick_);
      },
      [this](int from_shard, CommandResult&& result) {
        outboxes_[from_shard].results.push_back(std::move(result));
      });
  if (delayed_spawns > 0) metrics_.Reached(Limit::kSpawnsPerTick, delayed_spawns);
  for (auto& [id, world] : worlds_) world->Advance(tick, static_cast<int>(caught_up) + 1);
  AnswerRequests();
  // The gauges are updated before replies are sent, so that a client sees its commands in the
  // metrics as soon as it has received the replies.
  UpdateGauges();
  Publish();

  metrics_.ticks.Add();
  metrics_.tick.Observe(std::chrono::duration<double>(Clock::now() - begin).count());
  metrics_.cpu_ns.Set(ThreadCpuTimeNs());
}

void Shard::AnswerRequests() {
  for (const InspectRequest& request : inspect_requests_) {
    protocol::AvatarState state =
        WorldOf(request.world).Inspect(request.avatar, tick_, config_.limits.max_control_bytes / 2);
    state.nonce = request.nonce;
    outboxes_[request.from_shard].inspections.push_back({request.session, std::move(state)});
  }
  inspect_requests_.clear();
  for (const StatesRequest& request : states_requests_) {
    outboxes_[request.from_shard].states.push_back(
        WorldOf(request.world).States(request, encoder_));
  }
  states_requests_.clear();
}

void Shard::Publish() {
  for (auto& [id, world] : worlds_) {
    if (const auto events = world->TakeEvents()) {
      for (int shard = 0; shard < shard_count(); ++shard) {
        if (!world->interest().WantsEvents(shard)) continue;
        outboxes_[shard].events.push_back({id, tick_, events});
      }
    }
    if (MovementDelivery movements; world->TakeMovements(tick_, movements)) {
      for (int shard = 0; shard < shard_count(); ++shard) {
        if (!world->interest().WantsMovements(shard)) continue;
        outboxes_[shard].movements.push_back(movements);
      }
    }
    PublishPoses(*world);
  }
  // The outbox of this shard is posted as well, so that the shard handles it after the tick. The
  // tick would otherwise take longer.
  for (auto& [shard, outbox] : std::exchange(outboxes_, {})) {
    shards_.at(static_cast<std::size_t>(shard))->Post(std::move(outbox));
  }
}

void Shard::PublishPoses(WorldShard& world) {
  for (const PoseMode mode : kSentModes) {
    WorldInterest::Demand total;
    for (int shard = 0; shard < shard_count(); ++shard) {
      const auto demand = world.interest().DemandOf(shard, mode, tick_);
      total.all |= demand.all;
      total.subset |= demand.subset;
    }
    if (!total.all && !total.subset) continue;
    PoseDelivery delivery;
    if (!world.Encode(mode, tick_, total.all, composer_, delivery)) continue;
    for (int shard = 0; shard < shard_count(); ++shard) {
      const auto demand = world.interest().DemandOf(shard, mode, tick_);
      if (demand.all || demand.subset) outboxes_[shard].poses.push_back(delivery);
    }
  }
}

void Shard::ScheduleHousekeeping() {
  housekeeping_timer_.expires_after(kHousekeepingInterval);
  housekeeping_timer_.async_wait([this](const boost::system::error_code& error) {
    if (error) return;
    const auto now = Clock::now();
    for (auto& [id, session] : sessions_) session->Housekeep(now);
    // WorldOf creates a world again when it is needed.
    std::erase_if(worlds_, [](const auto& item) {
      return item.second->avatar_count() == 0 && item.second->interest().empty();
    });
    std::erase_if(connections_, [](const auto& connection) { return connection.expired(); });
    ScheduleHousekeeping();
  });
}

void Shard::UpdateGauges() {
  std::size_t avatars = 0;
  for (const auto& [id, world] : worlds_) avatars += world->avatar_count();
  std::size_t attached = 0;
  std::size_t websockets = 0;
  std::size_t regions = 0;
  for (const auto& [id, session] : sessions_) {
    attached += session->is_attached() ? 1 : 0;
    regions += session->stream().subscriptions().region_count();
    websockets += session->is_attached(TransportKind::kWebSocket) ? 1 : 0;
  }
  STRIDEWIRE_CHECK(attached <= sessions_.size() && websockets <= attached);
  metrics_.avatars.Set(avatars);
  metrics_.regions.Set(regions);
  metrics_.sessions_attached.Set(attached);
  metrics_.sessions_websocket.Set(websockets);
  metrics_.sessions_detached.Set(sessions_.size() - attached);
}

// ---- messages

void Shard::Post(ShardMessage message) {
  asio::post(context_,
             [this, message = std::move(message)]() mutable { Handle(std::move(message)); });
}

void Shard::SendToShard(int shard, ShardMessage message) {
  if (shard == index_) {
    Handle(std::move(message));
  } else {
    shards_.at(static_cast<std::size_t>(shard))->Post(std::move(message));
  }
}

void Shard::Handle(ShardMessage&& message) {
  std::visit(
      [this]<typename T>(T& content) {
        if constexpr (std::is_same_v<T, WorldCommand>) {
          if (const auto* part = std::get_if<TerrainPart>(&content.part)) {
            for (const auto& [id, session] : sessions_) {
              session->OnTerrain(content.world->id, part->terrain->frame);
            }
          }
          inbox_.Push(std::move(content));
        } else if constexpr (std::is_same_v<T, InspectRequest>) {
          inspect_requests_.push_back(std::move(content));
        } else if constexpr (std::is_same_v<T, StatesRequest>) {
          states_requests_.push_back(std::move(content));
        } else if constexpr (std::is_same_v<T, Interest>) {
          WorldOf(content.world).SetInterest(content);
        } else if constexpr (std::is_same_v<T, ShardOutbox>) {
          Deliver(std::move(content));
        } else if constexpr (std::is_same_v<T, JoinResult>) {
          if (Session* session = FindSession(content.session)) {
            session->OnJoined(content.seq, std::move(content.world));
          } else if (content.world) {
            server_.Post(LeaveNotice{(*content.world)->id});
          }
        } else {
          static_assert(std::is_same_v<T, TerrainRefusal>);
          if (Session* session = FindSession(content.session)) {
            session->OnTerrainRefused(content.seq, std::move(content.refusal));
          }
        }
      },
      message);
}

void Shard::Deliver(ShardOutbox&& outbox) {
  for (CommandResult& result : outbox.results) {
    if (Session* session = FindSession(result.session)) session->OnResult(std::move(result));
  }
  for (const InspectResult& result : outbox.inspections) {
    if (Session* session = FindSession(result.session)) session->OnInspected(result.state);
  }
  for (const EventDelivery& delivery : outbox.events) {
    for (Session* session : interests_.WatchersOf(delivery.world)) session->OnEvents(delivery);
  }
  for (const MovementDelivery& delivery : outbox.movements) {
    SharedMovements movements(delivery, encoder_);
    for (Session* session : interests_.WatchersOf(delivery.world)) session->OnMovements(movements);
  }
  for (const StatesResult& result : outbox.states) {
    if (Session* session = FindSession(result.session)) session->OnStates(result);
  }
  for (const PoseDelivery& delivery : outbox.poses) {
    SharedPoses poses(delivery, composer_, metrics_);
    for (Session* session : interests_.WatchersOf(delivery.world)) session->OnPoses(poses);
  }
}

Session* Shard::FindSession(SessionId session) {
  const auto it = sessions_.find(session);
  return it == sessions_.end() ? nullptr : it->second.get();
}

WorldShard& Shard::WorldOf(const std::shared_ptr<World>& world) {
  std::unique_ptr<WorldShard>& entry = worlds_[world->id];
  if (entry == nullptr) {
    std::erase_if(scratch_, [](const auto& item) { return item.second.expired(); });
    std::weak_ptr<PoseScratch>& known = scratch_[world->library.get()];
    std::shared_ptr<PoseScratch> scratch = known.lock();
    if (scratch == nullptr) {
      scratch = std::make_shared<PoseScratch>(world->library);
      known = scratch;
    }
    entry =
        std::make_unique<WorldShard>(WorldShardDef{.world = world,
                                                   .shard = index_,
                                                   .shard_count = shard_count(),
                                                   .max_queue = config_.limits.max_queue,
                                                   .max_bulk_bytes = config_.limits.max_bulk_bytes,
                                                   .clock = clock_,
                                                   .budget = budget_,
                                                   .metrics = metrics_,
                                                   .scratch = std::move(scratch)});
  }
  STRIDEWIRE_CHECK(&entry->world() == world.get());
  return *entry;
}

void Shard::InterestChanged(const std::shared_ptr<World>& world) { interests_.Update(world); }

// ---- sessions

void Shard::Adopt(Arrival arrival) {
  asio::post(context_,
             [this, arrival = std::move(arrival)]() mutable { AdoptNow(std::move(arrival)); });
}

void Shard::AdoptNow(Arrival&& arrival) {
  STRIDEWIRE_CHECK(arrival.transport != nullptr && arrival.identity.id != 0);
  if (!arrival.transport->Attach(context_)) {
    spdlog::error("shard {} cannot take over a connection", index_);
    if (!arrival.is_resuming) server_.Post(SessionEnded{arrival.identity.id});
    return;
  }
  auto connection =
      std::make_shared<Connection>(std::move(arrival.transport), config_.limits, metrics_);
  connections_.push_back(connection);
  std::unique_ptr<Session>& session = sessions_[arrival.identity.id];
  const bool is_resumed = arrival.is_resuming && session != nullptr && !session->is_ended();
  if (session == nullptr || session->is_ended()) {
    // The session ended while its client was reconnecting. A new session with the same token is
    // created.
    if (arrival.is_resuming) server_.Post(SessionRestored{index_, arrival.identity});
    session = std::make_unique<Session>(std::move(arrival.identity), *this);
  }
  (is_resumed ? metrics_.sessions_resumed : metrics_.sessions_opened).Add();
  session->Attach(std::move(connection), arrival.hello, is_resumed, arrival.received);
  UpdateGauges();
}

void Shard::DestroySession(SessionId session) {
  // The session may be calling this function, so its destruction is posted.
  asio::post(context_, [this, session] {
    const auto it = sessions_.find(session);
    if (it == sessions_.end() || !it->second->is_ended()) return;
    sessions_.erase(it);
    metrics_.sessions_ended.Add();
    server_.Post(SessionEnded{session});
    UpdateGauges();
  });
}

void Shard::Drain() {
  asio::post(context_, [this] {
    is_draining_ = true;
    for (auto& [id, session] : sessions_) session->Drain();
  });
}

void Shard::WhenDrained(std::function<void()> done) {
  asio::post(context_, [this, done = std::move(done)]() mutable {
    const bool is_done = std::ranges::all_of(connections_, [](const auto& weak) {
      const auto connection = weak.lock();
      return connection == nullptr || connection->is_closed();
    });
    if (is_done) {
      done();
      return;
    }
    auto timer = std::make_shared<asio::steady_timer>(context_, std::chrono::milliseconds(5));
    timer->async_wait([this, timer, done = std::move(done)](const auto& error) mutable {
      if (!error) WhenDrained(std::move(done));
    });
  });
}

}  // namespace stridewire::server
