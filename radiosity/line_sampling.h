// SPDX-License-Identifier: GPL-3.0-or-later
/// How much of what two elements exchange is visible, told by lines between them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "radiosity/element_tree.h"
#include "radiosity/elements.h"
#include "radiosity/visibility.h"

namespace interglow::radiosity {

/// What lines between two elements carry, and what of it arrives.
struct LineSums {
  double whole = 0.0;
  double seen = 0.0;
  double whole_squares = 0.0;
  double seen_squares = 0.0;

  /// The visible share, without the bias that a ratio of two sums has to first order. One half if nothing is carried.
  double share() const;
  /// How many equal lines tell as much.
  double worth() const { return whole_squares > 0.0 ? whole * whole / whole_squares : 0.0; }
  /// Squared standard deviation of the share, as if the lines were independent: a lattice does better.
  double variance() const;
  LineSums operator+(const LineSums& other) const {
    return {whole + other.whole, seen + other.seen, whole_squares + other.whole_squares,
            seen_squares + other.seen_squares};
  }
  bool agree() const { return seen == 0.0 || seen == whole; }
};

/// Lines between points of a lattice over those parts of both elements that lie in front of the other's plane, weighted
/// so that their mean is that of cosines over squared distance over both elements. Of elements that are near, points of
/// the smaller one and directions uniform in the solid angle of the other. The lattice is moved by a hash of the two
/// numbers and the draw: draws are independent, pairs are, and results do not depend on threads.
class LineSampler {
 public:
  /// Keeps references to all.
  LineSampler(const Elements& elements, const ElementTree& tree, const Visibility& visibility)
      : elements_(elements), tree_(tree), visibility_(visibility) {}

  void clear();
  /// Adds lines between two elements, i < j, until `count` carry something; fewer if few do. Returns how many do.
  int add(int i, int j, std::uint64_t draw, int count);
  void trace();
  std::size_t size() const { return segments_.size(); }
  double weight(std::size_t line) const { return weights_[line]; }
  bool blocked(std::size_t line) const { return blocked_[line] != 0; }
  /// Of the traced lines [first, end).
  LineSums sums(std::size_t first, std::size_t end) const;

 private:
  const Elements& elements_;
  const ElementTree& tree_;
  const Visibility& visibility_;
  std::vector<Segment> segments_;
  std::vector<char> blocked_;
  std::vector<double> weights_;
};

}  // namespace interglow::radiosity
