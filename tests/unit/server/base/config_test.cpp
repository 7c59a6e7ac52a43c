#include "base/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>
#include <set>

namespace stridewire::server {
namespace {

using testing::HasSubstr;

TEST(Config, HasDocumentedDefaults) {
  const Config config;
  EXPECT_EQ(ToText(config.listen), "127.0.0.1:7420");
  EXPECT_EQ(ToText(config.http), "127.0.0.1:7421");
  EXPECT_EQ(config.library, "builtin");
  EXPECT_EQ(config.tick_hz, 60.0);
  EXPECT_GE(config.shard_count(), 1);
  EXPECT_TRUE(CheckConfig(config));
}

TEST(Config, EveryKeyAcceptsItsDefault) {
  const Config defaults;
  std::set<std::string> names;
  for (const ConfigKey& key : ConfigKeys()) {
    SCOPED_TRACE(key.name);
    EXPECT_TRUE(names.insert(key.name).second);
    Config config;
    EXPECT_TRUE(key.set(config, key.get(defaults)));
    EXPECT_EQ(key.get(config), key.get(defaults));
  }
}

TEST(Config, EveryKeyRejectsInvalidValuesAndKeepsItsValue) {
  const Config defaults;
  for (const ConfigKey& key : ConfigKeys()) {
    if (key.name == "data_dir" || key.name == "library" || key.name == "viewer_dir") {
      continue;  // any text is a valid path
    }
    for (const char* invalid : {"", "many", "1e", "-", "0x10", "nan", "inf", "-1", "99999999999999",
                                "1 ", " 1", "true1", "127.0.0.1", "[::1:80"}) {
      if (key.is_list && std::string_view(invalid).empty()) continue;  // an empty list
      if (key.name == "trusted_proxies" && std::string_view(invalid) == "127.0.0.1") continue;
      SCOPED_TRACE(key.name + " = '" + invalid + "'");
      Config config;
      const Status status = key.set(config, invalid);
      ASSERT_FALSE(status);
      EXPECT_NE(status.error().text, std::string());
      EXPECT_EQ(key.get(config), key.get(defaults));
    }
  }
}

TEST(Config, EveryNumberAcceptsBothEndsOfItsRange) {
  for (const ConfigKey& key : ConfigKeys()) {
    if (key.is_text || key.is_flag || key.is_list) continue;
    SCOPED_TRACE(key.name);
    // The help text ends with "(MIN to MAX)".
    const auto open = key.help.rfind('(');
    const auto middle = key.help.rfind(" to ");
    ASSERT_NE(open, std::string::npos);
    ASSERT_NE(middle, std::string::npos);
    const std::string min = key.help.substr(open + 1, middle - open - 1);
    const std::string max = key.help.substr(middle + 4, key.help.size() - middle - 5);
    Config config;
    EXPECT_TRUE(key.set(config, min)) << min;
    EXPECT_TRUE(key.set(config, max)) << max;
    EXPECT_FALSE(key.set(config, max + "0")) << max << "0";
    EXPECT_FALSE(key.set(config, "-" + max)) << "-" << max;
  }
}

TEST(Config, PrintedTextIsReadBackUnchanged) {
  Config config;
  config.listen = {"::1", 9};
  config.library = "a \"strange\" \\ name\n";
  config.allowed_origins = {"https://a.example", "http://[::1]:8080"};
  config.trusted_proxies = {"127.0.0.1", "fd00::/8"};
  config.tick_hz = 29.97;
  config.allow_insecure = true;
  config.run_time_correction = false;
  config.foot_planting = false;
  config.idle_motion = false;
  config.stride_variation = false;
  config.limits.max_sessions = 3;
  config.limits.idle_timeout_s = 0.0;
  config.worlds["hall"] = {.library = "hall.swl", .terrain = "hall \"1\".json", .persistent = true};
  config.worlds["Caf\xc3\xa9 \"1\"\\"] = {
      .library = "", .terrain = "", .idle_motion = true, .stride_variation = true};
  const std::string text = PrintConfig(config);
  Config read;
  const Status status = ReadConfigText(text, "printed", read);
  ASSERT_TRUE(status) << Describe(status.error()) << "\n" << text;
  EXPECT_EQ(PrintConfig(read), text);
  EXPECT_EQ(read.listen, config.listen);
  EXPECT_EQ(read.library, config.library);
  EXPECT_EQ(read.allowed_origins, config.allowed_origins);
  EXPECT_EQ(read.trusted_proxies, config.trusted_proxies);
  EXPECT_EQ(read.tick_hz, 29.97);
  EXPECT_FALSE(read.run_time_correction);
  EXPECT_FALSE(read.foot_planting);
  EXPECT_FALSE(read.idle_motion);
  EXPECT_FALSE(read.stride_variation);
  EXPECT_EQ(read.worlds, config.worlds);
  EXPECT_EQ(read.limits.idle_timeout_s, 0.0);
}

TEST(Config, FileErrorsContainFileLineAndKey) {
  struct Case {
    const char* text;
    const char* where;
    const char* what;
  };
  const Case cases[] = {
      {"\nlissten = \"x:1\"", "f.toml:2: lissten", "unknown key"},
      {"listen = 7420", "f.toml:1: listen", "in quotes"},
      {"listen = \"localhost\"", "f.toml:1: listen", "HOST:PORT"},
      {"listen = \"h:70000\"", "f.toml:1: listen", "0 to 65535"},
      {"tick_hz = \"60\"", "f.toml:1: tick_hz", "expected a number"},
      {"tick_hz = 0", "f.toml:1: tick_hz = 0 (expected 1 to 1000)", "out of range"},
      {"tick_hz = nan", "f.toml:1: tick_hz", "out of range"},
      {"shards = 1.5", "f.toml:1: shards", "integer"},
      {"allowed_origins = \"https://a.example\"", "f.toml:1: allowed_origins", "list of strings"},
      {"trusted_proxies = [\"10.0.0.0/40\"]", "f.toml:1: trusted_proxies", "address or network"},
      {"allowed_origins = [1]", "f.toml:1: allowed_origins", "list of strings"},
      {"allowed_origins = [\"\"]", "f.toml:1: allowed_origins", "list of strings"},
      {"allowed_origins = [\"*\"]", "f.toml:1: allowed_origins", "origin of a page"},
      {"allowed_origins = [\"https://a.example/\"]", "f.toml:1: allowed_origins", "without a path"},
      {"allowed_origins = [\"a.example\"]", "f.toml:1: allowed_origins", "origin of a page"},
      {"allow_insecure = 1", "f.toml:1: allow_insecure", "true or false"},
      {"log_level = \"loud\"", "f.toml:1: log_level", "warning"},
      {"limits = 3", "f.toml:1: limits", "section"},
      {"[limits]\n\nmax_session = 3", "f.toml:3: limits.max_session", "unknown key"},
      {"[limits]\nmax_sessions = 0", "f.toml:2: limits.max_sessions", "out of range"},
      {"max_sessions = 3", "f.toml:1: max_sessions", "unknown key"},
      {"[worlds]\nhall = 1", "f.toml:2: worlds.hall", "section"},
      {"[worlds.\"x\\u0007\"]\nlibrary = \"a\"", "worlds.x", "a world name"},
      {"[worlds.hall]\nlibrary = 1", "f.toml:2: worlds.hall.library", "in quotes"},
      {"[worlds.hall]\nlibrary = \"\"", "f.toml:2: worlds.hall.library", "in quotes"},
      {"[worlds.hall]\nterrain = true", "f.toml:2: worlds.hall.terrain", "in quotes"},
      {"[worlds.hall]\npersistent = \"yes\"", "f.toml:2: worlds.hall.persistent", "true or false"},
      {"[worlds.hall]\nidle_motion = 1", "f.toml:2: worlds.hall.idle_motion", "true or false"},
      {"[worlds.hall]\nstride_variation = 1", "f.toml:2: worlds.hall.stride_variation",
       "true or false"},
      {"[worlds.hall]\nbig = true", "f.toml:2: worlds.hall.big", "unknown key"},
      {"tick_hz = = 3", "f.toml:1", "invalid TOML"},
      {"a\xff = 3", "f.toml:1", "invalid TOML"},
  };
  for (const Case& bad : cases) {
    SCOPED_TRACE(bad.text);
    Config config;
    const Status status = ReadConfigText(bad.text, "f.toml", config);
    ASSERT_FALSE(status);
    EXPECT_THAT(Describe(status.error()), HasSubstr(bad.where));
    EXPECT_THAT(Describe(status.error()), HasSubstr(bad.what));
  }
}

TEST(Config, KeepsItsValuesIfAFileHasAnError) {
  Config config;
  EXPECT_FALSE(ReadConfigText("tick_hz = 30\nshards = \"x\"", "f", config));
  EXPECT_EQ(config.tick_hz, 60.0);
}

TEST(Config, RequiresAllowInsecureForPublicAddresses) {
  for (const char* address : {"0.0.0.0:7420", "192.168.1.2:7420", "[::]:7420", "example.org:1",
                              "127.0.0.1.example.org:1"}) {
    SCOPED_TRACE(address);
    Config config;
    config.listen = *ParseEndpoint(address);
    const Status status = CheckConfig(config);
    ASSERT_FALSE(status);
    EXPECT_THAT(Describe(status.error()), HasSubstr("allow_insecure"));
    config.allow_insecure = true;
    EXPECT_TRUE(CheckConfig(config));
  }
  for (const char* address : {"127.0.0.1:0", "127.8.9.1:1", "[::1]:1", "localhost:1"}) {
    SCOPED_TRACE(address);
    Config config;
    config.listen = *ParseEndpoint(address);
    EXPECT_TRUE(CheckConfig(config));
  }
  Config config;
  config.http = {"0.0.0.0", 1};
  EXPECT_FALSE(CheckConfig(config));
  config.http_enabled = false;
  EXPECT_TRUE(CheckConfig(config));
}

TEST(Config, ChecksWorldNames) {
  for (const char* name : {"a", "load-0", "..", "a/b", "Caf\xc3\xa9 \"1\"",
                           "\xe5\xba\x83\xe5\xa0\xb4", "\xf0\x9f\x9a\xb6"}) {
    EXPECT_TRUE(IsWorldName(name)) << name;
  }
  for (const char* name : {"", "a\n", "\x7f", "\xc3", "\xc0\xaf", "\xed\xa0\x80"}) {
    EXPECT_FALSE(IsWorldName(name)) << name;
  }
  EXPECT_TRUE(IsWorldName(std::string(64, 'x')));
  EXPECT_FALSE(IsWorldName(std::string(65, 'x')));
}

TEST(Config, ParsesEndpoints) {
  EXPECT_EQ(*ParseEndpoint("[::1]:80"), (Endpoint{"::1", 80}));
  EXPECT_EQ(ToText(*ParseEndpoint("[::1]:80")), "[::1]:80");
  EXPECT_EQ(*ParseEndpoint("host.name:0"), (Endpoint{"host.name", 0}));
  for (const char* bad :
       {"", ":", ":80", "host", "host:", "host:x", "host:-1", "host:65536", "::1:80", "[]:80"}) {
    EXPECT_FALSE(ParseEndpoint(bad)) << bad;
  }
}

}  // namespace
}  // namespace stridewire::server
