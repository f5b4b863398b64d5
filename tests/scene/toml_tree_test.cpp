// SPDX-License-Identifier: GPL-3.0-or-later
#include "scene/toml_tree.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "diagnostics/error.h"

namespace interglow::scene {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

std::string message_of(std::string_view text) {
  try {
    parse_toml(text, "some.toml");
  } catch (const InvalidInput& error) {
    return error.what();
  }
  return "no exception";
}

TEST(TomlTree, KeepsLinesAndTheOrderOfTheDocument) {
  const TomlNode document = parse_toml("z = 1\na = 2.5\n\n[m.late]\nx = true\n[m.early]\ny = \"w\"\n", "some.toml");
  const auto& top = std::get<TomlTable>(document.value).entries;
  ASSERT_EQ(top.size(), 3U);
  EXPECT_EQ(top[0].key, "z");
  EXPECT_EQ(std::get<std::int64_t>(top[0].node.value), 1);
  EXPECT_EQ(top[1].key, "a");
  EXPECT_EQ(std::get<double>(top[1].node.value), 2.5);
  EXPECT_EQ(top[1].node.line, 2);
  const auto& tables = std::get<TomlTable>(top[2].node.value).entries;
  ASSERT_EQ(tables.size(), 2U);
  EXPECT_EQ(tables[0].key, "late");
  EXPECT_EQ(tables[0].node.line, 4);
  EXPECT_EQ(tables[1].key, "early");
  EXPECT_EQ(std::get<TomlTable>(tables[1].node.value).entries[0].node.line, 7);
}

TEST(TomlTree, NamesTheLineThatIsNotToml) {
  EXPECT_THAT(message_of("a = 1\nb = = 2\n"), testing::AllOf(StartsWith("some.toml:2: "), HasSubstr("b = = 2")));
}

TEST(TomlTree, RefusesATableDefinedTwice) {
  EXPECT_THAT(message_of("[object.a]\nx = 1\n[object.a]\ny = 2\n"),
              testing::AllOf(StartsWith("some.toml:3: "), HasSubstr("object.a"), HasSubstr("already exists")));
}

TEST(TomlTree, RefusesAKeyGivenTwice) {
  EXPECT_THAT(message_of("[t]\nx = 1\nx = 2\n"), testing::AllOf(StartsWith("some.toml:3: "), HasSubstr("x")));
}

TEST(TomlTree, RefusesDatesAndDeepNesting) {
  EXPECT_THAT(message_of("a = 1\nday = 2020-01-01\n"), testing::AllOf(StartsWith("some.toml:2: "), HasSubstr("date")));
  EXPECT_THAT(message_of("a = " + std::string(10000, '[')), HasSubstr("nested"));
}

TEST(TomlTree, RefusesWhatIsNotText) {
  EXPECT_THAT(message_of(std::string("\x00\xff\x01 \n", 5)), StartsWith("some.toml"));
  EXPECT_THROW(read_toml("/nonexistent/scene.toml"), InvalidInput);
  EXPECT_THROW(read_toml("/"), InvalidInput);
}

}  // namespace
}  // namespace interglow::scene
