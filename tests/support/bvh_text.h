#pragma once

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "test_paths.h"

namespace stridewire::test {

/// Generates BVH text of a small walking figure. Each member controls one property of the file.
struct BvhText {
  std::string line_end = "\n";
  bool names = true;  ///< False: the joints are called J0, J1, ...
  bool toes = true;   ///< False: the ankle has an End Site instead of a toe joint.
  bool end_sites = true;
  bool last_line_end = true;
  bool positions_everywhere = false;
  bool folded = false;  ///< The legs point up in the rest pose; every frame turns them down.
  double unit = 1.0;    ///< File units per metre.
  int frames = 12;
  std::string frame_time = "0.0333333";
  std::string frames_text;  ///< Replaces the number after `Frames:` if not empty.
  /// The axes of the file (1: x, 2: y, 3: z; negative: inverted) in which the figure's x, y and z
  /// axes point. They must form a rotation.
  std::array<int, 3> axes{1, 2, 3};

  struct Part {
    const char* name;
    int parent;
    double x, y, z;
  };

  [[nodiscard]] std::vector<Part> Parts() const {
    std::vector<Part> parts = {{"Hips", -1, 0, 0, 0},
                               {"LeftUpLeg", 0, 0.09, -0.05, 0},
                               {"LeftLeg", 1, 0, -0.42, 0.01},
                               {"LeftFoot", 2, 0, -0.41, -0.01}};
    if (toes) parts.push_back({"LeftToeBase", 3, 0, -0.05, 0.13});
    const int right = static_cast<int>(parts.size());
    parts.push_back({"RightUpLeg", 0, -0.09, -0.05, 0});
    parts.push_back({"RightLeg", right, 0, -0.42, 0.01});
    parts.push_back({"RightFoot", right + 1, 0, -0.41, -0.01});
    if (toes) parts.push_back({"RightToeBase", right + 2, 0, -0.05, 0.13});
    const int spine = static_cast<int>(parts.size());
    parts.push_back({"Spine", 0, 0, 0.2, 0});
    parts.push_back({"Head", spine, 0, 0.35, 0});
    parts.push_back({"LeftArm", spine, 0.2, 0.25, 0});
    parts.push_back({"RightArm", spine, -0.2, 0.25, 0});
    if (folded) {
      for (Part& part : parts) {
        if (std::string(part.name).find("Leg") != std::string::npos && part.parent > 0)
          part.y *= -1;
        if (std::string(part.name).find("Foot") != std::string::npos) part.y *= -1;
        if (std::string(part.name).find("Toe") != std::string::npos) {
          part.y *= -1;
          part.z *= -1;
        }
      }
    }
    return parts;
  }

  /// The file axis (0 to 2) and the sign of an axis of the figure.
  [[nodiscard]] int FileAxis(int axis) const {
    return std::abs(axes[static_cast<std::size_t>(axis)]) - 1;
  }
  [[nodiscard]] double Sign(int axis) const {
    return axes[static_cast<std::size_t>(axis)] < 0 ? -1.0 : 1.0;
  }

  [[nodiscard]] std::array<double, 3> InFile(double x, double y, double z) const {
    std::array<double, 3> out{};
    const double in[] = {x, y, z};
    for (int axis = 0; axis < 3; ++axis) {
      out[static_cast<std::size_t>(FileAxis(axis))] = Sign(axis) * in[axis] * unit;
    }
    return out;
  }

  [[nodiscard]] std::string Text() const {
    std::string text;
    const auto line = [&](const std::string& s) { text += s + line_end; };
    const auto numbers = [&](const std::array<double, 3>& v) {
      char buffer[120];
      std::snprintf(buffer, sizeof buffer, "%.7f %.7f %.7f", v[0], v[1], v[2]);
      return std::string(buffer);
    };
    const std::vector<Part> parts = Parts();
    line("HIERARCHY");
    int open = 0;
    std::vector<int> stack;
    std::vector<bool> has_child(parts.size(), false);
    for (const Part& part : parts) {
      if (part.parent >= 0) has_child[static_cast<std::size_t>(part.parent)] = true;
    }
    for (std::size_t j = 0; j < parts.size(); ++j) {
      const Part& part = parts[j];
      while (!stack.empty() && stack.back() != part.parent) {
        line(std::string(static_cast<std::size_t>(--open), '\t') + "}");
        stack.pop_back();
      }
      const std::string indent(static_cast<std::size_t>(open), '\t');
      const std::string name = names ? part.name : "J" + std::to_string(j);
      line(indent + (j == 0 ? "ROOT " : "JOINT ") + name);
      line(indent + "{");
      line(indent + "\tOFFSET " + numbers(InFile(part.x, part.y, part.z)));
      const std::string letters = "XYZ";
      std::string channels;
      for (const int axis : {2, 0, 1})
        channels +=
            std::string(" ") + letters[static_cast<std::size_t>(FileAxis(axis))] + "rotation";
      const bool moves = j == 0 || positions_everywhere;
      line(indent + (moves ? "\tCHANNELS 6 Xposition Yposition Zposition" : "\tCHANNELS 3") +
           channels);
      if (!has_child[j] && end_sites) {
        line(indent + "\tEnd Site");
        line(indent + "\t{");
        const bool is_foot = std::string(part.name).find("Foot") != std::string::npos;
        line(indent + "\t\tOFFSET " +
             (is_foot ? numbers(InFile(0, -0.06, 0.21)) : numbers(InFile(0, 0, 0.06))));
        line(indent + "\t}");
      }
      stack.push_back(static_cast<int>(j));
      ++open;
    }
    while (open > 0) line(std::string(static_cast<std::size_t>(--open), '\t') + "}");
    line("MOTION");
    line("Frames: " + (frames_text.empty() ? std::to_string(frames) : frames_text));
    line("Frame Time: " + frame_time);
    for (int f = 0; f < frames; ++f) {
      std::string row;
      for (std::size_t j = 0; j < parts.size(); ++j) {
        const Part& part = parts[j];
        const double phase = 0.5 * f + static_cast<double>(j);
        if (j == 0) {
          row += numbers(InFile(0.02 * std::sin(phase), 0.95 + 0.02 * std::cos(phase), 0.04 * f));
        } else if (positions_everywhere) {
          row += ' ' + numbers(InFile(part.x, part.y + 0.01 * (f % 2 == 0 ? 1 : -1), part.z));
        }
        // Angles about z, x and y of the figure. An inverted axis inverts the angle.
        double angles[] = {3.0 * std::sin(phase), 20.0 * std::sin(0.7 * phase),
                           4.0 * std::cos(phase)};
        if (folded && std::string(part.name).find("UpLeg") != std::string::npos) angles[1] += 180.0;
        const int about[] = {2, 0, 1};
        for (int k = 0; k < 3; ++k) {
          char buffer[40];
          std::snprintf(buffer, sizeof buffer, " %.6f", Sign(about[k]) * angles[k]);
          row += buffer;
        }
      }
      line(row);
    }
    if (!last_line_end) text.resize(text.size() - line_end.size());
    return text;
  }
};

/// Returns the external captures; empty if they are not available.
inline std::vector<std::filesystem::path> SharedCaptures() {
  std::vector<std::filesystem::path> paths;
  if (std::filesystem::is_directory(MocapDir())) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(MocapDir())) {
      if (entry.path().extension() == ".bvh") paths.push_back(entry.path());
    }
  }
  return paths;
}

/// Returns the captures of Debian's package assimp-testmodels; empty if it is not installed.
inline std::vector<std::filesystem::path> PackagedCaptures() {
  std::vector<std::filesystem::path> paths;
  for (const char* name : {"01_01.bvh", "01_03.bvh"}) {
    const std::filesystem::path path = std::filesystem::path("/usr/share/assimp/models/BVH") / name;
    if (std::filesystem::exists(path)) paths.push_back(path);
  }
  return paths;
}

inline std::string FileText(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

}  // namespace stridewire::test
