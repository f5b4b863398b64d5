// SPDX-License-Identifier: GPL-3.0-or-later
// Error against time of ways to compute unoccluded form factors, one core: product rules of 1 to 6 points per
// direction, the kernel between centres without and with second moments, Gauss points on edges, the contour integral,
// random lines, and the automatic choice. Two families of pairs, by the gap between their centres in patch sizes: near
// (below 1.5: touching), middle (below 5) and far (below 17), and all: pairs as they come, at any gap.
//   cube    quads of a cube, 12 x 12 a face
//   turned  triangles, parallelograms and other quads in turn, turned at random, areas up to 4 apart
// 64 pairs of a patch are a list; the automatic choice gets 16 lists at a time, as from a tile of the operator. The
// error of every method is measured against the contour integral at round-off before the method is timed. At the end,
// for each point of the automatic choice, its time over that of the fastest other method of no larger error, from the
// least of all repetitions. scripts/plot_form_factor_error draws the result.
//   form_factor_error_benchmark --benchmark_repetitions=8 --benchmark_enable_random_interleaving=true
//     --benchmark_out=error.json --benchmark_out_format=json
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iostream>
#include <limits>
#include <map>
#include <numbers>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "radiosity/form_factor_batch.h"
#include "tests/radiosity/form_factor_shapes.h"

namespace {

using namespace interglow::radiosity;
using Eigen::Vector3d;

constexpr std::size_t kPairsOfAPatch = 64;  // so that a vector kernel has work
constexpr std::array<const char*, 4> kSets{"near", "middle", "far", "all"};
constexpr std::array<double, 4> kGapLimits{0.0, 1.5, 5.0, 17.0};  // in patch sizes, of the first three
constexpr std::size_t kGaps = 3, kAll = 3;

struct Pairs {
  std::uint32_t one;
  std::vector<std::uint32_t> others;
  std::vector<double> exact;  ///< exchange areas
};

struct Family {
  const char* name;
  std::vector<Polygon> patches;
  FormFactorBatch batch;
  std::array<std::vector<Pairs>, kSets.size()> pairs;
  Family(const char* given_name, std::vector<Polygon> given_patches)
      : name(given_name), patches(given_patches), batch(std::move(given_patches)) {}

  std::size_t count(std::size_t set) const {
    std::size_t sum = 0;
    for (const Pairs& p : pairs[set]) sum += p.others.size();
    return sum;
  }
  double least_area(std::uint32_t i, std::uint32_t j) const { return std::min(batch.area(i), batch.area(j)); }
  void add(Pairs& set, std::uint32_t other) const {
    set.others.push_back(other);
    set.exact.push_back(exchange_area(patches[set.one], patches[other], 0.0).value);
  }
};

Vector3d centre(const Polygon& p) {
  Vector3d sum = Vector3d::Zero();
  for (int k = 0; k < p.corners; ++k) sum += p.corner[static_cast<std::size_t>(k)];
  return sum / p.corners;
}

Vector3d normal(const Polygon& p) { return (p.corner[1] - p.corner[0]).cross(p.corner[2] - p.corner[0]).normalized(); }

Family cube() {
  constexpr int kSide = 12;
  Family made("cube", test::cube(kSide, false));
  const double size = std::sqrt(made.batch.area(0));
  constexpr std::uint32_t kFace = kSide * kSide;
  for (std::uint32_t i = kFace; i < made.batch.size(); i += 5) {
    std::array<Pairs, kSets.size()> of_patch;
    for (Pairs& set : of_patch) set.one = i;
    for (std::uint32_t j = 0; j < i / kFace * kFace; ++j) {
      const double gap = (centre(made.patches[i]) - centre(made.patches[j])).norm() / size;
      Pairs& set = of_patch[gap < kGapLimits[1] ? 0 : gap < kGapLimits[2] ? 1 : 2];
      if (set.others.size() < kPairsOfAPatch) made.add(set, j);
    }
    constexpr std::uint32_t kStep = 13;  // runs along no row or column; at most 56 pairs
    for (std::uint32_t j = i % kStep; j < i / kFace * kFace; j += kStep) made.add(of_patch[kAll], j);
    for (std::size_t k = 0; k < kSets.size(); ++k) {
      if (!of_patch[k].others.empty()) made.pairs[k].push_back(of_patch[k]);
    }
  }
  return made;
}

/// Patches of about unit size at any angle; each set holds one patch and 64 that face it wholly.
class TurnedPatches {
 public:
  Family family() {
    constexpr std::size_t kListsOfAGap = 24;
    std::vector<Polygon> patches;
    for (std::size_t gap = 0; gap < kGaps; ++gap)
      for (std::size_t list = 0; list < kListsOfAGap; ++list) {
        const Polygon one = shape(list);
        patches.push_back(one);
        for (std::size_t k = 0; k < kPairsOfAPatch; ++k) patches.push_back(partner(one, k, gap));
      }
    Family made("turned", std::move(patches));
    for (std::uint32_t i = 0; i < made.batch.size(); i += kPairsOfAPatch + 1) {
      Pairs set{i, {}, {}};
      for (std::uint32_t k = 1; k <= kPairsOfAPatch; ++k) made.add(set, i + k);
      made.pairs[kAll].push_back(set);
      made.pairs[i / (kPairsOfAPatch + 1) / kListsOfAGap].push_back(std::move(set));
    }
    return made;
  }

 private:
  double between(double low, double high) { return low + (high - low) * unit_(random_); }
  Vector3d direction() {
    for (;;) {
      const double x = between(-1, 1), y = between(-1, 1), z = between(-1, 1);
      const Vector3d v(x, y, z);
      if (v.squaredNorm() <= 1 && v.squaredNorm() > 0.01) return v.normalized();
    }
  }
  /// Centre about the origin, area 0.5 to 2.
  Polygon shape(std::size_t kind) {
    const Vector3d u = direction(), v = u.cross(direction()).normalized();
    const double stretch = std::sqrt(between(0.5, 1.5)), skew = between(-0.4, 0.4), lean = between(-0.3, 0.3);
    const auto at = [&](double s, double t) -> Vector3d { return stretch * s * u + (t / stretch) * (v + skew * u); };
    Polygon made = kind % 3 == 0   ? test::triangle(at(-0.8, -0.6), at(0.8, -0.6), at(lean, 0.9))
                   : kind % 3 == 1 ? test::quad(at(-0.5, -0.5), at(0.5, -0.5), at(0.5, 0.5), at(-0.5, 0.5))
                                   : test::quad(at(-0.5, -0.5), at(0.5, -0.5), at(0.4 + lean / 5, 0.6), at(-0.4, 0.5));
    const double size = std::sqrt(between(0.5, 2.0) / area(made));
    for (int k = 0; k < made.corners; ++k) made.corner[static_cast<std::size_t>(k)] *= size;
    return made;
  }
  static double area(const Polygon& p) {
    double sum = 0.0;
    for (std::size_t k = 1; k + 1 < static_cast<std::size_t>(p.corners); ++k)
      sum += (p.corner[k] - p.corner[0]).cross(p.corner[k + 1] - p.corner[0]).norm() / 2;
    return sum;
  }
  static bool in_front(const Polygon& patch, const Polygon& of) {
    for (int k = 0; k < patch.corners; ++k) {
      const double height = normal(of).dot(patch.corner[static_cast<std::size_t>(k)] - of.corner[0]);
      if (height < -1e-12) return false;
    }
    return true;
  }
  Polygon partner(const Polygon& one, std::size_t kind, std::size_t gap) {
    for (;;) {
      Polygon made = shape(kind);
      Vector3d move = between(std::max(kGapLimits[gap], 1.5), kGapLimits[gap + 1]) * direction();
      if (gap == 0) move = one.corner[kind % 3] - made.corner[0];  // touching at a corner
      for (int k = 0; k < made.corners; ++k) made.corner[static_cast<std::size_t>(k)] += move;
      if (in_front(made, one) && in_front(one, made)) return made;
    }
  }
  std::mt19937_64 random_{2026};
  std::uniform_real_distribution<double> unit_{0.0, 1.0};
};

/// What a method has written: values alone, or with their estimates.
struct Found {
  std::vector<double> values = std::vector<double>(kPairsOfAPatch);
  std::vector<FormFactor> results = std::vector<FormFactor>(kPairsOfAPatch);
  bool with_estimates = false;
  double value(std::size_t k) const { return with_estimates ? results[k].value : values[k]; }
};

/// Exchange areas of lists of pairs: as many at a time as the assembly of a transport operator has.
using Method = std::function<void(const Family&, std::span<const Pairs>, std::span<Found>)>;
constexpr std::size_t kLists = 16;

void do_all(const Family& family, std::size_t set, const Method& method, std::span<Found> found) {
  const std::span<const Pairs> pairs = family.pairs[set];
  for (std::size_t start = 0; start < pairs.size(); start += kLists) {
    const std::size_t count = std::min(kLists, pairs.size() - start);
    method(family, pairs.subspan(start, count), found.subspan(start, count));
  }
}

/// The same list by list.
Method each(std::function<void(const Family&, const Pairs&, Found&)> one) {
  return [one = std::move(one)](const Family& family, std::span<const Pairs> lists, std::span<Found> found) {
    for (std::size_t k = 0; k < lists.size(); ++k) one(family, lists[k], found[k]);
  };
}

void measure(benchmark::State& state, const Family& family, std::size_t set, const Method& method) {
  std::vector<Found> found(family.pairs[set].size());
  do_all(family, set, method, found);
  double squares = 0.0;
  double worst = 0.0;
  for (std::size_t list = 0; list < found.size(); ++list) {
    const Pairs& p = family.pairs[set][list];
    for (std::size_t k = 0; k < p.others.size(); ++k) {
      const double least_area = family.least_area(p.one, p.others[k]);
      const double error = std::abs(found[list].value(k) - p.exact[k]) / least_area;
      if (!std::isfinite(error)) return state.SkipWithError("a value is not finite");
      if (found[list].with_estimates && error > found[list].results[k].error_estimate / least_area + 1e-15)
        return state.SkipWithError("an error is above its estimate");
      squares += error * error;
      worst = std::max(worst, error);
    }
  }
  for (auto _ : state) {
    do_all(family, set, method, found);
    benchmark::DoNotOptimize(found.data());
    benchmark::ClobberMemory();
  }
  const auto count = static_cast<double>(family.count(set));
  state.counters["rms_error"] = std::sqrt(squares / count);
  state.counters["largest_error"] = worst;
  state.counters["seconds_a_pair"] =
      benchmark::Counter(count, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

Method automatic(double tolerance) {
  return [tolerance](const Family& family, std::span<const Pairs> lists, std::span<Found> found) {
    std::array<FormFactorBatch::Row, kLists> rows;
    for (std::size_t k = 0; k < lists.size(); ++k) {
      found[k].with_estimates = true;
      rows[k] = {lists[k].one, lists[k].others, {found[k].results.data(), lists[k].others.size()}};
    }
    family.batch.exchange_areas({rows.data(), lists.size()}, tolerance);
  };
}

Method fixed_rule(FixedRule rule) {
  return each([rule](const Family& family, const Pairs& p, Found& found) {
    family.batch.exchange_areas_by_rule(p.one, p.others, rule, {found.values.data(), p.others.size()});
  });
}

Method contour(double tolerance) {
  return each([tolerance](const Family& family, const Pairs& p, Found& found) {
    found.with_estimates = true;
    for (std::size_t k = 0; k < p.others.size(); ++k) {
      found.results[k] = exchange_area(family.patches[p.one], family.patches[p.others[k]],
                                       tolerance * family.least_area(p.one, p.others[k]));
    }
  });
}

/// cosθ cosθ' / (π r²) at random pairs of points: what a ray caster does where nothing is in the way.
Method random_lines(int lines) {
  return each([lines](const Family& family, const Pairs& p, Found& found) {
    std::mt19937_64 random(p.one);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    const auto at = [&](const Polygon& q) -> Vector3d {  // a quad is cut along its diagonal
      const Vector3d diagonal = q.corner[2] - q.corner[0];
      double u = unit(random), v = unit(random);
      const double last = q.corners == 3 ? 0.0 : diagonal.cross(q.corner[3] - q.corner[0]).norm();
      const double first = (q.corner[1] - q.corner[0]).cross(diagonal).norm();
      const bool in_last = last > 0.0 && unit(random) * (first + last) < last;
      if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
      return q.corner[0] + u * diagonal + v * (q.corner[in_last ? 3 : 1] - q.corner[0]);
    };
    const Polygon& one = family.patches[p.one];
    const Vector3d n = normal(one);
    for (std::size_t k = 0; k < p.others.size(); ++k) {
      const Polygon& other = family.patches[p.others[k]];
      const Vector3d m = normal(other);
      double sum = 0.0;
      for (int line = 0; line < lines; ++line) {
        const Vector3d d = at(other) - at(one);
        const double square = d.squaredNorm();
        sum += std::max(0.0, n.dot(d)) * std::max(0.0, -m.dot(d)) / (square * square);
      }
      found.values[k] = sum / lines / std::numbers::pi * family.batch.area(p.one) * family.batch.area(p.others[k]);
    }
  });
}

/// What one method does to the pairs of one set.
struct Point {
  double seconds = std::numeric_limits<double>::infinity();  ///< a pair, least of all repetitions
  double largest_error = 0.0;
};

/// The console's table, and how far the automatic choice is from the lower envelope of all others.
class EnvelopeReporter : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration || run.counters.count("seconds_a_pair") == 0) continue;
      Point& point = points_[run.run_name.function_name];
      point.seconds = std::min(point.seconds, static_cast<double>(run.counters.at("seconds_a_pair")));
      point.largest_error = run.counters.at("largest_error");
    }
    ConsoleReporter::ReportRuns(runs);
  }

  void Finalize() override {
    std::map<std::string, double> largest;
    for (const auto& [name, point] : points_) {
      if (name.find("/automatic/") == std::string::npos) continue;
      const std::string set = name.substr(0, name.find('/') + 1);
      const Point* best = nullptr;
      std::string best_name;
      for (const auto& [other_name, other] : points_) {
        if (other_name.rfind(set, 0) != 0 || other_name.find("/automatic/") != std::string::npos) continue;
        if (other.largest_error <= point.largest_error && (best == nullptr || other.seconds < best->seconds)) {
          best = &other;
          best_name = other_name;
        }
      }
      GetOutputStream() << name << ": error " << point.largest_error << ", " << 1e9 * point.seconds << " ns, ";
      if (best == nullptr) {
        GetOutputStream() << "nothing else is as exact\n";
        continue;
      }
      const double ratio = point.seconds / best->seconds;
      largest[set] = std::max(largest[set], ratio);
      GetOutputStream() << ratio << " times " << best_name << '\n';
    }
    for (const auto& [set, ratio] : largest) GetOutputStream() << set << " largest ratio " << ratio << '\n';
    ConsoleReporter::Finalize();
  }

 private:
  std::map<std::string, Point> points_;
};

void add(const Family& family, const std::string& method, const std::string& setting, const Method& run) {
  for (std::size_t set = 0; set < kSets.size(); ++set) {
    std::string name(family.name);
    name.append(" ").append(kSets[set]).append("/").append(method).append("/").append(setting);
    benchmark::RegisterBenchmark(name.c_str(),
                                 [&family, set, run](benchmark::State& state) { measure(state, family, set, run); })
        ->Unit(benchmark::kMillisecond)
        ->MinTime(0.05);
  }
}

void add_all(const Family& family) {
  for (int digits = 3; digits <= 14; ++digits) {
    add(family, "automatic", "1e-" + std::to_string(digits), automatic(std::pow(10.0, -digits)));
    add(family, "contour integral", "1e-" + std::to_string(digits), contour(std::pow(10.0, -digits)));
  }
  for (int points = 1; points <= 6; ++points)
    add(family, "product rule", std::to_string(points), fixed_rule({FixedRule::kProduct, points}));
  for (int points = 1; points <= 3; ++points)
    add(family, "centres", std::to_string(points), fixed_rule({FixedRule::kCentres, points}));
  for (int points : {2, 4, 6, 8, 10, 12, 16, 20, 24})
    add(family, "edge rule", std::to_string(points), fixed_rule({FixedRule::kEdges, points}));
  for (int lines = 16; lines <= 4096; lines *= 4)
    add(family, "random lines", std::to_string(lines), random_lines(lines));
}

}  // namespace

int main(int argc, char** argv) {
  const std::array<Family, 2> families{cube(), TurnedPatches().family()};
  for (const Family& family : families) add_all(family);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  EnvelopeReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  benchmark::Shutdown();
}
