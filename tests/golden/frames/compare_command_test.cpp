// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <regex>

#include "frame_command_test.h"

namespace lenticule::test {
namespace {

class CompareCommand : public FrameCommandTest {
 protected:
  [[nodiscard]] ProcessResult compare(const std::string& reference, const std::string& test,
                                      std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments = {"compare", reference, test};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
};

TEST_F(CompareCommand, GivesFiguresPerChannelAndInTotal) {
  const auto report = json_of(compare(picture("a.png", kWidth, kHeight, 100),
                                      picture("b.png", kWidth, kHeight, 110), {"--json"}));
  ASSERT_EQ(report["frames"].size(), 1u);
  const auto& frame = report["frames"][0];
  for (const char* channel : {"red", "green", "blue"}) {
    EXPECT_EQ(frame["channels"][channel]["rmse"], 10.0);
    EXPECT_EQ(frame["channels"][channel]["samples"], kWidth * kHeight);
  }
  EXPECT_EQ(frame["total"]["mse"], 100.0);
  EXPECT_NEAR(frame["total"]["psnr_db"].get<double>(), 28.1308, 1e-4);
  EXPECT_EQ(frame["total"]["max"], 10);
  EXPECT_EQ(frame["total"]["over_8"], kWidth * kHeight * 3);
  EXPECT_EQ(frame["total"]["over_32"], 0);
  EXPECT_FALSE(frame.contains("views"));
}

TEST_F(CompareCommand, EqualPicturesHaveANullPsnrAndPassAnyLimit) {
  const std::string a = picture("a.png", kWidth, kHeight, 100);
  const auto report = json_of(compare(a, a, {"--json", "--limit-psnr", "99"}));
  EXPECT_TRUE(report["worst"]["total"]["psnr_db"].is_null());
}

TEST_F(CompareCommand, AddsViewsWithARig) {
  const std::string a = picture("a.png", kWidth, kHeight, 100);
  const std::string b = picture("b.png", kWidth, kHeight, 101);
  const auto native = json_of(compare(a, b, {"--json", "--rig", path("rig.toml")}));
  EXPECT_EQ(native["frames"][0]["views"].size(), 8u);
  const auto five = json_of(compare(a, b, {"--json", "--rig", path("rig.toml"), "--views", "5"}));
  EXPECT_EQ(five["frames"][0]["views"].size(), 5u);
  EXPECT_TRUE(five["frames"][0].contains("worst_view"));
  EXPECT_NE(compare(a, b, {"--rig", path("rig.toml")}).out.find("worst view"), std::string::npos);
}

TEST_F(CompareCommand, FindsTheWorstFrameOfASequence) {
  for (int n = 1; n <= 3; ++n) {
    (void)picture(fmt::format("a{}.png", n), 8, 8, 50);
    (void)picture(fmt::format("b{}.png", n), 8, 8, static_cast<uint8_t>(n == 2 ? 90 : 51));
  }
  const auto report = json_of(compare(path("a%d.png"), path("b%d.png"), {"--json"}));
  EXPECT_EQ(report["frames"].size(), 3u);
  EXPECT_EQ(report["worst_frame"], 1);
  EXPECT_EQ(report["worst"]["total"]["max"], 40);

  std::filesystem::remove(path("b3.png"));
  expect_failure(compare(path("a%d.png"), path("b%d.png")), 4, "b3.png");
  std::filesystem::remove(path("a3.png"));
  std::filesystem::remove(path("a2.png"));
  expect_failure(compare(path("a%d.png"), path("b%d.png")), 4, "2 files, the reference has 1");
}

TEST_F(CompareCommand, NamesBothReadingsOfAPublishedRmse) {
  const auto done =
      compare(picture("a.png", kWidth, kHeight, 100), picture("b.png", kWidth, kHeight, 105));
  EXPECT_NE(done.out.find("is a mean square; compare it with MSE 25.0000"), std::string::npos)
      << done.out;
  EXPECT_NE(done.out.find("100.000 %"), std::string::npos) << "all are over 1";
}

/// The shadows of thin wires are lost; the audit sees fewer of these errors than there are.
TEST_F(CompareCommand, FindsNoLargerErrorThanRenderStates) {
  std::string scene =
      "v\nfrom 0 3 20\nat 0 0 0\nup 0 1 0\nangle 30\nhither 0.01\nresolution 960 540\n"
      "b 0.9 0.9 0.9\nl 7 18 6 0.5 0.5 0.5\nl -8 14 9 0.5 0.5 0.5\nf 0.9 0.9 0.9 1 0 1 0 1\n"
      "p 4\n-12 -3 -9\n-12 -3 9\n12 -3 9\n12 -3 -9\nf 0.5 0.5 0.5 1 0 1 0 1\n";
  for (int n = 0; n < 12; ++n)
    scene += fmt::format("c\n{} 8 -3 0.01\n{} 8 {} 0.01\n", n - 6, 6 - n, n / 3.0);
  write("wires.nff", scene);
  const auto render = [this](const char* method) {
    return run({"render", path("wires.nff"), "--rig", source_file("scenes/rigs/kiosk-27-1080.toml"),
                "--whole-depth", "--frames", "0", "--method", method, "--json", "-o",
                path(method + std::string(".ppm"))});
  };
  ASSERT_EQ(render("full").exit_code, 0);
  const ProcessResult adaptive = render("adaptive");
  const auto stated = json_of(adaptive);
  const auto report = json_of(compare(path("full.ppm"), path("adaptive.ppm"), {"--json"}));
  const double rmse = report["frames"][0]["total"]["rmse"];
  EXPECT_GT(rmse, stated["audited_rmse"].get<double>());
  EXPECT_LE(rmse, stated["rmse_bound"].get<double>());
  std::smatch printed;
  ASSERT_TRUE(std::regex_search(adaptive.err, printed,
                                std::regex("RMSE of the worst frame: (?:at most )?([0-9.]+)")))
      << adaptive.err;
  EXPECT_LE(rmse, std::stod(printed[1]));
}

TEST_F(CompareCommand, ViewsAreAlsoMeasuredAsEyesSeeThem) {
  const std::string a = picture("a.png", kWidth, kHeight, 100);
  const std::string b = picture("b.png", kWidth, kHeight, 110);
  const auto equal = json_of(compare(a, a, {"--json", "--rig", path("rig.toml"), "--views", "3"}));
  const auto other = json_of(compare(a, b, {"--json", "--rig", path("rig.toml"), "--views", "3"}));
  for (size_t view = 0; view < 3; ++view) {
    const auto& same = equal["frames"][0]["views"][view]["seen"];
    EXPECT_EQ(same["ssim"], 1.0);
    EXPECT_EQ(same["total"]["max"], 0);
    const auto& seen = other["frames"][0]["views"][view]["seen"];
    EXPECT_LT(seen["ssim"].get<double>(), 1.0);
    EXPECT_EQ(seen["channels"]["green"]["max"], 10);
  }
}

TEST_F(CompareCommand, ASequenceHasMeansItsWorstFrameAndItsWorstView) {
  for (int n = 0; n < 3; ++n) {
    (void)picture(fmt::format("a{}.png", n), kWidth, kHeight, 100);
    (void)picture(fmt::format("b{}.png", n), kWidth, kHeight,
                  static_cast<uint8_t>(n == 1 ? 120 : 101));
  }
  const std::vector<std::string> rig = {"--rig", path("rig.toml"), "--views", "3"};
  auto json_too = rig;
  json_too.emplace_back("--json");
  const auto report = json_of(compare(path("a%d.png"), path("b%d.png"), json_too));
  EXPECT_EQ(report["worst_frame"], 1);
  EXPECT_EQ(report["worst_view"]["frame"], 1);
  EXPECT_EQ(report["worst_view"]["seen"]["total"]["max"], 20);
  const auto& means = report["means"];
  EXPECT_NEAR(means["total"]["mse"].get<double>(), (1.0 + 400.0 + 1.0) / 3.0, 1e-9);
  EXPECT_NEAR(means["mean_rmse"].get<double>(), (1.0 + 20.0 + 1.0) / 3.0, 1e-9);
  EXPECT_NEAR(means["mean_psnr_db"].get<double>(), (2.0 * 48.1308 + 48.1308 - 26.0206) / 3.0, 1e-3);
  EXPECT_EQ(means["views"].size(), 3u);
  EXPECT_NEAR(means["total"]["share_over_8"].get<double>(), 1.0 / 3.0, 1e-9);
  const auto table = compare(path("a%d.png"), path("b%d.png"), rig);
  for (const char* part : {"worst frame: 1", "of frame 1", "means of frames: RMSE 7.3333"})
    EXPECT_NE(table.out.find(part), std::string::npos) << part << "\n" << table.out;
}

TEST_F(CompareCommand, CountsTheShareOfSubpixelsOverAGivenDifference) {
  for (int n = 0; n < 4; ++n) {
    (void)picture(fmt::format("a{}.png", n), kWidth, kHeight, 100);
    (void)picture(fmt::format("b{}.png", n), kWidth, kHeight, static_cast<uint8_t>(100 + n));
  }
  const auto over = [&](const char* levels) {
    const auto report =
        json_of(compare(path("a%d.png"), path("b%d.png"), {"--over", levels, "--json"}));
    EXPECT_EQ(report["frames"][3]["total"]["share_over"], std::string_view(levels) == "3" ? 0 : 1);
    return report["means"]["total"]["share_over"].get<double>();
  };
  EXPECT_DOUBLE_EQ(over("2"), 0.25);
  EXPECT_DOUBLE_EQ(over("1.5"), 0.5);  // of whole levels, 2 and 3 are more
  EXPECT_DOUBLE_EQ(over("3"), 0.0);
  const auto table = compare(path("a%d.png"), path("b%d.png"), {"--over", "1.5"});
  for (const char* part : {"50.0000 % of the subpixels differ by more than 1.5 levels",
                           "RMSE 1.8708: root mean square over all subpixels"})
    EXPECT_NE(table.out.find(part), std::string::npos) << part << "\n" << table.out;
}

TEST_F(CompareCommand, TwoFoldersArePairedByName) {
  for (const char* folder : {"a", "b"}) {
    std::filesystem::create_directories(path(folder));
    for (const char* name : {"first", "second"})
      (void)picture(fmt::format("{}/{}.png", folder, name), 8, 8,
                    static_cast<uint8_t>(*folder == 'a' ? 50
                                         : *name == 'f' ? 51
                                                        : 70));
  }
  write("a/notes.txt", "no picture");
  const auto report = json_of(compare(path("a"), path("b"), {"--json"}));
  EXPECT_EQ(report["frames"].size(), 2u);
  EXPECT_EQ(report["worst"]["test"], path("b/second.png"));
  expect_failure(compare(path("a"), path("b/first.png")), 2, "only one side is a folder");
  std::filesystem::remove(path("b/second.png"));
  expect_failure(compare(path("a"), path("b")), 4, "b/second.png");
  std::filesystem::create_directories(path("empty"));
  expect_failure(compare(path("empty"), path("b")), 4, "no pictures");
}

TEST_F(CompareCommand, DrawsTheDifferencesOfTheWorstFrame) {
  (void)picture("a0.png", 8, 8, 50);
  (void)picture("a1.png", 8, 8, 0);
  (void)picture("b0.png", 8, 8, 51);
  (void)picture("b1.png", 8, 8, 255);
  ASSERT_EQ(compare(path("a%d.png"), path("b%d.png"), {"--picture", path("heat.png")}).exit_code,
            0);
  const auto heat = frames::read_woven(path("heat.png"));
  EXPECT_EQ(heat.width(), 8);
  EXPECT_EQ(heat.row(3)[10], 255) << "white: all that there can be";
  expect_failure(compare(path("a0.png"), path("b0.png"), {"--picture", path("heat.gif")}), 2,
                 "heat.gif");
}

TEST_F(CompareCommand, AMissedLimitIsExitCode5AfterTheFigures) {
  const std::string a = picture("a.png", kWidth, kHeight, 100);
  const std::string b = picture("b.png", kWidth, kHeight, 110);
  const auto missed = compare(a, b, {"--limit-psnr", "30"});
  expect_failure(missed, 5, "28.13 dB, below the limit of 30 dB");
  EXPECT_NE(missed.out.find("total"), std::string::npos);
  EXPECT_EQ(compare(a, b, {"--limit-psnr", "28"}).exit_code, 0);
}

TEST_F(CompareCommand, RefusesIncomparablePictures) {
  const std::string a = picture("a.png", kWidth, kHeight, 100);
  expect_failure(compare(a, picture("b.png", kHeight, kWidth, 100)), 4, "b.png");
  expect_failure(compare(a, path("none.png")), 4, "none.png");
  expect_failure(compare(a, truncated(a, "cut.png")), 4, "cut.png");
  expect_failure(compare(a, path("%d.png")), 2, "only one side");
  expect_failure(compare(path("x%d.png"), path("y%d.png")), 4, "x%d.png");
  expect_failure(compare(a, a, {"--views", "5"}), 4, "3840 x 2160");  // of the sample rig
  const std::string other = picture("other.png", 8, 8, 1);
  expect_failure(compare(other, other, {"--rig", path("rig.toml")}), 4, "48 x 32");
}

}  // namespace
}  // namespace lenticule::test
