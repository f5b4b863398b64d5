// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/affine_registration.h"

#include <fmt/format.h>

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "diagnostics/error.h"
#include "fitting/affine_search.h"
#include "fitting/spline_image.h"
#include "radiosity/row_chunks.h"

namespace interglow::fitting {
namespace {

/// a11, a12, a21, a22, shift x, shift y (all at the middle, positions over `radius`), gain, offset.
constexpr int kUnknowns = 8;
using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;

constexpr int kSmallestSide = 16;
constexpr int kCoarsestSide = 24;  // the search costs the fourth power of this
constexpr std::size_t kSeeds = 8;  // rough alignments that are followed at the coarsest level
constexpr int kFinestRounds = 3;   // the second already moves the map by less than 1e-5 px
constexpr const char* kNoOverlap = "the images do not overlap enough to be aligned; give a better start.";
constexpr double kStillPx = 1e-6;      // a step that moves no corner further than this ends a level
constexpr double kNormalMad = 1.4826;  // standard deviation of a normal distribution over its median deviation

/// Positions are measured from the middle of the fixed image, in units of the distance to its corners.
struct Frame {
  Eigen::Vector2d middle;
  double radius;

  explicit Frame(const image::ScalarMap& fixed)
      : middle((fixed.width - 1) / 2.0, (fixed.height - 1) / 2.0), radius(middle.norm()) {}
};

struct Level {
  image::ScalarMap fixed;
  SplineImage moving;
  std::vector<std::uint8_t> mask;  ///< empty: all
  double border_px;
};

/// One minimisation at one level: the pixels that count and the Huber scale are fixed within it.
class Alignment {
 public:
  Alignment(const Level& level, const AffineParams& params, const Unknowns& start)
      : level_(level), frame_(level.fixed) {
    for (int y = 0; y < level.fixed.height; ++y) {
      for (int x = 0; x < level.fixed.width; ++x) {
        const int pixel = y * level.fixed.width + x;
        if (!level.mask.empty() && level.mask[static_cast<std::size_t>(pixel)] == 0) continue;
        ++candidates_;
        if (std::min({x, y, level.fixed.width - 1 - x, level.fixed.height - 1 - y}) < level.border_px) continue;
        const Eigen::Vector2d at = position(start, x, y);
        if (level.moving.contains(at.x(), at.y(), level.border_px)) pixels_.push_back(pixel);
      }
    }
    update_scale(start, params.huber_sigmas);
  }

  std::size_t size() const { return pixels_.size(); }
  double overlap_share() const {
    return static_cast<double>(size()) / static_cast<double>(std::max<std::size_t>(candidates_, 1));
  }
  double residual_sd() const { return residual_sd_; }
  const Frame& frame() const { return frame_; }
  const std::vector<int>& pixels() const { return pixels_; }

  Eigen::Vector2d position(const Unknowns& u, double x, double y) const {
    const double a = (x - frame_.middle.x()) / frame_.radius;
    const double b = (y - frame_.middle.y()) / frame_.radius;
    return {u[0] * a + u[1] * b + u[4], u[2] * a + u[3] * b + u[5]};
  }

  /// Residual and its derivatives at pixel number i; false if the map leaves the moving image.
  bool linearize(const Unknowns& u, std::size_t i, double& residual, Unknowns& derivative) const {
    const int x = pixels_[i] % level_.fixed.width;
    const int y = pixels_[i] / level_.fixed.width;
    const Eigen::Vector2d at = position(u, x, y);
    if (!level_.moving.contains(at.x(), at.y())) return false;
    const SplineImage::Sample m = level_.moving.sample(at.x(), at.y());
    const double a = (x - frame_.middle.x()) / frame_.radius;
    const double b = (y - frame_.middle.y()) / frame_.radius;
    residual = static_cast<double>(level_.fixed.value[static_cast<std::size_t>(pixels_[i])]) - u[6] * m.value - u[7];
    const double gx = -u[6] * m.dx;
    const double gy = -u[6] * m.dy;
    derivative << gx * a, gx * b, gy * a, gy * b, gx, gy, -m.value, -1.0;
    return true;
  }

  double weight(double residual) const {
    const double size = std::abs(residual);
    return size <= huber_ ? 1.0 : huber_ / size;
  }

  /// Mean of ρ, with JᵀWJ and JᵀWr over the count if wanted.
  double cost(const Unknowns& u, Normal* normal = nullptr, Unknowns* gradient = nullptr) const {
    const auto part = [&](Eigen::Index first, Eigen::Index rows) -> Eigen::MatrixXd {
      Eigen::Matrix<double, kUnknowns + 2, kUnknowns + 1> sums =
          Eigen::Matrix<double, kUnknowns + 2, kUnknowns + 1>::Zero();
      Normal products = Normal::Zero();
      Unknowns moments = Unknowns::Zero();
      double residual = 0.0;
      Unknowns d;
      for (Eigen::Index i = first; i < first + rows; ++i) {
        if (!linearize(u, static_cast<std::size_t>(i), residual, d)) continue;
        const double size = std::abs(residual);
        sums(kUnknowns, 0) += size <= huber_ ? 0.5 * size * size : huber_ * (size - 0.5 * huber_);
        sums(kUnknowns + 1, 0) += 1.0;
        if (normal != nullptr) {
          const double w = weight(residual);
          products.noalias() += (w * d) * d.transpose();
          moments.noalias() += (w * residual) * d;
        }
      }
      sums.topLeftCorner<kUnknowns, kUnknowns>() = products;
      sums.col(kUnknowns).head<kUnknowns>() = moments;
      return sums;
    };
    const Eigen::MatrixXd sums =
        radiosity::sum_over_row_chunks(static_cast<Eigen::Index>(size()), kUnknowns + 2, kUnknowns + 1, part);
    const double count = sums(kUnknowns + 1, 0);
    // A map that throws half of the pixels out of the image is no improvement, whatever the rest says.
    if (count < 0.5 * static_cast<double>(size()) || count == 0.0) return std::numeric_limits<double>::infinity();
    if (normal != nullptr) *normal = sums.topLeftCorner<kUnknowns, kUnknowns>() / count;
    if (gradient != nullptr) *gradient = sums.col(kUnknowns).head<kUnknowns>() / count;
    return sums(kUnknowns, 0) / count;
  }

  /// Cost over half the variance of the fixed image's pixels that count: comparable between starts.
  double relative_cost(const Unknowns& u) const {
    double sum = 0.0, squares = 0.0;
    for (const int pixel : pixels_) {
      const auto value = static_cast<double>(level_.fixed.value[static_cast<std::size_t>(pixel)]);
      sum += value;
      squares += value * value;
    }
    const auto count = static_cast<double>(size());
    const double variance = (squares - sum * sum / count) / count;
    return variance > 0.0 ? cost(u) / (0.5 * variance) : std::numeric_limits<double>::infinity();
  }

 private:
  void update_scale(const Unknowns& u, double huber_sigmas) {
    std::vector<double> sizes;
    double residual = 0.0;
    Unknowns d;
    for (std::size_t i = 0; i < size(); ++i) {
      if (linearize(u, i, residual, d)) sizes.push_back(std::abs(residual));
    }
    if (sizes.empty()) return;
    const auto half = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
    std::nth_element(sizes.begin(), half, sizes.end());
    residual_sd_ = kNormalMad * *half;
    // Images are scaled to a range of about 1; without any noise the threshold stays above the rounding of floats.
    huber_ = std::max(huber_sigmas * residual_sd_, 1e-6);
  }

  const Level& level_;
  Frame frame_;
  std::vector<int> pixels_;
  std::size_t candidates_ = 0;
  double residual_sd_ = 0.0;
  double huber_ = 1.0;
};

struct Descent {
  Unknowns unknowns = Unknowns::Zero();
  int iterations = 0;
  bool converged = false;
};

/// Levenberg-Marquardt on the Huber cost with its weights renewed in every step.
Descent descend(const Alignment& alignment, Unknowns u, int most_iterations) {
  Descent result{u, 0, false};
  Normal normal;
  Unknowns gradient;
  double cost = alignment.cost(u, &normal, &gradient);
  double damping = 1e-3;
  while (result.iterations < most_iterations && std::isfinite(cost)) {
    ++result.iterations;
    Normal damped = normal;
    damped.diagonal() *= 1.0 + damping;
    const Unknowns step = damped.ldlt().solve(-gradient);
    if (!step.allFinite()) break;
    const Unknowns next = u + step;
    Normal next_normal;
    Unknowns next_gradient;
    const double next_cost = alignment.cost(next, &next_normal, &next_gradient);
    const double moved_px = step.head<6>().cwiseAbs().maxCoeff();
    if (next_cost <= cost) {
      u = next;
      cost = next_cost;
      normal = next_normal;
      gradient = next_gradient;
      damping = std::max(damping / 10.0, 1e-12);
    } else {
      damping *= 10.0;
    }
    // Short because damped is not the same as short because done.
    if ((moved_px < kStillPx && damping < 1.0) || damping > 1e12) {
      result.converged = true;
      break;
    }
  }
  result.unknowns = u;
  return result;
}

Unknowns unknowns_of(const Affine& map, const Frame& frame, double gain, double offset) {
  Unknowns u;
  const Eigen::Vector2d shift = map(frame.middle);
  u << map.linear(0, 0) * frame.radius, map.linear(0, 1) * frame.radius, map.linear(1, 0) * frame.radius,
      map.linear(1, 1) * frame.radius, shift.x(), shift.y(), gain, offset;
  return u;
}

Affine affine_of(const Unknowns& u, const Frame& frame) {
  Affine map;
  map.linear << u[0], u[1], u[2], u[3];
  map.linear /= frame.radius;
  map.shift = Eigen::Vector2d(u[4], u[5]) - map.linear * frame.middle;
  return map;
}

/// Sums over the pixels that count: of both pictures' values, given the map, and their products.
struct Moments {
  double n = 0, sf = 0, sm = 0, sff = 0, smm = 0, sfm = 0;

  Moments(const Alignment& alignment, const image::ScalarMap& fixed, const Unknowns& u) {
    double residual = 0.0;
    Unknowns d;
    for (std::size_t i = 0; i < alignment.size(); ++i) {
      if (!alignment.linearize(u, i, residual, d)) continue;
      const double m = -d[6];
      const auto f = static_cast<double>(fixed.value[static_cast<std::size_t>(alignment.pixels()[i])]);
      n += 1;
      sf += f;
      sm += m;
      sff += f * f;
      smm += m * m;
      sfm += f * m;
    }
  }
};

/// Gain and offset by least squares over the pixels that count, given the map.
void solve_intensities(const Alignment& alignment, const image::ScalarMap& fixed, Unknowns& u) {
  const auto [n, sf, sm, sff, smm, sfm] = Moments(alignment, fixed, u);
  const double variance = n * smm - sm * sm;
  if (!(variance > 0.0)) return;
  u[6] = (n * sfm - sf * sm) / variance;
  u[7] = (sf - u[6] * sm) / n;
}

/// The descent at one level from a map of its pixels; no iterations if too few pixels overlap.
Descent align(const Level& level, const AffineParams& params, const Affine& start, double gain, double offset,
              bool intensities_known, Affine& map, double* relative_cost = nullptr) {
  map = start;
  const Frame frame(level.fixed);
  Unknowns u = unknowns_of(start, frame, gain, offset);
  const Alignment alignment(level, params, u);
  if (alignment.size() < 4 * kUnknowns) return {};
  if (!intensities_known) solve_intensities(alignment, level.fixed, u);
  const Descent descent =
      descend(intensities_known ? alignment : Alignment(level, params, u), u, params.most_iterations);
  map = affine_of(descent.unknowns, frame);
  if (relative_cost != nullptr) {
    const Alignment reached(level, params, descent.unknowns);
    if (reached.size() >= 4 * kUnknowns) *relative_cost = reached.relative_cost(descent.unknowns);
  }
  return descent;
}

image::ScalarMap halve(const image::ScalarMap& map) {
  const image::ScalarMap smooth = gaussian_blur(map, 1.0);
  image::ScalarMap half{(map.width + 1) / 2, (map.height + 1) / 2, {}};
  for (int y = 0; y < map.height; y += 2) {
    for (int x = 0; x < map.width; x += 2)
      half.value.push_back(smooth.value[static_cast<std::size_t>(y) * static_cast<std::size_t>(map.width) +
                                        static_cast<std::size_t>(x)]);
  }
  return half;
}

std::vector<std::uint8_t> halve(const std::vector<std::uint8_t>& mask, int width, int height) {
  std::vector<std::uint8_t> half;
  if (mask.empty()) return half;
  for (int y = 0; y < height; y += 2) {
    for (int x = 0; x < width; x += 2)
      half.push_back(mask[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)]);
  }
  return half;
}

/// The image over its range, so that unknowns are of like size; returns lowest value and range.
std::pair<double, double> normalize(image::ScalarMap& map, const char* name) {
  for (std::size_t p = 0; p < map.value.size(); ++p) {
    if (!std::isfinite(map.value[p])) {
      throw InvalidInput(fmt::format("{} image: row {}, column {}: {} is not finite.", name,
                                     p / static_cast<std::size_t>(map.width), p % static_cast<std::size_t>(map.width),
                                     map.value[p]));
    }
  }
  const auto [lowest, highest] = std::minmax_element(map.value.begin(), map.value.end());
  const std::pair<double, double> range{*lowest, static_cast<double>(*highest) - static_cast<double>(*lowest)};
  if (!(range.second > 0.0))
    throw InvalidInput(fmt::format("{} image: all pixels are {:g}; there is nothing to align.", name, range.first));
  for (float& value : map.value) value = static_cast<float>((static_cast<double>(value) - range.first) / range.second);
  return range;
}

void check(const image::ScalarMap& map, const char* name) {
  if (map.width < kSmallestSide || map.height < kSmallestSide) {
    throw InvalidInput(fmt::format("{} image: {} × {} pixels; expected at least {} a side.", name, map.width,
                                   map.height, kSmallestSide));
  }
  if (map.value.size() != static_cast<std::size_t>(map.width) * static_cast<std::size_t>(map.height))
    throw InvalidParams(
        fmt::format("{} image: {} values for {} × {} pixels.", name, map.value.size(), map.width, map.height));
}

/// (JᵀWJ)⁻¹ (Σ_x Σ_d C(d) J(x) J(x + d)ᵀ) (JᵀWJ)⁻¹ with C the autocovariance of the residuals, measured over the image:
/// the prefilter and the interpolation of noise correlate neighbours.
Normal sandwich(const Alignment& alignment, const Unknowns& u, int width, int height, int reach) {
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  std::vector<float> score(pixels, 0.0F);  // weighted residual; 0 where a pixel does not count
  std::vector<char> counts(pixels, 0);
  Eigen::Matrix<double, Eigen::Dynamic, kUnknowns, Eigen::RowMajor> derivative =
      Eigen::Matrix<double, Eigen::Dynamic, kUnknowns, Eigen::RowMajor>::Zero(static_cast<Eigen::Index>(pixels),
                                                                              kUnknowns);
  Normal bread = Normal::Zero();
  for (std::size_t i = 0; i < alignment.size(); ++i) {
    double residual = 0.0;
    Unknowns d;
    if (!alignment.linearize(u, i, residual, d)) continue;
    const auto p = static_cast<std::size_t>(alignment.pixels()[i]);
    const double w = alignment.weight(residual);
    score[p] = static_cast<float>(w * residual);
    counts[p] = 1;
    derivative.row(static_cast<Eigen::Index>(p)) = d.transpose();
    bread.noalias() += (w * d) * d.transpose();
  }
  // C(d) for the lags of a half plane; the other half is its mirror image.
  struct Lag {
    int dx, dy;
    double covariance;
  };
  std::vector<Lag> lags;
  for (int dy = 0; dy <= reach; ++dy) {
    for (int dx = dy == 0 ? 0 : -reach; dx <= reach; ++dx) lags.push_back({dx, dy, 0.0});
  }
  std::vector<Normal> parts(lags.size(), Normal::Zero());
  tbb::parallel_for(std::size_t{0}, lags.size(), [&](std::size_t l) {
    Lag& lag = lags[l];
    double products = 0.0;
    double pairs = 0.0;
    for (int y = 0; y + lag.dy < height; ++y) {
      for (int x = std::max(0, -lag.dx); x < std::min(width, width - lag.dx); ++x) {
        const std::size_t p =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
        const std::size_t q = p + static_cast<std::size_t>(lag.dy * width + lag.dx);
        if (counts[p] == 0 || counts[q] == 0) continue;
        products += static_cast<double>(score[p]) * static_cast<double>(score[q]);
        pairs += 1.0;
        parts[l].noalias() +=
            derivative.row(static_cast<Eigen::Index>(p)).transpose() * derivative.row(static_cast<Eigen::Index>(q));
      }
    }
    lag.covariance = pairs > 0.0 ? products / pairs : 0.0;
  });
  Normal meat = Normal::Zero();
  for (std::size_t l = 0; l < lags.size(); ++l) {
    if (lags[l].dx == 0 && lags[l].dy == 0) {
      meat += lags[l].covariance * parts[l];
    } else {
      meat += lags[l].covariance * (parts[l] + parts[l].transpose());
    }
  }
  const Normal inverse = bread.ldlt().solve(Normal::Identity());
  return inverse * meat * inverse;
}

double correlation(const Alignment& alignment, const Unknowns& u, const image::ScalarMap& fixed) {
  const auto [n, sf, sm, sff, smm, sfm] = Moments(alignment, fixed, u);
  const double variances = (sff - sf * sf / n) * (smm - sm * sm / n);
  return variances > 0.0 ? (sfm - sf * sm / n) / std::sqrt(variances) : 0.0;
}

/// From a map of this level's pixels to one of the next coarser level's and back: positions halve, the linear part
/// stays.
Affine coarser(const Affine& map, double factor) { return {map.linear, map.shift / factor}; }

}  // namespace

double corner_rms_px(const Affine& a, const Affine& b, int width, int height) {
  double squares = 0.0;
  for (const double x : {0.0, width - 1.0}) {
    for (const double y : {0.0, height - 1.0}) squares += (a({x, y}) - b({x, y})).squaredNorm();
  }
  return std::sqrt(squares / 4.0);
}

void validate(const AffineParams& params) {
  const auto require = [](bool met, const char* field, double value, const char* range) {
    if (!met) throw InvalidParams(fmt::format("{}: {}; expected {}.", field, value, range));
  };
  require(params.spline_order == 3 || params.spline_order == 5, "spline_order", params.spline_order, "3 or 5");
  require(params.prefilter_sigma_px >= 0.0 && params.prefilter_sigma_px <= 100.0, "prefilter_sigma_px",
          params.prefilter_sigma_px, "a value in [0, 100]");
  require(params.huber_sigmas > 0.0, "huber_sigmas", params.huber_sigmas, "a value above 0");
  require(params.border_px >= 0.0, "border_px", params.border_px, "0 or more");
  require(params.search_turn_deg >= 0.0 && params.search_turn_deg <= 180.0, "search_turn_deg", params.search_turn_deg,
          "a value in [0, 180]");
  require(params.search_scale >= 1.0 && params.search_scale <= 4.0, "search_scale", params.search_scale,
          "a value in [1, 4]");
  require(params.search_shift >= 0.0 && params.search_shift <= 1.0, "search_shift", params.search_shift,
          "a value in [0, 1]");
  require(params.most_iterations >= 1, "most_iterations", params.most_iterations, "at least 1");
  if (params.start && !(params.start->linear.allFinite() && params.start->shift.allFinite()))
    throw InvalidParams("start: a value is not finite.");
}

AffineRegistration register_affine(const image::ScalarMap& fixed, const image::ScalarMap& moving,
                                   const AffineParams& params) {
  validate(params);
  check(fixed, "fixed");
  check(moving, "moving");
  if (!params.fixed_mask.empty() && params.fixed_mask.size() != fixed.value.size()) {
    throw InvalidParams(
        fmt::format("fixed_mask: {} entries for {} × {} pixels.", params.fixed_mask.size(), fixed.width, fixed.height));
  }
  image::ScalarMap fixed_map = fixed;
  image::ScalarMap moving_map = moving;
  const auto [fixed_lowest, fixed_range] = normalize(fixed_map, "fixed");
  const auto [moving_lowest, moving_range] = normalize(moving_map, "moving");

  std::vector<Level> levels;
  std::vector<image::ScalarMap> moving_levels{moving_map};
  levels.push_back({fixed_map, SplineImage(moving_map, 3), params.fixed_mask, params.border_px});
  while (std::min({fixed_map.width, fixed_map.height, moving_map.width, moving_map.height}) >= 2 * kCoarsestSide) {
    const std::vector<std::uint8_t> mask = halve(levels.back().mask, fixed_map.width, fixed_map.height);
    fixed_map = halve(fixed_map);
    moving_map = halve(moving_map);
    moving_levels.push_back(moving_map);
    levels.push_back({fixed_map, SplineImage(moving_map, 3), mask, 1.0});
  }

  const double coarsest = std::pow(2.0, static_cast<double>(levels.size()) - 1.0);
  std::vector<Affine> seeds;
  if (params.start) {
    seeds.push_back(coarser(*params.start, coarsest));
  } else {
    seeds = search_affine(levels.back().fixed, moving_levels.back(), params, kSeeds);
    if (seeds.empty()) {
      throw InvalidInput(
          "no turn, scale and shift of the search lays a third of the moving image on the fixed one with a positive "
          "correlation. Enlarge search_turn_deg, search_scale or search_shift, or give a start.");
    }
  }
  AffineRegistration result;
  double least = std::numeric_limits<double>::infinity();
  Affine map = seeds.front();
  double gain = 1.0;
  double offset = 0.0;
  for (const Affine& seed : seeds) {
    Affine found;
    double cost = std::numeric_limits<double>::infinity();
    const Descent descent = align(levels.back(), params, seed, 1.0, 0.0, false, found, &cost);
    if (cost < least) {
      least = cost;
      map = found;
      gain = descent.unknowns[6];
      offset = descent.unknowns[7];
    }
  }
  Descent last;
  for (std::size_t l = levels.size(); l-- > 0;) {
    if (l + 1 < levels.size()) map.shift *= 2.0;
    Affine found;
    last = align(levels[l], params, map, gain, offset, std::isfinite(least), found);
    if (last.iterations == 0) throw InvalidInput(kNoOverlap);
    map = found;
    gain = last.unknowns[6];
    offset = last.unknowns[7];
  }

  // The finest level once more: pixels, Huber scale and prefilter follow the map. A blur of covariance C of the fixed
  // image is one of A C Aᵀ in the moving image; equal blurs of both would shift the map by 0.002 px at 2 % of scale.
  Level& finest = levels.front();
  const double variance = params.prefilter_sigma_px * params.prefilter_sigma_px;
  finest.border_px = params.border_px + 3.0 * params.prefilter_sigma_px;
  finest.fixed = gaussian_blur(finest.fixed, params.prefilter_sigma_px);
  for (int round = 0; round < kFinestRounds; ++round) {
    const Eigen::Matrix2d moving_blur = variance * map.linear * map.linear.transpose();
    finest.moving = SplineImage(gaussian_blur(moving_levels.front(), moving_blur), params.spline_order);
    last = align(finest, params, Affine(map), gain, offset, true, map);
    if (last.iterations == 0) throw InvalidInput(kNoOverlap);
    gain = last.unknowns[6];
    offset = last.unknowns[7];
  }

  const Alignment final_state(finest, params, last.unknowns);
  result.moving_from_fixed = map;
  result.gain = gain * fixed_range / moving_range;
  result.offset = fixed_lowest + fixed_range * offset - result.gain * moving_lowest;
  result.residual_sd = final_state.residual_sd() * fixed_range;
  result.correlation = correlation(final_state, last.unknowns, finest.fixed);
  result.overlap_share = final_state.overlap_share();
  result.iterations = last.iterations;
  result.converged = last.converged;
  // Beyond this distance noise blurred by the prefilter and by interpolation is not correlated.
  const int reach = static_cast<int>(std::ceil(4.0 * params.prefilter_sigma_px)) + 2;
  const Normal covariance = sandwich(final_state, last.unknowns, fixed.width, fixed.height, reach);
  result.covariance = covariance.topLeftCorner<6, 6>();
  double squares = 0.0;
  for (const double x : {0.0, fixed.width - 1.0}) {
    for (const double y : {0.0, fixed.height - 1.0}) {
      const Eigen::Vector2d at = (Eigen::Vector2d(x, y) - final_state.frame().middle) / final_state.frame().radius;
      Eigen::Matrix<double, 2, 6> position;
      position << at.x(), at.y(), 0, 0, 1, 0, 0, 0, at.x(), at.y(), 0, 1;
      squares += (position * result.covariance * position.transpose()).trace();
    }
  }
  result.corner_sd_px = std::sqrt(std::max(squares / 4.0, 0.0));
  Eigen::Matrix<double, 6, 1> unit;
  unit << Eigen::Vector4d::Constant(1.0 / final_state.frame().radius), 1.0, 1.0;
  result.covariance = unit.asDiagonal() * result.covariance * unit.asDiagonal();
  return result;
}

image::ScalarMap mean_over_bands(const image::SpectralImage& image) {
  image::ScalarMap mean{image.width, image.height, {}};
  const auto bands = static_cast<std::size_t>(image.bands());
  for (std::size_t from = 0; from < image.value.size(); from += bands) {
    double sum = 0.0;
    for (std::size_t b = 0; b < bands; ++b) sum += static_cast<double>(image.value[from + b]);
    mean.value.push_back(static_cast<float>(sum / static_cast<double>(bands)));
  }
  return mean;
}

WarpedImage warp(const image::SpectralImage& moving, const Affine& moving_from_fixed, int width, int height,
                 int spline_order) {
  WarpedImage warped;
  warped.image = {width, height, moving.wavelength_nm, {}};
  const auto bands = static_cast<std::size_t>(moving.bands());
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  warped.image.value.assign(pixels * bands, 0.0F);
  warped.covered.assign(pixels, 0);
  tbb::parallel_for(std::size_t{0}, bands, [&](std::size_t b) {
    image::ScalarMap band{moving.width, moving.height, {}};
    for (std::size_t v = b; v < moving.value.size(); v += bands) band.value.push_back(moving.value[v]);
    const SplineImage spline(band, spline_order);
    for (std::size_t p = 0; p < pixels; ++p) {
      const Eigen::Vector2d at = moving_from_fixed({static_cast<double>(p % static_cast<std::size_t>(width)),
                                                    static_cast<double>(p / static_cast<std::size_t>(width))});
      if (!spline.contains(at.x(), at.y())) continue;
      warped.image.value[p * bands + b] = static_cast<float>(spline.sample(at.x(), at.y()).value);
      if (b == 0) warped.covered[p] = 1;
    }
  });
  return warped;
}

}  // namespace interglow::fitting
