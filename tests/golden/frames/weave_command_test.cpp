// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <set>

#include "frame_command_test.h"

namespace lenticule::test {
namespace {

class WeaveCommand : public FrameCommandTest {
 protected:
  [[nodiscard]] ProcessResult weave(const std::string& input, std::vector<std::string> more = {},
                                    const ProcessLimits& limits = {}) const {
    std::vector<std::string> arguments = {"weave",          input, "--rig",
                                          path("rig.toml"), "-o",  path("woven.png")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments, limits);
  }
  /// Expects no files except the test's own inputs.
  void expect_no_output() const {
    for (const std::string& name : listing()) {
      EXPECT_NE(name, "woven.png");
      EXPECT_FALSE(name.starts_with(".")) << name;
    }
  }
  [[nodiscard]] frames::WovenFrame woven() const { return frames::read_woven(path("woven.png")); }
};

TEST_F(WeaveCommand, ReadsTheGridFromTheName) {
  const auto done = json_of(weave(quilt("q_qs3x2a1.5.png"), {"--json", "--filter", "nearest"}));
  EXPECT_EQ(done["views"], 6);
  EXPECT_EQ(done["width"], kWidth);
  EXPECT_EQ(done["view_width"], 8);
  EXPECT_EQ(done["aspect"], 1.5);
  EXPECT_EQ(done["filter"], "nearest");
  const auto frame = woven();
  const std::set<uint8_t> codes(frame.bytes().begin(), frame.bytes().end());
  EXPECT_EQ(codes, (std::set<uint8_t>{40, 80, 120, 160, 200, 240}));
}

TEST_F(WeaveCommand, FlagsOverrideTheName) {
  const auto done = json_of(weave(quilt("q_qs1x1.png"), {"--json", "--grid", "3x2", "--views", "4",
                                                         "--aspect", "1.5", "--invert"}));
  EXPECT_EQ(done["views"], 4);
  EXPECT_EQ(done["inverted"], true);
}

TEST_F(WeaveCommand, APatternOfViewsGivesTheSameFrameAsTheirQuilt) {
  ASSERT_EQ(weave(quilt("q_qs3x2a1.5.png")).exit_code, 0);
  const auto from_quilt = woven();
  for (int view = 0; view < 6; ++view)
    (void)picture(fmt::format("view{}.png", view), 8, 6, static_cast<uint8_t>(40 * (view + 1)));
  ASSERT_EQ(weave(path("view%d.png"), {"--aspect", "1.5"}).exit_code, 0);
  EXPECT_EQ(woven(), from_quilt);
}

TEST_F(WeaveCommand, RefusesUnreadableInput) {
  expect_failure(weave(path("none_qs3x2a1.5.png")), 4, "none_qs3x2a1.5.png");
  expect_failure(weave(truncated(quilt("q.png"), "cut_qs3x2a1.5.png")), 4, "truncated");
  expect_failure(weave(path("none%d.png")), 4, "none%d.png");
  write("text_qs3x2a1.5.png", "no picture");
  expect_failure(weave(path("text_qs3x2a1.5.png")), 4, "not a picture of a known format");
  expect_failure(weave(picture("small_qs3x2a1.png", 2, 2, 9)), 4, "too few");
  expect_no_output();
}

TEST_F(WeaveCommand, RefusesInvalidRequests) {
  const std::string plain = quilt("plain.png");
  expect_failure(weave(plain), 2, "the layout of the views is unknown");
  write("model.glb", "glTF, of no version");
  expect_failure(weave(path("model.glb")), 4, "a model, not a picture");
  for (const char* grid : {"3", "3x", "x2", "3x2x1", "0x2", "-3x2", "a"})
    expect_failure(weave(plain, {"--grid", grid}), 2, "");
  expect_failure(weave(plain, {"--grid", "3x2", "--views", "7"}), 2, "7 views");
  expect_failure(weave(plain, {"--grid", "3x2", "--views", "0"}), 2, "");
  expect_failure(weave(plain, {"--grid", "3x2", "--aspect", "-1"}), 2, "aspect");
  expect_failure(weave(plain, {"--grid", "3x2", "--aspect", "nan"}), 2, "aspect");
  expect_failure(weave(plain, {"--grid", "3x2", "--filter", "cubic"}), 2, "cubic");
  expect_failure(weave(plain, {"--grid", "3x2", "--fit", "zoom"}), 2, "zoom");
  expect_failure(weave(path("v%d%d.png")), 2, "v%d%d.png");
  expect_no_output();
}

TEST_F(WeaveCommand, LeavesNoFileIfWritingFails) {
  const std::string input = quilt("q_qs3x2a1.5.png");
  // A container needs no decoder, whose memory would be limited, too.
  const std::string container = path("views.lts");
  ASSERT_EQ(run({"convert", input, "-o", container}).exit_code, 0);
  const auto weave_to = [&](const std::string& output, const ProcessLimits& limits = {}) {
    return run({"weave", container, "--rig", path("rig.toml"), "-o", output}, limits);
  };
  expect_failure(weave_to(path("no/folder/woven.png")), 1, "no/folder/woven.png");
  expect_failure(weave_to(path("woven.gif")), 2, "woven.gif");
  expect_failure(weave_to(path("woven.png"), {.largest_file_bytes = 100}), 1, "woven.png");
  expect_no_output();
}

TEST_F(WeaveCommand, RefusesAnInvalidRig) {
  write("bad.toml", "format = 1\n");
  expect_failure(
      run({"weave", quilt("q_qs3x2a1.5.png"), "--rig", path("bad.toml"), "-o", path("woven.png")}),
      4, "bad.toml");
  expect_no_output();
}

}  // namespace
}  // namespace lenticule::test
