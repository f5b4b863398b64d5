// SPDX-License-Identifier: GPL-3.0-or-later
// Two unit squares that face each other at distance 1: F = 0.19982489569838746 (Hottel's closed form).
#include <cmath>
#include <cstdio>

#include "radiosity/form_factor.h"

int main() {
  const interglow::radiosity::Polygon lower{{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}}, 4};
  const interglow::radiosity::Polygon upper{{{{0, 0, 1}, {0, 1, 1}, {1, 1, 1}, {1, 0, 1}}}, 4};
  const double f = interglow::radiosity::form_factor(lower, upper).value;
  std::printf("%.15f\n", f);
  return std::abs(f - 0.19982489569838746) < 1e-12 ? 0 : 1;
}
