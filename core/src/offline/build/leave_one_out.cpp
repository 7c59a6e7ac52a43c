#include "offline/build/leave_one_out.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "base/check.h"
#include "offline/base/parallel.h"
#include "offline/build/example_clusters.h"
#include "offline/build/parameter_scales.h"
#include "offline/build/smooth_examples.h"
#include "runtime/avatar/avatar_body.h"
#include "runtime/library/cardinal_basis.h"
#include "runtime/library/contact_keytimes.h"
#include "runtime/library/convex_hull.h"
#include "runtime/plan/foot_locks.h"
#include "runtime/plan/foot_planner.h"
#include "runtime/plan/request_plan.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/weights/correction.h"
#include "runtime/weights/measure.h"

namespace stridewire {
namespace {

constexpr double kSameSite = 1e-9;

// All examples except one. Near duplicates are averaged into one site.
struct Others {
  std::vector<int> examples;
  std::vector<std::vector<int>> clusters;
  std::vector<double> sites;  // [cluster][parameter]
};

Others OthersOf(const MotionGroup& group, int left_out, double cluster_diameter_m) {
  STRIDEWIRE_CHECK(left_out >= 0 && left_out < group.example_count);
  Others others;
  std::vector<GridExample> points;
  for (int e = 0; e < group.example_count; ++e) {
    if (e == left_out) continue;
    others.examples.push_back(e);
    points.emplace_back().parameters.assign(group.site(e).begin(), group.site(e).end());
  }
  std::vector<double> units;
  for (const Parameter& parameter : group.parameters) {
    units.push_back(parameter.name == ParameterName::kTurn ? kMetresPerRadian : 1.0);
  }
  for (std::vector<int>& cluster : CompleteLinkage(points, units, cluster_diameter_m)) {
    for (std::size_t l = 0; l < group.parameters.size(); ++l) {
      double sum = 0.0;
      for (const int i : cluster) sum += points[static_cast<std::size_t>(i)].parameters[l];
      others.sites.push_back(sum / static_cast<double>(cluster.size()));
    }
    for (int& i : cluster) i = others.examples[static_cast<std::size_t>(i)];
    others.clusters.push_back(std::move(cluster));
  }
  return others;
}

// A group that is fitted without one of the examples. Like a pseudoexample, each of its sites has a
// weight per example, so a blend of sites is a blend of examples as well. The group stores the
// motion of all examples, but the weights of the excluded one are 0.
struct GroupOfOthers {
  CardinalBasis basis;
  std::vector<double> linear;
  std::vector<double> radial;
  MotionGroup group;  // Its spans refer to the other members.
};

// Fits a group to sites. Row `site` of `shares` [site][example] contains the weights with which the
// site blends the examples.
std::unique_ptr<GroupOfOthers> FitOthers(const MotionGroup& original, std::span<const double> sites,
                                         std::span<const double> shares, bool is_smooth) {
  const std::vector<double> scales = ScalesOf(original);
  const auto n = static_cast<std::size_t>(original.example_count);
  const std::size_t count = shares.size() / n;
  STRIDEWIRE_CHECK(count > 0 && shares.size() == count * n);
  STRIDEWIRE_CHECK(sites.size() == count * static_cast<std::size_t>(original.parameter_count()));
  auto fitted = std::make_unique<GroupOfOthers>();
  if (is_smooth) {
    auto wide = FitSmoothBasis(sites, scales);
    if (!wide) return nullptr;
    fitted->basis = std::move(wide->basis);
  } else {
    auto basis = CardinalBasisFit{.parameter_count = original.parameter_count(),
                                  .example_count = static_cast<int>(count),
                                  .sites = sites,
                                  .scales = scales}
                     .Run();
    if (!basis) return nullptr;
    fitted->basis = *std::move(basis);
  }
  const auto blend = [&](const std::vector<double>& rows) {
    std::vector<double> blended(rows.size() / count * n);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      for (std::size_t e = 0; e < n; ++e) {
        blended[i / count * n + e] += rows[i] * shares[i % count * n + e];
      }
    }
    return blended;
  };
  fitted->linear = blend(fitted->basis.linear);
  fitted->radial = blend(fitted->basis.radial);
  MotionGroup& group = fitted->group;
  group = original;
  group.sites = fitted->basis.sites;
  group.site_count = static_cast<int>(count);
  group.site_weights = {};
  group.dilations = fitted->basis.dilations;
  group.linear = fitted->linear;
  group.radial = fitted->radial;
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    group.parameters[l].centre = fitted->basis.centres[l];
  }
  return fitted;
}

std::vector<double> NearestWeights(const MotionGroup& group, int left_out, std::size_t used) {
  STRIDEWIRE_CHECK(used > 0);
  const std::span<const double> wanted = group.site(left_out);
  std::vector<std::pair<double, int>> near;
  for (int e = 0; e < group.example_count; ++e) {
    if (e == left_out) continue;
    double squared = 0.0;
    for (std::size_t l = 0; l < wanted.size(); ++l) {
      const double difference = (group.site(e)[l] - wanted[l]) / group.parameters[l].scale;
      squared += difference * difference;
    }
    near.emplace_back(std::sqrt(squared), e);
  }
  std::sort(near.begin(), near.end());
  near.resize(std::min(used, near.size()));
  std::vector<double> weights(static_cast<std::size_t>(group.example_count));
  double sum = 0.0;
  for (const auto& [distance, e] : near) {
    const double weight = 1.0 / std::max(distance, kSameSite);
    weights[static_cast<std::size_t>(e)] = weight;
    sum += weight;
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

// Differences between one excluded movement and its synthesis by one method.
struct Comparison {
  bool is_valid = false;
  PoseError pose;
  double planted_m = 0.0;
  double foot_m = 0.0;
  double keytime_s = 0.0;
  double parameter_m = 0.0;
};

std::vector<double> Keytimes(const MotionGroup& group, std::span<const double> weights) {
  const auto keys = static_cast<std::size_t>(group.interval_count()) + 1;
  std::vector<double> keytimes(keys);
  for (std::size_t e = 0; e < weights.size(); ++e) {
    for (std::size_t k = 0; k < keys; ++k) {
      keytimes[k] += weights[e] * group.keytimes_s[e * keys + k];
    }
  }
  return keytimes;
}

class Comparer {
 public:
  Comparer(const MotionLibrary& library, int group_index)
      : library_(library),
        group_index_(group_index),
        group_(library.group(group_index)),
        comparison_(library.skeleton(), library.stand_pose()),
        cache_(library.layout()),
        pose_(library.skeleton().joint_count()),
        body_(std::shared_ptr<const MotionLibrary>(std::shared_ptr<void>(), &library)),
        plan_scratch_(library) {
    body_.plants_feet = true;
  }

  // Returns the weights [example] that an avatar would use: those for the parameters `wanted`,
  // projected onto the hull of the other examples, after correction. Returns an empty vector if the
  // weights cannot be solved. `products` is the result of MovementProducts.
  std::vector<double> CardinalWeights(const Others& others, std::span<const double> products,
                                      std::span<const double> wanted) {
    const auto smoothness = ChooseSmoothness(group_, others.examples, products);
    const auto smooth = smoothness ? FitSmooth(group_, others.examples, *smoothness) : nullptr;
    const auto n = static_cast<std::size_t>(group_.example_count);
    std::vector<double> shares(others.clusters.size() * n);
    CorrectionScratch scratch(library_.skeleton(), library_.layout(), group_.example_count);
    for (std::size_t c = 0; c < others.clusters.size(); ++c) {
      const std::span<double> share = std::span(shares).subspan(c * n, n);
      const std::vector<int>& cluster = others.clusters[c];
      for (const int e : cluster) {
        share[static_cast<std::size_t>(e)] = 1.0 / static_cast<double>(cluster.size());
      }
      if (smooth == nullptr) continue;
      const std::span<const double> site =
          std::span(others.sites).subspan(c * wanted.size(), wanted.size());
      if (SetSmoothWeights(*smooth, site, scratch, movement_)) {
        std::ranges::copy(scratch.weights(group_), share.begin());
      }
    }
    const auto fitted = FitOthers(group_, others.sites, shares, smooth != nullptr);
    if (fitted == nullptr) return {};
    ParameterValues applied{.count = group_.parameter_count()};
    ProjectOntoHull(others.sites, MetricOf(group_), kHullGrowth, wanted,
                    std::span(applied.values).first(wanted.size()));
    CorrectWeights(fitted->group, applied, DefaultCorrectionLimits(group_), scratch, movement_);
    return {movement_.weights.begin(),
            movement_.weights.begin() + static_cast<std::ptrdiff_t>(group_.example_count)};
  }

  // Returns the poses of the movement with these weights and planted feet, as an avatar displays
  // them. The feet start where those of the left-out example start, and the moving foot lands on
  // the footprint of that example.
  std::vector<Pose> PlantedPoses(int left_out, std::span<const double> weights,
                                 std::span<const Pose> truth) {
    const Foot moving = MovingFoot(group_.kind);
    const auto m = static_cast<std::size_t>(moving);
    // Returns the feet of a pose. The ground under the moving foot is at GroundRise of the
    // parameter `height`, or at 0 if the group lacks this parameter. The other foot stands at 0.
    const auto feet_of = [&](const Pose& pose, ParameterName height) {
      FootLocks feet = FootLocksOf(library_.skeleton(), library_.leg_rig(), pose, 0.0, nullptr);
      if (const int l = group_.FindParameter(height); l >= 0) {
        feet[m].print.position_m.y = GroundRise(group_.site(left_out)[static_cast<std::size_t>(l)]);
      }
      return feet;
    };
    RequestPlan request;
    request.group = group_index_;
    request.requested = request.applied = ValuesOf(group_.site(left_out));
    request.exact = feet_of(truth.back(), ParameterName::kEndY)[m].print;
    request.turn_rad = group_.heading_change_rad[static_cast<std::size_t>(left_out)];

    AvatarBody& body = body_;
    body.locks = feet_of(truth.front(), ParameterName::kStartY);
    body.movement.group = group_index_;
    // The avatar begins in the first pose of the blend, planted on these footprints.
    ApplyWeights(group_, weights, body.movement);
    body.StartWeighted(BaseFrame{}, 1.0);
    plan_scratch_.cache().Clear();
    EvaluateBlend(group_, library_.layout(), body.movement, 0.0, plan_scratch_.cache(),
                  body.blended_pose);
    const FootLocks blended = feet_of(body.blended_pose, ParameterName::kStartY);
    body.blended_pose.root_position_m +=
        Vec3(body.locks[1 - m].print.position_m - blended[1 - m].print.position_m);
    StandOn(body.locks, body.movement);
    body.earlier_feet[0] =
        CorrectFeet(library_.skeleton(), library_.leg_rig(), body.movement, 0.0, body.blended_pose);
    body.StartWeighted(BaseFrame{}, 1.0);
    body.BlendIn(LandingTarget{request, nullptr, DVec3(0.0)}, false, plan_scratch_);

    std::vector<Pose> poses;
    for (int p = 0; p < group_.grid_point_count; ++p) {
      body.Evaluate(body.movement.warp.TimeAt(p));
      poses.push_back(body.pose);
    }
    return poses;
  }

  Comparison Compare(int left_out, std::span<const double> weights) {
    STRIDEWIRE_CHECK(weights.size() == static_cast<std::size_t>(group_.example_count));
    std::vector<double> one(weights.size());
    one[static_cast<std::size_t>(left_out)] = 1.0;
    const std::vector<Pose> truth = PosesAtGridPoints(group_, library_.layout(), one);
    const std::vector<Pose> synthesized = PosesAtGridPoints(group_, library_.layout(), weights);
    Comparison result;
    const auto pose = comparison_.Measure(truth, synthesized);
    if (!pose) return result;
    result.is_valid = true;
    result.pose = *pose;
    if (IsStep(group_.kind) && library_.leg_rig().is_usable) {
      const auto planted = comparison_.Measure(truth, PlantedPoses(left_out, weights, truth));
      if (planted) result.planted_m = planted->mean_m;
    }
    int feet = 0;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      if (IsStep(group_.kind) && foot != MovingFoot(group_.kind)) continue;
      ++feet;
      for (std::size_t i = 0; i < truth.size(); ++i) {
        result.foot_m += glm::length(BallPosition(library_.skeleton(), truth[i], foot) -
                                     BallPosition(library_.skeleton(), synthesized[i], foot)) /
                         static_cast<double>(truth.size());
      }
    }
    result.foot_m /= feet;
    const std::vector<double> true_keys = Keytimes(group_, one);
    const std::vector<double> synthesized_keys = Keytimes(group_, weights);
    for (std::size_t k = 1; k < true_keys.size(); ++k) {
      result.keytime_s +=
          std::fabs(true_keys[k] - synthesized_keys[k]) / static_cast<double>(true_keys.size() - 1);
    }
    ApplyWeights(group_, weights, movement_);
    cache_.Clear();
    result.parameter_m = LargestDifference(
        group_, ValuesOf(group_.site(left_out)),
        MeasureMovement(library_.skeleton(), library_.layout(), group_, movement_, cache_, pose_));
    return result;
  }

 private:
  const MotionLibrary& library_;
  int group_index_;
  const MotionGroup& group_;
  PoseComparison comparison_;
  GridCache cache_;
  Pose pose_;
  AvatarBody body_;
  FootPlanScratch plan_scratch_;
  Movement movement_;
};

void AddTo(LeftOutMean& mean, const Comparison& one, double share) {
  mean.pose_m += share * one.pose.mean_m;
  for (std::size_t p = 0; p < mean.part_m.size(); ++p) mean.part_m[p] += share * one.pose.part_m[p];
  mean.planted_m += share * one.planted_m;
  mean.foot_m += share * one.foot_m;
  mean.keytime_s += share * one.keytime_s;
  mean.parameter_m += share * one.parameter_m;
}

}  // namespace

std::string_view BlendMethodName(BlendMethod method) {
  switch (method) {
    case BlendMethod::kCardinal: return "cardinal";
    case BlendMethod::kNearest: return "nearest";
    case BlendMethod::kInverseDistance: return "inverse_distance";
  }
  return "unknown";
}

LeaveOneOut MeasureLeaveOneOut(const MotionLibrary& library, int group_index,
                               double cluster_diameter_m) {
  const MotionGroup& group = library.group(group_index);
  LeaveOneOut result;
  if (group.example_count < 3) return result;
  const auto n = static_cast<std::size_t>(group.example_count);
  const int threads = ThreadCount(0);
  std::vector<Comparer> comparers;
  for (int t = 0; t < threads; ++t) comparers.emplace_back(library, group_index);
  std::vector<std::array<Comparison, kBlendMethodCount>> all(n);
  const std::vector<double> products =
      MovementProducts(group, library.layout(), library.skeleton());
  ParallelFor(group.example_count, 1, threads, [&](int e, int thread) {
    const Others others = OthersOf(group, e, cluster_diameter_m);
    Comparer& comparer = comparers[static_cast<std::size_t>(thread)];
    const std::vector<double> cardinal = comparer.CardinalWeights(others, products, group.site(e));
    if (cardinal.empty()) return;
    const auto d = static_cast<std::size_t>(group.parameter_count());
    all[static_cast<std::size_t>(e)] = {comparer.Compare(e, cardinal),
                                        comparer.Compare(e, NearestWeights(group, e, 1)),
                                        comparer.Compare(e, NearestWeights(group, e, d + 1))};
  });
  for (const auto& methods : all) result.movements += methods[0].is_valid ? 1 : 0;
  if (result.movements == 0) return result;
  const double share = 1.0 / result.movements;
  for (const auto& methods : all) {
    if (!methods[0].is_valid) continue;
    for (std::size_t m = 0; m < methods.size(); ++m) {
      AddTo(result.means[m], methods[m], share);
      result.wins[m] += methods[0].pose.mean_m < methods[m].pose.mean_m ? share : 0.0;
    }
  }
  return result;
}

}  // namespace stridewire
