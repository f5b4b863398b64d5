// SPDX-License-Identifier: GPL-3.0-or-later
// The path tracer against closed forms. Pooled z-scores: the mean over all pixels of one channel and band against its
// own standard error. False-alarm rate of the file: 60 comparisons at |z| < 5.5 (normal), below 3e-6; each finds a bias
// of about 9 of the printed standard errors 999 times in 1000.
#include "cross_check/path_tracer.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "diagnostics/error.h"

namespace interglow::cross_check {
namespace {

using std::numbers::pi;

mesh::PatchMesh quad(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                     const Eigen::Vector3d& d) {
  mesh::PatchMesh mesh;
  mesh.points = {a, b, c, d};
  mesh.faces = {{0, 1, 2, 3}};
  return mesh;
}

/// Cube [0, 1]³ seen from inside.
mesh::PatchMesh inside_of_cube() {
  mesh::PatchMesh mesh;
  for (int i = 0; i < 8; ++i) mesh.points.emplace_back(i & 1, (i >> 1) & 1, i >> 2);
  mesh.faces = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
  mesh.closed = true;
  return mesh;
}

scene::Scene scene_with(const spectral::WavelengthGrid& grid, const spectral::DonaldsonMatrix& donaldson) {
  scene::Scene scene;
  scene.grid = grid;
  scene.materials = {{"material", donaldson}};
  scene.camera.width = scene.camera.height = 12;
  return scene;
}

scene::Scene grey_scene(double reflectance) {
  return scene_with(spectral::WavelengthGrid::from_centers(Eigen::VectorXd::Constant(1, 550.0)),
                    {Eigen::VectorXd::Constant(1, reflectance), {}});
}

struct Pooled {
  double mean, standard_error;
};

Pooled pooled(const Estimate& estimate, int band) {
  Pooled pool{0.0, 0.0};
  const auto bands = static_cast<std::size_t>(estimate.mean.bands());
  const std::size_t pixels = estimate.mean.value.size() / bands;
  for (std::size_t p = 0; p < pixels; ++p) {
    pool.mean += estimate.mean.value[p * bands + static_cast<std::size_t>(band)];
    pool.standard_error += std::pow(estimate.standard_error.value[p * bands + static_cast<std::size_t>(band)], 2);
  }
  return {pool.mean / static_cast<double>(pixels), std::sqrt(pool.standard_error) / static_cast<double>(pixels)};
}

void expect_mean(const PathTracer& tracer, Channel channel, double expected, int band = 0) {
  const Pooled pool = pooled(tracer.estimate(channel), band);
  // Rounding of float storage where nothing is random.
  EXPECT_LE(std::abs(pool.mean - expected), 5.5 * pool.standard_error + 1e-6 * std::abs(expected))
      << name(channel) << " band " << band << ": found " << pool.mean << " +- " << pool.standard_error << ", expected "
      << expected;
}

TEST(PathTracer, ParallelBeamOnATiltedPlaneIsLambertsLaw) {
  scene::Scene scene = grey_scene(0.6);
  scene.objects.push_back({.name = "plane", .patches = quad({-50, -50, 0}, {50, -50, 0}, {50, 50, 0}, {-50, 50, 0})});
  scene.directional_lights.push_back(
      {"beam", Eigen::Vector3d(1, 0, -2).normalized(), Eigen::VectorXd::Constant(1, 3.0)});
  PathTracer tracer(scene, {});
  tracer.add_batches(32);
  expect_mean(tracer, Channel::kRe, 0.6 / pi * 3.0 * 2.0 / std::sqrt(5.0));
  expect_mean(tracer, Channel::kRr, 0.0);
}

TEST(PathTracer, DiskSourceOfTheSameNormalIrradianceGivesTheSameLightOnAFacingPlane) {
  scene::Scene scene = grey_scene(1.0);
  scene.objects.push_back({.name = "plane", .patches = quad({-50, -50, 0}, {50, -50, 0}, {50, 50, 0}, {-50, 50, 0})});
  scene.directional_lights.push_back({"disk", {0, 0, -1}, Eigen::VectorXd::Constant(1, pi), 0.2});
  PathTracer tracer(scene, {});
  tracer.add_batches(32);
  expect_mean(tracer, Channel::kRe, 1.0);
}

// Howell, A Catalog of Radiation Configuration Factors, B-3/B-4 and the reference case dA_center_below_sq:
// 0.239456470460774.
TEST(PathTracer, EmittingSquareLightsThePointBelowItsCentre) {
  for (const double bounces : {0.0, 3.0}) {
    scene::Scene scene = grey_scene(1.0);
    scene.objects.push_back({.name = "floor", .patches = quad({-50, -50, 0}, {50, -50, 0}, {50, 50, 0}, {-50, 50, 0})});
    scene.objects.push_back({.name = "lamp",
                             .patches = quad({-0.5, -0.5, 1}, {-0.5, 0.5, 1}, {0.5, 0.5, 1}, {0.5, -0.5, 1}),
                             .exitance = Eigen::VectorXd::Constant(1, pi)});
    scene.camera.position = {40, 0, 30};
    scene.camera.target = {0, 0, 0};
    scene.camera.horizontal_fov_deg = 0.02;
    PathTracer tracer(scene, {.bounces = static_cast<int>(bounces)});
    tracer.add_batches(64);
    expect_mean(tracer, Channel::kRe, 0.239456470460774);
  }
}

TEST(PathTracer, ClosedBoxIsAFurnace) {
  for (const double reflectance : {0.5, 0.95}) {
    scene::Scene scene = grey_scene(reflectance);
    scene.objects.push_back(
        {.name = "box", .patches = inside_of_cube(), .exitance = Eigen::VectorXd::Constant(1, 1.0)});
    scene.camera.position = {0.3, 0.4, 0.5};
    scene.camera.target = {0.9, 0.8, 0.1};
    scene.camera.horizontal_fov_deg = 90;
    PathTracer tracer(scene, {});
    tracer.add_batches(64);
    expect_mean(tracer, Channel::kTotal, 1.0 / (1.0 - reflectance) / pi);
    expect_mean(tracer, Channel::kRe, reflectance / pi);
    PathTracer two(scene, {.bounces = 1});
    two.add_batches(64);
    expect_mean(two, Channel::kTotal, (1.0 + reflectance + reflectance * reflectance) / pi);
  }
}

// Every point of an integrating sphere sees the area A_s of a lamp by A_s / A, wherever it stands: irradiance
// M A_s / (A (1 - ρ)). The facets of 1.4° depart from the sphere's by 1e-4, far below what the check can tell.
TEST(PathTracer, IntegratingSphereIsUniformlyLit) {
  constexpr double kReflectance = 0.8;
  mesh::PatchMesh wall, cap;
  const auto inwards = [&](Eigen::Vector3d a, Eigen::Vector3d b, Eigen::Vector3d c) {
    mesh::PatchMesh& part = (a + b + c).normalized().z() > 0.8 ? cap : wall;
    const auto first = static_cast<int>(part.points.size());
    for (const Eigen::Vector3d& corner : {a, c, b}) part.points.push_back(corner.normalized());
    part.faces.push_back({first, first + 1, first + 2, -1});
  };
  constexpr int kParts = 64;
  for (const double x : {-1.0, 1.0}) {
    for (const double y : {-1.0, 1.0}) {
      for (const double z : {-1.0, 1.0}) {
        const auto at = [&](int i, int j) {
          return Eigen::Vector3d(x * i / kParts, y * j / kParts, z * (kParts - i - j) / kParts);
        };
        const bool outwards = x * y * z > 0.0;
        const auto add = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
          outwards ? inwards(a, b, c) : inwards(a, c, b);
        };
        for (int i = 0; i < kParts; ++i) {
          for (int j = 0; i + j < kParts; ++j) {
            add(at(i + 1, j), at(i, j + 1), at(i, j));
            if (i + j + 1 < kParts) add(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
          }
        }
      }
    }
  }
  scene::Scene scene = grey_scene(kReflectance);
  const double lamp_area = mesh::total_area(cap);
  const double direct = lamp_area / (lamp_area + mesh::total_area(wall));
  scene.objects.push_back({.name = "wall", .patches = wall});
  scene.objects.push_back({.name = "lamp", .patches = cap, .exitance = Eigen::VectorXd::Constant(1, 1.0)});
  scene.camera.position = {0.1, 0.2, 0.3};
  scene.camera.target = {0.4, -0.3, -1};
  scene.camera.horizontal_fov_deg = 60;
  PathTracer tracer(scene, {});
  tracer.add_batches(128);
  expect_mean(tracer, Channel::kRe, kReflectance * direct / pi);
  expect_mean(tracer, Channel::kTotal, kReflectance * direct / (1.0 - kReflectance) / pi);
  const Pooled total = pooled(tracer.estimate(Channel::kTotal), 0);
  EXPECT_LT(total.standard_error, 4e-3 * total.mean) << "it can tell too little";
}

TEST(PathTracer, SkyFurnaceIsUniformWhateverTheShape) {
  scene::Scene scene = grey_scene(1.0);
  scene.objects.push_back(
      {.name = "left", .patches = quad({-1, -9, 2}, {0, -9, 0}, {0, 9, 0}, {-1, 9, 2}), .sides = scene::Sides::kTwo});
  scene.objects.push_back(
      {.name = "right", .patches = quad({0, -9, 0}, {1, -9, 2}, {1, 9, 2}, {0, 9, 0}), .sides = scene::Sides::kTwo});
  scene.sky = scene::SkyLight{"sky", Eigen::VectorXd::Constant(1, 2.0)};
  scene.camera.position = {0, 0, 30};
  scene.camera.horizontal_fov_deg = 2.5;
  PathTracer tracer(scene, {});
  tracer.add_batches(256);
  expect_mean(tracer, Channel::kTotal, 2.0);
}

// Two plates with F12 = F21 = 1 up to (gap / side)²: reference kind radiosity_parallel_plates.
TEST(PathTracer, ParallelPlatesReachTheGeometricSeries) {
  scene::Scene scene = grey_scene(0.5);
  scene.materials.push_back({"other", {Eigen::VectorXd::Constant(1, 0.8), {}}});
  scene.objects.push_back({.name = "lower",
                           .patches = quad({-2000, -2000, 0}, {2000, -2000, 0}, {2000, 2000, 0}, {-2000, 2000, 0}),
                           .exitance = Eigen::VectorXd::Constant(1, 1.0)});
  scene.objects.push_back({.name = "upper",
                           .patches = quad({-2000, -2000, 1}, {-2000, 2000, 1}, {2000, 2000, 1}, {2000, -2000, 1}),
                           .material = 1});
  scene.camera.position = {0, 0, 0.1};
  scene.camera.target = {0, 0, 1};
  PathTracer tracer(scene, {});
  tracer.add_batches(64);
  expect_mean(tracer, Channel::kTotal, 0.8 / (1.0 - 0.4) / pi);
  expect_mean(tracer, Channel::kRr, (0.8 / (1.0 - 0.4) - 0.8) / pi);
  PathTracer twice(scene, {.bounces = 2});
  twice.add_batches(64);
  expect_mean(twice, Channel::kTotal, 0.8 * (1.0 + 0.4) / pi);
}

// In a closed box with one Donaldson matrix and uniform exitance M every point has B = (I - D)^-1 M, and the irradiance
// splits into direct M, reflected (I - S)^-1 S M and the rest.
TEST(PathTracer, FluorescentFurnaceMatchesTheMatrixInverse) {
  spectral::DonaldsonMatrix donaldson;
  donaldson.reflectance = Eigen::Vector3d(0.2, 0.5, 0.7);
  donaldson.luminescence = Eigen::Matrix3d::Zero();
  donaldson.luminescence(1, 0) = 0.3;
  donaldson.luminescence(2, 0) = 0.2;
  donaldson.luminescence(2, 1) = 0.25;
  donaldson.luminescence(0, 1) = 0.02;  // anti-Stokes
  scene::Scene scene = scene_with(spectral::WavelengthGrid::uniform(400, 600, 100), donaldson);
  const Eigen::Vector3d exitance(1.0, 0.5, 0.2);
  scene.objects.push_back({.name = "box", .patches = inside_of_cube(), .exitance = exitance});
  scene.camera.position = {0.3, 0.4, 0.5};
  scene.camera.target = {0.9, 0.8, 0.1};
  scene.camera.horizontal_fov_deg = 90;
  PathTracer tracer(scene, {});
  tracer.add_batches(128);
  const Eigen::Matrix3d S = donaldson.reflectance.asDiagonal();
  const Eigen::Matrix3d L = donaldson.luminescence;
  const Eigen::Vector3d H = (Eigen::Matrix3d::Identity() - S - L).inverse() * exitance;
  const Eigen::Vector3d HR = (Eigen::Matrix3d::Identity() - S).inverse() * S * exitance;
  const Eigen::Vector3d HL = H - exitance - HR;
  for (int band = 0; band < 3; ++band) {
    expect_mean(tracer, Channel::kTotal, H[band] / pi, band);
    expect_mean(tracer, Channel::kRe, (S * exitance)[band] / pi, band);
    expect_mean(tracer, Channel::kRr, (S * HR)[band] / pi, band);
    expect_mean(tracer, Channel::kLe, (L * exitance)[band] / pi, band);
    expect_mean(tracer, Channel::kLr, (L * HR)[band] / pi, band);
    expect_mean(tracer, Channel::kLl, (L * HL)[band] / pi, band);
    expect_mean(tracer, Channel::kRl, (S * HL)[band] / pi, band);
    expect_mean(tracer, Channel::kEmission, exitance[band] / pi, band);
  }
  EXPECT_LE(tracer.largest_sample(),
            4.0 * tracer.largest_possible_sample());  // the former is a sum over a batch of 4 paths
}

// The back of a one-sided sheet is black; a two-sided one reflects there as well.
TEST(PathTracer, BackOfAOneSidedSheetIsBlack) {
  for (const auto sides : {scene::Sides::kOne, scene::Sides::kTwo}) {
    scene::Scene scene = grey_scene(0.8);
    scene.objects.push_back(
        {.name = "sheet", .patches = quad({-50, -50, 0}, {-50, 50, 0}, {50, 50, 0}, {50, -50, 0}), .sides = sides});
    scene.directional_lights.push_back({"beam", {0, 0, -1}, Eigen::VectorXd::Constant(1, pi)});
    PathTracer tracer(scene, {});
    tracer.add_batches(32);
    expect_mean(tracer, Channel::kTotal, sides == scene::Sides::kTwo ? 0.8 : 0.0);
  }
}

TEST(PathTracer, SameBitsForAnyNumberOfThreads) {
  scene::Scene scene = grey_scene(0.7);
  scene.objects.push_back({.name = "box", .patches = inside_of_cube(), .exitance = Eigen::VectorXd::Constant(1, 1.0)});
  scene.camera.position = {0.3, 0.4, 0.5};
  scene.camera.target = {0.9, 0.8, 0.1};
  const auto trace = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    PathTracer tracer(scene, {});
    tracer.add_batches(3);
    tracer.add_batches(2);
    return tracer.estimate(Channel::kTotal).mean.value;
  };
  EXPECT_EQ(trace(1), trace(2));
}

// A batch more, or another seed, must change the picture: otherwise the standard error would mean nothing.
TEST(PathTracer, SeedsAreIndependent) {
  scene::Scene scene = grey_scene(0.7);
  scene.objects.push_back({.name = "box", .patches = inside_of_cube(), .exitance = Eigen::VectorXd::Constant(1, 1.0)});
  scene.camera.position = {0.3, 0.4, 0.5};
  scene.camera.target = {0.9, 0.8, 0.1};
  PathTracer first(scene, {.seed = 1});
  PathTracer second(scene, {.seed = 2});
  first.add_batches(64);
  second.add_batches(64);
  const Estimate a = first.estimate(Channel::kTotal);
  const Estimate b = second.estimate(Channel::kTotal);
  double sum = 0.0;
  for (std::size_t i = 0; i < a.mean.value.size(); ++i) {
    const double z =
        (a.mean.value[i] - b.mean.value[i]) / std::hypot(a.standard_error.value[i], b.standard_error.value[i]);
    sum += z * z;
  }
  // Chi-square of 144 nearly normal z (t with 126 degrees of freedom: variance 1.016): within 5.5 standard deviations.
  const double n = static_cast<double>(a.mean.value.size());
  EXPECT_NEAR(sum / n, 1.016, 5.5 * std::sqrt(2.0 / n));
}

TEST(PathTracer, RefusesWhatItCannotTrace) {
  scene::Scene scene = grey_scene(0.7);
  scene.objects.push_back({.name = "box", .patches = inside_of_cube(), .exitance = Eigen::VectorXd::Constant(1, 1.0)});
  EXPECT_THROW(PathTracer(scene, {.bounces = -1}), InvalidParams);
  EXPECT_THROW(PathTracer(scene, {.samples_per_batch = 0}), InvalidParams);
  EXPECT_THROW(PathTracer(scene, {}).estimate(Channel::kTotal), InvalidParams);
}

}  // namespace
}  // namespace interglow::cross_check
