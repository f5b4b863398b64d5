// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/render.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <numbers>

#include "diagnostics/error.h"
#include "mesh/subdivide.h"
#include "radiosity/form_factor.h"
#include "rendering/camera_rays.h"
#include "shapes.h"

namespace interglow::rendering {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using radiosity::RowMatrix;

constexpr double kPi = std::numbers::pi;

/// Three bands; a fluorescent material moves light from the first to the third band.
scene::Scene empty_scene() {
  scene::Scene scene;
  scene.grid = spectral::WavelengthGrid::uniform(400, 600, 100);
  scene.materials = {test::grey("white", 0.8, 3), test::grey("fluorescent", 0.5, 3)};
  scene.materials[1].donaldson.luminescence = Eigen::MatrixXd::Zero(3, 3);
  scene.materials[1].donaldson.luminescence(2, 0) = 0.25;
  scene.camera.position = {0, 0, 100};
  scene.camera.target = {0, 0, 0};
  scene.camera.width = 32;
  scene.camera.height = 24;
  scene.camera.horizontal_fov_deg = 10.0;
  return scene;
}

scene::Object object(const mesh::PatchMesh& mesh, int material = 0) {
  scene::Object result;
  result.name = "object";
  result.patches = mesh;
  result.material = material;
  return result;
}

scene::DirectionalLight beam(const Vector3d& direction) {
  scene::DirectionalLight light;
  light.direction = direction.normalized();
  light.normal_irradiance = Vector3d(1.0, 2.0, 3.0);
  return light;
}

/// A solution without indirect light.
radiosity::Solution direct_only(const radiosity::Elements& elements) {
  radiosity::Solution solution;
  solution.direct = RowMatrix::Ones(elements.size(), 3);
  solution.reflected = RowMatrix::Zero(elements.size(), 3);
  return solution;
}

TEST(Render, LevelPlaneUnderABeamIsLambertian) {
  scene::Scene scene = empty_scene();
  scene.objects = {object(test::level_square(50, 0, true), 1)};
  scene.directional_lights = {beam({0.3, -0.2, -1.0})};
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const RenderedImages images = render(scene, elements, direct_only(elements), {});
  const double cosine = -scene.directional_lights[0].direction.z();
  for (int row = 0; row < 24; row += 5) {
    for (int column = 0; column < 32; column += 5) {
      for (int band = 0; band < 3; ++band) {
        EXPECT_NEAR(images.re.pixel(row, column)[band], 0.5 / kPi * (band + 1.0) * cosine, 1e-6);
        // Excited in band 0 (irradiance 1 × cosine), emitted in band 2.
        EXPECT_NEAR(images.le.pixel(row, column)[band], band == 2 ? 0.25 / kPi * cosine : 0.0, 1e-6);
      }
    }
  }
  EXPECT_TRUE(images.rr.value.empty());
  EXPECT_TRUE(images.emission.value.empty());
}

TEST(Render, EdgesAreAreaAverages) {
  // The square covers x < x0 of the image plane; the pixel that it ends in shows the covered share. A rank-1 lattice
  // of n² points meets an upright edge to 1 / (2 n²).
  for (const double x0 : {0.3, 1.234, -2.07}) {
    scene::Scene scene = empty_scene();
    scene.objects = {object(test::quad({-50, -50, 0}, {x0, -50, 0}, {x0, 50, 0}, {-50, 50, 0}))};
    scene.directional_lights = {beam({0, 0, -1})};
    const radiosity::Elements elements = radiosity::make_elements(scene);
    const RenderedImages images = render(scene, elements, direct_only(elements), {.samples_per_side = 8});
    const double pixel_mm = 2 * 100 * std::tan(5 * kPi / 180) / 32;
    const double edge = 16 + x0 / pixel_mm;
    for (int column = 0; column < 32; ++column) {
      const double share = std::clamp(edge - column, 0.0, 1.0);
      EXPECT_NEAR(images.coverage[10 * 32 + static_cast<std::size_t>(column)], share, 0.5 / 64 + 1e-6) << column;
      EXPECT_NEAR(images.total.pixel(10, column)[0], share * 0.8 / kPi, (0.5 / 64 + 1e-6) * 0.8 / kPi);
      EXPECT_EQ(images.object[10 * 32 + static_cast<std::size_t>(column)],
                share > 0.5
                    ? 0
                    : (share < 0.45 && share == 0.0 ? -1 : images.object[10 * 32 + static_cast<std::size_t>(column)]));
    }
  }
}

TEST(Render, FacetsInsideAPixelShowWithTheirShares) {
  // Three strips of a roof in one pixel, the middle one between the slopes of the others: its normal is their mean, but
  // the brighter slope fills more of the pixel than the darker one. Edges upright, met to 1 / (2 n²).
  constexpr double kTilt = 0.01;
  const double half_mm = 100 * std::tan(5 * kPi / 180);
  for (const auto& [left, right] : {std::pair{-0.9, 0.3}, {-0.35, 0.8}, {-0.5, 0.5}}) {
    SCOPED_TRACE(left);
    scene::Scene scene = empty_scene();
    scene.camera.width = scene.camera.height = 1;
    const double x0 = left * half_mm;
    const double x1 = right * half_mm;
    const double down = 20 * std::tan(kTilt);
    scene.objects = {
        object(test::quad({x0 - 20, -50, -down}, {x0, -50, 0}, {x0, 50, 0}, {x0 - 20, 50, -down})),
        object(test::quad({x0, -50, 0}, {x1, -50, 0}, {x1, 50, 0}, {x0, 50, 0})),
        object(test::quad({x1, -50, 0}, {x1 + 20, -50, -down}, {x1 + 20, 50, -down}, {x1, 50, 0})),
    };
    // One object: no silhouette among the strips.
    for (const int other : {1, 2}) {
      mesh::PatchMesh& all = scene.objects[0].patches;
      for (mesh::Face face : scene.objects[static_cast<std::size_t>(other)].patches.faces) {
        for (int& corner : face) corner += static_cast<int>(all.points.size());
        all.faces.push_back(face);
      }
      const auto& points = scene.objects[static_cast<std::size_t>(other)].patches.points;
      all.points.insert(all.points.end(), points.begin(), points.end());
    }
    scene.objects.resize(1);
    scene.directional_lights = {beam({1, 0, -1})};
    const radiosity::Elements elements = radiosity::make_elements(scene);
    const RenderedImages images = render(scene, elements, direct_only(elements), {.samples_per_side = 16});
    const auto cosine = [](double tilt) { return std::cos(kPi / 4 - tilt); };
    const double expected =
        0.5 * (left + 1) * cosine(kTilt) + 0.5 * (right - left) * cosine(0) + 0.5 * (1 - right) * cosine(-kTilt);
    const double step = cosine(kTilt) - cosine(0);
    EXPECT_NEAR(images.total.pixel(0, 0)[0] * kPi / 0.8, expected, 2 * step * 0.5 / 256 + 1e-6);
  }
}

TEST(Render, SlitsOfNoWidthDoNotLightAGroove) {
  // A groove of 60 degrees under a sky. Corners on its bottom line stand off the other side by 1.5 or 3 µm here and
  // there, so that slits far below a pixel open. A point at x from the bottom sees of the other side, of width L, F =
  // (1 + (L cos 60°
  // - x) / √(L² + x² - 2 L x cos 60°)) / 2 (crossed strings), and of the sky the rest.
  constexpr double kWidth_mm = 20.0;
  constexpr int kRows = 60;
  constexpr double kRow_mm = 5.0;
  scene::Scene scene = empty_scene();
  scene.camera.height = 4;
  scene.camera.width = 64;
  scene.camera.horizontal_fov_deg = 11.0;
  scene.camera.up = Vector3d::UnitY();
  scene.sky = scene::SkyLight{"sky", VectorXd::Ones(3)};
  for (const double side : {-1.0, 1.0}) {
    const Vector3d along(side * 0.5, 0, std::sqrt(0.75));
    const Vector3d away(side * std::sqrt(0.75), 0, 0.5);  // from the other side
    mesh::PatchMesh sheet;
    for (int k = 0; k <= kRows; ++k) {
      const double back = 0.0015 * ((k + 2) % 3);
      const Vector3d at(0, (k - 0.5 * kRows) * kRow_mm, 0);
      sheet.points.push_back(at + back * away);
      for (const double t : {4.0, kWidth_mm}) sheet.points.push_back(at + t * along);
      if (k == 0) continue;
      for (int strip = 0; strip < 2; ++strip) {
        const int a = 3 * (k - 1) + strip;
        // Triangles: the corners of a quad would not be in one plane.
        for (const auto& [p, q, r] : {std::array{a, a + 3, a + 4}, {a, a + 4, a + 1}})
          sheet.faces.push_back(side < 0 ? mesh::Face{p, q, r, -1} : mesh::Face{p, r, q, -1});
      }
    }
    scene.objects.push_back(object(sheet));
  }
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const RenderedImages images =
      render(scene, elements, direct_only(elements), {.samples_per_side = 16, .gather_tolerance = 1e-4});
  const double reach = std::tan(scene.camera.horizontal_fov_deg * kPi / 360);
  for (int column = 0; column < 64; ++column) {
    constexpr int kSteps = 400;
    double expected = 0.0;
    for (int step = 0; step < kSteps; ++step) {
      const double slope = reach * std::abs(2.0 * (column + (step + 0.5) / kSteps) / 64 - 1.0);
      // (x/2, √¾ x) on the ray: x / 2 = slope (100 - √¾ x).
      const double x = slope * 100 / (0.5 + slope * std::sqrt(0.75));
      const double seen = 0.5 * (1 + (0.5 * kWidth_mm - x) / std::sqrt(kWidth_mm * kWidth_mm + x * x - kWidth_mm * x));
      expected += 0.8 * (1 - seen) / kSteps;
    }
    // The slits themselves are dark: up to 2.6 µm of the 300 µm of the pixels beside them.
    EXPECT_NEAR(images.re.pixel(1, column)[0], expected, 0.012 * expected) << "column " << column;
  }
}

TEST(Render, CornersAreAreaAverages) {
  // One corner of the square ends in pixel (10, 17), of which it covers u × v. A rank-1 lattice of N points errs by
  // O(log N / N) on boxes: log2(64) / 2 points of 64 here, where a grid of 8 x 8 errs by up to 8 and one with sheared
  // rows by 4.
  const double pixel_mm = 2 * 100 * std::tan(5 * kPi / 180) / 32;
  for (const auto& [u, v] : {std::pair{0.67, 0.065}, {0.31, 0.425}, {0.433, 0.433}, {0.433, 0.543}, {0.1, 0.9}}) {
    scene::Scene scene = empty_scene();
    const double x = (17 + u - 16) * pixel_mm;
    const double y = (12 - (10 + 1 - v)) * pixel_mm;
    scene.objects = {object(test::quad({-50, -50, 0}, {x, -50, 0}, {x, y, 0}, {-50, y, 0}))};
    scene.directional_lights = {beam({0, 0, -1})};
    const radiosity::Elements elements = radiosity::make_elements(scene);
    const RenderedImages images = render(scene, elements, direct_only(elements), {.samples_per_side = 8});
    EXPECT_NEAR(images.coverage[10 * 32 + 17], u * v, 3.0 / 64) << u << " " << v;
  }
}

TEST(Render, ShadowOfASquareHasTheRightAreaAndPlace) {
  // A square of side 4 at height 10 under a beam tilted by tan = 0.3 along x shades a square of side 4 shifted by 3.
  scene::Scene scene = empty_scene();
  scene.camera.position = {0, 0, -100};  // sees the floor, which looks down, from below
  scene.camera.horizontal_fov_deg = 14;
  scene.camera.width = scene.camera.height = 64;
  scene.objects = {object(test::level_square(100, 0, false)), object(test::level_square(2, -200, true))};
  scene.objects[1].sides = scene::Sides::kTwo;
  for (Vector3d& p : scene.objects[1].patches.points) p.z() = -110;
  scene.directional_lights = {beam({0.03, 0.01, 1.0})};
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const RenderedImages images = render(scene, elements, direct_only(elements), {});
  const double pixel_mm = 2 * 100 * std::tan(7 * kPi / 180) / 64;
  double lit = 0.0;
  double x = 0.0;
  double y = 0.0;
  // Camera looks along +z with up = y: right = forward × up = -x.
  for (int row = 0; row < 64; ++row) {
    for (int column = 0; column < 64; ++column) {
      const double dark =
          1.0 - images.re.pixel(row, column)[0] / (0.8 / kPi * scene.directional_lights[0].direction.z());
      lit += dark;
      x += dark * -((column + 0.5) - 32) * pixel_mm;
      y += dark * (32 - (row + 0.5)) * pixel_mm;
    }
  }
  EXPECT_NEAR(lit * pixel_mm * pixel_mm, 16.0, 0.1);
  EXPECT_NEAR(x / lit, 3.3, 0.02);
  EXPECT_NEAR(y / lit, 1.1, 0.02);
}

TEST(Render, SphereUnderABeamIsSmoothWithoutTerminatorArtefacts) {
  // A coarse sphere with true normals (320 and more facets): radiance ρ/π cosθ with the interpolated normal, no facet
  // shades another.
  scene::Scene scene = empty_scene();
  scene.objects = {object(test::smooth_sphere(5.0, 3))};
  scene.directional_lights = {beam({-1.0, 0.0, -0.2})};  // the terminator crosses the picture
  scene.camera.width = scene.camera.height = 128;
  scene.camera.horizontal_fov_deg = 6.5;
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const RenderedImages images = render(scene, elements, direct_only(elements), {});
  const double h = std::tan(3.25 * kPi / 180);
  double worst = 0.0;
  for (int row = 0; row < 128; ++row) {
    for (int column = 0; column < 128; ++column) {
      const Vector3d direction =
          Vector3d((2 * (column + 0.5) / 128 - 1) * h, (1 - 2 * (row + 0.5) / 128) * h, -1).normalized();
      const double along = 100 * -direction.z();
      const double inside = along * along - (100 * 100 - 25);
      if (inside < 2.0) continue;  // towards the silhouette the facets' outline matters
      const Vector3d hit = Vector3d(0, 0, 100) + (along - std::sqrt(inside)) * direction;
      const double expected = 0.8 / kPi * std::max(0.0, -hit.normalized().dot(scene.directional_lights[0].direction));
      worst = std::max(worst, std::abs(images.re.pixel(row, column)[0] - expected));
    }
  }
  // Facets of 0.1 rad: interpolated normals err by up to 0.1² / 8 of a radian and hits lie up to 0.1² / 8 radii too
  // deep.
  EXPECT_LT(worst, 0.8 / kPi * 0.012);
}

TEST(Render, WhiteFurnaceIsUniform) {
  // Inside a closed box whose walls all radiate B, H = B at every point, in corners and edges as well.
  scene::Scene scene = empty_scene();
  scene.objects = {object(mesh::subdivide(test::cavity(10), 1.0), 1)};
  scene.camera.position = {5, 4, 9};
  scene.camera.target = {5, 5.5, 0};
  scene.camera.horizontal_fov_deg = 80;
  const radiosity::Elements elements = radiosity::make_elements(scene);
  radiosity::Solution solution = direct_only(elements);
  solution.direct.setZero();
  const Eigen::RowVector3d reflected(1.0, 0.7, 0.2);
  const Eigen::RowVector3d luminescent(0.0, 0.1, 0.4);
  solution.reflected = reflected.replicate(elements.size(), 1);
  solution.reflected_source = solution.reflected;
  solution.luminescent = luminescent.replicate(elements.size(), 1);
  solution.luminescent_source = solution.luminescent;
  const RenderedImages images = render(scene, elements, solution, {.gather_tolerance = 1e-3});
  const double scale = 2.4;  // irradiance summed over bands, which the tolerance refers to (bands of equal width)
  for (int row = 0; row < 24; ++row) {
    for (int column = 0; column < 32; ++column) {
      EXPECT_EQ(images.coverage[static_cast<std::size_t>(row * 32 + column)], 1.0F);
      for (int band = 0; band < 3; ++band) {
        EXPECT_NEAR(images.rr.pixel(row, column)[band], 0.5 / kPi * reflected[band], 2e-3 * scale * 0.5 / kPi)
            << row << ' ' << column;
        EXPECT_NEAR(images.rl.pixel(row, column)[band], 0.5 / kPi * luminescent[band], 2e-3 * scale * 0.5 / kPi);
        EXPECT_NEAR(images.lr.pixel(row, column)[band], band == 2 ? 0.25 / kPi * reflected[0] : 0.0,
                    2e-3 * scale * 0.25 / kPi);
        EXPECT_NEAR(images.ll.pixel(row, column)[band], 0.0, 1e-7);
      }
    }
  }
}

TEST(Render, ComponentsAddUpToThePicture) {
  scene::Scene scene = empty_scene();
  scene.objects = {object(mesh::subdivide(test::level_square(8, 0, true), 2.0), 1),
                   object(test::smooth_sphere(2.0, 2), 0), object(test::level_square(1, 12, false), 0)};
  for (Vector3d& p : scene.objects[1].patches.points) p.z() += 2.0;
  scene.objects[2].exitance = Vector3d(3.0, 2.0, 1.0);
  scene.objects[2].sides = scene::Sides::kTwo;
  scene.directional_lights = {beam({0.3, -0.2, -1.0})};
  scene.sky = scene::SkyLight{"sky", Vector3d(0.1, 0.2, 0.3)};
  const radiosity::Elements elements = radiosity::make_elements(scene);
  radiosity::Solution solution = direct_only(elements);
  solution.reflected_source = 0.3 * solution.direct;
  solution.luminescent = solution.luminescent_source = 0.1 * solution.direct;
  const RenderedImages images = render(scene, elements, solution, {.gather_tolerance = 1e-2});
  for (std::size_t k = 0; k < images.total.value.size(); ++k) {
    const double sum = static_cast<double>(images.re.value[k]) + images.rr.value[k] + images.le.value[k] +
                       images.lr.value[k] + images.ll.value[k] + images.rl.value[k] + images.emission.value[k];
    ASSERT_NEAR(images.total.value[k], sum, 1e-6 * std::abs(sum)) << k;
  }
}

TEST(Render, EmittersAndSkyLightTheFloor) {
  // Straight below the middle of a square emitter of half-side 2 at height 3 the irradiance is M times the closed form
  // of the parallel square; the rest of the sky's hemisphere adds π L (1 - F).
  const double x = 2.0 / 3.0;
  const double r = std::sqrt(1 + x * x);
  const double factor = 4 * (2 * x / r * std::atan(x / r)) / (2 * kPi);
  scene::Scene scene = empty_scene();
  scene.objects = {object(test::level_square(1, 0, true)), object(test::level_square(2, 3, false))};
  scene.objects[1].exitance = Vector3d(3.0, 2.0, 1.0);
  scene.sky = scene::SkyLight{"sky", Vector3d(0.1, 0.2, 0.3)};
  scene.camera.position = {0, 0, 2.5};
  scene.camera.horizontal_fov_deg = 1.0;
  scene.camera.width = scene.camera.height = 3;
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const RenderedImages images = render(scene, elements, direct_only(elements), {.gather_tolerance = 1e-3});
  for (int band = 0; band < 3; ++band) {
    const double irradiance = factor * scene.objects[1].exitance[band] + kPi * scene.sky->radiance[band] * (1 - factor);
    EXPECT_NEAR(images.re.pixel(1, 1)[band], 0.8 / kPi * irradiance, 2e-3 * irradiance);
  }
  // Seen directly: exitance / π on the front, nothing on the back.
  scene.camera.position = {0, 0, 1};
  scene.camera.target = {0, 0, 2};
  const RenderedImages lamp = render(scene, elements, direct_only(elements), {});
  EXPECT_NEAR(lamp.emission.pixel(1, 1)[0], 3.0 / kPi, 1e-6);
  scene.camera.position = {0, 0, 5};
  const RenderedImages behind = render(scene, elements, direct_only(elements), {});
  EXPECT_EQ(behind.emission.pixel(1, 1)[0], 0.0F);
}

// The half-shadow of a wall under a lamp, 4 mm wide, seen so flat that a pixel is 8 mm deep. What a point of the floor
// sees of the lamp is a rectangle that ends where the wall's top stands before it; its form factor is Lambert's.
TEST(Render, HalfShadowsInsideAPixelShowWithTheirMean) {
  scene::Scene scene = empty_scene();
  scene.materials.push_back(test::grey("black", 0.0, 3));
  constexpr double kLamp_mm = 60, kWall_mm = 10, kNear_mm = 40, kFar_mm = 60;
  scene.objects = {object(mesh::subdivide(test::level_square(60, 0, true), 20.0)),
                   object(test::quad({-500, 0, 0}, {500, 0, 0}, {500, 0, kWall_mm}, {-500, 0, kWall_mm}), 2),
                   object(test::quad({-10, kNear_mm, kLamp_mm}, {-10, kFar_mm, kLamp_mm}, {10, kFar_mm, kLamp_mm},
                                     {10, kNear_mm, kLamp_mm}),
                          2)};
  scene.objects[2].exitance = Vector3d(100.0, 200.0, 300.0);
  scene.camera.position = {0, -300, 60};
  scene.camera.target = {0, -10, 0};
  scene.camera.up = {0, 0, 1};
  scene.camera.width = 16;
  scene.camera.height = 8;
  scene.camera.horizontal_fov_deg = 5.0;
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const RenderedImages images =
      render(scene, elements, direct_only(elements), {.samples_per_side = 16, .gather_tolerance = 1e-4});

  const auto irradiance = [&](const Vector3d& p) {  // per unit of exitance
    const double last = std::min(kFar_mm, -p.y() * (kLamp_mm / kWall_mm - 1.0));
    if (last <= kNear_mm) return 0.0;
    radiosity::Polygon seen;
    seen.corners = 4;
    seen.corner = {Vector3d(-10, kNear_mm, kLamp_mm), Vector3d(-10, last, kLamp_mm), Vector3d(10, last, kLamp_mm),
                   Vector3d(10, kNear_mm, kLamp_mm)};
    return radiosity::point_form_factor(p, Vector3d::UnitZ(), seen);
  };
  const CameraRays camera = camera_rays(scene.camera);
  const double lit = 0.8 / kPi * 100 * irradiance({0, -20, 0});
  constexpr int kParts = 24;
  int half_lit = 0;
  for (int row = 0; row < scene.camera.height; ++row) {
    for (int column = 0; column < scene.camera.width; column += 5) {
      double mean = 0.0;
      bool is_floor = true;
      for (int i = 0; i < kParts * kParts; ++i) {
        const Vector3d direction =
            camera.direction(column + (i % kParts + 0.5) / kParts, row + (i / kParts + 0.5) / kParts);
        const Vector3d p = camera.origin - camera.origin.z() / direction.z() * direction;
        is_floor = is_floor && direction.z() < 0 && p.y() < -0.5 && p.y() > -60;
        if (is_floor) mean += 0.8 / kPi * 100 * irradiance(p) / (kParts * kParts);
      }
      if (!is_floor) continue;
      if (mean > 0.02 * lit && mean < 0.9 * lit) ++half_lit;
      EXPECT_NEAR(images.re.pixel(row, column)[0], mean, 2e-3 * lit) << "row " << row << " column " << column;
    }
  }
  EXPECT_GE(half_lit, 4);
}

TEST(Render, SameBitsForAnyNumberOfThreads) {
  scene::Scene scene = empty_scene();
  scene.objects = {object(mesh::subdivide(test::level_square(8, 0, true), 1.0), 1),
                   object(test::smooth_sphere(2.0, 3), 0)};
  for (Vector3d& p : scene.objects[1].patches.points) p.z() += 2.0;
  scene.directional_lights = {beam({0.3, -0.2, -1.0})};
  scene.directional_lights[0].half_angle_rad = 0.05;
  const radiosity::Elements elements = radiosity::make_elements(scene);
  radiosity::Solution solution = direct_only(elements);
  solution.reflected_source = 0.3 * solution.direct;
  std::vector<float> first;
  for (const std::size_t threads : {1, 2, 3}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const RenderedImages images = render(scene, elements, solution, {});
    if (first.empty()) first = images.total.value;
    EXPECT_EQ(images.total.value, first) << threads << " threads";
  }
}

TEST(Render, RefusesParamsOutOfRange) {
  EXPECT_THROW(validate(RenderParams{.samples_per_side = 0}), InvalidParams);
  try {
    validate(RenderParams{.gather_tolerance = 2.0});
    FAIL() << "accepted";
  } catch (const InvalidParams& error) {
    EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr("gather_tolerance"), testing::HasSubstr("2")));
  }
}

// Every point of an open plane sees the whole sky, whatever its neighbours in the same plane: radiance ρ L. The plane
// is oblique, so that the backs of its faces lie in front of it by rounding.
TEST(Render, ObliqueSheetUnderASkySeesNothingOfItsOwnBack) {
  scene::Scene scene = empty_scene();
  const Vector3d u = Vector3d(0.83, 0.11, 0.31).normalized();
  const Vector3d v = Vector3d(-0.17, 0.71, 0.29).cross(u).cross(u).normalized() * (-1.0);
  const Vector3d u40 = 40.0 * u, v40 = 40.0 * v;
  mesh::PatchMesh sheet = mesh::subdivide(test::quad(-u40 - v40, u40 - v40, u40 + v40, -u40 + v40), 9.0);
  if (mesh::vector_area(sheet, sheet.faces[0]).z() < 0.0) {
    for (mesh::Face& face : sheet.faces) std::swap(face[1], face[3]);
  }
  scene.objects = {object(sheet)};
  scene.sky = scene::SkyLight{"sky", Vector3d(1.0, 2.0, 3.0)};
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const RenderedImages images = render(scene, elements, direct_only(elements), {});
  for (int row = 0; row < scene.camera.height; ++row) {
    for (int column = 0; column < scene.camera.width; ++column) {
      for (int band = 0; band < 3; ++band) {
        ASSERT_NEAR(images.re.pixel(row, column)[band], 0.8 * (band + 1), 1e-6) << row << " " << column << " " << band;
      }
    }
  }
}

}  // namespace
}  // namespace interglow::rendering
