#include <gtest/gtest.h>

extern "C" int StridewireUsedFromC(void);

TEST(ClientHeader, IsUsableFromC99) { EXPECT_EQ(StridewireUsedFromC(), 0); }
