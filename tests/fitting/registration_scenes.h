// SPDX-License-Identifier: GPL-3.0-or-later
/// Pictures of analytic scenes at exactly known positions: no resampling makes the truth uncertain.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include "fitting/affine_registration.h"

namespace interglow::fitting {

using Scene = std::function<double(double, double)>;  ///< about 0 … 1 over position in pixels of the fixed image

/// Two shaded half cylinders that touch, soft-edged like a lens of 1 px blur makes them, and textures of Gaussian
/// spots.
inline Scene cylinders_scene(int size, unsigned seed, int spots = 40) {
  struct Spot {
    double x, y, width, height;
  };
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<Spot> all;
  for (int s = 0; s < spots; ++s) {
    const double x = uniform(random), y = uniform(random), w = uniform(random), h = uniform(random);
    all.push_back({(0.15 + 0.7 * x) * size, (0.15 + 0.7 * y) * size, 2.0 + 8.0 * w, 0.2 * (h - 0.5)});
  }
  return [=](double x, double y) {
    const double radius = 0.17 * size;
    const double middle = 0.5 * size;
    const auto step = [](double distance) { return 0.5 * std::erfc(-distance / std::numbers::sqrt2); };
    double value = 0.2;
    for (const double side : {-1.0, 1.0}) {
      const double u = (x - middle - side * radius) / radius;  // across the cylinder, -1 … 1
      const double shading = (0.4 + 0.15 * side) * std::exp(-0.8 * (u - 0.3) * (u - 0.3));
      const double along = step(0.25 * size + 0.05 * size * side - std::abs(y - middle));
      value += shading * along * step(radius * (1.0 - std::abs(u)));
    }
    for (const Spot& spot : all) {
      const double dx = (x - spot.x) / spot.width;
      const double dy = (y - spot.y) / spot.width;
      value += spot.height * std::exp(-0.5 * (dx * dx + dy * dy));
    }
    return value;
  };
}

/// Spots of 1.8 to 3.4 px all over the picture, of 400 DN root mean square: with so much detail, 4 DN of noise allow
/// less than 0.002 px. The cylinders above, whose outlines hold most of what there is to align, allow 0.003 px.
inline Scene texture_scene(int size, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<std::array<double, 4>> spots;
  for (int s = 0; s < size * size / 80; ++s) {
    const double x = uniform(random), y = uniform(random), w = uniform(random), h = uniform(random);
    spots.push_back({x * size, y * size, 1.8 + 1.6 * w, 0.8 * (h - 0.5)});
  }
  return [=](double x, double y) {
    double value = 0.5;
    for (const auto& [at_x, at_y, width, height] : spots) {
      const double dx = (x - at_x) / width;
      const double dy = (y - at_y) / width;
      const double square = dx * dx + dy * dy;
      if (square < 50.0) value += height * std::exp(-0.5 * square);  // beyond lies less than 1e-11
    }
    return value;
  };
}

/// A 12-bit picture of the scene, taken where `scene_from_pixel` puts the pixels: 300 + 3500 gain value + offset,
/// normal noise of noise_dn, rounded.
inline image::ScalarMap take_picture(const Scene& scene, int size, const Affine& scene_from_pixel, double noise_dn,
                                     unsigned seed, double gain = 1.0, double offset = 0.0, bool quantise = true) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  image::ScalarMap picture{size, size, {}};
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const Eigen::Vector2d at = scene_from_pixel(Eigen::Vector2d(x, y));
      const double dn = gain * (300.0 + 3500.0 * scene(at.x(), at.y())) + offset + noise_dn * noise(random);
      picture.value.push_back(static_cast<float>(quantise ? std::clamp(std::round(dn), 0.0, 4095.0) : dn));
    }
  }
  return picture;
}

inline Affine inverse(const Affine& map) {
  const Eigen::Matrix2d linear = map.linear.inverse();
  return {linear, -linear * map.shift};
}

/// A turn and scales about the middle, then a shift.
inline Affine about_middle(int size, double turn_deg, double scale_x, double scale_y, double shift_x, double shift_y) {
  const Eigen::Vector2d middle = Eigen::Vector2d::Constant((size - 1) / 2.0);
  Affine map;
  map.linear = Eigen::Rotation2Dd(turn_deg * std::numbers::pi / 180.0).toRotationMatrix() *
               Eigen::Vector2d(scale_x, scale_y).asDiagonal();
  map.shift = middle - map.linear * middle + Eigen::Vector2d(shift_x, shift_y);
  return map;
}

}  // namespace interglow::fitting
