// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/spectral_metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace interglow::spectral {
namespace {

TEST(SpectralAngle, KnownAngles) {
  constexpr double kPi = std::numbers::pi;
  EXPECT_NEAR(*spectral_angle(Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 5)), kPi / 2, 1e-15);
  EXPECT_NEAR(*spectral_angle(Eigen::Vector2d(2, 0), Eigen::Vector2d(3, 3)), kPi / 4, 1e-15);
  EXPECT_EQ(*spectral_angle(Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(2, 4, 6)), 0.0);
  // arccos would give 0 for this one.
  EXPECT_NEAR(*spectral_angle(Eigen::Vector2d(1, 0), Eigen::Vector2d(1, 1e-10)), 1e-10, 1e-20);
  EXPECT_FALSE(spectral_angle(Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 1)).has_value());
}

TEST(DeltaSrgb, RangesToTheRootOfThree) {
  EXPECT_NEAR(delta_srgb(Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones()), std::numbers::sqrt3, 1e-15);
  EXPECT_NEAR(delta_srgb({0.1, 0.2, 0.3}, {0.4, 0.2, 0.7}), 0.5, 1e-15);
}

TEST(RootMeanSquareDifference, ByHand) {
  EXPECT_NEAR(root_mean_square_difference(Eigen::Vector2d(1, 2), Eigen::Vector2d(4, 6)), std::sqrt(12.5), 1e-15);
}

TEST(Ciede2000, MeetsTheTableOfSharmaEtAl) {
  // G. Sharma, W. Wu, E. N. Dalal, Color Res. Appl. 30 (2005) 21-30, table 1: pairs that pass every branch of the
  // formula.
  struct Pair {
    Eigen::Vector3d a, b;
    double difference;
  };
  const std::vector<Pair> pairs = {{{50.0, 2.6772, -79.7751}, {50.0, 0.0, -82.7485}, 2.0425},
                                   {{50.0, 3.1571, -77.2803}, {50.0, 0.0, -82.7485}, 2.8615},
                                   {{50.0, 2.8361, -74.0200}, {50.0, 0.0, -82.7485}, 3.4412},
                                   {{50.0, -1.3802, -84.2814}, {50.0, 0.0, -82.7485}, 1.0000},
                                   {{50.0, -1.1848, -84.8006}, {50.0, 0.0, -82.7485}, 1.0000},
                                   {{50.0, -0.9009, -85.5211}, {50.0, 0.0, -82.7485}, 1.0000},
                                   {{50.0, 0.0, 0.0}, {50.0, -1.0, 2.0}, 2.3669},
                                   {{50.0, -1.0, 2.0}, {50.0, 0.0, 0.0}, 2.3669},
                                   {{50.0, 2.4900, -0.0010}, {50.0, -2.4900, 0.0009}, 7.1792},
                                   {{50.0, 2.4900, -0.0010}, {50.0, -2.4900, 0.0010}, 7.1792},
                                   {{50.0, 2.4900, -0.0010}, {50.0, -2.4900, 0.0011}, 7.2195},
                                   {{50.0, 2.4900, -0.0010}, {50.0, -2.4900, 0.0012}, 7.2195},
                                   {{50.0, -0.0010, 2.4900}, {50.0, 0.0009, -2.4900}, 4.8045},
                                   {{50.0, -0.0010, 2.4900}, {50.0, 0.0010, -2.4900}, 4.8045},
                                   {{50.0, -0.0010, 2.4900}, {50.0, 0.0011, -2.4900}, 4.7461},
                                   {{50.0, 2.5, 0.0}, {50.0, 0.0, -2.5}, 4.3065},
                                   {{50.0, 2.5, 0.0}, {73.0, 25.0, -18.0}, 27.1492},
                                   {{50.0, 2.5, 0.0}, {61.0, -5.0, 29.0}, 22.8977},
                                   {{50.0, 2.5, 0.0}, {56.0, -27.0, -3.0}, 31.9030},
                                   {{50.0, 2.5, 0.0}, {58.0, 24.0, 15.0}, 19.4535},
                                   {{50.0, 2.5, 0.0}, {50.0, 3.1736, 0.5854}, 1.0000},
                                   {{50.0, 2.5, 0.0}, {50.0, 3.2972, 0.0}, 1.0000},
                                   {{50.0, 2.5, 0.0}, {50.0, 1.8634, 0.5757}, 1.0000},
                                   {{50.0, 2.5, 0.0}, {50.0, 3.2592, 0.3350}, 1.0000},
                                   {{60.2574, -34.0099, 36.2677}, {60.4626, -34.1751, 39.4387}, 1.2644},
                                   {{63.0109, -31.0961, -5.8663}, {62.8187, -29.7946, -4.0864}, 1.2630},
                                   {{61.2901, 3.7196, -5.3901}, {61.4292, 2.2480, -4.9620}, 1.8731},
                                   {{35.0831, -44.1164, 3.7933}, {35.0232, -40.0716, 1.5901}, 1.8645},
                                   {{22.7233, 20.0904, -46.6940}, {23.0331, 14.9730, -42.5619}, 2.0373},
                                   {{36.4612, 47.8580, 18.3852}, {36.2715, 50.5065, 21.2231}, 1.4146},
                                   {{90.8027, -2.0831, 1.4410}, {91.1528, -1.6435, 0.0447}, 1.4441},
                                   {{90.9257, -0.5406, -0.9208}, {88.6381, -0.8985, -0.7239}, 1.5381},
                                   {{6.7747, -0.2908, -2.4247}, {5.8714, -0.0985, -2.2286}, 0.6377},
                                   {{2.0776, 0.0795, -1.1350}, {0.9033, -0.0636, -0.5514}, 0.9082}};
  for (const Pair& pair : pairs) {
    EXPECT_NEAR(ciede2000(pair.a, pair.b), pair.difference, 5.1e-5)
        << pair.a.transpose() << " | " << pair.b.transpose();
    EXPECT_NEAR(ciede2000(pair.b, pair.a), pair.difference, 5.1e-5) << "swapped";
  }
}

}  // namespace
}  // namespace interglow::spectral
