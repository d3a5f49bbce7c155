// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule depth` and `render --prefilter` on the command line.
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "tests/commands/program.h"

namespace lenticule::test {
namespace {

class DepthCommand : public CommandTest {
 protected:
  static std::vector<std::string> arguments(std::vector<std::string> words,
                                            const std::vector<std::string>& more) {
    for (const char* word : {"--rig", "scenes/rigs/tiny.toml"})
      words.push_back(word[0] == '-' ? word : source_file(word));
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  static ProcessResult depth(const std::string& scene, const std::vector<std::string>& more) {
    return run(arguments({"depth", scene}, more));
  }
  ProcessResult render(const std::string& name, const std::vector<std::string>& more) {
    return run(arguments(
        {"render", "builtin:tree:3", "--depth-budget", "6", "--json", "-o", path(name)}, more));
  }
};

TEST_F(DepthCommand, ReportsTheDepthOfAScene) {
  const auto fits = results_of(depth("builtin:tree:3", {"--json", "--depth-scale", "0.1"}));
  EXPECT_DOUBLE_EQ(fits.at("depth_of_field_mm"), 6.0 * 7.7);
  EXPECT_LT(fits.at("depth_of_field_at_edge_mm"), fits["depth_of_field_mm"]);
  EXPECT_EQ(fits.at("subpixels"), 48 * 32 * 3);
  const auto json = results_of(
      depth("builtin:tree:3", {"--json", "--depth-budget", "6", "--picture", path("depth.png")}));
  EXPECT_LT(json.at("share_within"), fits.at("share_within"));
  const auto share = [&](const char* key) { return json.at(key).get<double>(); };
  EXPECT_NEAR(share("share_within") + share("share_in_front") + share("share_behind") +
                  share("share_nothing"),
              1.0, 1e-12);
  EXPECT_LE(share("share_at_glass"), share("share_within"));
  uint64_t seen = 0;
  for (const auto& bin : json.at("bins")) seen += bin.at("subpixels").get<uint64_t>();
  EXPECT_NEAR(static_cast<double>(seen), (1.0 - share("share_nothing")) * 48 * 32 * 3, 0.5);
  EXPECT_EQ(frames::read_woven(path("depth.png")).width(), 48);
}

TEST_F(DepthCommand, PrintsATableAndAddsUpFrames) {
  const ProcessResult one = depth("builtin:teapot:2", {});
  ASSERT_EQ(one.exit_code, 0) << one.err;
  for (const char* text : {"depth of field", "in front of it", "at the panel", "share"})
    EXPECT_NE(one.out.find(text), std::string::npos) << text;
  const auto json = results_of(depth("builtin:teapot:2", {"--frames", "0:2", "--json"}));
  EXPECT_EQ(json.at("frames"), 2);
  EXPECT_EQ(json.at("subpixels"), 2 * 48 * 32 * 3);
}

TEST_F(DepthCommand, PrefiltersOnlyOnRequest) {
  const auto off = render("off.png", {});
  ASSERT_EQ(off.exit_code, 0) << off.err;
  ASSERT_EQ(render("named.png", {"--prefilter", "off"}).exit_code, 0);
  const auto deep = render("depth.png", {"--prefilter", "depth", "--prefilter-samples", "9"});
  ASSERT_EQ(deep.exit_code, 0) << deep.err;
  const auto frame = [&](const char* name) { return frames::read_woven(path(name)); };
  EXPECT_EQ(frame("off.png"), frame("named.png"));
  EXPECT_FALSE(frame("off.png") == frame("depth.png"));
  const auto counts = nlohmann::json::parse(deep.out);
  EXPECT_EQ(counts.at("prefilter"), "depth");
  EXPECT_GT(counts.at("prefiltered_subpixels"), 0);
  EXPECT_GT(counts.at("prefilter_rays"), 0);
  EXPECT_EQ(nlohmann::json::parse(off.out).at("prefilter_rays"), 0);
}

TEST_F(DepthCommand, RefusesInvalidPrefilterOptions) {
  for (const auto& [more, said] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"--prefilter", "blur"}, "prefilter 'blur': unknown"},
           {{"--prefilter", "depth", "--method", "adaptive"}, "method adaptive: has no prefilter"},
           {{"--prefilter", "beam", "--samples", "4"},
            "samples 4: cannot be combined with a prefilter"},
           {{"--prefilter", "depth", "--prefilter-samples", "1"},
            "prefilter samples 1: not in 3 ... 1024"}}) {
    expect_end(render("x.png", more), 2, said);
  }
  EXPECT_EQ(depth("builtin:none-such", {}).exit_code, 2);
  EXPECT_EQ(depth("builtin:teapot:2", {"--depth-budget", "-1"}).exit_code, 2);
  EXPECT_EQ(depth("builtin:teapot:2", {"--picture", path("x.doc")}).exit_code, 2);
}

}  // namespace
}  // namespace lenticule::test
