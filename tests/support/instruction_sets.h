#pragma once

#include <hwy/highway.h>

#include <cstdint>
#include <string_view>
#include <vector>

namespace stridewire {

/// Limits the kernels of this program to one instruction set for the lifetime of the object.
class OnlyInstructionSet {
 public:
  explicit OnlyInstructionSet(std::int64_t target) { Choose(target); }
  ~OnlyInstructionSet() { Choose(0); }
  OnlyInstructionSet(const OnlyInstructionSet&) = delete;
  OnlyInstructionSet& operator=(const OnlyInstructionSet&) = delete;

 private:
  static void Choose(std::int64_t target) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
};

/// A SIMD instruction set.
struct InstructionSet {
  std::int64_t target;
  std::string_view name;
};
inline constexpr InstructionSet kInstructionSets[] = {
    {HWY_AVX3, "AVX-512"}, {HWY_AVX2, "AVX2"}, {HWY_SSE4, "SSE4"}, {HWY_NEON, "NEON"}};

/// Compiled instruction sets that this machine supports, the widest first. The last one is plain
/// C++.
inline std::vector<std::int64_t> InstructionSets() {
  std::vector<std::int64_t> sets;
  for (const InstructionSet& set : kInstructionSets) {
    if ((hwy::SupportedTargets() & set.target) != 0) sets.push_back(set.target);
  }
  sets.push_back(HWY_SCALAR);
  return sets;
}

}  // namespace stridewire
