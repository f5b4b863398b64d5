// SPDX-License-Identifier: GPL-3.0-or-later
/// What the vectorised kernels and their caller share. Plain data only: the kernels' sources are compiled for several
/// instruction sets, and an inline function compiled for one of them must not end up in the program's common code.
#pragma once

#include <cstddef>
#include <cstdint>

namespace interglow::radiosity::batch {

constexpr int kMaxOrder = 6;  ///< points per direction of the largest product rule
constexpr int kBlock = 256;   ///< pairs classified at a time

/// A polygon as the kernels want it: x(u, v) = origin + u e1 + v e2 + uv e3 over the unit square; a triangle is
/// collapsed at u = 0.
struct PatchRecord {
  double origin[3], e1[3], e2[3], e3[3];
  double normal[3];
  double centre[3];
  double density[3];  ///< |∂x/∂u × ∂x/∂v| / area = density[0] + density[1] u + density[2] v; (1, 0, 0) for a triangle's
                      ///< own weights
  double area;
  double radius;  ///< farthest corner from the centre
  /// spread[m]: mean of |x - centre|^2m, plus the same by the rule of m points per direction: bounds that rule's error.
  double spread[kMaxOrder + 1];
  double triangle;          ///< 1 for a triangle's nodes, 0 for a quad's
  double bilinear;          ///< 1 if no parallelogram: the rule of m points is one degree short, and m + 1 is taken
  double deviation, lever;  ///< distance within which a point at distance r counts as on the plane: deviation + lever r
};

/// Nodes of the m x m rule on the unit square: [0] for quads, [1] for triangles (the weight u of the collapsed square
/// included).
struct ProductRule {
  int points;
  double u[2][kMaxOrder * kMaxOrder], v[2][kMaxOrder * kMaxOrder], weight[2][kMaxOrder * kMaxOrder];
};

/// What to do with a pair. 1 ... kMaxOrder: the product rule of that many points per direction.
enum Choice : std::int32_t { kNothing = 0, kScalar = 100 };

struct Kernels {
  const char* name;
  /// For each pair the cheapest choice whose error bound meets `tolerance`, the bound, both as absolute exchange areas.
  void (*classify)(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
                   std::int32_t* choice, double* bound);
  /// A1 A2 Σ Σ w w' cosθ cosθ' / (π r²) by the given rule.
  void (*product)(const PatchRecord* const* first, const PatchRecord* const* second, int count, const ProductRule& rule,
                  double* exchange);
};

const Kernels& baseline_kernels();
#if defined(__x86_64__)
const Kernels& avx2_kernels();
const Kernels& avx512_kernels();
#endif

}  // namespace interglow::radiosity::batch
