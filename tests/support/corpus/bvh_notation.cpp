#include "corpus/bvh_notation.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

namespace stridewire::test {
namespace {

constexpr int kPositionDigits = 6;
constexpr int kAngleDigits = 5;

// Angles in degrees about the axes i, j and k, applied such that R = R_i R_j R_k.
std::array<double, 3> EulerDegrees(const DQuat& rotation, const std::array<int, 3>& order) {
  const auto [i, j, k] = order;
  const double sign = (j - i + 3) % 3 == 1 ? 1.0 : -1.0;
  const glm::dmat3 m = glm::mat3_cast(rotation);
  const auto at = [&](int row, int column) { return m[column][row]; };
  const double sine = std::clamp(sign * at(i, k), -1.0, 1.0);
  std::array<double, 3> angles{0.0, std::asin(sine), 0.0};
  if (std::fabs(sine) < 1.0 - 1e-12) {
    angles[0] = std::atan2(-sign * at(j, k), at(k, k));
    angles[2] = std::atan2(-sign * at(i, j), at(i, i));
  } else {
    angles[0] = std::atan2(sign * at(k, j), at(j, j));
  }
  for (double& angle : angles) angle /= kDegree;
  return angles;
}

class Writer {
 public:
  Writer(const Rig& rig, const BvhNotation& notation) : rig_(rig), notation_(notation) {}

  std::string Run() {
    if (notation_.byte_order_mark) text_ += "\xEF\xBB\xBF";
    if (!notation_.comment.empty()) text_ += notation_.comment + notation_.line_end;
    Line(0, Word("HIERARCHY"));
    for (int j = 0; j < static_cast<int>(rig_.joints.size()); ++j) {
      if (Joint(j).parent < 0) WriteJoint(j, 0);
    }
    Line(0, Word("MOTION"));
    Line(0, Word("Frames: ") + (notation_.frames_text.empty() ? std::to_string(rig_.frame_count())
                                                              : notation_.frames_text));
    text_ += Word("Frame Time: ");
    Number(1.0 / rig_.fps, notation_.frame_time_digits);
    text_ += notation_.line_end;
    for (int f = 0; f < rig_.frame_count(); ++f) WriteRow(f);
    if (!notation_.last_line_end) text_.resize(text_.size() - notation_.line_end.size());
    return std::move(text_);
  }

 private:
  const RigJoint& Joint(int j) const { return rig_.joints[static_cast<std::size_t>(j)]; }

  std::string Word(std::string word) const {
    if (notation_.lower_case) {
      for (char& c : word) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
    return word;
  }

  void Line(int depth, const std::string& line) {
    for (int i = 0; i < depth; ++i) text_ += notation_.indent;
    text_ += line + notation_.line_end;
  }

  void Number(double value, int digits) {
    char buffer[64];
    const auto end =
        std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::fixed, digits).ptr;
    if (notation_.decimal_comma) std::replace(buffer, end, '.', ',');
    text_.append(buffer, end);
  }

  void Offset(int depth, const DVec3& offset) {
    for (int i = 0; i < depth; ++i) text_ += notation_.indent;
    text_ += Word("OFFSET");
    for (int axis = 0; axis < 3; ++axis) {
      text_ += notation_.separator;
      Number(offset[axis], kPositionDigits);
    }
    text_ += notation_.line_end;
  }

  bool HasPositions(const RigJoint& joint) const {
    return notation_.positions_everywhere || joint.channels == Channels::kPositionAndRotation;
  }

  void WriteChannels(int depth, const RigJoint& joint) {
    const bool has_positions = HasPositions(joint);
    const int count = 3 + (has_positions ? 3 : 0) + (notation_.scales ? 3 : 0);
    std::string positions;
    std::string rotations;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto letter = [](int axis) { return std::string(1, "XYZ"[axis]); };
      if (has_positions) positions += ' ' + Word(letter(notation_.position_order[i]) + "position");
      rotations += ' ' + Word(letter(notation_.rotation_order[i]) + "rotation");
    }
    std::string line = Word("CHANNELS ") + std::to_string(count);
    line += notation_.rotations_first ? rotations + positions : positions + rotations;
    if (notation_.scales) line += Word(" Xscale Yscale Zscale");
    Line(depth, line);
  }

  void WriteJoint(int j, int depth) {
    const RigJoint& joint = Joint(j);
    order_.push_back(j);
    Line(depth, Word(joint.parent < 0 ? "ROOT " : "JOINT ") + joint.name);
    Line(depth, "{");
    Offset(depth + 1, joint.offset);
    WriteChannels(depth + 1, joint);
    for (int k = j + 1; k < static_cast<int>(rig_.joints.size()); ++k) {
      if (Joint(k).parent == j) WriteJoint(k, depth + 1);
    }
    for (const DVec3& end : joint.end_sites) {
      Line(depth + 1, Word("End Site"));
      Line(depth + 1, "{");
      Offset(depth + 2, end);
      Line(depth + 1, "}");
    }
    Line(depth, "}");
  }

  void WriteRow(int frame) {
    int in_line = 0;
    const auto value = [&](double number, int digits) {
      if (in_line > 0 && in_line == notation_.numbers_per_line) {
        text_ += notation_.line_end;
        in_line = 0;
      }
      if (in_line > 0) text_ += notation_.separator;
      Number(number, digits);
      ++in_line;
    };
    for (const int j : order_) {
      const RigJoint& joint = Joint(j);
      const auto f = static_cast<std::size_t>(frame);
      const DVec3 position = joint.positions.empty() ? joint.offset : joint.positions[f];
      const auto angles = EulerDegrees(joint.rotations[f], notation_.rotation_order);
      const auto write_positions = [&] {
        if (!HasPositions(joint)) return;
        for (const int axis : notation_.position_order) value(position[axis], kPositionDigits);
      };
      if (!notation_.rotations_first) write_positions();
      for (const double angle : angles) value(angle, kAngleDigits);
      if (notation_.rotations_first) write_positions();
      for (int i = 0; i < (notation_.scales ? 3 : 0); ++i) value(1.0, 1);
    }
    text_ += notation_.line_end;
  }

  const Rig& rig_;
  const BvhNotation& notation_;
  std::vector<int> order_;
  std::string text_;
};

}  // namespace

std::string WriteRig(const Rig& rig, const BvhNotation& notation) {
  return Writer(rig, notation).Run();
}

}  // namespace stridewire::test
