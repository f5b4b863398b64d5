// SPDX-License-Identifier: GPL-3.0-or-later
/// What the vectorised kernels and their caller share. Plain data only: the kernels' sources are compiled for several
/// instruction sets, and an inline function compiled for one of them must not end up in the program's common code.
#pragma once

#include <cstddef>
#include <cstdint>

namespace interglow::radiosity::batch {

constexpr int kMaxOrder = 6;        ///< points per direction of the largest product rule
constexpr int kMaxEdgePoints = 24;  ///< points of the largest rule on edges
constexpr int kErrors = 4;          ///< orders of which an edge rule's error is known
constexpr int kProductErrors = 8;   ///< of a product rule; odd ones too
constexpr int kBlock = 256;         ///< pairs settled at a time
constexpr int kMostOpen = 512;      ///< pairs that are sorted by their rules at a time

/// A polygon as the kernels want it: x(u, v) = origin + u e1 + v e2 + uv e3 over the unit square; a triangle is
/// collapsed at u = 0. Doubles only: kernels load runs of members of several records at once. A cache line each for the
/// stages of the choice.
struct alignas(64) PatchRecord {
  double centre[3], normal[3];
  double area;
  double spread;  ///< bits of three numbers that decide on most pairs that stand apart: Spread (batch_shapes.h)

  double half_edge;  ///< the longest
  double perimeter;
  double sides;   ///< |e1| |e2| sqrt(1 + |cosine of their angle|)
  double skew;    ///< what a quad taken for a parallelogram may change of its area; -1 for all other patches
  double radius;  ///< farthest corner from the centre
  double density[3];  ///< |∂x/∂u × ∂x/∂v| / area = density[0] + density[1] u + density[2] v; (1, 0, 0) for a triangle's
                      ///< own weights

  double e1[3], e2[3];      ///< e2 of a triangle is 0
  double deviation, lever;  ///< distance within which a point at distance r counts as on the plane: deviation + lever r

  // A product rule runs along straight lines, of constant v and of constant u.
  double half_line_u, half_line_v;  ///< at least the half of the longest
  double variance;      ///< at least the mean squared distance along any direction from the centre, of the patch and of
                        ///< the middles of either family of lines
  double offset;        ///< at least the distance from the centre to the mean of those middles
  double density_skew;  ///< largest rise of the density from the middle of a line to its end, over the middle's; 0 of a
                        ///< triangle, whose rules have it in their weights
  double third;         ///< bound on mean |x - centre|³; 0 where odd moments vanish by symmetry
  double fourth;        ///< mean |x - centre|⁴
  double second;        ///< mean |x - centre|²

  double origin[3], e3[3];
  double unused[2];

  double moment1[3], moment2[3];  ///< p, q with mean (x - centre)(x - centre)ᵀ = p pᵀ + q qᵀ
  double padding[2];              ///< vectors are loaded whole
};

/// The same bytes as FormFactor, whose header the kernels' sources may not include.
struct Result {
  double value, error_estimate;
  std::int64_t method;
};
constexpr std::int64_t kZeroMethod = 0, kFarMethod = 1, kEdgeMethod = 2;  ///< values of FormFactorMethod

/// Nodes of the m x m rule on the unit square: [0] for quads, [1] for triangles (the weight u of the collapsed square
/// included).
struct ProductRule {
  int points;
  double u[2][kMaxOrder * kMaxOrder], v[2][kMaxOrder * kMaxOrder], weight[2][kMaxOrder * kMaxOrder];
  double error[kProductErrors];  ///< at most, of x^(2m + j) by m points per direction of a quad or a triangle
};

/// The positive nodes of an even Gauss-Legendre rule on [-1, 1] and their weights over the interval's length.
struct EdgeRule {
  int half;  ///< half of the points
  double node[kMaxEdgePoints / 2], weight[kMaxEdgePoints / 2];
  double
      error[kErrors];  ///< of x^(2m + 2j) by m points, over the interval's length; never negative, at most 1/(2m+2j+1)
};

/// What to do with a pair. kEdges + 2n: the contour integral by 2n points on each edge of two parallelograms; kEdges +
/// 2n + 1: of other patches.
enum Choice : std::int32_t {
  kNothing,         ///< the value is 0
  kUnsettled,       ///< `classify` is to be asked
  kParallelograms,  ///< `choose` is to be asked
  kOthers,          ///< `choose_products` is to be asked
  kContour,
  kRound,  ///< the centres with moments taken for alike in all directions of the plane
  kMoments,
  kCut,
  kProduct,  ///< kProduct + m: the product rule
  kEdges = kProduct + kMaxOrder,
  kChoices = kEdges + kMaxEdgePoints + 2
};

/// Distance from a plane, in normalised coordinates, that the first line's balls are enlarged by.
constexpr double kOpen = 1e-9;

/// Pairs that `settle` has left: their places in its list, choices or whom to ask, and bounds; of several lists, one
/// after the other.
struct OpenPairs {
  int count;
  std::int32_t place[kMostOpen], choice[kMostOpen];
  double bound[kMostOpen];
};

struct Kernels {
  const char* name;
  /// Exchange areas of one patch with others, times `square_unit`, where the first lines of the records tell that
  /// nothing is exchanged or that the centres with moments meet `tolerance`, or points on edges, the same for a whole
  /// vector. The others are added to `open`.
  /// @param count  at most kBlock
  /// @param edge_rules  by half of their points
  void (*settle)(const PatchRecord* records, std::uint32_t one, const std::uint32_t* others, int count,
                 double tolerance, double square_unit, const EdgeRule* edge_rules, Result* results, OpenPairs& open);
  /// For each pair of parallelograms the cheapest choice whose error bound meets `tolerance`, and the bound, an
  /// absolute exchange area; kUnsettled where that takes a closer look.
  void (*choose)(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
                 const EdgeRule* edge_rules, std::int32_t* choice, double* bound);
  /// The same of any patches, of the rules that take no points on edges.
  /// @param product_rules  by their points per direction
  void (*choose_products)(const PatchRecord* const* first, const PatchRecord* const* second, int count,
                          double tolerance, const ProductRule* product_rules, std::int32_t* choice, double* bound);
  /// Choice and bound of any pair, never kUnsettled.
  /// @param product_rules  by their points per direction
  void (*classify)(const PatchRecord* const* first, const PatchRecord* const* second, int count, double tolerance,
                   const EdgeRule* edge_rules, const ProductRule* product_rules, std::int32_t* choice, double* bound);
  /// By the centres (1), with moments of second order alike in all directions of the plane (2), or the true ones (3).
  void (*centres)(const PatchRecord* const* first, const PatchRecord* const* second, int count, int moments,
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
