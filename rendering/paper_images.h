// SPDX-License-Identifier: GPL-3.0-or-later
/// The model of Tominaga and Guarnera [tominaga2021] on the pixels of a rendered picture (radiosity/paper_model.h).
#pragma once

#include <Eigen/Core>

#include "radiosity/paper_model.h"
#include "rendering/render.h"
#include "scene/scene.h"

namespace interglow::rendering {

/// Sum of the spectra of all lights on the scene's grid: normal irradiance of beams, π radiance of the sky, exitance of
/// surfaces.
Eigen::VectorXd light_spectrum(const scene::Scene& scene);

/// Spectral functions of object i beside object j under the scene's light, in the bands of the camera.
radiosity::PaperFunctions camera_functions(const scene::Scene& scene, int i, int j);

/// f_re and f_rr [1/sr] of every pixel, by least squares of the picture without luminescence, re + rr (equation 12); 0
/// off the objects.
/// @throws InvalidInput if the scene has not two objects, or one is grey, so that the two terms of the other cannot be
/// told apart
radiosity::ShadingTerms paper_shading_terms(const scene::Scene& scene, const RenderedImages& images);

/// The picture as the paper synthesises it from these two terms and the spectral functions, f_rr times `w_over_w_prime`
/// (equations 10 and 13).
/// @returns images with these components; emission, coverage, object and report as given
/// @throws as paper_shading_terms
RenderedImages paper_images(const scene::Scene& scene, const RenderedImages& exact, double w_over_w_prime = 1.0);

}  // namespace interglow::rendering
