// SPDX-License-Identifier: GPL-3.0-or-later
#include "rendering/paper_images.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "diagnostics/error.h"
#include "rendering/contact.h"

namespace interglow::rendering {
namespace {

/// Two parallel squares of side 10, at z = 0 and z = height, the upper one beside the lower: a camera above sees both.
scene::Scene two_sheets(double gap_mm) {
  scene::Scene scene;
  scene.grid = spectral::WavelengthGrid::uniform(400.0, 600.0, 50.0);
  const auto material = [&](const char* name, std::initializer_list<double> reflectance) {
    spectral::Material made{name, {}};
    made.donaldson.reflectance = Eigen::Map<const Eigen::VectorXd>(reflectance.begin(), 5);
    return made;
  };
  scene.materials = {material("a", {0.2, 0.3, 0.5, 0.8, 0.9}), material("b", {0.9, 0.7, 0.4, 0.3, 0.1})};
  // Emission alpha_i and excitation beta_i of rank-one materials, D_L = alpha beta^T 50 nm below the diagonal.
  for (std::size_t m = 0; m < 2; ++m) {
    Eigen::MatrixXd luminescence = Eigen::MatrixXd::Zero(5, 5);
    for (int em = 0; em < 5; ++em) {
      for (int ex = 0; ex < em; ++ex) luminescence(em, ex) = 0.01 * (em + 1) * (m == 0 ? 5 - ex : 1 + ex);
    }
    scene.materials[m].donaldson.luminescence = luminescence;
  }
  for (int o = 0; o < 2; ++o) {
    scene::Object object;
    object.name = o == 0 ? "low" : "high";
    object.material = o;
    const double x = o == 0 ? -10.0 - gap_mm / 2 : gap_mm / 2;
    object.patches.points = {{x, -5, 0}, {x + 10, -5, 0}, {x + 10, 5, 0}, {x, 5, 0}};
    object.patches.faces = {{0, 1, 2, 3}};
    scene.objects.push_back(object);
  }
  scene.directional_lights.push_back({"sun", {0, 0, -1}, Eigen::VectorXd::LinSpaced(5, 1.0, 3.0)});
  scene.camera.position = {0, 0, 1000};
  scene.camera.target = {0, 0, 0};
  scene.camera.horizontal_fov_deg = 2.0;
  scene.camera.width = 64;
  scene.camera.height = 16;
  return scene;
}

/// A picture of one row whose pixels show objects 0 and 1 with given shading terms.
RenderedImages picture(const scene::Scene& scene, const std::vector<std::array<double, 2>>& terms) {
  RenderedImages images;
  images.total = {static_cast<int>(terms.size()), 1, scene.grid.centers_nm(), {}};
  images.re = images.rr = images.total;
  const Eigen::VectorXd& light = scene.directional_lights[0].normal_irradiance;
  for (std::size_t p = 0; p < terms.size(); ++p) {
    const auto i = p % 2;
    const Eigen::VectorXd own = scene.materials[i].donaldson.reflectance.cwiseProduct(light);
    const Eigen::VectorXd both = own.cwiseProduct(scene.materials[1 - i].donaldson.reflectance);
    for (int band = 0; band < 5; ++band) {
      images.re.value.push_back(static_cast<float>(terms[p][0] * own[band]));
      images.rr.value.push_back(static_cast<float>(terms[p][1] * both[band]));
      images.total.value.push_back(images.re.value.back() + images.rr.value.back());
    }
    images.object.push_back(static_cast<int>(i));
    images.coverage.push_back(1.0F);
  }
  return images;
}

TEST(PaperImages, AreRecoveredFromThePicture) {
  const scene::Scene scene = two_sheets(1.0);
  const std::vector<std::array<double, 2>> truth = {{0.3, 0.1}, {0.2, 0.0}, {0.0, 0.05}, {0.31, 0.2}};
  const radiosity::ShadingTerms terms = paper_shading_terms(scene, picture(scene, truth));
  for (std::size_t p = 0; p < truth.size(); ++p) {
    EXPECT_NEAR(terms.re[static_cast<Eigen::Index>(p)], truth[p][0], 1e-6) << "pixel " << p;
    EXPECT_NEAR(terms.rr[static_cast<Eigen::Index>(p)], truth[p][1], 1e-6) << "pixel " << p;
  }
}

TEST(PaperImages, RefuseScenesTheModelDoesNotFit) {
  scene::Scene scene = two_sheets(1.0);
  const RenderedImages images = picture(scene, {{0.3, 0.1}});
  scene.materials[1].donaldson.reflectance.setConstant(0.5);
  try {
    paper_shading_terms(scene, images);
    FAIL() << "grey neighbour accepted";
  } catch (const InvalidInput& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("proportional"));
  }
  scene.objects.push_back(scene.objects[0]);
  EXPECT_THROW(paper_shading_terms(scene, images), InvalidInput);
}

TEST(PaperImages, RatioScalesAllButDirectLight) {
  const scene::Scene scene = two_sheets(1.0);
  const RenderedImages images = picture(scene, {{0.3, 0.1}, {0.2, 0.15}});
  const RenderedImages one = paper_images(scene, images);
  const RenderedImages more = paper_images(scene, images, 1.5);
  for (std::size_t k = 0; k < one.total.value.size(); ++k) {
    EXPECT_NEAR(one.re.value[k], images.re.value[k], 1e-6);
    EXPECT_EQ(more.le.value[k], one.le.value[k]);
    EXPECT_NEAR(more.rl.value[k], 1.5F * one.rl.value[k], 1e-6);
    EXPECT_NEAR(more.total.value[k] - one.total.value[k],
                0.5F * (one.rr.value[k] + one.lr.value[k] + one.ll.value[k] + one.rl.value[k]), 1e-6);
  }
}

TEST(ContactRegion, HoldsThePixelsNearTheNeighbour) {
  const scene::Scene scene = two_sheets(1.0);
  const radiosity::Elements elements = radiosity::make_elements(scene);
  const std::vector<int> region = contact_region(scene, elements, 4.0);
  // At z = 0 the picture is 2 · 1000 tan 1° wide; a point x < -0.5 lies x_edge - x from the sheet that begins at +0.5.
  const double width_mm = 2000.0 * std::tan(std::numbers::pi / 180.0);
  for (int column = 0; column < 64; ++column) {
    const double x = (2.0 * (column + 0.5) / 64.0 - 1.0) * width_mm / 2.0;
    int expected = -1;
    if (x < -0.5 && x > -10.5 && 0.5 - x < 4.0) expected = 1;
    if (x > 0.5 && x < 10.5 && x + 0.5 < 4.0) expected = 0;
    EXPECT_EQ(region[static_cast<std::size_t>(8 * 64 + column)], expected) << "x = " << x;
  }
}

}  // namespace
}  // namespace interglow::rendering
