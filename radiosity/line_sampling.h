// SPDX-License-Identifier: GPL-3.0-or-later
/// How much of what two elements exchange is visible, estimated by lines between them.
#pragma once

#include <cstddef>
#include <vector>

#include "radiosity/element_tree.h"
#include "radiosity/elements.h"
#include "radiosity/shadow_cells.h"
#include "radiosity/visibility.h"

namespace interglow::radiosity {

/// Two elements and what is known of their visible share so far.
struct SampledPair {
  int i;
  int j;
  double exchange;     ///< unoccluded exchange area [mm²]
  double tolerance;    ///< wanted error of the visible exchange area [mm²]
  int at = 0;          ///< the caller's number
  int lines = 0;       ///< tried
  double whole = 0.0;  ///< what the lines carry
  double seen = 0.0;   ///< of it, what arrives
  ShadowResult result{};
};

/// Lines between points of a rank-1 lattice over both elements, weighted by cosines over squared distance. The same
/// lines for the same pair of numbers, so that results do not depend on threads.
class LineSampler {
 public:
  /// Share of a line that stays in doubt, also where all lines agree.
  static constexpr double kDoubt = 0.5;

  /// Keeps references to all.
  LineSampler(const Elements& elements, const ElementTree& tree, const Visibility& visibility)
      : elements_(elements), tree_(tree), visibility_(visibility) {}

  /// Doubles the lines of every pair, from `fewest` to `most`, until its tolerance is met; those of all pairs are
  /// traced together. Pairs may come with lines. The error estimate is that of independent samples, and half a line in
  /// doubt.
  void sample(std::vector<SampledPair>& pairs, int fewest, int most);

  /// Lines one by one: add, trace, look.
  void clear();
  /// Adds line `number` between two elements; false if it carries nothing.
  bool add_line(int i, int j, int number);
  void trace();
  std::size_t size() const { return segments_.size(); }
  double weight(std::size_t line) const { return weights_[line]; }
  bool blocked(std::size_t line) const { return blocked_[line] != 0; }

 private:
  static bool settle(SampledPair& pair);

  const Elements& elements_;
  const ElementTree& tree_;
  const Visibility& visibility_;
  std::vector<Segment> segments_;
  std::vector<char> blocked_;
  std::vector<double> weights_;
  std::vector<int> active_;
  std::vector<std::size_t> ends_;
};

}  // namespace interglow::radiosity
