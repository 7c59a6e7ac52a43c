#include "corpus/rig.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace stridewire::test {
namespace {

const DQuat kNoTurn(1.0, 0.0, 0.0, 0.0);

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

bool IsLegPart(Part part) { return part >= Part::kLeftUpLeg && part <= Part::kRightToes; }

// Appends a joint with constant rotation.
int AddJoint(const std::string& name, int parent, const DVec3& offset, Rig& rig) {
  RigJoint joint;
  joint.name = name;
  joint.parent = parent;
  joint.offset = offset;
  joint.rotations.assign(Index(rig.frame_count()), kNoTurn);
  rig.joints.push_back(std::move(joint));
  return static_cast<int>(rig.joints.size()) - 1;
}

// Sorts the joints depth first, so that parents precede their children again.
void SortJoints(Rig& rig) {
  std::vector<int> order;
  const std::function<void(int)> visit = [&](int j) {
    order.push_back(j);
    for (int k = 0; k < static_cast<int>(rig.joints.size()); ++k) {
      if (rig.joints[Index(k)].parent == j) visit(k);
    }
  };
  for (int j = 0; j < static_cast<int>(rig.joints.size()); ++j) {
    if (rig.joints[Index(j)].parent < 0) visit(j);
  }
  std::vector<int> new_index(rig.joints.size(), -1);
  std::vector<RigJoint> sorted;
  for (const int j : order) {
    new_index[Index(j)] = static_cast<int>(sorted.size());
    sorted.push_back(std::move(rig.joints[Index(j)]));
  }
  for (RigJoint& joint : sorted) {
    if (joint.parent >= 0) joint.parent = new_index[Index(joint.parent)];
  }
  for (int& part : rig.parts) part = part < 0 ? -1 : new_index[Index(part)];
  rig.joints = std::move(sorted);
}

// Removes a joint and everything below it.
void Remove(int joint, Rig& rig) {
  std::vector<bool> gone(rig.joints.size(), false);
  for (std::size_t j = 0; j < rig.joints.size(); ++j) {
    const int parent = rig.joints[j].parent;
    gone[j] = static_cast<int>(j) == joint || (parent >= 0 && gone[Index(parent)]);
  }
  std::vector<int> new_index(rig.joints.size(), -1);
  std::vector<RigJoint> kept;
  for (std::size_t j = 0; j < rig.joints.size(); ++j) {
    if (gone[j]) continue;
    new_index[j] = static_cast<int>(kept.size());
    kept.push_back(std::move(rig.joints[j]));
    if (kept.back().parent >= 0) kept.back().parent = new_index[Index(kept.back().parent)];
  }
  for (int& part : rig.parts) part = part < 0 ? -1 : new_index[Index(part)];
  rig.joints = std::move(kept);
}

// Half of the rotation's twist about an axis.
DQuat HalfTwist(const DQuat& rotation, const DVec3& axis) {
  const double along = glm::dot(DVec3(rotation.x, rotation.y, rotation.z), axis);
  const double angle = 2.0 * std::atan2(along, rotation.w);
  return glm::angleAxis(0.5 * std::remainder(angle, 2.0 * std::numbers::pi), axis);
}

DQuat RandomTurn(Random& random) {
  DQuat q(random.Draw(-1, 1), random.Draw(-1, 1), random.Draw(-1, 1), random.Draw(-1, 1));
  return glm::length(q) > 0.1 ? glm::normalize(q) : kNoTurn;
}

double YawOf(const DQuat& rotation) {
  const DVec3 ahead = rotation * DVec3(0.0, 0.0, 1.0);
  return std::atan2(ahead.x, ahead.z);
}

}  // namespace

std::vector<DVec3> Rig::Positions(int frame) const {
  std::vector<DVec3> positions(joints.size());
  std::vector<DQuat> world(joints.size());
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const RigJoint& joint = joints[j];
    const DVec3 local = joint.positions.empty() ? joint.offset : joint.positions[Index(frame)];
    const DQuat& rotation = joint.rotations[Index(frame)];
    if (joint.parent < 0) {
      positions[j] = local;
      world[j] = rotation;
      continue;
    }
    const std::size_t parent = Index(joint.parent);
    positions[j] = positions[parent] + world[parent] * local;
    world[j] = world[parent] * rotation;
  }
  return positions;
}

Rig MakeRig(const Figure& figure, const FigureMotion& motion) {
  static constexpr const char* kNames[] = {
      "Hips",     "LeftUpLeg",    "LeftLeg",      "LeftFoot",    "LeftToeBase", "RightUpLeg",
      "RightLeg", "RightFoot",    "RightToeBase", "Spine",       "Spine1",      "Neck",
      "Head",     "LeftShoulder", "LeftArm",      "LeftForeArm", "LeftHand",    "RightShoulder",
      "RightArm", "RightForeArm", "RightHand"};
  Rig rig;
  rig.fps = motion.fps;
  for (int p = 0; p < kPartCount; ++p) {
    const Part part = static_cast<Part>(p);
    RigJoint joint;
    joint.name = kNames[p];
    joint.named_after = p;
    joint.parent = Figure::Parent(part);
    joint.offset = figure.Offset(part);
    if (const DVec3 end = figure.End(part); end != DVec3(0.0)) joint.end_sites = {end};
    rig.joints.push_back(std::move(joint));
    rig.parts[Index(p)] = p;
  }
  rig.joints[0].channels = Channels::kPositionAndRotation;
  for (const FigurePose& pose : motion.poses) {
    const std::array<DQuat, kPartCount> local = LocalRotations(figure, pose);
    for (std::size_t j = 0; j < local.size(); ++j) rig.joints[j].rotations.push_back(local[j]);
    rig.joints[0].positions.push_back(pose.pelvis_m);
  }
  return rig;
}

void AddTwistJoints(TwistPlace place, Rig& rig) {
  for (const Part upper : {Part::kLeftUpLeg, Part::kLeftLeg, Part::kRightUpLeg, Part::kRightLeg}) {
    const int above = rig.parts[Index(static_cast<int>(upper))];
    const int below = rig.parts[Index(static_cast<int>(upper) + 1)];
    if (above < 0 || below < 0) continue;
    const DVec3 half = 0.5 * rig.joints[Index(below)].offset;
    const int twist = AddJoint(rig.joints[Index(above)].name + "Twist", above, half, rig);
    rig.joints[Index(twist)].named_after = static_cast<int>(upper);
    rig.joints[Index(twist)].suffix = "Twist";
    if (place == TwistPlace::kBeside) {
      rig.joints[Index(twist)].end_sites = {half};
      continue;
    }
    RigJoint& child = rig.joints[Index(below)];
    child.parent = twist;
    child.offset = half;
    const DVec3 axis = glm::normalize(half);
    for (int f = 0; f < rig.frame_count(); ++f) {
      DQuat& rotation = rig.joints[Index(above)].rotations[Index(f)];
      const DQuat turn = HalfTwist(rotation, axis);
      rotation = rotation * glm::conjugate(turn);
      rig.joints[Index(twist)].rotations[Index(f)] = turn;
    }
  }
  SortJoints(rig);
}

void RemoveToes(bool with_end_site, Rig& rig) {
  for (const Part toes : {Part::kRightToes, Part::kLeftToes}) {
    const RigJoint joint = rig.Of(toes);
    RigJoint& foot = rig.Of(static_cast<Part>(static_cast<int>(toes) - 1));
    if (with_end_site) foot.end_sites = {joint.offset + joint.end_sites.front()};
    Remove(rig.parts[Index(static_cast<int>(toes))], rig);
  }
}

void AddFingers(Rig& rig) {
  for (const Part hand : {Part::kLeftHand, Part::kRightHand}) {
    const int palm = rig.parts[Index(static_cast<int>(hand))];
    const DVec3 end = rig.joints[Index(palm)].end_sites.front();
    rig.joints[Index(palm)].end_sites.clear();
    for (const char* finger : {"Index", "Ring"}) {
      const double side = finger[0] == 'I' ? 0.02 : -0.02;
      int parent = palm;
      for (int k = 1; k <= 3; ++k) {
        const DVec3 offset = k == 1 ? 0.5 * end + DVec3(0.0, 0.0, side) : 0.2 * end;
        const std::string suffix = finger + std::to_string(k);
        parent = AddJoint(rig.joints[Index(palm)].name + suffix, parent, offset, rig);
        rig.joints[Index(parent)].named_after = static_cast<int>(hand);
        rig.joints[Index(parent)].suffix = suffix;
      }
      rig.joints[Index(parent)].end_sites = {0.15 * end};
    }
  }
  SortJoints(rig);
}

void RemoveLeg(int foot, Rig& rig) {
  const Part up_leg = foot == 0 ? Part::kLeftUpLeg : Part::kRightUpLeg;
  Remove(rig.parts[Index(static_cast<int>(up_leg))], rig);
}

void AddRoots(Roots roots, Rig& rig) {
  const int hips = rig.parts[0];
  const int first =
      AddJoint(roots == Roots::kRotated ? "Armature" : "Reference", -1, DVec3(0.0), rig);
  int parent = first;
  rig.joints[Index(first)].channels = Channels::kPositionAndRotation;
  const auto count = Index(rig.frame_count());
  RigJoint& hip_joint = rig.joints[Index(hips)];
  std::vector<DVec3> top_positions(count, DVec3(0.0));
  std::vector<DQuat> top_rotations(count, kNoTurn);
  if (roots == Roots::kRotated) {
    top_positions.assign(count, DVec3(0.3, 0.1, -0.2));
    top_rotations.assign(count, AboutX(-90.0 * kDegree));
  } else if (roots == Roots::kTrajectory) {
    for (std::size_t f = 0; f < count; ++f) {
      top_positions[f] = hip_joint.positions[f] * DVec3(1.0, 0.0, 1.0);
      top_rotations[f] = AboutY(YawOf(hip_joint.rotations[f]));
    }
  } else if (roots == Roots::kSplit) {
    top_positions = hip_joint.positions;
    parent = AddJoint("Pivot", first, DVec3(0.0), rig);
  }
  std::vector<DQuat> between(count, kNoTurn);
  if (roots == Roots::kSplit) {
    for (std::size_t f = 0; f < count; ++f) {
      between[f] = AboutY(YawOf(rig.joints[Index(hips)].rotations[f]));
    }
    rig.joints[Index(parent)].rotations = between;
  }
  RigJoint& moved = rig.joints[Index(hips)];
  moved.parent = parent;
  for (std::size_t f = 0; f < count; ++f) {
    const DQuat above = top_rotations[f] * between[f];
    moved.positions[f] = glm::conjugate(above) * (moved.positions[f] - top_positions[f]);
    moved.rotations[f] = glm::conjugate(above) * moved.rotations[f];
  }
  if (roots == Roots::kSplit) {
    moved.positions.clear();
    moved.channels = Channels::kRotation;
  }
  rig.joints[Index(first)].positions = std::move(top_positions);
  rig.joints[Index(first)].rotations = std::move(top_rotations);
  SortJoints(rig);
}

void AddPropInHand(Rig& rig) {
  const int hand = rig.parts[Index(static_cast<int>(Part::kRightHand))];
  const int prop = AddJoint("Sword", hand, DVec3(-0.08, 0.0, 0.0), rig);
  rig.joints[Index(prop)].end_sites = {DVec3(0.0, 0.0, 0.9)};
  SortJoints(rig);
}

void AddSecondRoot(Rig& rig) {
  const int prop = AddJoint("Camera", -1, DVec3(0.0), rig);
  RigJoint& joint = rig.joints[Index(prop)];
  joint.channels = Channels::kPositionAndRotation;
  joint.end_sites = {DVec3(0.0, 0.0, 0.2)};
  for (int f = 0; f < rig.frame_count(); ++f) {
    joint.positions.push_back(DVec3(2.0, 1.5, 3.0 + 0.01 * f));
  }
}

void ReFrame(Frames frames, Random& random, Rig& rig) {
  std::vector<DQuat> turns(rig.joints.size(), kNoTurn);
  for (std::size_t j = 0; j < turns.size(); ++j) {
    switch (frames) {
      case Frames::kLegsDown:
      case Frames::kLegsAside: break;
      case Frames::kAlongBones: {
        DVec3 bone = rig.joints[j].end_sites.empty() ? DVec3(0.0) : rig.joints[j].end_sites[0];
        for (const RigJoint& child : rig.joints) {
          if (child.parent == static_cast<int>(j)) bone = child.offset;
        }
        if (glm::length(bone) < 1e-9) break;
        const DVec3 x = glm::normalize(bone);
        const DVec3 other = std::fabs(x.z) < 0.9 ? DVec3(0, 0, 1) : DVec3(0, 1, 0);
        const DVec3 y = glm::normalize(glm::cross(other, x));
        turns[j] = glm::normalize(glm::quat_cast(glm::dmat3(x, y, glm::cross(x, y))));
        break;
      }
      case Frames::kQuarters:
        for (int axis = 0; axis < 3; ++axis) {
          const double angle = 90.0 * kDegree * std::floor(random.Draw(0.0, 4.0));
          turns[j] = turns[j] * (axis == 0   ? AboutX(angle)
                                 : axis == 1 ? AboutY(angle)
                                             : AboutZ(angle));
        }
        break;
      case Frames::kRandom: turns[j] = RandomTurn(random); break;
    }
  }
  if (frames == Frames::kLegsDown || frames == Frames::kLegsAside) {
    for (int p = 0; p < kPartCount; ++p) {
      if (!IsLegPart(static_cast<Part>(p)) || rig.parts[Index(p)] < 0) continue;
      turns[Index(rig.parts[Index(p)])] =
          frames == Frames::kLegsDown ? AboutZ(180.0 * kDegree) : AboutY(90.0 * kDegree);
    }
  }
  for (std::size_t j = 0; j < turns.size(); ++j) {
    RigJoint& joint = rig.joints[j];
    const DQuat back = joint.parent < 0 ? kNoTurn : glm::conjugate(turns[Index(joint.parent)]);
    joint.offset = back * joint.offset;
    for (DVec3& position : joint.positions) position = back * position;
    for (DQuat& rotation : joint.rotations) rotation = back * rotation * turns[j];
    for (DVec3& end : joint.end_sites) end = glm::conjugate(turns[j]) * end;
  }
}

void TurnWorld(const DQuat& turn, Rig& rig) {
  for (RigJoint& joint : rig.joints) {
    joint.offset = turn * joint.offset;
    for (DVec3& position : joint.positions) position = turn * position;
    for (DQuat& rotation : joint.rotations) rotation = turn * rotation * glm::conjugate(turn);
    for (DVec3& end : joint.end_sites) end = turn * end;
  }
}

void Translate(const DVec3& by_m, Rig& rig) {
  for (RigJoint& joint : rig.joints) {
    if (joint.parent >= 0) continue;
    for (DVec3& position : joint.positions) position += by_m;
  }
}

void Scale(double factor, Rig& rig) {
  for (RigJoint& joint : rig.joints) {
    joint.offset *= factor;
    for (DVec3& position : joint.positions) position *= factor;
    for (DVec3& end : joint.end_sites) end *= factor;
  }
}

void InsertRestFrames(int count, Rig& rig) {
  for (RigJoint& joint : rig.joints) {
    joint.rotations.insert(joint.rotations.begin(), Index(count), kNoTurn);
    if (!joint.positions.empty()) {
      joint.positions.insert(joint.positions.begin(), Index(count), joint.offset);
    }
  }
}

void AddNoise(double amplitude_rad, Random& random, Rig& rig) {
  for (std::size_t j = 0; j < rig.joints.size(); ++j) {
    if (static_cast<int>(j) == rig.parts[0] || rig.joints[j].parent < 0) continue;
    const double rates[] = {random.Draw(3.0, 9.0), random.Draw(3.0, 9.0), random.Draw(3.0, 9.0)};
    for (int f = 0; f < rig.frame_count(); ++f) {
      const double t = f / rig.fps;
      DQuat& rotation = rig.joints[j].rotations[Index(f)];
      rotation = rotation * AboutX(amplitude_rad * std::sin(rates[0] * t)) *
                 AboutY(amplitude_rad * std::sin(rates[1] * t)) *
                 AboutZ(amplitude_rad * std::sin(rates[2] * t));
    }
  }
}

void FlipForearm(int frame, Rig& rig) {
  DQuat& rotation = rig.Of(Part::kLeftForeArm).rotations[Index(frame)];
  rotation = rotation * AboutX(120.0 * kDegree);
}

}  // namespace stridewire::test
