// SPDX-License-Identifier: GPL-3.0-or-later
// Vectors of doubles, records by lanes, logarithms, included once for each instruction set (batch_kernel_source.h).
#pragma once

#include "radiosity/batch_kernel.h"

namespace interglow::radiosity::batch {
namespace {

constexpr int kLanes = INTERGLOW_LANES;
using Real = double __attribute__((vector_size(kLanes * sizeof(double))));
using Mask = long long __attribute__((vector_size(kLanes * sizeof(double))));
using Bits = unsigned long long __attribute__((vector_size(kLanes * sizeof(double))));

constexpr double kPi = 3.14159265358979323846;
constexpr double kEpsilon = 2.220446049250313e-16;
/// Rounding of plane distances in normalised coordinates (at most 2): sides within it are left to the exact decision.
constexpr double kSideRounding = 64 * kEpsilon;

inline Real splat(double value) { return Real{} + value; }
inline Real max(Real a, Real b) { return a > b ? a : b; }
inline Real min(Real a, Real b) { return a < b ? a : b; }

inline Real square_root(Real x) {
  Real y;
  for (int lane = 0; lane < kLanes; ++lane) y[lane] = __builtin_sqrt(x[lane]);
  return y;
}

struct Vector {
  Real x, y, z;
};
inline Vector operator+(Vector a, Vector b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vector operator*(Real s, Vector a) { return {s * a.x, s * a.y, s * a.z}; }
inline Vector operator*(double s, Vector a) { return {s * a.x, s * a.y, s * a.z}; }
inline Real dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// The lanes in use, to memory.
inline void store(double* to, Real value, int lanes_used) {
  if (lanes_used == kLanes) {
    __builtin_memcpy(to, &value, sizeof(Real));
  } else {
    for (int lane = 0; lane < lanes_used; ++lane) to[lane] = value[lane];
  }
}
inline void store(std::int32_t* to, Real value, int lanes_used) {
  using Integers = std::int32_t __attribute__((vector_size(kLanes * sizeof(std::int32_t))));
  const Integers rounded = __builtin_convertvector(value, Integers);
  if (lanes_used == kLanes) {
    __builtin_memcpy(to, &rounded, sizeof(Integers));
  } else {
    for (int lane = 0; lane < lanes_used; ++lane) to[lane] = rounded[lane];
  }
}

/// Three columns become rows of three, the lanes in use, to memory.
inline void store_rows(Result* to, Real x, Real y, Real z, int lanes_used) {
  Real row[3];
#if INTERGLOW_LANES == 8
  const Real a = __builtin_shufflevector(x, y, 0, 8, 1, 1, 9, 2, 2, 10);
  row[0] = __builtin_shufflevector(a, z, 0, 1, 8, 3, 4, 9, 6, 7);
  row[1] =
      __builtin_shufflevector(__builtin_shufflevector(y, z, 10, 3, 3, 11, 4, 4, 12, 5), x, 0, 11, 2, 3, 12, 5, 6, 13);
  row[2] =
      __builtin_shufflevector(__builtin_shufflevector(y, z, 5, 13, 6, 6, 14, 7, 7, 15), x, 0, 1, 14, 3, 4, 15, 6, 7);
#elif INTERGLOW_LANES == 4
  row[0] = __builtin_shufflevector(__builtin_shufflevector(x, y, 0, 4, 1, 1), z, 0, 1, 4, 3);
  row[1] = __builtin_shufflevector(__builtin_shufflevector(y, z, 1, 5, 2, 2), x, 0, 1, 6, 3);
  row[2] = __builtin_shufflevector(__builtin_shufflevector(y, z, 6, 3, 3, 7), x, 0, 7, 2, 3);
#else
  row[0] = __builtin_shufflevector(x, y, 0, 2);
  row[1] = __builtin_shufflevector(z, x, 0, 3);
  row[2] = __builtin_shufflevector(y, z, 1, 3);
#endif
  if (lanes_used == kLanes) {
    __builtin_memcpy(to, row, sizeof(row));
  } else {
    __builtin_memcpy(to, row, sizeof(Result) * static_cast<std::size_t>(lanes_used));
  }
}

/// Rows of kLanes doubles become columns.
inline void transpose(Real (&row)[kLanes]) {
#if INTERGLOW_LANES == 8
  Real a[8];
  for (int i = 0; i < 8; i += 2) {
    a[i] = __builtin_shufflevector(row[i], row[i + 1], 0, 8, 2, 10, 4, 12, 6, 14);
    a[i + 1] = __builtin_shufflevector(row[i], row[i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int i = 0; i < 8; i += 4)
    for (int k = i; k < i + 2; ++k) {
      row[k] = __builtin_shufflevector(a[k], a[k + 2], 0, 1, 8, 9, 4, 5, 12, 13);
      row[k + 2] = __builtin_shufflevector(a[k], a[k + 2], 2, 3, 10, 11, 6, 7, 14, 15);
    }
  for (int k = 0; k < 4; ++k) {
    a[k] = __builtin_shufflevector(row[k], row[k + 4], 0, 1, 2, 3, 8, 9, 10, 11);
    a[k + 4] = __builtin_shufflevector(row[k], row[k + 4], 4, 5, 6, 7, 12, 13, 14, 15);
  }
  for (int k = 0; k < 8; ++k) row[k] = a[k];
#elif INTERGLOW_LANES == 4
  Real a[4];
  for (int i = 0; i < 4; i += 2) {
    a[i] = __builtin_shufflevector(row[i], row[i + 1], 0, 4, 2, 6);
    a[i + 1] = __builtin_shufflevector(row[i], row[i + 1], 1, 5, 3, 7);
  }
  for (int k = 0; k < 2; ++k) {
    row[k] = __builtin_shufflevector(a[k], a[k + 2], 0, 1, 4, 5);
    row[k + 2] = __builtin_shufflevector(a[k], a[k + 2], 2, 3, 6, 7);
  }
#else
  const Real low = __builtin_shufflevector(row[0], row[1], 0, 2);
  row[1] = __builtin_shufflevector(row[0], row[1], 1, 3);
  row[0] = low;
#endif
}

/// The records of one side of a packet; often all the same one.
struct Lanes {
  const PatchRecord* record[kLanes];
  bool uniform;

  Lanes(const PatchRecord* const* records, int count) : uniform(true) {
    for (int lane = 0; lane < kLanes; ++lane) record[lane] = records[lane < count ? lane : count - 1];
    for (int lane = 1; lane < kLanes; ++lane) uniform = uniform & (record[lane] == record[0]);
  }
  /// All the same.
  explicit Lanes(const PatchRecord* one) : uniform(true) {
    for (int lane = 0; lane < kLanes; ++lane) record[lane] = one;
  }
  /// Not taken for the same one.
  Lanes(const PatchRecord* records, const std::uint32_t* index, int count) : uniform(false) {
    for (int lane = 0; lane < kLanes; ++lane) record[lane] = records + index[lane < count ? lane : count - 1];
  }
  /// kCount doubles from `offset` bytes into the records. @pre kCount rounded up to kLanes stays inside the record
  template <int kCount>
  void load(std::size_t offset, Real (&value)[kCount]) const {
    if (uniform) {
      const char* from = reinterpret_cast<const char*>(record[0]) + offset;
      for (int k = 0; k < kCount; ++k) {
        double one;
        __builtin_memcpy(&one, from + k * sizeof(double), sizeof(double));
        value[k] = splat(one);
      }
      return;
    }
    for (int begin = 0; begin < kCount; begin += kLanes) {
      Real row[kLanes];
      for (int lane = 0; lane < kLanes; ++lane)
        __builtin_memcpy(&row[lane], reinterpret_cast<const char*>(record[lane]) + offset + begin * sizeof(double),
                         sizeof(Real));
      transpose(row);
      for (int k = begin; k < kCount && k < begin + kLanes; ++k) value[k] = row[k - begin];
    }
  }
};

inline bool any(Mask mask) {
#if INTERGLOW_LANES == 8
  using Bytes = signed char __attribute__((vector_size(kLanes)));
  const Bytes narrow = __builtin_convertvector(mask, Bytes);
  long long all;
  __builtin_memcpy(&all, &narrow, sizeof(all));
  return all != 0;
#else
  long long some = 0;
  for (int lane = 0; lane < kLanes; ++lane) some |= mask[lane];
  return some != 0;
#endif
}

inline Real square_of(Real x) { return x * x; }
inline Real magnitude(Real x) { return reinterpret_cast<Real>(reinterpret_cast<Bits>(x) & 0x7fffffffffffffffull); }

/// ln (n / d) of positive normal numbers, to 2 roundings of max(1, its value).
inline Real log_ratio(Real n, Real d) {
  constexpr unsigned long long kMantissa = 0x000fffffffffffffull, kOne = 0x3ff0000000000000ull,
                               kTwo52 = 0x4330000000000000ull;
  const Bits n_bits = reinterpret_cast<Bits>(n), d_bits = reinterpret_cast<Bits>(d);
  // 2^52 + biased exponent, as a double: the difference is exact.
  Real exponent = reinterpret_cast<Real>((n_bits >> 52) | kTwo52) - reinterpret_cast<Real>((d_bits >> 52) | kTwo52);
  Real x = reinterpret_cast<Real>((n_bits & kMantissa) | kOne);
  const Real y = reinterpret_cast<Real>((d_bits & kMantissa) | kOne);
  const Mask above = x > 1.4142135623730951 * y, below = 1.4142135623730951 * x < y;
  exponent = above ? exponent + 1.0 : (below ? exponent - 1.0 : exponent);
  x = above ? 0.5 * x : (below ? 2.0 * x : x);
  const Real z = (x - y) / (x + y);  // at most 0.1716
  const Real w = z * z;
  Real series = splat(1.0 / 21);
  series = series * w + 1.0 / 19;
  series = series * w + 1.0 / 17;
  series = series * w + 1.0 / 15;
  series = series * w + 1.0 / 13;
  series = series * w + 1.0 / 11;
  series = series * w + 1.0 / 9;
  series = series * w + 1.0 / 7;
  series = series * w + 1.0 / 5;
  series = series * w + 1.0 / 3;
  series = series * w + 1.0;
  return exponent * 0.6931471805599453 + 2.0 * z * series;
}

}  // namespace
}  // namespace interglow::radiosity::batch
