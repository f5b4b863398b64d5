// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/decomposition.h"

#include <fmt/format.h>

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "diagnostics/error.h"
#include "radiosity/row_chunks.h"

namespace interglow::fitting {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
/// A component takes part in the weakest direction if its share of that unit vector is at least this.
constexpr double kLeastShare = 0.3;
/// Noise gain from which the sentence speaks of spectra that are hard to tell apart.
constexpr double kNotableNoiseGain = 10.0;
/// Shading maps are in single precision (6e-8), amplified by the decomposition.
constexpr double kLeastShadingSine = 1e-5;

/// Up to five numbers without the heap.
using Terms = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostComponents, 1>;
using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostComponents, kMostComponents>;

/// Least squares in the coordinates of the columns' own space: A = Q R, so |A f - y|² = |R f - Qᵀ y|² + constant.
class SmallSolver {
 public:
  explicit SmallSolver(const Eigen::MatrixXd& columns) {
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(columns);
    const Eigen::Index count = columns.cols();
    q_ = qr.householderQ() * Eigen::MatrixXd::Identity(columns.rows(), count);
    r_ = qr.matrixQR().topRows(count).triangularView<Eigen::Upper>();
    for (unsigned set = 1; set < (1U << count); ++set) {
      Subset subset;
      for (int c = 0; c < count; ++c) {
        if ((set >> c & 1U) != 0) subset.column.push_back(c);
      }
      SmallMatrix part(count, static_cast<Eigen::Index>(subset.column.size()));
      for (std::size_t c = 0; c < subset.column.size(); ++c)
        part.col(static_cast<Eigen::Index>(c)) = r_.col(subset.column[c]);
      subset.inverse = Eigen::MatrixXd(part).completeOrthogonalDecomposition().pseudoInverse();
      subsets_.push_back(std::move(subset));
    }
  }

  const Eigen::MatrixXd& q() const { return q_; }

  Terms any_sign(const Terms& projected) const { return subsets_.back().inverse * projected; }

  /// The best of the non-negative solutions of all sets of columns, given the solution without bounds.
  Terms non_negative(const Terms& projected) const {
    Terms best = Terms::Zero(r_.cols());
    double least = projected.squaredNorm();
    for (const Subset& subset : subsets_) {
      const Terms part = subset.inverse * projected;
      if ((part.array() < 0.0).any()) continue;
      Terms terms = Terms::Zero(r_.cols());
      for (std::size_t c = 0; c < subset.column.size(); ++c)
        terms[subset.column[c]] = part[static_cast<Eigen::Index>(c)];
      const double squares = (r_ * terms - projected).squaredNorm();
      if (squares < least) {
        least = squares;
        best = terms;
      }
    }
    return best;
  }

 private:
  struct Subset {
    std::vector<int> column;
    SmallMatrix inverse;
  };
  Eigen::MatrixXd q_;
  SmallMatrix r_;
  std::vector<Subset> subsets_;
};

std::string join(const std::vector<int>& members, const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t m = 0; m < members.size(); ++m) {
    text += (m == 0                    ? "\""
             : m + 1 == members.size() ? "\" and \""
                                       : "\", \"") +
            names[static_cast<std::size_t>(members[m])];
  }
  return text + "\"";
}

void check_basis(const ComponentBasis& basis, Eigen::Index weights) {
  const Eigen::Index count = basis.spectrum.cols();
  if (count < 1 || count > kMostComponents || static_cast<Eigen::Index>(basis.name.size()) != count) {
    throw InvalidParams(fmt::format("basis: {} spectra and {} names; expected as many names as spectra, 1 to {}.",
                                    count, basis.name.size(), kMostComponents));
  }
  if (basis.spectrum.rows() < count) {
    throw InvalidParams(
        fmt::format("basis: {} components in {} bands; more components than bands have no unique shading "
                    "terms.",
                    count, basis.spectrum.rows()));
  }
  if (weights != 0 && weights != basis.spectrum.rows()) {
    throw InvalidParams(
        fmt::format("band_weight: {} values; expected one a band, that is {}.", weights, basis.spectrum.rows()));
  }
  for (Eigen::Index c = 0; c < count; ++c) {
    if (!basis.spectrum.col(c).allFinite()) {
      throw InvalidParams(fmt::format("basis: component \"{}\" has a value that is not finite.",
                                      basis.name[static_cast<std::size_t>(c)]));
    }
  }
}

Eigen::MatrixXd weighted(const ComponentBasis& basis, const Eigen::VectorXd& band_weight) {
  if (band_weight.size() == 0) return basis.spectrum;
  return band_weight.asDiagonal() * basis.spectrum;
}

void check(const image::SpectralImage& image, const std::vector<int>& object, const std::vector<ComponentBasis>& bases,
           const DecompositionParams& params) {
  const std::size_t pixels = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  if (object.size() != pixels) {
    throw InvalidParams(
        fmt::format("object: {} entries for an image of {} × {} pixels.", object.size(), image.width, image.height));
  }
  if (bases.empty()) throw InvalidParams("bases: none given; expected one an object.");
  for (const int index : object) {
    if (index < -1 || index >= static_cast<int>(bases.size())) {
      throw InvalidParams(fmt::format("object: {}; expected -1 or an index below {}.", index, bases.size()));
    }
  }
  for (std::size_t b = 0; b < bases.size(); ++b) {
    check_basis(bases[b], params.band_weight.size());
    if (bases[b].spectrum.rows() != image.bands()) {
      throw InvalidParams(fmt::format("object {}: spectra of {} bands for an image of {}.", b, bases[b].spectrum.rows(),
                                      image.bands()));
    }
    if (bases[b].name != bases.front().name) {
      throw InvalidParams(fmt::format("object {}: its components are named otherwise than those of object 0.", b));
    }
  }
  if (params.band_weight.size() != 0 &&
      !(params.band_weight.array().isFinite() && params.band_weight.array() >= 0).all())
    throw InvalidParams("band_weight: a value is negative or not finite; expected 1 / noise SD of each band.");
  if (!(params.least_sine >= 1e-12 && params.least_sine < 1.0))
    throw InvalidParams(fmt::format("least_sine: {}; expected a value in [1e-12, 1).", params.least_sine));
}

/// Sums that the chunks form: squares of residual and spectrum, pixels decomposed, not finite, bounded.
enum Sum { kResidual, kSpectrum, kPixels, kNotFinite, kBounded, kSums };

std::size_t component(const Decomposition& decomposition, const std::string& name) {
  const auto found = std::find(decomposition.name.begin(), decomposition.name.end(), name);
  if (found == decomposition.name.end())
    throw InvalidParams(fmt::format("the decomposition has no component \"{}\".", name));
  return static_cast<std::size_t>(found - decomposition.name.begin());
}

}  // namespace

ComponentBasis paper_basis(const radiosity::PaperFunctions& functions, int components) {
  std::vector<std::pair<std::string, Eigen::VectorXd>> columns = {{"re", functions.re}, {"rr", functions.rr}};
  if (components == 4) {
    columns.emplace_back("lum", functions.le + functions.lr + functions.ll);
    columns.emplace_back("rl", functions.rl);
  } else if (components == 5) {
    columns.emplace_back("le", functions.le);
    columns.emplace_back("li", functions.lr + functions.ll);
    columns.emplace_back("rl", functions.rl);
  } else if (components != 2) {
    throw InvalidParams(fmt::format("components: {}; expected 2, 4 or 5.", components));
  }
  std::erase_if(columns, [](const auto& column) { return column.second.isZero(0.0); });
  ComponentBasis basis;
  basis.spectrum.resize(functions.re.size(), static_cast<Eigen::Index>(columns.size()));
  for (std::size_t c = 0; c < columns.size(); ++c) {
    basis.name.push_back(columns[c].first);
    basis.spectrum.col(static_cast<Eigen::Index>(c)) = columns[c].second;
  }
  return basis;
}

BasisQuality examine(const ComponentBasis& basis, const Eigen::VectorXd& band_weight) {
  check_basis(basis, band_weight.size());
  Eigen::MatrixXd columns = weighted(basis, band_weight);
  for (Eigen::Index c = 0; c < columns.cols(); ++c) {
    const double length = columns.col(c).norm();
    if (!(length > 0.0)) {
      throw InvalidInput(
          fmt::format("component \"{}\" is 0 in all bands that count; leave it out of the decomposition.",
                      basis.name[static_cast<std::size_t>(c)]));
    }
    columns.col(c) /= length;
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(columns, Eigen::ComputeThinV);
  BasisQuality quality;
  quality.singular_value = svd.singularValues();
  const Eigen::Index count = columns.cols();
  const double smallest = quality.singular_value[count - 1];
  quality.condition_number =
      smallest > 0.0 ? quality.singular_value[0] / smallest : std::numeric_limits<double>::infinity();
  // (AᵀA)⁻¹ has 1 / sine² on its diagonal when the columns have length 1.
  quality.sine = (svd.matrixV() * quality.singular_value.cwiseInverse().asDiagonal()).rowwise().norm().cwiseInverse();
  const Eigen::VectorXd share = svd.matrixV().col(count - 1).cwiseAbs();
  for (int c = 0; c < count; ++c) {
    if (share[c] >= kLeastShare) quality.weakest.push_back(c);
  }
  const double least = quality.sine.minCoeff();
  if (least * kNotableNoiseGain > 1.0) {
    quality.sentence =
        fmt::format("the spectra are told apart well (condition number {:.3g})", quality.condition_number);
  } else {
    quality.sentence = fmt::format(
        "{} trade with each other: their spectra are within {:.3g} of dependence (sine of the angle), which multiplies "
        "the noise of their shading terms by {:.3g} (condition number {:.3g})",
        join(quality.weakest, basis.name), least, 1.0 / least, quality.condition_number);
  }
  return quality;
}

Decomposition decompose(const image::SpectralImage& image, const std::vector<int>& object,
                        const std::vector<ComponentBasis>& bases, const DecompositionParams& params) {
  check(image, object, bases, params);
  Decomposition result;
  result.width = image.width;
  result.height = image.height;
  result.name = bases.front().name;
  std::vector<Eigen::MatrixXd> columns;
  std::vector<SmallSolver> solvers;
  for (std::size_t b = 0; b < bases.size(); ++b) {
    result.quality.push_back(examine(bases[b], params.band_weight));
    const BasisQuality& quality = result.quality.back();
    if (!(quality.sine.minCoeff() >= params.least_sine)) {
      throw InvalidInput(fmt::format(
          "object {}: the spectra of {} nearly coincide (sine of the angle {:.2g}, allowed {:.2g}): noise would decide "
          "how light is shared between them. Merge them into one component or leave one out.",
          b, join(quality.weakest, bases[b].name), quality.sine.minCoeff(), params.least_sine));
    }
    columns.push_back(weighted(bases[b], params.band_weight));
    solvers.emplace_back(columns.back());
  }
  const image::ScalarMap none{image.width, image.height, std::vector<float>(object.size(), kNone)};
  result.shading.assign(result.name.size(), none);
  result.relative_residual = none;
  const Eigen::Index bands = image.bands();
  const auto work = [&](Eigen::Index first, Eigen::Index rows) -> Eigen::MatrixXd {
    Eigen::VectorXd sums = Eigen::VectorXd::Zero(kSums);
    Eigen::VectorXd y(bands);
    for (auto p = static_cast<std::size_t>(first); p < static_cast<std::size_t>(first + rows); ++p) {
      if (object[p] < 0) continue;
      const auto o = static_cast<std::size_t>(object[p]);
      y = Eigen::Map<const Eigen::VectorXf>(image.value.data() + p * static_cast<std::size_t>(bands), bands)
              .cast<double>();
      if (!y.allFinite()) {
        sums[kNotFinite] += 1.0;
        continue;
      }
      if (params.band_weight.size() != 0) y.array() *= params.band_weight.array();
      const Terms projected = solvers[o].q().transpose() * y;
      Terms terms = solvers[o].any_sign(projected);
      if (params.sign == Sign::kNonNegative && (terms.array() < 0.0).any()) {
        terms = solvers[o].non_negative(projected);
        sums[kBounded] += 1.0;
      }
      const double residual = (y - columns[o] * terms).squaredNorm();
      const double spectrum = y.squaredNorm();
      sums[kResidual] += residual;
      sums[kSpectrum] += spectrum;
      sums[kPixels] += 1.0;
      for (std::size_t c = 0; c < result.shading.size(); ++c)
        result.shading[c].value[p] = static_cast<float>(terms[static_cast<Eigen::Index>(c)]);
      result.relative_residual.value[p] = spectrum > 0.0 ? static_cast<float>(std::sqrt(residual / spectrum)) : 0.0F;
    }
    return sums;
  };
  const Eigen::MatrixXd sums = radiosity::sum_over_row_chunks(static_cast<Eigen::Index>(object.size()), kSums, 1, work);
  result.total_relative_residual = sums(kSpectrum) > 0.0 ? std::sqrt(sums(kResidual) / sums(kSpectrum)) : 0.0;
  result.pixels = static_cast<std::size_t>(sums(kPixels));
  result.not_finite = static_cast<std::size_t>(sums(kNotFinite));
  result.bounded = static_cast<std::size_t>(sums(kBounded));
  return result;
}

image::SpectralImage synthesize(const Decomposition& decomposition, const std::vector<int>& object,
                                const std::vector<ComponentBasis>& bases, const Eigen::VectorXd& wavelength_nm) {
  image::SpectralImage image{decomposition.width, decomposition.height, wavelength_nm, {}};
  const auto bands = static_cast<std::size_t>(wavelength_nm.size());
  image.value.assign(object.size() * bands, 0.0F);
  if (object.size() != decomposition.relative_residual.value.size())
    throw InvalidParams(
        fmt::format("object: {} entries for {} pixels.", object.size(), decomposition.relative_residual.value.size()));
  for (const ComponentBasis& basis : bases) {
    if (basis.name != decomposition.name || basis.spectrum.rows() != wavelength_nm.size())
      throw InvalidParams("bases: other names or bands than the decomposition and the wavelengths.");
  }
  radiosity::for_row_chunks(static_cast<Eigen::Index>(object.size()), [&](Eigen::Index first, Eigen::Index rows) {
    Terms terms(static_cast<Eigen::Index>(decomposition.name.size()));
    for (auto p = static_cast<std::size_t>(first); p < static_cast<std::size_t>(first + rows); ++p) {
      if (object[p] < 0 || std::isnan(decomposition.shading.front().value[p])) continue;
      for (std::size_t c = 0; c < decomposition.shading.size(); ++c)
        terms[static_cast<Eigen::Index>(c)] = static_cast<double>(decomposition.shading[c].value[p]);
      Eigen::Map<Eigen::VectorXf>(image.value.data() + p * bands, static_cast<Eigen::Index>(bands)) =
          (bases.at(static_cast<std::size_t>(object[p])).spectrum * terms).cast<float>();
    }
  });
  return image;
}

std::vector<LuminescenceSplit> split_luminescence(const Decomposition& decomposition, const std::vector<int>& object) {
  const std::vector<float>& re = decomposition.shading[component(decomposition, "re")].value;
  const std::vector<float>& rr = decomposition.shading[component(decomposition, "rr")].value;
  const std::vector<float>& lum = decomposition.shading[component(decomposition, "lum")].value;
  if (object.size() != lum.size())
    throw InvalidParams(fmt::format("object: {} entries for {} pixels.", object.size(), lum.size()));
  std::vector<LuminescenceSplit> splits;
  for (std::size_t o = 0; o < decomposition.quality.size(); ++o) {
    // Compressed to three rows by QR of the tall [f_re f_rr f_lum], a block at a time.
    Eigen::MatrixXd stack(3 + 512, 3);
    stack.setZero();
    Eigen::Index filled = 3;
    const auto compress = [&] {
      const Eigen::HouseholderQR<Eigen::MatrixXd> qr(stack.topRows(filled));
      const Eigen::MatrixXd r = qr.matrixQR().topRows(3).triangularView<Eigen::Upper>();
      stack.topRows(3) = r;
      filled = 3;
    };
    for (std::size_t p = 0; p < object.size(); ++p) {
      if (object[p] != static_cast<int>(o) || std::isnan(lum[p])) continue;
      stack.row(filled++) = Eigen::RowVector3d(re[p], rr[p], lum[p]);
      if (filled == stack.rows()) compress();
    }
    compress();
    const Eigen::MatrixXd shading = stack.topLeftCorner(3, 2);
    const Eigen::VectorXd luminescence = stack.col(2).head(3);
    const Eigen::Vector2d length = shading.colwise().norm();
    const double sine =
        length.minCoeff() > kLeastShadingSine * length.maxCoeff() ? std::abs(shading(1, 1)) / length[1] : 0.0;
    if (!(sine > kLeastShadingSine)) {
      throw InvalidInput(fmt::format(
          "object {}: f_re and f_rr are proportional over its pixels, so luminescence by direct and by indirect light "
          "cannot be told apart. Take in pixels far from the other object.",
          o));
    }
    const Eigen::VectorXd c = nonnegative_least_squares(shading, luminescence);
    const double norm = luminescence.norm();
    splits.push_back({c[0], c[1], norm > 0.0 ? (luminescence - shading * c).norm() / norm : 0.0});
  }
  return splits;
}

Eigen::VectorXd nonnegative_least_squares(const Eigen::MatrixXd& columns, const Eigen::VectorXd& right_side) {
  if (columns.cols() < 1 || columns.cols() > kMostComponents || columns.rows() < columns.cols() ||
      right_side.size() != columns.rows()) {
    throw InvalidParams(
        fmt::format("nonnegative_least_squares: a {} × {} matrix and {} values; expected 1 to {} columns, "
                    "no more than rows.",
                    columns.rows(), columns.cols(), right_side.size(), kMostComponents));
  }
  const SmallSolver solver(columns);
  const Terms projected = solver.q().transpose() * right_side;
  const Terms terms = solver.any_sign(projected);
  return (terms.array() < 0.0).any() ? Eigen::VectorXd(solver.non_negative(projected)) : Eigen::VectorXd(terms);
}

}  // namespace interglow::fitting
