#include "event_queue.h"

#include <gtest/gtest.h>

#include <vector>

namespace stridewire::client {
namespace {

stridewire_event Numbered(std::uint64_t number) {
  stridewire_event event{};
  event.command = number;
  return event;
}

TEST(EventQueue, PreservesTheOrder) {
  EventQueue queue(16);
  for (std::uint64_t n = 1; n <= 5; ++n) queue.Push(Numbered(n));
  std::vector<stridewire_event> out(3);
  ASSERT_EQ(queue.Take(out), 3u);
  EXPECT_EQ(out[0].command, 1u);
  EXPECT_EQ(out[2].command, 3u);
  ASSERT_EQ(queue.Take(out), 2u);
  EXPECT_EQ(out[1].command, 5u);
  EXPECT_EQ(queue.Take(out), 0u);
}

TEST(EventQueue, DropsTheOldestEventsAndReportsTheirNumber) {
  EventQueue queue(16);
  for (std::uint64_t n = 1; n <= 100; ++n) queue.Push(Numbered(n));
  EXPECT_EQ(queue.size(), 16u);
  EXPECT_EQ(queue.dropped(), 84u);
  std::vector<stridewire_event> out(2);
  ASSERT_EQ(queue.Take(out), 2u);
  EXPECT_EQ(out[0].command, 85u);
  EXPECT_EQ(out[0].events_dropped_before, 84u);
  EXPECT_EQ(out[1].events_dropped_before, 0u);
}

}  // namespace
}  // namespace stridewire::client
