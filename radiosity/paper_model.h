// SPDX-License-Identifier: GPL-3.0-or-later
/// The appearance model of Tominaga & Guarnera 2021: two shading terms from a scene without fluorescence, and the five
/// components synthesised from them with spectral functions. Works on any rows of spectra: elements or pixels.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "radiosity/solution.h"
#include "spectral/donaldson_matrix.h"

namespace interglow::radiosity {

/// Which spectral functions the luminescent components get.
enum class PaperLuminescence {
  kSeparate,  ///< equations 4 and 5: C_i1 α_i by direct light, C_i2 α_i and C_i3 α_i by light from the other object
  kMerged,    ///< equations 6 and 11: (C_i1 + C_i2 + C_i3) α_i for both, which counts excitation twice
};

/// Spectral functions of object i beside object j under the illuminant E, one value a band (equations 4 and 5,
/// integrals as products with the Donaldson matrix, which need not be a product of α and β).
struct PaperFunctions {
  Eigen::VectorXd re;  ///< S_i E
  Eigen::VectorXd rr;  ///< S_i S_j E
  Eigen::VectorXd le;  ///< C_i1 α_i = D_L,i E
  Eigen::VectorXd lr;  ///< C_i2 α_i = D_L,i S_j E
  Eigen::VectorXd ll;  ///< C_i3 α_i = D_L,i D_L,j E
  Eigen::VectorXd rl;  ///< C_i4 S_i α_j = S_i D_L,j E
};

/// @throws InvalidParams if the numbers of bands differ
PaperFunctions paper_functions(const spectral::DonaldsonMatrix& own, const spectral::DonaldsonMatrix& other,
                               const Eigen::VectorXd& illuminant,
                               PaperLuminescence luminescence = PaperLuminescence::kSeparate);

/// The materials with S as it is and nothing luminescent: what the shading terms are simulated with.
std::vector<spectral::Material> without_luminescence(std::vector<spectral::Material> materials);

/// f_re and f_rr of every row.
struct ShadingTerms {
  Eigen::VectorXd re;
  Eigen::VectorXd rr;
  double relative_residual = 0.0;  ///< |y - f_re a_1 - f_rr a_2| / |y| over all rows that belong to an object
};

/// Least squares per row: y = f_re S_i E + f_rr S_i S_j E (equation 12).
///
/// @param spectra     rows x bands, radiosity or radiance of the scene without fluorescence
/// @param row_object  index into `functions`; -1: background, both terms 0
/// @throws InvalidInput naming the object if its two functions are proportional to 1e-6 (S_j is grey): nothing tells
/// the terms apart Cost O(rows × bands). Same bits for any number of threads.
ShadingTerms shading_terms(const RowMatrix& spectra, const std::vector<int>& row_object,
                           const std::vector<PaperFunctions>& functions);

/// Mean f_rr over mean f_re of the rows in the region (one flag a row): w of a captured, w' of a simulated image.
/// @throws InvalidInput if the region has no direct light
double interreflection_ratio(const ShadingTerms& terms, const std::vector<char>& region);

/// Equations 10 and 13: f_le = f_re, f_lr = f_ll = f_rl = f_rr, all but the direct ones times w / w'.
Components synthesize(const ShadingTerms& terms, const std::vector<int>& row_object,
                      const std::vector<PaperFunctions>& functions, double w_over_w_prime = 1.0);

}  // namespace interglow::radiosity
