// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/paper_model.h"

#include <fmt/format.h>

#include <cmath>

#include "diagnostics/error.h"
#include "radiosity/row_chunks.h"

namespace interglow::radiosity {
namespace {

/// Sine of the angle between the two functions below which noise decides how light is shared between them.
constexpr double kLeastSine = 1e-6;

Eigen::VectorXd luminescence(const spectral::DonaldsonMatrix& donaldson, const Eigen::VectorXd& irradiance) {
  if (!donaldson.luminesces()) return Eigen::VectorXd::Zero(irradiance.size());
  return donaldson.luminescence * irradiance;
}

void check_rows(Eigen::Index rows, const std::vector<int>& row_object, std::size_t objects) {
  if (static_cast<Eigen::Index>(row_object.size()) != rows) {
    throw InvalidParams(fmt::format("row_object: {} entries for {} rows.", row_object.size(), rows));
  }
  for (const int object : row_object) {
    if (object >= static_cast<int>(objects)) {
      throw InvalidParams(fmt::format("row_object: object {}; expected -1 or an index below {}.", object, objects));
    }
  }
}

/// Coefficients of a row on the two functions: rows of the pseudo-inverse.
struct LeastSquares {
  Eigen::VectorXd re;
  Eigen::VectorXd rr;
};

LeastSquares least_squares(const PaperFunctions& functions, std::size_t object) {
  const double re_norm = functions.re.norm();
  const double rr_norm = functions.rr.norm();
  if (!(re_norm > 0.0)) {
    throw InvalidInput(fmt::format(
        "object {}: S E is 0 in all bands, so its image has no shading terms. Check reflectance and illuminant.",
        object));
  }
  if (rr_norm == 0.0) return {functions.re / (re_norm * re_norm), Eigen::VectorXd::Zero(functions.re.size())};
  const Eigen::VectorXd q1 = functions.re / re_norm;
  const double along = q1.dot(functions.rr);
  Eigen::VectorXd q2 = functions.rr - along * q1;
  const double across = q2.norm();
  if (!(across > kLeastSine * rr_norm)) {
    throw InvalidInput(fmt::format(
        "object {}: S_i E and S_i S_j E are proportional to {:.1g}; the reflectance of the other object is grey, "
        "and direct light and interreflection cannot be told apart by their spectra.",
        object, across / rr_norm));
  }
  q2 /= across;
  return {(q1 - along / across * q2) / re_norm, q2 / across};
}

}  // namespace

PaperFunctions paper_functions(const spectral::DonaldsonMatrix& own, const spectral::DonaldsonMatrix& other,
                               const Eigen::VectorXd& illuminant, PaperLuminescence kind) {
  if (own.bands() != illuminant.size() || other.bands() != illuminant.size()) {
    throw InvalidParams(fmt::format("paper_functions: materials of {} and {} bands under an illuminant of {}.",
                                    own.bands(), other.bands(), illuminant.size()));
  }
  const Eigen::VectorXd other_reflects = other.reflectance.cwiseProduct(illuminant);
  const Eigen::VectorXd other_emits = luminescence(other, illuminant);
  PaperFunctions functions{.re = own.reflectance.cwiseProduct(illuminant),
                           .rr = own.reflectance.cwiseProduct(other_reflects),
                           .le = luminescence(own, illuminant),
                           .lr = luminescence(own, other_reflects),
                           .ll = luminescence(own, other_emits),
                           .rl = own.reflectance.cwiseProduct(other_emits)};
  if (kind == PaperLuminescence::kMerged) {
    functions.le += functions.lr + functions.ll;
    functions.lr = functions.le;
    functions.ll.setZero();
  }
  return functions;
}

std::vector<spectral::Material> without_luminescence(std::vector<spectral::Material> materials) {
  for (spectral::Material& material : materials) material.donaldson.luminescence.resize(0, 0);
  return materials;
}

ShadingTerms shading_terms(const RowMatrix& spectra, const std::vector<int>& row_object,
                           const std::vector<PaperFunctions>& functions) {
  check_rows(spectra.rows(), row_object, functions.size());
  std::vector<LeastSquares> solvers;
  for (std::size_t object = 0; object < functions.size(); ++object) {
    if (functions[object].re.size() != spectra.cols()) {
      throw InvalidParams(fmt::format("object {}: functions of {} bands for spectra of {}.", object,
                                      functions[object].re.size(), spectra.cols()));
    }
    solvers.push_back(least_squares(functions[object], object));
  }
  ShadingTerms terms{Eigen::VectorXd::Zero(spectra.rows()), Eigen::VectorXd::Zero(spectra.rows())};
  // Squares of the residual and of the spectra, chunk by chunk.
  const Eigen::MatrixXd squares =
      sum_over_row_chunks(spectra.rows(), 2, 1, [&](Eigen::Index first, Eigen::Index rows) -> Eigen::MatrixXd {
        Eigen::Vector2d sum = Eigen::Vector2d::Zero();
        for (Eigen::Index r = first; r < first + rows; ++r) {
          const int object = row_object[static_cast<std::size_t>(r)];
          if (object < 0) continue;
          const auto o = static_cast<std::size_t>(object);
          const Eigen::VectorXd y = spectra.row(r).transpose();
          terms.re[r] = solvers[o].re.dot(y);
          terms.rr[r] = solvers[o].rr.dot(y);
          sum[0] += (y - terms.re[r] * functions[o].re - terms.rr[r] * functions[o].rr).squaredNorm();
          sum[1] += y.squaredNorm();
        }
        return sum;
      });
  terms.relative_residual = squares(1) > 0.0 ? std::sqrt(squares(0) / squares(1)) : 0.0;
  return terms;
}

double interreflection_ratio(const ShadingTerms& terms, const std::vector<char>& region) {
  if (static_cast<Eigen::Index>(region.size()) != terms.re.size()) {
    throw InvalidParams(fmt::format("region: {} flags for {} rows.", region.size(), terms.re.size()));
  }
  double direct = 0.0;
  double indirect = 0.0;
  for (std::size_t r = 0; r < region.size(); ++r) {
    if (region[r] == 0) continue;
    direct += terms.re[static_cast<Eigen::Index>(r)];
    indirect += terms.rr[static_cast<Eigen::Index>(r)];
  }
  if (!(direct > 0.0)) {
    throw InvalidInput(
        "the region has no direct light (mean f_re is not above 0), so w = mean f_rr / mean f_re is undefined. Choose "
        "lit pixels.");
  }
  return indirect / direct;
}

Components synthesize(const ShadingTerms& terms, const std::vector<int>& row_object,
                      const std::vector<PaperFunctions>& functions, double w_over_w_prime) {
  check_rows(terms.re.size(), row_object, functions.size());
  const Eigen::Index bands = functions.empty() ? 0 : functions.front().re.size();
  const RowMatrix zero = RowMatrix::Zero(terms.re.size(), bands);
  Components parts{.re = zero, .rr = zero, .le = zero, .lr = zero, .ll = zero, .rl = zero};
  for_row_chunks(terms.re.size(), [&](Eigen::Index first, Eigen::Index rows) {
    for (Eigen::Index r = first; r < first + rows; ++r) {
      const int object = row_object[static_cast<std::size_t>(r)];
      if (object < 0) continue;
      const PaperFunctions& of = functions[static_cast<std::size_t>(object)];
      const double indirect = w_over_w_prime * terms.rr[r];
      parts.re.row(r) = terms.re[r] * of.re.transpose();
      parts.le.row(r) = terms.re[r] * of.le.transpose();
      parts.rr.row(r) = indirect * of.rr.transpose();
      parts.lr.row(r) = indirect * of.lr.transpose();
      parts.ll.row(r) = indirect * of.ll.transpose();
      parts.rl.row(r) = indirect * of.rl.transpose();
    }
  });
  return parts;
}

}  // namespace interglow::radiosity
