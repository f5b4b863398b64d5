// SPDX-License-Identifier: GPL-3.0-or-later
#include "radiosity/transport_assembly.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <vector>

#include "radiosity/blockers.h"
#include "radiosity/element_tree.h"
#include "radiosity/form_factor.h"
#include "radiosity/form_factor_batch.h"
#include "radiosity/risen_blockers.h"
#include "radiosity/shadow_cells.h"
#include "radiosity/visibility.h"

namespace interglow::radiosity {
namespace {

using Eigen::Vector3d;
using Candidates = std::vector<int>;

/// Elements a side of a tile: small enough to stay in the first-level cache with its vectors, large enough for dense
/// products.
constexpr int kTileSize = 32;
/// Pieces of parallel work to aim at: enough to keep many cores busy to the end.
constexpr std::size_t kTasks = 1024;

/// More polygons than this in the way of one pair are sampled by rays: clipping would cost more than the tolerance is
/// worth.
constexpr std::size_t kMostClipped = 12;
/// With at most this many bodies in a scene all of them are handed down the tree of clusters; more are searched for
/// each tile.
constexpr std::size_t kMostHandedDown = 64;
/// Lines between two clusters, one of them black, that must all be blocked for the pair to be dropped.
constexpr int kClusterLines = 256;
/// Lines of a sampled pair that one line does not settle.
constexpr int kFewestLines = 4;
constexpr int kMostLines = 4096;

struct Problem {
  const Elements& elements;
  const TransportParams& params;
  ElementTree tree;
  Blockers blockers;
  std::vector<int> tile_of_node;              ///< number of the tile cluster a node is, -1 if it is none
  std::vector<std::uint64_t> hidden_objects;  ///< by node: bit o: nothing of object o rises above any member's plane
  std::vector<char> black;                    ///< by node: all members are black
  std::vector<double> rise;      ///< by node: what rises less above the members' planes counts as below them [mm]
  double entry_tolerance = 0.0;  ///< of one form factor
  std::optional<FormFactorBatch> kernel;
  std::optional<Visibility> visibility;
  std::optional<RisenBlockers> risen;
};

struct NodePair {
  int a;
  int b;
};

struct Shaft {
  std::array<Vector3d, 16> corner;
  int a_corners = 0;
  int corners = 0;
  Box hull = Box::empty();
};

/// Whether every line between the two ends of a shaft meets the body: for a convex body it is enough that all lines
/// between corners do.
bool covers(const ConvexBody& body, const Shaft& shaft, double flat) {
  for (int i = 0; i < shaft.a_corners; ++i) {
    for (int j = shaft.a_corners; j < shaft.corners; ++j) {
      const Vector3d& p = shaft.corner[static_cast<std::size_t>(i)];
      const Vector3d& q = shaft.corner[static_cast<std::size_t>(j)];
      if (body.solid) {
        double enter = 0.0;
        double leave = 1.0;
        for (const ConvexBody::Face& face : body.face) {
          const double hp = face.height(p);
          const double hq = face.height(q);
          if (hp >= -flat && hq >= -flat) return false;
          if (hp > 0.0)
            enter = std::max(enter, hp / (hp - hq));
          else if (hq > 0.0)
            leave = std::min(leave, hp / (hp - hq));
        }
        if (!(enter < leave)) return false;
      } else {
        const ConvexBody::Face& plane = body.face[0];
        const double hp = plane.height(p);
        const double hq = plane.height(q);
        if (!((hp > flat && hq < -flat) || (hp < -flat && hq > flat))) return false;
        const Vector3d x = (q * hp - p * hq) / (hp - hq);
        for (std::size_t k = 0; k < body.vertex.size(); ++k) {
          const Vector3d edge = body.vertex[k + 1 < body.vertex.size() ? k + 1 : 0] - body.vertex[k];
          if (plane.normal.cross(edge).dot(x - body.vertex[k]) < 0.0) return false;
        }
      }
    }
  }
  return true;
}

/// Works through pairs of clusters of one task.
class Descent {
 public:
  explicit Descent(const Problem& problem) : problem_(problem) {}

  void run(NodePair pair) {
    Candidates all;
    if (problem_.blockers.body.size() <= kMostHandedDown) {
      for (std::size_t k = 0; k < problem_.blockers.body.size(); ++k) all.push_back(static_cast<int>(k));
    }
    to_tiles(pair.a, pair.b, all);
  }

  TileMatrix::Chunk chunk;
  TransportReport counts;
  struct RowError {
    int element;
    double squared;
  };
  std::vector<RowError> row_errors;

 private:
  /// A pair of a tile that blockers may reach.
  struct Shadowed {
    int row;
    int column;
    int first_candidate;
    int candidates;
  };

  /// A pair whose visible share is estimated by lines.
  struct SampledPair {
    int i;
    int j;
    double exchange;
    double tolerance;
    int at = 0;  ///< place in the tile
    int lines = 0;
    double whole = 0.0;
    double seen = 0.0;
    ShadowResult result{};
  };

  /// The line that every pair of a sampled tile gets: the first that carries something.
  struct FirstLine {
    int number = 0;
    double weight = 0.0;
    bool blocked = false;
  };

  const Cluster& cluster(int node) const { return problem_.tree.cluster(node); }
  double flat() const { return problem_.tree.flat(); }
  bool is_tile(int node) const { return problem_.tile_of_node[static_cast<std::size_t>(node)] >= 0; }
  int element(int position) const { return problem_.tree.order()[static_cast<std::size_t>(position)]; }

  /// Two black sides exchange nothing that anybody asks for, nor does one where black sides do not take part.
  bool idle(bool black_a, bool black_b) const {
    return problem_.params.black_sides ? black_a && black_b : black_a || black_b;
  }

  bool may_exchange(int a, int b) const {
    if (idle(problem_.black[static_cast<std::size_t>(a)] != 0, problem_.black[static_cast<std::size_t>(b)] != 0))
      return false;
    return may_face(cluster(a), cluster(b).box) && may_face(cluster(b), cluster(a).box);
  }

  void to_tiles(int a, int b, const Candidates& candidates) {
    if (!may_exchange(a, b)) return;
    Candidates left;
    if (!thin_out(a, b, candidates, left)) return;
    if (is_tile(a) && is_tile(b)) {
      tile(a, b, left);
      return;
    }
    if (problem_.black[static_cast<std::size_t>(a)] != problem_.black[static_cast<std::size_t>(b)] &&
        hidden_by_lines(a, b))
      return;
    if (a == b) {
      to_tiles(cluster(a).left, cluster(a).left, left);
      to_tiles(cluster(a).left, cluster(a).right, left);
      to_tiles(cluster(a).right, cluster(a).right, left);
    } else if (!is_tile(a) && (is_tile(b) || cluster(a).count >= cluster(b).count)) {
      to_tiles(cluster(a).left, b, left);
      to_tiles(cluster(a).right, b, left);
    } else {
      to_tiles(a, cluster(b).left, left);
      to_tiles(a, cluster(b).right, left);
    }
  }

  void tile(int a, int b, const Candidates& candidates) {
    if (problem_.tile_of_node[static_cast<std::size_t>(a)] > problem_.tile_of_node[static_cast<std::size_t>(b)])
      std::swap(a, b);
    row_first_ = cluster(a).first;
    column_first_ = cluster(b).first;
    rows_ = cluster(a).count;
    columns_ = cluster(b).count;
    facing_.assign(static_cast<std::size_t>(rows_ * columns_), 0);
    shadowed_.clear();
    candidate_pool_.clear();
    any_ = false;
    sampled_ = false;
    if (problem_.blockers.body.size() > kMostHandedDown) {
      Candidates found;
      if (!search(a, b, found)) return;
      sampled_ = found.size() > kMostClipped;
      if (sampled_) found.clear();
      pairs(a, b, found);
    } else {
      pairs(a, b, candidates);
    }
    if (!any_) return;
    in_doubt_ = 0.0;
    if (sampled_ && !sample_tile()) return;
    values_.assign(static_cast<std::size_t>(rows_ * columns_), 0.0);
    squared_error_a_.assign(static_cast<std::size_t>(rows_), 0.0);
    squared_error_b_.assign(static_cast<std::size_t>(columns_), 0.0);
    fill();
    if (a == b) {
      for (int r = 0; r < columns_; ++r) {
        for (int c = 0; c < r; ++c) {
          double& lower = values_[static_cast<std::size_t>(r * columns_ + c)];
          double& upper = values_[static_cast<std::size_t>(c * columns_ + r)];
          lower = upper = lower + upper;  // one of them is 0
        }
      }
    }
    const auto add_errors = [&](int first, const std::vector<double>& squared) {
      for (std::size_t k = 0; k < squared.size(); ++k) {
        if (squared[k] > 0.0) row_errors.push_back({element(first + static_cast<int>(k)), squared[k]});
      }
    };
    add_errors(row_first_, squared_error_a_);
    add_errors(column_first_, squared_error_b_);
    chunk.values.push_back(values_);
    chunk.tiles.push_back({problem_.tile_of_node[static_cast<std::size_t>(a)],
                           problem_.tile_of_node[static_cast<std::size_t>(b)], chunk.values.back().data()});
  }

  /// Marks the pairs of a tile that face one another and lists those that blockers may reach.
  void pairs(int a, int b, const Candidates& candidates) {
    const Cluster& ca = cluster(a);
    const Cluster& cb = cluster(b);
    if (a == b) {
      if (ca.count == 1) return;
      pairs(ca.left, ca.left, candidates);
      pairs(ca.left, ca.right, candidates);
      pairs(ca.right, ca.right, candidates);
      return;
    }
    if (!may_exchange(a, b)) return;
    if (candidates.empty()) {
      for (int p = ca.first; p < ca.first + ca.count; ++p) {
        for (int q = cb.first; q < cb.first + cb.count; ++q) mark(p, q);
      }
      return;
    }
    Candidates left;
    if (!thin_out(a, b, candidates, left)) return;
    if (ca.count == 1 && cb.count == 1) {
      if (!mark(ca.first, cb.first) || left.empty()) return;
      shadowed_.push_back({ca.first - row_first_, cb.first - column_first_, static_cast<int>(candidate_pool_.size()),
                           static_cast<int>(left.size())});
      candidate_pool_.insert(candidate_pool_.end(), left.begin(), left.end());
    } else if (cb.count == 1 ||
               (ca.count > 1 && (ca.box.high - ca.box.low).squaredNorm() >= (cb.box.high - cb.box.low).squaredNorm())) {
      pairs(ca.left, b, left);
      pairs(ca.right, b, left);
    } else {
      pairs(a, cb.left, left);
      pairs(a, cb.right, left);
    }
  }

  bool in_front_of(int i, const Polygon& other) const {
    return in_front(problem_.elements.normal.row(i).transpose(), problem_.tree.polygon(i).corner[0], other);
  }

  bool mark(int p, int q) {
    const int i = element(p);
    const int j = element(q);
    // Front and back of one face: rounding may put either in front of the other.
    if (problem_.elements.face[static_cast<std::size_t>(i)] == problem_.elements.face[static_cast<std::size_t>(j)])
      return false;
    if (idle(problem_.elements.material[static_cast<std::size_t>(i)] < 0,
             problem_.elements.material[static_cast<std::size_t>(j)] < 0))
      return false;
    if (!in_front_of(i, problem_.tree.polygon(j)) || !in_front_of(j, problem_.tree.polygon(i))) return false;
    ++counts.facing_pairs;
    any_ = true;
    facing_[static_cast<std::size_t>((p - row_first_) * columns_ + q - column_first_)] = 1;
    return true;
  }

  /// Error of a sampled exchange area that its rows can bear [mm²]. With e² = ε² (1/N + F) / 2 for an entry F the
  /// squares of a row, whose entries sum to at most 1, sum to ε²; the variance of n lines falls as F² / n, so that
  /// entries get lines in proportion to their size, which is the fewest lines for a given error of the row.
  double sampling_tolerance(int i, int j, double exchange) const {
    const double smaller = std::min(problem_.elements.area_mm2[i], problem_.elements.area_mm2[j]);
    return smaller * std::sqrt(0.5 * (problem_.entry_tolerance * problem_.entry_tolerance +
                                      problem_.params.tolerance * problem_.params.tolerance * exchange / smaller));
  }

  /// Exchange areas of the marked pairs of a tile, row by row; then what blockers leave of them.
  void fill() {
    results_.assign(static_cast<std::size_t>(rows_ * columns_), FormFactor{});
    for (int r = 0; r < rows_; ++r) {
      others_.clear();
      columns_of_others_.clear();
      for (int c = 0; c < columns_; ++c) {
        if (facing_[static_cast<std::size_t>(r * columns_ + c)] == 0) continue;
        others_.push_back(static_cast<std::uint32_t>(element(column_first_ + c)));
        columns_of_others_.push_back(c);
      }
      row_results_.assign(others_.size(), FormFactor{});
      problem_.kernel->exchange_areas(static_cast<std::uint32_t>(element(row_first_ + r)), others_,
                                      0.1 * problem_.entry_tolerance, row_results_);
      for (std::size_t k = 0; k < others_.size(); ++k) {
        // The vector kernel takes patches that rise above a plane by a few roundings of the scene as not rising.
        if (row_results_[k].method == FormFactorMethod::kZero) {
          const double smaller = std::min(problem_.elements.area_mm2[element(row_first_ + r)],
                                          problem_.elements.area_mm2[static_cast<Eigen::Index>(others_[k])]);
          row_results_[k] = exchange_area(problem_.tree.polygon(element(row_first_ + r)),
                                          problem_.tree.polygon(static_cast<int>(others_[k])),
                                          0.1 * problem_.entry_tolerance * smaller);
        }
        results_[static_cast<std::size_t>(r * columns_ + columns_of_others_[k])] = row_results_[k];
      }
    }
    sample_pairs();
    for (const Shadowed& pair : shadowed_) {
      FormFactor& exchange = results_[static_cast<std::size_t>(pair.row * columns_ + pair.column)];
      if (exchange.value > 0.0) shadow(pair, exchange);
    }
    for (int r = 0; r < rows_; ++r) {
      for (int c = 0; c < columns_; ++c) {
        const auto at = static_cast<std::size_t>(r * columns_ + c);
        if (facing_[at] == 0) continue;
        const FormFactor& exchange = results_[at];
        ++counts.pairs_by_method[static_cast<std::size_t>(exchange.method)];
        values_[at] = exchange.value;
        const double squared = exchange.error_estimate * exchange.error_estimate;
        const double area_a = problem_.elements.area_mm2[element(row_first_ + r)];
        const double area_b = problem_.elements.area_mm2[element(column_first_ + c)];
        squared_error_a_[static_cast<std::size_t>(r)] += squared / (area_a * area_a);
        squared_error_b_[static_cast<std::size_t>(c)] += squared / (area_b * area_b);
      }
    }
  }

  void shadow(const Shadowed& pair, FormFactor& exchange) {
    int outer = element(row_first_ + pair.row);
    int source = element(column_first_ + pair.column);
    if (outer > source) std::swap(outer, source);
    bodies_.clear();
    for (int k = 0; k < pair.candidates; ++k) {
      bodies_.push_back(
          &problem_.blockers
               .body[static_cast<std::size_t>(candidate_pool_[static_cast<std::size_t>(pair.first_candidate + k)])]);
    }
    const double bearable = sampling_tolerance(outer, source, exchange.value);
    ShadowResult result;
    if (bodies_.size() <= kMostClipped) {
      const double tolerance = 0.5 * problem_.entry_tolerance *
                               std::min(problem_.elements.area_mm2[outer], problem_.elements.area_mm2[source]);
      const bool swap = better_outer(source, outer);
      result = cells_.integrate(problem_.tree.polygon(swap ? source : outer),
                                problem_.tree.polygon(swap ? outer : source), bodies_, tolerance, flat());
    }
    // Patches that touch, with blockers in the gap: the cells give up before lines do.
    if (bodies_.size() > kMostClipped ||
        result.error_estimate > std::max(bearable, exchange.value / static_cast<double>(kMostLines))) {
      sampled_pairs_.assign(1, {outer, source, exchange.value, bearable});
      sample();
      const ShadowResult& sampled = sampled_pairs_[0].result;
      if (bodies_.size() > kMostClipped || sampled.error_estimate < result.error_estimate) result = sampled;
    }
    take_away(result, exchange);
  }

  /// Seen from the farther patch, shadows on the other one move less: their edges cross fewer of its corners.
  bool better_outer(int i, int j) const {
    const auto nearest = [&](int e) {
      double least = std::numeric_limits<double>::infinity();
      const Vector3d p = problem_.elements.centroid.row(e).transpose();
      for (const ConvexBody* body : bodies_)
        least = std::min(least, (p.cwiseMax(body->box.low).cwiseMin(body->box.high) - p).squaredNorm());
      return least;
    };
    return problem_.elements.area_mm2[i] * nearest(j) < problem_.elements.area_mm2[j] * nearest(i);
  }

  bool hidden_by_lines(int a, int b);
  bool sample_tile();
  void sample_pairs();
  void sample();
  static bool settle(SampledPair& pair);
  bool add_segment(int i, int j, int number);
  void take_away(const ShadowResult& result, FormFactor& exchange);

  void add_to_shaft(int node, Shaft& shaft) const {
    const Cluster& c = cluster(node);
    const auto add = [&](const Vector3d& p) {
      shaft.corner[static_cast<std::size_t>(shaft.corners++)] = p;
      shaft.hull.cover(p);
    };
    if (c.count == 1) {
      const Polygon& polygon = problem_.tree.polygon(element(c.first));
      for (int k = 0; k < polygon.corners; ++k) add(polygon.corner[static_cast<std::size_t>(k)]);
    } else {
      for (int k = 0; k < 8; ++k) add(c.box.corner(k));
    }
  }

  /// Whether some vertex of the body rises above some member's plane.
  bool may_rise_above(int node, const ConvexBody& body) const {
    const Cluster& c = cluster(node);
    if (problem_.risen && c.count == 1) return problem_.risen->above_element(element(c.first), body);
    if (c.sin_spread == 0.0) {
      return std::any_of(body.vertex.begin(), body.vertex.end(), [&](const Vector3d& v) {
        return c.axis.dot(v) - c.lowest > problem_.rise[static_cast<std::size_t>(node)];
      });
    }
    return may_face(c, body.box);
  }

  struct Between {
    int a;
    int b;
    Shaft shaft;
    std::uint64_t hidden;  ///< objects that stay below all planes of one side
  };

  Between between(int a, int b) const {
    Between result{
        a,
        b,
        {},
        problem_.hidden_objects[static_cast<std::size_t>(a)] | problem_.hidden_objects[static_cast<std::size_t>(b)]};
    add_to_shaft(a, result.shaft);
    result.shaft.a_corners = result.shaft.corners;
    add_to_shaft(b, result.shaft);
    return result;
  }

  static bool is_hidden(const Between& pair, int object) { return object < 64 && ((pair.hidden >> object) & 1U) != 0; }

  bool overlaps(const Box& box, const Shaft& shaft) const {
    return (box.low.array() <= shaft.hull.high.array() + flat()).all() &&
           (box.high.array() >= shaft.hull.low.array() - flat()).all();
  }

  /// Whether a body may cut a line between a member of one cluster and one of the other.
  bool may_cut(const ConvexBody& body, const Between& pair) const {
    const Shaft& shaft = pair.shaft;
    for (const ConvexBody::Face& face : body.face) {
      bool front = false;
      bool back = false;
      for (int c = 0; c < shaft.corners; ++c) {
        const double height = face.height(shaft.corner[static_cast<std::size_t>(c)]);
        front = front || height > flat();
        back = back || height < -flat();
      }
      if (!back || (!front && !body.solid)) return false;
    }
    if (!may_rise_above(pair.a, body) || !may_rise_above(pair.b, body)) return false;
    return !separated(shaft.corner.data(), shaft.corners, body.vertex.data(), static_cast<int>(body.vertex.size()),
                      flat());
  }

  bool hides_all(const ConvexBody& body, const Between& pair) {
    if (pair.a == pair.b || !covers(body, pair.shaft, flat())) return false;
    counts.blocked_pairs += static_cast<std::int64_t>(cluster(pair.a).count) * cluster(pair.b).count;
    return true;
  }

  /// Keeps the candidates that may cut a line between a member of `a` and one of `b`; false if one of them cuts all
  /// lines.
  bool thin_out(int a, int b, const Candidates& candidates, Candidates& left) {
    if (candidates.empty()) return true;
    const Between pair = between(a, b);
    for (const int k : candidates) {
      const ConvexBody& body = problem_.blockers.body[static_cast<std::size_t>(k)];
      if (is_hidden(pair, body.object) || !overlaps(body.box, pair.shaft) || !may_cut(body, pair)) continue;
      if (hides_all(body, pair)) return false;
      left.push_back(k);
    }
    return true;
  }

  /// The bodies that may cut lines between two tiles; stops once there are too many to be clipped. False if one cuts
  /// all lines.
  bool search(int a, int b, Candidates& found) {
    const Between pair = between(a, b);
    const int tile_a = problem_.tile_of_node[static_cast<std::size_t>(a)];
    const int tile_b = problem_.tile_of_node[static_cast<std::size_t>(b)];
    for (const BodyTree& tree : problem_.blockers.tree) {
      if (is_hidden(pair, tree.object)) continue;
      pending_.assign(1, 0);
      while (!pending_.empty()) {
        const BodyTree::Node& node = tree.node[static_cast<std::size_t>(pending_.back())];
        pending_.pop_back();
        if (!overlaps(node.box, pair.shaft)) continue;
        if (node.body < 0) {
          if (!may_face(cluster(a), node.box) || !may_face(cluster(b), node.box)) continue;
          pending_.push_back(node.right);
          pending_.push_back(node.left);
          continue;
        }
        const ConvexBody& body = problem_.blockers.body[static_cast<std::size_t>(node.body)];
        if (!problem_.risen->above_tile(tile_a, node.body) || !problem_.risen->above_tile(tile_b, node.body)) continue;
        if (!may_cut(body, pair)) continue;
        if (hides_all(body, pair)) return false;
        found.push_back(node.body);
        if (found.size() > kMostClipped) return true;
      }
    }
    return true;
  }

  const Problem& problem_;
  ShadowCells cells_;
  std::vector<const ConvexBody*> bodies_;
  std::vector<char> facing_;
  std::vector<Shadowed> shadowed_;
  std::vector<int> candidate_pool_;
  std::vector<std::uint32_t> others_;
  std::vector<int> columns_of_others_;
  std::vector<FormFactor> results_, row_results_;
  std::vector<Segment> segments_;
  std::vector<char> segment_blocked_;
  std::vector<double> weights_;
  std::vector<SampledPair> sampled_pairs_;
  std::vector<int> active_;
  std::vector<FirstLine> first_lines_;
  std::vector<std::size_t> places_;
  std::vector<std::size_t> ends_;
  std::vector<double> values_, squared_error_a_, squared_error_b_;
  int row_first_ = 0;
  int column_first_ = 0;
  int rows_ = 0;
  int columns_ = 0;
  std::vector<int> pending_;
  bool any_ = false;
  double in_doubt_ = 0.0;  ///< share of every pair of a sampled tile that its lines left open
  bool sampled_ = false;   ///< rays decide about this tile's pairs
};

void Descent::take_away(const ShadowResult& result, FormFactor& exchange) {
  exchange.error_estimate += result.error_estimate;
  if (!result.touched) return;
  if (result.covered) {
    ++counts.blocked_pairs;
    exchange.value = 0.0;
    exchange.method = FormFactorMethod::kBlocked;
    return;
  }
  ++counts.partially_visible_pairs;
  exchange.value = std::clamp(exchange.value - result.hidden, 0.0, exchange.value);
  exchange.method = FormFactorMethod::kOccluded;
}

/// Adds line `number` between two patches and its share of the exchange: points of a rank-1 lattice in four dimensions
/// (powers of the root of x^5 = x + 1), shifted from pair to pair. False if it carries nothing.
bool Descent::add_segment(int i, int j, int number) {
  constexpr std::array<double, 4> kStep = {0.8566748838545029, 0.733891856627126, 0.6287067210378087,
                                           0.5385972572236101};
  std::array<double, 4> x;
  for (std::size_t k = 0; k < 4; ++k) {
    const double turn = 0.5 + (number + 1) * kStep[k] + i * kStep[(k + 1) % 4] + j * kStep[(k + 2) % 4];
    x[k] = turn - std::floor(turn);
  }
  const auto at = [](const Polygon& polygon, double u, double v, double& weight) -> Vector3d {
    const auto& [a, b, c, d] = polygon.corner;
    if (polygon.corners == 3) {
      if (u + v > 1.0) {
        u = 1.0 - u;
        v = 1.0 - v;
      }
      return a + u * (b - a) + v * (c - a);
    }
    weight *= ((1 - v) * (b - a) + v * (c - d)).cross((1 - u) * (d - a) + u * (c - b)).norm();
    return (1 - u) * ((1 - v) * a + v * d) + u * ((1 - v) * b + v * c);
  };
  // Of a quad the Jacobian over its area: 1 on average, as for a triangle.
  double weight = 1.0;
  for (const int e : {i, j}) {
    if (problem_.tree.polygon(e).corners == 4) weight /= problem_.elements.area_mm2[e];
  }
  const Vector3d p = at(problem_.tree.polygon(i), x[0], x[1], weight);
  const Vector3d q = at(problem_.tree.polygon(j), x[2], x[3], weight);
  const Vector3d line = q - p;
  const double cosines = std::max(0.0, problem_.elements.normal.row(i).dot(line)) *
                         std::max(0.0, -problem_.elements.normal.row(j).dot(line));
  if (cosines <= 0.0) return false;
  const double squared = line.squaredNorm();
  weights_.push_back(weight * cosines / (squared * squared));
  segments_.push_back(
      {p, q, problem_.elements.face[static_cast<std::size_t>(i)], problem_.elements.face[static_cast<std::size_t>(j)]});
  return true;
}

/// The black inside of an open sheet is behind its outside for most of a scene, but no single face hides it. It sends
/// nothing back, so lines are proof enough: if all of them are blocked the clusters are dropped, with one line in
/// doubt.
bool Descent::hidden_by_lines(int a, int b) {
  if (problem_.blockers.body.size() <= kMostHandedDown) return false;
  const Cluster& ca = cluster(a);
  const Cluster& cb = cluster(b);
  constexpr std::array<double, 2> kStep = {0.7548776662466927, 0.5698402909980532};
  double factor = 0.0;  // mean over the lines of the form factor from a member of a to all of b
  int lines = 0;
  for (int number = 0; number < 4 * kClusterLines && lines < kClusterLines;) {
    segments_.clear();
    weights_.clear();
    constexpr int kTogether = 32;
    double areas = 0.0;
    for (int k = 0; k < kTogether; ++k, ++number) {
      const double x = (number + 0.5) * kStep[0];
      const double y = (number + 0.5) * kStep[1];
      const int i = element(ca.first + static_cast<int>((x - std::floor(x)) * ca.count));
      const int j = element(cb.first + static_cast<int>((y - std::floor(y)) * cb.count));
      if (add_segment(i, j, number)) areas += problem_.elements.area_mm2[j];
    }
    if (segments_.empty()) continue;
    segment_blocked_.resize(segments_.size());
    problem_.visibility->blocked(segments_, segment_blocked_);
    if (std::count(segment_blocked_.begin(), segment_blocked_.end(), 0) > 0) return false;
    lines += static_cast<int>(segments_.size());
    factor += areas / static_cast<double>(segments_.size()) * cb.count *
              std::accumulate(weights_.begin(), weights_.end(), 0.0) / std::numbers::pi;
  }
  if (lines < kClusterLines) return false;
  counts.blocked_pairs += static_cast<std::int64_t>(ca.count) * cb.count;
  const double in_doubt = std::min(1.0, factor / lines) / lines;
  for (int k = ca.first; k < ca.first + ca.count; ++k) row_errors.push_back({element(k), in_doubt * in_doubt});
  return true;
}

/// One line for every pair of the tile, before anything is computed. If they agree, all of the tile is clear or
/// blocked, with one line in doubt. False if the tile is blocked; `sampled_` stays set if the pairs must be looked at
/// one by one.
bool Descent::sample_tile() {
  segments_.clear();
  weights_.clear();
  first_lines_.assign(static_cast<std::size_t>(rows_ * columns_), {});
  places_.clear();
  for (int r = 0; r < rows_; ++r) {
    for (int c = 0; c < columns_; ++c) {
      const auto at = static_cast<std::size_t>(r * columns_ + c);
      if (facing_[at] == 0) continue;
      const int i = std::min(element(row_first_ + r), element(column_first_ + c));
      const int j = std::max(element(row_first_ + r), element(column_first_ + c));
      // Not all pairs share front sides along every line.
      int number = 0;
      bool found = false;
      for (; number < kFewestLines && !found; ++number) found = add_segment(i, j, number);
      first_lines_[at].number = number - 1;
      if (!found) continue;
      first_lines_[at].weight = weights_.back();
      places_.push_back(at);
    }
  }
  segment_blocked_.resize(segments_.size());
  problem_.visibility->blocked(segments_, segment_blocked_);
  for (std::size_t k = 0; k < places_.size(); ++k) first_lines_[places_[k]].blocked = segment_blocked_[k] != 0;
  const auto blocked = std::count(segment_blocked_.begin(), segment_blocked_.end(), 1);
  constexpr std::size_t kEnough = 64;
  if (segments_.size() < kEnough || (blocked != 0 && blocked != static_cast<std::ptrdiff_t>(segments_.size())))
    return true;
  sampled_ = false;
  in_doubt_ = 1.0 / static_cast<double>(segments_.size());
  if (blocked == 0) return true;
  counts.blocked_pairs += static_cast<std::int64_t>(std::count(facing_.begin(), facing_.end(), 1));
  return false;
}

/// All pairs of a tile whose lines disagree; where they agree, those pairs that are too large for what is left in
/// doubt.
void Descent::sample_pairs() {
  if (!sampled_ && in_doubt_ == 0.0) return;
  sampled_pairs_.clear();
  for (int r = 0; r < rows_; ++r) {
    for (int c = 0; c < columns_; ++c) {
      const auto at = static_cast<std::size_t>(r * columns_ + c);
      if (facing_[at] == 0 || !(results_[at].value > 0.0)) continue;
      const int i = std::min(element(row_first_ + r), element(column_first_ + c));
      const int j = std::max(element(row_first_ + r), element(column_first_ + c));
      const double exchange = results_[at].value;
      const double bearable = sampling_tolerance(i, j, exchange);
      if (!sampled_ && in_doubt_ * exchange <= bearable) {
        results_[at].error_estimate += in_doubt_ * exchange;
        continue;
      }
      SampledPair pair{i, j, exchange, bearable};
      pair.at = static_cast<int>(at);
      const FirstLine& line = first_lines_[at];
      pair.lines = line.number + 1;
      pair.whole = line.weight;
      pair.seen = line.blocked ? 0.0 : line.weight;
      sampled_pairs_.push_back(pair);
    }
  }
  sample();
  for (const SampledPair& pair : sampled_pairs_) take_away(pair.result, results_[static_cast<std::size_t>(pair.at)]);
}

/// Doubles the lines of every pair of `sampled_pairs_` until its tolerance is met; those of all pairs are traced
/// together.
void Descent::sample() {
  constexpr std::size_t kTogether = 4096;
  active_.clear();
  for (std::size_t k = 0; k < sampled_pairs_.size(); ++k) {
    if (sampled_pairs_[k].lines == 0 || !settle(sampled_pairs_[k])) active_.push_back(static_cast<int>(k));
  }
  for (int goal = kFewestLines; goal <= kMostLines && !active_.empty(); goal *= 2) {
    std::size_t kept = 0;
    for (std::size_t first = 0; first < active_.size();) {
      segments_.clear();
      weights_.clear();
      ends_.clear();
      std::size_t end = first;
      for (; end < active_.size() && segments_.size() < kTogether; ++end) {
        SampledPair& pair = sampled_pairs_[static_cast<std::size_t>(active_[end])];
        for (; pair.lines < goal; ++pair.lines) add_segment(pair.i, pair.j, pair.lines);
        ends_.push_back(segments_.size());
      }
      segment_blocked_.resize(segments_.size());
      problem_.visibility->blocked(segments_, segment_blocked_);
      std::size_t segment = 0;
      for (std::size_t k = first; k < end; ++k) {
        SampledPair& pair = sampled_pairs_[static_cast<std::size_t>(active_[k])];
        for (; segment < ends_[k - first]; ++segment) {
          pair.whole += weights_[segment];
          if (segment_blocked_[segment] == 0) pair.seen += weights_[segment];
        }
        if (!settle(pair)) active_[kept++] = active_[k];
      }
      first = end;
    }
    active_.resize(kept);
  }
}

/// The result of the lines so far; true if it meets the tolerance.
bool Descent::settle(SampledPair& pair) {
  const double share = pair.whole > 0.0 ? pair.seen / pair.whole : 1.0;
  pair.result.touched = share < 1.0;
  pair.result.covered = share == 0.0;
  pair.result.hidden = (1.0 - share) * pair.exchange;
  // A lattice does better than the spread of independent samples; half a sample stays in doubt.
  pair.result.error_estimate = pair.exchange * (std::sqrt(share * (1.0 - share) / pair.lines) + 0.5 / pair.lines);
  return pair.result.error_estimate <= pair.tolerance;
}

/// Numbers the tile clusters in order of position and returns their first positions.
std::vector<int> mark_tiles(const ElementTree& tree, int node, std::vector<int>& tile_of_node,
                            std::vector<int>& first) {
  if (node < 0) return {0};
  std::vector<int> pending = {node};
  while (!pending.empty()) {
    const int n = pending.back();
    pending.pop_back();
    const Cluster& cluster = tree.cluster(n);
    if (cluster.count <= kTileSize) {
      tile_of_node[static_cast<std::size_t>(n)] = static_cast<int>(first.size());
      first.push_back(cluster.first);
    } else {
      pending.push_back(cluster.right);
      pending.push_back(cluster.left);
    }
  }
  first.push_back(tree.cluster(node).count);
  return first;
}

/// For every element, which objects stay below its plane; for every node, what holds for all of its members.
void mark_nodes(Problem& problem) {
  const Elements& elements = problem.elements;
  const auto n = static_cast<std::size_t>(elements.size());
  const int objects = elements.faces.object.empty() ? 0 : std::min(64, elements.faces.object.back() + 1);
  std::vector<std::vector<Vector3d>> points(static_cast<std::size_t>(objects));
  for (const ConvexBody& body : problem.blockers.body) {
    if (body.object >= objects) continue;
    auto& all = points[static_cast<std::size_t>(body.object)];
    all.insert(all.end(), body.vertex.begin(), body.vertex.end());
  }
  std::vector<std::uint64_t> hidden(n, 0);
  std::vector<double> rise(n, 0.0);
  tbb::parallel_for(std::size_t{0}, n, [&](std::size_t e) {
    const Vector3d normal = elements.normal.row(static_cast<Eigen::Index>(e)).transpose();
    // Lines that leave at an angle of θ with the surface carry a share of θ² of the flux: rounded coordinates of a
    // convex object may rise this far without hiding anything that the tolerance would notice.
    rise[e] = std::max(problem.tree.flat(), std::sqrt(elements.area_mm2[static_cast<Eigen::Index>(e)]) *
                                                std::min(1e-5, 0.1 * std::sqrt(problem.entry_tolerance)));
    const double highest = normal.dot(problem.tree.polygon(static_cast<int>(e)).corner[0]) + rise[e];
    for (int o = 0; o < objects; ++o) {
      const auto& all = points[static_cast<std::size_t>(o)];
      if (std::all_of(all.begin(), all.end(), [&](const Vector3d& p) { return normal.dot(p) <= highest; }))
        hidden[e] |= std::uint64_t{1} << o;
    }
  });
  const int nodes = problem.tree.size();
  problem.hidden_objects.assign(static_cast<std::size_t>(nodes), ~std::uint64_t{0});
  problem.black.assign(static_cast<std::size_t>(nodes), 1);
  problem.rise.assign(static_cast<std::size_t>(nodes), std::numeric_limits<double>::infinity());
  // Children come after their parents.
  for (int node = nodes - 1; node >= 0; --node) {
    const Cluster& cluster = problem.tree.cluster(node);
    const auto at = static_cast<std::size_t>(node);
    if (cluster.count == 1) {
      const auto e = static_cast<std::size_t>(problem.tree.order()[static_cast<std::size_t>(cluster.first)]);
      problem.hidden_objects[at] = hidden[e];
      problem.rise[at] = rise[e];
      problem.black[at] = elements.material[e] < 0 ? 1 : 0;
      continue;
    }
    for (const int child : {cluster.left, cluster.right}) {
      problem.rise[at] = std::min(problem.rise[at], problem.rise[static_cast<std::size_t>(child)]);
      problem.hidden_objects[at] &= problem.hidden_objects[static_cast<std::size_t>(child)];
      problem.black[at] = static_cast<char>(problem.black[at] & problem.black[static_cast<std::size_t>(child)]);
    }
  }
}

/// Splits the pair of the root with itself into about kTasks pairs of clusters, in a fixed order.
std::vector<NodePair> make_tasks(const Problem& problem) {
  std::vector<NodePair> tasks = {{problem.tree.root(), problem.tree.root()}};
  const auto count = [&](int node) { return problem.tree.cluster(node).count; };
  const auto is_tile = [&](int node) { return problem.tile_of_node[static_cast<std::size_t>(node)] >= 0; };
  bool split_any = true;
  while (split_any && tasks.size() < kTasks) {
    split_any = false;
    std::vector<NodePair> next;
    for (const auto& [a, b] : tasks) {
      const Cluster& ca = problem.tree.cluster(a);
      const Cluster& cb = problem.tree.cluster(b);
      if (!may_face(ca, cb.box) || !may_face(cb, ca.box)) continue;
      if (is_tile(a) && is_tile(b)) {
        next.push_back({a, b});
        continue;
      }
      split_any = true;
      if (a == b) {
        next.insert(next.end(), {{ca.left, ca.left}, {ca.left, ca.right}, {ca.right, ca.right}});
      } else if (!is_tile(a) && (is_tile(b) || count(a) >= count(b))) {
        next.insert(next.end(), {{ca.left, b}, {ca.right, b}});
      } else {
        next.insert(next.end(), {{a, cb.left}, {a, cb.right}});
      }
    }
    tasks.swap(next);
  }
  return tasks;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

Assembly assemble(const Elements& elements, const TransportParams& params, const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  const Eigen::Index n = elements.size();
  Assembly assembly;
  assembly.error_estimate = Eigen::VectorXd::Zero(n);
  assembly.report.elements = n;
  assembly.report.pairs = n * (n - 1) / 2;
  Problem problem{elements, params, ElementTree(elements), {}, {}, {}, {}, {}, 0.0, {}, {}, {}};
  problem.entry_tolerance = params.tolerance / std::sqrt(static_cast<double>(std::max<Eigen::Index>(n, 1)));
  if (n == 0) return assembly;
  problem.tile_of_node.assign(static_cast<std::size_t>(2 * n), -1);
  std::vector<int> first;
  mark_tiles(problem.tree, problem.tree.root(), problem.tile_of_node, first);
  if (params.occlusion) {
    problem.blockers = make_blockers(elements, problem.tree.flat());
    problem.visibility.emplace(elements.faces);
  }
  std::vector<Polygon> polygons;
  for (int e = 0; e < static_cast<int>(n); ++e) polygons.push_back(problem.tree.polygon(e));
  problem.kernel.emplace(std::move(polygons));
  if (problem.blockers.body.size() > kMostHandedDown) {
    problem.risen.emplace(elements, problem.tree, problem.blockers, first, params.tolerance);
  }
  mark_nodes(problem);
  const std::vector<NodePair> tasks = make_tasks(problem);
  assembly.report.seconds_search = seconds_since(start);
  const auto factors_start = std::chrono::steady_clock::now();

  std::vector<TileMatrix::Chunk> chunks(tasks.size());
  std::vector<TransportReport> counts(tasks.size());
  std::vector<std::vector<Descent::RowError>> row_errors(tasks.size());
  std::atomic<std::size_t> done = 0;
  tbb::parallel_for(std::size_t{0}, tasks.size(), [&](std::size_t t) {
    Descent descent(problem);
    descent.run(tasks[t]);
    chunks[t] = std::move(descent.chunk);
    counts[t] = descent.counts;
    row_errors[t] = std::move(descent.row_errors);
    progress.update("form factors", static_cast<double>(++done) / static_cast<double>(tasks.size()));
  });
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    assembly.report.facing_pairs += counts[t].facing_pairs;
    assembly.report.partially_visible_pairs += counts[t].partially_visible_pairs;
    assembly.report.blocked_pairs += counts[t].blocked_pairs;
    for (std::size_t m = 0; m < counts[t].pairs_by_method.size(); ++m)
      assembly.report.pairs_by_method[m] += counts[t].pairs_by_method[m];
    for (const auto& [element, squared] : row_errors[t]) assembly.error_estimate[element] += squared;
  }
  assembly.error_estimate = assembly.error_estimate.cwiseSqrt();
  assembly.exchange = TileMatrix(problem.tree.order(), std::move(first), std::move(chunks));
  assembly.report.seconds_factors = seconds_since(factors_start);
  return assembly;
}

}  // namespace interglow::radiosity
