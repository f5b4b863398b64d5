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
  // What decides on most pairs that stand apart: one cache line, and another.
  double centre[3], normal[3];
  double area;
  double ball;           ///< `radius`; without end if the plane is too uncertain for what is asked of the first line
  double half_edge;      ///< longest
  double middle_radius;  ///< farthest middle of an edge from the centre
  double perimeter;
  double sides;           ///< |e1| |e2| sqrt(1 + |cosine of their angle|)
  double second, fourth;  ///< mean |x - centre|², ⁴
  double skew;            ///< what a quad taken for a parallelogram may change of its area
  double parallelogram;   ///< 1 or 0
  // The rest.
  double radius;            ///< farthest corner from the centre
  double deviation, lever;  ///< distance within which a point at distance r counts as on the plane: deviation + lever r
  double third;             ///< bound on mean |x - centre|³; 0 where odd moments vanish by symmetry
  double inverse_half_edge;
  double triangle;                ///< 1 for a triangle's nodes, 0 for a quad's
  double moment1[3], moment2[3];  ///< p, q with mean (x - centre)(x - centre)ᵀ = p pᵀ + q qᵀ
  double origin[3], e1[3], e2[3], e3[3];
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

/// What to do with a pair. kEdges + 2n: the contour integral by 2n points on each edge of two parallelograms; kEdges +
/// 2n + 1: of other patches.
enum Choice : std::int32_t {
  kNothing,         ///< the value is 0
  kSettled,         ///< the value is there
  kSettledByEdges,  ///< the same, from points on edges
  kUnsettled,       ///< `classify` is to be asked
  kContour,
  kCentres,
  kMoments,
  kCut,
  kEdges,
  kChoices = kEdges + kMaxEdgePoints + 2
};

/// Distance from a plane, in normalised coordinates, that `settle` leaves to `classify`.
constexpr double kOpen = 1e-9;

struct Kernels {
  const char* name;
  /// For each pair the cheapest choice whose error bound meets `tolerance`, and the bound, an absolute exchange area,
  /// where that can be told from balls around the patches; else kUnsettled. For kSettled the value, else the smaller
  /// area.
  /// @param edge_rules  by half of their points
  void (*settle)(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
                 const EdgeRule* edge_rules, std::int32_t* choice, double* bound, double* exchange);
  /// The same from the patches' shapes, without values and never kUnsettled.
  void (*classify)(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
                   std::int32_t* choice, double* bound);
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
