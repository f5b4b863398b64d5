// SPDX-License-Identifier: GPL-3.0-or-later
/// From band means on one set of bands to band means on another, conserving the integral.
#pragma once

#include <Eigen/Core>

namespace interglow::spectral {

/// Redistributes `mean`, the mean values over the adjoining bands between `edges`, to the bands between `new_edges`.
///
/// Within each band a parabola with the band's mean is laid between edge values that lie between the neighbouring
/// means, made monotone [colella-woodward-1984, eq. 1.10] (its integral is a monotone cubic through the cumulated
/// table). So the integral over every old band is kept exactly, no value leaves the range of the neighbouring means
/// (what is not negative stays so), and a band at a local extremum stays flat.
///
/// @param edges      n + 1, increasing;  mean: n
/// @param new_edges  m + 1, increasing; outside the old bands the table is 0
/// @returns m means: (1/width) times the integral over the new band
/// Cost O(n + m).
Eigen::VectorXd resample_means(const Eigen::VectorXd& edges, const Eigen::VectorXd& mean,
                               const Eigen::VectorXd& new_edges);

}  // namespace interglow::spectral
