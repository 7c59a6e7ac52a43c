#include "stridewire/runtime/correction.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "stridewire/runtime/measure.h"

namespace stridewire {
namespace {

using Vector = std::array<double, kMaxParameters>;  // metres; a radian is kMetresPerRadian
using Matrix = std::array<Vector, kMaxParameters>;

constexpr double kSlopeStepM = 2e-3;
// Slopes cost one measurement a parameter; below this error the rank-one update does.
constexpr double kSlopeErrorM = 1e-4;
constexpr double kSmallestPivot = 0.1;  // a' is near the identity; else directions are not spanned
constexpr double kSmallestUpdate = 0.05;

Matrix Identity(std::size_t d) {
  Matrix matrix{};
  for (std::size_t l = 0; l < d; ++l) matrix[l][l] = 1.0;
  return matrix;
}

// Gauss-Jordan with pivoting; false, and `inverse` as it was, if the matrix is nearly singular.
bool Invert(Matrix matrix, std::size_t d, Matrix& inverse) {
  Matrix result = Identity(d);
  for (std::size_t i = 0; i < d; ++i) {
    std::size_t pivot = i;
    for (std::size_t k = i + 1; k < d; ++k) {
      if (std::fabs(matrix[k][i]) > std::fabs(matrix[pivot][i])) pivot = k;
    }
    if (!(std::fabs(matrix[pivot][i]) >= kSmallestPivot)) return false;
    std::swap(matrix[i], matrix[pivot]);
    std::swap(result[i], result[pivot]);
    const double divisor = matrix[i][i];
    for (std::size_t c = 0; c < d; ++c) {
      matrix[i][c] /= divisor;
      result[i][c] /= divisor;
    }
    for (std::size_t k = 0; k < d; ++k) {
      if (k == i) continue;
      const double factor = matrix[k][i];
      for (std::size_t c = 0; c < d; ++c) {
        matrix[k][c] -= factor * matrix[i][c];
        result[k][c] -= factor * result[i][c];
      }
    }
  }
  inverse = result;
  return true;
}

// B += (s - B y) (s^T B) / (s^T B y), so that B y = s: s the step, y what a(p) moved by.
void UpdateInverse(const Vector& s, const Vector& y, std::size_t d, Matrix& b) {
  Vector by{};
  Vector sb{};
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j < d; ++j) {
      by[i] += b[i][j] * y[j];
      sb[j] += s[i] * b[i][j];
    }
  }
  double sby = 0.0;
  double ss = 0.0;
  for (std::size_t l = 0; l < d; ++l) {
    sby += s[l] * by[l];
    ss += s[l] * s[l];
  }
  if (!(std::fabs(sby) > kSmallestUpdate * ss)) return;
  for (std::size_t i = 0; i < d; ++i) {
    for (std::size_t j = 0; j < d; ++j) b[i][j] += (s[i] - by[i]) * sb[j] / sby;
  }
}

}  // namespace

CorrectionLimits DefaultCorrectionLimits(const MotionGroup& group) {
  return {.max_iterations = group.parameter_count() <= 2 ? 3 : 8};
}

Correction CorrectParameters(const MotionLibrary& library, int group_index,
                             const ParameterValues& wanted, const CorrectionLimits& limits,
                             std::span<double> weight_scratch, GridCache& cache, PoseSpan pose,
                             Movement& movement) {
  const Correction correction =
      CorrectParameters(library.skeleton(), library.layout(), library.group(group_index), wanted,
                        limits, weight_scratch, cache, pose, movement);
  movement.group = group_index;
  return correction;
}

Correction CorrectParameters(const Skeleton& skeleton, const GridLayout& layout,
                             const MotionGroup& group, const ParameterValues& wanted,
                             const CorrectionLimits& limits, std::span<double> weight_scratch,
                             GridCache& cache, PoseSpan pose, Movement& movement) {
  const std::size_t d = group.parameters.size();
  Vector unit{};
  for (std::size_t l = 0; l < d; ++l) {
    unit[l] = group.parameters[l].name == ParameterName::kTurn ? kMetresPerRadian : 1.0;
  }
  movement.base = {};  // near the origin floats are finest

  // A shift from p^, and r = p^ - a(p^ + shift).
  struct Point {
    Vector shift{};
    Vector r{};
    double error_m = 0.0;
    double weight_sum = 0.0;  // of |w|
  };
  const auto parameters_at = [&](const Vector& shift) {
    ParameterValues p = wanted;
    for (std::size_t l = 0; l < d; ++l) p.values[l] += shift[l] / unit[l];
    return p;
  };
  const auto measure = [&](const Vector& shift) {
    Point point;
    point.shift = shift;
    const ParameterValues p = parameters_at(shift);
    SetWeights(group, -1, std::span(p.values).first(d), weight_scratch, movement);
    for (const float weight : movement.weights) {
      point.weight_sum += std::fabs(static_cast<double>(weight));
    }
    cache.Clear();
    const ParameterValues measured =
        MeasureMovement(skeleton, layout, group, movement, cache, pose);
    for (std::size_t l = 0; l < d; ++l) {
      point.r[l] = unit[l] * (wanted.values[l] - measured.values[l]);
      point.error_m = std::max(point.error_m, std::fabs(point.r[l]));
    }
    return point;
  };

  Point best = measure({});
  Correction correction;
  correction.initial_error_m = best.error_m;
  const double max_weight_sum = std::max(kMaxCorrectedWeightSum, best.weight_sum);
  Matrix b = Identity(d);
  double damping = 1.0;
  int i = 0;
  for (; i < limits.max_iterations && best.error_m > limits.tolerance_m; ++i) {
    if (i > 0 && damping == 1.0 && best.error_m > kSlopeErrorM) {
      Matrix slopes{};  // [row][column] = da_row / dp_column
      for (std::size_t column = 0; column < d; ++column) {
        Vector shift = best.shift;
        shift[column] += kSlopeStepM;
        const Vector r = measure(shift).r;
        for (std::size_t row = 0; row < d; ++row) {
          slopes[row][column] = (best.r[row] - r[row]) / kSlopeStepM;
        }
      }
      Invert(slopes, d, b);
    }
    Vector shift = best.shift;
    double reach_m = 0.0;
    for (std::size_t row = 0; row < d; ++row) {
      for (std::size_t column = 0; column < d; ++column) {
        shift[row] += damping * b[row][column] * best.r[column];
      }
      reach_m = std::max(reach_m, std::fabs(shift[row]));
    }
    if (!(reach_m <= kMaxCorrectionM)) {
      damping *= 0.5;
      continue;
    }
    const Point next = measure(shift);
    Vector step{};
    Vector moved{};
    for (std::size_t l = 0; l < d; ++l) {
      step[l] = next.shift[l] - best.shift[l];
      moved[l] = best.r[l] - next.r[l];
    }
    UpdateInverse(step, moved, d, b);
    if (next.error_m < best.error_m && next.weight_sum <= max_weight_sum) {
      best = next;
      damping = 1.0;
    } else {
      damping *= 0.5;
    }
  }
  correction.parameters = parameters_at(best.shift);
  correction.error_m = best.error_m;
  correction.iterations = i;
  return correction;
}

}  // namespace stridewire
