// SPDX-License-Identifier: Apache-2.0
// Tests rendering with methods that reuse points on the command line.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "tests/commands/program.h"
#include "tests/support/rig_text.h"

namespace lenticule::test {
namespace {

class ReuseCommand : public CommandTest {
 protected:
  void SetUp() override {
    write("rig.toml",
          rig_toml({.width_px = 96,
                    .height_px = 48,
                    .pitch_subpx = 12.3,
                    .slant = 0.17,
                    .offset_lenses = 0.25,
                    .more_of_sheet = "refraction_shape = 0.45\nspot_sigma_lenses = 0.03\n"}));
  }
  ProcessResult render(const std::string& folder, const std::string& frames,
                       const std::vector<std::string>& more = {}) {
    return run(joined({"render", "builtin:balls:2", "--rig", path("rig.toml"), "--method",
                       "temporal", "--frames", frames, "-o", path(folder + "/%02d.png"), "--json"},
                      more));
  }
  frames::WovenFrame frame(const std::string& name) { return frames::read_woven(path(name)); }
};

/// An interrupted run gives the same bytes, with and without a key frame after the interruption.
TEST_F(ReuseCommand, ResumesToTheSameBytes) {
  const ProcessResult whole = render("whole", "3:20");
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  ASSERT_EQ(render("broken", "3:20").exit_code, 0);
  for (const char* name : {"broken/09.png", "broken/10.png", "broken/18.png"})
    std::filesystem::remove(path(name));
  const auto report = results_of(render("broken", "3:20", {"--resume", "--threads", "1"}));
  EXPECT_EQ(report["frames_rendered"], 3);
  EXPECT_EQ(report["frames_rendered_again"], 6 + 2);
  EXPECT_GT(report["projected_subpixels"], 0);
  for (const char* name : {"09.png", "10.png", "11.png", "18.png", "19.png"})
    EXPECT_EQ(frame(std::string("whole/") + name), frame(std::string("broken/") + name)) << name;
}

TEST_F(ReuseCommand, PaintsAndCountsMissingSubpixels) {
  const ProcessResult result =
      render("out", "0:2", {"--turn", "0:10", "--missing", path("missing/%02d.png")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto report = nlohmann::json::parse(result.out);
  EXPECT_NE(result.err.find("missing after reprojection"), std::string::npos) << result.err;
  uint64_t white = 0;
  for (const char* name : {"missing/00.png", "missing/01.png"}) {
    const frames::WovenFrame missing = frame(name);
    white += static_cast<uint64_t>(std::ranges::count(missing.bytes(), 255));
  }
  EXPECT_GT(white, 0U);
  EXPECT_EQ(report["missing_subpixels"], white);
  EXPECT_EQ(run({"render", "builtin:balls:2", "--rig", path("rig.toml"), "-o", path("a.png"),
                 "--missing", path("m.png")})
                .exit_code,
            2);
}

}  // namespace
}  // namespace lenticule::test
