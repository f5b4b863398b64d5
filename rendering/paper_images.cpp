// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/paper_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>
#include <utility>

#include "diagnostics/error.h"

namespace interglow::rendering {
namespace {

using radiosity::RowMatrix;

/// Rows of the picture that are worked on at a time: enough to be quick, few enough to need no second picture in
/// memory.
constexpr int kRowsAtOnce = 16;

struct Block {
  std::size_t first_pixel = 0;
  Eigen::Index pixels = 0;
};

std::vector<Block> blocks_of(const image::SpectralImage& image) {
  std::vector<Block> blocks;
  for (int row = 0; row < image.height; row += kRowsAtOnce) {
    const int rows = std::min(kRowsAtOnce, image.height - row);
    blocks.push_back({static_cast<std::size_t>(row) * static_cast<std::size_t>(image.width),
                      static_cast<Eigen::Index>(rows) * image.width});
  }
  return blocks;
}

auto rows_of(image::SpectralImage& image, const Block& block) {
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<Rows>(image.value.data() + block.first_pixel * static_cast<std::size_t>(image.bands()),
                          block.pixels, image.bands());
}

auto rows_of(const image::SpectralImage& image, const Block& block) {
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const Rows>(image.value.data() + block.first_pixel * static_cast<std::size_t>(image.bands()),
                                block.pixels, image.bands());
}

std::vector<int> objects_of(const RenderedImages& images, const Block& block) {
  const auto first = images.object.begin() + static_cast<std::ptrdiff_t>(block.first_pixel);
  return {first, first + block.pixels};
}

std::vector<radiosity::PaperFunctions> functions_of(const scene::Scene& scene) {
  if (scene.objects.size() != 2) {
    throw InvalidInput(
        fmt::format("model = \"paper\": the scene has {} objects; the paper's model is of two. Use model = \"exact\".",
                    scene.objects.size()));
  }
  return {camera_functions(scene, 0, 1), camera_functions(scene, 1, 0)};
}

}  // namespace

Eigen::VectorXd light_spectrum(const scene::Scene& scene) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(scene.grid.size());
  for (const scene::DirectionalLight& light : scene.directional_lights) sum += light.normal_irradiance;
  if (scene.sky) sum += std::numbers::pi * scene.sky->radiance;
  for (const scene::Object& object : scene.objects) {
    if (object.emits()) sum += object.exitance;
  }
  return sum;
}

radiosity::PaperFunctions camera_functions(const scene::Scene& scene, int i, int j) {
  const auto donaldson = [&](int object) -> const spectral::DonaldsonMatrix& {
    const auto material = static_cast<std::size_t>(scene.objects[static_cast<std::size_t>(object)].material);
    return scene.materials[material].donaldson;
  };
  radiosity::PaperFunctions functions = radiosity::paper_functions(donaldson(i), donaldson(j), light_spectrum(scene));
  const int last = scene.camera.last_band < 0 ? static_cast<int>(scene.grid.size()) - 1 : scene.camera.last_band;
  for (Eigen::VectorXd* f :
       {&functions.re, &functions.rr, &functions.le, &functions.lr, &functions.ll, &functions.rl}) {
    *f = f->segment(scene.camera.first_band, last - scene.camera.first_band + 1).eval();
  }
  return functions;
}

radiosity::ShadingTerms paper_shading_terms(const scene::Scene& scene, const RenderedImages& images) {
  const auto functions = functions_of(scene);
  const auto pixels = static_cast<Eigen::Index>(images.object.size());
  radiosity::ShadingTerms terms{Eigen::VectorXd::Zero(pixels), Eigen::VectorXd::Zero(pixels), 0.0};
  for (const Block& block : blocks_of(images.total)) {
    RowMatrix spectra = rows_of(images.re, block).cast<double>();
    if (!images.rr.value.empty()) spectra += rows_of(images.rr, block).cast<double>();
    const auto found = radiosity::shading_terms(spectra, objects_of(images, block), functions);
    terms.re.segment(static_cast<Eigen::Index>(block.first_pixel), block.pixels) = found.re;
    terms.rr.segment(static_cast<Eigen::Index>(block.first_pixel), block.pixels) = found.rr;
    terms.relative_residual = std::max(terms.relative_residual, found.relative_residual);
  }
  return terms;
}

RenderedImages paper_images(const scene::Scene& scene, const RenderedImages& exact, double w_over_w_prime) {
  const auto functions = functions_of(scene);
  const radiosity::ShadingTerms terms = paper_shading_terms(scene, exact);
  RenderedImages paper;
  paper.total = exact.total;
  for (image::SpectralImage* part : {&paper.re, &paper.rr, &paper.le, &paper.lr, &paper.ll, &paper.rl})
    *part = exact.total;
  for (const Block& block : blocks_of(exact.total)) {
    const auto first = static_cast<Eigen::Index>(block.first_pixel);
    const radiosity::ShadingTerms here{terms.re.segment(first, block.pixels), terms.rr.segment(first, block.pixels),
                                       0.0};
    const radiosity::Components parts =
        radiosity::synthesize(here, objects_of(exact, block), functions, w_over_w_prime);
    RowMatrix total = RowMatrix::Zero(block.pixels, exact.total.bands());
    const auto put = [&](image::SpectralImage& image, const RowMatrix& values) {
      rows_of(image, block) = values.cast<float>();
      total += values;
    };
    put(paper.re, parts.re);
    put(paper.rr, parts.rr);
    put(paper.le, parts.le);
    put(paper.lr, parts.lr);
    put(paper.ll, parts.ll);
    put(paper.rl, parts.rl);
    rows_of(paper.total, block) = total.cast<float>();
  }
  paper.emission = exact.emission;
  paper.coverage = exact.coverage;
  paper.object = exact.object;
  paper.report = exact.report;
  return paper;
}

}  // namespace interglow::rendering
