// SPDX-License-Identifier: GPL-3.0-or-later
/// What errors of single form factors make of a row's sum.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace interglow::radiosity {

/// What Student's t with so many degrees of freedom, at least 1, exceeds as seldom as a normal deviate exceeds
/// `deviations`, by Wallace's (1959) formula.
inline double student(double deviations, double freedom) {
  freedom = std::max(1.0, freedom);
  const double scaled = deviations * (8.0 * freedom + 3.0) / (8.0 * freedom + 1.0);
  return std::sqrt(freedom * std::expm1(std::min(100.0, scaled * scaled / freedom)));
}

/// Error of a row of form factors from some of its pairs. Rules may all be wrong in one direction: their bounds add.
/// Lines are independent from pair to pair: squares add. Each pair is drawn several times, so that the spread of a
/// lattice, which is far less than that of independent lines, is seen in the differences, surely enough once a row has
/// many pairs.
struct RowError {
  int element = 0;
  double bound = 0.0;
  double variance = 0.0;        ///< as if lines were independent
  double draws_variance = 0.0;  ///< from the differences of the draws
  double draws_squares = 0.0;   ///< Σ over the pairs of its square over the number of draws + 1
  double in_doubt = 0.0;        ///< squared error that lines that all agree leave open

  void operator+=(const RowError& other) {
    bound += other.bound;
    variance += other.variance;
    draws_variance += other.draws_variance;
    draws_squares += other.draws_squares;
    in_doubt += other.in_doubt;
  }

  /// Of form factors, from that of exchange areas.
  RowError over(double area) const {
    const double square = area * area;
    return {
        element,          bound / area, variance / square, draws_variance / square, draws_squares / (square * square),
        in_doubt / square};
  }

  /// What the row's error exceeds as seldom as a normal deviate exceeds `deviations` times its standard deviation. The
  /// differences of few pairs do not tell their spread well: Student's t with Satterthwaite's degrees of freedom.
  double estimate(double deviations) const {
    const double as_independent = deviations * std::sqrt(variance + in_doubt);
    if (!(draws_squares > 0.0)) return bound + as_independent;
    const double freedom = draws_variance * draws_variance / draws_squares - 2.0;
    return bound + std::min(as_independent, student(deviations, freedom) * std::sqrt(draws_variance + in_doubt));
  }
};

/// How many standard deviations none of `rows` normal deviates exceeds, with a probability of 99 %.
inline double deviations_of_all(Eigen::Index rows) {
  const double each = 0.01 / static_cast<double>(rows > 0 ? rows : 1);
  double low = 0.0;
  double high = 40.0;
  for (int step = 0; step < 60; ++step) {
    const double middle = 0.5 * (low + high);
    (std::erfc(middle / std::numbers::sqrt2) > each ? low : high) = middle;
  }
  return high;
}

}  // namespace interglow::radiosity
