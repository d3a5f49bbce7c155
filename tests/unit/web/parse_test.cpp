// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/http/parse.h"

#include <gtest/gtest.h>

namespace lenticule::web {
namespace {

TEST(WebParse, FindsACookieByItsWholeName) {
  EXPECT_EQ(cookie_value("a=1; lenticule=x=y; b=2", "lenticule"), "x=y");
  EXPECT_EQ(cookie_value("xlenticule=1;lenticule=2", "lenticule"), "2");
  EXPECT_EQ(cookie_value("lenticule", "lenticule"), std::nullopt);
  EXPECT_EQ(cookie_value("", "lenticule"), std::nullopt);
  EXPECT_EQ(cookie_value(";;;=;", "lenticule"), std::nullopt);
}

TEST(WebParse, TakesBearerCredentialsOnly) {
  EXPECT_EQ(bearer_credential("Bearer abc"), "abc");
  EXPECT_EQ(bearer_credential("bearer   abc "), "abc");
  EXPECT_EQ(bearer_credential("Basic abc"), std::nullopt);
  EXPECT_EQ(bearer_credential("Bearer "), std::nullopt);
  EXPECT_EQ(bearer_credential("Bearerabc"), std::nullopt);
}

TEST(WebParse, TakesConsistentRangesOnly) {
  EXPECT_EQ(parse_content_range("bytes 0-99/1000"),
            (ByteRange{.first = 0, .last = 99, .total = 1000}));
  for (const char* wrong :
       {"bytes 0-99/*", "bytes 5-4/10", "bytes 0-10/10", "bytes */10", "0-9/10", "bytes 0-9",
        "bytes -1-9/10", "bytes 0-18446744073709551616/18446744073709551617", "bytes 0-9/10x"})
    EXPECT_EQ(parse_content_range(wrong), std::nullopt) << wrong;
}

TEST(WebParse, AMediaNameIsOneHarmlessPathComponent) {
  for (const char* right : {"film.lts", "my film (2).mkv", "Käse.png", "views_qs8x6a0.75.png"})
    EXPECT_TRUE(is_media_name(right)) << right;
  for (const char* wrong : {"", ".", "..", "../x", "a/b", "a\\b", ".hidden", "-rf", " a", "a ",
                            "a\nb", "a\x1b[2J", "%05d.png", "<b>", "ring:x", "\xff\xfe", "a|b"})
    EXPECT_FALSE(is_media_name(wrong)) << wrong;
  EXPECT_FALSE(is_media_name(std::string(kMaxMediaName + 1, 'a')));
  EXPECT_FALSE(is_media_name(std::string_view("a\0b", 3)));
}

}  // namespace
}  // namespace lenticule::web
