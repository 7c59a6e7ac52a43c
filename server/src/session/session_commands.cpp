// The part of a session that does what its client asks of worlds and avatars.

#include <algorithm>
#include <iterator>
#include <string>
#include <utility>

#include "session/session.h"
#include "world/convert.h"

namespace stridewire::server {

using protocol::Reply;
using protocol::ReplyItem;
using protocol::Seq;
using protocol::StatusCode;

namespace {

// The items of a command as parts for each shard, whose avatars they are about, numbered as they came.
template <typename Item, typename Part>
void ShareOut(std::vector<Item>&& items, std::vector<Part>& parts) {
  // Numbers in a row are shared out evenly.
  for (Part& part : parts) part.items.reserve(items.size() / parts.size() + 1);
  const int shard_count = static_cast<int>(parts.size());
  std::uint32_t index = 0;
  for (Item& item : items) {
    const auto shard = static_cast<std::size_t>(ShardOf(item.avatar, shard_count));
    parts[shard].items.push_back({index++, std::move(item)});
  }
}

// What one of the requests needs and this client has not agreed on; null: nothing.
const char* FeatureMissing(const std::vector<protocol::RequestItem>& items,
                           std::uint64_t features) {
  for (const protocol::RequestItem& item : items) {
    const auto* step = std::get_if<protocol::StepMovement>(&item.movement);
    const bool is_walk = std::holds_alternative<protocol::WalkMovement>(item.movement);
    if (step != nullptr && step->at && (features & protocol::kFeatureFootprints) == 0) {
      return "footprints";
    }
    if (is_walk && (features & protocol::kFeatureWalks) == 0) return "walks";
    if (item.interrupt != protocol::Interrupt::kNone &&
        (features & protocol::kFeatureTakeovers) == 0) {
      return "takeovers";
    }
    if (step != nullptr && step->exact_only && (features & protocol::kFeatureRefusals) == 0) {
      return "refusals";
    }
  }
  return nullptr;
}

// A refused item takes under 256 bytes of a Reply; with no more items a Reply always fits.
constexpr std::size_t kReplyItemBytes = 256;
// Heights and boxes of a terrain that count as one item: the largest is then half a burst.
constexpr std::size_t kNumbersPerItem = 32;

}  // namespace

std::size_t Session::MaxItems(const Limits& limits) {
  return std::min(protocol::kMaxItems, limits.max_bulk_bytes / kReplyItemBytes);
}

bool Session::Affords(Seq seq, std::size_t item_count) {
  const Limits& limits = host_.config().limits;
  if (item_count > MaxItems(limits)) {
    host_.metrics().Reached(Limit::kFrameBytes);
    Answer(seq, StatusCode::kLimitReached, "more items than one message may have here");
    return false;
  }
  request_tokens_.AdvanceTime(host_.clock().ServerTime(Clock::now()));
  if (request_tokens_.Take(static_cast<double>(item_count))) return true;
  host_.metrics().Reached(Limit::kRequestsPerSecond);
  host_.metrics().requests_rejected.Add(item_count);
  Answer(seq, StatusCode::kLimitReached, "more items a second than a session may send");
  return false;
}

Session::Membership* Session::Commanding(Seq seq, WorldId world) {
  const auto it = worlds_.find(world);
  if (it == worlds_.end()) {
    Answer(seq, StatusCode::kNotJoined, "this session is not in that world");
    return nullptr;
  }
  if (it->second.role != protocol::Role::kController) {
    Answer(seq, StatusCode::kNotAllowed, "an observer commands nothing");
    return nullptr;
  }
  return &it->second;
}

template <typename Part>
void Session::SubmitParts(Seq seq, const std::shared_ptr<World>& world, std::vector<Part>&& parts,
                          Pending&& pending) {
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
  pending_items_ += pending.item_count;
  pending_.emplace(seq, std::move(pending));
  for (std::size_t shard = 0; shard < parts.size(); ++shard) {
    if (is_empty(parts[shard])) continue;
    host_.Submit(static_cast<int>(shard), {.world = world,
                                           .from_shard = host_.shard_index(),
                                           .session = identity_.id,
                                           .seq = seq,
                                           .part = std::move(parts[shard])});
  }
}

void Session::Execute(protocol::Spawn&& command) {
  const Membership* membership = Commanding(command.seq, command.world);
  if (membership == nullptr || !Affords(command.seq, command.items.size())) return;
  World& world = *membership->world;
  std::vector<SpawnPart> parts(static_cast<std::size_t>(host_.shard_count()));
  Pending pending{.item_count = command.items.size(), .reply = {}};
  std::uint32_t index = 0;
  for (protocol::SpawnItem& item : command.items) {
    ReplyItem refused{.index = index, .avatar = item.avatar, .code = StatusCode::kLimitReached};
    switch (host_.avatar_budget().Reserve(world)) {
      case AvatarBudget::Verdict::kOk:
        if (item.avatar != 0) {
          NoteNumber(world, item.avatar);
        } else {
          item.avatar = NextNumber(world);
        }
        if (item.avatar == 0) {
          host_.avatar_budget().Release(world);
          refused.text = "no avatar number is left";
          pending.reply.items.push_back(std::move(refused));
        } else {
          parts[static_cast<std::size_t>(ShardOf(item.avatar, host_.shard_count()))]
              .items.push_back({index, item});
        }
        break;
      case AvatarBudget::Verdict::kWorldFull:
        host_.metrics().Reached(Limit::kAvatarsPerWorld);
        refused.text = "the world has as many avatars as it takes";
        pending.reply.items.push_back(std::move(refused));
        break;
      case AvatarBudget::Verdict::kServerFull:
        host_.metrics().Reached(Limit::kAvatars);
        refused.text = "the server has as many avatars as it takes";
        pending.reply.items.push_back(std::move(refused));
        break;
    }
    ++index;
  }
  SubmitParts(command.seq, membership->world, std::move(parts), std::move(pending));
}

void Session::Execute(protocol::Request&& command) {
  const Membership* membership = Commanding(command.seq, command.world);
  if (membership == nullptr || !Affords(command.seq, command.items.size())) return;
  if (const char* feature = FeatureMissing(command.items, features_)) {
    Answer(command.seq, StatusCode::kUnsupported,
           std::string("the feature '") + feature + "' was not agreed on in the handshake");
    return;
  }
  // Movements of one avatar stand beside each other.
  std::size_t avatars = 0;
  for (std::size_t i = 0; i < command.items.size(); ++i) {
    avatars += i == 0 || command.items[i].avatar != command.items[i - 1].avatar;
  }
  const auto at_once = static_cast<std::size_t>(host_.config().limits.starts_per_tick);
  const auto over_ticks = static_cast<std::uint32_t>((avatars + at_once - 1) / at_once);
  std::vector<RequestPart> parts(static_cast<std::size_t>(host_.shard_count()),
                                 RequestPart{.items = {}, .over_ticks = over_ticks});
  const std::size_t item_count = command.items.size();
  ShareOut(std::move(command.items), parts);
  SubmitParts(command.seq, membership->world, std::move(parts),
              Pending{.item_count = item_count, .reply = {}});
}

void Session::Execute(protocol::SetLayers&& command) {
  const Membership* membership = Commanding(command.seq, command.world);
  if (membership == nullptr || !Affords(command.seq, command.items.size())) return;
  if ((features_ & protocol::kFeatureLayers) == 0) {
    Answer(command.seq, StatusCode::kUnsupported,
           "the feature 'layers' was not agreed on in the handshake");
    return;
  }
  const std::size_t item_count = command.items.size();
  std::vector<LayerPart> parts(static_cast<std::size_t>(host_.shard_count()));
  ShareOut(std::move(command.items), parts);
  SubmitParts(command.seq, membership->world, std::move(parts),
              Pending{.item_count = item_count, .reply = {}});
}

void Session::Inspect(const protocol::InspectAvatar& question) {
  if ((features_ & protocol::kFeatureInspect) == 0) {
    host_.metrics().protocol_errors.Add();
    Fail(StatusCode::kUnexpectedMessage, "InspectAvatar needs the feature 'inspect'");
    return;
  }
  const auto refuse = [&](StatusCode code, const char* text) {
    Send(protocol::AvatarState{.nonce = question.nonce,
                               .world = question.world,
                               .avatar = question.avatar,
                               .code = code,
                               .text = text});
  };
  const auto it = worlds_.find(question.world);
  if (it == worlds_.end()) {
    refuse(StatusCode::kNotJoined, "this session is not in that world");
  } else if (pending_questions_ >= host_.config().limits.max_pending_commands) {
    host_.metrics().Reached(Limit::kPendingCommands);
    refuse(StatusCode::kLimitReached, "as many questions wait for their answer as may");
  } else {
    ++pending_questions_;
    host_.Ask(ShardOf(question.avatar, host_.shard_count()), {.world = it->second.world,
                                                              .from_shard = host_.shard_index(),
                                                              .session = identity_.id,
                                                              .nonce = question.nonce,
                                                              .avatar = question.avatar});
  }
}

void Session::OnInspected(const protocol::AvatarState& state) {
  --pending_questions_;
  const auto is_walk = [](const protocol::RequestItem& item) {
    return std::holds_alternative<protocol::WalkMovement>(item.movement);
  };
  if ((features_ & protocol::kFeatureWalks) != 0 || std::ranges::none_of(state.queue, is_walk)) {
    Send(state);
    return;
  }
  protocol::AvatarState without = state;
  std::erase_if(without.queue, is_walk);
  Send(without);
}

template <typename Part>
void Session::SubmitAvatars(Seq seq, WorldId world, const std::vector<AvatarId>& avatars,
                            const Part& empty) {
  const Membership* membership = Commanding(seq, world);
  if (membership == nullptr || !Affords(seq, avatars.size())) return;
  std::vector<Part> parts(static_cast<std::size_t>(host_.shard_count()), empty);
  std::uint32_t index = 0;
  for (const AvatarId avatar : avatars) {
    parts[static_cast<std::size_t>(ShardOf(avatar, host_.shard_count()))].avatars.push_back(
        {index++, avatar});
  }
  SubmitParts(seq, membership->world, std::move(parts),
              Pending{.item_count = avatars.size(), .reply = {}});
}

void Session::Execute(protocol::Remove&& command) {
  SubmitAvatars<RemovePart>(command.seq, command.world, command.avatars);
}

void Session::Execute(protocol::CancelQueue&& command) {
  SubmitAvatars<CancelPart>(command.seq, command.world, command.avatars);
}

void Session::Execute(protocol::SetPlanting&& command) {
  if ((features_ & protocol::kFeaturePlanting) == 0) {
    Answer(command.seq, StatusCode::kUnsupported,
           "the feature 'planting' was not agreed on in the handshake");
    return;
  }
  SubmitAvatars(command.seq, command.world, command.avatars, PlantingPart{{}, command.enabled});
}

void Session::Execute(protocol::SetTerrain&& command) {
  const Membership* membership = Commanding(command.seq, command.world);
  if (membership == nullptr) return;
  if ((features_ & protocol::kFeatureTerrain) == 0) {
    Answer(command.seq, StatusCode::kUnsupported,
           "the feature 'terrain' was not agreed on in the handshake");
    return;
  }
  // What it costs to make and to tell, in items.
  std::size_t numbers = 0;
  if (command.terrain) {
    numbers = command.terrain->boxes.size();
    if (const auto& field = command.terrain->height_field) numbers += field->heights_m.size();
  }
  const std::size_t item_count = 1 + numbers / kNumbersPerItem;
  if (!Affords(command.seq, item_count)) return;
  Pending pending{.outstanding = host_.shard_count(), .item_count = item_count, .reply = {}};
  pending.reply.seq = command.seq;
  pending.reply.accepted = 1;
  pending_items_ += item_count;
  pending_.emplace(command.seq, std::move(pending));
  host_.SetTerrain({.world = membership->world,
                    .from_shard = host_.shard_index(),
                    .session = identity_.id,
                    .seq = command.seq,
                    .terrain = std::move(command.terrain)});
}

void Session::OnTerrainRefused(Seq seq, Refusal refusal) {
  const auto it = pending_.find(seq);
  if (is_ended_ || it == pending_.end()) return;
  pending_items_ -= it->second.item_count;
  pending_.erase(it);
  Answer(seq, refusal.code, std::move(refusal.text));
  UpdatePause();
}

void Session::OnGround(WorldId world, const SharedFrame& frame) {
  if (connection_ == nullptr || (features_ & protocol::kFeatureTerrain) == 0) return;
  if (worlds_.contains(world)) connection_->SendTerrain(world, frame);
}

void Session::OnResult(CommandResult&& result) {
  const auto it = pending_.find(result.seq);
  if (is_ended_ || it == pending_.end()) return;
  Pending& pending = it->second;
  pending.reply.accepted += result.accepted;
  std::ranges::move(result.items, std::back_inserter(pending.reply.items));
  if (--pending.outstanding > 0) return;
  // Shards answer in any order.
  std::ranges::sort(pending.reply.items, {}, &ReplyItem::index);
  Reply reply = std::move(pending.reply);
  pending_items_ -= pending.item_count;
  pending_.erase(it);
  Answer(std::move(reply));
  UpdatePause();
}

}  // namespace stridewire::server
