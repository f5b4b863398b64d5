// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnostics/suggestion.h"

#include <gtest/gtest.h>

namespace interglow {
namespace {

TEST(Suggestion, FindsTheNearestWordOrNone) {
  const std::vector<std::string> known = {"material", "mesh", "transform"};
  EXPECT_EQ(nearest_word("materail", known), "material");
  EXPECT_EQ(nearest_word("mash", known), "mesh");
  EXPECT_FALSE(nearest_word("xylophone", known));
}

}  // namespace
}  // namespace interglow
