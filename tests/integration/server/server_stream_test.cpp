// Sessions over WebSocket: the same behaviour as over TCP, and errors that only a WebSocket can
// have.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <random>

#include "test_server.h"
#include "web_client.h"

namespace stridewire {
namespace {

using namespace std::chrono_literals;
using protocol::ErrorNotice;
using protocol::EventType;
using protocol::PoseMode;
using protocol::StatusCode;
using server::Limit;
using server::ThreadMetrics;

std::vector<std::byte> Encoded(const protocol::Message& message) {
  std::vector<std::byte> frame;
  EXPECT_TRUE(protocol::Encoder().Encode(message, frame));
  return frame;
}

std::vector<std::byte> Hello() { return Encoded(protocol::Hello{.client_name = "test"}); }

// ---- same behaviour as over TCP

// The messages of a session, without the members that differ between sessions.
struct Heard {
  protocol::Welcome welcome;
  protocol::WorldInfo world;
  std::vector<protocol::Reply> replies;
  std::vector<std::vector<protocol::Event>> events;  // by avatar
  StatusCode end{};
};

void Converse(RawClient& client, const std::string& world_name, Heard& heard) {
  const auto collect = [&](const protocol::Message& message) {
    const auto* message_events = std::get_if<protocol::Events>(&message);
    if (message_events == nullptr) return;
    for (protocol::Event event : message_events->events) {
      event.tick = 0;  // depends on timing
      event.time_s = 0.0;
      heard.events.resize(std::max<std::size_t>(heard.events.size(), event.avatar + 1));
      heard.events[event.avatar].push_back(event);
    }
  };
  const auto welcome = client.SayHello();
  ASSERT_TRUE(welcome);
  heard.welcome = *welcome;
  heard.welcome.session = 0;
  heard.welcome.resume_token.clear();
  const auto world = client.Join(world_name);
  ASSERT_TRUE(world);
  heard.world = *world;
  heard.world.world = 0;
  heard.world.tick = 0;
  heard.world.name.clear();
  const auto reply = [&](const auto& command) {
    client.Send(command);
    auto answer = client.Await<protocol::Reply>(collect);
    ASSERT_TRUE(answer);
    heard.replies.push_back(*answer);
  };
  reply(protocol::Spawn{.seq = client.NextSeq(),
                        .world = world->world,
                        .items = {{.avatar = 1},
                                  {.avatar = 2, .start = {{1e9, 0, 0}, 0}},
                                  {.avatar = 3, .start = {{3, 0, 1}, 0.5}}}});
  std::vector<protocol::RequestItem> items = Steps(1, 3, 0.4);
  items.push_back({.avatar = 9, .request_id = 77, .movement = protocol::StandMovement{1.0}});
  for (protocol::RequestItem item : Steps(3, 2, 0.3)) items.push_back(item);
  reply(protocol::Request{.seq = client.NextSeq(), .world = world->world, .items = items});
  reply(protocol::LeaveWorld{.seq = client.NextSeq(), .world = world->world + 1});
  const auto finished = [&](std::size_t avatar) {
    return heard.events.size() <= avatar
               ? 0
               : std::ranges::count(heard.events[avatar], EventType::kFinished,
                                    &protocol::Event::type);
  };
  // Each avatar makes one more step to come to a stand.
  while (finished(1) < 4 || finished(3) < 3) {
    const auto message = client.Receive();
    ASSERT_TRUE(message);
    collect(*message);
  }
  for (auto& events : heard.events) {
    // The time between spawning and the request depends on timing.
    std::erase_if(events,
                  [](const protocol::Event& event) { return event.type == EventType::kIdle; });
  }
  // A command with a wrong sequence number closes the connection.
  client.Send(protocol::LeaveWorld{.seq = client.NextSeq() + 5, .world = world->world});
  const auto notice = client.Await<ErrorNotice>();
  ASSERT_TRUE(notice);
  heard.end = notice->code;
  EXPECT_TRUE(client.AwaitClose());
}

TEST(ServerStream, SendsTheSameMessagesAsTcp) {
  TestServer server;
  Heard tcp;
  Heard web;
  RawClient tcp_client = server.Connect();
  Converse(tcp_client, "a", tcp);
  ASSERT_FALSE(HasFatalFailure());
  WebClient web_client(server.http_port());
  ASSERT_EQ(web_client.upgrade_status(), 101u);
  Converse(web_client, "b", web);
  ASSERT_FALSE(HasFatalFailure());
  EXPECT_EQ(tcp.welcome, web.welcome);
  EXPECT_EQ(tcp.world, web.world);
  EXPECT_EQ(tcp.replies, web.replies);
  EXPECT_EQ(tcp.events, web.events);
  EXPECT_EQ(web.end, StatusCode::kBadSequence);
  EXPECT_EQ(tcp.end, web.end);
  EXPECT_EQ(web_client.close_code(), 1008u);
}

// The bytes of the poses of one tick and shard.
using PosesByTick = std::map<std::pair<std::uint64_t, int>, std::vector<std::byte>>;

PosesByTick CollectPoses(RawClient& client, std::size_t count) {
  PosesByTick poses;
  while (poses.size() < count) {
    const auto batch = client.Await<protocol::PoseBatch>();
    if (!batch) break;
    poses[{batch->info.tick, batch->info.shard}].assign(batch->poses.begin(), batch->poses.end());
  }
  return poses;
}

TEST(ServerStream, SendsTheSamePosesAsTcp) {
  TestServer server;
  RawClient controller = server.Connect();
  ASSERT_TRUE(controller.SayHello());
  const auto world = controller.Join("w");
  ASSERT_TRUE(world);
  ASSERT_TRUE(controller.Spawn(world->world, {{.avatar = 1}, {.avatar = 2}, {.avatar = 3}}));
  ASSERT_TRUE(controller.Request(world->world, Steps(1, 50, 0.5)));
  ASSERT_TRUE(controller.Request(world->world, Steps(2, 50, 0.3)));
  for (const PoseMode mode : {PoseMode::kFull, PoseMode::kQuantised}) {
    RawClient tcp = server.Connect();
    WebClient web(server.http_port());
    for (RawClient* observer : {&tcp, static_cast<RawClient*>(&web)}) {
      ASSERT_TRUE(observer->SayHello());
      ASSERT_TRUE(observer->Join("w", protocol::Role::kObserver));
      ASSERT_TRUE(observer->Observe(world->world, 1, mode));
    }
    PosesByTick of_web;
    std::thread reader([&] { of_web = CollectPoses(web, 120); });
    const PosesByTick of_tcp = CollectPoses(tcp, 120);
    reader.join();
    std::size_t same = 0;
    for (const auto& [tick, poses] : of_tcp) {
      const auto it = of_web.find(tick);
      if (it == of_web.end()) continue;
      EXPECT_EQ(it->second, poses) << "tick " << tick.first << " shard " << tick.second;
      EXPECT_FALSE(poses.empty());
      ++same;
    }
    EXPECT_GE(same, 40u);
  }
}

TEST(ServerStream, SendsSeveralMovementsPerMessage) {
  TestServer server(TestConfig(2));
  RawClient controller = server.Connect();
  ASSERT_TRUE(controller.SayHello());
  const auto world = controller.Join("w");
  ASSERT_TRUE(world);
  ASSERT_TRUE(controller.Spawn(world->world, {{.avatar = 1}, {.avatar = 2}, {.avatar = 3}}));
  WebClient web(server.http_port());
  ASSERT_TRUE(web.SayHello());
  ASSERT_TRUE(web.Join("w", protocol::Role::kObserver));
  ASSERT_TRUE(web.Observe(world->world, 1, PoseMode::kMovement, false, 2));
  std::map<std::uint16_t, std::uint64_t> last_steps;
  int joined = 0;
  for (int i = 0; i < 200; ++i) {
    const auto movements = web.Await<protocol::Movements>();
    ASSERT_TRUE(movements);
    joined += web.is_within_message() ? 1 : 0;
    if (movements->states) continue;
    const auto [last, is_new] = last_steps.try_emplace(movements->shard, movements->step - 1);
    EXPECT_EQ(movements->step, last->second + 1);
    last->second = movements->step;
  }
  EXPECT_EQ(last_steps.size(), 2u);
  EXPECT_GT(joined, 0);
}

TEST(ServerStream, DoesNotCompress) {
  TestServer server;
  WebClient client(server.http_port());
  EXPECT_EQ(client.upgrade_status(), 101u);
  EXPECT_EQ(client.extensions(), "");
}

// ---- resuming

TEST(ServerStream, ResumesOverEitherTransport) {
  TestServer server;
  auto connect = [&](bool is_web) -> std::unique_ptr<RawClient> {
    if (is_web) return std::make_unique<WebClient>(server.http_port());
    return std::make_unique<RawClient>(server.Connect());
  };
  for (const auto& [first_web, second_web] :
       {std::pair(true, true), std::pair(true, false), std::pair(false, true)}) {
    SCOPED_TRACE(testing::Message() << "from " << first_web << " to " << second_web);
    auto first = connect(first_web);
    const auto welcome = first->SayHello();
    ASSERT_TRUE(welcome);
    const auto world = first->Join("w");
    ASSERT_TRUE(world);
    ASSERT_TRUE(first->Spawn(world->world, {{}}));
    ASSERT_TRUE(first->Observe(world->world, 1, PoseMode::kFull));
    ASSERT_TRUE(first->Await<protocol::PoseBatch>());
    ASSERT_TRUE(Eventually([&] {
      return server.metrics().Sum(&ThreadMetrics::sessions_websocket) == (first_web ? 1u : 0u);
    }));
    first->Abort();
    ASSERT_TRUE(
        Eventually([&] { return server.metrics().Sum(&ThreadMetrics::sessions_detached) == 1; }));

    auto second = connect(second_web);
    const auto back = second->SayHello(welcome->resume_token);
    ASSERT_TRUE(back);
    EXPECT_TRUE(back->resumed);
    EXPECT_EQ(back->session, welcome->session);
    const auto info = second->Await<protocol::WorldInfo>();
    ASSERT_TRUE(info);
    EXPECT_EQ(info->world, world->world);
    EXPECT_TRUE(second->Await<protocol::PoseBatch>());
    second->Send(protocol::Goodbye{});
    EXPECT_TRUE(second->AwaitClose());
    ASSERT_TRUE(Eventually([&] {
      return server.metrics().Sum(&ThreadMetrics::sessions_attached) == 0 &&
             server.metrics().Sum(&ThreadMetrics::sessions_detached) == 0;
    }));
  }
}

TEST(ServerStream, ReplacesAHalfOpenConnection) {
  TestServer server;
  WebClient old(server.http_port());
  const auto welcome = old.SayHello();
  ASSERT_TRUE(welcome);
  RawClient fresh = server.Connect();
  const auto back = fresh.SayHello(welcome->resume_token);
  ASSERT_TRUE(back);
  EXPECT_TRUE(back->resumed);
  const auto notice = old.Await<ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kReplaced);
  EXPECT_TRUE(old.AwaitClose());
  EXPECT_EQ(old.close_code(), 1008u);
}

TEST(ServerStream, KeepsTheSessionAfterAClosedWebSocketButNotAfterGoodbye) {
  TestServer server;
  WebClient polite(server.http_port());
  ASSERT_TRUE(polite.SayHello());
  polite.Send(protocol::Goodbye{});
  EXPECT_TRUE(polite.AwaitClose());
  EXPECT_EQ(polite.close_code(), 1000u);
  EXPECT_TRUE(
      Eventually([&] { return server.metrics().Sum(&ThreadMetrics::sessions_ended) == 1; }));

  // A page that is reloaded closes its WebSocket and resumes a moment later.
  WebClient closed(server.http_port());
  const auto welcome = closed.SayHello();
  ASSERT_TRUE(welcome);
  closed.CloseWebSocket();
  ASSERT_TRUE(
      Eventually([&] { return server.metrics().Sum(&ThreadMetrics::sessions_detached) == 1; }));
  WebClient again(server.http_port());
  EXPECT_TRUE(again.SayHello(welcome->resume_token)->resumed);
}

TEST(ServerStream, ReportsAShutdown) {
  std::optional<TestServer> server(std::in_place);
  WebClient greeted(server->http_port());
  ASSERT_TRUE(greeted.SayHello());
  WebClient silent(server->http_port());
  std::thread drain([&] { EXPECT_TRUE(server->DrainAndJoin()); });
  const auto notice = greeted.Await<ErrorNotice>();
  EXPECT_TRUE(notice && notice->code == StatusCode::kShuttingDown);
  EXPECT_TRUE(greeted.AwaitClose());
  EXPECT_EQ(greeted.close_code(), 1001u);
  drain.join();
  // The server does not wait for a client without a session. The client usually receives a notice,
  // and its connection is closed in any case.
  server.reset();
  EXPECT_TRUE(silent.AwaitClose());
}

// ---- invalid messages

struct BadMessage {
  const char* name;
  std::function<void(WebClient&)> send;
  StatusCode code;
  unsigned close_code;
};

std::vector<BadMessage> BadMessages() {
  const auto bytes = [](std::vector<std::byte> message) {
    return [message = std::move(message)](WebClient& client) { client.SendBytes(message); };
  };
  const std::vector<std::byte> ping = Encoded(protocol::Ping{.nonce = 1});
  std::vector<std::byte> torn = ping;
  torn.resize(ping.size() - 8);
  std::vector<std::byte> twice = ping;
  twice.insert(twice.end(), ping.begin(), ping.end());
  std::vector<std::byte> trailing = ping;
  trailing.resize(ping.size() + 1);
  std::vector<std::byte> garbage(4096);
  std::mt19937 random(20261121);
  for (std::byte& byte : garbage) byte = static_cast<std::byte>(random());
  std::vector<std::byte> huge = ping;
  huge[11] = std::byte{0x7f};  // the header announces 2 GiB
  return {
      {"a text", [](WebClient& client) { client.SendText("hello"); }, StatusCode::kUnsupported,
       1003},
      {"an empty text", [](WebClient& client) { client.SendText(""); }, StatusCode::kUnsupported,
       1003},
      {"an empty message", bytes({}), StatusCode::kMalformed, 1002},
      {"half a header", bytes(std::vector<std::byte>(ping.begin(), ping.begin() + 8)),
       StatusCode::kMalformed, 1002},
      {"part of a frame", bytes(torn), StatusCode::kMalformed, 1002},
      {"two frames", bytes(twice), StatusCode::kMalformed, 1002},
      {"a frame and a byte", bytes(trailing), StatusCode::kMalformed, 1002},
      {"garbage", bytes(garbage), StatusCode::kMalformed, 1002},
      {"a frame that announces too much", bytes(huge), StatusCode::kLimitReached, 1009},
      {"a frame in two messages",
       [ping](WebClient& client) {
         client.SendBytes(std::span(ping).first(20));
         client.SendBytes(std::span(ping).subspan(20));
       },
       StatusCode::kMalformed, 1002},
      {"fragments without an end",
       [ping](WebClient& client) {
         client.SendFragment(ping, false);
         for (int i = 0; i < 100; ++i) client.SendFragment(ping, false);
       },
       StatusCode::kMalformed, 1002},
  };
}

TEST(ServerStream, RejectsMessagesThatAreNotOneFrame) {
  TestServer server;
  std::uint64_t errors = 0;
  for (const bool is_greeted : {false, true}) {
    for (const BadMessage& bad : BadMessages()) {
      SCOPED_TRACE(testing::Message() << bad.name << (is_greeted ? "" : " before Hello"));
      WebClient client(server.http_port());
      ASSERT_TRUE(!is_greeted || client.SayHello());
      bad.send(client);
      const auto notice = client.Await<ErrorNotice>();
      ASSERT_TRUE(notice);
      EXPECT_TRUE(notice->fatal);
      EXPECT_EQ(notice->code, bad.code) << notice->text;
      EXPECT_TRUE(client.AwaitClose());
      EXPECT_EQ(client.close_code(), bad.close_code);
      EXPECT_EQ(server.metrics().Sum(&ThreadMetrics::protocol_errors), ++errors);
    }
  }
  WebClient client(server.http_port());
  EXPECT_TRUE(client.SayHello());
}

TEST(ServerStream, AcceptsAFrameInFragments) {
  TestServer server;
  WebClient client(server.http_port());
  const std::vector<std::byte> hello = Hello();
  for (std::size_t at = 0; at < hello.size(); at += 7) {
    client.SendFragment(std::span(hello).subspan(at, std::min<std::size_t>(7, hello.size() - at)),
                        false);
  }
  client.SendFragment({}, true);
  EXPECT_TRUE(client.Await<protocol::Welcome>());
  // A frame that is larger than the read buffer.
  const auto world = client.Join("w");
  ASSERT_TRUE(world);
  ASSERT_TRUE(client.Spawn(world->world, {{.avatar = 1}}));
  const std::vector<std::byte> request = Encoded(protocol::Request{
      .seq = client.NextSeq(), .world = world->world, .items = Steps(1, 3000, 0.5)});
  ASSERT_GT(request.size(), std::size_t{64} << 10);
  client.SendFragment(std::span(request).first(50'000), false);
  client.SendFragment(std::span(request).subspan(50'000), true);
  const auto reply = client.Await<protocol::Reply>();
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->accepted, 256u);  // the size of the queue
}

TEST(ServerStream, ClosesOnInvalidWebSocketFrames) {
  TestServer server;
  // An unmasked frame, a reserved opcode, a ping that is too long, and a reserved bit.
  const std::vector<std::vector<unsigned char>> frames = {{0x82, 0x01, 0x00},
                                                          {0x83, 0x80, 0, 0, 0, 0},
                                                          {0x89, 0xfe, 0x01, 0x00, 0, 0, 0, 0},
                                                          {0xc2, 0x80, 0, 0, 0, 0}};
  for (const auto& frame : frames) {
    WebClient client(server.http_port());
    ASSERT_TRUE(client.SayHello());
    client.SendRaw(std::as_bytes(std::span(frame)));
    EXPECT_TRUE(client.AwaitClose());
    EXPECT_EQ(client.close_code(), 1002u);
  }
  EXPECT_TRUE(Eventually(
      [&] { return server.metrics().Sum(&ThreadMetrics::protocol_errors) == frames.size(); }));
}

TEST(ServerStream, RejectsLargeFramesBeforeHello) {
  TestServer server;
  WebClient client(server.http_port());
  const std::vector<std::byte> frame =
      Encoded(protocol::Request{.seq = 1, .world = 1, .items = Steps(1, 2000, 0.5)});
  client.SendBytes(frame);
  const auto notice = client.Await<ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kLimitReached);
  EXPECT_TRUE(client.AwaitClose());
  EXPECT_EQ(client.close_code(), 1009u);
  EXPECT_EQ(server.metrics().Sum(Limit::kFrameBytes), 1u);
}

TEST(ServerStream, RequiresAValidUpgrade) {
  TestServer server;
  // A request without an upgrade gets status 426; see also stridewired_test.
  WebClient elsewhere(server.http_port(), {.path = "/metrics"});
  EXPECT_EQ(elsewhere.upgrade_status(), 200u);  // a page, not a stream
  WebClient nowhere(server.http_port(), {.path = "/streams"});
  EXPECT_EQ(nowhere.upgrade_status(), 404u);
}

// ---- origins

TEST(ServerStream, AllowsItsOwnAndListedOrigins) {
  server::Config config = TestConfig();
  config.allowed_origins = {"https://example.org", "http://localhost:8080"};
  TestServer server(config);
  const std::string own = "127.0.0.1:" + std::to_string(server.http_port());
  struct Case {
    std::string host;
    std::string origin;
    bool is_taken;
  };
  const std::vector<Case> cases = {
      {"", "", true},
      {"", "http://" + own, true},
      {"localhost:9", "http://localhost:9", true},
      {"", "https://example.org", true},
      {"", "http://localhost:8080", true},
      {"", "http://example.org", false},
      {"", "https://evil.example", false},
      {"", "null", false},
      {"", "http://127.0.0.1:1", false},
      {"", "file://", false},
      // A name that resolves to this machine and could be controlled by the page (DNS rebinding).
      {"rebound.example:80", "http://rebound.example", false},
  };
  std::uint64_t refused = 0;
  for (const Case& c : cases) {
    SCOPED_TRACE(c.origin + " at " + c.host);
    WebClient client(server.http_port(), {.host = c.host, .origin = c.origin});
    EXPECT_EQ(client.upgrade_status(), c.is_taken ? 101u : 403u);
    if (c.is_taken) {
      EXPECT_TRUE(client.SayHello());
    } else {
      ++refused;
    }
  }
  EXPECT_EQ(server.metrics().Sum(&ThreadMetrics::origins_refused), refused);
}

// ---- timeouts and limits

TEST(ServerStream, ClosesAHandshakeAfterItsTimeout) {
  server::Config config = TestConfig();
  config.limits.handshake_timeout_s = 0.1;
  TestServer server(config);
  WebClient client(server.http_port());
  // An incomplete Hello does not count.
  const std::vector<std::byte> hello = Hello();
  client.SendFragment(std::span(hello).first(24), false);
  const auto notice = client.Await<ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kTimeout);
  EXPECT_TRUE(client.AwaitClose());
  EXPECT_EQ(server.metrics().Sum(Limit::kHandshakeTimeout), 1u);
}

TEST(ServerStream, AnswersWebSocketPingsAndCountsThemAsActivity) {
  server::Config config = TestConfig();
  config.limits.idle_timeout_s = 1.0;
  TestServer server(config);
  WebClient client(server.http_port());
  ASSERT_TRUE(client.SayHello());
  for (int i = 0; i < 8; ++i) {
    client.Ping();
    EXPECT_FALSE(client.Receive(250ms));
    ASSERT_FALSE(client.is_closed());
  }
  EXPECT_EQ(client.pongs(), 8);
  EXPECT_EQ(server.metrics().Sum(Limit::kIdleTimeout), 0u);
  // Afterwards the client reads nothing, so it does not answer the pings of the server either.
  EXPECT_TRUE(Eventually([&] { return server.metrics().Sum(Limit::kIdleTimeout) == 1; }));
  const auto notice = client.Await<ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kTimeout);
  EXPECT_EQ(server.metrics().Sum(Limit::kIdleTimeout), 1u);
}

// Like a hidden page, whose browser answers pings although its program sends nothing.
TEST(ServerStream, PingsASilentClientSoThatItStaysConnected) {
  server::Config config = TestConfig();
  config.limits.idle_timeout_s = 0.6;
  TestServer server(config);
  WebClient client(server.http_port());
  ASSERT_TRUE(client.SayHello());
  EXPECT_FALSE(client.Receive(2500ms));
  ASSERT_FALSE(client.is_closed());
  EXPECT_GE(client.pings(), 3);
  client.Send(protocol::Ping{.nonce = 7});
  const auto pong = client.Await<protocol::Pong>();
  ASSERT_TRUE(pong);
  EXPECT_EQ(pong->nonce, 7u);
  EXPECT_EQ(server.metrics().Sum(Limit::kIdleTimeout), 0u);
}

TEST(ServerStream, CountsTheAddressesThatTrustedProxiesForward) {
  for (const bool is_trusted : {true, false}) {
    SCOPED_TRACE(is_trusted);
    server::Config config = TestConfig();
    config.limits.max_sessions_per_address = 1;
    if (is_trusted) config.trusted_proxies = {"10.0.0.0/8", "127.0.0.1"};
    TestServer server(config);
    std::vector<std::unique_ptr<WebClient>> clients;
    const auto is_welcome = [&](const std::string& forwarded_for) {
      clients.push_back(std::make_unique<WebClient>(
          server.http_port(), WebClient::Options{.forwarded_for = forwarded_for}));
      clients.back()->Send(protocol::Hello{.client_name = "test"});
      const auto answer = clients.back()->Receive();
      if (!answer) return false;
      if (const auto* notice = std::get_if<ErrorNotice>(&*answer)) {
        EXPECT_EQ(notice->text, "too many sessions from this address (max_sessions_per_address)");
      }
      return std::holds_alternative<protocol::Welcome>(*answer);
    };
    EXPECT_TRUE(is_welcome("203.0.113.1"));
    EXPECT_EQ(is_welcome("203.0.113.2, 10.0.0.7"), is_trusted);
    EXPECT_FALSE(is_welcome("203.0.113.9, 203.0.113.1"));
    EXPECT_EQ(is_welcome("203.0.113.1, 203.0.113.3"), is_trusted);
  }
}

TEST(ServerStream, DoesNotCountAgainstHttpConnections) {
  server::Config config = TestConfig();
  config.limits.max_http_connections = 2;
  config.limits.max_sessions = 5;
  TestServer server(config);
  std::vector<std::unique_ptr<WebClient>> clients;
  for (int i = 0; i < 5; ++i) {
    clients.push_back(std::make_unique<WebClient>(server.http_port()));
    ASSERT_EQ(clients.back()->upgrade_status(), 101u);
    ASSERT_TRUE(clients.back()->SayHello());
  }
  EXPECT_EQ(server.metrics().Sum(Limit::kHttpConnections), 0u);
  WebClient sixth(server.http_port());
  ASSERT_EQ(sixth.upgrade_status(), 101u);
  sixth.SendBytes(Hello());
  const auto notice = sixth.Await<ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kLimitReached);
  EXPECT_TRUE(sixth.AwaitClose());
  EXPECT_EQ(sixth.close_code(), 1013u);
  EXPECT_TRUE(
      Eventually([&] { return server.metrics().Sum(&ThreadMetrics::sessions_websocket) == 5; }));
  EXPECT_THAT(server.metrics().Text(),
              testing::HasSubstr("stridewire_sessions_attached{transport=\"websocket\"} 5"));
}

TEST(ServerStream, DropsOldPosesOfASlowReader) {
  server::Config config = TestConfig(1);
  config.limits.socket_send_buffer_bytes = 16 << 10;
  config.limits.observer_backlog_ticks = 2;
  TestServer server(config);
  RawClient controller = server.Connect();
  ASSERT_TRUE(controller.SayHello());
  const auto world = controller.Join("w");
  ASSERT_TRUE(world);
  ASSERT_TRUE(controller.Spawn(world->world, std::vector<protocol::SpawnItem>(400)));
  WebClient observer(server.http_port(), {.receive_buffer_bytes = 16 << 10});
  ASSERT_TRUE(observer.SayHello());
  ASSERT_TRUE(observer.Join("w", protocol::Role::kObserver));
  ASSERT_TRUE(observer.Observe(world->world, 1, PoseMode::kFull));
  const auto first = observer.Await<protocol::PoseBatch>();
  ASSERT_TRUE(first);
  const std::uint64_t first_tick = first->info.tick;

  // Does not read until much more was dropped than all buffers can contain.
  ASSERT_TRUE(
      Eventually([&] { return server.metrics().Sum(&ThreadMetrics::batches_dropped) > 60; }));
  controller.Send(protocol::Ping{.nonce = 1});
  const auto pong = controller.Await<protocol::Pong>();
  ASSERT_TRUE(pong);
  const std::uint64_t now = pong->tick;
  ASSERT_GT(now, first_tick + 60);

  // Then it receives the contents of the buffers, the backlog, and current poses.
  std::uint64_t last_tick = first_tick;
  std::uint64_t lost = 0;
  int stale = 0;
  std::optional<protocol::Lagging> lagging;
  while (last_tick < now) {
    const auto message = observer.Receive();
    ASSERT_TRUE(message);
    if (const auto* message_lagging = std::get_if<protocol::Lagging>(&*message))
      lagging = *message_lagging;
    const auto* batch = std::get_if<protocol::PoseBatch>(&*message);
    if (batch == nullptr) continue;
    EXPECT_GT(batch->info.tick, last_tick);
    lost += batch->info.tick - last_tick - 1;
    last_tick = batch->info.tick;
    if (last_tick < now) ++stale;
  }
  EXPECT_GE(lost, 40u);
  EXPECT_LT(stale, 40);
  // The first Lagging may be as old as the poses before it.
  while (!lagging || lagging->dropped_batches < 60) {
    const auto message = observer.Receive();
    ASSERT_TRUE(message);
    if (const auto* message_lagging = std::get_if<protocol::Lagging>(&*message))
      lagging = *message_lagging;
  }
  // The controller was not delayed.
  EXPECT_EQ(server.metrics().Sum(Limit::kWriteTimeout), 0u);
}

TEST(ServerStream, DisconnectsAReaderAfterTheWriteTimeout) {
  server::Config config = TestConfig(1);
  config.limits.socket_send_buffer_bytes = 16 << 10;
  config.limits.write_timeout_s = 0.3;
  TestServer server(config);
  WebClient observer(server.http_port(), {.receive_buffer_bytes = 16 << 10});
  ASSERT_TRUE(observer.SayHello());
  const auto world = observer.Join("w");
  ASSERT_TRUE(world);
  ASSERT_TRUE(observer.Spawn(world->world, std::vector<protocol::SpawnItem>(400)));
  ASSERT_TRUE(observer.Observe(world->world, 1, PoseMode::kFull));
  EXPECT_TRUE(Eventually([&] { return server.metrics().Sum(Limit::kWriteTimeout) == 1; }));
  EXPECT_TRUE(
      Eventually([&] { return server.metrics().Sum(&ThreadMetrics::sessions_detached) == 1; }));
}

TEST(ServerStream, SurvivesMutatedFrames) {
  const unsigned seed = std::random_device()();
  std::printf("seed %u\n", seed);
  std::mt19937 random(seed);
  TestServer server;
  const std::vector<std::vector<std::byte>> frames = {
      Encoded(protocol::JoinWorld{.seq = 1, .name = "w"}),
      Encoded(protocol::Spawn{.seq = 2, .world = 1, .items = {{.avatar = 1}, {.avatar = 2}}}),
      Encoded(protocol::Request{.seq = 3, .world = 1, .items = Steps(1, 4, 0.5)}),
      Encoded(protocol::Ping{.nonce = 1}),
  };
  for (int round = 0; round < 100; ++round) {
    WebClient client(server.http_port());
    ASSERT_TRUE(client.SayHello());
    for (const std::vector<std::byte>& frame : frames) {
      std::vector<std::byte> mutated = frame;
      const unsigned flips = random() % 3;
      for (unsigned i = 0; i < flips; ++i) {
        mutated[random() % mutated.size()] = static_cast<std::byte>(random());
      }
      // Send it as a message, or as raw bytes.
      if (random() % 4 == 0) {
        client.SendRaw(mutated);
      } else {
        client.SendBytes(mutated);
      }
    }
  }
  WebClient client(server.http_port());
  ASSERT_TRUE(client.SayHello());
  EXPECT_TRUE(client.Join("after"));
}

}  // namespace
}  // namespace stridewire
