// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/donaldson_resample.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "spectral/conservative_resample.h"

namespace interglow::spectral {
namespace {

constexpr double kSameWavelengthNm = 1e-6;
// Anti-Stokes emission ends within a few kT (25 meV) of the excitation: 50 nm is 0.25 eV at 500 nm. Beyond it is noise.
constexpr double kAntiStokesReachNm = 50.0;
// Instruments leave this much around 0 and 1 on the diagonal.
constexpr double kReflectanceNoise = 0.05;
// The same instrument shows up to 0.05 for a non-luminescent red chip and 0.11 for the weakest luminescent sample.
constexpr double kLeakageYield = 0.06;

Eigen::VectorXd edges_of(const WavelengthGrid& grid) {
  Eigen::VectorXd edges(grid.size() + 1);
  edges[0] = grid.lower_edge_nm(0);
  for (Eigen::Index i = 0; i < grid.size(); ++i) edges[i + 1] = grid.upper_edge_nm(i);
  return edges;
}

/// The table with its diagonal set apart. Luminescence per nm of excitation, emission x excitation.
struct SplitTable {
  Eigen::Index first_row = 0;   ///< first emission band that is an excitation band too; they are consecutive
  Eigen::VectorXd diagonal;     ///< whole radiance factor of those bands, clamped to [0, 1]
  Eigen::MatrixXd stokes;       ///< emission longer than excitation; 0 elsewhere
  Eigen::MatrixXd anti_stokes;  ///< emission shorter than excitation; 0 elsewhere
};

/// Excitation band of an emission band, or -1.
std::vector<Eigen::Index> same_bands(const BispectralTable& table) {
  const WavelengthGrid& emission = table.emission;
  const WavelengthGrid& excitation = table.excitation;
  std::vector<Eigen::Index> same(static_cast<std::size_t>(emission.size()), -1);
  for (Eigen::Index i = 0; i < emission.size(); ++i) {
    const double center = emission.center_nm(i);
    const bool in_range =
        center > excitation.lower_edge_nm(0) && center < excitation.upper_edge_nm(excitation.size() - 1);
    if (!in_range) continue;
    Eigen::Index nearest = 0;
    (excitation.centers_nm().array() - center).abs().minCoeff(&nearest);
    if (std::abs(excitation.center_nm(nearest) - center) > kSameWavelengthNm ||
        std::abs(excitation.lower_edge_nm(nearest) - emission.lower_edge_nm(i)) > kSameWavelengthNm ||
        std::abs(excitation.upper_edge_nm(nearest) - emission.upper_edge_nm(i)) > kSameWavelengthNm) {
      throw InvalidInput(
          fmt::format("{}: emission band {} nm ({} to {} nm) is not a band of the excitation, so the diagonal of the "
                      "matrix is unknown. "
                      "Measure or tabulate both on the same wavelengths where they overlap.",
                      table.source, center, emission.lower_edge_nm(i), emission.upper_edge_nm(i)));
    }
    same[static_cast<std::size_t>(i)] = nearest;
  }
  return same;
}

void require_numbers(const BispectralTable& table) {
  const Eigen::MatrixXd& D = table.radiance_factor;
  if (D.rows() != table.emission.size() || D.cols() != table.excitation.size() || D.size() == 0) {
    throw InvalidInput(fmt::format("{}: {} x {} values, expected {} emission x {} excitation bands.", table.source,
                                   D.rows(), D.cols(), table.emission.size(), table.excitation.size()));
  }
  for (Eigen::Index i = 0; i < D.rows(); ++i) {
    for (Eigen::Index j = 0; j < D.cols(); ++j) {
      if (!std::isfinite(D(i, j))) {
        throw InvalidInput(fmt::format("{}: emission {} nm, excitation {} nm: {}; expected a finite number.",
                                       table.source, table.emission.center_nm(i), table.excitation.center_nm(j),
                                       D(i, j)));
      }
    }
  }
}

SplitTable split(const BispectralTable& table, Warnings& warnings) {
  require_numbers(table);
  const std::vector<Eigen::Index> same = same_bands(table);
  SplitTable parts;
  parts.stokes = Eigen::MatrixXd::Zero(table.emission.size(), table.excitation.size());
  parts.anti_stokes = parts.stokes;
  std::vector<double> diagonal;
  double worst_excess = 0.0;
  double worst_nm = 0.0;
  for (Eigen::Index i = 0; i < table.emission.size(); ++i) {
    const double emission_nm = table.emission.center_nm(i);
    for (Eigen::Index j = 0; j < table.excitation.size(); ++j) {
      const double value = table.radiance_factor(i, j);
      if (same[static_cast<std::size_t>(i)] == j) {
        if (diagonal.empty()) parts.first_row = i;
        const double clamped = std::clamp(value, 0.0, 1.0);
        if (std::abs(value - clamped) > kReflectanceNoise) {
          throw InvalidInput(
              fmt::format("{}: radiance factor at {} nm (diagonal) is {}; expected 0 to 1. Check that rows are "
                          "emission, and that the "
                          "numbers are factors and no percentages.",
                          table.source, emission_nm, value));
        }
        if (std::abs(value - clamped) > worst_excess) {
          worst_excess = std::abs(value - clamped);
          worst_nm = emission_nm;
        }
        diagonal.push_back(clamped);
      } else if (table.excitation.center_nm(j) < emission_nm) {
        parts.stokes(i, j) = value / table.excitation.width_nm(j);
      } else {
        parts.anti_stokes(i, j) = value / table.excitation.width_nm(j);
      }
    }
  }
  if (diagonal.empty()) {
    throw InvalidInput(table.source +
                       ": no emission band is an excitation band too, so the reflectance is unknown. "
                       "Extend the table.");
  }
  if (worst_excess > 0.0) {
    warnings.push_back(
        fmt::format("{}: radiance factors on the diagonal leave 0 to 1 by up to {:.2g} (at {} nm) and were "
                    "limited.",
                    table.source, worst_excess, worst_nm));
  }
  parts.diagonal = Eigen::Map<const Eigen::VectorXd>(diagonal.data(), static_cast<Eigen::Index>(diagonal.size()));
  return parts;
}

/// Standard deviation of the entries far on the anti-Stokes side, where nothing radiates (from their median deviation).
double noise_of(const BispectralTable& table) {
  std::vector<double> values;
  for (Eigen::Index i = 0; i < table.emission.size(); ++i) {
    for (Eigen::Index j = 0; j < table.excitation.size(); ++j) {
      if (table.excitation.center_nm(j) - table.emission.center_nm(i) > kAntiStokesReachNm) {
        values.push_back(std::abs(table.radiance_factor(i, j)));
      }
    }
  }
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return 1.4826 * *middle;  // of a normal distribution
}

/// Bands whose Stokes entries together stand out of the noise and reach a hundredth of the strongest band; in a table
/// without noise (a fit, a formula) all that radiate.
Eigen::Array<bool, Eigen::Dynamic, 1> bands_with_signal(const Eigen::VectorXd& sums, const Eigen::VectorXd& counts,
                                                        double noise) {
  const double floor = noise > 0.0 ? 0.01 * sums.maxCoeff() : 0.0;
  return sums.array() > (3.0 * noise * counts.array().sqrt()).max(floor);
}

/// Sets to 0 what is negative or lies in bands without luminescence, and says how much that was.
void remove_noise(const BispectralTable& table, SplitTable& parts, Warnings& warnings) {
  const Eigen::MatrixXd entries = parts.stokes * table.excitation.widths_nm().asDiagonal();
  Eigen::MatrixXd is_stokes = Eigen::MatrixXd::Zero(entries.rows(), entries.cols());
  for (Eigen::Index i = 0; i < entries.rows(); ++i) {
    for (Eigen::Index j = 0; j < entries.cols(); ++j) {
      if (table.excitation.center_nm(j) < table.emission.center_nm(i) - kSameWavelengthNm) is_stokes(i, j) = 1.0;
    }
  }
  const double noise = noise_of(table);
  const auto emits = bands_with_signal(entries.rowwise().sum(), is_stokes.rowwise().sum(), noise);
  const auto excites =
      bands_with_signal(entries.colwise().sum().transpose(), is_stokes.colwise().sum().transpose(), noise);
  double removed = 0.0;
  double kept = 0.0;
  for (Eigen::Index i = 0; i < entries.rows(); ++i) {
    for (Eigen::Index j = 0; j < entries.cols(); ++j) {
      const bool luminesces = emits[i] && excites[j];
      const double distance_nm = table.excitation.center_nm(j) - table.emission.center_nm(i);
      if (!luminesces || parts.stokes(i, j) < 0.0) {
        removed += entries(i, j);
        parts.stokes(i, j) = 0.0;
      }
      if (!luminesces || parts.anti_stokes(i, j) < 0.0 || distance_nm > kAntiStokesReachNm)
        parts.anti_stokes(i, j) = 0.0;
      kept += parts.stokes(i, j) * table.excitation.width_nm(j);
    }
  }
  const double yield =
      (parts.stokes * table.excitation.widths_nm().asDiagonal())
          .cwiseProduct(table.emission.widths_nm() * table.excitation.widths_nm().cwiseInverse().transpose())
          .colwise()
          .sum()
          .maxCoeff();
  if (noise > 0.0 && yield > 0.0 && yield < kLeakageYield) {
    warnings.push_back(
        fmt::format("{}: at most {:.1f} % of the light received is re-emitted, about what slit leakage shows for "
                    "samples that do not "
                    "luminesce. Use the diagonal as a reflectance if this sample does not.",
                    table.source, 100.0 * yield));
  }
  if (std::abs(removed) > 1e-3 * kept && kept > 0.0) {
    warnings.push_back(
        fmt::format("{}: entries that are negative or in bands without luminescence above the noise ({:.2g}) were set "
                    "to 0; they summed "
                    "to {:.1f} % of the luminescence.",
                    table.source, noise, 100.0 * removed / kept));
  }
}

/// Same-band luminescence per nm of excitation, one value for each band of the diagonal: half of α β at the diagonal of
/// the product α β^T closest to the Stokes entries (alternating least squares over them alone).
Eigen::VectorXd same_band_luminescence(const BispectralTable& table, const SplitTable& parts) {
  const Eigen::MatrixXd& L = parts.stokes;
  Eigen::MatrixXd mask = Eigen::MatrixXd::Zero(L.rows(), L.cols());
  for (Eigen::Index i = 0; i < L.rows(); ++i) {
    for (Eigen::Index j = 0; j < L.cols(); ++j) {
      if (table.excitation.center_nm(j) < table.emission.center_nm(i) - kSameWavelengthNm) mask(i, j) = 1.0;
    }
  }
  Eigen::VectorXd beta = L.colwise().sum().transpose();
  Eigen::VectorXd alpha = Eigen::VectorXd::Zero(L.rows());
  const auto divided = [](const Eigen::VectorXd& numerator, const Eigen::VectorXd& denominator) {
    return Eigen::VectorXd((denominator.array() > 0.0).select(numerator.array() / denominator.array(), 0.0).max(0.0));
  };
  // Converges linearly with the ratio of the second to the first singular value (0.1 to 0.3 for one compound).
  constexpr int kRounds = 60;
  for (int round = 0; round < kRounds; ++round) {
    alpha = divided(L * beta, mask * beta.cwiseAbs2());
    beta = divided(L.transpose() * alpha, mask.transpose() * alpha.cwiseAbs2());
  }
  Eigen::VectorXd result(parts.diagonal.size());
  for (Eigen::Index d = 0; d < result.size(); ++d) {
    const Eigen::Index row = parts.first_row + d;
    Eigen::Index column = 0;
    (table.excitation.centers_nm().array() - table.emission.center_nm(row)).abs().minCoeff(&column);
    result[d] = std::min(0.5 * alpha[row] * beta[column], parts.diagonal[d] / table.excitation.width_nm(column));
  }
  return result;
}

/// Reflectances on the new bands; the end values hold outside.
Eigen::VectorXd resample_reflectance(const Eigen::VectorXd& edges, const Eigen::VectorXd& mean,
                                     const Eigen::VectorXd& new_edges) {
  const double first = std::min(edges[0], new_edges[0]) - 1.0;
  const double last = std::max(edges[edges.size() - 1], new_edges[new_edges.size() - 1]) + 1.0;
  Eigen::VectorXd wide_edges(edges.size() + 2);
  wide_edges << first, edges, last;
  Eigen::VectorXd wide_mean(mean.size() + 2);
  wide_mean << mean[0], mean, mean[mean.size() - 1];
  return resample_means(wide_edges, wide_mean, new_edges);
}

/// One side of the diagonal as means over the new bands, per nm of excitation. `rows(j)` is the range of emission bands
/// that belong to this side for excitation band j; for an emission band, the excitation bands of a side are
/// consecutive.
template <class Rows>
Eigen::MatrixXd resample_side(const BispectralTable& table, const Eigen::MatrixXd& density, const Rows& rows,
                              const Eigen::VectorXd& new_edges) {
  const Eigen::VectorXd emission_edges = edges_of(table.emission);
  const Eigen::VectorXd excitation_edges = edges_of(table.excitation);
  const Eigen::Index bands = new_edges.size() - 1;
  Eigen::MatrixXd by_emission = Eigen::MatrixXd::Zero(bands, density.cols());
  Eigen::VectorXi first_column = Eigen::VectorXi::Constant(bands, static_cast<int>(density.cols()));
  Eigen::VectorXi end_column = Eigen::VectorXi::Zero(bands);
  for (Eigen::Index j = 0; j < density.cols(); ++j) {
    const auto [first, end] = rows(j);
    if (first >= end) continue;
    by_emission.col(j) = resample_means(emission_edges.segment(first, end - first + 1),
                                        density.col(j).segment(first, end - first), new_edges);
    for (Eigen::Index k = 0; k < bands; ++k) {
      if (new_edges[k] >= emission_edges[end] || new_edges[k + 1] <= emission_edges[first]) continue;
      first_column[k] = std::min(first_column[k], static_cast<int>(j));
      end_column[k] = static_cast<int>(j) + 1;
    }
  }
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(bands, bands);
  for (Eigen::Index k = 0; k < bands; ++k) {
    const Eigen::Index first = first_column[k];
    const Eigen::Index count = end_column[k] - first;
    if (count <= 0) continue;
    result.row(k) = resample_means(excitation_edges.segment(first, count + 1),
                                   by_emission.row(k).segment(first, count).transpose(), new_edges)
                        .transpose();
  }
  return result;
}

void warn_about_range(const BispectralTable& table, const SplitTable& parts, const WavelengthGrid& grid,
                      Warnings& warnings) {
  const double first = table.emission.lower_edge_nm(parts.first_row);
  const double last = table.emission.upper_edge_nm(parts.first_row + parts.diagonal.size() - 1);
  const double grid_first = grid.lower_edge_nm(0);
  const double grid_last = grid.upper_edge_nm(grid.size() - 1);
  if (grid_first < first - kSameWavelengthNm || grid_last > last + kSameWavelengthNm) {
    warnings.push_back(
        fmt::format("{}: reflectance is tabulated from {} to {} nm, the wavelength grid covers {} to {} nm; the end "
                    "value is held outside.",
                    table.source, first, last, grid_first, grid_last));
  }
}

}  // namespace

DonaldsonReading resample(const BispectralTable& table, const WavelengthGrid& grid,
                          const DonaldsonResampleParams& params) {
  DonaldsonReading reading;
  SplitTable parts = split(table, reading.warnings);
  warn_about_range(table, parts, grid, reading.warnings);
  if (!params.keep_noise) remove_noise(table, parts, reading.warnings);
  if (!params.keep_anti_stokes) {
    const double share = parts.anti_stokes.sum() / parts.stokes.sum();
    if (share > 0.005) {
      reading.warnings.push_back(fmt::format(
          "{}: anti-Stokes entries ({:.1f} % of the luminescence) were dropped; keep_anti_stokes keeps them.",
          table.source, 100.0 * share));
    }
    parts.anti_stokes.setZero();
  }

  const Eigen::VectorXd new_edges = edges_of(grid);
  const Eigen::VectorXd same_band = same_band_luminescence(table, parts);
  const Eigen::Index diagonal_bands = parts.diagonal.size();
  const Eigen::VectorXd widths = table.emission.widths_nm().segment(parts.first_row, diagonal_bands);
  const Eigen::VectorXd pure = parts.diagonal - same_band.cwiseProduct(widths);
  reading.donaldson.reflectance =
      resample_reflectance(edges_of(table.emission).segment(parts.first_row, diagonal_bands + 1), pure, new_edges);

  // The same-band cells belong to the Stokes side.
  for (Eigen::Index d = 0; d < diagonal_bands; ++d) {
    const Eigen::Index row = parts.first_row + d;
    Eigen::Index column = 0;
    (table.excitation.centers_nm().array() - table.emission.center_nm(row)).abs().minCoeff(&column);
    parts.stokes(row, column) = same_band[d];
  }
  const auto boundary = [&](Eigen::Index column) {
    const double* centers = table.emission.centers_nm().data();
    return std::lower_bound(centers, centers + table.emission.size(),
                            table.excitation.center_nm(column) - kSameWavelengthNm) -
           centers;
  };
  using Range = std::pair<Eigen::Index, Eigen::Index>;
  const Eigen::Index emission_bands = table.emission.size();
  const Eigen::MatrixXd stokes = resample_side(
      table, parts.stokes,
      [&](Eigen::Index j) {
        return Range{boundary(j), emission_bands};
      },
      new_edges);
  const Eigen::MatrixXd anti_stokes = resample_side(
      table, parts.anti_stokes,
      [&](Eigen::Index j) {
        return Range{0, boundary(j)};
      },
      new_edges);

  Eigen::MatrixXd luminescence = Eigen::MatrixXd::Zero(grid.size(), grid.size());
  for (Eigen::Index k = 0; k < grid.size(); ++k) {
    for (Eigen::Index j = 0; j < grid.size(); ++j) {
      // Of a cell of the table that the new diagonal divides, what falls on the wrong side is same-band luminescence.
      (j < k ? luminescence(k, j) : reading.donaldson.reflectance[k]) += stokes(k, j) * grid.width_nm(j);
      (j > k ? luminescence(k, j) : reading.donaldson.reflectance[k]) += anti_stokes(k, j) * grid.width_nm(j);
    }
  }
  reading.donaldson.reflectance = reading.donaldson.reflectance.cwiseMax(0.0).cwiseMin(1.0);
  if ((luminescence.array() != 0.0).any()) reading.donaldson.luminescence = std::move(luminescence);
  return reading;
}

}  // namespace interglow::spectral
