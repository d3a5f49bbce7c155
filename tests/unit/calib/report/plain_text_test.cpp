// SPDX-License-Identifier: Apache-2.0
#include "calib/report/plain_text.h"

#include <gtest/gtest.h>

#include "base/text.h"
#include "optics/rig_file.h"
#include "sample_calibration.h"

namespace lenticule::calib {
namespace {

// The rig file's own rule for printable text must accept everything that escaped() returns.
TEST(PlainText, EveryPairOfBytesIsValidInARigFile) {
  optics::Rig rig = test::sample_rig();
  for (int first = 0; first < 256; ++first) {
    std::string all;
    for (int second = 0; second < 256; ++second) {
      all += static_cast<char>(first);
      all += static_cast<char>(second);
    }
    rig.provenance = {{"key", escaped(all)}};
    ASSERT_FALSE(optics::find_problem(rig)) << first;
    ASSERT_EQ(optics::parse_rig(optics::rig_to_toml(rig), "text"), rig) << first;
  }
}

TEST(PlainText, HtmlEscapesMarkup) {
  EXPECT_EQ(html_escaped("<b a='1' c=\"2\">&\n"),
            "&lt;b a=&#39;1&#39; c=&quot;2&quot;&gt;&amp;\\x0a");
}

}  // namespace
}  // namespace lenticule::calib
