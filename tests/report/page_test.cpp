// SPDX-License-Identifier: GPL-3.0-or-later
#include "report/page.h"

#include <gtest/gtest.h>

#include "diagnostics/error.h"

namespace interglow::report {
namespace {

Json document() {
  return {{"title", "A title with </script> in it"},
          {"verdict", {{"state", "agrees"}, {"text", "within 0.5 %"}}},
          {"sections", Json::array({{{"type", "facts"}, {"title", "Settings"}, {"rows", {{"margin", 0.005}}}}})}};
}

/// The text between the data element's tags, as a browser would cut it out.
std::string data_of(const std::string& html) {
  const std::string open = "id=\"report-data\">";
  const std::size_t from = html.find(open) + open.size();
  return html.substr(from, html.find("</script", from) - from);
}

TEST(Page, CarriesItsDataUnharmed) { EXPECT_EQ(Json::parse(data_of(html_page(document()))), document()); }

TEST(Page, AsksForNothingOutside) {
  const std::string html = html_page(document());
  for (const char* sign : {"src=\"http", "href=\"http", "@import", "url(http", "fetch("})
    EXPECT_EQ(html.find(sign), std::string::npos) << sign;
  EXPECT_NE(html.find("default-src 'none'"), std::string::npos);
  EXPECT_LT(html.size(), 200'000U);
}

TEST(Page, RefusesAnIncompleteDescription) {
  EXPECT_THROW(html_page({{"title", "x"}}), InvalidParams);
  Json wrong = document();
  wrong["sections"][0]["type"] = "pie";
  try {
    html_page(wrong);
    FAIL();
  } catch (const InvalidParams& error) {
    EXPECT_NE(std::string(error.what()).find("pie"), std::string::npos);
  }
}

}  // namespace
}  // namespace interglow::report
