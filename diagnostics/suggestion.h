// SPDX-License-Identifier: GPL-3.0-or-later
/// The nearest known word to a misspelt one, for error messages.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace interglow {

/// The entry of `known` with the smallest edit distance to `word`, if it is near enough
/// (at most a third of the letters, at least 2) to be what was meant.
std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& known);

}  // namespace interglow
