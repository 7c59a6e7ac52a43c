#include "stridewire/protocol/compact_codec.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "base/check.h"
#include "compact_kernel.h"
#include "smallest_three.h"
#include "stridewire/protocol/limits.h"
#include "stridewire/protocol/pose_codec.h"

namespace stridewire::protocol {
namespace {

// The squares of the three smaller components sum to at most 3/4. The margin allows for the
// rounding error of components of 8 bits.
constexpr float kMaxThreeSquaredCompact = 0.77f;
// The decoded w can be smaller than the encoded one, because each component is rounded by up to
// half a step.
constexpr float kLeastDecodedW = 0.9f;

constexpr std::size_t kRootBytes = 12;

// Reads the numbers of a pose that WriteWords (compact_kernel.cpp) has written without gaps.
class BitReader {
 public:
  explicit BitReader(std::span<const std::byte> words) : words_(words) {}

  // Reads up to 16 bits. The caller guarantees that they exist.
  std::uint32_t Take(int bits) {
    if (bits > held_) {
      std::uint16_t word = 0;
      std::memcpy(&word, words_.data() + at_, 2);
      at_ += 2;
      window_ |= std::uint32_t{word} << held_;
      held_ += 16;
    }
    const std::uint32_t value = window_ & ((1u << bits) - 1);
    window_ >>= bits;
    held_ -= bits;
    return value;
  }
  [[nodiscard]] bool RestIsZero() const { return window_ == 0; }

 private:
  std::span<const std::byte> words_;
  std::size_t at_ = 0;
  std::uint32_t window_ = 0;
  int held_ = 0;
};

bool ReadSmallestThree(BitReader& reader, const CompactJoint& joint, Quat& q) {
  const std::uint32_t largest = reader.Take(2);
  const int zero = 1 << (joint.smallest_three_bits - 1);
  float c[4] = {};
  float squared = 0.0f;
  bool is_good = true;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto bits = static_cast<int>(reader.Take(joint.smallest_three_bits));
    is_good &= bits != 0;
    const float value = static_cast<float>(bits - zero) * joint.step[0];
    c[kKept[largest][k]] = value;
    squared += value * value;
  }
  if (!is_good || squared > kMaxThreeSquaredCompact) return false;
  c[largest] = std::sqrt(1.0f - squared);
  q = Quat(c[3], c[0], c[1], c[2]);
  return true;
}

bool ReadComponents(BitReader& reader, const CompactJoint& joint, Quat& q) {
  float v[3];
  for (std::size_t c = 0; c < 3; ++c) {
    const std::uint32_t bits = joint.bits[c] > 0 ? reader.Take(joint.bits[c]) : 0;
    v[c] = joint.low[c] + static_cast<float>(bits) * joint.step[c];
  }
  const float w_squared = 1.0f - (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  const float least = kLeastDecodedW * joint.least_w;
  if (!(w_squared >= least * least)) return false;
  const Quat reference(joint.reference[3], joint.reference[0], joint.reference[1],
                       joint.reference[2]);
  q = reference * Quat(std::sqrt(w_squared), v[0], v[1], v[2]);
  return true;
}

// Assigns the bits of consecutive numbers to 32-bit words.
class WordPlan {
 public:
  void Put(std::size_t row, int bits) {
    parts_.push_back({static_cast<std::uint16_t>(row), static_cast<std::int8_t>(fill_)});
    fill_ += bits;
    bits_ += static_cast<std::size_t>(bits);
    if (fill_ < 32) return;
    parts_.back().ends_word = true;
    fill_ -= 32;
    if (fill_ == 0) return;
    parts_.push_back({static_cast<std::uint16_t>(row), static_cast<std::int8_t>(fill_ - bits)});
  }
  [[nodiscard]] std::size_t bits() const { return bits_; }

  // Adds words of zeros up to a multiple of four words.
  std::vector<CompactPart> Finish() {
    if (fill_ > 0) parts_.back().ends_word = true;
    const std::size_t words = (bits_ + 31) / 32;
    for (std::size_t i = words; i % 4 != 0; ++i) parts_.push_back({kZeroRow, 0, true});
    return std::move(parts_);
  }

 private:
  std::vector<CompactPart> parts_;
  int fill_ = 0;
  std::size_t bits_ = 0;
};

// Sorts joints by depth. Joints of the same depth do not depend on each other.
std::vector<std::uint16_t> ByDepth(std::span<const std::int16_t> parents) {
  std::vector<int> depths;
  std::vector<std::uint16_t> order;
  for (const std::int16_t parent : parents) {
    order.push_back(static_cast<std::uint16_t>(depths.size()));
    depths.push_back(parent < 0 ? 0 : depths[static_cast<std::size_t>(parent)] + 1);
  }
  std::ranges::stable_sort(order, {}, [&](std::uint16_t joint) { return depths[joint]; });
  return order;
}

}  // namespace

Status CheckRotationQuantizations(std::span<const RotationQuantization> codes) {
  const auto wrong = [](ErrorCode code, const char* text, std::size_t joint) {
    return Fail(code, text, static_cast<std::int64_t>(joint));
  };
  if (codes.size() > kMaxJoints) {
    return wrong(ErrorCode::kLimitExceeded, "too many rotation quantizations", codes.size());
  }
  for (std::size_t j = 0; j < codes.size(); ++j) {
    const RotationQuantization& code = codes[j];
    if (code.smallest_three_bits != 0) {
      if (code.smallest_three_bits < RotationQuantization::kMinFreeBits ||
          code.smallest_three_bits > RotationQuantization::kMaxFreeBits) {
        return wrong(ErrorCode::kOutOfRange, "smallest_three_bits is neither 0 nor from 8 to 15",
                     j);
      }
    } else if (j == 0) {
      return wrong(ErrorCode::kMalformed, "smallest_three_bits of the root is 0", j);
    }
    const float squared = Dot(code.reference, code.reference);
    if (!(std::abs(squared - 1.0f) <= 1e-5f)) {
      return wrong(ErrorCode::kOutOfRange, "reference is not a unit quaternion", j);
    }
    if (!(code.least_w >= RotationQuantization::kMinLeastW && code.least_w <= 1.0f)) {
      return wrong(ErrorCode::kOutOfRange, "least_w is not from 0.3 to 1", j);
    }
    for (int c = 0; c < 3; ++c) {
      if (!(std::abs(code.low[c]) <= 1.0f)) {
        return wrong(ErrorCode::kOutOfRange, "low is not from -1 to 1", j);
      }
      if (!(code.step[c] >= RotationQuantization::kMinStep && code.step[c] <= 2.0f)) {
        return wrong(ErrorCode::kOutOfRange, "step is not from 2^-20 to 2", j);
      }
      if (code.bits[static_cast<std::size_t>(c)] > RotationQuantization::kMaxBits) {
        return wrong(ErrorCode::kOutOfRange, "a component has more than 16 bits", j);
      }
    }
  }
  return {};
}

Status CheckReducedJoints(std::span<const std::uint16_t> joints,
                          std::span<const std::int16_t> parents) {
  const auto wrong = [](const char* text, std::size_t index) {
    return Fail(ErrorCode::kMalformed, text, static_cast<std::int64_t>(index));
  };
  if (joints.size() > parents.size()) {
    return Fail(ErrorCode::kShapeMismatch, "more reduced joints than joints",
                static_cast<std::int64_t>(joints.size()));
  }
  if (joints.empty() || joints[0] != 0) return wrong("the root is missing", 0);
  for (std::size_t i = 1; i < joints.size(); ++i) {
    if (joints[i] >= parents.size()) return wrong("no such joint", i);
    if (joints[i] <= joints[i - 1]) return wrong("joints are not ascending", i);
    // A parent that does not precede its child is not in joints.first(i), so it is reported here as
    // missing.
    const std::int16_t parent = parents[joints[i]];
    if (parent < 0 ||
        !std::ranges::binary_search(joints.first(i), static_cast<std::uint16_t>(parent))) {
      return wrong("the parent of a joint is missing", i);
    }
  }
  return {};
}

Expected<CompactCodec> CompactCodec::Make(std::span<const RotationQuantization> codes,
                                          std::span<const std::int16_t> parents,
                                          std::span<const std::uint16_t> included) {
  if (const Status status = CheckRotationQuantizations(codes); !status) {
    return std::unexpected(status.error());
  }
  if (codes.empty() || codes.size() != parents.size()) {
    return std::unexpected(Error{ErrorCode::kShapeMismatch,
                                 "the number of rotation quantizations is not the number of joints",
                                 static_cast<std::int64_t>(codes.size())});
  }
  if (!included.empty()) {
    if (const Status status = CheckReducedJoints(included, parents); !status) {
      return std::unexpected(status.error());
    }
  }
  CompactCodec codec;
  codec.joints_.resize(codes.size());
  WordPlan words;
  for (std::size_t c = 0; c < 3; ++c) words.Put(c, 32);
  for (std::size_t j = 0; j < codes.size(); ++j) {
    const std::size_t row = kJointRows + 4 * j;
    const RotationQuantization& code = codes[j];
    CompactJoint& joint = codec.joints_[j];
    joint.parent = parents[j];
    if (j == 0 ? joint.parent != -1
               : joint.parent < 0 || joint.parent >= static_cast<std::int32_t>(j)) {
      return std::unexpected(Error{ErrorCode::kOutOfRange, "parent does not precede the joint",
                                   static_cast<std::int64_t>(j)});
    }
    if (joint.parent >= 0)
      codec.joints_[static_cast<std::size_t>(joint.parent)].has_children = true;
    joint.reference[0] = code.reference.x;
    joint.reference[1] = code.reference.y;
    joint.reference[2] = code.reference.z;
    joint.reference[3] = code.reference.w;
    joint.has_reference = code.reference != kIdentityQuat;
    joint.is_omitted =
        !included.empty() && !std::ranges::binary_search(included, static_cast<std::uint16_t>(j));
    if (joint.is_omitted) continue;
    joint.least_w = code.least_w;
    joint.smallest_three_bits = code.smallest_three_bits;
    if (code.smallest_three_bits > 0) {
      joint.inverse_step[0] =
          kSqrt2 * static_cast<float>((1 << (code.smallest_three_bits - 1)) - 1);
      joint.step[0] = 1.0f / joint.inverse_step[0];
      words.Put(row + 3, 2);
      for (std::size_t c = 0; c < 3; ++c) words.Put(row + c, code.smallest_three_bits);
      continue;
    }
    for (std::size_t c = 0; c < 3; ++c) {
      joint.low[c] = code.low[static_cast<int>(c)];
      joint.step[c] = code.step[static_cast<int>(c)];
      joint.inverse_step[c] = 1.0f / joint.step[c];
      joint.bits[c] = code.bits[c];
      if (code.bits[c] > 0) words.Put(row + c, code.bits[c]);
    }
  }
  codec.pose_bytes_ = 2 * ((words.bits() + 15) / 16);
  codec.parts_ = words.Finish();
  codec.order_ = ByDepth(parents);
  return codec;
}

void CompactCodec::Block::Add(const Vec3& root_position_m, std::span<const Quat> rotations) {
  STRIDEWIRE_CHECK(size_ < kBlock);
  if (rotations_.size() < 4 * rotations.size()) rotations_.resize(4 * rotations.size());
  joint_count_ = rotations.size();
  for (int c = 0; c < 3; ++c) roots_m_[c][size_] = root_position_m[c];
  Floats* to = rotations_.data();
  for (const Quat& q : rotations) {
    for (const float value : {q.x, q.y, q.z, q.w}) (to++)->of[size_] = value;
  }
  ++size_;
}

void CompactCodec::Block::Get(std::size_t i, Vec3& root_position_m,
                              std::span<Quat> rotations) const {
  for (int c = 0; c < 3; ++c) root_position_m[c] = roots_m_[c][i];
  const Floats* from = rotations_.data();
  for (Quat& q : rotations) {
    for (float* value : {&q.x, &q.y, &q.z, &q.w}) *value = (from++)->of[i];
  }
}

void CompactCodec::Block::CopyBytes(std::size_t i, std::span<std::byte> out) const {
  const std::uint32_t* from = words_.front().of + 4 * i;
  std::size_t at = 0;
  for (; at + 16 <= out.size(); at += 16, from += 4 * kBlock)
    std::memcpy(out.data() + at, from, 16);
  std::memcpy(out.data() + at, from, out.size() - at);
}

void CompactCodec::Block::StreamBytes(std::size_t i, std::size_t pieces, std::byte* to) const {
  StreamWords(words_.front().of + 4 * i, pieces, to);
}

void CompactCodec::Encode(Block& block) const {
  STRIDEWIRE_CHECK(block.size_ == 0 || block.joint_count_ == joints_.size());
  Encode({&block.roots_m_[0][0], block.rotations_.empty() ? nullptr : block.rotations_.front().of,
          block.size_},
         block);
}

void CompactCodec::Encode(const SoaPoses& poses, Block& block) const {
  STRIDEWIRE_CHECK(poses.count <= kBlock);
  block.size_ = poses.count;
  const std::size_t joints = joints_.size();
  if (block.errors_.size() < 3 * joints) {
    block.numbers_.resize(kJointRows + 4 * joints);
    block.errors_.resize(3 * joints);
  }
  const std::size_t words = (pieces() + kMaxTrailingPieces) * 4;
  if (block.words_.size() < words) block.words_.resize(words);
  EncodeCompact(
      {joints_, order_, parts_},
      {poses.count, poses.are_unit, poses.roots_m, poses.rotations, block.errors_.front().of,
       block.numbers_.front().of, block.words_.front().of, block.fits_});
}

Status CompactCodec::Decode(std::span<const std::byte> in, Vec3& root_position_m,
                            std::span<Quat> rotations) const {
  if (rotations.size() != joints_.size()) {
    return Fail(ErrorCode::kShapeMismatch, "the pose has another number of joints",
                static_cast<std::int64_t>(rotations.size()));
  }
  if (in.size() != pose_bytes()) {
    return Fail(ErrorCode::kShapeMismatch, "the input has the wrong size for a pose",
                static_cast<std::int64_t>(in.size()));
  }
  if (const Status status = DecodeRoot(in.first<kRootBytes>(), root_position_m); !status) {
    return status;
  }
  BitReader reader(in.subspan(kRootBytes));
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const CompactJoint& joint = joints_[j];
    if (joint.is_omitted) {
      rotations[j] =
          Quat(joint.reference[3], joint.reference[0], joint.reference[1], joint.reference[2]);
      continue;
    }
    const bool is_good = joint.smallest_three_bits > 0
                             ? ReadSmallestThree(reader, joint, rotations[j])
                             : ReadComponents(reader, joint, rotations[j]);
    if (!is_good) {
      return Fail(ErrorCode::kMalformed, "rotation has bits that no encoder writes",
                  static_cast<std::int64_t>(j));
    }
  }
  if (!reader.RestIsZero())
    return Fail(ErrorCode::kMalformed, "the unused bits of the last word are not 0");
  return {};
}

}  // namespace stridewire::protocol
