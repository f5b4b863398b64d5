// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/fit_mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>

#include "diagnostics/error.h"
#include "fit_scenes.h"
#include "radiosity/elements.h"

namespace interglow::fitting {
namespace {

using Eigen::Vector3d;

/// Length of the edges that belong to one face only.
double border_mm(const mesh::PatchMesh& mesh) {
  std::map<std::pair<int, int>, int> uses;
  for (const mesh::Face& face : mesh.faces) {
    const int count = mesh::corner_count(face);
    for (int k = 0; k < count; ++k) {
      const int a = face[static_cast<std::size_t>(k)];
      const int b = face[static_cast<std::size_t>((k + 1) % count)];
      ++uses[std::minmax(a, b)];
    }
  }
  double length = 0.0;
  for (const auto& [edge, count] : uses) {
    EXPECT_LE(count, 2);
    if (count == 1)
      length += (mesh.points[static_cast<std::size_t>(edge.first)] - mesh.points[static_cast<std::size_t>(edge.second)])
                    .norm();
  }
  return length;
}

TEST(FitMesh, RoundBodiesGetPointsOnTheirSurface) {
  // Half cylinders of radius 20 mm from 16 faces that turn by at most 20 degrees: the middle of the cubic lies within
  // 3/128 turn⁴ radii of the circle, and chords of turn t are shorter than their arcs by t²/24.
  const scene::Scene coarse = test::half_cylinders({.around = 16, .along = 4});
  const scene::Scene fine = fit_mesh(coarse, {.most_turn_deg = 5.0, .contact_halvings = 0});
  for (std::size_t o = 0; o < 2; ++o) {
    const double axis = o == 0 ? -20.0 : 20.0;
    for (const Vector3d& p : fine.objects[o].patches.points)
      EXPECT_NEAR(std::hypot(p.x() - axis, p.z()), 20.0,
                  3.0 / 128.0 * 20.0 * std::pow(20.0 * std::numbers::pi / 180.0, 4));
    const double round = std::numbers::pi * 20.0 * 50.0;
    EXPECT_LT(mesh::total_area(fine.objects[o].patches), round);
    EXPECT_GT(mesh::total_area(fine.objects[o].patches),
              round * (1.0 - std::pow(5.0 * std::numbers::pi / 180.0, 2) / 24.0));
    // Faces stay quads, as the surface bends one way; their normals are the circle's.
    for (std::size_t f = 0; f < fine.objects[o].patches.faces.size(); ++f) {
      const mesh::Face& face = fine.objects[o].patches.faces[f];
      ASSERT_EQ(mesh::corner_count(face), 4) << "face " << f;
      const Vector3d p = fine.objects[o].patches.points[static_cast<std::size_t>(face[2])];
      const Vector3d normal(p.x() - axis, 0.0, p.z());
      EXPECT_GT(fine.objects[o].patches.corner_normals[f][2].dot(normal.normalized()), 1.0 - 1e-6);
    }
  }
}

TEST(FitMesh, FacesFollowTheLinesWhereOthersStand) {
  // The arch stands on x = ±20, |y| < 25: no face of the plane has points on both sides of these lines, and the plane
  // is still whole: its area is that of the square, and its border the square's.
  const scene::Scene coarse = test::arch_on_plane({.around = 9, .along = 4});
  const scene::Scene fine = fit_mesh(coarse, {});
  const mesh::PatchMesh& plane = fine.objects[1].patches;
  EXPECT_NEAR(mesh::total_area(plane), 110.0 * 110.0, 1e-8);
  EXPECT_NEAR(border_mm(plane), 440.0, 1e-9);
  for (std::size_t f = 0; f < plane.faces.size(); ++f) {
    double low = 1e9, high = -1e9, near = 1e9;
    for (int k = 0; k < mesh::corner_count(plane.faces[f]); ++k) {
      const Vector3d& p = plane.points[static_cast<std::size_t>(plane.faces[f][static_cast<std::size_t>(k)])];
      low = std::min(low, std::abs(p.x()));
      high = std::max(high, std::abs(p.x()));
      near = std::min(near, std::abs(p.y()));
    }
    EXPECT_FALSE(low < 20.0 - 1e-6 && high > 20.0 + 1e-6 && near < 25.0 - 0.1)
        << "face " << f << " from |x| = " << low << " to " << high;
  }
}

TEST(FitMesh, FacesShrinkTowardsContacts) {
  // Outside the arch's foot the faces are no longer than 0.6 of their farther end's distance, down to a quarter of
  // what they were.
  const scene::Scene coarse = test::arch_on_plane({.around = 10, .along = 4});
  const scene::Scene fine = fit_mesh(coarse, {.contact_halvings = 2});
  const scene::Scene plain = fit_mesh(coarse, {.contact_halvings = 0});
  const auto narrowest = [](const mesh::PatchMesh& mesh) {
    double width = 1e9;
    for (const mesh::Face& face : mesh.faces) {
      double low = 1e9, high = -1e9;
      bool outside = true;
      for (int k = 0; k < mesh::corner_count(face); ++k) {
        const Vector3d& p = mesh.points[static_cast<std::size_t>(face[static_cast<std::size_t>(k)])];
        outside = outside && std::abs(p.x()) > 20.0 - 1e-9 && std::abs(p.y()) < 25.0;
        low = std::min(low, p.x());
        high = std::max(high, p.x());
      }
      if (outside) width = std::min(width, high - low);
    }
    return width;
  };
  EXPECT_NEAR(narrowest(fine.objects[1].patches) / narrowest(plain.objects[1].patches), 0.25, 1e-9);
}

TEST(FitMesh, FacesOfCuspsAreShortBesideTheirEnds) {
  // Below 5 mm the gap between the half cylinders, 2 (20 - sqrt(400 - z²)), is narrower than 1.26 mm. Their faces are
  // 10 mm long; those at the ends of the cusp are halved twice, those in its middle not at all.
  const scene::Scene fine = fit_mesh(test::half_cylinders({.around = 16, .along = 5}), {.contact_halvings = 2});
  for (const scene::Object& object : fine.objects) {
    int ends = 0, middles = 0;
    for (std::size_t f = 0; f < object.patches.faces.size(); ++f) {
      Vector3d low = Vector3d::Constant(1e9), high = -low, across = Vector3d::Zero();
      for (int k = 0; k < mesh::corner_count(object.patches.faces[f]); ++k) {
        const Vector3d& p =
            object.patches.points[static_cast<std::size_t>(object.patches.faces[f][static_cast<std::size_t>(k)])];
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
        across = across.cwiseMax(p.cwiseAbs());
      }
      if (high.z() > 5.0 || across.x() > 5.0) continue;
      if (across.y() > 25.0 - 1e-9) {
        EXPECT_NEAR(high.y() - low.y(), 2.5, 1e-9) << "face " << f;
        ++ends;
      }
      if (across.y() < 5.0 + 1e-9) {
        EXPECT_NEAR(high.y() - low.y(), 10.0, 1e-9) << "face " << f;
        ++middles;
      }
    }
    EXPECT_GT(ends, 0);
    EXPECT_GT(middles, 0);
  }
}

TEST(FitMesh, FarObjectsAndFlatOnesStayAsTheyAre) {
  const scene::Scene scene = test::single_plane({.around = 5});
  const scene::Scene same = fit_mesh(scene, {});
  EXPECT_EQ(same.objects[0].patches.faces, scene.objects[0].patches.faces);
  EXPECT_EQ(same.objects[0].patches.points, scene.objects[0].patches.points);
}

TEST(FitMesh, ParamsOutOfRangeAreRefused) {
  const auto message = [](const FitMeshParams& params) -> std::string {
    try {
      validate(params);
    } catch (const InvalidParams& error) {
      return error.what();
    }
    return {};
  };
  EXPECT_NE(message({.most_turn_deg = 0.1}).find("most_turn_deg is 0.1"), std::string::npos);
  EXPECT_NE(message({.contact_halvings = 9}).find("contact_halvings is 9"), std::string::npos);
  EXPECT_NE(message({.most_faces = 0}).find("most_faces is 0"), std::string::npos);
}

}  // namespace
}  // namespace interglow::fitting
