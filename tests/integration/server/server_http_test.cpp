// What the HTTP port serves besides streams: the viewer's files, info.json.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/asio.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "scratch_folder.h"
#include "test_server.h"

namespace stridewire {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace fs = std::filesystem;
namespace http = boost::beast::http;
using server::ViewerFiles;
using testing::HasSubstr;

// One connection, one request after the other.
class HttpClient {
 public:
  explicit HttpClient(std::uint16_t port) : socket_(context_) {
    socket_.connect({asio::ip::address_v4::loopback(), port});
  }

  http::response<http::string_body> Ask(const std::string& target,
                                        http::verb method = http::verb::get,
                                        const std::string& if_none_match = "") {
    http::request<http::empty_body> request(method, target, 11);
    request.set(http::field::host, "localhost");
    if (!if_none_match.empty()) request.set(http::field::if_none_match, if_none_match);
    http::write(socket_, request);
    http::response_parser<http::string_body> parser;
    parser.skip(method == http::verb::head);
    parser.body_limit(std::uint64_t{1} << 30);
    http::read(socket_, buffer_, parser);
    return parser.release();
  }

 private:
  asio::io_context context_;
  asio::ip::tcp::socket socket_;
  beast::flat_buffer buffer_;
};

void Write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

class ServerHttp : public testing::Test {
 protected:
  void SetUp() override {
    Write(root / "index.html", "<!doctype html><title>viewer</title>");
    Write(root / "assets/viewer-0123.js", std::string(300'000, 'x'));
    Write(root / "assets/viewer-4567.css", "body{}");
    Write(root / "robots.txt", "User-agent: *\n");
    Write(root / ".hidden", "secret");
    Write(root / ".git/config", "secret");
    Write(folder.path() / "outside.txt", "secret");
    fs::create_symlink(folder.path() / "outside.txt", root / "link.txt");
    fs::create_directory_symlink(folder.path(), root / "up");
  }

  test::ScratchFolder folder;
  fs::path root = fs::path(folder.path()) / "viewer";
};

TEST_F(ServerHttp, ServesTheViewersFiles) {
  auto viewer = ViewerFiles::Read(root.string());
  ASSERT_TRUE(viewer) << Describe(viewer.error());
  EXPECT_EQ(viewer->count(), 4u);
  TestServer server(TestConfig(), *std::move(viewer));
  HttpClient client(server.http_port());

  const auto page = client.Ask("/");
  EXPECT_EQ(page.result_int(), 200u);
  EXPECT_EQ(page.body(), "<!doctype html><title>viewer</title>");
  EXPECT_EQ(page[http::field::content_type], "text/html; charset=utf-8");
  EXPECT_EQ(page[http::field::cache_control], "no-cache");
  const std::string policy(page["Content-Security-Policy"]);
  EXPECT_THAT(policy, HasSubstr("default-src 'self'"));
  EXPECT_THAT(policy, HasSubstr("frame-ancestors 'none'"));
  EXPECT_THAT(policy, testing::Not(HasSubstr("unsafe")));
  EXPECT_EQ(page["X-Content-Type-Options"], "nosniff");
  EXPECT_EQ(page["Referrer-Policy"], "no-referrer");
  EXPECT_EQ(client.Ask("/index.html?x=1").body(), page.body());

  const auto script = client.Ask("/assets/viewer-0123.js");
  EXPECT_EQ(script.body().size(), 300'000u);
  EXPECT_EQ(script[http::field::content_type], "text/javascript; charset=utf-8");
  EXPECT_EQ(script[http::field::cache_control], "public, max-age=31536000, immutable");
  EXPECT_EQ(script["X-Content-Type-Options"], "nosniff");
  EXPECT_EQ(client.Ask("/assets/viewer-4567.css")[http::field::content_type],
            "text/css; charset=utf-8");
  EXPECT_EQ(client.Ask("/robots.txt")[http::field::cache_control], "no-cache");
  EXPECT_EQ(client.Ask("/", http::verb::post).result_int(), 405u);
}

TEST_F(ServerHttp, SendsAFileOnceToWhoKeepsIt) {
  TestServer server(TestConfig(), ViewerFiles::Read(root.string()).value());
  HttpClient client(server.http_port());
  const auto first = client.Ask("/");
  const std::string tag(first[http::field::etag]);
  ASSERT_GE(tag.size(), 10u);
  for (const std::string& known : {tag, "W/" + tag, "\"other\", " + tag, std::string("*")}) {
    const auto again = client.Ask("/", http::verb::get, known);
    EXPECT_EQ(again.result_int(), 304u) << known;
    EXPECT_EQ(again.body(), "");
    EXPECT_EQ(again[http::field::etag], tag);
    EXPECT_EQ(again[http::field::cache_control], "no-cache");
  }
  EXPECT_EQ(client.Ask("/", http::verb::get, "\"other\"").body(), first.body());
  // The connection is as good as before, and other files have other tags.
  EXPECT_NE(client.Ask("/robots.txt")[http::field::etag], tag);

  const auto head = client.Ask("/assets/viewer-0123.js", http::verb::head);
  EXPECT_EQ(head.result_int(), 200u);
  EXPECT_EQ(head[http::field::content_length], "300000");
  EXPECT_EQ(head.body(), "");
  EXPECT_EQ(client.Ask("/healthz").body(), "ok\n");
}

TEST_F(ServerHttp, ServesNothingElse) {
  TestServer server(TestConfig(), ViewerFiles::Read(root.string()).value());
  HttpClient client(server.http_port());
  // One that comes into being later is not there either.
  Write(root / "late.txt", "secret");
  for (const char* path : {"/../outside.txt",
                           "/assets/../../outside.txt",
                           "/..%2foutside.txt",
                           "/%2e%2e/outside.txt",
                           "/assets/..\\..\\outside.txt",
                           "//etc/passwd",
                           "/./index.html",
                           "/.hidden",
                           "/.git/config",
                           "/link.txt",
                           "/up/outside.txt",
                           "/late.txt",
                           "/assets",
                           "/assets/",
                           "/viewer/index.html",
                           "/index.html%00.js",
                           "/INDEX.HTML",
                           "/stream/",
                           "index.html",
                           "http://localhost/index.html"}) {
    const auto answer = client.Ask(path);
    EXPECT_EQ(answer.result_int(), 404u) << path;
    EXPECT_THAT(answer.body(), testing::Not(HasSubstr("secret"))) << path;
  }
}

TEST_F(ServerHttp, SaysWhatIsWrongWithAFolder) {
  const auto says = [](const std::string& path, const std::string& what, ErrorCode code) {
    const auto viewer = ViewerFiles::Find(path);
    ASSERT_FALSE(viewer) << path;
    EXPECT_EQ(viewer.error().code, code);
    EXPECT_THAT(Describe(viewer.error()),
                testing::AllOf(HasSubstr("viewer_dir: "), HasSubstr(what)));
  };
  says((fs::path(folder.path()) / "none").string(), "no index.html", ErrorCode::kNotFound);
  says((root / "index.html").string(), "no index.html", ErrorCode::kNotFound);
  Write(root / "a name.js", "");
  says(root.string(), "a name.js", ErrorCode::kInvalidArgument);
  fs::remove(root / "a name.js");
  for (std::size_t i = 0; i < ViewerFiles::kMaxFiles; ++i) {
    Write(root / "many" / (std::to_string(i) + ".txt"), "");
  }
  says(root.string(), "more files", ErrorCode::kLimitExceeded);
  fs::remove_all(root / "many");
  Write(root / "huge.bin", "");
  fs::resize_file(root / "huge.bin", ViewerFiles::kMaxBytes);
  says(root.string(), "more bytes", ErrorCode::kLimitExceeded);
}

TEST_F(ServerHttp, WithoutAViewerSaysHowToBuildIt) {
  TestServer server;
  HttpClient client(server.http_port());
  const auto page = client.Ask("/");
  EXPECT_EQ(page.result_int(), 200u);
  EXPECT_EQ(page[http::field::content_type], "text/html; charset=utf-8");
  EXPECT_THAT(page.body(), HasSubstr("STRIDEWIRE_BUILD_VIEWER=ON"));
  EXPECT_EQ(client.Ask("/index.html").result_int(), 404u);
}

TEST_F(ServerHttp, TellsWhatThereIs) {
  server::Config config = TestConfig();
  config.worlds["hall"] = {};
  config.worlds["plaza"] = {};
  TestServer server(config);
  RawClient controller = server.Connect();
  ASSERT_TRUE(controller.SayHello());
  const auto plaza = controller.Join("plaza");
  const auto own = controller.Join("own");
  ASSERT_TRUE(plaza && own);
  ASSERT_TRUE(controller.Spawn(plaza->world, {{}, {}, {}}));
  HttpClient client(server.http_port());
  const auto answer = client.Ask("/info.json");
  EXPECT_EQ(answer[http::field::content_type], "application/json");
  EXPECT_EQ(answer[http::field::cache_control], "no-store");
  const auto info = nlohmann::json::parse(answer.body());
  EXPECT_EQ(info["tick_hz"], 60.0);
  EXPECT_EQ(info["shards"], 2);
  EXPECT_EQ(info["listen"], "127.0.0.1:" + std::to_string(server.port()));
  EXPECT_EQ(info["open_worlds"], true);
  EXPECT_FALSE(info["version"].get<std::string>().empty());
  EXPECT_EQ(info["worlds"], nlohmann::json::parse(R"([
    {"name": "hall", "library": "toy", "avatars": 0},
    {"name": "own", "library": "toy", "avatars": 0},
    {"name": "plaza", "library": "toy", "avatars": 3}])"));
}

TEST_F(ServerHttp, TellsWhoWantsNoWebSocketWhatIsThere) {
  TestServer server;
  HttpClient client(server.http_port());
  const auto answer = client.Ask("/stream");
  EXPECT_EQ(answer.result_int(), 426u);
  EXPECT_EQ(answer[http::field::upgrade], "websocket");
}

}  // namespace
}  // namespace stridewire
