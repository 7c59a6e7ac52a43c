#include "controller.h"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

namespace stridewire::load {
namespace {

constexpr double kSpacingM = 3.0;  // Distance between spawned avatars.
constexpr double kFirstPlanWithinS = 2.0;
constexpr double kPauseBetweenChoreographiesS = 0.5;
constexpr std::int64_t kRetryNs = 5'000'000;

protocol::FootChoice ToFoot(const std::optional<Foot>& foot) {
  if (!foot) return protocol::FootChoice::kAuto;
  return *foot == Foot::kLeft ? protocol::FootChoice::kLeft : protocol::FootChoice::kRight;
}

Movement ToMovement(const MovementRequest& request) {
  return std::visit(
      [](const auto& movement) -> Movement {
        using T = std::decay_t<decltype(movement)>;
        if constexpr (std::is_same_v<T, StepRequest>) {
          return protocol::StepMovement{.foot = ToFoot(movement.foot),
                                        .length_m = movement.length_m,
                                        .side_m = movement.side_m,
                                        .height_m = movement.height_m,
                                        .turn_rad = movement.turn_rad,
                                        .exact_only = movement.exact_only,
                                        .allow_nearest = movement.allow_nearest};
        } else if constexpr (std::is_same_v<T, JumpRequest>) {
          return protocol::JumpMovement{.length_m = movement.length_m,
                                        .height_m = movement.height_m,
                                        .turn_rad = movement.turn_rad,
                                        .allow_nearest = movement.allow_nearest};
        } else if constexpr (std::is_same_v<T, StandRequest>) {
          return protocol::StandMovement{.seconds = movement.seconds};
        } else {
          return protocol::WalkMovement{movement.position_m, movement.heading_rad,
                                        movement.waypoints_m, movement.speed_m_s};
        }
      },
      request.movement);
}

}  // namespace

Controller::Controller(ThreadContext& context, const boost::asio::ip::tcp::endpoint& server,
                       RunState& run, int world, LatencyProbes* probes)
    : Session(context, server, "load controller of " + WorldName(world)),
      run_(run),
      world_(world),
      probes_(probes),
      timer_(context.io) {
  const std::size_t count = run.layout.CountIn(world);
  walkers_.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    walkers_.push_back({.wanderer = Wanderer(run.options.seed, run.layout.Number(world, i))});
  }
}

void Controller::OnWelcome() {
  const protocol::Seq seq = NextSeq();
  pending_[seq] = {.command = Command::kJoin, .avatars = {}};
  Send(protocol::JoinWorld{
      .seq = seq, .name = WorldName(world_), .role = protocol::Role::kController});
}

void Controller::OnMessage(protocol::Message& message, std::size_t /*frame_bytes*/,
                           std::int64_t /*now_ns*/) {
  if (const auto* events = std::get_if<protocol::Events>(&message)) {
    for (const protocol::Event& event : events->events) OnEvent(event);
  } else if (const auto* reply = std::get_if<protocol::Reply>(&message)) {
    OnReply(*reply);
  } else if (const auto* info = std::get_if<protocol::WorldInfo>(&message)) {
    world_id_ = info->world;
  }
}

void Controller::OnLost(const std::string& why, bool by_us) {
  has_spawned_ = false;
  pending_.clear();
  spawned_count_ = 0;
  if (!by_us && !run_.is_ending) run_.Problem(name() + ": " + why);
}

void Controller::OnReply(const protocol::Reply& reply) {
  const auto found = pending_.find(reply.seq);
  if (found == pending_.end()) return Lose("the server sent an unexpected Reply");
  const Pending pending = std::move(found->second);
  pending_.erase(found);
  const bool is_ok = reply.code == protocol::StatusCode::kOk;
  switch (pending.command) {
    case Command::kRequest: return OnRequestReply(reply, pending);
    case Command::kSpawn:
    case Command::kSpawnAgain: return OnSpawnReply(reply, pending);
    case Command::kRemove: return;
    case Command::kRemoveLast: has_cleaned_up_ = true; return Finish();
    case Command::kJoin:
      if (!is_ok) {
        run_.Problem(name() + ": the server refused the join: " +
                     std::string(protocol::StatusCodeName(reply.code)) + " " + reply.text);
        return;
      }
      std::vector<protocol::AvatarId> all(walkers_.size());
      for (std::size_t i = 0; i < all.size(); ++i) all[i] = run_.layout.Number(world_, i);
      return Spawn(all, Command::kSpawn);
  }
}

protocol::Placement Controller::Place(protocol::AvatarId number) const {
  // Places the avatars in a square around the origin, or around the start of the choreography.
  const std::size_t index = run_.layout.IndexIn(number);
  const auto side = static_cast<std::size_t>(
      std::max(1.0, std::ceil(std::sqrt(static_cast<double>(walkers_.size())))));
  const double half = 0.5 * static_cast<double>(side - 1);
  protocol::Placement place;
  const std::size_t row = index / side;
  place.position_m = DVec3(kSpacingM * (static_cast<double>(index % side) - half), 0.0,
                           kSpacingM * (static_cast<double>(row) - half));
  if (run_.choreography != nullptr) {
    place.position_m += run_.choreography->start.position_m;
    place.heading_rad = run_.choreography->start.heading_rad;
  }
  return place;
}

void Controller::Spawn(const std::vector<protocol::AvatarId>& avatars, Command command) {
  for (std::size_t from = 0; from < avatars.size(); from += kMaxItemsPerMessage) {
    const std::size_t to = std::min(avatars.size(), from + kMaxItemsPerMessage);
    protocol::Spawn spawn{.seq = NextSeq(), .world = world_id_, .items = {}};
    Pending& pending = pending_[spawn.seq];
    pending.command = command;
    for (std::size_t i = from; i < to; ++i) {
      spawn.items.push_back({.avatar = avatars[i], .start = Place(avatars[i])});
      pending.avatars.push_back(avatars[i]);
    }
    Send(spawn);
  }
}

void Controller::Remove(const std::vector<protocol::AvatarId>& avatars, Command last) {
  for (std::size_t from = 0; from < avatars.size(); from += kMaxItemsPerMessage) {
    const std::size_t to = std::min(avatars.size(), from + kMaxItemsPerMessage);
    protocol::Remove remove{.seq = NextSeq(), .world = world_id_, .avatars = {}};
    pending_[remove.seq].command = to == avatars.size() ? last : Command::kRemove;
    for (std::size_t i = from; i < to; ++i) remove.avatars.push_back(avatars[i]);
    Send(remove);
  }
}

void Controller::OnSpawnReply(const protocol::Reply& reply, const Pending& pending) {
  // Avatars of an aborted run or of a lost connection may still exist.
  std::vector<protocol::AvatarId> existing;
  std::size_t refused = 0;
  std::string why;
  if (reply.code != protocol::StatusCode::kOk) {
    refused = pending.avatars.size();
    why = std::string(protocol::StatusCodeName(reply.code)) + " " + reply.text;
  }
  for (const protocol::ReplyItem& item : reply.items) {
    if (item.code == protocol::StatusCode::kOk) continue;
    if (item.index >= pending.avatars.size())
      return Lose("a Reply has an item that was not in the command");
    if (item.code == protocol::StatusCode::kAvatarExists && pending.command == Command::kSpawn) {
      existing.push_back(pending.avatars[item.index]);
    } else {
      ++refused;
      why = "avatar " + std::to_string(pending.avatars[item.index]) + ": " +
            std::string(protocol::StatusCodeName(item.code)) + " " + item.text;
    }
  }
  if (refused > 0) {
    run_.Problem(name() + ": the server refused " + std::to_string(refused) + " avatars, e.g. " +
                 why);
  }
  spawned_count_ += pending.avatars.size() - existing.size();
  if (!existing.empty()) {
    Remove(existing, Command::kRemove);
    Spawn(existing, Command::kSpawnAgain);
  }
  if (spawned_count_ == walkers_.size()) {
    has_spawned_ = true;
    StartMoving();
  }
}

void Controller::StartMoving() {
  due_ = {};
  const std::int64_t now_ns = NowNs();
  for (std::size_t i = 0; i < walkers_.size(); ++i) {
    walkers_[i].next = 0;
    walkers_[i].waiting = 0;
    Schedule(i, now_ns + static_cast<std::int64_t>(
                             1e9 * walkers_[i].wanderer.FirstStart(kFirstPlanWithinS)));
  }
  ArmTimer();
}

void Controller::Schedule(std::size_t walker, std::int64_t at_ns) {
  due_.push({.at_ns = at_ns, .walker = walker});
}

void Controller::ArmTimer() {
  if (due_.empty() || !moves_) return;
  const bool is_held_up = !has_spawned_ || pending_.size() >= kMaxUnanswered;
  const std::int64_t at_ns =
      is_held_up ? std::max(due_.top().at_ns, NowNs() + kRetryNs) : due_.top().at_ns;
  timer_.expires_at(std::chrono::steady_clock::time_point(std::chrono::nanoseconds(at_ns)));
  timer_.async_wait([this](const boost::system::error_code& code) {
    if (!code) SendDue();
  });
}

void Controller::SendDue() {
  if (!moves_ || finished()) return;
  if (has_spawned_ && pending_.size() < kMaxUnanswered) {
    const std::int64_t now_ns = NowNs();
    protocol::Request request{.seq = 0, .world = world_id_, .items = {}};
    while (!due_.empty() && due_.top().at_ns <= now_ns) {
      const Due due = due_.top();
      due_.pop();
      counts_.send_late.RecordNs(now_ns - due.at_ns);
      if (run_.choreography == nullptr) {
        AddWanderPlan(due, now_ns, request);
      } else {
        AddChoreography(due.walker, due.at_ns, now_ns, request);
      }
      if (request.items.size() >= kMaxItemsPerMessage) SendRequest(request);
    }
    SendRequest(request);
  }
  ArmTimer();
}

void Controller::AddWanderPlan(const Due& due, std::int64_t now_ns, protocol::Request& request) {
  WanderPlan plan = walkers_[due.walker].wanderer.Next(can_jump_);
  const std::uint32_t limit = welcome().limits.max_queue;
  if (limit > 0 && plan.movements.size() > limit) plan.movements.resize(limit);
  const protocol::AvatarId number = run_.layout.Number(world_, due.walker);
  if (probes_ != nullptr) {
    probes_->Schedule(number - 1, last_request_ + 1, due.at_ns, now_ns);
  }
  for (const Movement& movement : plan.movements) {
    request.items.push_back(
        {.avatar = number, .request_id = ++last_request_, .movement = movement});
  }
  Schedule(due.walker, due.at_ns + static_cast<std::int64_t>(1e9 * plan.period_s));
}

std::size_t Controller::MaxQueuedMovements() const {
  const std::uint32_t limit = welcome().limits.max_queue;
  return limit > 0 ? std::min<std::size_t>(limit, kMaxQueuedMovements) : kMaxQueuedMovements;
}

void Controller::AddChoreography(std::size_t walker, std::int64_t due_ns, std::int64_t now_ns,
                                 protocol::Request& request) {
  const std::vector<MovementRequest>& movements = run_.choreography->movements;
  const protocol::AvatarId number = run_.layout.Number(world_, walker);
  Walker& state = walkers_[walker];
  if (state.next == 0 && probes_ != nullptr &&
      !std::holds_alternative<StandRequest>(movements.front().movement)) {
    probes_->Schedule(number - 1, last_request_ + 1, due_ns, now_ns);
  }
  while (state.next < movements.size() && state.waiting < MaxQueuedMovements()) {
    request.items.push_back({.avatar = number,
                             .request_id = ++last_request_,
                             .movement = ToMovement(movements[state.next])});
    ++state.next;
    ++state.waiting;
  }
}

void Controller::SendRequest(protocol::Request& request) {
  if (request.items.empty()) return;
  request.seq = NextSeq();
  pending_[request.seq] = {
      .command = Command::kRequest, .avatars = {}, .items = request.items.size()};
  counts_.requests_sent += request.items.size();
  Send(request);
  request.items.clear();
}

void Controller::OnRequestReply(const protocol::Reply& reply, const Pending& pending) {
  if (reply.code != protocol::StatusCode::kOk) {
    counts_.requests_rejected += pending.items;
    counts_.rejected_by_code[reply.code] += pending.items;
    return;
  }
  counts_.requests_accepted += reply.accepted;
  for (const protocol::ReplyItem& item : reply.items) {
    if (item.code == protocol::StatusCode::kOk) continue;
    ++counts_.requests_rejected;
    ++counts_.rejected_by_code[item.code];
    // These codes mean that the library has no jumps, so the controller stops requesting them.
    if (item.code == protocol::StatusCode::kNoMovement ||
        item.code == protocol::StatusCode::kUnsupported) {
      can_jump_ = false;
    }
    if (!run_.layout.IsOurs(world_, item.avatar)) continue;
    if (probes_ != nullptr) probes_->Rejected(item.avatar - 1, item.request_id);
    Walker& walker = walkers_[run_.layout.IndexIn(item.avatar)];
    if (walker.waiting > 0) --walker.waiting;
  }
}

void Controller::OnEvent(const protocol::Event& event) {
  if (!run_.layout.IsOurs(world_, event.avatar)) return;
  const std::size_t index = run_.layout.IndexIn(event.avatar);
  Walker& walker = walkers_[index];
  switch (event.type) {
    case protocol::EventType::kStarted:
      if (event.request_id == 0) return;
      if (probes_ != nullptr) {
        probes_->Started(event.avatar - 1, event.request_id, event.tick);
      }
      break;
    case protocol::EventType::kRejected:
      if (event.request_id == 0) return;
      if (event.code == protocol::StatusCode::kDropped) {
        // This program has dropped the request itself, for example by removing its avatar.
        if (probes_ != nullptr) probes_->Rejected(event.avatar - 1, event.request_id);
        return;
      }
      ++counts_.requests_rejected;
      ++counts_.rejected_by_code[event.code];
      if (counts_.requests_accepted > 0) --counts_.requests_accepted;
      if (probes_ != nullptr) probes_->Rejected(event.avatar - 1, event.request_id);
      break;
    case protocol::EventType::kIdle:
      if (run_.choreography != nullptr && walker.waiting == 0 &&
          walker.next == run_.choreography->movements.size()) {
        walker.next = 0;
        Schedule(index, NowNs() + static_cast<std::int64_t>(1e9 * kPauseBetweenChoreographiesS));
        ArmTimer();
      }
      return;
    default: return;
  }
  if (run_.choreography == nullptr || walker.waiting == 0) return;
  --walker.waiting;
  if (walker.waiting == MaxQueuedMovements() / 2 &&
      walker.next < run_.choreography->movements.size()) {
    Schedule(index, NowNs());
    ArmTimer();
  }
}

void Controller::CleanUp() {
  moves_ = false;
  timer_.cancel();
  if (!has_spawned_) {
    has_cleaned_up_ = true;
    return Finish();
  }
  std::vector<protocol::AvatarId> all(walkers_.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = run_.layout.Number(world_, i);
  Remove(all, Command::kRemoveLast);
}

}  // namespace stridewire::load
