#include "runtime/pose/layer_stack.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/easing.h"
#include "runtime/pose/apply_layer.h"
#include "runtime/skeleton/layer_clip.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {
namespace {

bool IsWithin(double value, double low, double high) { return value >= low && value <= high; }

// Returns the elapsed fraction of the current blend.
double Progress(const LayerStack::Playing& p) {
  return p.elapsed_s >= p.ease_s ? 1.0 : p.elapsed_s / p.ease_s;
}

double WeightOf(const LayerStack::Playing& p) {
  const double weight = p.from_weight + (p.to_weight - p.from_weight) * SmoothStep(Progress(p));
  if (p.elapsed_s >= p.slope_s) return std::clamp(weight, 0.0, 1.0);
  // t (1 - t / T)^2 has slope 1 at t = 0, and value and slope 0 at t = T. With this term, the
  // weight starts with its previous slope.
  const double left = 1.0 - p.elapsed_s / p.slope_s;
  return std::clamp(weight + p.slope * p.elapsed_s * left * left, 0.0, 1.0);
}

double SlopeOf(const LayerStack::Playing& p) {
  const double u = Progress(p);
  double slope = u >= 1.0 ? 0.0 : (p.to_weight - p.from_weight) * 6.0 * u * (1.0 - u) / p.ease_s;
  if (p.elapsed_s < p.slope_s) {
    const double part = p.elapsed_s / p.slope_s;
    slope += p.slope * (1.0 - part) * (1.0 - 3.0 * part);
  }
  return slope;
}

// Starts a blend from the current weight and speed to new ones. The current slope of the weight
// fades out within the remaining time of the previous blend, so that the weight does not overshoot.
void StartBlend(double weight, double speed, double blend_s, LayerStack::Playing& p) {
  const double left_s = std::max(0.0, std::max(p.ease_s, p.slope_s) - p.elapsed_s);
  STRIDEWIRE_CHECK(p.weight >= 0.0 && p.weight <= 1.0 && blend_s >= 0.0);
  p.slope = SlopeOf(p);
  p.slope_s = std::min(left_s, blend_s);
  p.from_weight = p.weight;
  p.to_weight = weight;
  p.from_speed = p.speed;
  p.to_speed = speed;
  p.elapsed_s = 0.0;
  p.ease_s = blend_s;
}

}  // namespace

LayerStack::Playing* LayerStack::Find(int layer, bool is_ending) {
  const auto found = std::ranges::find_if(
      playing_, [&](const Playing& p) { return p.layer == layer && p.is_ending == is_ending; });
  return found == playing_.end() ? nullptr : &*found;
}

Status LayerStack::Set(const MotionLibrary& library, const LayerRequest& request) {
  if (request.layer < 0 || static_cast<std::size_t>(request.layer) >= library.layers().size()) {
    return Fail(ErrorCode::kNotFound, "the library has no such layer", request.layer);
  }
  // Written this way so that NaN is rejected.
  if (!IsWithin(request.blend_s, 0.0, kMaxLayerBlendS)) {
    return Fail(ErrorCode::kOutOfRange, "a layer's blend time must be from 0 to 10 s");
  }
  Playing* on = Find(request.layer, false);
  if (!request.enabled) {
    if (on == nullptr) return {};
    StartBlend(0.0, on->speed, request.blend_s, *on);
    on->is_ending = true;
    return {};
  }
  if (!(request.weight > 0.0 && request.weight <= 1.0)) {
    return Fail(ErrorCode::kOutOfRange, "a layer's weight must be above 0 and at most 1");
  }
  if (!IsWithin(request.speed, kMinLayerSpeed, kMaxLayerSpeed)) {
    return Fail(ErrorCode::kOutOfRange, "a layer's speed must be from 0.1 to 4");
  }
  if (on == nullptr && library.layers()[static_cast<std::size_t>(request.layer)].is_looping) {
    on = Find(request.layer, true);
  }
  if (on == nullptr) {
    if (playing_.size() == kMaxLayers) {
      return Fail(ErrorCode::kLimitExceeded, "the avatar already plays four layers", kMaxLayers);
    }
    Reserve();
    on = &playing_.emplace_back(Playing{.layer = request.layer, .speed = request.speed});
  }
  StartBlend(request.weight, request.speed, request.blend_s, *on);
  on->is_ending = false;
  on->blend_s = request.blend_s;
  on->weight = WeightOf(*on);
  STRIDEWIRE_CHECK(playing_.size() <= kMaxLayers);
  return {};
}

void LayerStack::Advance(const MotionLibrary& library, double dt_s) {
  STRIDEWIRE_CHECK(playing_.size() <= kMaxLayers);
  for (Playing& p : playing_) {
    p.elapsed_s += dt_s;
    p.speed = p.from_speed + (p.to_speed - p.from_speed) * SmoothStep(Progress(p));
    p.time_s += dt_s * p.speed;
    const LayerClip& clip = library.layers()[static_cast<std::size_t>(p.layer)];
    const double duration_s = clip.duration_s();
    p.weight = WeightOf(p);
    if (clip.is_looping) {
      p.time_s -= std::floor(p.time_s / duration_s) * duration_s;
    } else if (!p.is_ending && p.time_s + p.blend_s * p.speed >= duration_s) {
      StartBlend(0.0, p.speed, p.blend_s, p);
      p.is_ending = true;
    }
  }
  std::erase_if(playing_, [](const Playing& p) { return p.is_ending && p.elapsed_s >= p.ease_s; });
}

void LayerStack::Apply(const MotionLibrary& library, PoseSpan pose) const {
  for (const Playing& p : playing()) {
    if (p.weight <= 0.0) continue;
    ApplyLayer(library.layers()[static_cast<std::size_t>(p.layer)], p.time_s, p.weight, pose);
  }
}

Status LayerStack::Restore(const MotionLibrary& library, std::span<const Playing> playing) {
  // Limit on times in seconds. It is far above the duration of the longest clip, 18,000 s
  // (kMaxLayerFrames at kMinLayerFps).
  constexpr double kLongestS = 1e6;
  const auto is_valid = [&](const Playing& p) {
    const auto is_fraction = [](double value) { return IsWithin(value, 0.0, 1.0); };
    const auto is_time = [](double value) { return IsWithin(value, 0.0, kLongestS); };
    const auto is_speed = [](double value) { return IsWithin(value, 0.0, kMaxLayerSpeed); };
    return p.layer >= 0 && static_cast<std::size_t>(p.layer) < library.layers().size() &&
           is_time(p.time_s) && is_fraction(p.weight) && is_fraction(p.from_weight) &&
           is_fraction(p.to_weight) && is_speed(p.speed) && is_speed(p.from_speed) &&
           is_speed(p.to_speed) && std::isfinite(p.slope) && is_time(p.slope_s) &&
           is_time(p.elapsed_s) && is_time(p.ease_s) && is_time(p.blend_s);
  };
  if (playing.size() > kMaxLayers || !std::ranges::all_of(playing, is_valid)) {
    return Fail(ErrorCode::kOutOfRange, "the layer state is not valid");
  }
  if (!playing.empty()) Reserve();
  playing_.assign(playing.begin(), playing.end());
  return {};
}

}  // namespace stridewire
