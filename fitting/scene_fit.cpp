// SPDX-License-Identifier: GPL-3.0-or-later
#include "fitting/scene_fit.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "diagnostics/error.h"

namespace interglow::fitting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;
using radiosity::RowMatrix;

/// Side of the square tiles that are compressed at once, and whose scores make the sandwich [px].
constexpr int kTile = 16;
/// A step below this share of the standard deviation of every parameter ends the search.
constexpr double kSmallStep = 0.02;
constexpr double kSmallGain = 1e-7;
constexpr double kWideLamp = 0.05;  ///< half-angle of the first stage's lamp [rad]

int own_count(const FitParams& params) { return (params.gain ? 1 : 0) + (params.offset ? 1 : 0); }

double huber_weight(double residual, double limit) {
  const double size = std::abs(residual);
  return size <= limit ? 1.0 : limit / size;
}

double huber_cost(double residual, double limit) {
  const double size = std::abs(residual);
  return size <= limit ? residual * residual : limit * (2.0 * size - limit);
}

double quantile(std::vector<float>& values, double share) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return static_cast<double>(values[static_cast<std::size_t>(at)]);
}

/// Means over blocks of pixels; a block is used if all its pixels are.
FitData reduced(const FitData& data, int factor, double sigma_share) {
  FitData small;
  const int width = data.image.width / factor;
  const int height = data.image.height / factor;
  const int bands = data.image.bands();
  small.image.width = width;
  small.image.height = height;
  small.image.wavelength_nm = data.image.wavelength_nm;
  small.image.value.assign(
      static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * static_cast<std::size_t>(bands), 0.0F);
  small.use.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 1);
  for (int row = 0; row < height * factor; ++row) {
    for (int column = 0; column < width * factor; ++column) {
      const std::size_t to = static_cast<std::size_t>(row / factor) * static_cast<std::size_t>(width) +
                             static_cast<std::size_t>(column / factor);
      const std::size_t from =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(data.image.width) + static_cast<std::size_t>(column);
      if (data.use[from] == 0) small.use[to] = 0;
      for (int b = 0; b < bands; ++b) {
        small.image.value[to * static_cast<std::size_t>(bands) + static_cast<std::size_t>(b)] +=
            data.image.pixel(row, column)[b] / static_cast<float>(factor * factor);
      }
    }
  }
  small.sigma.resize(small.image.value.size());
  for (int b = 0; b < bands; ++b) {
    std::vector<float> values;
    for (std::size_t p = 0; p < small.use.size(); ++p) {
      if (small.use[p])
        values.push_back(small.image.value[p * static_cast<std::size_t>(bands) + static_cast<std::size_t>(b)]);
    }
    const auto sigma = static_cast<float>(sigma_share * quantile(values, 0.99));
    for (std::size_t p = 0; p < small.use.size(); ++p)
      small.sigma[p * static_cast<std::size_t>(bands) + static_cast<std::size_t>(b)] = sigma;
  }
  for (const std::uint8_t used : small.use) small.residuals += used ? static_cast<std::size_t>(bands) : 0;
  return small;
}

LensCamera reduced(const LensCamera& camera, int factor) {
  LensCamera small = camera;
  small.width /= factor;
  small.height /= factor;
  small.focal_px /= factor;
  small.principal_px /= factor;
  return small;
}

/// The camera at full size that a small one's moves make of `full`.
LensCamera enlarged(const LensCamera& small, const LensCamera& full, int factor) {
  LensCamera result = small;
  result.width = full.width;
  result.height = full.height;
  result.focal_px *= factor;
  result.principal_px *= factor;
  return result;
}

/// Solves min |T x - r|² + λ |D x|² with D the column norms of T.
VectorXd damped_solution(const MatrixXd& triangle, Index count, double damping) {
  MatrixXd system(triangle.rows() + count, count);
  VectorXd right = VectorXd::Zero(system.rows());
  system.topRows(triangle.rows()) = triangle.leftCols(count);
  right.head(triangle.rows()) = triangle.col(count);
  system.bottomRows(count).setZero();
  for (Index k = 0; k < count; ++k)
    system(triangle.rows() + k, k) = std::sqrt(damping) * std::max(triangle.col(k).norm(), 1e-300);
  return system.colPivHouseholderQr().solve(right);
}

struct Search {
  const ForwardModel& model;
  const FitData& data;
  const FitParams& params;
  std::vector<int> free;
  LensCamera like;
  const Progress& progress;

  double total(const FitState& state, const Evaluation& evaluation) const {
    const MatrixXd priors = prior_rows(state, like, free, params);
    const double prior = priors.rows() > 0 ? priors.col(priors.cols() - 1).squaredNorm() : 0.0;
    return robust_cost(model, data, state, evaluation, params) + prior / static_cast<double>(data.residuals);
  }

  FitStage run(const std::string& name, FitState& state, int most_iterations, double enough) const {
    FitStage stage;
    stage.name = name;
    stage.width = data.image.width;
    Evaluation now = model.evaluate(state, {}, progress);
    fit_bands(model, data, now, params, state);
    double cost = total(state, now);
    stage.cost_before = cost;
    double damping = 1e-3;
    const auto count = static_cast<Index>(free.size());
    stage.end = "iteration limit";
    for (int iteration = 0; iteration < most_iterations; ++iteration) {
      ++stage.iterations;
      progress.update(name, static_cast<double>(iteration) / most_iterations);
      const Evaluation here = model.evaluate(state, free, progress);
      const CompressedAt at = compress(model, data, state, here, free, params);
      const MatrixXd priors = prior_rows(state, like, free, params);
      TileQr joined(count + 1);
      joined.add(at.all.shared_triangle.leftCols(count + 1));
      if (priors.rows() > 0) joined.add(priors);
      bool better = false;
      double step_size = 0.0;
      double gained = 0.0;
      for (int attempt = 0; attempt < 8 && !better; ++attempt) {
        const VectorXd step = damped_solution(joined.triangle(), count, damping);
        VectorXd full = VectorXd::Zero(shared_count(model.scene()));
        for (Index k = 0; k < count; ++k) full[free[static_cast<std::size_t>(k)]] = step[k];
        // No step leaves the range in which a picture makes sense.
        if (full.head(kShiftX).norm() > 0.5 || state.w + full[kW] <= 0.0 || state.blur_px + full[kBlur] > 20.0) {
          damping = std::max(10.0 * damping, 1e-6);
          continue;
        }
        FitState next = moved(state, full);
        next.blur_px = std::max(next.blur_px, kLeastBlur);
        Evaluation there;
        try {
          there = model.evaluate(next, {}, progress);
        } catch (const InvalidParams&) {  // a camera that no longer sees the objects
          damping *= 10.0;
          continue;
        }
        fit_bands(model, data, there, params, next);
        const double next_cost = total(next, there);
        if (next_cost < cost) {
          better = true;
          gained = (cost - next_cost) / cost;
          cost = next_cost;
          state = next;
          step_size = (at.all.shared_triangle.topLeftCorner(count, count) * step).norm();
          damping = std::max(0.1 * damping, 1e-9);
        } else {
          step_size = (at.all.shared_triangle.topLeftCorner(count, count) * step).norm();
          if (step_size < kSmallStep) break;
          damping = std::max(10.0 * damping, 1e-6);
        }
      }
      if (!better) {
        stage.end = step_size < kSmallStep ? "step below 2 % of the standard deviations" : "no step lowers the cost";
        break;
      }
      if (step_size < kSmallStep || gained < enough) {
        stage.end = "cost no longer falls";
        break;
      }
    }
    stage.cost = cost;
    return stage;
  }
};

/// Aligns what the objects cover with what is bright in the capture, by Gauss-Newton on pictures of some 32 pixels.
FitStage align_silhouettes(const ForwardModel& model, const FitData& data, FitState& state, const Progress& progress) {
  FitStage stage;
  stage.name = "silhouettes";
  stage.width = data.image.width;
  const int width = data.image.width;
  const int height = data.image.height;
  std::vector<float> level;
  for (Index p = 0; p < static_cast<Index>(width) * height; ++p) {
    level.push_back(
        Eigen::Map<const Eigen::VectorXf>(data.image.value.data() + p * data.image.bands(), data.image.bands()).mean());
  }
  std::vector<float> sorted = level;
  const double dark = quantile(sorted, 0.02);
  const double bright = quantile(sorted, 0.9);
  RowMatrix seen(level.size(), 1);
  for (std::size_t p = 0; p < level.size(); ++p) {
    // Half-covered pixels of a dim surface count as half.
    seen(static_cast<Index>(p), 0) =
        std::clamp((static_cast<double>(level[p]) - dark) / (0.15 * (bright - dark) + 1e-300), 0.0, 1.0);
  }
  double damping = 1e-3;
  double blur = 4.0;
  VectorXd target = blurred(seen, width, height, blur).col(0);
  const auto residual = [&](const LensCamera& camera) -> VectorXd {
    return target - model.coverage(camera, blur, {}).value;
  };
  double cost = residual(state.camera).squaredNorm() / static_cast<double>(level.size());
  stage.cost_before = cost;
  stage.end = "iteration limit";
  const std::vector<int> pose{kTurnX, kTurnY, kTurnZ, kShiftX, kShiftY, kShiftZ};
  for (int iteration = 0; iteration < 40; ++iteration) {
    if (iteration == 20) {
      blur = 1.5;
      target = blurred(seen, width, height, blur).col(0);
      cost = residual(state.camera).squaredNorm() / static_cast<double>(level.size());
    }
    ++stage.iterations;
    progress.update("silhouettes", iteration / 40.0);
    const CoverageEvaluation here = model.coverage(state.camera, blur, pose);
    MatrixXd system(here.value.size(), 7);
    for (std::size_t k = 0; k < pose.size(); ++k) {
      if (data.use.empty()) break;
      system.col(static_cast<Index>(k)) = here.derivative[k];
    }
    system.col(6) = target - here.value;
    for (Index p = 0; p < system.rows(); ++p) {
      if (!data.use[static_cast<std::size_t>(p)]) system.row(p).setZero();
    }
    TileQr qr(7);
    qr.add(system);
    bool better = false;
    for (int attempt = 0; attempt < 6 && !better; ++attempt) {
      // Turns of a smooth outline may be undetermined: damping keeps them.
      const VectorXd step = damped_solution(qr.triangle(), 6, damping);
      Eigen::Matrix<double, LensCamera::kParameters, 1> full;
      full.setZero();
      full.head<6>() = step;
      if (step.head<3>().norm() < 0.3 && std::abs(step[5]) < 0.3 * state.camera.pivot_in_camera.z()) {
        const LensCamera next = state.camera.moved(full);
        const double next_cost = residual(next).squaredNorm() / static_cast<double>(level.size());
        if (next_cost < cost) {
          better = true;
          if (cost - next_cost < 1e-4 * cost && iteration >= 20) {
            stage.end = "cost no longer falls";
            iteration = 40;
          }
          cost = next_cost;
          state.camera = next;
          damping = std::max(0.2 * damping, 1e-4);
          continue;
        }
      }
      damping *= 10.0;
    }
    if (!better) {
      if (iteration < 20) {
        iteration = 19;
        damping = 1e-3;
        continue;
      }
      stage.end = "no step lowers the cost";
      break;
    }
  }
  stage.cost = cost;
  return stage;
}

}  // namespace

void validate(const FitParams& params) {
  const auto positive = [](double value, const char* name) {
    if (!(value > 0.0) || !std::isfinite(value))
      throw InvalidParams(fmt::format("{} is {}, expected a finite value above 0.", name, value));
  };
  positive(params.reflectance_sigma, "reflectance_sigma");
  positive(params.principal_sigma_px, "principal_sigma_px");
  positive(params.distortion_sigma, "distortion_sigma");
  if (!(params.huber_sigmas >= 1.0))
    throw InvalidParams(fmt::format("huber_sigmas is {}, expected at least 1.", params.huber_sigmas));
  if (!(params.model_sigma >= 0.0 && params.model_sigma <= 1.0))
    throw InvalidParams(fmt::format("model_sigma is {}, expected a value in [0, 1].", params.model_sigma));
  if (params.most_iterations < 1)
    throw InvalidParams(fmt::format("most_iterations is {}, expected at least 1.", params.most_iterations));
}

std::vector<int> free_parameters(const scene::Scene& scene, const FitParams& params) {
  std::vector<int> free;
  const auto add = [&](bool wanted, int first, int last) {
    for (int k = first; wanted && k <= last; ++k) free.push_back(k);
  };
  add(params.light, kLightU, kLightV);
  add(params.pose, kTurnX, kShiftZ);
  add(params.focal, kFocal, kFocal);
  add(params.principal, kPrincipalX, kPrincipalY);
  add(params.distortion, kDistortion, kDistortion);
  add(params.blur, kBlur, kBlur);
  add(params.w, kW, kW);
  add(params.reflectance, kFirstScale, kFirstScale + static_cast<int>(scene.materials.size()) - 1);
  return free;
}

MatrixXd prior_rows(const FitState& state, const LensCamera& like, const std::vector<int>& free,
                    const FitParams& params) {
  MatrixXd rows(0, static_cast<Index>(free.size()) + 1);
  const auto add = [&](Index column, double offset, double sigma) {
    rows.conservativeResize(rows.rows() + 1, rows.cols());
    rows.bottomRows(1).setZero();
    rows(rows.rows() - 1, column) = 1.0 / sigma;
    rows(rows.rows() - 1, rows.cols() - 1) = -offset / sigma;
  };
  for (std::size_t k = 0; k < free.size(); ++k) {
    const auto column = static_cast<Index>(k);
    if (free[k] == kPrincipalX || free[k] == kPrincipalY) {
      const int axis = free[k] - kPrincipalX;
      add(column, state.camera.principal_px[axis] - like.principal_px[axis], params.principal_sigma_px);
    } else if (free[k] == kDistortion) {
      add(column, state.camera.distortion, params.distortion_sigma);
    } else if (free[k] >= kFirstScale) {
      add(column, state.scale[free[k] - kFirstScale] - 1.0, params.reflectance_sigma);
    }
  }
  return rows;
}

void fit_bands(const ForwardModel& model, const FitData& data, const Evaluation& evaluation, const FitParams& params,
               FitState& state) {
  if (!params.gain && !params.offset) return;
  const Index bands = model.spectra().bands();
  tbb::parallel_for(Index{0}, bands, [&](Index b) {
    // Huber weights from the residuals of the last round; the first has none.
    double gain = state.gain[b];
    double offset = state.offset[b];
    const VectorXd prediction = evaluation.channels * model.palette().col(b);
    for (int round = 0; round < 3; ++round) {
      Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
      Eigen::Vector2d right = Eigen::Vector2d::Zero();
      for (Index p = 0; p < prediction.size(); ++p) {
        if (!data.use[static_cast<std::size_t>(p)]) continue;
        const auto at = static_cast<std::size_t>(p * bands + b);
        const double sigma = static_cast<double>(data.sigma[at]);
        const double y = static_cast<double>(data.image.value[at]);
        double weight = 1.0 / (sigma * sigma);
        if (round > 0) weight *= huber_weight((y - gain * prediction[p] - offset) / sigma, params.huber_sigmas);
        const Eigen::Vector2d row(prediction[p], 1.0);
        normal += weight * row * row.transpose();
        right += weight * y * row;
      }
      if (params.gain && params.offset) {
        const double determinant = normal.determinant();
        if (!(determinant > 1e-12 * normal(0, 0) * normal(1, 1))) break;
        const Eigen::Vector2d solution = normal.inverse() * right;
        gain = solution[0];
        offset = solution[1];
      } else if (params.gain) {
        if (!(normal(0, 0) > 0.0)) break;
        gain = (right[0] - normal(0, 1) * offset) / normal(0, 0);
      } else {
        offset = (right[1] - normal(0, 1) * gain) / normal(1, 1);
      }
    }
    state.gain[b] = gain;
    state.offset[b] = offset;
  });
}

double robust_cost(const ForwardModel& model, const FitData& data, const FitState& state, const Evaluation& evaluation,
                   const FitParams& params) {
  const Index bands = model.spectra().bands();
  VectorXd sum = VectorXd::Zero(bands);
  tbb::parallel_for(Index{0}, bands, [&](Index b) {
    const VectorXd prediction = evaluation.channels * (state.gain[b] * model.palette().col(b));
    double cost = 0.0;
    for (Index p = 0; p < prediction.size(); ++p) {
      if (!data.use[static_cast<std::size_t>(p)]) continue;
      const auto at = static_cast<std::size_t>(p * bands + b);
      cost += huber_cost((static_cast<double>(data.image.value[at]) - prediction[p] - state.offset[b]) /
                             static_cast<double>(data.sigma[at]),
                         params.huber_sigmas);
    }
    sum[b] = cost;
  });
  return sum.sum() / static_cast<double>(data.residuals);
}

CompressedAt compress(const ForwardModel& model, const FitData& data, const FitState& state,
                      const Evaluation& evaluation, const std::vector<int>& free, const FitParams& params,
                      const std::vector<RowMatrix>& right_sides, bool with_halves) {
  const int width = data.image.width;
  const int height = data.image.height;
  const Index bands = model.spectra().bands();
  const Index own = own_count(params);
  const auto shared = static_cast<Index>(free.size());
  const Index columns = own + shared + 1 + static_cast<Index>(right_sides.size());
  const RowMatrix& palette = model.palette();
  std::vector<TileQr> all(static_cast<std::size_t>(bands), TileQr(columns));
  std::vector<std::vector<TileQr>> half(with_halves ? 2 : 0, all);
  std::vector<double> cost(static_cast<std::size_t>(bands), 0.0);
  std::vector<double> square(static_cast<std::size_t>(bands), 0.0);
  std::vector<std::size_t> robust(static_cast<std::size_t>(bands), 0);

  struct Score {
    std::vector<Index> tile;
    std::vector<VectorXd> value;  ///< own, shared
  };
  std::vector<Score> scores(static_cast<std::size_t>(bands));
  const int tiles_across = (width + kTile - 1) / kTile;
  const int tiles_down = (height + kTile - 1) / kTile;
  for (int tile = 0; tile < tiles_across * tiles_down; ++tile) {
    const int row0 = tile / tiles_across * kTile;
    const int column0 = tile % tiles_across * kTile;
    std::vector<Index> pixels;
    for (int row = row0; row < std::min(height, row0 + kTile); ++row) {
      for (int column = column0; column < std::min(width, column0 + kTile); ++column) {
        const Index p = static_cast<Index>(row) * width + column;
        if (data.use[static_cast<std::size_t>(p)]) pixels.push_back(p);
      }
    }
    if (pixels.empty()) continue;
    const auto count = static_cast<Index>(pixels.size());
    const auto in_bands = [&](const RowMatrix& channels) -> RowMatrix {
      return channels(pixels, Eigen::all) * palette;
    };
    const RowMatrix prediction = in_bands(evaluation.channels);
    std::vector<RowMatrix> slope(static_cast<std::size_t>(shared) + right_sides.size());
    tbb::parallel_for(std::size_t{0}, slope.size(), [&](std::size_t k) {
      slope[k] = k < static_cast<std::size_t>(shared)
                     ? in_bands(evaluation.derivative[static_cast<std::size_t>(free[k])])
                     : in_bands(right_sides[k - static_cast<std::size_t>(shared)]);
    });
    tbb::parallel_for(Index{0}, bands, [&](Index b) {
      const auto band = static_cast<std::size_t>(b);
      MatrixXd rows(count, columns);
      VectorXd residual(count);
      for (Index i = 0; i < count; ++i) {
        const auto at = static_cast<std::size_t>(pixels[static_cast<std::size_t>(i)] * bands + b);
        const double sigma = static_cast<double>(data.sigma[at]);
        residual[i] =
            (static_cast<double>(data.image.value[at]) - state.gain[b] * prediction(i, b) - state.offset[b]) / sigma;
        const double weight = huber_weight(residual[i], params.huber_sigmas);
        cost[band] += huber_cost(residual[i], params.huber_sigmas);
        square[band] += residual[i] * residual[i];
        robust[band] += weight < 1.0 ? 1 : 0;
        const double root = std::sqrt(weight) / sigma;
        Index column = 0;
        if (params.gain) rows(i, column++) = root * prediction(i, b);
        if (params.offset) rows(i, column++) = root;
        for (Index k = 0; k < shared; ++k)
          rows(i, column++) = root * state.gain[b] * slope[static_cast<std::size_t>(k)](i, b);
        rows(i, column++) = std::sqrt(weight) * residual[i];
        for (std::size_t k = static_cast<std::size_t>(shared); k < slope.size(); ++k)
          rows(i, column++) = root * state.gain[b] * slope[k](i, b);
      }
      all[band].add(rows);
      if (with_halves) {
        half[static_cast<std::size_t>((tile / tiles_across + tile % tiles_across) % 2)][band].add(rows);
        scores[band].tile.push_back(tile);
        scores[band].value.push_back(rows.leftCols(own + shared).transpose() * rows.col(own + shared));
      }
    });
  }

  const auto triangles = [](const std::vector<TileQr>& of) {
    std::vector<MatrixXd> result;
    for (const TileQr& qr : of) result.push_back(qr.triangle());
    return result;
  };
  CompressedAt result;
  result.all = join_bands(triangles(all), own, shared);
  const auto residuals = static_cast<double>(data.residuals);
  result.cost = std::accumulate(cost.begin(), cost.end(), 0.0) / residuals;
  result.chi_square = std::accumulate(square.begin(), square.end(), 0.0) / residuals;
  result.robust_share = static_cast<double>(std::accumulate(robust.begin(), robust.end(), std::size_t{0})) / residuals;
  if (!with_halves) return result;
  for (const auto& one : half) result.half_triangle.push_back(join_bands(triangles(one), own, shared).shared_triangle);

  // Scores of the tiles after the bands' own parameters are eliminated: s_shared + response' s_own.
  MatrixXd score = MatrixXd::Zero(shared, static_cast<Index>(tiles_across) * tiles_down);
  for (std::size_t band = 0; band < scores.size(); ++band) {
    const MatrixXd response = result.all.own_response(band);
    for (std::size_t k = 0; k < scores[band].tile.size(); ++k) {
      const VectorXd& value = scores[band].value[k];
      score.col(scores[band].tile[k]) += value.tail(shared) + response.transpose() * value.head(own);
    }
  }
  result.score_scatter = score * score.transpose();
  const MatrixXd priors = prior_rows(state, state.camera, free, params);
  if (priors.rows() > 0) result.score_scatter += priors.leftCols(shared).transpose() * priors.leftCols(shared);
  return result;
}

SceneFit fit_scene(const ForwardModel& model, const Capture& capture, const FitState& start, const FitParams& params,
                   const Progress& progress) {
  validate(params);
  const image::SpectralImage& image = capture.image;
  if (image.width != start.camera.width || image.height != start.camera.height) {
    throw InvalidInput(
        fmt::format("The capture has {} × {} pixels, the scene's camera {} × {}. Set camera.width_px and height_px to "
                    "the capture's.",
                    image.width, image.height, start.camera.width, start.camera.height));
  }
  const VectorXd& wavelength = model.spectra().wavelength_nm;
  if (image.bands() != wavelength.size() || (image.wavelength_nm - wavelength).cwiseAbs().maxCoeff() > 0.5) {
    throw InvalidInput(fmt::format(
        "The capture has {} bands from {:.1f} to {:.1f} nm, the scene's camera {} from {:.1f} to {:.1f} nm. Set the "
        "scene's wavelengths and the camera's bands to the capture's.",
        image.bands(), image.wavelength_nm[0], image.wavelength_nm[image.bands() - 1], wavelength.size(), wavelength[0],
        wavelength[wavelength.size() - 1]));
  }

  SceneFit fit;
  fit.state = start;
  fit.free = free_parameters(model.scene(), params);
  FitData& data = fit.data;
  data.image = image;
  data.use = capture.use;
  const int bands = image.bands();
  data.sigma.resize(image.value.size());
  fit.noise_known = capture.noise.known();
  VectorXd peak = VectorXd::Zero(bands);
  for (int b = 0; b < bands; ++b) {
    std::vector<float> values;
    for (std::size_t p = 0; p < data.use.size(); ++p) {
      if (data.use[p]) values.push_back(image.value[p * static_cast<std::size_t>(bands) + static_cast<std::size_t>(b)]);
    }
    peak[b] = quantile(values, 0.99);
  }
  if (!(peak.maxCoeff() > 0.0)) throw InvalidInput("The capture is dark in all bands: nothing can be fitted to it.");
  for (std::size_t p = 0; p < data.use.size(); ++p) {
    for (int b = 0; b < bands; ++b) {
      const std::size_t at = p * static_cast<std::size_t>(bands) + static_cast<std::size_t>(b);
      const double value = static_cast<double>(image.value[at]);
      double variance = std::pow(params.model_sigma * std::max(value, 0.0), 2);
      variance += fit.noise_known ? capture.variance(p, b, value) : std::pow(2e-3 * peak[b], 2);
      data.sigma[at] = static_cast<float>(std::sqrt(std::max(variance, std::pow(1e-6 * peak.maxCoeff(), 2))));
    }
    data.residuals += data.use[p] ? static_cast<std::size_t>(bands) : 0;
  }

  const LensCamera like = start.camera;
  if (params.staged) {
    const int side = std::max(image.width, image.height);
    const double half_angle = fit.state.half_angle_rad;
    int factor = 1;
    while (side / (2 * factor) >= 32) factor *= 2;
    bool first = true;
    for (; factor > 1 || first; factor /= 2) {
      const FitData small = reduced(data, factor, 0.01);
      FitState state = fit.state;
      state.camera = reduced(state.camera, factor);
      if (first && params.pose) fit.stages.push_back(align_silhouettes(model, small, state, progress));
      // A wide lamp far from the answer: shadows that overlap attract one another.
      if (first) state.half_angle_rad = std::max(half_angle, kWideLamp);
      state.blur_px = std::max(0.7, fit.state.blur_px / factor);
      FitParams coarse = params;
      coarse.principal = coarse.distortion = coarse.reflectance = false;
      coarse.blur = false;
      coarse.focal = params.focal && !first;
      const Search search{model,   small, coarse, free_parameters(model.scene(), coarse), reduced(like, factor),
                          progress};
      fit.stages.push_back(search.run("small picture", state, first ? 25 : 8, 1e-3));
      state.half_angle_rad = half_angle;
      state.camera = enlarged(state.camera, like, factor);
      state.blur_px = fit.state.blur_px;
      fit.state = state;
      first = false;
      if (factor == 1) break;
    }
  }
  if (params.blur) fit.state.blur_px = std::max(fit.state.blur_px, 0.5);
  const Search search{model, data, params, fit.free, like, progress};
  fit.stages.push_back(search.run("full picture", fit.state, params.most_iterations, kSmallGain));
  fit.converged = fit.stages.back().end != "iteration limit";

  const Evaluation end = model.evaluate(fit.state, fit.free, progress);
  const CompressedAt at = compress(model, data, fit.state, end, fit.free, params, {}, true);
  fit.compressed = at.all;
  fit.half_triangle = at.half_triangle;
  fit.score_scatter = at.score_scatter;
  fit.cost = at.cost;
  fit.chi_square = at.chi_square;
  fit.robust_share = at.robust_share;
  fit.residuals = data.residuals;
  return fit;
}

}  // namespace interglow::fitting
