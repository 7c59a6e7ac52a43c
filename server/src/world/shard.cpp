#include "world/shard.h"

#include <pthread.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <ctime>
#include <iterator>
#include <numeric>
#include <utility>

#include "base/check.h"
#include "world/id_set.h"

namespace stridewire::server {
namespace {

namespace asio = boost::asio;
using protocol::PoseMode;
using Clock = TickClock::Clock;

constexpr std::chrono::milliseconds kHousekeepingInterval{100};

std::uint64_t ProcessorTimeOfThreadNs() {
  timespec time{};
  if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time) != 0) return 0;
  return static_cast<std::uint64_t>(time.tv_sec) * 1'000'000'000u +
         static_cast<std::uint64_t>(time.tv_nsec);
}

}  // namespace

Shard::Shard(int index, const Config& config, AvatarBudget& budget, ThreadMetrics& metrics,
             ShardPeers& peers)
    : index_(index),
      config_(config),
      budget_(budget),
      metrics_(metrics),
      peers_(peers),
      clock_(Clock::time_point{}, config.tick_hz),
      work_(context_.get_executor()),
      tick_timer_(context_),
      housekeeping_timer_(context_),
      encoder_({config.limits.max_control_bytes, config.limits.max_bulk_bytes}),
      composer_({config.limits.max_control_bytes, config.limits.max_bulk_bytes}) {}

Shard::~Shard() { Stop(); }

void Shard::Prepare(const TickClock& clock, std::vector<Shard*> shards) {
  clock_ = clock;
  shards_ = std::move(shards);
  outgoing_.resize(shards_.size());
}

void Shard::Start() {
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
  tick_timer_.cancel();
  housekeeping_timer_.cancel();
  for (const auto& weak : connections_) {
    if (const auto connection = weak.lock()) {
      connection->set_handler(nullptr);
      connection->Close();
    }
  }
  // A WebSocket that was reading while it closed has its read parked with the io_context it was made on.
  context_.restart();
  context_.poll();
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
  if (tick <= tick_) return;  // the timer was early by less than the clock can tell
  metrics_.tick_late.Observe(std::chrono::duration<double>(begin - clock_.Due(tick)).count());

  // A late tick is published once. Avatars make up for the time that passed, up to a bound, beyond
  // which a stalled server goes on where it was instead of stalling again.
  const std::uint64_t missed = tick - tick_ - 1;
  const std::uint64_t caught_up =
      std::min(missed, static_cast<std::uint64_t>(config_.max_catch_up_ticks));
  metrics_.ticks_missed.Add(missed);
  metrics_.ticks_slipped.Add(missed - caught_up);
  tick_ = tick;

  TellNamed();
  RunCommands();
  for (auto& [id, world] : worlds_) world->Advance(tick, static_cast<int>(caught_up) + 1);
  AnswerQuestions();
  // Before the replies go out: whoever has one finds the metrics to say the same.
  UpdateGauges();
  Publish();

  metrics_.ticks.Add();
  metrics_.tick.Observe(std::chrono::duration<double>(Clock::now() - begin).count());
  metrics_.cpu_ns.Set(ProcessorTimeOfThreadNs());
}

// What a tick takes, in order. Of who spawns more than that the rest waits for the next tick, and what it sent behind it.
void Shard::RunCommands() {
  std::map<SessionId, std::size_t> may_spawn;
  for (const WorldCommand& command : inbox_) {
    if (std::holds_alternative<SpawnPart>(command.part)) may_spawn[command.session] = 0;
  }
  const auto most = static_cast<std::size_t>(config_.limits.spawns_per_tick);
  const std::size_t share =
      std::max<std::size_t>(1, most / std::max<std::size_t>(1, may_spawn.size()));
  for (auto& [session, count] : may_spawn) count = share;

  std::vector<WorldCommand> waiting;
  std::set<SessionId> waits;
  for (WorldCommand& command : inbox_) {
    // A ground has a tick of its own.
    if (waits.contains(command.session) && !std::holds_alternative<TerrainPart>(command.part)) {
      waiting.push_back(std::move(command));
      continue;
    }
    std::vector<SpawnPart::Item> rest;
    auto* spawn = std::get_if<SpawnPart>(&command.part);
    if (spawn != nullptr) {
      std::size_t& left = may_spawn[command.session];
      if (spawn->items.size() > left) {
        const auto first = spawn->items.begin() + static_cast<std::ptrdiff_t>(left);
        rest.assign(first, spawn->items.end());
        spawn->items.erase(first, spawn->items.end());
      }
      left -= spawn->items.size();
    }
    CommandResult result = WorldOf(command.world).Execute(command, tick_);
    if (const auto begun = spawning_.find(command.session);
        spawn != nullptr && begun != spawning_.end()) {
      CommandResult all = std::move(begun->second);
      all.accepted += result.accepted;
      std::ranges::move(result.items, std::back_inserter(all.items));
      result = std::move(all);
      spawning_.erase(begun);
    } else if (!rest.empty()) {
      metrics_.Reached(Limit::kSpawnsPerTick, rest.size());
    }
    if (!rest.empty()) {
      spawn->items = std::move(rest);
      spawning_[command.session] = std::move(result);
      waits.insert(command.session);
      waiting.push_back(std::move(command));
    } else if (command.seq != 0) {
      outgoing_[static_cast<std::size_t>(command.from_shard)].results.push_back(std::move(result));
    }
  }
  inbox_ = std::move(waiting);
}

void Shard::AnswerQuestions() {
  for (const Inspection& question : questions_) {
    protocol::AvatarState state =
        WorldOf(question.world)
            .Inspect(question.avatar, tick_, config_.limits.max_control_bytes / 2);
    state.nonce = question.nonce;
    outgoing_[static_cast<std::size_t>(question.from_shard)].inspections.push_back(
        {question.session, std::move(state)});
  }
  questions_.clear();
  for (const StatesQuestion& question : states_questions_) {
    StatesAnswer answer = WorldOf(question.world).States(question, encoder_);
    answer.session = question.session;
    answer.nonce = question.nonce;
    outgoing_[static_cast<std::size_t>(question.from_shard)].states.push_back(std::move(answer));
  }
  states_questions_.clear();
}

void Shard::Publish() {
  for (auto& [id, world] : worlds_) {
    if (const auto events = world->TakeEvents()) {
      for (std::size_t shard = 0; shard < outgoing_.size(); ++shard) {
        if (!world->WantsEvents(static_cast<int>(shard))) continue;
        outgoing_[shard].events.push_back({id, tick_, events});
      }
    }
    if (MovementDelivery movements; world->TakeMovements(tick_, movements)) {
      for (std::size_t shard = 0; shard < outgoing_.size(); ++shard) {
        if (!world->WantsMovements(static_cast<int>(shard))) continue;
        outgoing_[shard].movements.push_back(movements);
      }
    }
    for (const PoseMode mode : kSentModes) {
      WorldShard::Wish any;
      for (int shard = 0; shard < shard_count(); ++shard) {
        const WorldShard::Wish wish = world->WishOf(shard, mode, tick_);
        any.whole |= wish.whole;
        any.some |= wish.some;
      }
      if (!any.whole && !any.some) continue;
      PoseDelivery delivery;
      if (!world->Encode(mode, tick_, any.whole, composer_, delivery)) continue;
      for (int shard = 0; shard < shard_count(); ++shard) {
        const WorldShard::Wish wish = world->WishOf(shard, mode, tick_);
        if (!wish.whole && !wish.some) continue;
        outgoing_[static_cast<std::size_t>(shard)].poses.push_back(delivery);
      }
    }
  }
  for (std::size_t shard = 0; shard < outgoing_.size(); ++shard) {
    if (outgoing_[shard].empty()) continue;
    Shard* receiver = shards_[shard];
    asio::post(receiver->context_,
               [receiver, mail = std::exchange(outgoing_[shard], {})]() mutable {
                 receiver->Receive(std::move(mail));
               });
  }
}

void Shard::Receive(ShardOutbox&& mail) {
  for (CommandResult& result : mail.results) {
    const auto it = sessions_.find(result.session);
    if (it != sessions_.end()) it->second->OnResult(std::move(result));
  }
  for (const InspectionResult& result : mail.inspections) {
    const auto it = sessions_.find(result.session);
    if (it != sessions_.end()) it->second->OnInspected(result.state);
  }
  for (const EventDelivery& delivery : mail.events) {
    SharedEvents events(delivery, encoder_);
    for (Session* session : WatchersOf(delivery.world)) session->OnEvents(events);
  }
  for (const MovementDelivery& delivery : mail.movements) {
    SharedMovements movements(delivery, encoder_);
    for (Session* session : WatchersOf(delivery.world)) session->OnMovements(movements);
  }
  for (const StatesAnswer& answer : mail.states) {
    const auto it = sessions_.find(answer.session);
    if (it != sessions_.end()) it->second->OnStates(answer);
  }
  for (const PoseDelivery& delivery : mail.poses) {
    SharedPoses poses(delivery, composer_, metrics_);
    for (Session* session : WatchersOf(delivery.world)) session->OnPoses(poses);
  }
}

std::span<Session* const> Shard::WatchersOf(WorldId world) const {
  const auto it = watchers_.find(world);
  return it == watchers_.end() ? std::span<Session* const>() : it->second;
}

WorldShard& Shard::WorldOf(const std::shared_ptr<World>& world) {
  std::unique_ptr<WorldShard>& entry = worlds_[world->id];
  if (entry == nullptr) {
    std::erase_if(scratch_, [](const auto& item) { return item.second.expired(); });
    std::weak_ptr<PoseScratch>& kept = scratch_[world->library.get()];
    std::shared_ptr<PoseScratch> scratch = kept.lock();
    if (scratch == nullptr) {
      scratch = std::make_shared<PoseScratch>(world->library);
      kept = scratch;
    }
    entry = std::make_unique<WorldShard>(world, index_, shard_count(), config_.limits.max_queue,
                                         clock_, budget_, metrics_, config_.limits.max_bulk_bytes,
                                         std::move(scratch));
  }
  return *entry;
}

// ---- between shards

void Shard::Submit(int shard, WorldCommand&& command) {
  if (shard == index_) {
    inbox_.push_back(std::move(command));
    return;
  }
  Shard* receiver = shards_[static_cast<std::size_t>(shard)];
  asio::post(receiver->context_, [receiver, command = std::move(command)]() mutable {
    receiver->inbox_.push_back(std::move(command));
  });
}

void Shard::Ask(int shard, Inspection&& question) {
  Shard* receiver = shards_[static_cast<std::size_t>(shard)];
  asio::post(receiver->context_, [receiver, question = std::move(question)]() mutable {
    receiver->questions_.push_back(std::move(question));
  });
}

void Shard::Ask(int shard, StatesQuestion&& question) {
  if (shard == index_) {
    states_questions_.push_back(std::move(question));
    return;
  }
  Shard* receiver = shards_[static_cast<std::size_t>(shard)];
  asio::post(receiver->context_, [receiver, question = std::move(question)]() mutable {
    receiver->states_questions_.push_back(std::move(question));
  });
}

void Shard::InterestChanged(const std::shared_ptr<World>& world) {
  Interest interest{.world = world, .shard = index_, .poses = {}};
  std::vector<Session*>& watchers = watchers_[world->id];
  watchers.clear();
  for (const auto& [id, session] : sessions_) {
    bool watches = session->WantsEvents(world->id);
    interest.events |= watches;
    for (const PoseMode mode : kSentModes) {
      const PoseInterest::Every every = session->EveryOf(world->id, mode);
      PoseInterest::Every& all = interest.poses[ModeIndex(mode)].every;
      watches |= every != PoseInterest::Every{};
      all.whole = std::gcd(all.whole, every.whole);
      all.some = std::gcd(all.some, every.some);
    }
    const bool movements = session->WantsMovements(world->id);
    interest.movements |= movements;
    interest.movement_places |= session->WantsMovementPlaces(world->id);
    watches |= movements;
    if (watches) watchers.push_back(session.get());
  }
  const bool is_none = watchers.empty();
  if (is_none) watchers_.erase(world->id);
  const auto told = told_interest_.find(world->id);
  const bool is_told = told != told_interest_.end();
  // Which avatars are named is told once a tick, however many sessions begin in it: until then the last list
  // holds, which has all that anyone has seen so far.
  if (is_told || !is_none) named_anew_.insert(world->id);
  bool is_same = is_told ? told->second.events == interest.events &&
                               told->second.movements == interest.movements &&
                               told->second.movement_places == interest.movement_places
                         : is_none;
  for (std::size_t mode = 0; is_told && mode < kSentModes.size(); ++mode) {
    interest.poses[mode].named = told->second.poses[mode].named;
    interest.poses[mode].regions = told->second.poses[mode].regions;
    is_same &= told->second.poses[mode].every == interest.poses[mode].every;
  }
  if (is_same) return;
  if (is_none) {
    interest.poses = {};
    told_interest_.erase(told);
  } else {
    told_interest_[world->id] = interest;
  }
  Tell(interest);
}

void Shard::TellNamed() {
  for (const WorldId world : std::exchange(named_anew_, {})) {
    const auto told = told_interest_.find(world);
    if (told == told_interest_.end()) continue;
    bool is_same = true;
    for (const PoseMode mode : kSentModes) {
      IdSet numbers;
      std::vector<RegionFilter> regions;
      for (const Session* session : WatchersOf(world)) {
        numbers.Add(session->Named(world, mode));
        if (const auto reach = session->ReachOf(world, mode)) regions.push_back(*reach);
      }
      const auto update = [&]<typename List>(std::shared_ptr<const List>& known, List&& list) {
        if (known == nullptr ? list.empty() : *known == list) return;
        is_same = false;
        known = std::make_shared<const List>(std::forward<List>(list));
      };
      PoseInterest& poses = told->second.poses[ModeIndex(mode)];
      update(poses.named, numbers.Take());
      update(poses.regions, std::move(regions));
    }
    if (!is_same) Tell(told->second);
  }
}

void Shard::Tell(const Interest& interest) {
  for (Shard* shard : shards_) {
    if (shard == this) {
      OnInterest(interest);
    } else {
      asio::post(shard->context_, [shard, interest] { shard->OnInterest(interest); });
    }
  }
}

void Shard::OnInterest(const Interest& interest) { WorldOf(interest.world).SetInterest(interest); }

// ---- sessions

void Shard::JoinWorld(SessionId session, protocol::Seq seq, std::string name) {
  peers_.JoinWorld(index_, session, seq, std::move(name));
}

void Shard::LeaveWorld(WorldId world) { peers_.LeaveWorld(world); }

void Shard::SetTerrain(TerrainChange&& change) { peers_.SetTerrain(std::move(change)); }

void Shard::ChangeTerrain(WorldCommand command) {
  asio::post(context_, [this, command = std::move(command)]() mutable {
    const SharedFrame frame = std::get<TerrainPart>(command.part).ground->frame;
    for (const auto& [id, session] : sessions_) session->OnGround(command.world->id, frame);
    inbox_.push_back(std::move(command));
  });
}

void Shard::RefuseTerrain(SessionId session, protocol::Seq seq, Refusal refusal) {
  asio::post(context_, [this, session, seq, refusal = std::move(refusal)]() mutable {
    const auto it = sessions_.find(session);
    if (it != sessions_.end()) it->second->OnTerrainRefused(seq, std::move(refusal));
  });
}

void Shard::Deliver(SessionId session, protocol::Seq seq, Outcome<std::shared_ptr<World>> joined) {
  asio::post(context_, [this, session, seq, joined = std::move(joined)]() mutable {
    const auto it = sessions_.find(session);
    if (it != sessions_.end()) {
      it->second->OnJoined(seq, std::move(joined));
    } else if (joined) {
      peers_.LeaveWorld((*joined)->id);
    }
  });
}

void Shard::Adopt(Arrival arrival) {
  asio::post(context_,
             [this, arrival = std::move(arrival)]() mutable { DoAdopt(std::move(arrival)); });
}

void Shard::DoAdopt(Arrival&& arrival) {
  if (!arrival.transport->Attach(context_)) {
    spdlog::error("a connection could not be taken over");
    if (!arrival.is_resuming) peers_.SessionEnded(arrival.identity.id);
    return;
  }
  auto connection =
      std::make_shared<Connection>(std::move(arrival.transport), config_.limits, metrics_);
  connections_.push_back(connection);
  std::unique_ptr<Session>& session = sessions_[arrival.identity.id];
  const bool is_resumed = arrival.is_resuming && session != nullptr && !session->is_ended();
  if (session == nullptr || session->is_ended()) {
    // It ended while its client was on the way: a new one under the same token.
    if (arrival.is_resuming) peers_.SessionBegan(index_, arrival.identity);
    session = std::make_unique<Session>(std::move(arrival.identity), *this);
  }
  (is_resumed ? metrics_.sessions_resumed : metrics_.sessions_opened).Add();
  session->Attach(std::move(connection), arrival.hello, is_resumed, arrival.received);
  UpdateGauges();
}

void Shard::SessionEnded(SessionId session) {
  // Not at once: it is in the middle of something.
  asio::post(context_, [this, session] {
    const auto it = sessions_.find(session);
    if (it == sessions_.end() || !it->second->is_ended()) return;
    sessions_.erase(it);
    metrics_.sessions_ended.Add();
    peers_.SessionEnded(session);
    UpdateGauges();
  });
}

void Shard::ScheduleHousekeeping() {
  housekeeping_timer_.expires_after(kHousekeepingInterval);
  housekeeping_timer_.async_wait([this](const boost::system::error_code& error) {
    if (error) return;
    const auto now = Clock::now();
    for (auto& [id, session] : sessions_) session->Housekeep(now);
    // What nobody is interested in and nothing lives in is made again when it is needed.
    std::erase_if(worlds_, [](const auto& item) {
      return item.second->avatar_count() == 0 && !item.second->HasInterest();
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
    regions += session->region_count();
    websockets += session->is_attached(TransportKind::kWebSocket) ? 1 : 0;
  }
  metrics_.avatars.Set(avatars);
  metrics_.regions.Set(regions);
  metrics_.sessions_attached.Set(attached);
  metrics_.sessions_websocket.Set(websockets);
  metrics_.sessions_detached.Set(sessions_.size() - attached);
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
