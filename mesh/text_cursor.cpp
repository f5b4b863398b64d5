// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/text_cursor.h"

#include <charconv>
#include <cstdlib>
#include <limits>
#include <string>
#include <system_error>

namespace interglow::mesh::detail {

std::optional<double> parse_number(std::string_view token) {
  // from_chars knows no plus sign.
  if (token.size() > 1 && token[0] == '+' && token[1] != '-' && token[1] != '+') token.remove_prefix(1);
  double value = 0.0;
  const auto [rest, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  if (rest != token.data() + token.size() || token.empty()) return std::nullopt;
  // from_chars does not say on which side a number is out of range.
  if (error == std::errc::result_out_of_range) return std::strtod(std::string(token).c_str(), nullptr);
  if (error != std::errc{}) return std::nullopt;
  return value;
}

std::optional<long long> parse_integer(std::string_view token) {
  if (token.size() > 1 && token[0] == '+' && token[1] != '-' && token[1] != '+') token.remove_prefix(1);
  long long value = 0;
  const auto [rest, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  if (rest != token.data() + token.size() || token.empty()) return std::nullopt;
  if (error == std::errc::result_out_of_range) return std::numeric_limits<long long>::max();
  if (error != std::errc{}) return std::nullopt;
  return value;
}

}  // namespace interglow::mesh::detail
