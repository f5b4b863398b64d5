// SPDX-License-Identifier: GPL-3.0-or-later
// Error against time of ways to compute unoccluded form factors, one core: product rules of 1 to 6 points per
// direction, the contour integral, random lines, and the automatic choice. Pairs of a cube of 12 x 12 quads a face, by
// the gap between their centres in patch sizes: near (below 1.5: touching), middle (below 5) and far. The error of
// every method is measured against the contour integral at round-off before the method is timed. At the end, for each
// point of the automatic choice, its time over that of the fastest other method of no larger error, from the least of
// all repetitions. scripts/plot_form_factor_error draws the result.
//   form_factor_error_benchmark --benchmark_repetitions=5 --benchmark_enable_random_interleaving=true
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
#include <string>
#include <vector>

#include "radiosity/form_factor_batch.h"
#include "tests/radiosity/form_factor_shapes.h"

namespace {

using namespace interglow::radiosity;
using Eigen::Vector3d;

constexpr int kSide = 12;
constexpr std::size_t kPairsOfAPatch = 64;  // so that a vector kernel has work

struct Pairs {
  std::uint32_t one;
  std::vector<std::uint32_t> others;
  std::vector<double> exact;  ///< exchange areas
};

struct Case {
  std::vector<Polygon> patches = test::cube(kSide, false);
  FormFactorBatch batch{patches};
  std::array<std::vector<Pairs>, 3> pairs;  ///< near, middle, far
  std::size_t count(std::size_t set) const {
    std::size_t sum = 0;
    for (const Pairs& p : pairs[set]) sum += p.others.size();
    return sum;
  }
};

Vector3d centre(const Polygon& p) {
  Vector3d sum = Vector3d::Zero();
  for (int k = 0; k < p.corners; ++k) sum += p.corner[static_cast<std::size_t>(k)];
  return sum / p.corners;
}

const Case& the_case() {
  static const Case made = [] {
    Case c;
    const double size = std::sqrt(c.batch.area(0));
    constexpr std::uint32_t kFace = kSide * kSide;
    for (std::uint32_t i = kFace; i < c.batch.size(); i += 5) {
      std::array<Pairs, 3> of_patch{Pairs{i, {}, {}}, Pairs{i, {}, {}}, Pairs{i, {}, {}}};
      for (std::uint32_t j = 0; j < i / kFace * kFace; ++j) {
        const double gap = (centre(c.patches[i]) - centre(c.patches[j])).norm() / size;
        Pairs& set = of_patch[gap < 1.5 ? 0 : gap < 5.0 ? 1 : 2];
        if (set.others.size() == kPairsOfAPatch) continue;
        set.others.push_back(j);
        set.exact.push_back(exchange_area(c.patches[i], c.patches[j], 0.0).value);
      }
      for (std::size_t k = 0; k < 3; ++k) {
        if (!of_patch[k].others.empty()) c.pairs[k].push_back(of_patch[k]);
      }
    }
    return c;
  }();
  return made;
}

/// Exchange areas of one patch with others.
using Method = std::function<void(const Pairs&, std::vector<double>&)>;

void measure(benchmark::State& state, std::size_t set, const Method& method) {
  const Case& c = the_case();
  std::vector<double> found(kPairsOfAPatch);
  double squares = 0.0;
  double worst = 0.0;
  for (const Pairs& p : c.pairs[set]) {
    method(p, found);
    for (std::size_t k = 0; k < p.others.size(); ++k) {
      const double error = std::abs(found[k] - p.exact[k]) / c.batch.area(p.one);
      if (!std::isfinite(error)) return state.SkipWithError("a value is not finite");
      squares += error * error;
      worst = std::max(worst, error);
    }
  }
  for (auto _ : state) {
    for (const Pairs& p : c.pairs[set]) method(p, found);
    benchmark::DoNotOptimize(found.data());
  }
  const auto count = static_cast<double>(c.count(set));
  state.counters["rms_error"] = std::sqrt(squares / count);
  state.counters["largest_error"] = worst;
  state.counters["seconds_a_pair"] =
      benchmark::Counter(count, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

Method automatic(double tolerance) {
  return [tolerance](const Pairs& p, std::vector<double>& found) {
    static thread_local std::vector<FormFactor> results(kPairsOfAPatch);
    the_case().batch.exchange_areas(p.one, p.others, tolerance, {results.data(), p.others.size()});
    for (std::size_t k = 0; k < p.others.size(); ++k) found[k] = results[k].value;
  };
}

Method fixed_rule(FixedRule rule) {
  return [rule](const Pairs& p, std::vector<double>& found) {
    the_case().batch.exchange_areas_by_rule(p.one, p.others, rule, {found.data(), p.others.size()});
  };
}

Method contour(double tolerance) {
  return [tolerance](const Pairs& p, std::vector<double>& found) {
    const Case& c = the_case();
    for (std::size_t k = 0; k < p.others.size(); ++k) {
      found[k] = exchange_area(c.patches[p.one], c.patches[p.others[k]], tolerance * c.batch.area(p.one)).value;
    }
  };
}

/// cosθ cosθ' / (π r²) at random pairs of points: what a ray caster does where nothing is in the way.
Method random_lines(int lines) {
  return [lines](const Pairs& p, std::vector<double>& found) {
    const Case& c = the_case();
    std::mt19937_64 random(p.one);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    const auto at = [&](const Polygon& q) -> Vector3d {  // squares
      return q.corner[0] + unit(random) * (q.corner[1] - q.corner[0]) + unit(random) * (q.corner[3] - q.corner[0]);
    };
    const auto normal = [](const Polygon& q) -> Vector3d {
      return (q.corner[1] - q.corner[0]).cross(q.corner[3] - q.corner[0]).normalized();
    };
    const Vector3d n = normal(c.patches[p.one]);
    for (std::size_t k = 0; k < p.others.size(); ++k) {
      const Polygon& other = c.patches[p.others[k]];
      const Vector3d m = normal(other);
      double sum = 0.0;
      for (int line = 0; line < lines; ++line) {
        const Vector3d d = at(other) - at(c.patches[p.one]);
        const double square = d.squaredNorm();
        sum += std::max(0.0, n.dot(d)) * std::max(0.0, -m.dot(d)) / (square * square);
      }
      found[k] = sum / lines / std::numbers::pi * c.batch.area(p.one) * c.batch.area(p.others[k]);
    }
  };
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

void add(const std::string& method, const std::string& setting, const Method& run) {
  constexpr std::array<const char*, 3> kSets{"near", "middle", "far"};
  for (std::size_t set = 0; set < kSets.size(); ++set) {
    benchmark::RegisterBenchmark((std::string(kSets[set]) + "/" + method + "/" + setting).c_str(),
                                 [set, run](benchmark::State& state) { measure(state, set, run); })
        ->Unit(benchmark::kMillisecond)
        ->MinTime(0.1);
  }
}

}  // namespace

int main(int argc, char** argv) {
  for (int digits = 3; digits <= 14; ++digits) {
    add("automatic", "1e-" + std::to_string(digits), automatic(std::pow(10.0, -digits)));
    if (digits % 2 == 0) add("contour integral", "1e-" + std::to_string(digits), contour(std::pow(10.0, -digits)));
  }
  for (int points = 1; points <= 6; ++points) {
    add("product rule", std::to_string(points), fixed_rule({FixedRule::kProduct, points}));
  }
  for (int points = 1; points <= 2; ++points)
    add("centres", std::to_string(points), fixed_rule({FixedRule::kCentres, points}));
  for (int points : {2, 4, 6, 8, 10, 12, 16, 20, 24})
    add("edge rule", std::to_string(points), fixed_rule({FixedRule::kEdges, points}));
  for (int lines = 16; lines <= 4096; lines *= 4) add("random lines", std::to_string(lines), random_lines(lines));
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  EnvelopeReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  benchmark::Shutdown();
}
