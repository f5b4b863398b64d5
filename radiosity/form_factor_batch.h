// SPDX-License-Identifier: GPL-3.0-or-later
/// Form factors of very many unoccluded pairs: the cheapest rule for each, vectors of pairs at a time.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "radiosity/form_factor.h"
#include "radiosity/polygon.h"

namespace interglow::radiosity {

namespace batch {
struct PatchRecord;
struct Kernels;
}  // namespace batch

/// Vectors of 2, 4 and 8 pairs.
enum class InstructionSet { kSse2, kAvx2, kAvx512 };

/// A rule that `exchange_areas` may choose.
struct FixedRule {
  enum Family {
    kCentres,  ///< 1: cosθ cosθ' / (π r²) from centre to centre; 2: with the moments of second order, taken for alike
               ///< in all directions of a patch's plane; 3: with the true ones
    kProduct,  ///< 1 to 6 points per direction on both patches
    kEdges,    ///< the contour integral by 2, 4 ... 24 points on each edge of both
  };
  Family family = kProduct;
  int points = 1;
};

/// Polygons made ready once; then any list of pairs, from any thread.
///
/// Pairs that stand apart take the kernel between their centres with second moments, or the contour integral by
/// 2 ... 24 Gauss points on every edge: the cheapest whose error bound meets the tolerance. All others go to
/// `exchange_area`. Bounds and rules: docs/form-factors.md. Vectors of 8, 4 or 2 pairs, as the processor has AVX-512,
/// AVX2 or neither. A pair's value depends on the two polygons and the tolerance alone: not on its neighbours in the
/// list, the thread, or the order of the two.
class FormFactorBatch {
 public:
  /// @param most  the best set to be used; a lesser one if the processor lacks it
  /// @throws InvalidParams if a corner is not finite. Patches without area are kept and exchange nothing.
  explicit FormFactorBatch(std::vector<Polygon> polygons, InstructionSet most = InstructionSet::kAvx512);
  ~FormFactorBatch();
  FormFactorBatch(FormFactorBatch&&) noexcept;
  FormFactorBatch& operator=(FormFactorBatch&&) noexcept;

  std::size_t size() const { return polygons_.size(); }
  const Polygon& polygon(std::size_t i) const { return polygons_[i]; }
  double area(std::size_t i) const;  ///< unit² of the coordinates

  /// Exchange areas A_one F_one,other for each of `others`, into `results` of the same length.
  ///
  /// @param tolerance  wanted absolute error of both form factors of a pair; 0 asks for round-off
  /// Cost: from about 6 ns (1e-4, far) over 0.1 µs (1e-14, a size apart) to some µs (touching) a pair.
  void exchange_areas(std::uint32_t one, std::span<const std::uint32_t> others, double tolerance,
                      std::span<FormFactor> results) const;

  /// The same for many patches, each with others of its own. Pairs are sorted by their rules: faster than one after the
  /// other where lists are short.
  struct Row {
    std::uint32_t one;
    std::span<const std::uint32_t> others;
    std::span<FormFactor> results;  ///< of the same length
  };
  void exchange_areas(std::span<const Row> rows, double tolerance) const;

  /// A_one F_one,other by one rule alone, whatever its error: what the choice of rules is measured against.
  /// @pre the patches face each other wholly
  /// @throws InvalidParams for a number of points that the family does not have
  void exchange_areas_by_rule(std::uint32_t one, std::span<const std::uint32_t> others, FixedRule rule,
                              std::span<double> results) const;

  /// The instruction set in use: "AVX-512", "AVX2" or "SSE2".
  const char* instruction_set() const;

 private:
  class Sorter;
  std::vector<Polygon> polygons_;
  std::vector<batch::PatchRecord> records_;
  const batch::Kernels* kernels_;
  double unit_ = 1.0;  ///< a power of two: coordinates of the records times it are the polygons', moved
};

}  // namespace interglow::radiosity
