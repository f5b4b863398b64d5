// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/visibility.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;

void add_quad(Faces& faces, const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  const int first = static_cast<int>(faces.points.size());
  faces.points.insert(faces.points.end(), {a, b, c, d});
  faces.corners.push_back({first, first + 1, first + 2, first + 3});
  faces.object.push_back(0);
}

void add_triangle(Faces& faces, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const int first = static_cast<int>(faces.points.size());
  faces.points.insert(faces.points.end(), {a, b, c});
  faces.corners.push_back({first, first + 1, first + 2, -1});
  faces.object.push_back(0);
}

Faces square_below_triangle(double scale) {
  Faces faces;
  add_quad(faces, scale * Vector3d(0, 0, 0), scale * Vector3d(1, 0, 0), scale * Vector3d(1, 1, 0),
           scale * Vector3d(0, 1, 0));
  add_triangle(faces, scale * Vector3d(0, 0, 1), scale * Vector3d(0, 1, 1), scale * Vector3d(1, 0, 1));
  return faces;
}

TEST(Visibility, FindsTheNearestFaceAtAnyScale) {
  for (double scale : {1e-6, 1.0, 1e6}) {
    const Visibility visibility(square_below_triangle(scale));
    const std::vector<Vector3d> directions = {{0, 0, -1}, {0.5, 0.5, -3}, {2, 0, -3}, {0, 0, 1}};
    std::vector<int> faces(directions.size());
    visibility.first_faces(scale * Vector3d(0.25, 0.25, 3.0), directions, faces);
    EXPECT_EQ(faces, (std::vector<int>{1, 0, -1, -1})) << scale;
  }
}

TEST(Visibility, HalfLinesAreBlockedAheadOnly) {
  for (double scale : {1e-6, 1.0, 1e6}) {
    const Visibility visibility(square_below_triangle(scale));
    const auto blocked = [&](const Vector3d& from, const Vector3d& direction, int face) {
      return visibility.blocked({scale * from, direction, face, -1, true});
    };
    EXPECT_TRUE(blocked({0.25, 0.25, 0.0}, {0, 0, 1}, 0)) << scale;
    EXPECT_FALSE(blocked({0.75, 0.75, 0.0}, {0, 0, 1}, 0)) << scale;  // past the triangle
    EXPECT_FALSE(blocked({0.25, 0.25, 1.0}, {0, 0, 1}, 1)) << scale;
    EXPECT_TRUE(blocked({0.25, 0.25, 1.0}, {0, 0, -1}, 1)) << scale;  // the square
    EXPECT_FALSE(blocked({0.25, 0.25, -1.0}, {0, 0, -1}, -1)) << scale;
    // A start in a face's plane that is not known to be its own: a corner that several faces share.
    EXPECT_FALSE(blocked({0.0, 0.0, 1.0}, {0.1, 0.1, 1}, -1)) << scale;
  }
}

TEST(Visibility, FacesThatASegmentEndsOnDoNotBlockIt) {
  const Visibility visibility(square_below_triangle(1.0));
  EXPECT_FALSE(visibility.blocked({{0.25, 0.25, 0.0}, {0.25, 0.25, 1.0}, 0, 1}));
  EXPECT_TRUE(visibility.blocked({{0.25, 0.25, 0.0}, {0.25, 0.25, 1.5}, 0, -1}));
  EXPECT_FALSE(visibility.blocked({{0.75, 0.75, 0.0}, {0.75, 0.75, 1.5}, 0, -1}));
}

TEST(Visibility, AFaceThatOnlyTouchesASegmentDoesNotBlockIt) {
  Faces faces = square_below_triangle(1.0);
  // A wall that stands on the edge from which the segment starts.
  add_quad(faces, Vector3d(0, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 1, 1), Vector3d(0, 0, 1));
  const Visibility visibility(faces);
  EXPECT_FALSE(visibility.blocked({{0.0, 0.25, 0.0}, {0.5, 0.25, 1.0}, 0, 1}));
  EXPECT_FALSE(visibility.blocked({{0.0, 0.25, 0.0}, {0.0, 0.25, 0.9}, 0, -1}));
  EXPECT_TRUE(visibility.blocked({{0.5, 0.25, 0.5}, {-0.5, 0.25, 0.5}, -1, -1}));
}

TEST(Visibility, PacketsAgreeWithTheClosedFormOfOneTriangle) {
  const Visibility visibility(square_below_triangle(1.0));
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(-0.2, 1.2);
  std::vector<Segment> segments;
  for (int k = 0; k < 1003; ++k) {
    const Vector3d from(uniform(random), uniform(random), 0.5);
    const Vector3d to(uniform(random), uniform(random), 1.5);
    segments.push_back({from, to, -1, -1});
  }
  std::vector<char> blocked(segments.size());
  visibility.blocked(segments, blocked);
  for (std::size_t k = 0; k < segments.size(); ++k) {
    const Vector3d middle = 0.5 * (segments[k].from + segments[k].to);
    const bool inside = middle.x() > 0 && middle.y() > 0 && middle.x() + middle.y() < 1;
    EXPECT_EQ(blocked[k] != 0, inside) << k << ": " << middle.transpose();
    EXPECT_EQ(visibility.blocked(segments[k]), inside) << k;
  }
}

TEST(Visibility, AnEmptySceneBlocksNothing) {
  const Visibility visibility{Faces{}};
  EXPECT_FALSE(visibility.blocked({{0, 0, 0}, {1, 1, 1}, -1, -1}));
}

}  // namespace
}  // namespace interglow::radiosity
