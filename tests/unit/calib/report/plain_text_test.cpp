// SPDX-License-Identifier: Apache-2.0
#include "calib/report/plain_text.h"

#include <gtest/gtest.h>

#include "optics/rig_file.h"
#include "sample_calibration.h"

namespace lenticule::calib {
namespace {

TEST(PlainText, KeepsWhatIsPrintable) {
  EXPECT_EQ(printable("Caméra 3 μm 日本 \U0001F600"), "Caméra 3 μm 日本 \U0001F600");
  EXPECT_EQ(printable(""), "");
}

TEST(PlainText, ReplacesControlsAndBrokenBytes) {
  EXPECT_EQ(printable("a\nb\tc\x01"
                      "d\x7f"),
            "a b c?d?");
  EXPECT_EQ(printable(std::string_view("a\0b", 3)), "a?b");
  EXPECT_EQ(printable("\xff"), "?");
  EXPECT_EQ(printable("caf\xe9"), "caf?");
  EXPECT_EQ(printable("\xc0\xaf"), "??") << "a long form of '/'";
  EXPECT_EQ(printable("\xed\xa0\x80"), "???") << "half of a pair";
  EXPECT_EQ(printable("\xf4\x90\x80\x80"), "????") << "beyond the last code";
  EXPECT_EQ(printable("\xe2\x82"), "??") << "cut short";
}

// The rig file has its own idea of printable text; ours may not be wider.
TEST(PlainText, EveryPairOfBytesIsFitForARigFile) {
  optics::Rig rig = test::sample_rig();
  for (int first = 0; first < 256; ++first) {
    std::string all;
    for (int second = 0; second < 256; ++second) {
      all += static_cast<char>(first);
      all += static_cast<char>(second);
    }
    rig.provenance = {{"key", printable(all)}};
    ASSERT_FALSE(optics::find_problem(rig)) << first;
    ASSERT_EQ(optics::parse_rig(optics::rig_to_toml(rig), "text"), rig) << first;
  }
}

TEST(PlainText, CutsAfterAWholeCharacter) {
  EXPECT_EQ(clipped("abcdef", 6), "abcdef");
  EXPECT_EQ(clipped("abcdefg", 6), "abc...");
  EXPECT_EQ(clipped("ab\u00e9defg", 6), "ab...");
  EXPECT_EQ(clipped("abcd", 3), "...");
}

TEST(PlainText, HtmlShowsMarkupInsteadOfObeyingIt) {
  EXPECT_EQ(html_escaped("<b a='1' c=\"2\">&\n"), "&lt;b a=&#39;1&#39; c=&quot;2&quot;&gt;&amp; ");
}

}  // namespace
}  // namespace lenticule::calib
