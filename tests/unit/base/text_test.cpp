// SPDX-License-Identifier: Apache-2.0
#include "base/text.h"

#include <gtest/gtest.h>

#include <iterator>
#include <nlohmann/json.hpp>

namespace lenticule {
namespace {

TEST(Text, EscapingKeepsPrintableUtf8) {
  const std::string text = "Cam\u00e9ra 3 \u03bcm \u65e5\u672c \U0001F600 C:\\x";
  EXPECT_EQ(escaped(text), text);
  EXPECT_EQ(escaped("\u0646\u0645\u06cc\u200c\u062e\u0648\u0627\u0647\u0645"),
            "\u0646\u0645\u06cc\u200c\u062e\u0648\u0627\u0647\u0645")
      << "Persian needs the non-joiner";
  EXPECT_EQ(escaped(""), "");
}

TEST(Text, EscapingShowsTheBytesOfControlsAndOfInvalidUtf8) {
  EXPECT_EQ(escaped("\x1b]0;title\x07"), "\\x1b]0;title\\x07");
  EXPECT_EQ(escaped("a\nb\tc\rd\x7f"), "a\\x0ab\\x09c\\x0dd\\x7f");
  EXPECT_EQ(escaped(std::string_view("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(escaped("\u009b31m"), "\\xc2\\x9b31m") << "one character that starts a sequence";
  EXPECT_EQ(escaped("\xff"), "\\xff");
  EXPECT_EQ(escaped("caf\xe9"), "caf\\xe9");
  EXPECT_EQ(escaped("\xc0\xaf"), "\\xc0\\xaf") << "a long form of '/'";
  EXPECT_EQ(escaped("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "half of a pair";
  EXPECT_EQ(escaped("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "beyond the last code";
  EXPECT_EQ(escaped("\xe2\x82"), "\\xe2\\x82") << "cut short";
}

TEST(Text, EscapingShowsBidirectionalAndInvisibleCharacters) {
  EXPECT_EQ(escaped("a\u202egnp.exe"), "a\\xe2\\x80\\xaegnp.exe");
  for (const char* mark : {"\u061c", "\u200b", "\u200e", "\u200f", "\u2028", "\u2029", "\u202a",
                           "\u2066", "\u2069", "\ufeff", "\U000e0041"})
    EXPECT_EQ(escaped(mark).substr(0, 2), "\\x") << escaped(mark);
}

TEST(Text, NaturalOrderComparesNumbersInNames) {
  const NaturalOrder before;
  const char* const names[] = {"a",       "a1.png", "A2.png", "a2b.png", "a2b10", "a2b11",
                               "a10.png", "ab.png", "IMG_9",  "img_10",  "IMG_11"};
  for (size_t k = 0; k + 1 < std::size(names); ++k) {
    EXPECT_TRUE(before(names[k], names[k + 1])) << names[k];
    EXPECT_FALSE(before(names[k + 1], names[k])) << names[k];
  }
  EXPECT_TRUE(before("99999999999999999999998", "99999999999999999999999"));
  // Names that differ in zeros or case only still have a strict order.
  EXPECT_NE(before("a01", "a1"), before("a1", "a01"));
  EXPECT_NE(before("A1", "a1"), before("a1", "A1"));
  EXPECT_FALSE(before("a1", "a1"));
}

TEST(Text, PercentSignsOfUrisAreDecoded) {
  EXPECT_EQ(percent_decoded("a%20b%c3%A4"), "a b\xC3\xA4");
  EXPECT_EQ(percent_decoded("100%"), "100%");
  EXPECT_EQ(percent_decoded("%05d%2"),
            "\x05"
            "d%2");
}

TEST(Text, EscapingTwiceChangesNothing) {
  const std::string once = escaped("\x1b[2J\n\xff\u202e");
  EXPECT_EQ(escaped(once), once);
}

TEST(Text, ShorteningCutsAfterAWholeCharacter) {
  EXPECT_EQ(shortened("abcdef", 6), "abcdef");
  EXPECT_EQ(shortened("abcdefg", 6), "abc...");
  EXPECT_EQ(shortened("ab\u00e9defg", 6), "ab...");
  EXPECT_EQ(shortened("abcd", 3), "...");
}

TEST(Text, JsonIsValidAsciiForAnyBytes) {
  const std::string text = json_text(nlohmann::json{{"name", "\x1b[2J\xff\u009b\u202e\u00e9"}});
  for (const char c : text) EXPECT_TRUE(c >= ' ' && c < 0x7f) << static_cast<int>(c);
  EXPECT_EQ(nlohmann::json::parse(text)["name"], "\x1b[2J\ufffd\u009b\u202e\u00e9");
}

}  // namespace
}  // namespace lenticule
