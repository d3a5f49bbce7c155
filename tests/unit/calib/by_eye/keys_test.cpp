// SPDX-License-Identifier: Apache-2.0
// Tests valid and invalid keys from terminals and scripts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "base/error.h"
#include "base/terminal_keys.h"
#include "tests/support/error_matchers.h"

namespace lenticule::calib {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::vector<KeyPress> decoded(std::string_view bytes) {
  KeyDecoder decoder;
  std::vector<KeyPress> presses;
  for (const char byte : bytes)
    if (const auto press = decoder.feed(byte)) presses.push_back(*press);
  if (const auto press = decoder.pause()) presses.push_back(*press);
  return presses;
}

TEST(KeyDecoder, ArrowsWithShiftAreCoarseAndWithControlFine) {
  EXPECT_THAT(decoded("\x1b[A\x1b[1;2B\x1b[1;5C\x1bOD"),
              ElementsAre(KeyPress{Key::Up}, KeyPress{Key::Down, Stride::Coarse},
                          KeyPress{Key::Right, Stride::Fine}, KeyPress{Key::Left}));
  EXPECT_THAT(decoded("\x1b[5~\x1b[6~"),
              ElementsAre(KeyPress{Key::Up, Stride::Coarse}, KeyPress{Key::Down, Stride::Coarse}));
}

TEST(KeyDecoder, LettersAreEnoughForAPlainTerminal) {
  EXPECT_THAT(
      decoded("hLkj[]"),
      ElementsAre(KeyPress{Key::Left}, KeyPress{Key::Right, Stride::Coarse}, KeyPress{Key::Up},
                  KeyPress{Key::Down}, KeyPress{Key::SlantLess}, KeyPress{Key::SlantMore}));
  EXPECT_THAT(decoded("\r\x7fUr "),
              ElementsAre(KeyPress{Key::Next}, KeyPress{Key::Back}, KeyPress{Key::Undo},
                          KeyPress{Key::Redo}, KeyPress{Key::Compare}));
}

TEST(KeyDecoder, AnEscapeIsAKeyOnlyIfNothingFollows) {
  EXPECT_THAT(decoded("\x1b"), ElementsAre(KeyPress{Key::Restore}));
  EXPECT_THAT(decoded("\x1b\x1b[A"), ElementsAre(KeyPress{Key::Restore}, KeyPress{Key::Up}));
  EXPECT_THAT(decoded("\x1bx\x1b[99;99Z\x1b[200~"), IsEmpty()) << "unknown ones are dropped";
  EXPECT_THAT(decoded("\x1b["), IsEmpty());
}

TEST(KeyDecoder, NoiseIsConsumedWithoutGrowth) {
  std::mt19937 random(7);
  KeyDecoder decoder;
  size_t presses = 0;
  for (int n = 0; n < 200'000; ++n) {
    const char byte = n % 3 == 0 ? '\x1b' : n % 3 == 1 ? '[' : static_cast<char>(random());
    presses += decoder.feed(byte).has_value() ? 1 : 0;
  }
  EXPECT_GT(presses, 0u);
  (void)decoder.pause();
  EXPECT_FALSE(decoder.is_waiting());
  EXPECT_EQ(decoder.feed('q'), KeyPress{Key::Quit});
}

TEST(KeyScript, ReadsEveryKey) {
  std::string script;
  std::vector<KeyPress> all;
  for (int key = 0; key <= static_cast<int>(Key::Quit); ++key)
    for (const Stride stride : {Stride::Normal, Stride::Coarse, Stride::Fine}) {
      all.push_back({static_cast<Key>(key), stride});
      script += to_string(all.back()) + (key % 2 == 0 ? " " : "\n");
    }
  EXPECT_EQ(parse_key_script(script, "keys"), all);
}

TEST(KeyScript, ReadsCountsAndComments) {
  EXPECT_THAT(parse_key_script("left*3 # and so on: nonsense\r\n\n  enter", "keys"),
              ElementsAre(KeyPress{Key::Left}, KeyPress{Key::Left}, KeyPress{Key::Left},
                          KeyPress{Key::Next}));
}

TEST(KeyScript, ErrorsNameTheirLine) {
  for (const std::string bad : {"lift", "left*0", "left*-1", "left*", "left*2x", "shift+",
                                "left*99999999999", "left*60000 left*60000", "\x01"}) {
    ::lenticule::test::expect_error(
        ::lenticule::test::error_of([&] { (void)parse_key_script("enter\n" + bad, "keys.txt"); }),
        ErrorKind::Input, "keys.txt:2:");
  }
}

}  // namespace
}  // namespace lenticule::calib
