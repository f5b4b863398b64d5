// SPDX-License-Identifier: GPL-3.0-or-later
/// How long work says how far it is and learns that it should stop.
#pragma once

#include <functional>
#include <string_view>

namespace interglow {

/// Two callbacks given by the caller; a default-constructed Progress is silent and never stops.
struct Progress {
  /// Called with a stage name and the share done in [0, 1]; may be called from any thread, a few times a second.
  std::function<void(std::string_view stage, double fraction)> report;
  /// True once the work should stop.
  std::function<bool()> cancelled;

  /// Reports and throws `Cancelled` if the caller asked to stop. Call between units of work of 10 ms to 1 s.
  void update(std::string_view stage, double fraction) const;
};

}  // namespace interglow
