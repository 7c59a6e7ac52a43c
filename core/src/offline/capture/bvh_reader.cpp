#include "stridewire/offline/bvh_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <system_error>

#include "base/check.h"
#include "offline/base/text.h"
#include "offline/capture/bvh_figure.h"
#include "offline/capture/bvh_file.h"
#include "offline/capture/figure_axes.h"
#include "offline/capture/file_axis.h"
#include "offline/capture/foot_shape.h"
#include "offline/capture/leg_chain.h"

// Conversion from the axes and the unit of a file to those of base/math.h. Let W be the rotation of
// the world that turns up to +Y, and B the rotation of the joint frames that makes the resting
// figure face +Z:
//
//   root'    = unit W root        R_root' = W R_root B^-1
//   offset'  = unit B offset      R_joint' = B R_joint B^-1
//
// Every world position is then the position in the file, rotated by W and scaled to metres.

namespace stridewire {
namespace {

constexpr double kStandingHipsM = 0.95;  // Hip height of a standing adult.
constexpr double kSlowestFeetMS2 = 6.0;  // See NoteSlowMotion.
constexpr double kMinTravelM = 0.15;
// If a file animates the positions of joints, the mean of a joint's positions relative to its
// parent becomes its offset. A joint of the body may be this far from the mean; otherwise the file
// is rejected.
constexpr double kMaxDeviationM = 0.02;
// Joints of the body are those of the legs, and those above a chain of bones of at least this
// length, in leg lengths.
constexpr double kBodyShare = 0.25;

struct KnownUnit {
  double m;
  const char* name;
};
constexpr KnownUnit kKnownUnits[] = {
    {1.0, "1 m"},       {0.3048, "1 foot"}, {0.1, "1 dm"},  {0.0254 / 0.45, "1/0.45 inch"},
    {0.0254, "1 inch"}, {0.01, "1 cm"},     {0.001, "1 mm"}};
constexpr double kTypicalLegM = 0.83;
constexpr double kShortestLegM = 0.68;
constexpr double kLongestLegM = 1.0;

class Reader {
 public:
  Reader(BvhFile file, std::string name, const BvhReadOptions& options)
      : file_(std::move(file)), name_(std::move(name)), options_(options) {}

  Expected<Capture> Run() {
    capture_.path = name_;
    for (const auto step : {&Reader::SetFrameRate, &Reader::BuildFigure, &Reader::FindUnit,
                            &Reader::CheckPositions, &Reader::Convert}) {
      if (Status status = (this->*step)(); !status)
        return std::unexpected(std::move(status.error()));
    }
    capture_.notes = std::move(figure_.notes);
    return std::move(capture_);
  }

 private:
  std::string LineOf(int line) const { return name_ + ':' + std::to_string(line); }
  void Note(std::string text) { figure_.notes.push_back(std::move(text)); }
  const std::vector<Joint>& joints() const { return figure_.joints; }
  const Joint& joint(int j) const { return joints()[Index(j)]; }

  Status SetFrameRate() {
    if (options_.fps) {
      if (!(*options_.fps > 0.0 && *options_.fps <= 10000.0)) {
        return Fail(ErrorCode::kInvalidArgument,
                    "expected a number of frames per second above 0 and at most 10000", "fps");
      }
      capture_.clip.fps = *options_.fps;
      return {};
    }
    if (!file_.has_frame_time) {
      return Fail(ErrorCode::kMalformed,
                  "expected Frame Time: after Frames:; set the frame rate with the option fps",
                  LineOf(file_.frame_time_line));
    }
    const double frame_time = file_.frame_time_s;
    if (!(frame_time >= 1e-4 && frame_time <= 10.0)) {
      return Fail(ErrorCode::kOutOfRange,
                  "Frame Time: expected 0.0001 to 10 seconds; the option fps replaces it",
                  LineOf(file_.frame_time_line));
    }
    double fps = 1.0 / frame_time;
    const double whole = std::nearbyint(fps);
    if (whole >= 1.0 && std::fabs(1.0 / whole - frame_time) < file_.frame_time_digit_s &&
        std::fabs(fps - whole) < 2e-3 * whole) {
      fps = whole;
    }
    capture_.clip.fps = std::min(fps, 10000.0);
    return {};
  }

  Status BuildFigure() {
    frame_time_s_ = file_.frame_time_s;
    Expected<BvhFigure> figure =
        MakeBvhFigure(std::move(file_), name_, capture_.clip.fps, options_);
    if (!figure) return std::unexpected(std::move(figure.error()));
    figure_ = std::move(*figure);
    Expected<FigureAxes> axes = FindFigureAxes(figure_, options_.up, name_);
    if (!axes) return std::unexpected(std::move(axes.error()));
    axes_ = *axes;
    capture_.up = axes_.up;
    capture_.up_source = axes_.up_source;
    capture_.first_frame = figure_.first_frame;
    return {};
  }

  double LegLength(const FoundLeg& leg) const { return ChainLength(joints(), leg.hip, leg.ankle); }

  Status FindUnit() {
    const double leg = 0.5 * (LegLength(figure_.legs.legs[0]) + LegLength(figure_.legs.legs[1]));
    if (options_.unit_m) {
      if (!(*options_.unit_m > 0.0 && *options_.unit_m <= 1000.0)) {
        return Fail(ErrorCode::kInvalidArgument, "expected a unit above 0 and at most 1000 metres",
                    "unit_m");
      }
      capture_.unit_m = *options_.unit_m;
      return {};
    }
    if (!(leg > 1e-9)) return Fail(ErrorCode::kOutOfRange, "the legs have length zero", name_);
    double best = 0.0;
    for (const KnownUnit& unit : kKnownUnits) {
      const double leg_m = leg * unit.m;
      if (leg_m < kShortestLegM || leg_m > kLongestLegM) continue;
      const double miss = std::fabs(std::log(leg_m / kTypicalLegM));
      if (best > 0.0 && miss >= best) continue;
      best = std::max(miss, 1e-12);
      capture_.unit_m = unit.m;
      unit_name_ = unit.name;
    }
    if (best > 0.0) {
      Note(Text("one file unit is taken as %s: the legs are then %.2f m long", unit_name_,
                leg * capture_.unit_m));
      return {};
    }
    // Estimates the hip height of the standing figure as a sum of bone lengths: from the root to
    // the hips, along the legs, and from the ankle to the ball.
    std::vector<DVec3> p;
    std::vector<DQuat> rotations;
    figure_.ComputePose(-1, p, rotations);
    double standing = leg;
    for (const FoundLeg& found : figure_.legs.legs) {
      standing -= 0.5 * (axes_.joint_turn * p[Index(found.hip)]).y;
      standing -= 0.5 * std::min(0.0, (axes_.joint_turn * figure_.FootVector(found)).y);
    }
    if (!(standing > 0.5 * leg)) standing = leg;
    capture_.unit_is_common = false;
    capture_.unit_m = kStandingHipsM / standing;
    Note(
        Text("no common unit gives legs of 0.68 to 1.0 m; a unit of %.5g m puts the hips of the "
             "standing figure at %.2f m",
             capture_.unit_m, kStandingHipsM));
    return {};
  }

  // Returns the length of the longest chain of bones below each joint.
  std::vector<double> LengthsBelow() const {
    std::vector<double> lengths(joints().size(), 0.0);
    for (std::size_t j = joints().size() - 1; j > 0; --j) {
      double& above = lengths[Index(joints()[j].parent)];
      above = std::max(above, lengths[j] + glm::length(DVec3(joints()[j].offset_m)));
    }
    return lengths;
  }

  bool IsInLeg(int j) const {
    return std::ranges::any_of(figure_.legs.legs, [&](const FoundLeg& leg) {
      int above = std::max(leg.ankle, leg.ball);
      while (above > j) above = joint(above).parent;
      return above == j;
    });
  }

  // The offset of a joint becomes the mean of its positions. Rejects files in which positions of
  // the legs, the trunk or the limbs differ too much from their mean. Other joints, such as props
  // and fingers, get a note.
  Status CheckPositions() {
    const AveragedJoint* worst = nullptr;
    const std::vector<double> below = LengthsBelow();
    const double least =
        kBodyShare * 0.5 * (LegLength(figure_.legs.legs[0]) + LegLength(figure_.legs.legs[1]));
    for (const AveragedJoint& averaged : figure_.averaged) {
      if (worst == nullptr || averaged.deviation > worst->deviation) worst = &averaged;
      const double deviation_m = averaged.deviation * capture_.unit_m;
      if (deviation_m <= kMaxDeviationM) continue;
      if (!IsInLeg(averaged.joint) && below[Index(averaged.joint)] < least) continue;
      return Fail(ErrorCode::kUnsupported,
                  "only the root may move in its parent; export the motion without stretch and "
                  "translation of joints",
                  LineOf(figure_.joint_lines[Index(averaged.joint)]) +
                      Text(": the joint %.60s moves by up to %.2f m from its mean position",
                           joint(averaged.joint).name.c_str(), deviation_m));
    }
    if (worst == nullptr) return {};
    Note(
        Text("%zu joints besides the root have position channels; their means replace the OFFSETs "
             "(largest deviation %.4f m, %.100s)",
             figure_.averaged.size(), worst->deviation * capture_.unit_m,
             joint(worst->joint).name.c_str()));
    return {};
  }

  Status Convert() {
    const double unit = capture_.unit_m;
    STRIDEWIRE_CHECK(unit > 0.0);
    STRIDEWIRE_CHECK(figure_.roots.size() == Index(figure_.clip.frame_count()));
    const DQuat identity(1.0, 0.0, 0.0, 0.0);
    const bool turns = axes_.joint_turn != identity;
    const auto point = [&](Vec3& v) { v = Vec3(unit * (axes_.joint_turn * DVec3(v))); };
    for (Joint& j : figure_.joints) point(j.offset_m);
    for (EndSite& site : figure_.end_sites) point(site.offset_m);
    for (std::size_t j = 1; j < joints().size(); ++j) {
      if (glm::length(joints()[j].offset_m) > kMaxOffsetM) {
        return Fail(ErrorCode::kOutOfRange, "the OFFSET of the joint is too large",
                    LineOf(figure_.joint_lines[j]));
      }
    }
    for (std::size_t i = 0; i < figure_.end_sites.size(); ++i) {
      if (glm::length(figure_.end_sites[i].offset_m) > kMaxOffsetM) {
        return Fail(ErrorCode::kOutOfRange, "the OFFSET of the End Site is too large",
                    LineOf(figure_.end_site_lines[i]));
      }
    }
    Clip& clip = figure_.clip;
    for (int f = 0; f < clip.frame_count(); ++f) {
      const PoseSpan pose = clip.frame(f);
      pose.root_position_m = Vec3(unit * (axes_.world_turn * figure_.roots[Index(f)]));
      if (!turns && axes_.world_turn == identity) continue;
      for (std::size_t j = 0; j < joints().size(); ++j) {
        const DQuat& before = j == 0 ? axes_.world_turn : axes_.joint_turn;
        pose.rotations[j] = Quat(
            glm::normalize(before * DQuat(pose.rotations[j]) * glm::conjugate(axes_.joint_turn)));
      }
    }
    MakeSignContinuous(clip);
    for (int side = 0; side < 2; ++side) {
      SetFootShape(figure_, axes_.rest_stands, figure_.legs.legs[side],
                   capture_.skeleton.legs[side]);
    }
    NoteSlowMotion();
    capture_.clip = std::move(figure_.clip);
    capture_.skeleton.joints = std::move(figure_.joints);
    capture_.skeleton.end_sites = std::move(figure_.end_sites);
    if (Status status = capture_.skeleton.Validate(); !status) {
      status.error().where = name_;
      return status;
    }
    if (Status status = capture_.clip.Validate(); !status) {
      status.error().where = name_;
      return status;
    }
    return {};
  }

  DVec3 AnklePosition(int frame, int ankle) const {
    const ConstPoseSpan pose = figure_.clip.frame(frame);
    DVec3 position(0.0);
    for (int j = ankle; j >= 0; j = joint(j).parent) {
      position = DQuat(pose.rotations[Index(j)]) * position;
      position += DVec3(j == 0 ? pose.root_position_m : joint(j).offset_m);
    }
    return position;
  }

  // Some conversions declare 30 Hz for motion that was captured at 120 Hz. This is detected by the
  // acceleration of the ankles over 50 ms. In correct captures of walks, its 99th percentile was 17
  // to 68 m/s^2. Playback at a quarter of the speed reduces that to 1 to 4.
  void NoteSlowMotion() {
    const Clip& clip = figure_.clip;
    const int half = std::max(1, static_cast<int>(std::lround(0.025 * clip.fps)));
    const int count = clip.frame_count() - capture_.first_frame;
    if (options_.fps || count < 8 * half) return;
    std::vector<double> accelerations;
    double travel_m = 0.0;
    for (const FoundLeg& leg : figure_.legs.legs) {
      std::vector<DVec3> path(Index(count));
      for (int f = 0; f < count; ++f) {
        path[Index(f)] = AnklePosition(capture_.first_frame + f, leg.ankle);
        travel_m = std::max(travel_m, glm::length(path[Index(f)] - path[0]));
      }
      const double scale = clip.fps * clip.fps / (half * half);
      for (int f = half; f + half < count; ++f) {
        const DVec3 d = path[Index(f + half)] - 2.0 * path[Index(f)] + path[Index(f - half)];
        accelerations.push_back(glm::length(d) * scale);
      }
    }
    // A figure that stands still does not reveal its frame rate.
    if (travel_m < kMinTravelM) return;
    const auto p99 =
        accelerations.begin() +
        static_cast<std::ptrdiff_t>(0.99 * static_cast<double>(accelerations.size() - 1));
    std::nth_element(accelerations.begin(), p99, accelerations.end());
    if (*p99 >= kSlowestFeetMS2) return;
    Note(Text(
        "the feet accelerate by %.1f m/s^2 at most, which is too slow for a person (17 or more): "
        "Frame Time %.6g s may be too long; most captures have 120 frames per second",
        *p99, frame_time_s_));
  }

  BvhFile file_;
  std::string name_;
  const BvhReadOptions& options_;
  Capture capture_;
  BvhFigure figure_;
  FigureAxes axes_;
  double frame_time_s_ = 0.0;
  const char* unit_name_ = "";
};

}  // namespace

Expected<Capture> ParseBvh(std::string_view text, std::string_view name,
                           const BvhReadOptions& options) {
  if (text.size() > kMaxBvhBytes) {
    return Fail(ErrorCode::kLimitExceeded, "the file is larger than the limit of 512 MiB",
                std::string(name));
  }
  Expected<BvhFile> file = ParseBvhFile(text, name);
  if (!file) return std::unexpected(std::move(file.error()));
  return Reader(std::move(*file), std::string(name), options).Run();
}

Expected<Capture> ReadBvh(const std::filesystem::path& path, const BvhReadOptions& options) {
  const std::string name = path.string();
  std::error_code code;
  const std::filesystem::file_status status = std::filesystem::status(path, code);
  if (status.type() == std::filesystem::file_type::not_found) {
    return Fail(ErrorCode::kNotFound, "there is no such file", name);
  }
  if (code) return Fail(ErrorCode::kIo, "cannot open the file", name);
  if (!std::filesystem::is_regular_file(status)) {
    return Fail(ErrorCode::kIo, "expected a regular file", name);
  }
  const std::uintmax_t size = std::filesystem::file_size(path, code);
  if (code) return Fail(ErrorCode::kIo, "cannot open the file", name);
  if (size > kMaxBvhBytes) {
    return Fail(ErrorCode::kLimitExceeded, "the file is larger than the limit of 512 MiB", name);
  }
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return Fail(ErrorCode::kIo, "cannot open the file", name);
  std::string text(static_cast<std::size_t>(size), '\0');
  stream.read(text.data(), static_cast<std::streamsize>(size));
  // The file may have become shorter since file_size.
  text.resize(static_cast<std::size_t>(stream.gcount()));
  if (stream.bad()) return Fail(ErrorCode::kIo, "cannot read the file", name);
  return ParseBvh(text, name, options);
}

}  // namespace stridewire
