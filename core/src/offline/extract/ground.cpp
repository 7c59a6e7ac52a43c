#include "offline/extract/ground.h"

#include <algorithm>
#include <cmath>

#include "offline/base/statistics.h"

namespace stridewire {
namespace {

// Maximum difference of the resting heights of the two feet, caused by displaced markers.
constexpr double kFeetDifferMaxM = 0.03;
constexpr double kBallUsualM = 0.04;
constexpr double kBallPlausibleMinM = 0.01;
constexpr double kBallPlausibleMaxM = 0.09;
// Maximum difference of the heights of contacts on one piece of level ground.
constexpr double kLevelBandM = 0.03;
// Levels with a smaller fraction of the contacts are ignored.
constexpr double kLevelShareMin = 0.2;
// The score of a level is its fraction of the contacts, minus its deviation from the usual height
// in units of kDeviationM.
constexpr double kDeviationM = 0.06;

// Returns the height of the right resting ball above the left one: the median over all pairs of
// contacts that overlap in time and are on the same level.
double RightAboveLeft(const FootContacts& contacts) {
  std::vector<double> differences;
  for (const Contact& left : contacts.feet[0]) {
    for (const Contact& right : contacts.feet[1]) {
      const double difference = right.ball_height_m - left.ball_height_m;
      if (left.frames.Overlaps(right.frames) && std::fabs(difference) < kFeetDifferMaxM) {
        differences.push_back(difference);
      }
    }
  }
  return Median(std::move(differences));
}

// Returns the height of the resting balls above the ground. Chooses a level that has many contacts
// and is close to the usual height above y = 0. Returns the usual height if there is no such level.
double BallHeight(std::vector<double> heights) {
  std::ranges::sort(heights);
  const auto count = static_cast<double>(heights.size());
  double best = kBallUsualM;
  double best_score = -1e9;
  for (auto first = heights.begin(); first != heights.end(); ++first) {
    const auto last = std::upper_bound(first, heights.end(), *first + kLevelBandM);
    const double share = static_cast<double>(last - first) / count;
    const double height = Median({first, last});
    if (share < kLevelShareMin || height < kBallPlausibleMinM || height > kBallPlausibleMaxM) {
      continue;
    }
    const double score = share - std::fabs(height - kBallUsualM) / kDeviationM;
    if (score > best_score) {
      best_score = score;
      best = height;
    }
  }
  return best;
}

}  // namespace

Ground FindGround(const FootContacts& contacts) {
  Ground ground;
  const double half_difference = 0.5 * RightAboveLeft(contacts);
  const double offset[2] = {-half_difference, half_difference};
  std::vector<double> heights;
  for (int f = 0; f < 2; ++f) {
    for (const Contact& contact : contacts.feet[f]) {
      heights.push_back(contact.ball_height_m - offset[f]);
    }
  }
  if (heights.empty()) return ground;
  ground.has_contacts = true;
  const double mean = BallHeight(std::move(heights));
  for (int f = 0; f < 2; ++f) ground.ball_height_m[f] = mean + offset[f];
  return ground;
}

}  // namespace stridewire
