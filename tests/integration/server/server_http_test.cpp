// The HTTP server: viewer files, info.json and library pages.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <boost/asio.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>
#include <tuple>

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

// A connection that sends one request after the other.
class HttpClient {
 public:
  explicit HttpClient(std::uint16_t port) : socket_(context_) {
    socket_.connect({asio::ip::address_v4::loopback(), port});
  }

  http::response<http::string_body> Request(const std::string& target,
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

TEST_F(ServerHttp, ServesViewerFiles) {
  auto viewer = ViewerFiles::Read(root.string());
  ASSERT_TRUE(viewer) << Describe(viewer.error());
  EXPECT_EQ(viewer->count(), 4u);
  TestServer server(TestConfig(), *std::move(viewer));
  HttpClient client(server.http_port());

  const auto page = client.Request("/");
  EXPECT_EQ(page.result_int(), 200u);
  EXPECT_EQ(page.body(), "<!doctype html><title>viewer</title>");
  EXPECT_EQ(page[http::field::content_type], "text/html; charset=utf-8");
  EXPECT_EQ(page[http::field::cache_control], "no-cache");
  const std::string policy(page["Content-Security-Policy"]);
  EXPECT_THAT(policy, HasSubstr("default-src 'self'"));
  EXPECT_THAT(policy, HasSubstr("frame-ancestors 'none'"));
  EXPECT_THAT(policy, HasSubstr("script-src 'self' 'wasm-unsafe-eval'"));
  EXPECT_THAT(policy, testing::Not(HasSubstr("'unsafe")));
  EXPECT_EQ(page["X-Content-Type-Options"], "nosniff");
  EXPECT_EQ(page["Referrer-Policy"], "no-referrer");
  EXPECT_EQ(client.Request("/index.html?x=1").body(), page.body());

  const auto script = client.Request("/assets/viewer-0123.js");
  EXPECT_EQ(script.body().size(), 300'000u);
  EXPECT_EQ(script[http::field::content_type], "text/javascript; charset=utf-8");
  EXPECT_EQ(script[http::field::cache_control], "public, max-age=31536000, immutable");
  EXPECT_EQ(script["X-Content-Type-Options"], "nosniff");
  EXPECT_EQ(client.Request("/assets/viewer-4567.css")[http::field::content_type],
            "text/css; charset=utf-8");
  EXPECT_EQ(client.Request("/robots.txt")[http::field::cache_control], "no-cache");
  EXPECT_EQ(client.Request("/", http::verb::post).result_int(), 405u);
}

TEST_F(ServerHttp, SupportsEntityTags) {
  TestServer server(TestConfig(), ViewerFiles::Read(root.string()).value());
  HttpClient client(server.http_port());
  const auto first = client.Request("/");
  const std::string tag(first[http::field::etag]);
  ASSERT_GE(tag.size(), 10u);
  for (const std::string& known : {tag, "W/" + tag, "\"other\", " + tag, std::string("*")}) {
    const auto again = client.Request("/", http::verb::get, known);
    EXPECT_EQ(again.result_int(), 304u) << known;
    EXPECT_EQ(again.body(), "");
    EXPECT_EQ(again[http::field::etag], tag);
    EXPECT_EQ(again[http::field::cache_control], "no-cache");
  }
  EXPECT_EQ(client.Request("/", http::verb::get, "\"other\"").body(), first.body());
  // The connection can still be used, and other files have other tags.
  EXPECT_NE(client.Request("/robots.txt")[http::field::etag], tag);

  const auto head = client.Request("/assets/viewer-0123.js", http::verb::head);
  EXPECT_EQ(head.result_int(), 200u);
  EXPECT_EQ(head[http::field::content_length], "300000");
  EXPECT_EQ(head.body(), "");
  EXPECT_EQ(client.Request("/healthz").body(), "ok\n");
}

TEST_F(ServerHttp, ServesNoOtherFiles) {
  TestServer server(TestConfig(), ViewerFiles::Read(root.string()).value());
  HttpClient client(server.http_port());
  // Files that are created later are not served either.
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
    const auto answer = client.Request(path);
    EXPECT_EQ(answer.result_int(), 404u) << path;
    EXPECT_THAT(answer.body(), testing::Not(HasSubstr("secret"))) << path;
  }
}

TEST_F(ServerHttp, ReportsInvalidViewerFolders) {
  const auto expect_error = [](const std::string& path, const std::string& what, ErrorCode code) {
    const auto viewer = ViewerFiles::Find(path);
    ASSERT_FALSE(viewer) << path;
    EXPECT_EQ(viewer.error().code, code);
    EXPECT_THAT(Describe(viewer.error()),
                testing::AllOf(HasSubstr("viewer_dir: "), HasSubstr(what)));
  };
  expect_error((fs::path(folder.path()) / "none").string(), "no index.html", ErrorCode::kNotFound);
  expect_error((root / "index.html").string(), "no index.html", ErrorCode::kNotFound);
  Write(root / "a name.js", "");
  expect_error(root.string(), "a name.js", ErrorCode::kInvalidArgument);
  fs::remove(root / "a name.js");
  for (std::size_t i = 0; i < ViewerFiles::kMaxFiles; ++i) {
    Write(root / "many" / (std::to_string(i) + ".txt"), "");
  }
  expect_error(root.string(), "too many files", ErrorCode::kLimitExceeded);
  fs::remove_all(root / "many");
  Write(root / "huge.bin", "");
  fs::resize_file(root / "huge.bin", ViewerFiles::kMaxBytes);
  expect_error(root.string(), "too many bytes", ErrorCode::kLimitExceeded);
}

TEST_F(ServerHttp, ExplainsHowToBuildTheViewer) {
  TestServer server;
  HttpClient client(server.http_port());
  const auto page = client.Request("/");
  EXPECT_EQ(page.result_int(), 200u);
  EXPECT_EQ(page[http::field::content_type], "text/html; charset=utf-8");
  EXPECT_THAT(page.body(), HasSubstr("STRIDEWIRE_BUILD_VIEWER=ON"));
  EXPECT_EQ(client.Request("/index.html").result_int(), 404u);
}

TEST_F(ServerHttp, ListsWorldsInInfoJson) {
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
  const auto answer = client.Request("/info.json");
  EXPECT_EQ(answer[http::field::content_type], "application/json");
  EXPECT_EQ(answer[http::field::cache_control], "no-store");
  const auto info = nlohmann::json::parse(answer.body());
  EXPECT_EQ(info["tick_hz"], 60.0);
  EXPECT_EQ(info["shards"], 2);
  EXPECT_EQ(info["listen"], "127.0.0.1:" + std::to_string(server.port()));
  EXPECT_EQ(info["open_worlds"], true);
  EXPECT_FALSE(info["version"].get<std::string>().empty());
  EXPECT_EQ(info["worlds"], nlohmann::json::parse(R"([
    {"name": "hall", "library": "test", "avatars": 0},
    {"name": "own", "library": "test", "avatars": 0},
    {"name": "plaza", "library": "test", "avatars": 3}])"));
}

TEST_F(ServerHttp, RequiresAnUpgradeForStream) {
  TestServer server;
  HttpClient client(server.http_port());
  const auto answer = client.Request("/stream");
  EXPECT_EQ(answer.result_int(), 426u);
  EXPECT_EQ(answer[http::field::upgrade], "websocket");
}

// The JSON pages that the library page of the viewer requests.
class ServerLibraries : public testing::Test {
 protected:
  nlohmann::json Get(const std::string& target) {
    const auto response = client.Request(target);
    EXPECT_EQ(response.result_int(), 200u) << target << ": " << response.body();
    return nlohmann::json::parse(response.body(), nullptr, false);
  }

  TestServer server;
  HttpClient client{server.http_port()};
  nlohmann::json list = Get("/libraries.json");
  std::string folder = "/libraries/" + list[0]["hash"].get<std::string>();
};

TEST_F(ServerLibraries, DescribeTheirGroups) {
  ASSERT_EQ(list.size(), 1u);
  EXPECT_EQ(list[0]["name"], "test");
  const nlohmann::json skeleton = Get(folder + "/skeleton.json");
  EXPECT_EQ(skeleton["names"].size(), skeleton["parents"].size());
  EXPECT_EQ(skeleton["offsets_m"].size(), 3 * skeleton["names"].size());
  EXPECT_EQ(skeleton["legs"].size(), 2u);
  const nlohmann::json& groups = list[0]["groups"];
  ASSERT_GE(groups.size(), 3u);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const nlohmann::json sites = Get(folder + "/" + std::to_string(g) + "/sites.json");
    EXPECT_EQ(sites["kind"], groups[g]["kind"]);
    EXPECT_EQ(sites["parameters"].size(), groups[g]["parameters"].size());
    EXPECT_EQ(sites["sites"].size(), groups[g]["examples"].get<std::size_t>() +
                                         groups[g]["pseudoexamples"].get<std::size_t>());
  }
}

TEST_F(ServerLibraries, SaysWhatALibraryCanDo) {
  const nlohmann::json answer = Get(folder + "/summary.json");
  const nlohmann::json& summary = answer["summary"];
  EXPECT_GT(summary["strides"]["left"]["length_m"]["max"].get<double>(), 0.1);
  EXPECT_FALSE(summary["sentences"].empty());
  for (const nlohmann::json& missing : summary["missing"]) {
    EXPECT_FALSE(missing["advice"].get<std::string>().empty());
  }
  EXPECT_EQ(answer["self_check"]["checks"].size(), 5u);
}

TEST_F(ServerLibraries, SynthesizeRequestedMovements) {
  const std::size_t joints = Get(folder + "/skeleton.json")["names"].size();
  const nlohmann::json step = Get(folder + "/0/step.json?p=-0.31,0.62");
  const std::size_t frames = step["times_s"].size();
  EXPECT_GE(frames, 10u);
  EXPECT_EQ(step["roots_m"].size(), 3 * frames);
  EXPECT_EQ(step["rotations"].size(), 4 * joints * frames);
  EXPECT_NEAR(step["measured"][0].get<double>(), -0.31, 2e-5);
  EXPECT_NEAR(step["measured"][1].get<double>(), 0.62, 2e-5);
  EXPECT_LT(step["error_m"].get<double>(), step["uncorrected_error_m"].get<double>());
  const nlohmann::json plain = Get(folder + "/0/step.json?correction=0&p=-0.31,0.62");
  EXPECT_EQ(plain["iterations"], 0);
  EXPECT_EQ(plain["error_m"], plain["uncorrected_error_m"]);
  EXPECT_EQ(plain["error_m"], step["uncorrected_error_m"]);
  // Parameters far out of range are clamped as in a request.
  const nlohmann::json far = Get(folder + "/0/step.json?p=-0.31,3");
  EXPECT_TRUE(far["extrapolated"].get<bool>());
  EXPECT_LT(far["applied"][1].get<double>(), 0.9);
  EXPECT_EQ(far["requested"][1], 3.0);
  // An example is the step with the parameters of the example.
  const nlohmann::json sites = Get(folder + "/0/sites.json")["sites"];
  const nlohmann::json example = Get(folder + "/0/example.json?index=7");
  EXPECT_EQ(example["applied"], sites[7]["p"]);
  EXPECT_NEAR(example["weights"][7].get<double>(), 1.0, 1e-5);
}

TEST_F(ServerLibraries, MapErrorsOverASlice) {
  const auto map = [&](int correction) {
    return Get(folder +
               "/0/errors.json?x=0&y=1&p=0,0&cells=24&correction=" + std::to_string(correction));
  };
  const nlohmann::json plain = map(0);
  const nlohmann::json corrected = map(1);
  ASSERT_EQ(plain["errors_mm"].size(), 24u * 24u);
  int inside = 0;
  double largest_mm = 0.0;
  for (std::size_t i = 0; i < plain["errors_mm"].size(); ++i) {
    EXPECT_EQ(plain["errors_mm"][i].is_null(), corrected["errors_mm"][i].is_null());
    if (plain["errors_mm"][i].is_null()) continue;
    ++inside;
    largest_mm = std::max(largest_mm, plain["errors_mm"][i].get<double>());
    EXPECT_LE(corrected["errors_mm"][i].get<double>(), plain["errors_mm"][i].get<double>() + 1e-4);
  }
  EXPECT_GT(inside, 24 * 24 / 2);
  EXPECT_LT(inside, 24 * 24);  // one corner has no example nearby
  EXPECT_NEAR(plain["largest_m"].get<double>() * 1e3, largest_mm, 1e-4);
  EXPECT_LT(corrected["largest_m"].get<double>(), plain["largest_m"].get<double>() / 10);
}

TEST_F(ServerLibraries, RejectInvalidQueries) {
  for (const auto& [page, status, why] :
       {std::tuple("/0/step.json", 400u, "p: expected one number per parameter"),
        std::tuple("/0/step.json?p=1", 400u, "p: expected one number per parameter"),
        std::tuple("/0/step.json?p=1,2,3", 400u, "p: expected one number per parameter"),
        std::tuple("/0/step.json?p=1,", 400u, "p: expected one number per parameter"),
        std::tuple("/0/step.json?p=nan,1", 400u, "p: expected one number per parameter"),
        std::tuple("/0/step.json?p=inf,1", 400u, "p: expected one number per parameter"),
        std::tuple("/0/step.json?p=1e300,1", 400u, "p: expected one number per parameter"),
        std::tuple("/0/step.json?p=0,0&correction=2", 400u, "correction: expected 0 or 1"),
        std::tuple("/0/example.json?index=-1", 400u, "index: "),
        std::tuple("/0/example.json?index=9999999999", 400u, "index: "),
        std::tuple("/0/errors.json?x=0&y=2&p=0,0&cells=8", 400u, "y: "),
        std::tuple("/0/errors.json?x=0&y=1&p=0,0&cells=65", 400u, "cells: expected 2 to 64"),
        std::tuple("/0/errors.json?x=0&y=1&p=0,0", 400u, "cells: expected 2 to 64"),
        std::tuple("/0/other.json", 404u, "no such page"),
        std::tuple("/99/sites.json", 404u, "no such page or group"),
        std::tuple("/-1/sites.json", 404u, "no such page or group"),
        std::tuple("/", 404u, "no such"), std::tuple("", 404u, "no such")}) {
    const auto response = client.Request(folder + page);
    EXPECT_EQ(response.result_int(), status) << page;
    EXPECT_THAT(response.body(), HasSubstr(why)) << page;
  }
  EXPECT_EQ(client.Request("/libraries/00/0/sites.json").result_int(), 404u);
  EXPECT_EQ(client.Request("/libraries").result_int(), 404u);
  EXPECT_EQ(client.Request("/libraries.json", http::verb::post).result_int(), 405u);
}

TEST_F(ServerLibraries, LimitTheNumberOfWaitingRequests) {
  const std::string target = folder + "/0/errors.json?x=0&y=1&p=0,0&cells=64";
  std::atomic<int> answered = 0;
  std::atomic<int> refused = 0;
  std::vector<std::jthread> visitors;
  for (int i = 0; i < 48; ++i) {
    visitors.emplace_back([&] {
      const auto status = HttpClient(server.http_port()).Request(target).result_int();
      if (status == 200) ++answered;
      if (status == 503) ++refused;
    });
  }
  visitors.clear();
  EXPECT_EQ(answered + refused, 48);
  EXPECT_GE(answered, 16);
  EXPECT_EQ(server.metrics().Sum(server::Limit::kHttpWork), static_cast<std::uint64_t>(refused));
}

}  // namespace
}  // namespace stridewire
