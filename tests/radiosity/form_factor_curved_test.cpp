// SPDX-License-Identifier: GPL-3.0-or-later
// Curved bodies in the reference have closed forms; facets inscribed in them come up to those with the square of their
// size.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "radiosity/form_factor_batch.h"
#include "tests/radiosity/form_factor_shapes.h"
#include "tests/radiosity/reference_cases.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;
using test::quad;
using test::triangle;
using Patches = std::vector<Polygon>;

constexpr double kPi = std::numbers::pi;

Vector3d on_circle(double radius, double turn, double z) {
  return {radius * std::cos(2 * kPi * turn), radius * std::sin(2 * kPi * turn), z};
}

Patches disk(double radius, double z, int facets, bool up) {
  Patches patches;
  for (int i = 0; i < facets; ++i) {
    const Vector3d a = on_circle(radius, double(i) / facets, z), b = on_circle(radius, double(i + 1) / facets, z);
    patches.push_back(up ? triangle({0, 0, z}, a, b) : triangle({0, 0, z}, b, a));
  }
  return patches;
}

Patches cylinder(double radius, double height, int facets, bool outwards) {
  Patches patches;
  for (int i = 0; i < facets; ++i) {
    const double from = double(i) / facets, to = double(i + 1) / facets;
    const Vector3d a = on_circle(radius, from, 0), b = on_circle(radius, to, 0), c = on_circle(radius, to, height),
                   d = on_circle(radius, from, height);
    patches.push_back(outwards ? quad(a, b, c, d) : quad(b, a, d, c));
  }
  return patches;
}

Patches sphere(double radius, double centre_z, int facets) {
  Patches patches;
  const auto at = [&](int ring, int sector) {
    const double polar = kPi * ring / (facets / 2);
    return on_circle(radius * std::sin(polar), double(sector) / facets, centre_z - radius * std::cos(polar));
  };
  for (int ring = 0; ring < facets / 2; ++ring)
    for (int i = 0; i < facets; ++i) {
      if (ring == 0)
        patches.push_back(triangle({0, 0, centre_z - radius}, at(1, i + 1), at(1, i)));
      else if (ring + 1 == facets / 2)
        patches.push_back(triangle(at(ring, i), at(ring, i + 1), {0, 0, centre_z + radius}));
      else
        patches.push_back(quad(at(ring, i), at(ring, i + 1), at(ring + 1, i + 1), at(ring + 1, i)));
    }
  return patches;
}

/// Form factor between two convex bodies, or a body and one that surrounds it, where facets hide no one but by turning
/// away.
double body_factor(const Patches& from, const Patches& to) {
  Patches all = from;
  all.insert(all.end(), to.begin(), to.end());
  const FormFactorBatch batch(all);
  std::vector<std::uint32_t> others;
  for (std::size_t j = from.size(); j < all.size(); ++j) others.push_back(static_cast<std::uint32_t>(j));
  std::vector<FormFactor> results(others.size());
  double exchange = 0, area = 0;
  for (std::uint32_t i = 0; i < from.size(); ++i) {
    batch.exchange_areas(i, others, 1e-10, results);
    for (const FormFactor& result : results) exchange += result.value;
    area += batch.area(i);
  }
  return exchange / area;
}

double expected(const char* id, const char* key) {
  return test::reference_case(id).at("expected").at(key).at("value").get<double>();
}

/// The inscribed facets' error is a series in 1/n²: the next term moves the observed order by less than 0.1 at these n.
template <class Factor>
void expect_second_order(const char* id, double exact, Factor factor) {
  const double coarse = std::abs(factor(16) - exact), middle = std::abs(factor(32) - exact),
               fine = std::abs(factor(64) - exact);
  EXPECT_NEAR(std::log2(coarse / middle), 2.0, 0.1) << id;
  EXPECT_NEAR(std::log2(middle / fine), 2.0, 0.05) << id;
  EXPECT_LT(fine, 4e-3) << id;  // (2π/64)²/2 is 5e-3 of the radius
}

TEST(FormFactorCurved, CoaxialDisksAreMetInSecondOrder) {
  expect_second_order("disks_coax_r1_r1_h1", expected("disks_coax_r1_r1_h1", "F12"),
                      [](int n) { return body_factor(disk(1, 0, n, true), disk(1, 1, n, false)); });
  expect_second_order("disks_coax_r1_r2_h1", expected("disks_coax_r1_r2_h1", "F12"),
                      [](int n) { return body_factor(disk(1, 0, n, true), disk(2, 1, n, false)); });
}

TEST(FormFactorCurved, CoaxialCylindersAreMetInSecondOrder) {
  expect_second_order("coax_cyl_r1_r2_h1", expected("coax_cyl_r1_r2_h1", "F12_inner_to_outer"),
                      [](int n) { return body_factor(cylinder(1, 1, n, true), cylinder(2, 1, n, false)); });
}

TEST(FormFactorCurved, SphereOverADiskIsMetInSecondOrder) {
  // The sphere's centre is h above the disk.
  expect_second_order("sphere_disk_R0.5_r1_h1", expected("sphere_disk_R0.5_r1_h1", "F_disk_sphere"),
                      [](int n) { return body_factor(disk(1, 0, n, true), sphere(0.5, 1, n)); });
}

}  // namespace
}  // namespace interglow::radiosity
