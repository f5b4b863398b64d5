// SPDX-License-Identifier: GPL-3.0-or-later
/// What the vectorised kernels and their caller share. Plain data only: the kernels' sources are compiled for several
/// instruction sets, and an inline function compiled for one of them must not end up in the program's common code.
#pragma once

#include <cstddef>
#include <cstdint>

namespace interglow::radiosity::batch {

constexpr int kMaxOrder = 6;        ///< points per direction of the largest product rule
constexpr int kMaxEdgePoints = 24;  ///< points of the largest rule on edges
constexpr int kBlock = 256;         ///< pairs classified at a time

/// A polygon as the kernels want it: x(u, v) = origin + u e1 + v e2 + uv e3 over the unit square; a triangle is
/// collapsed at u = 0. Doubles only: kernels load runs of members of several records at once.
struct alignas(64) PatchRecord {
  double centre[3], normal[3];
  double area;
  double radius;            ///< farthest corner from the centre
  double deviation, lever;  ///< distance within which a point at distance r counts as on the plane: deviation + lever r
  double second, third, fourth;   ///< mean |x - centre|², ³ (0 where odd moments vanish by symmetry), ⁴
  double triangle;                ///< 1 for a triangle's nodes, 0 for a quad's
  double bilinear;                ///< 1 if no parallelogram: the product rule of m points is one degree short
  double half_edge;               ///< longest
  double moment1[3], moment2[3];  ///< p, q with mean (x - centre)(x - centre)ᵀ = p pᵀ + q qᵀ
  double perimeter;
  double skew;  ///< |e3| times the longest edge: what a quad taken for a parallelogram may change, as an area
  double origin[3], e1[3], e2[3], e3[3];
  double length1, length2;  ///< |e1|, |e2|
  double density[3];  ///< |∂x/∂u × ∂x/∂v| / area = density[0] + density[1] u + density[2] v; (1, 0, 0) for a triangle's
                      ///< own weights
};

/// Nodes of the m x m rule on the unit square: [0] for quads, [1] for triangles (the weight u of the collapsed square
/// included).
struct ProductRule {
  int points;
  double u[2][kMaxOrder * kMaxOrder], v[2][kMaxOrder * kMaxOrder], weight[2][kMaxOrder * kMaxOrder];
};

/// The positive nodes of an even Gauss-Legendre rule on [-1, 1] and their weights over the interval's length.
struct EdgeRule {
  int half;  ///< half of the points
  double node[kMaxEdgePoints / 2], weight[kMaxEdgePoints / 2];
};

/// What to do with a pair. kEdges + n: the contour integral by 2n points on each edge.
enum Choice : std::int32_t { kNothing = 0, kMoments = 1, kCut = 2, kEdges = 16, kContour = 100 };

struct Kernels {
  const char* name;
  /// For each pair the cheapest choice whose error bound meets `tolerance`, the bound, and for kMoments the value, both
  /// as absolute exchange areas.
  void (*classify)(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
                   std::int32_t* choice, double* bound, double* exchange);
  /// By the centres (`moments` false) or by the moments of second order as well.
  void (*centres)(const PatchRecord* const* first, const PatchRecord* const* second, int count, bool moments,
                  double* exchange);
  /// A1 A2 Σ Σ w w' cosθ cosθ' / (π r²) by the given rule.
  void (*product)(const PatchRecord* const* first, const PatchRecord* const* second, int count, const ProductRule& rule,
                  double* exchange);
  /// The contour integral by Gauss points on the edges of both patches; `parallelograms`: both of every pair are.
  void (*edges)(const PatchRecord* const* first, const PatchRecord* const* second, int count, const EdgeRule& rule,
                bool parallelograms, double* exchange);
};

const Kernels& baseline_kernels();
#if defined(__x86_64__)
const Kernels& avx2_kernels();
const Kernels& avx512_kernels();
#endif

}  // namespace interglow::radiosity::batch
