#include "offline/capture/conventions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stridewire {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

FileConventions File(const char* path, BvhAxis up, UpSource source) {
  FileConventions file;
  file.path = path;
  file.up = up;
  file.up_source = source;
  file.unit_m = 0.01;
  file.leg_m = 0.85;
  file.joint_names = {"Hips", "LeftUpLeg", "RightUpLeg"};
  return file;
}

TEST(Conventions, LeavesFilesThatAgreeAlone) {
  const std::vector<FileConventions> files = {File("a", BvhAxis::kPlusZ, UpSource::kRestPose),
                                              File("b", BvhAxis::kPlusZ, UpSource::kGuess)};
  for (const AgreedConventions& agreed : AgreeOnConventions(files)) {
    EXPECT_FALSE(agreed.up.has_value());
    EXPECT_FALSE(agreed.unit_m.has_value());
    EXPECT_THAT(agreed.notes, IsEmpty());
  }
  EXPECT_THAT(AgreeOnConventions({}), IsEmpty());
}

TEST(Conventions, GivesAFileThatLiesTheUpAxisOfTheOthers) {
  const std::vector<FileConventions> files = {File("lying", BvhAxis::kMinusZ, UpSource::kMotion),
                                              File("a", BvhAxis::kPlusY, UpSource::kMotion),
                                              File("b", BvhAxis::kPlusY, UpSource::kMotion)};
  const std::vector<AgreedConventions> agreed = AgreeOnConventions(files);
  EXPECT_EQ(agreed[0].up, BvhAxis::kPlusY);
  EXPECT_THAT(agreed[0].notes, Contains(HasSubstr("up is taken as +y like in other files")));
  EXPECT_FALSE(agreed[1].up.has_value());
  EXPECT_FALSE(agreed[2].up.has_value());
}

TEST(Conventions, TrustsRestPosesMoreThanMotions) {
  const std::vector<FileConventions> files = {File("a", BvhAxis::kPlusZ, UpSource::kMotion),
                                              File("b", BvhAxis::kPlusZ, UpSource::kMotion),
                                              File("rest", BvhAxis::kPlusY, UpSource::kRestPose)};
  const std::vector<AgreedConventions> agreed = AgreeOnConventions(files);
  EXPECT_EQ(agreed[0].up, BvhAxis::kPlusY);
  EXPECT_EQ(agreed[1].up, BvhAxis::kPlusY);
  EXPECT_FALSE(agreed[2].up.has_value());
}

TEST(Conventions, KeepsClearDifferencesWithANote) {
  std::vector<FileConventions> files = {File("a", BvhAxis::kPlusY, UpSource::kRestPose),
                                        File("b", BvhAxis::kPlusZ, UpSource::kRestPose),
                                        File("c", BvhAxis::kPlusZ, UpSource::kMotion)};
  files[2].joint_names = {"Pelvis"};  // Another figure.
  const std::vector<AgreedConventions> agreed = AgreeOnConventions(files);
  for (const std::size_t i : {1u, 2u}) {
    EXPECT_FALSE(agreed[i].up.has_value());
    EXPECT_THAT(agreed[i].notes, Contains(HasSubstr("up is +z, but +y in a")));
  }
}

TEST(Conventions, GivesAnEstimatedUnitTheCommonOneOfOtherFiles) {
  std::vector<FileConventions> files = {File("tall", BvhAxis::kPlusY, UpSource::kRestPose),
                                        File("a", BvhAxis::kPlusY, UpSource::kRestPose),
                                        File("metres", BvhAxis::kPlusY, UpSource::kRestPose)};
  files[0].unit_is_common = false;
  files[0].unit_m = 0.0085;  // With a unit of 1 cm, the legs would be 1 m long.
  files[2].unit_m = 1.0;
  const std::vector<AgreedConventions> agreed = AgreeOnConventions(files);
  ASSERT_TRUE(agreed[0].unit_m.has_value());
  EXPECT_EQ(*agreed[0].unit_m, 0.01);
  EXPECT_THAT(agreed[0].notes, Contains(HasSubstr("one file unit is taken as 0.01 m like in a")));
  EXPECT_THAT(agreed[2].notes, Contains(HasSubstr("one file unit is 1 m, but 0.01 m in tall")));

  // A child's legs may be too short for that unit.
  files[0].leg_m = 0.3;
  EXPECT_FALSE(AgreeOnConventions(files)[0].unit_m.has_value());
}

}  // namespace
}  // namespace stridewire
