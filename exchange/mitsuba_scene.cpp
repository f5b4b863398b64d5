// SPDX-License-Identifier: GPL-3.0-or-later
// Conventions: Mitsuba's diffuse surfaces and area emitters have one side, the one of the normal (counter-clockwise
// corners), and their backs are black, as here. Its camera looks along +z with +x to the left of the picture, so that
// a look-at gives a picture that is not mirrored.
#include <fmt/format.h>

#include <iterator>
#include <numbers>

#include "exchange/scene_text.h"

namespace interglow::exchange::detail {
namespace {

/// Keys are written in snake_case by Mitsuba 3 and in camelCase by 0.6.
struct Words {
  const char *version, *fov_axis, *to_world, *pixel_format, *component_format, *sample_count, *max_depth, *rr_depth,
      *face_normals;
};
constexpr Words kWords3{"3.0.0",        "fov_axis",  "to_world", "pixel_format", "component_format",
                        "sample_count", "max_depth", "rr_depth", "face_normals"};
constexpr Words kWords06{"0.6.0",       "fovAxis",  "toWorld", "pixelFormat", "componentFormat",
                         "sampleCount", "maxDepth", "rrDepth", "faceNormals"};

class Writer {
 public:
  Writer(const scene::Scene& scene, Renderer renderer, const RendererExportParams& params)
      : scene_(scene), params_(params), is_3_(renderer == Renderer::kMitsuba3), words_(is_3_ ? kWords3 : kWords06) {}

  std::string write() {
    add("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n");
    add("<!-- Made by interglow export. Lengths in mm, radiance in W m^-2 sr^-1 nm^-1. Render with: {} -->\n",
        is_3_ ? "mitsuba -m scalar_spectral -o image.exr scene.xml" : "mitsuba -o image.exr scene.xml");
    add("<scene version=\"{}\">\n", words_.version);
    add_integrator();
    add_sensor();
    for (const scene::DirectionalLight& light : scene_.directional_lights) {
      add("<emitter type=\"directional\">\n<vector name=\"direction\" x=\"{}\" y=\"{}\" z=\"{}\"/>\n",
          light.direction.x(), light.direction.y(), light.direction.z());
      add_spectrum("irradiance", light.normal_irradiance);
      add("</emitter>\n");
    }
    if (scene_.sky) {
      add("<emitter type=\"constant\">\n");
      add_spectrum("radiance", scene_.sky->radiance);
      add("</emitter>\n");
    }
    for (std::size_t object = 0; object < scene_.objects.size(); ++object) add_object(object);
    add("</scene>\n");
    return std::move(text_);
  }

 private:
  template <typename... Values>
  void add(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Values>(values)...);
  }

  void add_spectrum(const char* name, const Eigen::VectorXd& bands) {
    const PolyLine line = poly_line(scene_.grid, bands);
    if (is_3_) {
      // The plugin by its name: the short form with value="..." scales emitters to a luminance of 1.
      add("<spectrum name=\"{}\" type=\"irregular\">\n<string name=\"wavelengths\" value=\"{}\"/>\n"
          "<string name=\"values\" value=\"{}\"/>\n</spectrum>\n",
          name, joined(line.wavelength_nm, ", "), joined(line.value, ", "));
      return;
    }
    add("<spectrum name=\"{}\" value=\"", name);
    for (std::size_t i = 0; i < line.value.size(); ++i) {
      add("{}{}:{}", i == 0 ? "" : ", ", line.wavelength_nm[i], line.value[i]);
    }
    add("\"/>\n");
  }

  void add_integrator() {
    // A path of depth 2 is direct light. Roulette depends on the throughput, so that it starts late.
    const int depth = params_.bounces ? *params_.bounces + 2 : -1;
    add("<integrator type=\"path\">\n<integer name=\"{}\" value=\"{}\"/>\n<integer name=\"{}\" value=\"10\"/>\n",
        words_.max_depth, depth, words_.rr_depth);
    add("</integrator>\n");
  }

  void add_sensor() {
    const scene::Camera& camera = scene_.camera;
    add("<sensor type=\"perspective\">\n<float name=\"fov\" value=\"{}\"/>\n<string name=\"{}\" value=\"x\"/>\n",
        camera.horizontal_fov_deg, words_.fov_axis);
    add("<transform name=\"{}\"><lookat origin=\"{}\" target=\"{}\" up=\"{}\"/></transform>\n", words_.to_world,
        text(camera.position, ", "), text(camera.target, ", "), text(camera.up, ", "));
    add("<sampler type=\"independent\"><integer name=\"{}\" value=\"{}\"/></sampler>\n", words_.sample_count,
        params_.samples_per_pixel);
    add("<film type=\"hdrfilm\">\n<integer name=\"width\" value=\"{}\"/>\n<integer name=\"height\" value=\"{}\"/>\n"
        "<string name=\"{}\" value=\"luminance\"/>\n<string name=\"{}\" value=\"float32\"/>\n",
        camera.width, camera.height, words_.pixel_format, words_.component_format);
    if (!is_3_) add("<boolean name=\"banner\" value=\"false\"/>\n");
    add("<rfilter type=\"box\"/>\n</film>\n</sensor>\n");
  }

  void add_object(std::size_t index) {
    const scene::Object& object = scene_.objects[index];
    const bool two_sided = object.sides == scene::Sides::kTwo;
    add("<shape type=\"ply\">\n<string name=\"filename\" value=\"{}\"/>\n<boolean name=\"{}\" value=\"true\"/>\n",
        mesh_file(scene_, index), words_.face_normals);
    if (two_sided) add("<bsdf type=\"twosided\">\n");
    add("<bsdf type=\"diffuse\">\n");
    add_spectrum("reflectance", scene_.materials[static_cast<std::size_t>(object.material)].donaldson.reflectance);
    add("</bsdf>\n");
    if (two_sided) add("</bsdf>\n");
    if (object.emits()) {
      add("<emitter type=\"area\">\n");
      add_spectrum("radiance", object.exitance / std::numbers::pi);
      add("</emitter>\n");
    }
    add("</shape>\n");
  }

  const scene::Scene& scene_;
  const RendererExportParams& params_;
  bool is_3_;
  Words words_;
  std::string text_;
};

}  // namespace

std::string mitsuba_scene(const scene::Scene& scene, Renderer renderer, const RendererExportParams& params) {
  return Writer(scene, renderer, params).write();
}

}  // namespace interglow::exchange::detail
