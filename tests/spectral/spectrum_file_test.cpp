// SPDX-License-Identifier: GPL-3.0-or-later
#include "spectral/spectrum_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "diagnostics/error.h"
#include "spectral/shipped_tables.h"
#include "tests/spectral/table_text.h"

namespace interglow::spectral {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(ReadSpectrum, PicksTheColumnByName) {
  const TableText file(
      "\xEF\xBB\xBF# two papers\r\nwavelength_nm, pink ,\"orange\"\r\n400,0.25,+0.5\r\n\r\n410,2.5e-1,0.75\r\n");
  const Spectrum orange = read_spectrum(file.path(), "orange");
  EXPECT_EQ(orange.wavelength_nm, Eigen::Vector2d(400, 410));
  EXPECT_EQ(orange.value, Eigen::Vector2d(0.5, 0.75));
  EXPECT_THAT(orange.source, AllOf(HasSubstr(file.path().string()), HasSubstr("orange")));
  EXPECT_EQ(read_spectrum(file.path(), "pink").value, Eigen::Vector2d(0.25, 0.25));
}

TEST(ReadSpectrum, UnknownColumnNamesTheNearest) {
  const TableText file("wavelength_nm,pink,orange\n400,0.2,0.3\n");
  EXPECT_THAT(message_of<InvalidInput>([&] { read_spectrum(file.path(), "ornage"); }),
              AllOf(HasSubstr("ornage"), HasSubstr("did you mean \"orange\"")));
  EXPECT_THAT(message_of<InvalidInput>([&] { read_spectrum(file.path()); }), HasSubstr("\"pink\", \"orange\""));
}

TEST(ReadSpectrum, SpdHasNoHeader) {
  const TableText file("# Mitsuba\n400 0.1\n500.5\t0.2\n  600   0.3 \n", ".spd");
  const Spectrum spectrum = read_spectrum(file.path());
  EXPECT_EQ(spectrum.wavelength_nm, Eigen::Vector3d(400, 500.5, 600));
  EXPECT_EQ(spectrum.value, Eigen::Vector3d(0.1, 0.2, 0.3));
}

struct BadTable {
  std::string text;
  std::vector<std::string> expected;  ///< all in the message
};

TEST(ReadSpectrum, RefusesBadTablesWithPlaceAndRemedy) {
  const std::vector<BadTable> tables = {
      {"", {"empty"}},
      {"# only comments\n", {"empty"}},
      {"wavelength_nm,S\n", {"no rows"}},
      {"wavelength_nm\n400\n", {":1:", "one column"}},
      {"400,0.5\n410,0.5\n", {":1:", "\"400\"", "column names"}},
      {"wavelength_nm;S\n400;0,5\n", {":1:", "semicolons"}},
      {"wavelength_nm,S\n400,0,5\n", {":2:", "3 fields, expected 2", "decimal commas"}},
      {"wavelength_nm,S\n400,0.5\n410\n", {":3:", "1 fields, expected 2"}},
      {"wavelength_nm,S\n400,0.5\n# note\n410,nan\n", {":4:", "\"S\"", "\"nan\""}},
      {"wavelength_nm,S\n400,inf\n", {":2:", "\"inf\""}},
      {"wavelength_nm,S\n400,1e999\n", {":2:", "\"1e999\""}},
      {"wavelength_nm,S\n400,half\n", {":2:", "\"S\"", "\"half\""}},
      {"wavelength_nm,S\n400,\n", {":2:", "\"\" is not a finite number"}},
      {"wavelength_nm,S\n410,0.5\n400,0.5\n", {":3:", "400 nm follows 410 nm"}},
      {"wavelength_nm,S\n400,0.5\n400,0.6\n", {":3:", "increasing"}},
      {"wavelength_um,S\n0.4,0.5\n", {":2:", "0.4", "nanometres"}},
      {"wavelength_nm,S,S\n400,0.5,0.6\n", {":1:", "two columns", "\"S\""}},
      {std::string("wavelength_nm,S\n\0\0", 18), {"plain text"}},
  };
  for (const BadTable& table : tables) {
    const TableText file(table.text);
    const std::string message = message_of<InvalidInput>([&] { read_spectrum(file.path()); });
    EXPECT_THAT(message, HasSubstr(file.path().string())) << table.text;
    for (const std::string& part : table.expected) EXPECT_THAT(message, HasSubstr(part)) << table.text;
  }
  EXPECT_THAT(message_of<InvalidInput>([] { read_spectrum("/nowhere/lamp.csv"); }), HasSubstr("/nowhere/lamp.csv"));
}

TEST(WriteSpectraCsv, ReadsBackTheSameBits) {
  const TableText file("");
  const Eigen::Vector3d wavelength(400, 401.5, 700);
  const Eigen::Vector3d a(1.0 / 3.0, -2e-17, 1e300);
  write_spectra_csv(file.path(), wavelength, {{"a", a}, {"b,c", wavelength}}, {"radiance [W m^-2 sr^-1 nm^-1]"});
  const Spectrum back = read_spectrum(file.path(), "a");
  EXPECT_EQ(back.wavelength_nm, wavelength);
  EXPECT_EQ(back.value, a);
  EXPECT_EQ(spectrum_columns(file.path()), (std::vector<std::string>{"a", "b c"}));
}

TEST(FindTable, KnowsShippedNamesAndPaths) {
  EXPECT_TRUE(std::filesystem::exists(find_table("interglow:illuminants/d65")));
  EXPECT_EQ(find_table("lamp.csv", "/scenes"), std::filesystem::path("/scenes/lamp.csv"));
  EXPECT_EQ(find_table("/lamps/lamp.csv", "/scenes"), std::filesystem::path("/lamps/lamp.csv"));
  EXPECT_THAT(message_of<InvalidInput>([] { find_table("interglow:illuminants/d56"); }),
              AllOf(HasSubstr("\"interglow:illuminants/d56\""), HasSubstr("did you mean")));
  EXPECT_THROW(find_table("interglow:../spectrum"), InvalidInput);
}

TEST(ShippedTables, HoldThePublishedValues) {
  // CIE 15: D65 is 100 at 560 nm and 117.008 at 450 nm; ybar(555 nm) = 1; A is 100 at 560 nm.
  const Spectrum d65 = read_spectrum(find_table("interglow:illuminants/d65"));
  EXPECT_EQ(d65.value[(560 - 300) / 5], 100.0);
  EXPECT_EQ(d65.value[(450 - 300) / 5], 117.008);
  EXPECT_EQ(read_spectrum(find_table("interglow:illuminants/a")).value[(560 - 300) / 5], 100.0);
  EXPECT_EQ(read_spectrum(find_table("interglow:observers/cie1931_2deg_1nm"), "ybar").value[555 - 360], 1.0);
  EXPECT_NEAR(read_spectrum(find_table("interglow:illuminants/led365")).value[365 - 330 - 5], 0.5,
              1e-6);  // half at -5 nm
  for (const std::string& name : shipped_tables()) EXPECT_FALSE(spectrum_columns(find_table(name)).empty()) << name;
}

}  // namespace
}  // namespace interglow::spectral
