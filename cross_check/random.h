// SPDX-License-Identifier: GPL-3.0-or-later
/// Random numbers that are a function of their index: the same for any order of work.
#pragma once

#include <cstdint>

namespace interglow::cross_check {

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014): a bijection of 64 bits that passes BigCrush as a counter
/// generator.
constexpr std::uint64_t mix(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// Independent stream for each (seed, pixel, sample).
class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t pixel, std::uint64_t sample)
      : state_(mix(mix(mix(seed + 0x9e3779b97f4a7c15ULL) ^ (pixel * 0xd1342543de82ef95ULL)) ^
                   (sample * 0xaef17502108ef2d9ULL))) {}

  std::uint64_t bits() {
    state_ += 0x9e3779b97f4a7c15ULL;
    return mix(state_);
  }
  /// Uniform in [0, 1), 53 bits.
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1.0p-53; }

 private:
  std::uint64_t state_;
};

}  // namespace interglow::cross_check
