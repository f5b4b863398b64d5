// SPDX-License-Identifier: GPL-3.0-or-later
#include "cli/simulated_capture.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "cli/indirect_light.h"
#include "cli/run_pipeline.h"
#include "cross_check/path_tracer.h"
#include "diagnostics/error.h"
#include "files/atomic_file.h"
#include "image/band_folder.h"
#include "image/channel_file.h"
#include "image/envi.h"
#include "image/mat_file.h"
#include "image/spectral_exr.h"
#include "verification/check_scene.h"

namespace interglow::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// What the camera looks at.
struct IdealPicture {
  scene::Scene scene;
  image::SpectralImage radiance;
  std::vector<float> coverage;  ///< height × width
  std::optional<rendering::ContactRatio> contact;
  double relative_error = 0.0;  ///< of the path tracer, mean over lit pixels; 0 for radiosity
};

void scale_camera(scene::Camera& camera, int size) {
  const double factor = static_cast<double>(size) / std::max(camera.width, camera.height);
  camera.width = std::max(1, static_cast<int>(std::lround(camera.width * factor)));
  camera.height = std::max(1, static_cast<int>(std::lround(camera.height * factor)));
}

IdealPicture render_by_radiosity(const scene::SceneDescription& description, double scale, const Progress& progress) {
  RunOutcome run = run_scene(description, progress);
  return {run.built.scene, with_indirect_scaled(run.images, scale), run.images.coverage, run.contact, 0.0};
}

IdealPicture render_by_paths(const scene::SceneDescription& description, int paths, std::uint64_t seed, double scale,
                             const Progress& progress) {
  using cross_check::Channel;
  const scene::Scene built = scene::build_scene(description, progress).scene;
  IdealPicture picture;
  picture.scene = verification::check_scene(built, std::max(built.camera.width, built.camera.height));
  // At least 4 batches for a standard error; larger batches are stratified better.
  constexpr int kBatches = 4;
  cross_check::PathTracer tracer(picture.scene, {.bounces = description.solve.bounces,
                                                 .samples_per_batch = std::max(1, (paths + kBatches - 1) / kBatches),
                                                 .seed = seed,
                                                 .components = scale != 1.0});
  tracer.add_batches(kBatches, progress);
  const cross_check::Estimate total = tracer.estimate(Channel::kTotal);
  std::vector<image::SpectralImage> indirect;
  if (scale != 1.0) {
    for (const Channel channel : {Channel::kRr, Channel::kLr, Channel::kLl, Channel::kRl})
      indirect.push_back(tracer.estimate(channel).mean);
  }
  std::vector<const image::SpectralImage*> parts;
  for (const image::SpectralImage& part : indirect) parts.push_back(&part);
  picture.radiance = with_parts_scaled(total.mean, parts, scale);
  double light = 0.0, error = 0.0;
  for (std::size_t p = 0; p < total.integral_mean.size(); ++p) {
    picture.coverage.push_back(total.integral_mean[p] > 0.0 ? 1.0F : 0.0F);
    light += total.integral_mean[p];
    error += total.integral_standard_error[p];
  }
  picture.relative_error = light > 0.0 ? error / light : 0.0;
  return picture;
}

/// Radiance of a matte white target that faces the beams, in the camera's bands.
Eigen::VectorXd white_radiance(const scene::Scene& scene, double reflectance, Eigen::Index bands) {
  Eigen::VectorXd radiance = Eigen::VectorXd::Zero(scene.grid.size());
  for (const scene::DirectionalLight& light : scene.directional_lights)
    radiance += reflectance / std::numbers::pi * light.normal_irradiance;
  if (scene.sky) radiance += reflectance * scene.sky->radiance;
  if (!(radiance.maxCoeff() > 0.0)) {
    throw InvalidInput(
        "The scene has neither beam nor sky, so it is not known what lights a white target. Leave --white-frames out.");
  }
  return radiance.segment(scene.camera.first_band, bands);
}

/// Writes a frame and returns the name that the description gives it.
std::string write_frame(const fs::path& folder, const std::string& name, const image::SpectralImage& frame,
                        const std::string& format) {
  if (format == "mat") {
    image::write_mat(folder / (name + ".mat"), frame, image::MatType::kUint16);
    return name + ".mat";
  }
  if (format == "envi") {
    image::write_envi(folder / (name + ".img"), frame,
                      {.type = image::EnviType::kUint16, .description = "counts of a simulated camera"});
    return name + ".hdr";
  }
  image::write_band_folder(folder / name, frame, "." + format);
  return name;
}

fitting::Affine misalignment(const SimulatedCaptureRequest& request, const image::SpectralImage& picture) {
  const Eigen::Vector2d middle(0.5 * (picture.width - 1), 0.5 * (picture.height - 1));
  fitting::Affine map;
  map.linear = request.scale * Eigen::Rotation2Dd(request.turn_deg * std::numbers::pi / 180.0).toRotationMatrix();
  map.shift = middle - map.linear * middle + request.shift_px;
  // Without misalignment nothing is resampled, so the map is to be exactly the identity.
  if (map.linear.isIdentity(0.0)) map.shift = request.shift_px;
  return map;
}

std::vector<std::uint16_t> sensor_mask(const IdealPicture& picture, const fitting::Affine& ideal_from_sensor) {
  std::vector<std::uint16_t> mask;
  for (int y = 0; y < picture.radiance.height; ++y) {
    for (int x = 0; x < picture.radiance.width; ++x) {
      const Eigen::Vector2d at = ideal_from_sensor(Eigen::Vector2d(x, y));
      const long column = std::lround(at.x()), row = std::lround(at.y());
      const bool inside = column >= 0 && row >= 0 && column < picture.radiance.width && row < picture.radiance.height;
      const bool object =
          inside && picture.coverage[static_cast<std::size_t>(row) * static_cast<std::size_t>(picture.radiance.width) +
                                     static_cast<std::size_t>(column)] >= 0.5F;
      mask.push_back(object ? 65535 : 0);
    }
  }
  return mask;
}

template <typename Vector>
json list(const Vector& values) {
  return std::vector<double>(values.begin(), values.end());
}

json camera_json(const scene::Camera& camera) {
  return {{"position_mm", list(camera.position)},
          {"target_mm", list(camera.target)},
          {"up", list(camera.up)},
          {"horizontal_fov_deg", camera.horizontal_fov_deg},
          {"width_px", camera.width},
          {"height_px", camera.height}};
}

json truth_json(const SimulatedCaptureRequest& request, const IdealPicture& picture,
                const fitting::SensorOutput& output) {
  const fitting::SensorParams& sensor = request.sensor;
  const fitting::Affine& map = sensor.ideal_from_sensor;
  json lights = json::array();
  for (const scene::DirectionalLight& light : picture.scene.directional_lights) {
    lights.push_back({{"name", light.name},
                      {"direction", list(light.direction)},
                      {"half_angle_deg", light.half_angle_rad * 180.0 / std::numbers::pi},
                      {"irradiance_w_per_m2", light.normal_irradiance.dot(picture.scene.grid.widths_nm())}});
  }
  json truth = {
      {"command", request.command_line},
      {"version", INTERGLOW_VERSION},
      {"method", request.paths > 0 ? "path tracer" : "radiosity"},
      {"camera", camera_json(picture.scene.camera)},
      {"lights", lights},
      {"wavelengths_nm", list(picture.radiance.wavelength_nm)},
      {"w_over_w_simulated", request.indirect_scale},
      {"sensor",
       {{"bits", sensor.bits},
        {"seed", sensor.seed},
        {"read_sigma_counts", output.noise.read_sigma},
        {"shot_gain_counts_per_electron", output.noise.shot_gain},
        {"response_sigma", sensor.response_sigma},
        {"black_counts", sensor.black_counts},
        {"blur_px", sensor.blur_px},
        {"glare", sensor.glare},
        {"stray", sensor.stray},
        {"offset_counts", list(output.offset_counts)},
        {"band_gain", list(output.band_gain)},
        {"exposure", list(output.exposure)},
        {"counts_per_radiance", list(output.counts_per_radiance)},
        {"saturated_share", output.saturated_share},
        {"ideal_from_sensor",
         {{map.linear(0, 0), map.linear(0, 1), map.shift.x()}, {map.linear(1, 0), map.linear(1, 1), map.shift.y()}}}}}};
  if (request.paths > 0) truth["path_tracer"] = {{"paths", request.paths}, {"relative_error", picture.relative_error}};
  if (picture.contact) {
    truth["contact"] = {{"w_simulated", picture.contact->w},
                        {"distance_mm", picture.contact->distance_mm},
                        {"pixels", picture.contact->pixels}};
  }
  return truth;
}

std::string quoted(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "\"" : ", \"") + name + "\"";
  return "[" + text + "]";
}

std::string description_text(const SimulatedCaptureRequest& request, const fitting::SensorOutput& output,
                             const std::string& object, const std::vector<std::string>& dark,
                             const std::vector<std::string>& white) {
  std::string text = fmt::format(
      "# Simulated; what the camera really did stands in truth.json.\nobject = \"{}\"\nbits = {}\nlinear = true\n",
      object, request.sensor.bits);
  text += dark.empty() ? fmt::format("dark_level = {}\n", request.sensor.black_counts)
                       : fmt::format("dark = {}\n", quoted(dark));
  if (!white.empty())
    text += fmt::format("white = {}\nwhite_reflectance = {}\n", quoted(white), request.white_reflectance);
  if (request.sensor.expose_bands)
    text += fmt::format("exposure = [{}]\n",
                        fmt::join(std::vector<double>(output.exposure.begin(), output.exposure.end()), ", "));
  text += fmt::format("\n[noise]\nread_sigma = {}\nshot_gain = {}\n", output.noise.read_sigma, output.noise.shot_gain);
  // White frames take the pattern of the pixels out.
  if (output.noise.relative_sigma > 0.0 && white.empty())
    text += fmt::format("relative_sigma = {}\n", output.noise.relative_sigma);
  return text;
}

/// What the camera saw, in radiance, for people to look at.
image::SpectralImage as_radiance(const fitting::SensorOutput& output, double black_counts) {
  image::SpectralImage image = output.frames.object;
  const auto bands = static_cast<std::size_t>(image.bands());
  for (std::size_t v = 0; v < image.value.size(); ++v) {
    image.value[v] = static_cast<float>((image.value[v] - black_counts) /
                                        output.counts_per_radiance[static_cast<Eigen::Index>(v % bands)]);
  }
  return image;
}

}  // namespace

std::string write_simulated_capture(SimulatedCaptureRequest request, const Progress& progress) {
  fitting::validate(request.sensor);
  const auto require = [](bool holds, const char* option, double value, const char* expected) {
    if (!holds) throw InvalidParams(fmt::format("{} {}: expected {}.", option, value, expected));
  };
  if (request.size) require(*request.size >= 4 && *request.size <= 1 << 14, "--size", *request.size, "4 to 16384");
  if (request.edge_length_mm)
    require(*request.edge_length_mm > 0.0, "--edge-length", *request.edge_length_mm, "a length above 0");
  require(request.paths >= 0 && request.paths <= 1 << 20, "--path-traced", request.paths, "0 to 1048576 paths");
  require(request.indirect_scale >= 0.0 && request.indirect_scale <= 100.0, "--w-ratio", request.indirect_scale,
          "0 to 100");
  require(request.white_reflectance > 0.0 && request.white_reflectance <= 1.2, "--white-reflectance",
          request.white_reflectance, "above 0, at most 1.2");

  scene::SceneDescription description = scene::read_scene_file(request.scene);
  if (request.size) scale_camera(description.camera, *request.size);
  if (request.edge_length_mm) {
    for (scene::ObjectDescription& object : description.objects) {
      const bool given = object.remesh == scene::RemeshKind::kNone;
      (given ? object.subdivide_mm : object.edge_length_mm) = request.edge_length_mm;
      object.patches.reset();
    }
  }
  const IdealPicture picture = request.paths > 0 ? render_by_paths(description, request.paths, request.sensor.seed,
                                                                   request.indirect_scale, progress)
                                                 : render_by_radiosity(description, request.indirect_scale, progress);
  request.sensor.ideal_from_sensor = misalignment(request, picture.radiance);
  const Eigen::VectorXd white =
      request.sensor.white_frames > 0
          ? white_radiance(picture.scene, request.white_reflectance, picture.radiance.wavelength_nm.size())
          : Eigen::VectorXd();
  const fitting::SensorOutput output = fitting::simulate_sensor(picture.radiance, request.sensor, white);

  const std::string object = write_frame(request.out, "object", output.frames.object, request.format);
  std::vector<std::string> dark_names, white_names;
  for (std::size_t i = 0; i < output.frames.dark.size(); ++i)
    dark_names.push_back(
        write_frame(request.out, fmt::format("dark_{}", i + 1), output.frames.dark[i], request.format));
  for (std::size_t i = 0; i < output.frames.white.size(); ++i)
    white_names.push_back(
        write_frame(request.out, fmt::format("white_{}", i + 1), output.frames.white[i], request.format));
  const image::Attributes attributes = {{"Software", "interglow " INTERGLOW_VERSION},
                                        {"interglow:command", request.command_line}};
  image::write_grey_words(request.out / "mask.png", picture.radiance.width, picture.radiance.height,
                          sensor_mask(picture, request.sensor.ideal_from_sensor));
  image::write_spectral_exr(request.out / "ideal.exr", picture.radiance, attributes);
  image::write_png(request.out / "preview.png", image::make_preview(as_radiance(output, request.sensor.black_counts)),
                   attributes);
  files::write_text_atomically(request.out / "capture.toml",
                               description_text(request, output, object, dark_names, white_names));
  // truth.json comes last: where it is, everything else is there.
  files::write_text_atomically(request.out / "truth.json", truth_json(request, picture, output).dump(2) + "\n");

  const double brightest =
      request.sensor.peak * (std::ldexp(1.0, request.sensor.bits) - 1.0 - request.sensor.black_counts);
  return fmt::format(
      "{} × {} pixels, {} bands from {} to {} nm; signal to noise {:.0f} where it is brightest; {:.2f} % "
      "saturated\n{}\n",
      picture.radiance.width, picture.radiance.height, picture.radiance.bands(), picture.radiance.wavelength_nm[0],
      picture.radiance.wavelength_nm[picture.radiance.bands() - 1],
      brightest / std::sqrt(output.noise.variance(brightest)), 100.0 * output.saturated_share,
      (request.out / "capture.toml").string());
}

}  // namespace interglow::cli
