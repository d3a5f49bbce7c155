// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule render --zone`.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "frames/sequence/sequence_reader.h"
#include "tests/commands/program.h"

namespace lenticule::test {
namespace {

class ZoneCommand : public CommandTest {
 protected:
  [[nodiscard]] ProcessResult render(const std::string& output,
                                     const std::vector<std::string>& more,
                                     const std::string& rig = "tiny") const {
    std::vector<std::string> all = {"render", "builtin:demo",
                                    "--rig",  source_file("scenes/rigs/" + rig + ".toml"),
                                    "-o",     path(output)};
    all.insert(all.end(), more.begin(), more.end());
    return run(all);
  }
};

TEST_F(ZoneCommand, LeavesSubpixelsBlackAndCountsThem) {
  ASSERT_EQ(render("all.png", {}).exit_code, 0);
  const frames::WovenFrame all = frames::read_woven(path("all.png"));
  for (const char* method : {"full", "adaptive"}) {
    const ProcessResult done = render("zone.png", {"--zone", "-5:5", "--method", method, "--json"});
    ASSERT_EQ(done.exit_code, 0) << done.err;
    EXPECT_NE(done.err.find("no eye in it sees"), std::string::npos) << done.err;
    const auto unseen =
        nlohmann::json::parse(done.out).at("unseen_subpixels").get<std::ptrdiff_t>();
    EXPECT_GT(unseen, 100);
    const frames::WovenFrame zone = frames::read_woven(path("zone.png"));
    EXPECT_GE(std::ranges::count(zone.bytes(), uint8_t{0}), unseen);
  }
}

TEST_F(ZoneCommand, AFilmStatesItsZoneAndIsNotContinuedWithAnother) {
  ASSERT_EQ(render("film.lts", {"--zone", "5", "--frames", "0:2"}).exit_code, 0);
  EXPECT_EQ(frames::SequenceReader(path("film.lts")).info().zone, "-5:5");
  EXPECT_EQ(render("film.lts", {"--zone", "-5:5", "--frames", "0:2"}).exit_code, 0);
  for (const std::vector<std::string>& other :
       {std::vector<std::string>{"--zone", "6"}, std::vector<std::string>{}}) {
    std::vector<std::string> flags = {"--frames", "0:2"};
    flags.insert(flags.end(), other.begin(), other.end());
    const ProcessResult refused = render("film.lts", flags);
    EXPECT_EQ(refused.exit_code, 4);
    EXPECT_NE(refused.err.find("with --zone -5:5"), std::string::npos) << refused.err;
    std::filesystem::copy_file(path("film.lts"), path("begun.lts.part"),
                               std::filesystem::copy_options::overwrite_existing);
    flags.emplace_back("--resume");
    const ProcessResult resumed = render("begun.lts", flags);
    EXPECT_EQ(resumed.exit_code, 4) << resumed.err;
    EXPECT_NE(resumed.err.find("another --zone"), std::string::npos) << resumed.err;
  }
}

TEST_F(ZoneCommand, RefusesBadValuesAndMethodsThatCannotSkip) {
  const auto refused = [&](const std::vector<std::string>& flags, const std::string& rig,
                           int exit_code) {
    const ProcessResult result = render("o.png", flags, rig);
    EXPECT_EQ(result.exit_code, exit_code) << flags.back() << ": " << result.err;
    EXPECT_NE(result.err.find("--zone"), std::string::npos) << result.err;
    EXPECT_FALSE(std::filesystem::exists(path("o.png")));
  };
  for (const char* value :
       {"wide", "-5", "80:-20", "nan", "60@", "60@700", "60@0:700", "60@750:650", "1e9"})
    refused({"--zone", value}, "tiny", 2);
  for (const char* method : {"lens-view", "interpolate", "temporal", "hybrid"})
    refused({"--zone", "5", "--method", method}, "tiny", 2);
  refused({"--zone", "5"}, "paper-64", 4);
  EXPECT_EQ(render("o.png", {"--zone", "5@500:600"}, "paper-64").exit_code, 0);
}

}  // namespace
}  // namespace lenticule::test
