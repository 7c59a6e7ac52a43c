#include "offline/build/example_clusters.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "runtime/skeleton/foot_vector.h"

namespace stridewire {
namespace {

double Distance(const GridExample& a, const GridExample& b, std::span<const double> units) {
  double sum = 0.0;
  for (std::size_t l = 0; l < units.size(); ++l) {
    const double difference = (a.parameters[l] - b.parameters[l]) * units[l];
    sum += difference * difference;
  }
  return std::sqrt(sum);
}

}  // namespace

std::vector<std::vector<int>> CompleteLinkage(const std::vector<GridExample>& examples,
                                              std::span<const double> units, double diameter) {
  const std::size_t n = examples.size();
  STRIDEWIRE_CHECK(diameter >= 0.0);
  std::vector<std::vector<int>> clusters(n);
  // [cluster][cluster]: distance of the most distant members of two clusters.
  std::vector<double> distance(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    clusters[i] = {static_cast<int>(i)};
    for (std::size_t j = 0; j < n; ++j)
      distance[i * n + j] = Distance(examples[i], examples[j], units);
  }
  for (;;) {
    std::size_t a = 0;
    std::size_t b = 0;
    double nearest = diameter;
    for (std::size_t i = 0; i < n; ++i) {
      if (clusters[i].empty()) continue;
      for (std::size_t j = i + 1; j < n; ++j) {
        if (!clusters[j].empty() && distance[i * n + j] < nearest) {
          nearest = distance[i * n + j];
          a = i;
          b = j;
        }
      }
    }
    if (a == b) break;
    clusters[a].insert(clusters[a].end(), clusters[b].begin(), clusters[b].end());
    clusters[b].clear();
    for (std::size_t k = 0; k < n; ++k) {
      distance[a * n + k] = distance[k * n + a] =
          std::max(distance[a * n + k], distance[b * n + k]);
    }
  }
  std::erase_if(clusters, [](const std::vector<int>& cluster) { return cluster.empty(); });
  STRIDEWIRE_CHECK(!clusters.empty() || n == 0);
  for (std::vector<int>& cluster : clusters) std::sort(cluster.begin(), cluster.end());
  return clusters;
}

GridExample AverageExamples(const std::vector<GridExample>& examples, std::span<const int> members,
                            const GridLayout& layout, const Skeleton& skeleton,
                            const RawGroup& group) {
  STRIDEWIRE_CHECK(!members.empty());
  GridExample mean = examples[static_cast<std::size_t>(members[0])];
  if (members.size() == 1) return mean;
  const double share = 1.0 / static_cast<double>(members.size());
  std::vector<double> rows(mean.rows.size(), 0.0);
  std::fill(mean.keytimes_s.begin(), mean.keytimes_s.end(), 0.0);
  std::fill(mean.parameters.begin(), mean.parameters.end(), 0.0);
  mean.heading_change_rad = 0.0;
  for (const int member : members) {
    const GridExample& example = examples[static_cast<std::size_t>(member)];
    STRIDEWIRE_CHECK(example.rows.size() == rows.size() &&
                     example.parameters.size() == mean.parameters.size());
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i] += share * example.rows[i];
    for (std::size_t i = 0; i < mean.keytimes_s.size(); ++i) {
      mean.keytimes_s[i] += share * example.keytimes_s[i];
    }
    for (std::size_t l = 0; l < mean.parameters.size(); ++l) {
      mean.parameters[l] += share * example.parameters[l];
    }
    mean.heading_change_rad += share * example.heading_change_rad;
  }
  mean.source += " and " + std::to_string(members.size() - 1) + " like it";

  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  const int joint_count = skeleton.joint_count();
  for (std::size_t begin = 0; begin < rows.size(); begin += row_floats) {
    for (std::size_t j = 0; j < static_cast<std::size_t>(joint_count); ++j) {
      const std::size_t at = begin + 4 * j;
      double* q = &rows[at];
      const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
      // If the rotations cancel each other out, their mean is undefined. The rotation of the first
      // member is used instead.
      if (norm < 0.1) {
        for (std::size_t c = 0; c < 4; ++c) {
          q[c] = examples[static_cast<std::size_t>(members[0])].rows[at + c];
        }
        continue;
      }
      for (std::size_t c = 0; c < 4; ++c) q[c] /= norm;
    }
  }
  std::transform(rows.begin(), rows.end(), mean.rows.begin(),
                 [](double value) { return static_cast<float>(value); });

  if (IsStep(group.kind)) {
    const Foot moving = MovingFoot(group.kind);
    const std::span<const float> all(mean.rows);
    const DVec3 start =
        FootVector(skeleton, PoseOfRow(all.first(row_floats), layout, joint_count), moving, 0.0);
    const DVec3 end = FootVector(skeleton, PoseOfRow(all.last(row_floats), layout, joint_count),
                                 moving, mean.heading_change_rad);
    const double measured[] = {
        start.x, start.y, start.z, end.x, end.y, end.z, mean.heading_change_rad};
    for (std::size_t l = 0; l < group.parameters.size(); ++l) {
      mean.parameters[l] = measured[static_cast<std::size_t>(group.parameters[l])];
    }
  }
  return mean;
}

}  // namespace stridewire
