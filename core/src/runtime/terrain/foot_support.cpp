#include "runtime/terrain/foot_support.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "base/trig.h"

namespace stridewire {
namespace {

// Sample points of a sole: rows from heel to toe, columns from one side to the other.
constexpr int kHeelRows = 6;  // Number of rows of sample points behind the row of the ball.
constexpr int kToeRows = 3;
constexpr int kRows = kHeelRows + 1 + kToeRows;
constexpr int kColumns = 5;
constexpr int kBallColumn = kColumns / 2;
// Two neighbouring points belong to the same ground if the difference of their heights is at most
// their distance times kMaxSlope (45 degrees), plus kForgivenM.
constexpr double kMaxSlope = 1.0;
constexpr double kForgivenM = 0.005;

struct SolePoint {
  double side;     // Distance to the left of the ball, in metres.
  double forward;  // Distance in front of the ball, in metres.
  double height;
  bool is_reached;
};

class SolePoints {
 public:
  SolePoint& at(int row, int column) {
    return points_[static_cast<std::size_t>(row) * kColumns + static_cast<std::size_t>(column)];
  }
  SolePoint& ball() { return at(kHeelRows, kBallColumn); }
  [[nodiscard]] auto begin() const { return points_.begin(); }
  [[nodiscard]] auto end() const { return points_.end(); }
  [[nodiscard]] static constexpr int size() { return kRows * kColumns; }

  // Marks the points that can be reached from the ball over slopes of at most kMaxSlope. Passes
  // over all points until nothing changes.
  void Spread() {
    ball().is_reached = true;
    for (bool is_changed = true; is_changed;) {
      is_changed = false;
      for (int row = 0; row < kRows; ++row) {
        for (int column = 0; column < kColumns; ++column) {
          SolePoint& point = at(row, column);
          if (row > 0) is_changed |= Reach(point, at(row - 1, column));
          if (row + 1 < kRows) is_changed |= Reach(point, at(row + 1, column));
          if (column > 0) is_changed |= Reach(point, at(row, column - 1));
          if (column + 1 < kColumns) is_changed |= Reach(point, at(row, column + 1));
        }
      }
    }
  }

 private:
  static bool Reach(const SolePoint& from, SolePoint& to) {
    if (!from.is_reached || to.is_reached) return false;
    const double distance = std::abs(to.side - from.side) + std::abs(to.forward - from.forward);
    to.is_reached = std::abs(to.height - from.height) <= kMaxSlope * distance + kForgivenM;
    return to.is_reached;
  }

  std::array<SolePoint, std::size_t{kRows} * kColumns> points_{};
};

// A plane: height = ball_height + at_ball + side_slope * side + forward_slope * forward.
struct Plane {
  double at_ball = 0.0;
  double side_slope = 0.0;
  double forward_slope = 0.0;
  int count = 0;  // Number of points that the plane was fitted to.
};

// Fits a plane to the marked points by least squares. Their mean is subtracted first, so that level
// ground gives an exactly level plane.
Plane FitPlane(const SolePoints& points, double ball_height) {
  Plane plane;
  double mean_side = 0.0;
  double mean_forward = 0.0;
  double mean_height = 0.0;
  for (const SolePoint& point : points) {
    if (!point.is_reached) continue;
    ++plane.count;
    mean_side += point.side;
    mean_forward += point.forward;
    mean_height += point.height - ball_height;
  }
  mean_side /= plane.count;
  mean_forward /= plane.count;
  mean_height /= plane.count;
  double ss = 0.0;
  double sf = 0.0;
  double ff = 0.0;
  double sh = 0.0;
  double fh = 0.0;
  for (const SolePoint& point : points) {
    if (!point.is_reached) continue;
    const double side = point.side - mean_side;
    const double forward = point.forward - mean_forward;
    const double height = point.height - ball_height - mean_height;
    ss += side * side;
    sf += side * forward;
    ff += forward * forward;
    sh += side * height;
    fh += forward * height;
  }
  const double determinant = ss * ff - sf * sf;
  if (determinant > 1e-9 * ss * ff) {
    plane.side_slope = (sh * ff - fh * sf) / determinant;
    plane.forward_slope = (fh * ss - sh * sf) / determinant;
  } else if (ss + ff > 0.0) {
    // If all points are on one line, use the slope along it and none across.
    const bool is_along = ff >= ss;
    (is_along ? plane.forward_slope : plane.side_slope) = is_along ? fh / ff : sh / ss;
  }
  plane.at_ball = mean_height - plane.side_slope * mean_side - plane.forward_slope * mean_forward;
  return plane;
}

}  // namespace

FootSupport SupportOf(const Terrain& terrain, double x, double z, double heading_rad,
                      const Sole& sole) {
  // In (x, z), the forward direction is (sin, cos) and the left direction is (cos, -sin).
  const double sine = Sin(heading_rad);
  const double cosine = Cos(heading_rad);
  SolePoints points;
  for (int row = 0; row < kRows; ++row) {
    const double forward = row <= kHeelRows ? sole.heel_m * (row - kHeelRows) / kHeelRows
                                            : sole.toe_m * (row - kHeelRows) / kToeRows;
    for (int column = 0; column < kColumns; ++column) {
      const double side = sole.half_width_m * (column - kBallColumn) / kBallColumn;
      points.at(row, column) = {
          side, forward,
          terrain.HeightAt(x + sine * forward + cosine * side, z + cosine * forward - sine * side),
          false};
    }
  }
  const double ball_height = points.ball().height;
  const bool is_level = std::ranges::all_of(
      points, [&](const SolePoint& point) { return point.height == ball_height; });
  Plane plane;
  if (is_level) {
    plane.count = SolePoints::size();
  } else {
    points.Spread();
    plane = FitPlane(points, ball_height);
  }

  FootSupport support;
  support.ground_height_m = ball_height;
  support.plane_height_m = ball_height + plane.at_ball;
  for (const SolePoint& point : points) {
    const double above =
        point.height - ball_height -
        (plane.at_ball + plane.side_slope * point.side + plane.forward_slope * point.forward);
    support.rise_m = std::max(support.rise_m, above);
    support.gap_m = std::max(support.gap_m, -above);
  }
  support.carried = static_cast<double>(plane.count) / SolePoints::size();
  const double slope_x = plane.side_slope * cosine + plane.forward_slope * sine;
  const double slope_z = plane.forward_slope * cosine - plane.side_slope * sine;
  const double length = std::sqrt(slope_x * slope_x + 1.0 + slope_z * slope_z);
  support.normal = Vec3(-slope_x / length, 1.0 / length, -slope_z / length);
  return support;
}

}  // namespace stridewire
