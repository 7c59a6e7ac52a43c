#include "stridewire/offline/bvh_reader.h"

#include <gtest/gtest.h>

namespace stridewire {
namespace {

// From Debian's assimp-testmodels: any machine can have them.
TEST(ReadBvh, ReadsTheTestModelsOfDebian) {
  const char* path = "/usr/share/assimp/models/BVH/01_01.bvh";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "assimp-testmodels is not installed";
  const Expected<Capture> capture = ReadBvh(path);
  ASSERT_TRUE(capture.has_value()) << Describe(capture.error());
  EXPECT_EQ(capture->skeleton.joint_count(), 31);
  EXPECT_EQ(capture->clip.frame_count(), 2752);
  EXPECT_EQ(capture->clip.fps, 120.0);
  EXPECT_NEAR(capture->unit_m, 0.0254 / 0.45, 1e-9);
  EXPECT_EQ(capture->first_frame, 1);
}

}  // namespace
}  // namespace stridewire
