// SPDX-License-Identifier: GPL-3.0-or-later
// Plates that nearly touch what they hide: entries of the operator against one pair at a time, past all other faces as
// occluders, which asks nothing about who may block whom.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "radiosity/element_tree.h"
#include "radiosity/occluded_form_factor.h"
#include "radiosity/transport.h"
#include "radiosity/transport_assembly.h"
#include "tests/radiosity/scenes.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;
using testing::object;

/// Floor and ceiling, and plates of 0.1 to 2 over the floor, under the ceiling and over one another, at gaps of 1e-7 to
/// 0.1 and angles of 1e-8 to 0.3; some reach beyond what they lie over.
scene::Scene plates(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit;
  const auto between = [&](double low, double high) { return low + (high - low) * unit(random); };
  const auto magnitude = [&](double low, double high) { return std::exp(between(std::log(low), std::log(high))); };
  scene::Scene scene;
  const auto add = [&](const Vector3d& corner, const Vector3d& u, const Vector3d& v, bool both) {
    mesh::PatchMesh made;
    testing::add_grid(made, corner, u, v, 1, 1);
    scene.objects.push_back(object("plate", made));
    if (both) scene.objects.back().sides = scene::Sides::kTwo;
  };
  add({0, 0, 0}, Vector3d::UnitX(), Vector3d::UnitY(), false);
  add({0, 0, 1}, Vector3d::UnitY(), Vector3d::UnitX(), false);
  double low = 0.0, high = 1.0;
  for (int k = 0; k < 4; ++k) {
    const double tilt = magnitude(1e-8, 0.3), turn = between(0, 6.28), around = between(0, 6.28);
    const Vector3d flat(std::cos(turn), std::sin(turn), 0), across(-std::sin(turn), std::cos(turn), 0);
    const Vector3d axis(std::cos(around), std::sin(around), 0);
    const Eigen::AngleAxisd tilted(tilt, axis);
    const Vector3d u = tilted * (magnitude(0.1, 2.0) * flat), v = tilted * (magnitude(0.1, 2.0) * across);
    const Vector3d corner(between(0, 1), between(0, 1), 0);
    const Vector3d start = corner - 0.5 * (u + v);
    double least = 0.0, most = 0.0;  // heights of the corners over the first
    for (const Vector3d& to : {u, v, Vector3d(u + v)}) least = std::min(least, to.z()), most = std::max(most, to.z());
    const double gap = magnitude(1e-7, 0.1);
    const bool below = unit(random) < 0.5;
    const double z = below ? low + gap - least : high - gap - most;
    if (z + least <= low || z + most >= high) continue;
    (below ? low : high) = below ? z + most : z + least;
    add({start.x(), start.y(), z}, u, v, true);
  }
  return scene;
}

TEST(ClosePlates, EntriesAgreeWithSinglePairs) {
  constexpr double kTolerance = 1e-5;
  int pairs = 0, hidden = 0;
  for (const std::uint64_t seed : {1, 13, 23, 29}) {
    const Elements elements = make_elements(plates(seed));
    const ElementTree tree(elements);
    const Assembly assembly = assemble(elements, {.tolerance = kTolerance}, {});
    const Transport transport = Transport::build(elements, {.tolerance = kTolerance});
    const int count = static_cast<int>(elements.size());
    for (int i = 0; i < count; ++i)
      for (int j = 0; j < i; ++j) {
        const auto face = [&](int e) { return elements.face[static_cast<std::size_t>(e)]; };
        if (face(i) == face(j)) continue;
        const FormFactor whole = form_factor(tree.polygon(i), tree.polygon(j), {}, 1e-6);
        if (whole.value <= 0.0) continue;
        std::vector<Polygon> others;
        std::vector<char> taken(elements.faces.corners.size(), 0);
        for (int e = 0; e < count; ++e) {
          char& is_taken = taken[static_cast<std::size_t>(face(e))];
          if (face(e) != face(i) && face(e) != face(j) && is_taken == 0) others.push_back(tree.polygon(e));
          is_taken = 1;
        }
        const FormFactor expected = form_factor(tree.polygon(i), tree.polygon(j), others, 1e-6);
        // Where it falls short it says so.
        const double granted = std::max(kTolerance, assembly.error_estimate[i]) + expected.error_estimate;
        EXPECT_NEAR(transport.form_factor(i, j), expected.value, granted)
            << "scene " << seed << ", elements " << i << " and " << j << ", unoccluded " << whole.value;
        ++pairs;
        hidden += expected.value < 0.99 * whole.value ? 1 : 0;
      }
  }
  EXPECT_GT(pairs, 50);
  EXPECT_GT(hidden, 25);
  RecordProperty("pairs", pairs);
  RecordProperty("hidden", hidden);
}

}  // namespace
}  // namespace interglow::radiosity
