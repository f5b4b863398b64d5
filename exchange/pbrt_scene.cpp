// SPDX-License-Identifier: GPL-3.0-or-later
// Conventions: pbrt's camera frame is left-handed, so that a picture of a right-handed world is mirrored unless x is
// turned round before the look-at. Its fov is that of the narrower side of the picture. It divides the spectrum of
// every light by its luminance, which "scale" undoes.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "exchange/scene_text.h"
#include "spectral/observer.h"

namespace interglow::exchange::detail {
namespace {

/// What pbrt takes for "all bounces": the contribution of longer paths is below a float's rounding unless a closed room
/// reflects more than 0.98.
constexpr int kManyBounces = 1000;

double at(const PolyLine& line, double wavelength_nm) {
  const auto& nodes = line.wavelength_nm;
  if (wavelength_nm < nodes.front() || wavelength_nm > nodes.back()) return 0.0;
  const auto right = std::max<std::ptrdiff_t>(
      1, std::distance(nodes.begin(), std::lower_bound(nodes.begin(), nodes.end(), wavelength_nm)));
  const auto i = static_cast<std::size_t>(right);
  const double t = (wavelength_nm - nodes[i - 1]) / (nodes[i] - nodes[i - 1]);
  return (1.0 - t) * line.value[i - 1] + t * line.value[i];
}

/// Σ ȳ(λ) L(λ) over whole nanometres from 360 to 830, as pbrt computes it.
double luminance(const PolyLine& line) {
  const auto grid = spectral::WavelengthGrid::uniform(360.0, 830.0, 1.0);
  const Eigen::VectorXd y = spectral::cie1931_weights(grid).col(1);
  double sum = 0.0;
  for (Eigen::Index i = 0; i < grid.size(); ++i) sum += y[i] * at(line, grid.center_nm(i));
  return sum;
}

class Writer {
 public:
  Writer(const scene::Scene& scene, const RendererExportParams& params) : scene_(scene), params_(params) {}

  std::string write() {
    add("# Made by interglow export. Lengths in mm, radiance in W m^-2 sr^-1 nm^-1. Render with: pbrt scene.pbrt\n");
    add_camera();
    add("Integrator \"path\" \"integer maxdepth\" [ {} ]\n", params_.bounces ? *params_.bounces + 1 : kManyBounces);
    add("WorldBegin\n");
    for (const scene::DirectionalLight& light : scene_.directional_lights) {
      add("LightSource \"distant\" \"point3 from\" [ {} ] \"point3 to\" [ 0 0 0 ]\n", text(-light.direction, " "));
      add_light_spectrum(light.normal_irradiance);
    }
    if (scene_.sky) {
      add("LightSource \"infinite\"\n");
      add_light_spectrum(scene_.sky->radiance);
    }
    for (std::size_t object = 0; object < scene_.objects.size(); ++object) add_object(object);
    return std::move(text_);
  }

 private:
  template <typename... Values>
  void add(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Values>(values)...);
  }

  void add_spectrum(const char* name, const PolyLine& line) {
    add("  \"spectrum {}\" [", name);
    for (std::size_t i = 0; i < line.value.size(); ++i) add(" {} {}", line.wavelength_nm[i], line.value[i]);
    add(" ]\n");
  }

  void add_light_spectrum(const Eigen::VectorXd& bands) {
    const PolyLine line = poly_line(scene_.grid, bands);
    add_spectrum("L", line);
    add("  \"float scale\" [ {} ]\n", luminance(line));
  }

  void add_camera() {
    const scene::Camera& camera = scene_.camera;
    const double half = std::tan(0.5 * camera.horizontal_fov_deg * std::numbers::pi / 180.0);
    const double narrower = half * std::min(1.0, static_cast<double>(camera.height) / camera.width);
    add("Scale -1 1 1\n");
    add("LookAt {}\n  {}\n  {}\n", text(camera.position, " "), text(camera.target, " "), text(camera.up, " "));
    add("Camera \"perspective\" \"float fov\" [ {} ]\n", camera.width <= camera.height
                                                             ? camera.horizontal_fov_deg
                                                             : 2.0 * std::atan(narrower) * 180.0 / std::numbers::pi);
    const int last = camera.last_band < 0 ? static_cast<int>(scene_.grid.size()) - 1 : camera.last_band;
    add("Film \"spectral\" \"string filename\" [ \"image.exr\" ] \"integer xresolution\" [ {} ] \"integer "
        "yresolution\" "
        "[ {} ]\n  \"integer nbuckets\" [ {} ] \"float lambdamin\" [ {} ] \"float lambdamax\" [ {} ]\n",
        camera.width, camera.height, last - camera.first_band + 1, scene_.grid.lower_edge_nm(camera.first_band),
        scene_.grid.upper_edge_nm(last));
    add("PixelFilter \"box\" \"float xradius\" [ 0.5 ] \"float yradius\" [ 0.5 ]\n");
    add("Sampler \"independent\" \"integer pixelsamples\" [ {} ]\n", params_.samples_per_pixel);
  }

  void add_object(std::size_t index) {
    const scene::Object& object = scene_.objects[index];
    add("AttributeBegin\n");
    if (object.emits()) {
      add("AreaLightSource \"diffuse\"\n");
      add_light_spectrum(object.exitance / std::numbers::pi);
    }
    add("Material \"diffuse\"\n");
    add_spectrum(
        "reflectance",
        poly_line(scene_.grid, scene_.materials[static_cast<std::size_t>(object.material)].donaldson.reflectance));
    add("Shape \"plymesh\" \"string filename\" [ \"{}\" ]\nAttributeEnd\n", mesh_file(scene_, index));
  }

  const scene::Scene& scene_;
  const RendererExportParams& params_;
  std::string text_;
};

}  // namespace

std::string pbrt_scene(const scene::Scene& scene, const RendererExportParams& params) {
  return Writer(scene, params).write();
}

}  // namespace interglow::exchange::detail
