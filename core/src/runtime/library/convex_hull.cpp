#include "runtime/library/convex_hull.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/check.h"
#include "stridewire/runtime/motion_library.h"

// Wolfe's algorithm finds the point of smallest norm in a polytope. It keeps a "corral", a set of
// affinely independent vertices. Each round adds the vertex that is furthest in the direction from
// the current point to the origin. Then it drops vertices until the point of smallest norm in the
// affine hull of the corral is inside the corral:
//
//            o  origin (= the target)
//            |
//    v1 -----x---------- v2      x: nearest point, a convex combination of the corral {v1, v2}

namespace stridewire {
namespace {

constexpr int kMaxRounds = 200;
// Maximum number of vertices that are stored. In larger groups, which are rare, the other vertices
// are computed again whenever they are needed.
constexpr std::size_t kMaxStoredVertices = 256;
constexpr double kInside = 1e-9;

// The number of dimensions `D` is a template argument, so that the compiler unrolls the many short
// loops over it.
template <std::size_t D>
using Point = std::array<double, D>;

template <std::size_t D>
double DotProduct(const Point<D>& a, const Point<D>& b) {
  double sum = 0.0;
  for (std::size_t l = 0; l < D; ++l) sum += a[l] * b[l];
  return sum;
}

template <std::size_t D>
struct Corral {
  std::size_t size = 0;
  std::array<Point<D>, D + 1> points{};
  std::array<double, D + 1> lambda{};  // Weights of the points: >= 0, sum 1.

  void Remove(std::size_t i) {
    --size;
    for (; i < size; ++i) {
      points[i] = points[i + 1];
      lambda[i] = lambda[i + 1];
    }
  }
};

// Computes the weights (of any sign, sum 1) of the point of smallest norm in the affine hull of the
// corral. Solves (1 1^T + P P^T) v = 1 by Gaussian elimination with pivoting; the weights are v /
// sum v. Returns false if the system is singular.
template <std::size_t D>
bool AffineMinimum(const Corral<D>& corral, std::array<double, D + 1>& weights) {
  const std::size_t n = corral.size;
  std::array<std::array<double, D + 2>, D + 1> m;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      m[i][j] = m[j][i] = 1.0 + DotProduct<D>(corral.points[i], corral.points[j]);
    }
    m[i][n] = 1.0;
  }
  for (std::size_t i = 0; i < n; ++i) {
    std::size_t pivot = i;
    for (std::size_t r = i + 1; r < n; ++r) {
      if (std::fabs(m[r][i]) > std::fabs(m[pivot][i])) pivot = r;
    }
    if (std::fabs(m[pivot][i]) < 1e-13) return false;
    std::swap(m[i], m[pivot]);
    for (std::size_t r = i + 1; r < n; ++r) {
      const double f = m[r][i] / m[i][i];
      for (std::size_t c = i; c <= n; ++c) m[r][c] -= f * m[i][c];
    }
  }
  double sum = 0.0;
  for (std::size_t i = n; i-- > 0;) {
    double value = m[i][n];
    for (std::size_t c = i + 1; c < n; ++c) value -= m[i][c] * weights[c];
    weights[i] = value / m[i][i];
    sum += weights[i];
  }
  if (std::fabs(sum) < 1e-13) return false;
  for (std::size_t i = 0; i < n; ++i) weights[i] /= sum;
  return true;
}

template <std::size_t D>
double Project(std::span<const double> points, std::span<const double> metric, double growth,
               std::span<const double> target, std::span<double> nearest) {
  STRIDEWIRE_CHECK(points.size() >= D && points.size() % D == 0);
  const std::size_t count = points.size() / D;
  STRIDEWIRE_CHECK(count <= MotionLibrary::kMaxExamples);

  Point<D> sum{};
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t l = 0; l < D; ++l) sum[l] += points[i * D + l];
  }
  Point<D> mean{};
  for (std::size_t l = 0; l < D; ++l) mean[l] = sum[l] / static_cast<double>(count);
  // Vertices of the enlarged hull, relative to the target and multiplied by the metric. Only the
  // first ones are stored, so that large groups need no more stack than small ones.
  const auto compute_vertex = [&](std::size_t i) {
    Point<D> vertex{};
    for (std::size_t l = 0; l < D; ++l) {
      const double grown = mean[l] + (1.0 + growth) * (points[i * D + l] - mean[l]);
      vertex[l] = (grown - target[l]) * metric[l];
    }
    return vertex;
  };
  std::array<Point<D>, kMaxStoredVertices> stored;
  const std::size_t stored_count = std::min(count, kMaxStoredVertices);
  for (std::size_t i = 0; i < stored_count; ++i) stored[i] = compute_vertex(i);
  const auto vertex_at = [&](std::size_t i) {
    return i < stored_count ? stored[i] : compute_vertex(i);
  };
  // Returns the index of the vertex with the smallest `value`, and that value.
  const auto find_least = [&](const auto& value) {
    std::pair<std::size_t, double> least{0, HUGE_VAL};
    const auto consider = [&](std::size_t i, double v) {
      if (v < least.second) least = {i, v};
    };
    for (std::size_t i = 0; i < stored_count; ++i) consider(i, value(stored[i]));
    for (std::size_t i = stored_count; i < count; ++i) consider(i, value(compute_vertex(i)));
    return least;
  };

  const auto start =
      find_least([&](const Point<D>& vertex) { return DotProduct<D>(vertex, vertex); }).first;
  Corral<D> corral;
  corral.size = 1;
  corral.points[0] = vertex_at(start);
  corral.lambda[0] = 1.0;
  Point<D> x = corral.points[0];

  for (int round = 0; round < kMaxRounds; ++round) {
    const double norm = DotProduct<D>(x, x);
    if (norm < kInside * kInside) break;
    const auto [candidate, least] =
        find_least([&](const Point<D>& vertex) { return DotProduct<D>(x, vertex); });
    if (least > norm - 1e-12 * std::max(1.0, norm)) break;  // No vertex is closer to the origin.
    if (corral.size == D + 1) {  // The corral is full: remove the vertex with the smallest weight.
      const auto smallest = std::min_element(
          corral.lambda.begin(), corral.lambda.begin() + static_cast<long>(corral.size));
      corral.Remove(static_cast<std::size_t>(smallest - corral.lambda.begin()));
    }
    corral.points[corral.size] = vertex_at(candidate);
    corral.lambda[corral.size] = 0.0;
    ++corral.size;

    std::array<double, D + 1> weights{};
    bool solved = false;
    while (corral.size > 0) {
      if (!AffineMinimum<D>(corral, weights)) {
        corral.Remove(corral.size - 1);  // The new vertex is affinely dependent on the others.
        break;
      }
      const auto end = weights.begin() + static_cast<long>(corral.size);
      if (std::all_of(weights.begin(), end, [](double w) { return w > 1e-12; })) {
        solved = true;
        break;
      }
      // Move lambda towards the affine minimum until a weight reaches 0, then drop that vertex.
      double theta = 1.0;
      for (std::size_t i = 0; i < corral.size; ++i) {
        if (weights[i] <= 1e-12 && corral.lambda[i] > weights[i]) {
          theta = std::min(theta, corral.lambda[i] / (corral.lambda[i] - weights[i]));
        }
      }
      for (std::size_t i = 0; i < corral.size; ++i) {
        corral.lambda[i] += theta * (weights[i] - corral.lambda[i]);
      }
      const std::size_t before = corral.size;
      for (std::size_t i = corral.size; i-- > 0;) {
        if (corral.lambda[i] <= 1e-12) corral.Remove(i);
      }
      if (corral.size == before) break;
    }
    if (!solved) break;
    for (std::size_t i = 0; i < corral.size; ++i) corral.lambda[i] = weights[i];
    Point<D> next{};
    for (std::size_t i = 0; i < corral.size; ++i) {
      for (std::size_t l = 0; l < D; ++l) next[l] += corral.lambda[i] * corral.points[i][l];
    }
    if (DotProduct<D>(next, next) >= norm) break;  // Rounding errors prevent further progress.
    x = next;
  }

  const double distance = std::sqrt(DotProduct<D>(x, x));
  for (std::size_t l = 0; l < D; ++l) {
    nearest[l] = distance < kInside ? target[l] : target[l] + x[l] / metric[l];
  }
  return distance < kInside ? 0.0 : distance;
}

}  // namespace

double ProjectOntoHull(std::span<const double> points, std::span<const double> metric,
                       double growth, std::span<const double> target, std::span<double> nearest) {
  static_assert(kMaxParameters == 7);
  STRIDEWIRE_CHECK(!metric.empty() && metric.size() <= kMaxParameters);
  switch (metric.size()) {
    case 1: return Project<1>(points, metric, growth, target, nearest);
    case 2: return Project<2>(points, metric, growth, target, nearest);
    case 3: return Project<3>(points, metric, growth, target, nearest);
    case 4: return Project<4>(points, metric, growth, target, nearest);
    case 5: return Project<5>(points, metric, growth, target, nearest);
    case 6: return Project<6>(points, metric, growth, target, nearest);
    default: return Project<7>(points, metric, growth, target, nearest);
  }
}

}  // namespace stridewire
