#include "stridewire/runtime/motion_library.h"

#include <flatbuffers/flatbuffers.h>

#ifndef __wasm__
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#endif

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <string>

#include "motion_library_generated.h"
#include "runtime/library/keytimes.h"
#include "runtime/library/knee_hinges.h"
#include "runtime/library/library_file.h"
#include "runtime/library/locomotion_profile.h"
#include "runtime/library/stand_motion.h"
#include "runtime/library/transition.h"
#include "runtime/skeleton/layer_clip.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {
namespace {

constexpr std::size_t kAlignment = 64;
constexpr double kUnitTolerance = 1e-3;
constexpr double kLargestNumber = 1e9;

// The limits from here to kMaxRadiusFactor are far outside the range of human movements. Values
// beyond them would lose too much precision as floats.
//
// Maximum absolute value of a parameter, in metres or radians.
constexpr double kMaxParameter = 100.0;
// Maximum distance of the root from the base frame, along each axis.
constexpr double kMaxRootM = 1000.0;
constexpr double kMaxYawRad = 100.0;
constexpr double kMaxMovementS = 600.0;
constexpr double kMinScale = 1e-7;
constexpr double kMaxRadiusFactor = 100.0;

// The weights must stay bounded up to this distance outside the range of each parameter, as a
// fraction of the range. Requests are clamped to the hull enlarged by 10 %, so there is a margin.
constexpr double kReach = 0.5;
// Limit on the sum of |w|. It is compared with an upper bound, which increases with the number of
// examples and is far above the real sum.
constexpr double kMaxWeightSum = 1e6;
// Tolerance for sums of weights that must be 1.
constexpr double kSumTolerance = 1e-7;

Vec3 ToVec3(const fb::Vec3& v) { return {v.x(), v.y(), v.z()}; }

// Returns true if the number is finite and small enough that later arithmetic cannot overflow.
template <typename T>
bool IsSane(T value) {
  return std::isfinite(value) && std::fabs(static_cast<double>(value)) <= kLargestNumber;
}

template <typename T>
bool AllSane(std::span<const T> values) {
  return std::all_of(values.begin(), values.end(), [](T v) { return IsSane(v); });
}

bool AllWithin(std::span<const double> values, double limit) {
  return std::all_of(values.begin(), values.end(), [&](double v) { return std::fabs(v) <= limit; });
}

template <typename T>
std::span<const T> ToSpan(const flatbuffers::Vector<T>* vector) {
  return vector == nullptr ? std::span<const T>()
                           : std::span<const T>(vector->data(), vector->size());
}

Leg ToLeg(const fb::Leg& leg) {
  return {leg.hip(),
          leg.knee(),
          leg.ankle(),
          leg.ball(),
          ToVec3(leg.ball_offset()),
          ToVec3(leg.toe_tip_offset())};
}

Expected<Skeleton> LoadSkeleton(const fb::Skeleton& from) {
  Skeleton skeleton;
  if (from.joints()->size() > static_cast<std::size_t>(kMaxJoints)) {
    return Fail(ErrorCode::kMalformed, "too many joints", from.joints()->size());
  }
  for (const fb::Joint* joint : *from.joints()) {
    skeleton.joints.push_back({joint->name()->str(), joint->parent(), ToVec3(*joint->offset())});
  }
  if (from.end_sites() != nullptr) {
    if (from.end_sites()->size() > static_cast<std::size_t>(kMaxJoints)) {
      return Fail(ErrorCode::kMalformed, "too many end sites", from.end_sites()->size());
    }
    for (const fb::EndSite* site : *from.end_sites()) {
      skeleton.end_sites.push_back({site->joint(), ToVec3(site->offset())});
    }
  }
  skeleton.legs[0] = ToLeg(*from.left());
  skeleton.legs[1] = ToLeg(*from.right());
  if (const Status status = skeleton.Validate(); !status) return std::unexpected(status.error());
  return skeleton;
}

// Returns true if movements of this kind may have this parameter.
bool NameFitsKind(ParameterName name, MovementKind kind) {
  if (IsStep(kind)) return name <= ParameterName::kTurn;
  return name == ParameterName::kTurn || name == ParameterName::kLength ||
         name == ParameterName::kHeight;
}

Status LoadParameters(const fb::Group& from, MotionGroup& group) {
  const auto d = from.parameters()->size();
  if (d < 1 || d > static_cast<std::size_t>(kMaxParameters)) {
    return Fail(ErrorCode::kMalformed, "a group's parameter count is out of range", d);
  }
  for (const fb::Parameter* parameter : *from.parameters()) {
    const auto name = static_cast<ParameterName>(parameter->name());
    if (parameter->name() >= kParameterNameCount || !NameFitsKind(name, group.kind)) {
      return Fail(ErrorCode::kMalformed,
                  "a parameter's name is unknown or not valid for the group's kind",
                  parameter->name());
    }
    if (group.FindParameter(name) >= 0) {
      return Fail(ErrorCode::kMalformed, "a group has the same parameter twice", parameter->name());
    }
    // Written this way so that NaN is rejected.
    if (!(parameter->min() >= -kMaxParameter && parameter->max() <= kMaxParameter &&
          parameter->min() <= parameter->max() && parameter->scale() >= kMinScale &&
          parameter->scale() <= kMaxParameter)) {
      return Fail(ErrorCode::kMalformed, "a parameter's range or scale is invalid",
                  parameter->name());
    }
    group.parameters.push_back(
        {name, parameter->min(), parameter->max(), parameter->centre(), parameter->scale()});
  }
  return {};
}

// Checks that all sites are inside the ranges of their parameters. Requests are clamped to the hull
// of the examples, enlarged by less than kReach, so the bounds on weights that CheckWeightTables
// verifies for these ranges hold for every request.
Status CheckSites(const MotionGroup& group) {
  const std::size_t d = group.parameters.size();
  for (std::size_t l = 0; l < d; ++l) {
    const Parameter& parameter = group.parameters[l];
    const double slack = 1e-9 * kMaxParameter;
    const auto outside = [&](double value) {
      return !(value >= parameter.min - slack && value <= parameter.max + slack);
    };
    if (outside(parameter.centre)) {
      return Fail(ErrorCode::kMalformed, "a parameter's centre is outside its range",
                  static_cast<std::int64_t>(parameter.name));
    }
    for (std::size_t s = 0; s < group.sites.size() / d; ++s) {
      if (outside(group.sites[s * d + l])) {
        return Fail(ErrorCode::kMalformed, "a site is outside its parameters' range",
                    static_cast<std::int64_t>(s));
      }
    }
  }
  return {};
}

// Checks that the weights sum to 1 for all parameters, and that no weight can become huge within
// kReach of the examples. The constant row of the table must sum to 1 and all other rows to 0.
Status CheckWeightTables(const MotionGroup& group) {
  const auto n = static_cast<std::size_t>(group.example_count);
  double bound = 0.0;  // Upper bound on the sum of |w|.
  const auto check = [&](std::span<const double> row, double wanted, double factor) {
    double sum = 0.0;
    double size = 0.0;
    for (const double value : row) {
      sum += value;
      size += std::fabs(value);
    }
    bound += factor * size;
    return std::fabs(sum - wanted) <= kSumTolerance * std::max(1.0, size);
  };
  bool sums_are_right = check(group.linear.first(n), 1.0, 1.0);
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    const Parameter& p = group.parameters[l];
    const double extent = (1.0 + kReach) * (p.max - p.min) / p.scale;
    sums_are_right &= check(group.linear.subspan((l + 1) * n, n), 0.0, extent);
  }
  for (std::size_t s = 0; s < group.dilations.size(); ++s) {
    sums_are_right &= check(group.radial.subspan(s * n, n), 0.0, 2.0 / 3.0);  // B <= 2/3
  }
  for (std::size_t s = 0; s < group.site_weights.size(); s += n) {
    sums_are_right &= check(group.site_weights.subspan(s, n), 1.0, 0.0);
  }
  if (!sums_are_right) return Fail(ErrorCode::kMalformed, "a group's weights do not sum to 1");
  if (!(bound <= kMaxWeightSum)) {
    return Fail(ErrorCode::kMalformed, "a group's weights are too large");
  }
  return {};
}

Status LoadWeights(const fb::Group& from, MotionGroup& group) {
  const auto d = group.parameters.size();
  const auto n = static_cast<std::size_t>(group.example_count);
  group.sites = ToSpan(from.sites());
  if (group.sites.size() % d != 0 || group.sites.size() / d < n ||
      group.sites.size() / d > 2 * static_cast<std::size_t>(MotionLibrary::kMaxExamples)) {
    return Fail(ErrorCode::kMalformed, "a group's site count does not fit its examples");
  }
  const std::size_t m = group.sites.size() / d;
  group.site_count = static_cast<int>(m);
  group.site_weights = ToSpan(from.site_weights());
  group.dilations = ToSpan(from.dilations());
  group.linear = ToSpan(from.linear());
  group.radial = ToSpan(from.radial());
  if (group.site_weights.size() != (m - n) * n || group.dilations.size() != m ||
      group.linear.size() != (d + 1) * n || group.radial.size() != m * n) {
    return Fail(ErrorCode::kMalformed, "a group's weight tables have the wrong size");
  }
  if (!AllSane(group.sites) || !AllSane(group.site_weights) || !AllSane(group.dilations) ||
      !AllSane(group.linear) || !AllSane(group.radial)) {
    return Fail(ErrorCode::kMalformed,
                "a group's weight tables contain a number that is out of range");
  }
  for (const double dilation : group.dilations) {
    if (!(dilation > 1e-9))
      return Fail(ErrorCode::kMalformed, "a group's dilation is not positive");
  }
  group.radius_factor = from.radius_factor();
  if (!(group.radius_factor > 0.0 && group.radius_factor <= kMaxRadiusFactor)) {
    return Fail(ErrorCode::kMalformed, "a group's radius factor is out of range");
  }
  if (Status status = CheckSites(group); !status) return status;
  return CheckWeightTables(group);
}

Status LoadVariants(const fb::Group& from, MotionGroup& group) {
  const std::size_t d = group.parameters.size();
  group.variant_parameters = ToSpan(from.variant_parameters());
  const std::size_t variants = group.variant_parameters.size() / d;
  if (group.variant_parameters.size() % d != 0 || variants > MotionLibrary::kMaxVariants) {
    return Fail(ErrorCode::kMalformed, "a group's variant count is out of range",
                static_cast<std::int64_t>(variants));
  }
  if (!AllWithin(group.variant_parameters, kMaxParameter)) {
    return Fail(ErrorCode::kMalformed, "a variant's parameter is out of range");
  }
  if (variants > 0 && !IsStep(group.kind)) {
    return Fail(ErrorCode::kMalformed, "a group that has no steps has variants");
  }
  group.variant_count = static_cast<int>(variants);
  return {};
}

Status LoadTimes(const fb::Group& from, MotionGroup& group) {
  const auto n = static_cast<std::size_t>(group.row_count());
  group.cells = ToSpan(from.cells());
  const std::size_t intervals = group.cells.size();
  if (intervals < 1 || intervals > static_cast<std::size_t>(kMaxIntervals)) {
    return Fail(ErrorCode::kMalformed, "a group's interval count is out of range",
                static_cast<std::int64_t>(intervals));
  }
  std::int64_t points = 1;
  for (const int cells : group.cells) {
    if (cells < 1 || cells > MotionLibrary::kMaxGridPoints) {
      return Fail(ErrorCode::kMalformed, "a group's cell count is out of range", cells);
    }
    points += cells;
  }
  if (points > MotionLibrary::kMaxGridPoints) {
    return Fail(ErrorCode::kMalformed, "a group has too many grid points", points);
  }
  group.grid_point_count = static_cast<int>(points);
  group.keytimes_s = ToSpan(from.keytimes_s());
  group.heading_change_rad = ToSpan(from.heading_change_rad());
  if (group.keytimes_s.size() != n * (intervals + 1) || group.heading_change_rad.size() != n) {
    return Fail(ErrorCode::kMalformed, "a group's time tables have the wrong size");
  }
  if (!AllWithin(group.heading_change_rad, kMaxYawRad) ||
      !AllWithin(group.keytimes_s, kMaxMovementS)) {
    return Fail(ErrorCode::kMalformed,
                "a group's time tables contain a number that is out of range");
  }
  for (std::size_t e = 0; e < n; ++e) {
    const Status status =
        ValidateKeytimes(group.keytimes_s.subspan(e * (intervals + 1), intervals + 1));
    if (!status)
      return Fail(ErrorCode::kMalformed, status.error().text, static_cast<std::int64_t>(e));
  }
  return {};
}

Status LoadGrid(const fb::Group& from, const GridLayout& layout, std::size_t joints,
                MotionGroup& group) {
  const auto n = static_cast<std::size_t>(group.row_count());
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  group.grid = ToSpan(from.grid());
  if (group.grid.size() != static_cast<std::size_t>(group.grid_point_count) * n * row_floats) {
    return Fail(ErrorCode::kMalformed, "a group's grid has the wrong size");
  }
  if (reinterpret_cast<std::uintptr_t>(group.grid.data()) % kAlignment != 0) {
    return Fail(ErrorCode::kMalformed, "a group's grid is not aligned to 64 bytes");
  }
  if (!AllSane(group.grid)) {
    return Fail(ErrorCode::kMalformed, "a group's grid contains a number that is out of range");
  }
  for (std::size_t row = 0; row < group.grid.size(); row += row_floats) {
    const float* x = &group.grid[row];
    const auto [position, yaw_rad] = layout.RootOf(x);
    if (!(std::fabs(position.x) <= kMaxRootM && std::fabs(position.y) <= kMaxRootM &&
          std::fabs(position.z) <= kMaxRootM && std::fabs(yaw_rad) <= kMaxYawRad)) {
      return Fail(ErrorCode::kMalformed, "a stored root is out of range",
                  static_cast<std::int64_t>(row / row_floats));
    }
    for (std::size_t j = 0; j < joints; ++j) {
      const DQuat rotation(GridLayout::RotationOf(x, j));
      const double norm = std::sqrt(glm::dot(rotation, rotation));
      if (std::fabs(norm - 1.0) > kUnitTolerance) {
        return Fail(ErrorCode::kMalformed, "a stored rotation is not of unit length",
                    static_cast<std::int64_t>(j));
      }
    }
  }
  return {};
}

Expected<MotionGroup> LoadGroup(const fb::Group& from, const GridLayout& layout,
                                std::size_t joints) {
  MotionGroup group;
  if (from.kind() > static_cast<int>(MovementKind::kJump)) {
    return Fail(ErrorCode::kMalformed, "a group's kind is unknown", from.kind());
  }
  group.kind = static_cast<MovementKind>(from.kind());
  if (from.example_count() < 1 || from.example_count() > MotionLibrary::kMaxExamples) {
    return Fail(ErrorCode::kMalformed, "a group's example count is out of range",
                from.example_count());
  }
  group.example_count = from.example_count();
  const auto n = static_cast<std::size_t>(group.example_count);
  if (Status status = LoadParameters(from, group); !status) return std::unexpected(status.error());
  if (Status status = LoadWeights(from, group); !status) return std::unexpected(status.error());
  if (Status status = LoadVariants(from, group); !status) return std::unexpected(status.error());
  if (Status status = LoadTimes(from, group); !status) return std::unexpected(status.error());
  if (Status status = LoadGrid(from, layout, joints, group); !status) {
    return std::unexpected(status.error());
  }
  if (from.sources()->size() != n || from.mirrored()->size() != n) {
    return Fail(ErrorCode::kMalformed, "a group's source list has the wrong size");
  }
  for (const flatbuffers::String* source : *from.sources()) {
    group.sources.push_back(source->string_view());
  }
  group.is_completed = std::ranges::all_of(
      group.sources, [](std::string_view source) { return source.starts_with(kCompletedSource); });
  group.mirrored = ToSpan(from.mirrored());
  return group;
}

// Checks that a layer affects only joints that layers may affect, and that its keys are valid.
Status CheckLayer(const LayerClip& layer, const std::vector<bool>& joints_of_legs) {
  const auto fail = [&](const char* text) { return Fail(ErrorCode::kMalformed, text); };
  if (!IsLayerName(layer.name)) {
    return fail("a layer's name is not 1 to 32 of a-z, A-Z, 0-9, '_', '-', '.'");
  }
  if (!(layer.fps >= kMinLayerFps && layer.fps <= kMaxLayerFps)) {
    return fail("a layer's frame rate is out of range");
  }
  if (layer.joints.empty() || layer.joints.size() > joints_of_legs.size() ||
      layer.weights.size() != layer.joints.size()) {
    return fail("a layer's mask has the wrong size");
  }
  int before = -1;
  for (const int joint : layer.joints) {
    if (joint <= before || static_cast<std::size_t>(joint) >= joints_of_legs.size()) {
      return fail("a layer's mask lists joints that do not exist or are not in order");
    }
    if (joints_of_legs[static_cast<std::size_t>(joint)]) {
      return Fail(ErrorCode::kMalformed, "a layer's mask contains the root or a joint of a leg",
                  joint);
    }
    before = joint;
  }
  for (const float weight : layer.weights) {
    if (!(weight > 0.0f && weight <= 1.0f))
      return fail("a layer's mask contains a weight outside (0, 1]");
  }
  const std::size_t key_floats = 4 * layer.joints.size();
  if (layer.rotations.empty() || layer.rotations.size() % key_floats != 0 ||
      layer.rotations.size() / key_floats > static_cast<std::size_t>(kMaxLayerFrames)) {
    return fail("a layer's keys have the wrong size");
  }
  for (std::size_t i = 0; i < layer.rotations.size(); i += 4) {
    const float* q = &layer.rotations[i];
    const double norm = std::sqrt(double{q[0]} * q[0] + double{q[1]} * q[1] + double{q[2]} * q[2] +
                                  double{q[3]} * q[3]);
    if (!(std::fabs(norm - 1.0) <= kUnitTolerance)) {
      return Fail(ErrorCode::kMalformed, "a layer contains a rotation that is not of unit length",
                  static_cast<std::int64_t>(i / 4));
    }
  }
  return {};
}

LayerClip ToLayer(const fb::Layer& from) {
  return {.name = from.name()->string_view(),
          .source = from.source()->string_view(),
          .fps = from.fps(),
          .is_looping = from.is_looping(),
          .joints = ToSpan(from.joints()),
          .weights = ToSpan(from.weights()),
          .rotations = ToSpan(from.rotations())};
}

}  // namespace

std::string_view MovementKindName(MovementKind kind) {
  switch (kind) {
    case MovementKind::kStepLeft: return "step_left";
    case MovementKind::kStepRight: return "step_right";
    case MovementKind::kJump: return "jump";
    case MovementKind::kStand: return "stand";
  }
  return "unknown";
}

std::string_view ParameterText(ParameterName name) {
  switch (name) {
    case ParameterName::kStartX: return "start_x_m";
    case ParameterName::kStartY: return "start_y_m";
    case ParameterName::kStartZ: return "start_z_m";
    case ParameterName::kEndX: return "end_x_m";
    case ParameterName::kEndY: return "end_y_m";
    case ParameterName::kEndZ: return "end_z_m";
    case ParameterName::kTurn: return "turn_rad";
    case ParameterName::kLength: return "length_m";
    case ParameterName::kHeight: return "height_m";
  }
  return "unknown";
}

MotionLibrary::MotionLibrary() = default;

std::span<const LayerClip> MotionLibrary::layers() const { return layers_; }
std::span<const Transition> MotionLibrary::transitions() const { return transitions_; }

const Transition* MotionLibrary::FindTransition(std::size_t from, std::size_t to) const {
  return transitions_.empty() ? nullptr : &transitions_[from * (groups().size() + 1) + to];
}

int MotionLibrary::FindLayer(std::string_view name) const {
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    if (layers_[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

int MotionGroup::FindParameter(ParameterName name) const {
  for (std::size_t l = 0; l < parameters.size(); ++l) {
    if (parameters[l].name == name) return static_cast<int>(l);
  }
  return -1;
}

MotionLibrary::~MotionLibrary() {
  auto* data = const_cast<std::byte*>(bytes_.data());
#ifndef __wasm__
  if (is_mapped_) {
    munmap(data, bytes_.size());
    return;
  }
#endif
  std::free(data);
}

#ifdef __wasm__
// WebAssembly cannot map files. Its callers use FromBytes.
Expected<std::shared_ptr<const MotionLibrary>> MotionLibrary::Open(
    const std::filesystem::path& path) {
  return Fail(ErrorCode::kUnsupported, "files cannot be opened in WebAssembly", path.string());
}
#else
Expected<std::shared_ptr<const MotionLibrary>> MotionLibrary::Open(
    const std::filesystem::path& path) {
  const std::string where = path.string();
  const auto failed = [&](ErrorCode code, const char* text) { return Fail(code, text, where); };
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) {
    return failed(errno == ENOENT ? ErrorCode::kNotFound : ErrorCode::kIo,
                  errno == ENOENT ? "there is no such file" : "the file cannot be opened");
  }
  struct stat info{};
  if (fstat(file, &info) != 0 || !S_ISREG(info.st_mode)) {
    close(file);
    return failed(ErrorCode::kIo, "not a regular file");
  }
  const auto size = static_cast<std::size_t>(info.st_size);
  if (size > kMaxFileBytes || size < kLibraryHeaderBytes) {
    close(file);
    return failed(size > kMaxFileBytes ? ErrorCode::kLimitExceeded : ErrorCode::kMalformed,
                  size > kMaxFileBytes ? "the file is larger than 1 GiB, the limit for libraries"
                                       : "not a Stridewire library: shorter than its header");
  }
  void* mapping = mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file, 0);
  close(file);
  if (mapping == MAP_FAILED) return failed(ErrorCode::kIo, "the file cannot be mapped");

  std::shared_ptr<MotionLibrary> library(new MotionLibrary());
  library->bytes_ = {static_cast<const std::byte*>(mapping), size};
  library->is_mapped_ = true;
  if (Status status = library->Load(); !status) {
    Error error = status.error();
    error.where = where;
    return std::unexpected(error);
  }
  return library;
}
#endif

Expected<std::shared_ptr<const MotionLibrary>> MotionLibrary::FromBytes(
    std::span<const std::byte> bytes) {
  if (bytes.size() > kMaxFileBytes) {
    return Fail(ErrorCode::kLimitExceeded,
                "the file is larger than 1 GiB, the limit for libraries");
  }
  const std::size_t rounded = (bytes.size() + kAlignment) / kAlignment * kAlignment;
  auto* copy = static_cast<std::byte*>(std::aligned_alloc(kAlignment, rounded));
  if (copy == nullptr) return Fail(ErrorCode::kLimitExceeded, "out of memory");
  std::copy(bytes.begin(), bytes.end(), copy);
  std::shared_ptr<MotionLibrary> library(new MotionLibrary());
  library->bytes_ = {copy, bytes.size()};
  if (Status status = library->Load(); !status) return std::unexpected(status.error());
  return library;
}

Status MotionLibrary::Load() {
  if (Status status = LoadContent(); !status) return status;
  AddStandMotion();
  return {};
}

void MotionLibrary::AddStandMotion() {
  if (!leg_rig_->is_usable) return;
  stand_motion_ = std::make_unique<const StandMotion>(skeleton_, *leg_rig_, stand_pose_);
  groups_.push_back(stand_motion_->settle);
  groups_.push_back(stand_motion_->idle);
}

Status MotionLibrary::LoadContent() {
  if (bytes_.size() < kLibraryHeaderBytes) {
    return Fail(ErrorCode::kMalformed, "not a Stridewire library: shorter than its header");
  }
  if (std::memcmp(bytes_.data(), kLibraryMagic, 8) != 0) {
    return Fail(ErrorCode::kMalformed, "not a Stridewire library");
  }
  std::uint32_t version = 0;
  std::memcpy(&version, bytes_.data() + 8, 4);
  if (version != static_cast<std::uint32_t>(kFormatVersion)) {
    return Fail(ErrorCode::kVersionMismatch, "the library has another format version", version);
  }
  const std::span<const std::byte> payload = bytes_.subspan(kLibraryHeaderBytes);
  std::uint64_t payload_bytes = 0;
  std::memcpy(&payload_bytes, bytes_.data() + 16, 8);
  if (payload_bytes != payload.size()) {
    return Fail(ErrorCode::kMalformed, payload_bytes > payload.size()
                                           ? "the file is truncated"
                                           : "the file is longer than its header states");
  }
  const auto expected_header = MakeLibraryHeader(payload);
  if (std::memcmp(expected_header.data(), bytes_.data(), kLibraryHeaderBytes) != 0) {
    return Fail(ErrorCode::kMalformed, "the file is damaged: its content does not match its hash");
  }
  hash_ = HashText(HashPayload(payload));

  const auto* data = reinterpret_cast<const std::uint8_t*>(payload.data());
  flatbuffers::Verifier verifier(data, payload.size(), 16, 1'000'000);
  if (!fb::VerifyMotionLibraryBuffer(verifier)) {
    return Fail(ErrorCode::kMalformed, "the content is not a motion library");
  }
  const fb::MotionLibrary& root = *fb::GetMotionLibrary(data);
  Expected<Skeleton> skeleton = LoadSkeleton(*root.skeleton());
  if (!skeleton) return std::unexpected(skeleton.error());
  skeleton_ = std::move(*skeleton);
  layout_ = GridLayout(skeleton_.joint_count());

  const auto joints = static_cast<std::size_t>(skeleton_.joint_count());
  if (root.stand_rotations()->size() != joints) {
    return Fail(ErrorCode::kMalformed, "the stand pose does not fit the skeleton");
  }
  stand_pose_ = Pose(skeleton_.joint_count());
  stand_pose_.root_position_m = ToVec3(*root.stand_root());
  for (std::size_t j = 0; j < joints; ++j) {
    const fb::Quat& q = *root.stand_rotations()->Get(static_cast<flatbuffers::uoffset_t>(j));
    stand_pose_.rotations[j] = Quat(q.w(), q.x(), q.y(), q.z());
    if (!(std::fabs(glm::length(stand_pose_.rotations[j]) - 1.0f) <= kUnitTolerance)) {
      return Fail(ErrorCode::kMalformed,
                  "the stand pose contains a rotation that is not of unit length",
                  static_cast<std::int64_t>(j));
    }
  }
  const Vec3 stand = stand_pose_.root_position_m;
  if (!(std::fabs(stand.x) <= kMaxRootM && std::fabs(stand.y) <= kMaxRootM &&
        std::fabs(stand.z) <= kMaxRootM)) {
    return Fail(ErrorCode::kMalformed, "the stand pose's root is out of range");
  }

  if (root.groups()->size() < 1 || root.groups()->size() > static_cast<std::size_t>(kMaxGroups)) {
    return Fail(ErrorCode::kMalformed, "the group count is out of range", root.groups()->size());
  }
  for (const fb::Group* from : *root.groups()) {
    Expected<MotionGroup> group = LoadGroup(*from, layout_, joints);
    if (!group) return std::unexpected(group.error());
    max_row_count_ = std::max(max_row_count_, group->row_count());
    groups_.push_back(std::move(*group));
  }
  file_group_count_ = groups_.size();
  leg_rig_ =
      std::make_unique<const LegRig>(MakeLegRig(skeleton_, stand_pose_, LearnKneeHinges(*this)));
  locomotion_profile_ = std::make_unique<const LocomotionProfile>(MakeLocomotionProfile(*this));
  if (const auto* from = root.transitions()) {
    std::vector<Transition> transitions;
    for (const fb::Transition* t : *from) {
      transitions.push_back({t->distance_m(), t->end_example(), t->start_example()});
    }
    if (Status status = LoadTransitions(transitions); !status) return status;
  }
  if (root.layers() == nullptr) return {};
  if (root.layers()->size() > static_cast<std::size_t>(kMaxLayerClips)) {
    return Fail(ErrorCode::kMalformed, "the library has too many layers", root.layers()->size());
  }
  const std::vector<bool> joints_of_legs = JointsOfLegs(skeleton_);
  for (const fb::Layer* from : *root.layers()) {
    const LayerClip layer = ToLayer(*from);
    if (Status status = CheckLayer(layer, joints_of_legs); !status) return status;
    if (FindLayer(layer.name) >= 0) {
      return Fail(ErrorCode::kMalformed, "two layers have the same name");
    }
    layers_.push_back(layer);
  }
  return {};
}

Status MotionLibrary::LoadTransitions(const std::vector<Transition>& transitions) {
  const std::size_t nodes = groups_.size() + 1;
  if (transitions.size() != nodes * nodes) {
    return Fail(ErrorCode::kMalformed, "the table of transitions has the wrong size",
                static_cast<std::int64_t>(transitions.size()));
  }
  const auto is_example_of = [&](std::int32_t example, std::size_t node) {
    return node == groups_.size() ? example == -1
                                  : example >= 0 && example < groups_[node].example_count;
  };
  for (std::size_t i = 0; i < transitions.size(); ++i) {
    const Transition& t = transitions[i];
    if (!(t.distance_m >= 0.0f && IsSane(t.distance_m)) ||
        !is_example_of(t.end_example, i / nodes) || !is_example_of(t.start_example, i % nodes)) {
      return Fail(ErrorCode::kMalformed, "a transition refers to an example that does not exist",
                  static_cast<std::int64_t>(i));
    }
  }
  transitions_ = transitions;
  return {};
}

}  // namespace stridewire
