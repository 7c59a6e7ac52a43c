#include "stridewire/protocol/decode.h"

#include <limits>
#include <map>

#include "protocol_testing.h"
#include "stridewire_generated.h"
#include "test_vectors.h"

// Builds payloads that the encoder never writes.
namespace stridewire::protocol {
namespace {

using flatbuffers::FlatBufferBuilder;
using flatbuffers::Offset;

std::vector<std::byte> Payload(FlatBufferBuilder& builder) {
  const auto* data = reinterpret_cast<const std::byte*>(builder.GetBufferPointer());
  std::vector<std::byte> payload(data, data + builder.GetSize());
  payload.resize((payload.size() + 7) / 8 * 8);
  return payload;
}

template <typename T>
std::vector<std::byte> Finished(FlatBufferBuilder& builder, Offset<T> root) {
  builder.Finish(root);
  return Payload(builder);
}

void ExpectError(MessageType type, const std::vector<std::byte>& payload, ErrorCode code,
                 std::string_view where, std::int64_t index = -1) {
  const auto message = DecodeMessage({type, payload});
  ASSERT_FALSE(message) << where;
  EXPECT_EQ(message.error().code, code) << Describe(message.error());
  EXPECT_EQ(message.error().where, where);
  if (index >= 0) {
    EXPECT_EQ(message.error().index, index);
  }
}

TEST(Decode, ChecksEveryType) {
  // A table without fields is valid FlatBuffers, so that Check has to reject it.
  const std::map<MessageType, std::string> first_wrong = {
      {MessageType::kHello, "Hello.protocol_min"},
      {MessageType::kJoinWorld, "JoinWorld.seq"},
      {MessageType::kLeaveWorld, "LeaveWorld.seq"},
      {MessageType::kSpawn, "Spawn.seq"},
      {MessageType::kRemove, "Remove.seq"},
      {MessageType::kRequest, "Request.seq"},
      {MessageType::kCancelQueue, "CancelQueue.seq"},
      {MessageType::kObserve, "Observe.seq"},
      {MessageType::kStopObserving, "StopObserving.seq"},
      {MessageType::kPing, ""},
      {MessageType::kInspectAvatar, "InspectAvatar.world"},
      {MessageType::kGoodbye, ""},
      {MessageType::kWelcome, "Welcome.protocol"},
      {MessageType::kWorldInfo, "WorldInfo.world"},
      {MessageType::kReply, "Reply.seq"},
      {MessageType::kPoseBatch, "PoseBatch.world"},
      {MessageType::kEvents, "Events.world"},
      {MessageType::kLagging, "Lagging.world"},
      {MessageType::kError, ""},
      {MessageType::kPong, ""},
      {MessageType::kAvatarState, "AvatarState.world"},
      {MessageType::kSetTerrain, "SetTerrain.seq"},
      {MessageType::kWorldTerrain, "WorldTerrain.world"},
      {MessageType::kSetLayers, "SetLayers.seq"},
      {MessageType::kSetPlanting, "SetPlanting.seq"},
      {MessageType::kFetchLibrary, "FetchLibrary.hash"},
      {MessageType::kMovements, "Movements.world"},
      {MessageType::kLibraryPiece, ""}};
  EXPECT_EQ(first_wrong.size(), std::variant_size_v<Message>);
  FlatBufferBuilder builder;
  const auto empty = Finished(builder, wire::CreatePing(builder));
  for (const auto& [type, where] : first_wrong) {
    SCOPED_TRACE(MessageTypeName(type));
    if (where.empty()) {
      EXPECT_TRUE(DecodeMessage({type, empty}));
    } else {
      // Only the hash of a library is a text that must not be empty.
      const bool is_text = type == MessageType::kFetchLibrary;
      ExpectError(type, empty, is_text ? ErrorCode::kMalformed : ErrorCode::kOutOfRange, where);
    }
  }
}

TEST(Decode, RejectsAnUnknownType) {
  FlatBufferBuilder builder;
  const auto payload = Finished(builder, wire::CreatePing(builder));
  ExpectError(static_cast<MessageType>(200), payload, ErrorCode::kUnsupported, "frame.type", 200);
}

TEST(Decode, RejectsAMisalignedPayload) {
  FlatBufferBuilder builder;
  auto payload = Finished(builder, wire::CreatePing(builder));
  payload.insert(payload.begin(), std::byte{0});
  const auto message =
      DecodeMessage({MessageType::kPing, std::span<const std::byte>(payload).subspan(1)});
  ASSERT_FALSE(message);
  EXPECT_EQ(message.error().code, ErrorCode::kInvalidArgument);
}

TEST(Decode, RejectsAPayloadOverItsCap) {
  const std::vector<std::byte> payload(kMaxHelloBytes + 8);
  ExpectError(MessageType::kHello, payload, ErrorCode::kLimitExceeded, "Hello");
}

TEST(Decode, RejectsInvalidFlatBuffers) {
  for (const auto& [name, sample] : SampleMessages()) {
    SCOPED_TRACE(name);
    const MessageType type = TypeOf(sample);
    const std::string where(MessageTypeName(type));
    ExpectError(type, {}, ErrorCode::kMalformed, where);
    ExpectError(type, std::vector<std::byte>(8), ErrorCode::kMalformed, where);
    ExpectError(type, std::vector<std::byte>(64, std::byte{0xff}), ErrorCode::kMalformed, where);
  }
}

TEST(Decode, RejectsTruncatedPayloads) {
  // A truncated sample is rejected, unless only its padding is missing.
  for (const auto& [name, sample] : SampleMessages()) {
    SCOPED_TRACE(name);
    const MessageType type = TypeOf(sample);
    const auto frame = EncodeOrFail(sample);
    int refused = 0;
    for (std::size_t size = 0; size < frame.size() - kFrameHeaderBytes; ++size) {
      const std::vector<std::byte> cut(frame.begin() + kFrameHeaderBytes,
                                       frame.begin() + kFrameHeaderBytes + static_cast<long>(size));
      const auto message = DecodeMessage({type, cut});
      if (message) {
        EXPECT_TRUE(SameMessage(*message, sample));
      } else {
        ++refused;
        EXPECT_EQ(message.error().code, ErrorCode::kMalformed);
      }
    }
    EXPECT_GT(refused, 0);
  }
}

TEST(Decode, ChecksNumbers) {
  FlatBufferBuilder builder;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  ExpectError(MessageType::kPing, Finished(builder, wire::CreatePing(builder, 1, nan)),
              ErrorCode::kOutOfRange, "Ping.time_s");
  builder.Clear();
  const wire::Vec3 position(0.0, nan, 0.0);
  const std::vector items = {wire::CreateSpawnItem(builder, 1, &position, 0.0)};
  ExpectError(MessageType::kSpawn,
              Finished(builder, wire::CreateSpawn(builder, 1, 1, builder.CreateVector(items))),
              ErrorCode::kOutOfRange, "Spawn.items.position_m", 0);
}

TEST(Decode, RejectsAMisalignedList) {
  // With one of these two numbers of bytes after it, the list of doubles is aligned to 4 bytes
  // only.
  int refused = 0;
  for (const std::size_t behind : {32u, 36u}) {
    FlatBufferBuilder builder;
    const auto filler = builder.CreateVector(std::vector<std::uint8_t>(behind, 0));
    const auto crooked = builder.CreateVector(std::vector<std::uint32_t>{0});
    const auto movement = wire::CreateCurrentMovement(
        builder, 1, wire::MovementKind::Jump, 0, 0.0,
        Offset<flatbuffers::Vector<double>>(crooked.o), 0.0, 0.0, 0, 0, false, false, 0, filler);
    const auto payload = Finished(
        builder, wire::CreateAvatarState(builder, 1, 1, 1, 0, 0, 1, 0.0, nullptr, 0.0, movement));
    const auto* state = flatbuffers::GetRoot<wire::AvatarState>(payload.data());
    const auto at =
        reinterpret_cast<std::uintptr_t>(state->movement()->keytimes_s()->Data()) % alignof(double);
    if (at == 0) continue;
    ++refused;
    ExpectError(MessageType::kAvatarState, payload, ErrorCode::kMalformed,
                "AvatarState.movement.keytimes_s");
  }
  EXPECT_GT(refused, 0);
}

TEST(Decode, RejectsUnknownEnumerators) {
  FlatBufferBuilder builder;
  const auto item = [&](int type, int foot) {
    return wire::CreateRequestItem(builder, 1, 1, static_cast<wire::MovementType>(type),
                                   static_cast<wire::FootChoice>(foot));
  };
  const auto request = [&](int type, int foot) {
    builder.Clear();
    const std::vector items = {item(0, 0), item(type, foot)};
    return Finished(builder, wire::CreateRequest(builder, 1, 1, builder.CreateVector(items)));
  };
  EXPECT_TRUE(DecodeMessage({MessageType::kRequest, request(2, 0)}));
  EXPECT_TRUE(DecodeMessage({MessageType::kRequest, request(1, 77)})) << "a jump has no foot";
  ExpectError(MessageType::kRequest, request(3, 0), ErrorCode::kMalformed, "Request.items.type", 1);
  ExpectError(MessageType::kRequest, request(0, 3), ErrorCode::kMalformed, "Request.items.foot", 1);
}

TEST(Decode, NeedsOneDetailPerRing) {
  FlatBufferBuilder builder;
  const auto observe = [&](const std::vector<std::uint8_t>& details) {
    builder.Clear();
    const std::vector<wire::RateRing> rings{{8.0, 1}, {20.0, 2}};
    const auto rings_offset = builder.CreateVectorOfStructs(rings);
    const auto details_offset = builder.CreateVector(details);
    wire::RegionBuilder region(builder);
    region.add_radius_m(30.0);
    region.add_rings(rings_offset);
    region.add_ring_details(details_offset);
    return Finished(builder, wire::CreateObserve(builder, 1, 1, 1, wire::PoseMode::Quantised, 0, 1,
                                                 false, region.Finish()));
  };
  for (const std::vector<std::uint8_t>& good : {std::vector<std::uint8_t>{}, {2, 0}}) {
    const auto message = DecodeMessage({MessageType::kObserve, observe(good)});
    ASSERT_TRUE(message) << Describe(message.error());
    EXPECT_EQ(std::get<Observe>(*message).region->ring_details.size(), good.size());
  }
  ExpectError(MessageType::kObserve, observe({1}), ErrorCode::kMalformed,
              "Observe.region.ring_details", 1);
  ExpectError(MessageType::kObserve, observe({0, 3}), ErrorCode::kMalformed,
              "Observe.region.ring_details", 1);
  ExpectError(MessageType::kObserve, observe({0, 0, 0, 0, 0}), ErrorCode::kLimitExceeded,
              "Observe.region.ring_details");
}

TEST(Decode, AcceptsUnknownStatusCodesAndReservedFields) {
  FlatBufferBuilder builder;
  const auto reply = Finished(builder, wire::CreateReply(builder, 1, 499));
  const auto message = DecodeMessage({MessageType::kReply, reply});
  ASSERT_TRUE(message);
  EXPECT_EQ(static_cast<int>(std::get<Reply>(*message).code), 499);
  builder.Clear();
  const auto name = builder.CreateString("x");
  // The fourth field of Hello is reserved.
  const auto start = builder.StartTable();
  builder.AddElement<std::uint16_t>(4, 1, 0);
  builder.AddElement<std::uint16_t>(6, 1, 0);
  builder.AddOffset(8, name);
  builder.AddElement<std::uint64_t>(10, std::numeric_limits<std::uint64_t>::max(), 0);
  const auto hello = Finished(builder, flatbuffers::Offset<wire::Hello>(builder.EndTable(start)));
  EXPECT_TRUE(DecodeMessage({MessageType::kHello, hello}));
}

TEST(Decode, SkipsUnknownFields) {
  // A field that a later version of the schema could append to Ping.
  FlatBufferBuilder builder;
  const auto extra = builder.CreateString("from the future");
  const auto start = builder.StartTable();
  builder.AddElement<std::uint64_t>(wire::Ping::VT_NONCE, 5, 0);
  builder.AddElement<double>(wire::Ping::VT_TIME_S, 1.5, 0.0);
  builder.AddOffset(wire::Ping::VT_TIME_S + 2, extra);
  builder.Finish(Offset<wire::Ping>(builder.EndTable(start)));
  const auto message = DecodeMessage({MessageType::kPing, Payload(builder)});
  ASSERT_TRUE(message) << Describe(message.error());
  EXPECT_EQ(std::get<Ping>(*message), (Ping{5, 1.5}));
}

TEST(Decode, RejectsLongTextsBeforeCopying) {
  FlatBufferBuilder builder;
  const auto text = [&](std::size_t bytes) {
    return builder.CreateString(std::string(bytes, 'x'));
  };
  ExpectError(MessageType::kHello, Finished(builder, wire::CreateHello(builder, 1, 1, text(65))),
              ErrorCode::kLimitExceeded, "Hello.client_name");
  builder.Clear();
  const auto name = text(1);
  const auto token = text(4097);
  ExpectError(MessageType::kHello, Finished(builder, wire::CreateHello(builder, 1, 1, name, token)),
              ErrorCode::kLimitExceeded, "Hello.auth_token");
  builder.Clear();
  ExpectError(MessageType::kJoinWorld,
              Finished(builder, wire::CreateJoinWorld(builder, 1, text(65))),
              ErrorCode::kLimitExceeded, "JoinWorld.name");
  builder.Clear();
  ExpectError(MessageType::kGoodbye, Finished(builder, wire::CreateGoodbye(builder, 0, text(1025))),
              ErrorCode::kLimitExceeded, "Goodbye.text");
  builder.Clear();
  ExpectError(MessageType::kError, Finished(builder, wire::CreateError(builder, 0, text(1025))),
              ErrorCode::kLimitExceeded, "Error.text");
  builder.Clear();
  ExpectError(MessageType::kReply, Finished(builder, wire::CreateReply(builder, 1, 0, text(1025))),
              ErrorCode::kLimitExceeded, "Reply.text");
  builder.Clear();
  const std::vector items = {wire::CreateReplyItem(builder, 0, 1, 1, 0, text(257))};
  ExpectError(
      MessageType::kReply,
      Finished(builder, wire::CreateReply(builder, 1, 0, 0, 0, builder.CreateVector(items))),
      ErrorCode::kLimitExceeded, "Reply.items.text", 0);
  builder.Clear();
  const auto reason = text(257);
  wire::EventBuilder event(builder);
  event.add_avatar(1);
  event.add_reason(reason);
  const std::vector events = {event.Finish()};
  ExpectError(MessageType::kEvents,
              Finished(builder, wire::CreateEvents(builder, 1, 1, 1, builder.CreateVector(events))),
              ErrorCode::kLimitExceeded, "Events.events.reason", 0);
  builder.Clear();
  ExpectError(MessageType::kWorldInfo,
              Finished(builder, wire::CreateWorldInfo(builder, 1, 1, text(65))),
              ErrorCode::kLimitExceeded, "WorldInfo.name");
  builder.Clear();
  const auto plaza = text(5);
  ExpectError(MessageType::kWorldInfo,
              Finished(builder, wire::CreateWorldInfo(builder, 1, 1, plaza, wire::Role::Observer, 0,
                                                      text(65))),
              ErrorCode::kLimitExceeded, "WorldInfo.library_hash");
  for (const bool version : {false, true}) {
    builder.Clear();
    const auto long_text = text(65);
    wire::WelcomeBuilder welcome(builder);
    if (version) {
      welcome.add_server_version(long_text);
    } else {
      welcome.add_server_name(long_text);
    }
    ExpectError(MessageType::kWelcome, Finished(builder, welcome.Finish()),
                ErrorCode::kLimitExceeded,
                version ? "Welcome.server_version" : "Welcome.server_name");
  }
}

TEST(Decode, RejectsLongListsBeforeCopying) {
  FlatBufferBuilder builder;
  const std::vector<std::uint32_t> avatars(kMaxItems + 1, 1);
  const std::vector<std::uint8_t> token(65);
  ExpectError(MessageType::kRemove,
              Finished(builder, wire::CreateRemove(builder, 1, 1, builder.CreateVector(avatars))),
              ErrorCode::kLimitExceeded, "Remove.avatars");
  builder.Clear();
  ExpectError(
      MessageType::kCancelQueue,
      Finished(builder, wire::CreateCancelQueue(builder, 1, 1, builder.CreateVector(avatars))),
      ErrorCode::kLimitExceeded, "CancelQueue.avatars");
  builder.Clear();
  ExpectError(MessageType::kObserve,
              Finished(builder, wire::CreateObserve(builder, 1, 1, 1, wire::PoseMode::Full,
                                                    builder.CreateVector(avatars))),
              ErrorCode::kLimitExceeded, "Observe.avatars");
  builder.Clear();
  const auto name = builder.CreateString("x");
  const auto bytes = builder.CreateVector(token);
  ExpectError(MessageType::kHello,
              Finished(builder, wire::CreateHello(builder, 1, 1, name, 0, bytes)),
              ErrorCode::kLimitExceeded, "Hello.resume_token");
  builder.Clear();
  ExpectError(MessageType::kWelcome,
              Finished(builder, wire::CreateWelcome(builder, 1, 1, builder.CreateVector(token))),
              ErrorCode::kLimitExceeded, "Welcome.resume_token");
  builder.Clear();
  {
    const auto item = wire::CreateSpawnItem(builder, 1);
    const std::vector items(kMaxItems + 1, item);
    ExpectError(MessageType::kSpawn,
                Finished(builder, wire::CreateSpawn(builder, 1, 1, builder.CreateVector(items))),
                ErrorCode::kLimitExceeded, "Spawn.items");
  }
  builder.Clear();
  {
    const std::vector items(kMaxItems + 1, wire::CreateRequestItem(builder, 1, 1));
    ExpectError(MessageType::kRequest,
                Finished(builder, wire::CreateRequest(builder, 1, 1, builder.CreateVector(items))),
                ErrorCode::kLimitExceeded, "Request.items");
  }
  builder.Clear();
  {
    const std::vector items(kMaxItems + 1, wire::CreateReplyItem(builder, 1, 1));
    ExpectError(
        MessageType::kReply,
        Finished(builder, wire::CreateReply(builder, 1, 0, 0, 0, builder.CreateVector(items))),
        ErrorCode::kLimitExceeded, "Reply.items");
  }
  builder.Clear();
  {
    const std::vector items(kMaxItems + 1, wire::CreateEvent(builder));
    ExpectError(
        MessageType::kEvents,
        Finished(builder, wire::CreateEvents(builder, 1, 1, 1, builder.CreateVector(items))),
        ErrorCode::kLimitExceeded, "Events.events");
  }
  builder.Clear();
  {
    const std::vector<wire::ParameterValue> values(kMaxParameters + 1);
    const auto requested = builder.CreateVectorOfStructs(values);
    wire::EventBuilder event(builder);
    event.add_avatar(1);
    event.add_requested(requested);
    const std::vector events = {event.Finish()};
    ExpectError(
        MessageType::kEvents,
        Finished(builder, wire::CreateEvents(builder, 1, 1, 1, builder.CreateVector(events))),
        ErrorCode::kLimitExceeded, "Events.events.requested");
  }
}

Offset<wire::WorldInfo> World(FlatBufferBuilder& builder, Offset<wire::Skeleton> skeleton) {
  const auto name = builder.CreateString("plaza");
  return wire::CreateWorldInfo(builder, 1, 1, name, wire::Role::Observer, 0, 0, skeleton);
}

TEST(Decode, LimitsSkeletons) {
  FlatBufferBuilder builder;
  const auto name = builder.CreateString("j");
  const std::vector joints(kMaxJoints + 1, wire::CreateJoint(builder, name));
  ExpectError(MessageType::kWorldInfo,
              Finished(builder,
                       World(builder, wire::CreateSkeleton(builder, builder.CreateVector(joints)))),
              ErrorCode::kLimitExceeded, "WorldInfo.skeleton.joints");
  builder.Clear();
  const std::vector sites(257, wire::CreateEndSite(builder));
  ExpectError(MessageType::kWorldInfo,
              Finished(builder, World(builder, wire::CreateSkeleton(builder, 0,
                                                                    builder.CreateVector(sites)))),
              ErrorCode::kLimitExceeded, "WorldInfo.skeleton.end_sites");
  builder.Clear();
  ExpectError(MessageType::kWorldInfo, Finished(builder, World(builder, 0)), ErrorCode::kMalformed,
              "WorldInfo.skeleton.joints");
  builder.Clear();
  const std::vector long_name = {
      wire::CreateJoint(builder, builder.CreateString(std::string(65, 'x')))};
  ExpectError(MessageType::kWorldInfo,
              Finished(builder, World(builder, wire::CreateSkeleton(
                                                   builder, builder.CreateVector(long_name)))),
              ErrorCode::kLimitExceeded, "WorldInfo.skeleton.joints.name", 0);
}

TEST(Decode, LimitsTheNumberOfTables) {
  // 16 MB of offsets to one item would decode to a much larger message.
  FlatBufferBuilder builder;
  const std::vector items(4'000'000, wire::CreateRequestItem(builder, 1, 1));
  const auto payload =
      Finished(builder, wire::CreateRequest(builder, 1, 1, builder.CreateVector(items)));
  ASSERT_LE(payload.size(), kMaxBulkBytes);
  ExpectError(MessageType::kRequest, payload, ErrorCode::kMalformed, "Request");

  builder.Reset();
  const std::vector joints(200'000, wire::CreateJoint(builder, builder.CreateString("j")));
  const auto world = Finished(
      builder, World(builder, wire::CreateSkeleton(builder, builder.CreateVector(joints))));
  ASSERT_LE(world.size(), kMaxControlBytes);
  ExpectError(MessageType::kWorldInfo, world, ErrorCode::kMalformed, "WorldInfo");
}

TEST(Decode, ChecksTheSizesOfBatches) {
  FlatBufferBuilder builder;
  const auto batch = [&](std::size_t avatars, std::size_t flags, std::size_t bytes, int mode) {
    builder.Clear();
    const auto poses = builder.CreateVector(std::vector<std::uint8_t>(bytes));
    const auto flag_list = builder.CreateVector(std::vector<std::uint8_t>(flags));
    const auto avatar_list = builder.CreateVector(std::vector<std::uint32_t>(avatars, 1));
    return Finished(builder, wire::CreatePoseBatch(builder, 1, 0, 0, 1, 1, 0.0,
                                                   static_cast<wire::PoseMode>(mode), 2,
                                                   avatar_list, flag_list, poses));
  };
  const auto type = MessageType::kPoseBatch;
  EXPECT_TRUE(DecodeMessage({type, batch(3, 3, 3 * 24, 1)}));
  EXPECT_TRUE(DecodeMessage({type, batch(3, 3, 3 * 44, 0)}));
  ExpectError(type, batch(3, 2, 3 * 24, 1), ErrorCode::kShapeMismatch, "PoseBatch.flags");
  ExpectError(type, batch(3, 3, 3 * 24 - 1, 1), ErrorCode::kShapeMismatch, "PoseBatch.poses");
  ExpectError(type, batch(3, 3, 3 * 24, 0), ErrorCode::kShapeMismatch, "PoseBatch.poses");
  ExpectError(type, batch(3, 3, 3 * 24, 2), ErrorCode::kUnsupported, "PoseBatch.mode");
  ExpectError(type, batch(3, 3, 3 * 24, 9), ErrorCode::kMalformed, "PoseBatch.mode");
  ExpectError(type, batch(kMaxItems + 1, 3, 0, 1), ErrorCode::kLimitExceeded, "PoseBatch.avatars");
}

TEST(Decode, AcceptsBatchesWithoutLists) {
  // Batches without lists are empty.
  FlatBufferBuilder builder;
  wire::PoseBatchBuilder batch(builder);
  batch.add_world(1);
  batch.add_joint_count(31);
  const auto message = DecodeMessage({MessageType::kPoseBatch, Finished(builder, batch.Finish())});
  ASSERT_TRUE(message) << Describe(message.error());
  EXPECT_TRUE(std::get<PoseBatch>(*message).avatars.empty());
}

}  // namespace
}  // namespace stridewire::protocol
