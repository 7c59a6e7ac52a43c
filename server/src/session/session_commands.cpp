#include "session/session_commands.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <iterator>

#include "base/check.h"
#include "world/convert.h"

namespace stridewire::server {

using protocol::PoseMode;
using protocol::Reply;
using protocol::ReplyItem;
using protocol::Seq;
using protocol::StatusCode;

namespace {

constexpr const char* kNotJoinedText = "this session has not joined that world";

// Distributes the items of a command to the shards that own their avatars. Each item keeps its
// index in the command.
template <typename Item, typename Part>
void Distribute(std::vector<Item>&& items, std::vector<Part>& parts) {
  // Consecutive ids are distributed evenly over the shards, so parts have about the same size.
  for (Part& part : parts) part.items.reserve(items.size() / parts.size() + 1);
  const int shard_count = static_cast<int>(parts.size());
  std::uint32_t index = 0;
  for (Item& item : items) {
    const auto shard = static_cast<std::size_t>(ShardOf(item.avatar, shard_count));
    parts[shard].items.push_back({index++, std::move(item)});
  }
}

// Returns a note on the first walk whose speed the library cannot reach; empty if there is none.
std::string SpeedNote(const WalkSpeeds& speeds, const std::vector<protocol::RequestItem>& items) {
  for (std::size_t i = 0; i < items.size(); ++i) {
    const auto* walk = std::get_if<protocol::WalkMovement>(&items[i].movement);
    if (walk == nullptr || !walk->speed_m_s || !speeds.IsOutside(*walk->speed_m_s)) continue;
    return fmt::format(
        "items[{}].speed_m_s: the library walks at {:.2f} to {:.2f} m/s, not at {:g} m/s", i,
        speeds.slowest_m_s, speeds.fastest_m_s, *walk->speed_m_s);
  }
  return {};
}

// Upper bound for the size of a refused item in a Reply.
constexpr std::size_t kReplyItemBytes = 256;
// This many heights or boxes of a terrain count as one item. The largest terrain then uses about
// half of the default request_burst.
constexpr std::size_t kNumbersPerItem = 32;

}  // namespace

SessionCommands::SessionCommands(SessionContext& context, SessionStream& stream)
    : context_(context),
      stream_(stream),
      replies_(protocol::kReplyCache, context.host.config().limits.reply_cache_bytes),
      request_tokens_(context.host.config().limits.requests_per_s,
                      context.host.config().limits.request_burst) {}

std::size_t SessionCommands::MaxItems(const Limits& limits) {
  return std::min(protocol::kMaxItems, limits.max_bulk_bytes / kReplyItemBytes);
}

bool SessionCommands::Begin(Seq seq) {
  switch (replies_.Classify(seq)) {
    case ReplyCache::Verdict::kNew: replies_.Begin(seq); return true;
    case ReplyCache::Verdict::kPending:
    case ReplyCache::Verdict::kGap: return false;
    case ReplyCache::Verdict::kAnswered: {
      const ReplyCache::Answer& answer = replies_.Find(seq);
      if (const Membership* membership = context_.FindWorld(answer.joined)) {
        SendWorldInfo(seq, *membership);
        stream_.SendTerrain(*membership->world, false);
      }
      if (context_.connection != nullptr) context_.connection->SendControl(answer.reply);
      return false;
    }
    case ReplyCache::Verdict::kForgotten:
      context_.Send(Reply{.seq = seq,
                          .code = StatusCode::kForgotten,
                          .text = "the command was executed, but its reply is no longer stored"});
      return false;
  }
  return false;
}

bool SessionCommands::AcceptItems(Seq seq, std::size_t item_count) {
  ThreadMetrics& metrics = context_.host.metrics();
  if (item_count > MaxItems(context_.host.config().limits)) {
    metrics.Reached(Limit::kFrameBytes);
    Answer(seq, StatusCode::kLimitReached, "too many items in one command");
    return false;
  }
  request_tokens_.AdvanceTime(context_.host.clock().ServerTime(Connection::Clock::now()));
  if (request_tokens_.Take(static_cast<double>(item_count))) return true;
  metrics.Reached(Limit::kRequestsPerSecond);
  metrics.requests_rejected.Add(item_count);
  Answer(seq, StatusCode::kLimitReached, "too many items per second (requests_per_s)");
  return false;
}

Membership* SessionCommands::FindControlled(Seq seq, WorldId world) {
  Membership* membership = context_.FindWorld(world);
  if (membership == nullptr) {
    Answer(seq, StatusCode::kNotJoined, kNotJoinedText);
    return nullptr;
  }
  if (membership->role != protocol::Role::kController) {
    Answer(seq, StatusCode::kNotAllowed, "an observer may not command avatars");
    return nullptr;
  }
  return membership;
}

// ---- pending commands

SessionCommands::Pending& SessionCommands::AddPending(Seq seq, Pending&& pending) {
  pending_items_ += pending.item_count;
  const auto [it, is_new] = pending_.emplace(seq, std::move(pending));
  STRIDEWIRE_CHECK(is_new && it->second.outstanding > 0);
  return it->second;
}

SessionCommands::Pending SessionCommands::TakePending(Seq seq) {
  const auto it = pending_.find(seq);
  STRIDEWIRE_CHECK(it != pending_.end() && it->second.item_count <= pending_items_);
  pending_items_ -= it->second.item_count;
  Pending pending = std::move(it->second);
  pending_.erase(it);
  STRIDEWIRE_CHECK(!pending_.empty() || pending_items_ == 0);
  return pending;
}

template <typename Part>
void SessionCommands::SubmitParts(Seq seq, const std::shared_ptr<World>& world,
                                  std::vector<Part>&& parts, Pending&& pending) {
  const auto is_empty = [](const Part& part) {
    if constexpr (requires { part.items; }) {
      return part.items.empty();
    } else {
      return part.avatars.empty();
    }
  };
  for (const Part& part : parts) {
    if (!is_empty(part)) ++pending.outstanding;
  }
  pending.reply.seq = seq;
  if (pending.outstanding == 0) {
    Answer(std::move(pending.reply));
    return;
  }
  AddPending(seq, std::move(pending));
  for (std::size_t shard = 0; shard < parts.size(); ++shard) {
    if (is_empty(parts[shard])) continue;
    context_.host.SendToShard(static_cast<int>(shard),
                              WorldCommand{.world = world,
                                           .from_shard = context_.host.shard_index(),
                                           .session = context_.identity.id,
                                           .seq = seq,
                                           .part = std::move(parts[shard])});
  }
}

template <typename Part>
void SessionCommands::SubmitAvatars(Seq seq, WorldId world, const std::vector<AvatarId>& avatars,
                                    const Part& empty) {
  const Membership* membership = FindControlled(seq, world);
  if (membership == nullptr || !AcceptItems(seq, avatars.size())) return;
  const int shard_count = context_.host.shard_count();
  std::vector<Part> parts(static_cast<std::size_t>(shard_count), empty);
  std::uint32_t index = 0;
  for (const AvatarId avatar : avatars) {
    parts[static_cast<std::size_t>(ShardOf(avatar, shard_count))].avatars.push_back(
        {index++, avatar});
  }
  SubmitParts(seq, membership->world, std::move(parts),
              Pending{.item_count = avatars.size(), .reply = {}});
}

void SessionCommands::OnResult(CommandResult&& result) {
  const auto it = pending_.find(result.seq);
  if (it == pending_.end()) return;
  Pending& pending = it->second;
  STRIDEWIRE_CHECK(pending.outstanding > 0);
  pending.reply.accepted += result.accepted;
  std::ranges::move(result.items, std::back_inserter(pending.reply.items));
  if (--pending.outstanding > 0) return;
  // Shards answer in any order.
  std::ranges::sort(pending.reply.items, {}, &ReplyItem::index);
  Answer(TakePending(result.seq).reply);
}

// ---- worlds

void SessionCommands::Execute(protocol::JoinWorld&& command) {
  const Limits& limits = context_.host.config().limits;
  if (context_.worlds.size() >= static_cast<std::size_t>(limits.max_worlds_per_session)) {
    context_.host.metrics().Reached(Limit::kWorldsPerSession);
    Answer(command.seq, StatusCode::kLimitReached,
           "the session has joined too many worlds (max_worlds_per_session)");
    return;
  }
  AddPending(command.seq, Pending{.outstanding = 1, .role = command.role, .reply = {}});
  context_.host.SendToServer(JoinRequest{.from_shard = context_.host.shard_index(),
                                         .session = context_.identity.id,
                                         .seq = command.seq,
                                         .name = std::move(command.name)});
}

void SessionCommands::OnJoined(Seq seq, Outcome<std::shared_ptr<World>>&& outcome) {
  // The command may belong to an ended session, which this session replaces under the same id.
  if (!pending_.contains(seq)) {
    if (outcome) context_.host.SendToServer(LeaveNotice{(*outcome)->id});
    return;
  }
  const protocol::Role role = TakePending(seq).role;
  if (!outcome) {
    Answer(seq, outcome.error().code, std::move(outcome.error().text));
    return;
  }
  const std::shared_ptr<World> world = *std::move(outcome);
  if (context_.worlds.contains(world->id)) {
    context_.host.SendToServer(LeaveNotice{world->id});
    Answer(seq, StatusCode::kAlreadyJoined, "the session has already joined this world");
    return;
  }
  const Limits& limits = context_.host.config().limits;
  if (context_.worlds.size() >= static_cast<std::size_t>(limits.max_worlds_per_session)) {
    context_.host.metrics().Reached(Limit::kWorldsPerSession);
    context_.host.SendToServer(LeaveNotice{world->id});
    Answer(seq, StatusCode::kLimitReached,
           "the session has joined too many worlds (max_worlds_per_session)");
    return;
  }
  const Membership& membership =
      context_.worlds.emplace(world->id, Membership{.world = world, .role = role}).first->second;
  context_.host.InterestChanged(world);
  SendWorldInfo(seq, membership);
  stream_.SendTerrain(*world, false);
  Answer(Reply{.seq = seq}, world->id);
}

void SessionCommands::Execute(protocol::LeaveWorld&& command) {
  if (!context_.worlds.contains(command.world)) {
    Answer(command.seq, StatusCode::kNotJoined, kNotJoinedText);
    return;
  }
  Leave(command.world);
  Answer(command.seq, StatusCode::kOk);
}

void SessionCommands::Leave(WorldId id) {
  const auto it = context_.worlds.find(id);
  STRIDEWIRE_CHECK(it != context_.worlds.end());
  const std::shared_ptr<World> world = it->second.world;
  const bool is_controller = it->second.role == protocol::Role::kController;
  context_.worlds.erase(it);
  stream_.LeaveWorld(id);
  if (is_controller) {
    for (int shard = 0; shard < context_.host.shard_count(); ++shard) {
      context_.host.SendToShard(shard, WorldCommand{.world = world,
                                                    .from_shard = context_.host.shard_index(),
                                                    .session = context_.identity.id,
                                                    .seq = 0,
                                                    .part = ReleasePart{}});
    }
  }
  context_.host.InterestChanged(world);
  context_.host.SendToServer(LeaveNotice{id});
}

void SessionCommands::SendWorldInfo(Seq seq, const Membership& membership) {
  const World& world = *membership.world;
  std::vector<std::string> layers;
  for (const LayerClip& layer : world.library->layers()) layers.emplace_back(layer.name);
  context_.Send(protocol::WorldInfo{.seq = seq,
                                    .world = world.id,
                                    .name = world.name,
                                    .role = membership.role,
                                    .tick = context_.host.tick(),
                                    .library_hash = world.library->hash(),
                                    .skeleton = ToWire(world.library->skeleton()),
                                    .layers = std::move(layers),
                                    .rotation_quantizations = world.quantizations->joints,
                                    .reduced_joints = world.quantizations->reduced_joints});
}

// ---- avatars

void SessionCommands::Execute(protocol::Spawn&& command) {
  const Membership* membership = FindControlled(command.seq, command.world);
  if (membership == nullptr || !AcceptItems(command.seq, command.items.size())) return;
  World& world = *membership->world;
  AvatarBudget& budget = context_.host.avatar_budget();
  const int shard_count = context_.host.shard_count();
  std::vector<SpawnPart> parts(static_cast<std::size_t>(shard_count));
  Pending pending{.item_count = command.items.size(), .reply = {}};
  std::uint32_t index = 0;
  for (protocol::SpawnItem& item : command.items) {
    const auto submit = [&] {
      parts[static_cast<std::size_t>(ShardOf(item.avatar, shard_count))].items.push_back(
          {index, item});
    };
    const auto refuse = [&](const char* text, StatusCode code = StatusCode::kLimitReached) {
      pending.reply.items.push_back(
          {.index = index, .avatar = item.avatar, .code = code, .text = text});
    };
    if (item.teleport) {
      if (item.avatar != 0) {
        submit();
      } else {
        refuse("a teleport requires an avatar id above 0", StatusCode::kNoSuchAvatar);
      }
      ++index;
      continue;
    }
    switch (budget.Reserve(world)) {
      case AvatarBudget::Verdict::kOk:
        if (item.avatar != 0) {
          RecordAvatarId(world, item.avatar);
        } else {
          item.avatar = NextAvatarId(world);
        }
        if (item.avatar == 0) {
          budget.Release(world);
          refuse("no avatar id is left in this world");
        } else {
          submit();
        }
        break;
      case AvatarBudget::Verdict::kWorldFull:
        context_.host.metrics().Reached(Limit::kAvatarsPerWorld);
        refuse("too many avatars in this world (max_avatars_per_world)");
        break;
      case AvatarBudget::Verdict::kServerFull:
        context_.host.metrics().Reached(Limit::kAvatars);
        refuse("too many avatars on this server (max_avatars)");
        break;
    }
    ++index;
  }
  SubmitParts(command.seq, membership->world, std::move(parts), std::move(pending));
}

void SessionCommands::Execute(protocol::Request&& command) {
  const Membership* membership = FindControlled(command.seq, command.world);
  if (membership == nullptr || !AcceptItems(command.seq, command.items.size())) return;
  // Counts the avatars, assuming that the requests of each avatar are consecutive.
  std::size_t avatars = 0;
  for (std::size_t i = 0; i < command.items.size(); ++i) {
    avatars += i == 0 || command.items[i].avatar != command.items[i - 1].avatar;
  }
  const auto per_tick = static_cast<std::size_t>(context_.host.config().limits.starts_per_tick);
  const auto over_ticks = static_cast<std::uint32_t>((avatars + per_tick - 1) / per_tick);
  std::vector<RequestPart> parts(static_cast<std::size_t>(context_.host.shard_count()),
                                 RequestPart{.items = {}, .over_ticks = over_ticks});
  const std::size_t item_count = command.items.size();
  Pending pending{.item_count = item_count, .reply = {}};
  pending.reply.text = SpeedNote(membership->world->walk_speeds, command.items);
  Distribute(std::move(command.items), parts);
  SubmitParts(command.seq, membership->world, std::move(parts), std::move(pending));
}

void SessionCommands::Execute(protocol::SetLayers&& command) {
  const Membership* membership = FindControlled(command.seq, command.world);
  if (membership == nullptr || !AcceptItems(command.seq, command.items.size())) return;
  const std::size_t item_count = command.items.size();
  std::vector<LayerPart> parts(static_cast<std::size_t>(context_.host.shard_count()));
  Distribute(std::move(command.items), parts);
  SubmitParts(command.seq, membership->world, std::move(parts),
              Pending{.item_count = item_count, .reply = {}});
}

void SessionCommands::Execute(protocol::Remove&& command) {
  SubmitAvatars<RemovePart>(command.seq, command.world, command.avatars);
}

void SessionCommands::Execute(protocol::CancelQueue&& command) {
  SubmitAvatars<CancelPart>(command.seq, command.world, command.avatars);
}

void SessionCommands::Execute(protocol::SetPlanting&& command) {
  SubmitAvatars(command.seq, command.world, command.avatars, PlantingPart{{}, command.enabled});
}

// ---- terrain

void SessionCommands::Execute(protocol::SetTerrain&& command) {
  const Membership* membership = FindControlled(command.seq, command.world);
  if (membership == nullptr) return;
  // Number of heights and boxes. It determines the cost of validating and sending the terrain, and
  // therefore how many items the command counts as.
  std::size_t numbers = 0;
  if (command.terrain) {
    numbers = command.terrain->boxes.size();
    if (const auto& field = command.terrain->height_field) numbers += field->heights_m.size();
  }
  const std::size_t item_count = 1 + numbers / kNumbersPerItem;
  if (!AcceptItems(command.seq, item_count)) return;
  Pending pending{
      .outstanding = context_.host.shard_count(), .item_count = item_count, .reply = {}};
  pending.reply.seq = command.seq;
  pending.reply.accepted = 1;
  AddPending(command.seq, std::move(pending));
  context_.host.SendToServer(TerrainChange{.world = membership->world,
                                           .from_shard = context_.host.shard_index(),
                                           .session = context_.identity.id,
                                           .seq = command.seq,
                                           .terrain = std::move(command.terrain)});
}

void SessionCommands::OnTerrainRefused(Seq seq, Refusal refusal) {
  if (!pending_.contains(seq)) return;
  (void)TakePending(seq);
  Answer(seq, refusal.code, std::move(refusal.text));
}

// ---- subscriptions

void SessionCommands::Execute(protocol::Observe&& command) {
  Subscriptions& subscriptions = stream_.subscriptions();
  const Limits& limits = context_.host.config().limits;
  const auto refuse = [&](StatusCode code, std::string text) {
    Answer(command.seq, code, std::move(text));
  };
  command.mode = Subscriptions::SentMode(command.mode, command.detail);
  const Membership* membership = context_.FindWorld(command.world);
  if (membership == nullptr) return refuse(StatusCode::kNotJoined, kNotJoinedText);
  if (command.replace) return MoveRegion(command, membership->world);
  if (subscriptions.Contains(command.subscription)) {
    return refuse(StatusCode::kSubscriptionExists, "a subscription with this id already exists");
  }
  if (subscriptions.size() >= static_cast<std::size_t>(limits.max_subscriptions)) {
    context_.host.metrics().Reached(Limit::kSubscriptions);
    return refuse(StatusCode::kLimitReached,
                  "the session has too many subscriptions (max_subscriptions)");
  }
  if (command.region ? subscriptions.ObservesWorld(command.world)
                     : subscriptions.HasRegion(command.world)) {
    return refuse(StatusCode::kNotAllowed,
                  "a subscription with a region must be the only one of its world");
  }
  const auto max_selected = static_cast<std::size_t>(limits.max_named_avatars);
  if (subscriptions.selected_count() + command.avatars.size() > max_selected) {
    context_.host.metrics().Reached(Limit::kNamedAvatars);
    return refuse(StatusCode::kLimitReached,
                  "the subscriptions contain too many avatar ids (max_named_avatars)");
  }
  if (!AcceptItems(command.seq, command.avatars.size())) return;
  std::optional<RegionMembers> region;
  if (command.region) {
    region.emplace().Set(*command.region, membership->world->interest_cell_m, command.every_n_ticks,
                         command.mode);
  }
  subscriptions.Add(command.subscription, {.world = command.world,
                                           .mode = command.mode,
                                           .every_n_ticks = command.every_n_ticks,
                                           .with_events = command.with_events,
                                           .avatars = std::move(command.avatars),
                                           .region = std::move(region)});
  context_.host.InterestChanged(membership->world);
  Answer(command.seq, StatusCode::kOk);
  if (command.mode == PoseMode::kMovement) stream_.UpdateMovementFeeds(membership->world);
}

void SessionCommands::MoveRegion(const protocol::Observe& command,
                                 const std::shared_ptr<World>& world) {
  const auto intervals = [&] {
    std::array<SendInterval, kSentModes.size()> all;
    for (const PoseMode mode : kSentModes) {
      all[ModeIndex(mode)] = stream_.IntervalOf(command.world, mode);
    }
    return all;
  };
  const auto intervals_before = intervals();
  const bool had_events = stream_.WantsEvents(command.world);
  if (!stream_.subscriptions().MoveRegion(command.subscription, command, world->interest_cell_m)) {
    Answer(command.seq, StatusCode::kNoSuchSubscription,
           "no subscription of this id has a region with the same world and mode");
    return;
  }
  if (intervals() == intervals_before && stream_.WantsEvents(command.world) == had_events) {
    context_.host.SelectionChanged(command.world);
  } else {
    context_.host.InterestChanged(world);
  }
  Answer(command.seq, StatusCode::kOk);
}

void SessionCommands::Execute(protocol::StopObserving&& command) {
  const auto world = stream_.RemoveSubscription(command.subscription);
  if (!world) {
    Answer(command.seq, StatusCode::kNoSuchSubscription, "no subscription has this id");
    return;
  }
  context_.host.InterestChanged(context_.worlds.at(*world).world);
  Answer(command.seq, StatusCode::kOk);
}

// ---- replies

void SessionCommands::Answer(Seq seq, StatusCode code, std::string text) {
  Answer(Reply{.seq = seq, .code = code, .text = std::move(text)});
}

void SessionCommands::Answer(Reply&& reply, WorldId joined) {
  STRIDEWIRE_CHECK(!pending_.contains(reply.seq));
  const SharedFrame frame = EncodeFrame(context_.host.encoder(), reply);
  STRIDEWIRE_CHECK(frame != nullptr);  // MaxItems ensures that the Reply fits into a frame.
  const std::size_t forgotten = replies_.Store(reply.seq, frame, joined);
  if (forgotten > 0 && replies_.bytes() > context_.host.config().limits.reply_cache_bytes / 2) {
    context_.host.metrics().Reached(Limit::kReplyCache, forgotten);
  }
  if (context_.connection != nullptr) context_.connection->SendControl(frame);
}

}  // namespace stridewire::server
