#include <utility>
#include <vector>

#include "base/check.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/pose/soa_pose_evaluator.h"

namespace stridewire {

Avatar::Avatar(std::shared_ptr<const MotionLibrary> library, const BaseFrame& start,
               const AvatarOptions& options)
    : simulation_(std::make_unique<AvatarSimulation>(std::move(library), start, options)) {}

Avatar::~Avatar() = default;
Avatar::Avatar(Avatar&&) noexcept = default;
Avatar& Avatar::operator=(Avatar&&) noexcept = default;

Status Avatar::Enqueue(const MovementRequest& request) { return simulation_->Enqueue(request); }
int Avatar::CancelQueue() { return simulation_->CancelQueue(); }
Status Avatar::SetLayer(const LayerRequest& request) { return simulation_->SetLayer(request); }
void Avatar::Teleport(const BaseFrame& start) { simulation_->Teleport(start); }
Status Avatar::SetFootPlanting(bool enabled) { return simulation_->SetFootPlanting(enabled); }
void Avatar::SetTerrain(std::shared_ptr<const Terrain> terrain) {
  simulation_->SetTerrain(std::move(terrain));
}
void Avatar::Advance(double dt_s) { simulation_->Advance(dt_s); }

ConstPoseSpan Avatar::pose() const { return simulation_->pose(); }
std::span<const AvatarEvent> Avatar::events() const { return simulation_->events(); }
const BaseFrame& Avatar::base() const { return simulation_->base(); }
int Avatar::queue_size() const { return simulation_->queue_size(); }
bool Avatar::idle() const { return simulation_->idle(); }
bool Avatar::foot_planting() const { return simulation_->foot_planting(); }
const MotionLibrary& Avatar::library() const { return simulation_->library(); }
double Avatar::time_s() const { return simulation_->time_s(); }

struct AvatarCrowd::Scratch {
  explicit Scratch(std::shared_ptr<const MotionLibrary> of_library)
      : library(std::move(of_library)), evaluator(*library, 1), plan(*library) {}

  std::shared_ptr<const MotionLibrary> library;
  SoaPoseEvaluator evaluator;
  PlanScratch plan;
  // Simulations of the avatars that were passed to Advance.
  std::vector<AvatarSimulation*> simulations;
};

AvatarCrowd::AvatarCrowd(std::shared_ptr<const MotionLibrary> library)
    : scratch_(std::make_unique<Scratch>(std::move(library))) {}

AvatarCrowd::~AvatarCrowd() = default;
AvatarCrowd::AvatarCrowd(AvatarCrowd&&) noexcept = default;
AvatarCrowd& AvatarCrowd::operator=(AvatarCrowd&&) noexcept = default;

void AvatarCrowd::Advance(std::span<Avatar* const> avatars, double dt_s) {
  scratch_->simulations.clear();
  for (Avatar* avatar : avatars) {
    STRIDEWIRE_CHECK(&avatar->library() == scratch_->library.get());
    scratch_->simulations.push_back(avatar->simulation_.get());
  }
  AvatarSimulation::AdvanceAll(scratch_->simulations, dt_s, scratch_->plan, scratch_->evaluator);
}

}  // namespace stridewire
