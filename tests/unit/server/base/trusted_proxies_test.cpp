#include "base/trusted_proxies.h"

#include <gtest/gtest.h>

namespace stridewire::server {
namespace {

std::string ClientOf(const TrustedProxies& proxies, const std::string& peer,
                     std::string_view forwarded) {
  return proxies.ClientOf(boost::asio::ip::make_address(peer), forwarded).to_string();
}

TEST(TrustedProxies, AreEmptyByDefault) {
  EXPECT_EQ(ClientOf({}, "127.0.0.1", "203.0.113.7"), "127.0.0.1");
}

TEST(TrustedProxies, ReturnTheLastAddressThatIsNotTrusted) {
  const std::vector<std::string> networks{"127.0.0.1", "10.0.0.0/8", "fd00::/8"};
  const auto parsed = TrustedProxies::Parse(networks);
  ASSERT_TRUE(parsed);
  struct Case {
    const char* peer;
    const char* forwarded;
    const char* client;
  };
  for (const Case& each : {
           Case{"127.0.0.1", "203.0.113.7", "203.0.113.7"},
           Case{"127.0.0.1", "", "127.0.0.1"},
           Case{"::ffff:127.0.0.1", "203.0.113.7", "203.0.113.7"},
           Case{"127.0.0.1", "::ffff:203.0.113.7", "203.0.113.7"},
           // The client has written the first address itself.
           Case{"127.0.0.1", "198.51.100.1, 203.0.113.7", "203.0.113.7"},
           Case{"127.0.0.1", "198.51.100.1,203.0.113.7 , 10.1.2.3", "203.0.113.7"},
           Case{"fd00::1", "2001:db8::1", "2001:db8::1"},
           Case{"127.0.0.1", "[2001:db8::1]:567", "2001:db8::1"},
           Case{"127.0.0.1", "203.0.113.7:567", "203.0.113.7"},
           // All are proxies: the first one is the client.
           Case{"127.0.0.1", "10.1.2.3, 10.0.0.1", "10.1.2.3"},
           Case{"127.0.0.1", "203.0.113.7, unknown", "127.0.0.1"},
           Case{"127.0.0.1", "203.0.113.7,", "127.0.0.1"},
           Case{"127.0.0.1", "[", "127.0.0.1"},
           // The peer is not a trusted proxy, so its header is ignored.
           Case{"11.0.0.1", "203.0.113.7", "11.0.0.1"},
           Case{"127.0.0.2", "203.0.113.7", "127.0.0.2"},
       }) {
    EXPECT_EQ(ClientOf(*parsed, each.peer, each.forwarded), each.client)
        << each.peer << ": " << each.forwarded;
  }
}

TEST(TrustedProxies, RejectInvalidNetworks) {
  for (const char* text : {"", "localhost", "10.0.0.0/33", "10.0.0.0/", "10.0.0.0/-1", "::1/129",
                           "10.0.0.0/8/8", "10.0.0.1:80"}) {
    const std::vector<std::string> networks{"::1", text};
    const auto parsed = TrustedProxies::Parse(networks);
    ASSERT_FALSE(parsed) << text;
    EXPECT_EQ(parsed.error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(parsed.error().index, 1);
  }
}

}  // namespace
}  // namespace stridewire::server
