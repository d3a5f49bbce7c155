// SPDX-License-Identifier: Apache-2.0
// Tests the check before the TOML parser: characters outside ASCII are allowed only in strings and
// comments.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "optics/toml.h"

namespace lenticule::optics {
namespace {

TEST(TomlLetters, AreAllowedInStringsAndComments) {
  for (const char* good : {"", "\xEF\xBB\xBF# byte order mark\na = 1\n",
                           "# K\xC3\xBC"
                           "che\n",
                           "a = 1 # \xC3\xA4\n",
                           "a = \"K\xC3\xBC"
                           "che\"\n",
                           "a = 'K\xC3\xBC"
                           "che' # \xC3\xA4\n",
                           "a = \"\\\"\xC3\xA4\"\n", "a = '\\'\nb = \"\xC3\xA4\"\n",
                           "a = \"\"\"\n\xC3\xA4 \"\" '''\n\xC3\xA4\"\"\"\nb = 1\n",
                           "a = '''\n\xC3\xA4 '' \"\"\"\n\xC3\xA4''''' # \xC3\xA4\n",
                           "a = \"# \xC3\xA4\"\nb = \"\xC3\xA4\"\n"})
    EXPECT_EQ(stray_letter_line(good), std::nullopt) << good;
}

TEST(TomlLetters, AreReportedWithTheirLineOutsideStrings) {
  const auto at = [](const char* text) { return stray_letter_line(text).value_or(0); };
  EXPECT_EQ(at("\xC3\xA4 = 1\n"), 1);
  EXPECT_EQ(at("\n\n[\xC3\xA4]\n"), 3);
  EXPECT_EQ(at("a = 1\xC3\xA4\n"), 1);
  EXPECT_EQ(at("a = \"x\" \xC3\xA4\n"), 1);
  EXPECT_EQ(at("# c\na = '\\' \xC3\xA4\n"), 2);
  EXPECT_EQ(at("a = \"\"\"\n\n\"\"\"\"\" \xC3\xA4\n"), 3);
  EXPECT_EQ(at("a = \"no end\n\xC3\xA4 = 1\n"), 2);
}

TEST(TomlLetters, AreRefusedByTheReaderOutsideStringsAndKeptInThem) {
  try {
    static_cast<void>(parse_toml("a = 1\n\xC6\x8D = 2\n", "rig.toml"));
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::StartsWith("rig.toml:2: a character outside ASCII"));
  }
  const toml::table table = parse_toml(
      "name = \"K\xC3\xBC"
      "che\" # \xC3\xA4\n",
      "rig.toml");
  EXPECT_EQ(table["name"].value<std::string>(),
            "K\xC3\xBC"
            "che");
}

}  // namespace
}  // namespace lenticule::optics
