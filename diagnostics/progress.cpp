// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnostics/progress.h"

#include <string>

#include "diagnostics/error.h"

namespace interglow {

void Progress::update(std::string_view stage, double fraction) const {
  if (cancelled && cancelled()) throw Cancelled("stopped during " + std::string(stage));
  if (report) report(stage, fraction);
}

}  // namespace interglow
