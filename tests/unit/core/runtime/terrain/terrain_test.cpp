#include "stridewire/runtime/terrain.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "runtime/terrain/foot_support.h"

namespace stridewire {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

HeightField MakeField(GroundPoint origin, double cell, std::int32_t columns, std::int32_t rows) {
  HeightField field{origin, cell, columns, rows, {}};
  field.heights_m.resize(static_cast<std::size_t>(columns * rows));
  return field;
}

std::shared_ptr<const Terrain> MakeTerrain(TerrainData data) {
  auto terrain = Terrain::Make(std::move(data));
  if (!terrain) {
    ADD_FAILURE() << Describe(terrain.error());
    return *Terrain::Make({});
  }
  return *terrain;
}

/// The definition of the height, without an index.
double BruteHeight(const TerrainData& data, double x, double z) {
  double height = 0.0;
  if (data.height_field) {
    const HeightField& f = *data.height_field;
    const double u = (x - f.origin_m.x) / f.cell_m;
    const double v = (z - f.origin_m.z) / f.cell_m;
    if (u >= 0 && v >= 0 && u <= f.columns - 1 && v <= f.rows - 1) {
      // Each sample contributes with a tent function over its two neighbouring cells.
      for (std::int32_t j = 0; j < f.rows; ++j) {
        for (std::int32_t i = 0; i < f.columns; ++i) {
          const double weight =
              std::max(0.0, 1 - std::abs(u - i)) * std::max(0.0, 1 - std::abs(v - j));
          height += weight * f.heights_m[static_cast<std::size_t>(j * f.columns + i)];
        }
      }
    }
  }
  for (const TerrainBox& box : data.boxes) {
    if (x >= box.min_m.x && x <= box.max_m.x && z >= box.min_m.z && z <= box.max_m.z) {
      height = std::max(height, box.height_m);
    }
  }
  return height;
}

double DistanceTo(GroundPoint min, GroundPoint max, double x, double z) {
  const double dx = std::max({min.x - x, 0.0, x - max.x});
  const double dz = std::max({min.z - z, 0.0, z - max.z});
  return std::sqrt(dx * dx + dz * dz);
}

/// The borders are at multiples of 1/4 m, so that queries at multiples of 1/8 m often hit them.
TerrainData RandomTerrain(std::mt19937& random, bool with_field) {
  const auto quarter = [&random](int from, int to) {
    return 0.25 * std::uniform_int_distribution<int>(from, to)(random);
  };
  std::uniform_real_distribution<double> height(-0.5, 0.5);
  TerrainData data;
  if (with_field) {
    HeightField field = MakeField({quarter(-20, 0), quarter(-20, 0)}, 0.25,
                                  std::uniform_int_distribution<int>(2, 12)(random),
                                  std::uniform_int_distribution<int>(2, 12)(random));
    for (float& h : field.heights_m) h = static_cast<float>(height(random));
    data.height_field = field;
  }
  const int boxes = std::uniform_int_distribution<int>(0, 40)(random);
  for (int b = 0; b < boxes; ++b) {
    const GroundPoint min{quarter(-24, 20), quarter(-24, 20)};
    data.boxes.push_back({min, {min.x + quarter(1, 8), min.z + quarter(1, 8)}, height(random)});
  }
  return data;
}

double RandomEighth(std::mt19937& random) {
  return 0.125 * std::uniform_int_distribution<int>(-56, 56)(random);
}

TEST(Terrain, EmptyTerrainIsFlat) {
  const auto terrain = MakeTerrain({});
  EXPECT_EQ(terrain->HeightAt(3.0, -4.0), 0.0);
  EXPECT_EQ(terrain->NormalAt(3.0, -4.0), Vec3(0, 1, 0));
  EXPECT_EQ(terrain->HighestWithin(0.0, 0.0, 1.0), 0.0);
  const FootSupport support = SupportOf(*terrain, 1.0, 2.0, 0.7, {0.2, 0.1, 0.05});
  EXPECT_EQ(support.normal, Vec3(0, 1, 0));
  EXPECT_EQ(support.plane_height_m, 0.0);
  EXPECT_EQ(support.gap_m, 0.0);
  EXPECT_EQ(support.rise_m, 0.0);
  EXPECT_EQ(support.carried, 1.0);
}

TEST(Terrain, BordersBelongToBoxAndField) {
  HeightField field = MakeField({0, 0}, 0.5, 3, 2);
  field.heights_m = {1, 2, 3, 5, 6, 7};
  const auto terrain = MakeTerrain({field, {{{2, 2}, {3, 4}, 0.25}, {{3, 2}, {4, 4}, 0.5}}});
  EXPECT_EQ(terrain->HeightAt(0.0, 0.0), 1.0);
  EXPECT_EQ(terrain->HeightAt(1.0, 0.0), 3.0);
  EXPECT_EQ(terrain->HeightAt(1.0, 0.5), 7.0);
  EXPECT_EQ(terrain->HeightAt(0.25, 0.25), 3.5);
  EXPECT_EQ(terrain->HeightAt(std::nextafter(1.0, 2.0), 0.5), 0.0);
  EXPECT_EQ(terrain->HeightAt(std::nextafter(0.0, -1.0), 0.5), 0.0);

  EXPECT_EQ(terrain->HeightAt(2.0, 2.0), 0.25);
  EXPECT_EQ(terrain->HeightAt(std::nextafter(2.0, 0.0), 2.0), 0.0);
  EXPECT_EQ(terrain->HeightAt(3.0, 4.0), 0.5) << "the higher of two that meet";
  EXPECT_EQ(terrain->HeightAt(std::nextafter(3.0, 0.0), 4.0), 0.25);
  EXPECT_EQ(terrain->HeightAt(4.0, std::nextafter(4.0, 5.0)), 0.0);

  // The test is exact at edges: the disc touches the box, or barely does not.
  EXPECT_EQ(terrain->HighestWithin(1.75, 3.0, 0.25), 0.25);
  EXPECT_EQ(terrain->HighestWithin(1.75, 3.0, std::nextafter(0.25, 0.0)), 0.0);
  EXPECT_EQ(terrain->HighestWithin(2.75, 3.0, 0.25), 0.5);
  EXPECT_EQ(terrain->HighestWithin(2.75, 3.0, std::nextafter(0.25, 0.0)), 0.25);
  // Corners count by their distance from the centre, not by the square around the disc.
  EXPECT_EQ(terrain->HighestWithin(1.8, 1.8, 0.25), 0.0);
  EXPECT_EQ(terrain->HighestWithin(1.8, 1.8, 0.29), 0.25);
}

TEST(Terrain, MatchesBruteForce) {
  const unsigned seed = 20261121;
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  for (int round = 0; round < 300; ++round) {
    const TerrainData data = RandomTerrain(random, round % 3 != 0);
    const auto terrain = MakeTerrain(data);
    ASSERT_EQ(terrain->data(), data);
    for (int query = 0; query < 200; ++query) {
      const bool on_lines = query % 2 == 0;
      std::uniform_real_distribution<double> anywhere(-7.0, 7.0);
      const double x = on_lines ? RandomEighth(random) : anywhere(random);
      const double z = on_lines ? RandomEighth(random) : anywhere(random);
      ASSERT_NEAR(terrain->HeightAt(x, z), BruteHeight(data, x, z), 1e-12) << x << ", " << z;
    }
  }
}

TEST(Terrain, HighestWithinBoundsAllHeightsInside) {
  const unsigned seed = 77;
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int round = 0; round < 200; ++round) {
    const TerrainData data = RandomTerrain(random, round % 2 == 0);
    const auto terrain = MakeTerrain(data);
    for (int query = 0; query < 20; ++query) {
      const double x = RandomEighth(random);
      const double z = RandomEighth(random);
      const double radius = query % 2 == 0 ? 0.125 * (1 + query % 5) : 0.7 * unit(random);
      const double highest = terrain->HighestWithin(x, z, radius);
      for (int sample = 0; sample < 100; ++sample) {
        const double angle = 2 * std::numbers::pi * unit(random);
        const double distance = radius * 0.999999 * unit(random);
        const double height =
            terrain->HeightAt(x + distance * std::cos(angle), z + distance * std::sin(angle));
        ASSERT_GE(highest, height - 1e-12) << x << ", " << z << ", " << radius;
      }
      if (data.height_field) continue;
      // With boxes only, the result is exact.
      double expected_highest = 0.0;
      for (const TerrainBox& box : data.boxes) {
        if (DistanceTo(box.min_m, box.max_m, x, z) <= radius) {
          expected_highest = std::max(expected_highest, box.height_m);
        }
      }
      ASSERT_EQ(highest, expected_highest) << x << ", " << z << ", " << radius;
    }
  }
}

TEST(Terrain, NormalMatchesTheHeights) {
  const unsigned seed = 4;
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  HeightField field = MakeField({-1, -2}, 0.5, 9, 7);
  std::uniform_real_distribution<float> height(-0.3f, 0.3f);
  for (float& h : field.heights_m) h = height(random);
  const auto terrain = MakeTerrain({field, {}});
  std::uniform_int_distribution<int> cell_x(0, 7);
  std::uniform_int_distribution<int> cell_z(0, 5);
  std::uniform_real_distribution<double> inside(0.01, 0.49);
  for (int query = 0; query < 1000; ++query) {
    const double x = -1 + 0.5 * cell_x(random) + inside(random);
    const double z = -2 + 0.5 * cell_z(random) + inside(random);
    constexpr double kStep = 1e-4;
    const double slope_x =
        (terrain->HeightAt(x + kStep, z) - terrain->HeightAt(x - kStep, z)) / (2 * kStep);
    const double slope_z =
        (terrain->HeightAt(x, z + kStep) - terrain->HeightAt(x, z - kStep)) / (2 * kStep);
    const Vec3 normal = terrain->NormalAt(x, z);
    EXPECT_NEAR(glm::length(normal), 1.0, 1e-6);
    EXPECT_NEAR(-normal.x / normal.y, slope_x, 1e-5);
    EXPECT_NEAR(-normal.z / normal.y, slope_z, 1e-5);
  }
}

TEST(Terrain, FootSupportOnASlopeMatchesTheSlope) {
  HeightField field = MakeField({-5, -5}, 1.0, 11, 11);
  for (int j = 0; j < 11; ++j) {
    for (int i = 0; i < 11; ++i) {
      field.heights_m[static_cast<std::size_t>(j * 11 + i)] =
          0.25f * static_cast<float>(i) - 0.125f * static_cast<float>(j);
    }
  }
  const auto terrain = MakeTerrain({field, {}});
  const Vec3 expected = glm::normalize(Vec3(-0.25f, 1.0f, 0.125f));
  for (const double heading : {0.0, 0.4, 1.9, -2.5}) {
    const FootSupport support = SupportOf(*terrain, 0.3, -0.6, heading, {0.18, 0.08, 0.05});
    EXPECT_NEAR(glm::distance(support.normal, expected), 0.0, 1e-6) << heading;
    EXPECT_NEAR(support.plane_height_m, terrain->HeightAt(0.3, -0.6), 1e-12);
    EXPECT_NEAR(support.gap_m, 0.0, 1e-12);
    EXPECT_NEAR(support.rise_m, 0.0, 1e-12);
    EXPECT_EQ(support.carried, 1.0);
  }
}

TEST(Terrain, FootSupportDistinguishesEdgesFromSlopes) {
  // A slab that ends at z = 1 and a wall that begins at z = 3.
  const auto terrain = MakeTerrain({{}, {{{-1, 0}, {1, 1}, 0.2}, {{-1, 3}, {1, 4}, 0.5}}});
  const FootSupport on = SupportOf(*terrain, 0.0, 0.9, 0.0, {0.18, 0.08, 0.05});
  EXPECT_EQ(on.gap_m, 0.0);
  EXPECT_EQ(on.carried, 1.0);
  EXPECT_EQ(on.plane_height_m, 0.2);

  const FootSupport toes_over = SupportOf(*terrain, 0.0, 0.95, 0.0, {0.18, 0.08, 0.05});
  EXPECT_NEAR(toes_over.gap_m, 0.2, 1e-12);
  EXPECT_EQ(toes_over.rise_m, 0.0);
  EXPECT_EQ(toes_over.normal, Vec3(0, 1, 0)) << "stays on the slab";
  EXPECT_LT(toes_over.carried, 1.0);
  EXPECT_GT(toes_over.carried, 0.5);

  const FootSupport heel_over =
      SupportOf(*terrain, 0.0, 0.95, std::numbers::pi, {0.18, 0.08, 0.05});
  EXPECT_NEAR(heel_over.gap_m, 0.2, 1e-12);
  EXPECT_EQ(heel_over.plane_height_m, 0.2);

  const FootSupport at_wall = SupportOf(*terrain, 0.0, 2.95, 0.0, {0.18, 0.08, 0.05});
  EXPECT_EQ(at_wall.gap_m, 0.0);
  EXPECT_NEAR(at_wall.rise_m, 0.5, 1e-12);
  EXPECT_EQ(at_wall.plane_height_m, 0.0);

  // The same sideways: x = 1 is the left border of the slab.
  const FootSupport side_over = SupportOf(*terrain, 0.97, 0.5, 0.0, {0.18, 0.08, 0.05});
  EXPECT_NEAR(side_over.gap_m, 0.2, 1e-12);
}

TEST(Terrain, FootSupportAcceptsASoleWithoutArea) {
  HeightField field = MakeField({-5, -5}, 10.0, 2, 2);
  field.heights_m = {0, 0, 2, 2};  // Rises along z by 0.2.
  const auto terrain = MakeTerrain({field, {}});
  const FootSupport line = SupportOf(*terrain, 0.0, 0.0, 0.0, {0.2, 0.1, 0.0});
  EXPECT_NEAR(-line.normal.z / line.normal.y, 0.2, 1e-6);
  const FootSupport point = SupportOf(*terrain, 0.0, 0.0, 0.0, {0.0, 0.0, 0.0});
  EXPECT_EQ(point.normal, Vec3(0, 1, 0));
  EXPECT_NEAR(point.plane_height_m, 1.0, 1e-12);
}

TEST(Terrain, TreatsNonFiniteCoordinatesAsOutside) {
  HeightField field = MakeField({-1, -1}, 1.0, 3, 3);
  std::fill(field.heights_m.begin(), field.heights_m.end(), 1.0f);
  const auto terrain = MakeTerrain({field, {{{-1, -1}, {1, 1}, 2.0}}});
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    EXPECT_EQ(terrain->HeightAt(bad, 0.0), 0.0);
    EXPECT_EQ(terrain->NormalAt(0.0, bad), Vec3(0, 1, 0));
    EXPECT_EQ(terrain->HighestWithin(bad, 0.0, 1.0), 0.0);
  }
  EXPECT_EQ(terrain->HighestWithin(0.0, 0.0, kInfinity), 2.0);
}

void ExpectRefused(TerrainData data, ErrorCode code, const std::string& where) {
  const auto terrain = Terrain::Make(std::move(data));
  ASSERT_FALSE(terrain.has_value()) << where;
  EXPECT_EQ(terrain.error().code, code) << where;
  EXPECT_EQ(terrain.error().where, where);
}

TEST(Terrain, ErrorsNameTheField) {
  const HeightField good = MakeField({0, 0}, 0.5, 2, 3);
  const auto field = [&good](auto change) {
    TerrainData data{good, {}};
    change(*data.height_field);
    return data;
  };
  constexpr auto kRange = ErrorCode::kOutOfRange;
  ExpectRefused(field([](HeightField& f) { f.origin_m.z = kNan; }), kRange,
                "height_field.origin_m");
  ExpectRefused(field([](HeightField& f) { f.cell_m = 0.0; }), kRange, "height_field.cell_m");
  ExpectRefused(field([](HeightField& f) { f.cell_m = kInfinity; }), kRange, "height_field.cell_m");
  ExpectRefused(field([](HeightField& f) { f.columns = 1; }), kRange, "height_field.columns");
  ExpectRefused(field([](HeightField& f) { f.rows = 1025; }), kRange, "height_field.rows");
  ExpectRefused(field([](HeightField& f) { f.columns = 3; }), ErrorCode::kShapeMismatch,
                "height_field.heights_m");
  ExpectRefused(field([](HeightField& f) { f.heights_m[4] = 10001.0f; }), kRange,
                "height_field.heights_m[4]");
  ExpectRefused(field([](HeightField& f) { f.heights_m[5] = std::nanf(""); }), kRange,
                "height_field.heights_m[5]");

  const TerrainBox box{{0, 0}, {1, 1}, 0.5};
  const auto boxes = [&box](auto change) {
    TerrainData data{{}, {box, box}};
    change(data.boxes[1]);
    return data;
  };
  ExpectRefused(boxes([](TerrainBox& b) { b.min_m.x = -kInfinity; }), kRange, "boxes[1].min_m");
  ExpectRefused(boxes([](TerrainBox& b) { b.max_m.z = 2e6; }), kRange, "boxes[1].max_m");
  ExpectRefused(boxes([](TerrainBox& b) { b.max_m.x = 0.0; }), kRange, "boxes[1].max_m");
  ExpectRefused(boxes([](TerrainBox& b) { b.height_m = kNan; }), kRange, "boxes[1].height_m");
  ExpectRefused({{}, std::vector<TerrainBox>(kMaxTerrainBoxes + 1, box)}, ErrorCode::kLimitExceeded,
                "boxes");
  ExpectRefused({{}, std::vector<TerrainBox>(kMaxTerrainBoxesPerCell + 1, box)},
                ErrorCode::kLimitExceeded, "boxes");
}

TEST(Terrain, AcceptsTheLargestTerrain) {
  HeightField field = MakeField({-1e6, 1e6}, kMaxTerrainCellM, 1024, 1024);
  field.heights_m.back() = 1e4f;
  const auto large = MakeTerrain({field, {}});
  EXPECT_EQ(large->HeightAt(-1e6 + 1023e3, 1e6 + 1023e3), 1e4);

  EXPECT_NO_FATAL_FAILURE(
      MakeTerrain({{}, std::vector<TerrainBox>(kMaxTerrainBoxesPerCell, {{0, 0}, {1, 1}, 0.5})}));

  // The largest number of boxes, in two piles far apart, with a slab below each.
  std::vector<TerrainBox> stones;
  for (int i = 0; i < 65'534; ++i) {
    const double x = (i % 2 == 0 ? 0.0 : 900.0) + 0.5 * (i / 2 % 181);
    const double z = 0.5 * (i / 2 / 181);
    stones.push_back({{x, z}, {x + 0.4, z + 0.4}, 0.001 * (i % 100)});
  }
  stones.push_back({{-10, -10}, {200, 200}, -0.5});
  stones.push_back({{890, -10}, {1100, 200}, 0.0625});
  const auto terrain = MakeTerrain({{}, stones});
  for (int i = 0; i < 65'534; i += 97) {
    const TerrainBox& stone = stones[static_cast<std::size_t>(i)];
    const double under = i % 2 == 0 ? 0.0 : 0.0625;
    EXPECT_EQ(terrain->HeightAt(stone.min_m.x + 0.2, stone.min_m.z + 0.2),
              std::max(stone.height_m, under));
  }
}

// A box that is thinner than any cell, and a world that is wider than the largest index.
TEST(Terrain, IndexesBoxesOfAnyShape) {
  const double next = std::nextafter(1.0, 2.0);
  const auto terrain = MakeTerrain({{}, {{{1, 1}, {next, next}, 0.25}}});
  EXPECT_EQ(terrain->HeightAt(1.0, next), 0.25);
  EXPECT_EQ(terrain->HighestWithin(1.1, 1.0, 0.2), 0.25);
  const auto wide =
      MakeTerrain({{}, {{{-1e6, 0}, {-999'999, 1}, 0.25}, {{999'999, 0}, {1e6, 1e-9}, 0.5}}});
  EXPECT_EQ(wide->HeightAt(-1e6, 1.0), 0.25);
  EXPECT_EQ(wide->HeightAt(1e6, 0.0), 0.5);
  EXPECT_EQ(wide->HeightAt(0.0, 0.0), 0.0);
}

}  // namespace
}  // namespace stridewire
