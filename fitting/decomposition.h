// SPDX-License-Identifier: GPL-3.0-or-later
/// Spectral images as sums of known spectra times shading terms, pixel by pixel [tominaga-guarnera-2021, eq. 6-12].
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "image/png.h"
#include "image/spectral_image.h"
#include "radiosity/paper_model.h"

namespace interglow::fitting {

/// Most components of one object.
inline constexpr Eigen::Index kMostComponents = 5;

/// The spectra of one object's components.
struct ComponentBasis {
  std::vector<std::string> name;  ///< one a component
  Eigen::MatrixXd spectrum;       ///< bands × components, at most 5 components
};

/// Columns a_i1, a_i2, … of the paper for the given functions of an object: 2 components (re, rr; equation 12) or 4
/// (re, rr, lum, rl; equation 6, with lum = le + lr + ll). Columns that are 0 in all bands (no fluorescence) are left
/// out. The paper's five components are four with `lum` split by `split_luminescence`, as its a_i3 and a_i4 coincide.
/// With 5 components: re, rr, le, li = lr + ll and rl with spectra of their own, which often nearly coincide.
/// @throws InvalidParams unless components is 2, 4 or 5
ComponentBasis paper_basis(const radiosity::PaperFunctions& functions, int components);

/// How well the data can tell components apart.
struct BasisQuality {
  Eigen::VectorXd singular_value;  ///< of the columns scaled to length 1, decreasing
  double condition_number = 0.0;   ///< largest over smallest of them; infinite if the columns are dependent
  /// Sine of the angle between each column and the span of the others. The standard deviation of a shading term is
  /// 1 / sine times what it would be if the component were alone.
  Eigen::VectorXd sine;
  /// Components that take part in the weakest direction: they are the ones that trade with each other.
  std::vector<int> weakest;
  std::string sentence;  ///< the above in words, with names
};

/// Singular values and angles of the columns, each band multiplied by its weight.
/// @param band_weight  one a band (1 / noise SD), or empty: all 1
/// @throws InvalidParams if sizes disagree, a value is not finite or there are no or more than 5 components;
///         InvalidInput naming a component that is 0 in all weighted bands
BasisQuality examine(const ComponentBasis& basis, const Eigen::VectorXd& band_weight = {});

enum class Sign {
  kAny,          ///< least squares
  kNonNegative,  ///< least squares under f ≥ 0
};

struct DecompositionParams {
  Sign sign = Sign::kNonNegative;
  /// Weight of each band in the sum of squares, before squaring (1 / noise SD); empty: all 1. At least 0.
  Eigen::VectorXd band_weight{};
  /// A basis with a column closer than this (sine of the angle) to the span of its others is refused: noise would
  /// decide, amplified by its inverse. In [1e-12, 1).
  double least_sine = 1e-3;
};

/// Shading terms of every pixel.
struct Decomposition {
  int width = 0;
  int height = 0;
  std::vector<std::string> name;          ///< of the components, one list for all objects
  std::vector<image::ScalarMap> shading;  ///< one a component; not-a-number outside the mask
  image::ScalarMap relative_residual;     ///< |y - A f| / |y| with weights; not-a-number outside, 0 where y is 0
  double total_relative_residual = 0.0;   ///< the same over all pixels together
  std::size_t pixels = 0;                 ///< decomposed
  std::size_t not_finite = 0;             ///< pixels of an object left out because a value is not finite
  std::size_t bounded = 0;                ///< pixels in which f ≥ 0 set at least one term to 0
  std::vector<BasisQuality> quality;      ///< one an object
};

/// Solves y = A_i f for each pixel of object i.
///
/// The non-negative solution is exact: it is the least-squares solution over one of the at most 31 sets of columns, and
/// all of them are tried in pixels where plain least squares gives a negative term.
///
/// @param object  height × width, index into `bases`; -1: not in the mask
/// @param bases   one an object; all with the same names in the same order
/// @throws InvalidParams if sizes or names disagree; InvalidInput naming the components whose spectra nearly coincide
/// Cost O(pixels × bands). Same bits for any number of threads.
Decomposition decompose(const image::SpectralImage& image, const std::vector<int>& object,
                        const std::vector<ComponentBasis>& bases, const DecompositionParams& params = {});

/// The sum of all components: A f, 0 outside the mask. @throws InvalidParams if sizes disagree.
image::SpectralImage synthesize(const Decomposition& decomposition, const std::vector<int>& object,
                                const std::vector<ComponentBasis>& bases, const Eigen::VectorXd& wavelength_nm);

/// Equation 9: f_lum = c1 f_re + c2 f_rr over all pixels of an object by least squares, with c1, c2 ≥ 0.
struct LuminescenceSplit {
  double direct = 0.0;             ///< c1
  double indirect = 0.0;           ///< c2
  double relative_residual = 0.0;  ///< |f_lum - c1 f_re - c2 f_rr| / |f_lum|
};

/// One split an object. @throws InvalidParams if there are no components named re, rr and lum; InvalidInput if f_re and
/// f_rr of an object are proportional, so that nothing tells direct from indirect excitation.
std::vector<LuminescenceSplit> split_luminescence(const Decomposition& decomposition, const std::vector<int>& object);

/// Least squares |A x - b|² under x ≥ 0 for A with 1 to 5 independent columns, by trying every set of columns.
Eigen::VectorXd nonnegative_least_squares(const Eigen::MatrixXd& columns, const Eigen::VectorXd& right_side);

}  // namespace interglow::fitting
