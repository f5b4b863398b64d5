// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/spectrum.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace interglow::spectral {
namespace {

struct Range {
  double first_nm;
  double last_nm;
};

/// What the table stands for: its entries and half a step beyond either end.
Range covered_range(const Spectrum& spectrum) {
  const Eigen::VectorXd& x = spectrum.wavelength_nm;
  const Eigen::Index n = x.size();
  if (n == 1) return {x[0], x[0]};
  return {x[0] - 0.5 * (x[1] - x[0]), x[n - 1] + 0.5 * (x[n - 1] - x[n - 2])};
}

// Wavelengths are written with a few decimals; 1e-6 nm tells two of them apart and forgives rounding.
constexpr double kSameWavelengthNm = 1e-6;

Range grid_range(const WavelengthGrid& grid) { return {grid.lower_edge_nm(0), grid.upper_edge_nm(grid.size() - 1)}; }

bool covers(const Range& table, const Range& grid) {
  return table.first_nm <= grid.first_nm + kSameWavelengthNm && table.last_nm >= grid.last_nm - kSameWavelengthNm;
}

/// Index of the entry at the first centre if the entries within the grid are its centres, one by one; -1 otherwise.
Eigen::Index first_of_same_bands(const Spectrum& spectrum, const WavelengthGrid& grid) {
  const Eigen::VectorXd& x = spectrum.wavelength_nm;
  const double* lower = std::lower_bound(x.data(), x.data() + x.size(), grid.center_nm(0) - kSameWavelengthNm);
  const Eigen::Index first = lower - x.data();
  if (first + grid.size() > x.size()) return -1;
  if ((x.segment(first, grid.size()) - grid.centers_nm()).cwiseAbs().maxCoeff() > kSameWavelengthNm) return -1;
  const bool none_before = first == 0 || x[first - 1] <= grid.lower_edge_nm(0) + kSameWavelengthNm;
  const Eigen::Index next = first + grid.size();
  const bool none_after = next == x.size() || x[next] >= grid.upper_edge_nm(grid.size() - 1) - kSameWavelengthNm;
  return none_before && none_after ? first : -1;
}

/// Integrates the piecewise linear table from wavelength to wavelength, in one pass.
class RunningIntegral {
 public:
  RunningIntegral(const Spectrum& spectrum, Outside outside)
      : x_(spectrum.wavelength_nm),
        y_(spectrum.value),
        range_(covered_range(spectrum)),
        zero_(outside == Outside::kZero) {}

  /// Integral from `from` to `to`; calls must not go back.
  double operator()(double from, double to) {
    double sum = 0.0;
    while (next_ < x_.size() && x_[next_] <= from) ++next_;
    while (next_ < x_.size() && x_[next_] < to) {
      sum += piece(from, x_[next_]);
      from = x_[next_++];
    }
    return sum + piece(from, to);
  }

 private:
  /// Within one interval of the table, or outside it.
  double piece(double from, double to) const {
    if (next_ == 0 || next_ == x_.size()) {
      if (zero_) {
        from = std::max(from, range_.first_nm);
        to = std::min(to, range_.last_nm);
      }
      return std::max(0.0, to - from) * y_[next_ == 0 ? 0 : next_ - 1];
    }
    const double slope = (y_[next_] - y_[next_ - 1]) / (x_[next_] - x_[next_ - 1]);
    return (to - from) * (y_[next_ - 1] + slope * (0.5 * (from + to) - x_[next_ - 1]));
  }

  const Eigen::VectorXd& x_;
  const Eigen::VectorXd& y_;
  Range range_;
  bool zero_;
  Eigen::Index next_ = 0;  ///< first entry beyond where the last integral ended
};

}  // namespace

void validate(const Spectrum& spectrum) {
  const std::string& name = spectrum.source.empty() ? "spectrum" : spectrum.source;
  if (spectrum.wavelength_nm.size() != spectrum.value.size() || spectrum.value.size() == 0) {
    throw InvalidInput(fmt::format("{}: {} wavelengths and {} values; expected as many of each, at least one.", name,
                                   spectrum.wavelength_nm.size(), spectrum.value.size()));
  }
  for (Eigen::Index i = 0; i < spectrum.value.size(); ++i) {
    const double wavelength = spectrum.wavelength_nm[i];
    if (!std::isfinite(wavelength) || wavelength <= 0.0 || (i > 0 && wavelength <= spectrum.wavelength_nm[i - 1])) {
      throw InvalidInput(
          fmt::format("{}: entry {}: wavelength {} nm; expected finite, positive, strictly increasing wavelengths.",
                      name, i + 1, wavelength));
    }
    if (!std::isfinite(spectrum.value[i])) {
      throw InvalidInput(fmt::format("{}: entry {} ({} nm): value {}; expected a finite number.", name, i + 1,
                                     wavelength, spectrum.value[i]));
    }
  }
}

Eigen::VectorXd band_means(const Spectrum& spectrum, const WavelengthGrid& grid, Outside outside) {
  validate(spectrum);
  if (grid.size() == 0) return {};
  const Range table = covered_range(spectrum);
  const Range wanted = grid_range(grid);
  if (outside == Outside::kRefuse && !covers(table, wanted)) {
    throw InvalidInput(
        fmt::format("{}: the table covers {} to {} nm, but the wavelength grid needs {} to {} nm. Extend the table or "
                    "narrow the grid.",
                    spectrum.source.empty() ? "spectrum" : spectrum.source, table.first_nm, table.last_nm,
                    wanted.first_nm, wanted.last_nm));
  }
  if (const Eigen::Index first = first_of_same_bands(spectrum, grid); first >= 0) {
    return spectrum.value.segment(first, grid.size());
  }
  RunningIntegral integral(spectrum, outside);
  Eigen::VectorXd means(grid.size());
  for (Eigen::Index band = 0; band < grid.size(); ++band) {
    means[band] = integral(grid.lower_edge_nm(band), grid.upper_edge_nm(band)) / grid.width_nm(band);
  }
  return means;
}

Warnings warn_where_uncovered(const Spectrum& spectrum, const WavelengthGrid& grid, Outside outside) {
  if (grid.size() == 0 || spectrum.wavelength_nm.size() == 0) return {};
  const Range table = covered_range(spectrum);
  const Range wanted = grid_range(grid);
  if (covers(table, wanted)) return {};
  return {fmt::format("{}: the table covers {} to {} nm, the wavelength grid {} to {} nm; outside the table {}.",
                      spectrum.source.empty() ? "spectrum" : spectrum.source, table.first_nm, table.last_nm,
                      wanted.first_nm, wanted.last_nm,
                      outside == Outside::kZero
                          ? "the value is taken as 0 (ultraviolet that excites luminescence is lost)"
                          : "the end value is held")};
}

}  // namespace interglow::spectral
