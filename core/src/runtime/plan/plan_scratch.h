#pragma once

#include <memory>

#include "runtime/pose/evaluate_poses.h"
#include "runtime/weights/correction.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

struct FootSamplerLanes;

/// Memory for planning the feet of a movement (PlanFeet): about 100 KB. It is allocated once and
/// used for all movements of one library. Use one per thread.
class FootPlanScratch {
 public:
  /// `library` must outlive the scratch.
  explicit FootPlanScratch(const MotionLibrary& library);
  ~FootPlanScratch();
  FootPlanScratch(FootPlanScratch&&) noexcept;
  FootPlanScratch& operator=(FootPlanScratch&&) noexcept;

  [[nodiscard]] const MotionLibrary& library() const { return *library_; }
  /// Cached rows of the movement that is being planned. Clear the cache when the movement changes.
  [[nodiscard]] GridCache& cache() { return *cache_; }
  /// Arrays that FootSampler uses.
  [[nodiscard]] FootSamplerLanes& lanes() { return *lanes_; }

 private:
  const MotionLibrary* library_;
  std::unique_ptr<GridCache> cache_;
  std::unique_ptr<FootSamplerLanes> lanes_;
};

/// Memory for planning the feet and the weights of movements. Use one per thread.
struct PlanScratch {
  /// `library` must outlive the scratch.
  explicit PlanScratch(const MotionLibrary& library) : feet(library), correction(library) {}

  FootPlanScratch feet;
  CorrectionScratch correction;
};

}  // namespace stridewire
