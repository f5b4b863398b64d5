// SPDX-License-Identifier: GPL-3.0-or-later
/// Small readers of other renderers' scene files.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <map>
#include <pugixml.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace interglow::exchange {

/// Wavelengths [nm] and values.
using SpectrumNodes = std::pair<std::vector<double>, std::vector<double>>;

inline std::vector<double> numbers(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == ',' || c == ':'; }, ' ');
  std::istringstream words(text);
  std::vector<double> found;
  for (double number = 0; words >> number;) found.push_back(number);
  return found;
}

inline Eigen::Vector3d vector(const std::string& text) {
  const std::vector<double> xyz = numbers(text);
  if (xyz.size() != 3) throw std::runtime_error("not three numbers: " + text);
  return {xyz[0], xyz[1], xyz[2]};
}

/// A spectrum's nodes in the way of either version.
inline SpectrumNodes mitsuba_nodes(const pugi::xml_node& spectrum) {
  if (std::string(spectrum.attribute("type").value()) == "irregular") {
    return {numbers(spectrum.find_child_by_attribute("name", "wavelengths").attribute("value").value()),
            numbers(spectrum.find_child_by_attribute("name", "values").attribute("value").value())};
  }
  const std::vector<double> pairs = numbers(spectrum.attribute("value").value());
  SpectrumNodes nodes;
  for (std::size_t i = 0; i + 1 < pairs.size(); i += 2) {
    nodes.first.push_back(pairs[i]);
    nodes.second.push_back(pairs[i + 1]);
  }
  return nodes;
}

inline SpectrumNodes pbrt_nodes(const std::string& text) {
  const std::vector<double> pairs = numbers(text);
  SpectrumNodes nodes;
  for (std::size_t i = 0; i + 1 < pairs.size(); i += 2) {
    nodes.first.push_back(pairs[i]);
    nodes.second.push_back(pairs[i + 1]);
  }
  return nodes;
}

/// A statement of a pbrt file: its name, its kind, and parameters "type name" [ values ].
struct Statement {
  std::string name, kind;
  std::vector<double> plain;                  ///< numbers that follow the name
  std::map<std::string, std::string> values;  ///< by "type name"
};

inline std::vector<Statement> read_pbrt(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<std::string> tokens;
  for (std::string line; std::getline(file, line);) {
    line = line.substr(0, line.find('#'));
    for (std::size_t i = 0; i < line.size();) {
      if (std::isspace(static_cast<unsigned char>(line[i])) != 0) {
        ++i;
      } else if (line[i] == '"') {
        const std::size_t end = line.find('"', i + 1);
        tokens.push_back(line.substr(i, end - i + 1));
        i = end + 1;
      } else {
        const std::size_t end = std::min(line.find_first_of(" \t", i), line.size());
        tokens.push_back(line.substr(i, end - i));
        i = end;
      }
    }
  }
  std::vector<Statement> statements;
  const auto bare = [](const std::string& token) { return token.substr(1, token.size() - 2); };
  for (std::size_t t = 0; t < tokens.size(); ++t) {
    const std::string& token = tokens[t];
    if (token[0] == '"' && statements.back().kind.empty()) {
      statements.back().kind = bare(token);
    } else if (token[0] == '"') {
      std::string& value = statements.back().values[bare(token)];
      EXPECT_EQ(tokens.at(++t), "[");
      while (tokens.at(++t) != "]") value += (value.empty() ? "" : " ") + tokens[t];
    } else if (std::isalpha(static_cast<unsigned char>(token[0])) != 0) {
      statements.push_back({token, "", {}, {}});
    } else {
      statements.back().plain.push_back(std::stod(token));
    }
  }
  return statements;
}

}  // namespace interglow::exchange
