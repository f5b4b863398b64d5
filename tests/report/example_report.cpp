// SPDX-License-Identifier: GPL-3.0-or-later
// Writes a page with every kind of section to standard output, for the browser test.
#include <cmath>
#include <cstdio>

#include "report/packing.h"
#include "report/page.h"

namespace {

using interglow::image::SpectralImage;
using interglow::report::Json;

constexpr int kWidth = 512, kHeight = 384, kBands = 61;

SpectralImage picture(double factor) {
  SpectralImage image{kWidth, kHeight, Eigen::VectorXd::LinSpaced(kBands, 400, 700), {}};
  image.value.reserve(static_cast<std::size_t>(kWidth) * kHeight * kBands);
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      const double u = std::sin(0.02 * column) + 1.2;
      const double v = std::cos(0.03 * row) + 1.2;
      for (int b = 0; b < kBands; ++b) {
        const double t = b / 60.0;
        image.value.push_back(static_cast<float>(factor * 0.1 * (u * t + v * (1 - t))));
      }
    }
  }
  return image;
}

Json rgb(const char* name, const SpectralImage& image) {
  std::vector<float> values;
  for (std::size_t p = 0; p < static_cast<std::size_t>(kWidth) * kHeight; ++p) {
    for (const int band : {45, 30, 10}) values.push_back(image.value[p * kBands + static_cast<std::size_t>(band)]);
  }
  return {{"name", name},
          {"kind", "rgb"},
          {"unit", "(linear sRGB)"},
          {"values", interglow::report::pack_half(values, {kHeight, kWidth, 3})}};
}

}  // namespace

int main() {
  const SpectralImage a = picture(1.0);
  const SpectralImage b = picture(1.01);
  const SpectralImage error = picture(0.02);
  std::vector<float> difference(static_cast<std::size_t>(kWidth) * kHeight, 1.0F);
  difference[100] = -1.0F;
  const Json map = {{"name", "Relative difference"},
                    {"kind", "map"},
                    {"unit", "%"},
                    {"range", {-2, 2}},
                    {"values", interglow::report::pack_half(difference, {kHeight, kWidth})}};
  Json document = {{"title", "Example report of examples/a_folder_with_a_long_name/scene_with_a_long_name.toml"},
                   {"subtitle", "Every kind of section"},
                   {"verdict", {{"state", "undecided"}, {"text", "This is an example; nothing was compared."}}},
                   {"footer", "Made by a test."}};
  document["sections"] = Json::array({
      {{"type", "viewer"},
       {"title", "Pictures"},
       {"width", kWidth},
       {"height", kHeight},
       {"spectral_unit", "W m⁻² sr⁻¹ nm⁻¹"},
       {"images", Json::array({rgb("Radiosity", a), rgb("Path tracer", b), map})},
       {"spectra", Json::array({{{"name", "Radiosity"}, {"mean", interglow::report::pack_spectra(a)}},
                                {{"name", "Path tracer"},
                                 {"mean", interglow::report::pack_spectra(b)},
                                 {"error", interglow::report::pack_spectra(error)}}})}},
      {{"type", "table"},
       {"title", "Verdicts"},
       {"columns",
        {"Region", "Verdict", "Difference [%]", "Interval ± [%]", "Bernstein ± [%]", "Discretisation [%]",
         "Reference [W m⁻² sr⁻¹]", "Detected"}},
       {"rows",
        {{"total, whole", {{"verdict", "agrees"}}, 0.12, 0.04321, 0.1234, 0.02345, 1.234, "no"},
         {"total, tile row 12 column 10", {{"verdict", "disagrees"}}, -3.214, 0.1234, "–", 1.234e-5, 0.001234, "yes"},
         {"total, band 420 nm", {{"verdict", "undecided"}}, 0.4321, 0.2345, "–", 0.3456, 1.234e-4, "no"}}}},
      {{"type", "forest"},
       {"title", "Equivalence"},
       {"margin", 0.5},
       {"unit", "%"},
       {"rows",
        Json::array({{{"name", "whole"}, {"value", 0.12}, {"low", 0.05}, {"high", 0.19}, {"verdict", "agrees"}},
                     {{"name", "tile 1"}, {"value", 3.2}, {"low", 2.5}, {"high", 3.9}, {"verdict", "disagrees"}}})}},
      {{"type", "chart"},
       {"title", "Error against time"},
       {"x", {{"label", "Time [s]"}, {"scale", "log"}}},
       {"y", {{"label", "Error [%]"}, {"scale", "log"}}},
       {"series", Json::array({{{"name", "Radiosity"}, {"points", true}, {"x", {0.1, 1, 10}}, {"y", {1.0, 0.3, 0.1}}},
                               {{"name", "Path tracer"},
                                {"points", true},
                                {"x", {0.2, 2, 20}},
                                {"y", {5.0, 1.6, 0.5}},
                                {"low", {4.0, 1.4, 0.4}},
                                {"high", {6.0, 1.8, 0.6}}}})}},
      {{"type", "chart"},
       {"title", "z histogram"},
       {"x", {{"label", "z"}}},
       {"y", {{"label", "Pixels"}}},
       {"series",
        Json::array({{{"name", "found"}, {"bars", true}, {"x", {-2, -1, 0, 1, 2}}, {"y", {5, 24, 40, 24, 6}}}})}},
      {{"type", "facts"},
       {"title", "Settings"},
       {"rows",
        {{"margin", 0.005},
         {"confidence", 0.99},
         {"SHA-256 of examples/a_folder_with_a_long_name/another_folder_with_a_long_name/floor_of_the_room.obj",
          "4bf5122f344554c53bde2ebb8cd2b7e3d1600ad631c385a5d7cce23c7785459a"}}}},
      {{"type", "text"},
       {"title", "What was not tested"},
       {"paragraphs", {"Nothing was tested."}},
       {"items",
        {"one", "Warning: examples/a_folder_with_a_long_name/another_folder_with_a_long_name/scene.toml:35: two"}}},
  });
  std::puts(interglow::report::html_page(document).c_str());
}
