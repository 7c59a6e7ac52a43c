#include "stridewire/offline/bvh_writer.h"

#include <array>
#include <charconv>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <numbers>
#include <ostream>
#include <string>
#include <vector>

#include "base/check.h"
#include "base/trig.h"
#include "offline/base/replace_file.h"

namespace stridewire {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

// Appends the shortest decimal number that is read as the same float. Uses no exponent.
void AppendFloat(std::string& text, float value) {
  if (value == 0.0f) value = 0.0f;  // Avoids "-0".
  char buffer[128];
  const auto result =
      std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::fixed);
  text.append(buffer, result.ptr);
}

void AppendFixed(std::string& text, double value, int decimals) {
  char buffer[400];
  const auto result =
      std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::fixed, decimals);
  text.append(buffer, result.ptr);
}

void AppendVector(std::string& text, const Vec3& v) {
  for (int axis = 0; axis < 3; ++axis) {
    if (axis > 0) text += ' ';
    AppendFloat(text, v[axis]);
  }
}

std::string BvhName(const std::string& name) {
  std::string result = name;
  for (char& c : result) {
    if (static_cast<unsigned char>(c) <= ' ' || c == 0x7f || c == '{' || c == '}') c = '_';
  }
  return result;
}

struct Angles {
  double z = 0.0, y = 0.0, x = 0.0;  // Angles in radians. The rotation is R = Rz Ry Rx.
};

// Decomposes a rotation into Euler angles. Of the two solutions, returns the one nearer to the
// angles of the previous frame.
//
//                  | cz cy   cz sy sx - sz cx   cz sy cx + sz sx |
//   Rz Ry Rx   =   | sz cy   sz sy sx + cz cx   sz sy cx - cz sx |
//                  |  -sy         cy sx              cy cx       |
//
// If cy is near 0 (gimbal lock), only z -+ x is determined, and x keeps its previous value. z is
// computed from R Rx(-x) = Rz Ry, whose second column is (-sz, cz, 0), so it is correct in all
// cases.
Angles NearestAngles(const Quat& rotation, const Angles& before) {
  const glm::dmat3 r = glm::mat3_cast(glm::normalize(DQuat(rotation)));  // r[column][row]
  const double cos_y = std::sqrt(r[0][0] * r[0][0] + r[0][1] * r[0][1]);
  Angles best;
  double best_distance = -1.0;
  for (const double sign : {1.0, -1.0}) {
    Angles a;
    a.y = Atan2(-r[0][2], sign * cos_y);
    a.x = cos_y < 1e-7 ? before.x : Atan2(sign * r[1][2], sign * r[2][2]);
    const double sin_x = Sin(a.x);
    const double cos_x = Cos(a.x);
    a.z = Atan2(-(cos_x * r[1][0] - sin_x * r[2][0]), cos_x * r[1][1] - sin_x * r[2][1]);
    a.x = UnwrapAngle(a.x, before.x);
    a.y = UnwrapAngle(a.y, before.y);
    a.z = UnwrapAngle(a.z, before.z);
    const double distance =
        std::fabs(a.x - before.x) + std::fabs(a.y - before.y) + std::fabs(a.z - before.z);
    if (best_distance < 0.0 || distance < best_distance) {
      best = a;
      best_distance = distance;
    }
  }
  return best;
}

struct Tree {
  std::vector<std::vector<int>> children;
  std::vector<std::vector<int>> end_sites;  // Indices into Skeleton::end_sites.
  std::vector<int> depth_first;

  explicit Tree(const Skeleton& skeleton)
      : children(skeleton.joints.size()), end_sites(skeleton.joints.size()) {
    for (int j = 1; j < skeleton.joint_count(); ++j) {
      const int parent = skeleton.joints[static_cast<std::size_t>(j)].parent;
      children[static_cast<std::size_t>(parent)].push_back(j);
    }
    for (std::size_t i = 0; i < skeleton.end_sites.size(); ++i) {
      end_sites[static_cast<std::size_t>(skeleton.end_sites[i].joint)].push_back(
          static_cast<int>(i));
    }
  }
};

// Recursive. The depth is at most kMaxJoints, which Skeleton::Validate has checked.
void AppendJoint(std::string& text, const Skeleton& skeleton, Tree& tree, int j, int depth) {
  const std::size_t index = static_cast<std::size_t>(j);
  const Joint& joint = skeleton.joints[index];
  tree.depth_first.push_back(j);
  const std::string indent(static_cast<std::size_t>(depth), '\t');
  text += indent + (j == 0 ? "ROOT " : "JOINT ") + BvhName(joint.name) + '\n';
  text += indent + "{\n" + indent + "\tOFFSET ";
  AppendVector(text, j == 0 ? Vec3(0.0f) : joint.offset_m);
  text += '\n' + indent;
  text += j == 0 ? "\tCHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation\n"
                 : "\tCHANNELS 3 Zrotation Yrotation Xrotation\n";
  for (const int child : tree.children[index]) AppendJoint(text, skeleton, tree, child, depth + 1);
  const auto append_end_site = [&](const Vec3& offset_m) {
    text += indent + "\tEnd Site\n" + indent + "\t{\n" + indent + "\t\tOFFSET ";
    AppendVector(text, offset_m);
    text += '\n' + indent + "\t}\n";
  };
  for (const int site : tree.end_sites[index]) {
    append_end_site(skeleton.end_sites[static_cast<std::size_t>(site)].offset_m);
  }
  if (tree.children[index].empty() && tree.end_sites[index].empty()) append_end_site(Vec3(0.0f));
  text += indent + "}\n";
}

}  // namespace

Status WriteBvh(const Skeleton& skeleton, const Clip& clip, std::ostream& out) {
  if (Status status = skeleton.Validate(); !status) return status;
  if (Status status = clip.Validate(); !status) return status;
  if (skeleton.joint_count() != clip.joint_count) {
    return Fail(ErrorCode::kShapeMismatch, "skeleton and clip have different numbers of joints",
                clip.joint_count);
  }
  Tree tree(skeleton);
  std::string text = "HIERARCHY\n";
  AppendJoint(text, skeleton, tree, 0, 0);
  STRIDEWIRE_CHECK(tree.depth_first.size() == skeleton.joints.size());
  text += "MOTION\nFrames: " + std::to_string(clip.frame_count()) + "\nFrame Time: ";
  AppendFixed(text, 1.0 / clip.fps, 12);
  text += '\n';
  std::vector<Angles> before(skeleton.joints.size());
  for (int f = 0; f < clip.frame_count(); ++f) {
    const ConstPoseSpan pose = clip.frame(f);
    AppendVector(text, pose.root_position_m);
    for (const int j : tree.depth_first) {
      const std::size_t index = static_cast<std::size_t>(j);
      before[index] = NearestAngles(pose.rotations[index], before[index]);
      for (const double angle : {before[index].z, before[index].y, before[index].x}) {
        text += ' ';
        AppendFixed(text, angle * kDegrees + 0.0, 6);
      }
    }
    text += '\n';
    out.write(text.data(), static_cast<std::streamsize>(text.size()));
    text.clear();
  }
  out.flush();
  if (!out) return Fail(ErrorCode::kIo, "cannot write the motion");
  return {};
}

Status WriteBvh(const Skeleton& skeleton, const Clip& clip, const std::filesystem::path& path) {
  return ReplaceFile(path, [&](std::ostream& out) { return WriteBvh(skeleton, clip, out); });
}

}  // namespace stridewire
