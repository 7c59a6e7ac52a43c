#include "runtime/weights/correction.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.h"
#include "runtime/pose/pose_kernels.h"
#include "runtime/weights/measure.h"
#include "runtime/weights/variant_choice.h"

namespace stridewire {
namespace {

constexpr std::size_t kMaxRows = kMaxParameters + 1;  // Rows of [J; 1].
// One number per row of [J; 1]. Errors of parameters are in metres; a radian counts as
// kMetresPerRadian.
using Vector = std::array<double, kMaxRows>;
using Matrix = std::array<Vector, kMaxRows>;

// In the scale D of the changes (see CorrectWeights), this fraction of the mean |w| is added to the
// |w| of each example.
constexpr double kMinUsage = 0.5;
// Weights start to shrink when the sum of |w| is this far below its maximum.
constexpr double kMargin = 0.1;
// If the error is not much larger than this, weights shrink less, so that they are a smooth
// function of the request.
constexpr double kShrinkErrorM = 1e-4;
// Ridge added to the diagonal, relative to the trace. It keeps the matrix positive definite if the
// examples do not span all parameters.
constexpr double kRidge = 1e-9;
constexpr int kMaxHalvings = 3;
// Size of a variation in radians, as measured by PoseChange. Larger variations push toes into the
// ground in steps of the generated library.
constexpr double kVariedRad = 0.04;
// Maximum change of a pose by a variant, as measured by PoseChange. If it would be larger, the
// weight of the variant is reduced. Otherwise, knees that bend quickly when a foot lands would bend
// even more quickly.
constexpr double kVariantRad = 0.5;
constexpr double kTiny = 1e-9;
// Fractions of a step at which PoseChange measures the pose.
constexpr std::array<double, 3> kVariedAt{0.25, 0.5, 0.75};
// Maximum change of a weight relative to its value, before the effect on the parameters is removed.
// It is large, because little of the change remains in groups of generated steps. Steps that start
// or stop a walk have a lower limit: they are rarely repeated, and with the higher one, toes of
// generated steps would sink into the ground.
constexpr double kMaxRelativeChange = 12.0;
constexpr double kMaxRelativeChangeAtStand = 3.0;
// In groups with more than kMaxVariantParameters parameters, only steps that turn by at most this
// vary in pose.
constexpr double kMaxVariedTurnRad = 0.1;
// A group of climbing steps has smaller limits on weights if it has fewer captured examples than
// this per coefficient of the linear part.
constexpr int kExamplesPerCoefficient = 4;
// Feet are beside each other if they are at most this far apart in the walking direction.
constexpr double kBesideM = 0.15;
// A variation is not used if it leaves an error above this.
constexpr double kMaxVariedErrorM = 1e-4;

double Sum(std::span<const double> values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum;
}

double SumOfMagnitudes(std::span<const double> values) {
  double sum = 0.0;
  for (const double value : values) sum += std::fabs(value);
  return sum;
}

// Scales down negative weights until the sum of |w| is at most `max_sum`. Scales the others so that
// the sum remains 1.
void LimitNegativeWeights(double max_sum, std::span<double> weights) {
  double negative = 0.0;
  for (const double weight : weights) negative -= std::min(weight, 0.0);
  const double allowed = 0.5 * (max_sum - 1.0);
  if (negative <= allowed) return;
  for (double& weight : weights) {
    weight *= weight < 0.0 ? allowed / negative : (1.0 + allowed) / (1.0 + negative);
  }
}

// Cholesky factorization L L^T = matrix. Stores L in the lower triangle, including the diagonal.
// Returns false if the matrix is not positive definite.
bool Factor(Matrix& matrix, std::size_t rows) {
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = matrix[i][j];
      for (std::size_t k = 0; k < j; ++k) sum -= matrix[i][k] * matrix[j][k];
      if (i == j) {
        if (!(sum > 0.0)) return false;
        matrix[i][i] = std::sqrt(sum);
      } else {
        matrix[i][j] = sum / matrix[j][j];
      }
    }
  }
  return true;
}

void SolveFactored(const Matrix& factor, std::size_t rows, Vector& right) {
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t k = 0; k < i; ++k) right[i] -= factor[i][k] * right[k];
    right[i] /= factor[i][i];
  }
  for (std::size_t i = rows; i-- > 0;) {
    for (std::size_t k = i + 1; k < rows; ++k) right[i] -= factor[k][i] * right[k];
    right[i] /= factor[i][i];
  }
}

// Solves for the change of the weights in one Gauss-Newton iteration (see CorrectWeights).
class WeightStep {
 public:
  // `slopes` is J, [d][n], in metres. For Vary, `slopes` instead contains the `d` rows of
  // KeepInVariation. `total` is the sum of the corrected weights.
  WeightStep(std::span<const double> weights, std::span<const double> slopes, std::size_t d,
             double total)
      : weights_(weights), slopes_(slopes), n_(weights.size()), rows_(d + 1), total_(total) {
    min_usage_ = kMinUsage * SumOfMagnitudes(weights) / static_cast<double>(n_);
    for (std::size_t e = 0; e < n_; ++e) total_usage_ += Usage(e);
    for (std::size_t a = 0; a < rows_; ++a) {
      for (std::size_t b = 0; b <= a; ++b) {
        double sum = 0.0;
        for (std::size_t e = 0; e < n_; ++e) sum += Usage(e) * At(a, e) * At(b, e);
        factor_[a][b] = sum;
      }
    }
    double trace = 0.0;
    for (std::size_t a = 0; a < rows_; ++a) trace += factor_[a][a];
    for (std::size_t a = 0; a < rows_; ++a) factor_[a][a] += kRidge * trace;
    is_solvable_ = Factor(factor_, rows_);
  }

  [[nodiscard]] bool is_solvable() const { return is_solvable_; }

  // Writes weights [n] that compensate for the error `missing`. The part of the weights that does
  // not affect the parameters shrinks by the fraction `shrinking`.
  void Solve(const Vector& missing, double shrinking, std::span<double> out) const {
    Vector y = missing;
    y[rows_ - 1] = total_ - Sum(weights_);
    if (shrinking > 0.0) {
      for (std::size_t a = 0; a < rows_; ++a) {
        for (std::size_t e = 0; e < n_; ++e) y[a] += shrinking * At(a, e) * weights_[e];
      }
    }
    SolveFactored(factor_, rows_, y);
    for (std::size_t e = 0; e < n_; ++e) {
      out[e] = (1.0 - shrinking) * weights_[e] + Usage(e) * Combine(y, e);
    }
    SetSum(total_, out);
  }

  // Writes the change of the weights [n] in the direction of `variation`, without the component
  // that would change the sum of the weights or the quantities whose derivatives are the rows of
  // `slopes`.
  void Vary(const StrideVariation& variation, std::span<double> change) const {
    for (std::size_t e = 0; e < n_; ++e) change[e] = variation.WeightDirection(e) * weights_[e];
    Vector y{};
    for (std::size_t a = 0; a < rows_; ++a) {
      for (std::size_t e = 0; e < n_; ++e) y[a] += At(a, e) * change[e];
    }
    SolveFactored(factor_, rows_, y);
    for (std::size_t e = 0; e < n_; ++e) change[e] -= Usage(e) * Combine(y, e);
    SetSum(0.0, change);
  }

 private:
  [[nodiscard]] double Combine(const Vector& y, std::size_t e) const {
    double sum = 0.0;
    for (std::size_t a = 0; a < rows_; ++a) sum += At(a, e) * y[a];
    return sum;
  }
  // Restores the sum of the weights, which the ridge changes.
  void SetSum(double sum, std::span<double> out) const {
    const double left = (sum - Sum(out)) / total_usage_;
    for (std::size_t e = 0; e < n_; ++e) out[e] += left * Usage(e);
  }
  [[nodiscard]] double Usage(std::size_t e) const { return std::fabs(weights_[e]) + min_usage_; }
  [[nodiscard]] double At(std::size_t row, std::size_t e) const {
    return row + 1 == rows_ ? 1.0 : slopes_[row * n_ + e];
  }

  std::span<const double> weights_;
  std::span<const double> slopes_;
  std::size_t n_;
  std::size_t rows_;
  double total_;
  double min_usage_ = 0.0;
  double total_usage_ = 0.0;
  Matrix factor_{};
  bool is_solvable_ = false;
};

// Returns by how much the pose changes if the weights change by `change` [n], in radians: the
// square root of the sum of the squared angles of all joints, where the sum is a mean over
// kVariedAt.
double PoseChange(const MotionGroup& group, const GridLayout& layout,
                  std::span<const float> change) {
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  std::array<float, kMaxRowFloats> sum;
  double squares = 0.0;
  for (const double part : kVariedAt) {
    const auto point = static_cast<std::size_t>(part * (group.grid_point_count - 1));
    kernels::SumRows(&group.grid[point * change.size() * row_floats], change.data(), change.size(),
                     row_floats, sum.data());
    for (std::size_t j = 0; j < static_cast<std::size_t>(layout.joint_count); ++j) {
      const DQuat q(GridLayout::RotationOf(sum.data(), j));
      squares += 4.0 * glm::dot(q, q);
    }
  }
  return std::sqrt(squares / static_cast<double>(kVariedAt.size()));
}

// Adds a change to the weights [n]. `size_rad` is its size as measured by PoseChange. The change is
// scaled to kVariedRad, but at most by `max_scale`. If the sum of |w| would exceed
// max_sum - kMargin, the change is reduced further, if necessary to 0.
void AddVariation(std::span<const double> change, double size_rad, double max_scale, double max_sum,
                  std::span<double> weights) {
  const double scale = std::min(max_scale, kVariedRad / std::max(size_rad, kTiny));
  double sum = 0.0;
  for (std::size_t e = 0; e < weights.size(); ++e) {
    sum += std::fabs(weights[e] + scale * change[e]);
  }
  // The sum of |w| is convex, so linear interpolation keeps it within its limit.
  const double before = SumOfMagnitudes(weights);
  const double room = std::max(0.0, max_sum - kMargin - before);
  const double part = scale * std::min(1.0, room / std::max(sum - before, kTiny));
  for (std::size_t e = 0; e < weights.size(); ++e) weights[e] += part * change[e];
}

// Returns true if a step may vary in pose: all steps of groups with at most two parameters, which
// are straight, and level steps of other groups that hardly turn and have a parameter for the
// sideways position of the foot that lands. Steps that turn more are rarely repeated, and their
// examples differ so much that soles would enter the ground. Without that parameter, a variation
// would move the foot sideways.
bool MayVary(const MotionGroup& group, const ParameterValues& wanted) {
  if (wanted.count <= static_cast<int>(kMaxVariantParameters)) return true;
  const int turn = group.FindParameter(ParameterName::kTurn);
  return group.FindParameter(ParameterName::kEndX) >= 0 &&
         group.FindParameter(ParameterName::kEndY) < 0 &&
         (turn < 0 ||
          std::fabs(wanted.values[static_cast<std::size_t>(turn)]) <= kMaxVariedTurnRad);
}

// Returns true if a step starts or stops a walk, that is, if the feet are beside each other at its
// start or at its end.
bool StartsOrStops(const MotionGroup& group, const ParameterValues& parameters) {
  for (const ParameterName name : {ParameterName::kStartZ, ParameterName::kEndZ}) {
    const int l = group.FindParameter(name);
    if (l >= 0 && std::fabs(parameters.values[static_cast<std::size_t>(l)]) < kBesideM) return true;
  }
  return false;
}

// Writes the quantities that a random variation of the weights must not change to `rows`
// [row][n], with the value of each example: the parameters and, in generated steps that start or
// stop a walk, the keytimes if there is room. Returns the number of rows, at most kMaxParameters.
// `unit` contains metres per unit of each parameter.
std::size_t KeepInVariation(const MotionGroup& group, const ParameterValues& wanted,
                            const Vector& unit, std::span<double> rows) {
  const std::size_t d = group.parameters.size();
  const auto n = static_cast<std::size_t>(group.example_count);
  for (std::size_t l = 0; l < d; ++l) {
    for (std::size_t e = 0; e < n; ++e) {
      rows[l * n + e] = unit[l] * group.site(static_cast<int>(e))[l];
    }
  }
  // The keytimes of generated starts and stops differ considerably. If a variation shortened an
  // interval, the body would brake or accelerate harder in it.
  const std::size_t intervals = group.cells.size();
  if (!group.is_completed || !StartsOrStops(group, wanted)) return d;
  if (d + intervals > kMaxParameters) return d;
  for (std::size_t k = 0; k < intervals; ++k) {
    for (std::size_t e = 0; e < n; ++e) {
      rows[(d + k) * n + e] = group.keytimes_s[e * (intervals + 1) + k + 1];
    }
  }
  return d + intervals;
}

}  // namespace

CorrectionLimits DefaultCorrectionLimits(const MotionGroup& group) {
  CorrectionLimits limits{.max_iterations = group.parameter_count() <= 2 ? 3 : 8};
  const bool has_heights = group.FindParameter(ParameterName::kStartY) >= 0 ||
                           group.FindParameter(ParameterName::kEndY) >= 0;
  const int enough = kExamplesPerCoefficient * (group.parameter_count() + 1);
  if (has_heights && !group.is_completed && group.example_count < enough) {
    limits.start_weight_sum = kSparseStartWeightSum;
    limits.weight_sum = kSparseWeightSum;
  }
  return limits;
}

CorrectionScratch::CorrectionScratch(const Skeleton& skeleton, const GridLayout& layout,
                                     int max_row_count)
    : ends_(skeleton, layout) {
  STRIDEWIRE_CHECK(max_row_count >= 0 &&
                   max_row_count <= MotionLibrary::kMaxExamples + MotionLibrary::kMaxVariants);
  const auto n = static_cast<std::size_t>(max_row_count);
  weights_.resize(n);
  next_.resize(n);
  halved_.resize(n);
  slopes_.resize(n * kMaxParameters);
}

CorrectionScratch::CorrectionScratch(const MotionLibrary& library)
    : CorrectionScratch(library.skeleton(), library.layout(), library.max_row_count()) {}

Correction CorrectWeights(const MotionGroup& group, const ParameterValues& wanted,
                          const CorrectionLimits& limits, CorrectionScratch& scratch,
                          Movement& movement, const std::optional<StrideVariation>& variation) {
  const std::size_t d = group.parameters.size();
  const auto n = static_cast<std::size_t>(group.example_count);
  STRIDEWIRE_CHECK(n <= scratch.weights_.size() && d <= kMaxParameters);
  const std::span<double> weights = scratch.weights(group);
  const std::span<double> next = std::span(scratch.next_).first(n);
  const std::span<double> halved = std::span(scratch.halved_).first(n);
  const std::span<double> slopes = std::span(scratch.slopes_).first(d * n);
  EndPoses& ends = scratch.ends_;
  ends.SetGroup(group);
  Vector unit{};
  for (std::size_t l = 0; l < d; ++l) {
    unit[l] = group.parameters[l].name == ParameterName::kTurn ? kMetresPerRadian : 1.0;
  }

  struct ParameterError {
    Vector missing{};  // p^ - a(w).
    double largest_m = 0.0;
  };
  VariantShare share;
  const auto apply = [&](std::span<const double> w) {
    ApplyWeights(group, w, movement);
    if (share.variant >= 0) AddVariant(group, share.variant, share.weight, movement);
  };
  const auto measure = [&](std::span<const double> w) {
    apply(w);
    ends.Blend(movement);
    const ParameterValues measured = ends.Measure();
    ParameterError error;
    for (std::size_t l = 0; l < d; ++l) {
      error.missing[l] = unit[l] * (wanted.values[l] - measured.values[l]);
      error.largest_m = std::max(error.largest_m, std::fabs(error.missing[l]));
    }
    return error;
  };

  SetWeights(group, -1, std::span(wanted.values).first(d), weights, movement);
  LimitNegativeWeights(limits.start_weight_sum, weights);
  double max_sum = std::max(limits.weight_sum, SumOfMagnitudes(weights));
  const bool is_varied = variation.has_value() && MayVary(group, wanted);
  if (is_varied && group.variant_count == 0) {
    const std::size_t kept_count = KeepInVariation(group, wanted, unit, scratch.slopes_);
    const std::span<const double> kept = std::span(scratch.slopes_).first(kept_count * n);
    const WeightStep step(weights, kept, kept_count, 1.0);
    if (step.is_solvable()) {
      step.Vary(*variation, next);
      ApplyWeights(group, next, movement);
      AddVariation(next, PoseChange(group, ends.layout(), movement.weights),
                   StartsOrStops(group, wanted) ? kMaxRelativeChangeAtStand : kMaxRelativeChange,
                   max_sum, weights);
    }
  }
  if (is_varied) share = ChooseVariant(group, wanted, *variation);
  if (share.variant >= 0) {
    const ParameterValues applied = movement.parameters;
    SetWeights(group, -1, group.variant(share.variant), next, movement);
    movement.parameters = applied;
    for (double& weight : next) weight = -weight;
    ApplyWeights(group, next, movement);
    AddVariant(group, share.variant, 1.0, movement);
    const double size_rad = PoseChange(group, ends.layout(), movement.weights);
    share.weight *= std::min(1.0, kVariantRad / std::max(size_rad, kTiny));
    for (std::size_t e = 0; e < n; ++e) weights[e] += share.weight * next[e];
    max_sum = std::max(max_sum, SumOfMagnitudes(weights));
  }
  ParameterError best = measure(weights);
  Correction correction;
  correction.initial_error_m = best.largest_m;
  while (correction.iterations < limits.max_iterations && best.largest_m > limits.tolerance_m) {
    ++correction.iterations;
    ends.MeasureSlopes(slopes);
    for (std::size_t l = 0; l < d; ++l) {
      for (std::size_t e = 0; e < n; ++e) slopes[l * n + e] *= unit[l];
    }
    const WeightStep step(weights, slopes, d, 1.0 - share.weight);
    if (!step.is_solvable()) break;
    step.Solve(best.missing, 0.0, next);
    const double size = SumOfMagnitudes(next);
    if (size > max_sum - kMargin) {
      step.Solve(best.missing, 1.0, halved);
      const double least = SumOfMagnitudes(halved);
      // The new weights depend linearly on the amount of shrinking, and the sum of |w| is a convex
      // function of it. Linear interpolation between no and full shrinking thus gives a sufficient
      // amount.
      const double shrinking = least < size
                                   ? std::min((size - max_sum + kMargin) / (size - least), 1.0) *
                                         best.largest_m / (best.largest_m + kShrinkErrorM)
                                   : 0.0;
      for (std::size_t e = 0; e < n; ++e) next[e] += shrinking * (halved[e] - next[e]);
    }
    bool is_better = false;
    for (int halvings = 0; halvings <= kMaxHalvings && !is_better; ++halvings) {
      const double part = 1.0 / static_cast<double>(1 << halvings);
      for (std::size_t e = 0; e < n; ++e) halved[e] = weights[e] + part * (next[e] - weights[e]);
      if (SumOfMagnitudes(halved) > max_sum) continue;
      const ParameterError error = measure(halved);
      if (!(error.largest_m < best.largest_m)) continue;
      best = error;
      std::copy(halved.begin(), halved.end(), weights.begin());
      is_better = true;
    }
    if (!is_better) break;
  }
  if (is_varied && best.largest_m > kMaxVariedErrorM) {
    return CorrectWeights(group, wanted, limits, scratch, movement);
  }
  apply(weights);
  correction.error_m = best.largest_m;
  STRIDEWIRE_CHECK(!(correction.error_m > correction.initial_error_m));
  return correction;
}

}  // namespace stridewire
