// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/render.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <memory>
#include <numbers>
#include <optional>

#include "diagnostics/error.h"
#include "rendering/camera_rays.h"
#include "rendering/gather.h"
#include "rendering/irradiance_field.h"
#include "rendering/light_channels.h"
#include "rendering/primary_samples.h"
#include "rendering/surface.h"

namespace interglow::rendering {
namespace {

using radiosity::RowMatrix;

/// Seconds since construction.
class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Radiance spectra of one material per unit of each coefficient, in the camera's bands. Empty where there is none.
struct Palette {
  RowMatrix re, rr, le, lr, ll, rl;
};

Palette palette(const spectral::DonaldsonMatrix& donaldson, const RowMatrix& direct, const LightChannels& channels,
                int first_band, int bands) {
  const auto radiance_reflected = [&](const RowMatrix& light) -> RowMatrix {
    if (light.rows() == 0) return {};
    return (light * donaldson.reflectance.asDiagonal()).middleCols(first_band, bands) / std::numbers::pi;
  };
  const auto radiance_luminescent = [&](const RowMatrix& light) -> RowMatrix {
    if (light.rows() == 0 || !donaldson.luminesces()) return {};
    return (light * donaldson.luminescence.transpose()).middleCols(first_band, bands) / std::numbers::pi;
  };
  return {radiance_reflected(direct),
          radiance_reflected(channels.reflected_spectrum),
          radiance_luminescent(direct),
          radiance_luminescent(channels.reflected_spectrum),
          radiance_luminescent(channels.luminescent_spectrum),
          radiance_reflected(channels.luminescent_spectrum)};
}

/// Spectra of direct light per unit of its coefficient: beams, emitters, sky; lights x bands.
RowMatrix direct_spectra(const scene::Scene& scene, const LightChannels& channels) {
  const auto beams = static_cast<Eigen::Index>(scene.directional_lights.size());
  const auto emitters = static_cast<Eigen::Index>(channels.emitters.size());
  RowMatrix spectra(beams + emitters + (channels.sky ? 1 : 0), scene.grid.size());
  for (Eigen::Index b = 0; b < beams; ++b)
    spectra.row(b) = scene.directional_lights[static_cast<std::size_t>(b)].normal_irradiance;
  for (Eigen::Index e = 0; e < emitters; ++e) {
    spectra.row(beams + e) =
        scene.objects[static_cast<std::size_t>(channels.emitters[static_cast<std::size_t>(e)])].exitance;
  }
  if (channels.sky) spectra.row(beams + emitters) = std::numbers::pi * scene.sky->radiance;
  return spectra;
}

image::SpectralImage blank(const scene::Camera& camera, const Eigen::VectorXd& wavelength_nm) {
  image::SpectralImage picture;
  picture.width = camera.width;
  picture.height = camera.height;
  picture.wavelength_nm = wavelength_nm;
  picture.value.assign(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height) *
                           static_cast<std::size_t>(wavelength_nm.size()),
                       0.0F);
  return picture;
}

}  // namespace

void validate(const RenderParams& params) {
  if (params.samples_per_side < 1 || params.samples_per_side > 64) {
    throw InvalidParams(
        fmt::format("samples_per_side is {}, expected a whole number in [1, 64].", params.samples_per_side));
  }
  if (!(params.gather_tolerance >= 1e-9 && params.gather_tolerance <= 1.0)) {
    throw InvalidParams(fmt::format("gather_tolerance is {}, expected a value in [1e-9, 1].", params.gather_tolerance));
  }
}

RenderedImages render(const scene::Scene& scene, const radiosity::Elements& elements,
                      const radiosity::Solution& solution, const RenderParams& params, const Progress& progress) {
  validate(params);
  const CameraRays camera = camera_rays(scene.camera);
  const auto all_bands = static_cast<int>(scene.grid.size());
  const int first_band = scene.camera.first_band;
  const int last_band = scene.camera.last_band < 0 ? all_bands - 1 : scene.camera.last_band;
  if (first_band < 0 || last_band >= all_bands || first_band > last_band) {
    throw InvalidParams(
        fmt::format("camera: bands {} to {}, expected a range within 0 to {}.", first_band, last_band, all_bands - 1));
  }
  const int bands = last_band - first_band + 1;

  RenderedImages images;
  Stopwatch ray_time;
  const Surface surface(scene, elements);
  const radiosity::Visibility visibility(elements.faces);
  PrimarySamples samples = primary_samples(scene, camera, surface, visibility, params.samples_per_side, progress);
  images.report.seconds_rays = ray_time.seconds();

  Stopwatch gather_time;
  const LightChannels channels = light_channels(scene, elements, solution);
  const auto channel_count = static_cast<std::size_t>(channels.size());
  images.report.gather_channels = static_cast<int>(channel_count);
  // Of each face side: its material, or -1 where nothing is reflected.
  const auto material_of = [&](int side) {
    const int element = side % 2 != 0 ? elements.back_element[static_cast<std::size_t>(side / 2)]
                                      : elements.front_element[static_cast<std::size_t>(side / 2)];
    return element < 0 ? -1 : elements.material[static_cast<std::size_t>(element)];
  };
  std::optional<Gatherer> gatherer;
  std::optional<IrradianceField> field;
  if (channel_count > 0 && channels.mean_irradiance > 0.0) {
    const auto visible = [&] {
      std::vector<char> seen(2 * static_cast<std::size_t>(surface.face_count()), 0);
      for (const Sample& sample : samples.sample) {
        if (sample.side >= 0) seen[static_cast<std::size_t>(sample.side)] = 1;
      }
      std::vector<int> sides;
      for (int side = 0; side < 2 * surface.face_count(); ++side) {
        if (seen[static_cast<std::size_t>(side)] && material_of(side) >= 0) sides.push_back(side);
      }
      return sides;
    };
    const double tolerance = params.gather_tolerance * channels.mean_irradiance;
    gatherer.emplace(elements, visibility, channels.source, channels.strength, tolerance);
    field.emplace(surface, *gatherer, camera, channels.weight, tolerance);
    field->add(visible(), progress);
    divide_pixels(samples, field->bent_pixels(), scene, camera, surface, visibility, params.samples_per_side);
    // What only the further samples see. Where it bends, its pixels are divided already.
    field->add(visible(), progress);
    images.report.gather_points = static_cast<std::int64_t>(field->gather_points());
  }
  images.report.primary_rays = samples.rays;
  images.report.divided_pixels = samples.divided_pixels;
  images.report.seconds_gather = gather_time.seconds();

  Stopwatch pixel_time;
  const RowMatrix direct = direct_spectra(scene, channels);
  const auto direct_count = static_cast<std::size_t>(direct.rows());
  const std::size_t beam_count = scene.directional_lights.size();
  std::vector<Palette> palettes;
  bool luminesces = false;
  for (const spectral::Material& material : scene.materials) {
    palettes.push_back(palette(material.donaldson, direct, channels, first_band, bands));
    luminesces = luminesces || material.donaldson.luminesces();
  }

  const Eigen::VectorXd wavelength_nm = scene.grid.centers_nm().segment(first_band, bands);
  images.total = blank(scene.camera, wavelength_nm);
  const bool has_reflected = channels.reflected > 0;
  const bool has_luminescent = channels.luminescent > 0;
  if (direct_count > 0) images.re = blank(scene.camera, wavelength_nm);
  if (has_reflected) images.rr = blank(scene.camera, wavelength_nm);
  if (luminesces && direct_count > 0) images.le = blank(scene.camera, wavelength_nm);
  if (luminesces && has_reflected) images.lr = blank(scene.camera, wavelength_nm);
  if (luminesces && has_luminescent) images.ll = blank(scene.camera, wavelength_nm);
  if (has_luminescent) images.rl = blank(scene.camera, wavelength_nm);
  if (!channels.emitters.empty()) images.emission = blank(scene.camera, wavelength_nm);
  images.coverage.assign(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height), 0.0F);
  images.object.assign(images.coverage.size(), -1);

  const std::size_t coefficient_count =
      direct_count + static_cast<std::size_t>(channels.reflected + channels.luminescent);
  tbb::parallel_for(tbb::blocked_range<int>(0, camera.height, 4), [&](const tbb::blocked_range<int>& range) {
    std::vector<double> gathered(channel_count, 0.0);
    // Of each material in the pixel: direct lights, reflected modes, luminescent modes.
    std::vector<Eigen::VectorXd> coefficient(scene.materials.size(),
                                             Eigen::VectorXd::Zero(static_cast<Eigen::Index>(coefficient_count)));
    std::vector<double> object_share(scene.objects.size(), 0.0);
    std::vector<double> front_share(scene.objects.size(), 0.0);
    std::vector<int> materials;
    std::vector<int> objects;
    Eigen::RowVectorXd spectrum(bands);
    Eigen::RowVectorXd sum(bands);
    for (int row = range.begin(); row < range.end(); ++row) {
      for (int column = 0; column < camera.width; ++column) {
        const std::size_t pixel =
            static_cast<std::size_t>(row) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(column);
        const double share = 1.0 / static_cast<double>(samples.first[pixel + 1] - samples.first[pixel]);
        materials.clear();
        objects.clear();
        for (std::size_t s = samples.first[pixel]; s < samples.first[pixel + 1]; ++s) {
          const Sample& sample = samples.sample[s];
          if (sample.side < 0) continue;
          const int face = sample.side / 2;
          const bool back = sample.side % 2 != 0;
          const auto object = static_cast<std::size_t>(surface.object(face));
          if (object_share[object] == 0.0) objects.push_back(static_cast<int>(object));
          object_share[object] += share;
          if (!back) front_share[object] += share;
          const int material = material_of(sample.side);
          if (material < 0) continue;
          Eigen::VectorXd& amount = coefficient[static_cast<std::size_t>(material)];
          if (std::find(materials.begin(), materials.end(), material) == materials.end()) {
            materials.push_back(material);
            amount.setZero();
          }
          for (std::size_t b = 0; b < beam_count; ++b)
            amount[static_cast<Eigen::Index>(b)] += share * static_cast<double>(samples.beam[s * beam_count + b]);
          if (!field) continue;
          field->evaluate(face, back, sample.at, gathered.data());
          auto at = static_cast<Eigen::Index>(beam_count);
          for (std::size_t e = 0; e < channels.emitters.size(); ++e)
            amount[at++] += share * gathered[static_cast<std::size_t>(channels.first_emitter()) + e];
          if (channels.sky)
            amount[at++] += share * std::max(0.0, 1.0 - gathered[static_cast<std::size_t>(channels.sky_channel())]);
          for (std::size_t c = 0; c < static_cast<std::size_t>(channels.first_emitter()); ++c)
            amount[at++] += share * gathered[c];
        }
        if (objects.empty()) continue;

        sum.setZero();
        const auto add = [&](image::SpectralImage& picture, RowMatrix Palette::*kind, Eigen::Index first,
                             Eigen::Index count) {
          if (picture.value.empty()) return;
          spectrum.setZero();
          for (const int material : materials) {
            const RowMatrix& basis = palettes[static_cast<std::size_t>(material)].*kind;
            if (basis.rows() > 0)
              spectrum.noalias() +=
                  coefficient[static_cast<std::size_t>(material)].segment(first, count).transpose() * basis;
          }
          Eigen::Map<Eigen::RowVectorXf>(picture.pixel(row, column), bands) = spectrum.cast<float>();
          sum += spectrum;
        };
        const auto lights = static_cast<Eigen::Index>(direct_count);
        add(images.re, &Palette::re, 0, lights);
        add(images.le, &Palette::le, 0, lights);
        add(images.rr, &Palette::rr, lights, channels.reflected);
        add(images.lr, &Palette::lr, lights, channels.reflected);
        add(images.rl, &Palette::rl, lights + channels.reflected, channels.luminescent);
        add(images.ll, &Palette::ll, lights + channels.reflected, channels.luminescent);
        double best = 0.0;
        spectrum.setZero();
        std::sort(objects.begin(), objects.end());
        for (const int object : objects) {
          const auto o = static_cast<std::size_t>(object);
          images.coverage[pixel] += static_cast<float>(object_share[o]);
          if (object_share[o] > best) {
            best = object_share[o];
            images.object[pixel] = object;
          }
          if (scene.objects[o].emits()) {
            spectrum +=
                front_share[o] / std::numbers::pi * scene.objects[o].exitance.segment(first_band, bands).transpose();
          }
          object_share[o] = 0.0;
          front_share[o] = 0.0;
        }
        if (!images.emission.value.empty()) {
          Eigen::Map<Eigen::RowVectorXf>(images.emission.pixel(row, column), bands) = spectrum.cast<float>();
          sum += spectrum;
        }
        Eigen::Map<Eigen::RowVectorXf>(images.total.pixel(row, column), bands) = sum.cast<float>();
      }
      if (progress.report || progress.cancelled) progress.update("pixels", static_cast<double>(row) / camera.height);
    }
  });
  images.report.seconds_pixels = pixel_time.seconds();
  return images;
}

}  // namespace interglow::rendering
