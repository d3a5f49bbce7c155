// SPDX-License-Identifier: Apache-2.0
#include "optics/rig_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "tests/support/random_rigs.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/turned_picture.h"

namespace lenticule::optics {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSmall = R"(format = 1
name = "small"
[panel]
width_px = 48
height_px = 32
pixel_width_mm = 0.5
pixel_height_mm = 0.5
[sheet]
pitch_subpx = 7.7
slant = 0.25
gap_mm = 6
[viewing]
distance_mm = 500
)";

std::string with(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

/// Returns the error for a text, remedy included; empty if the text is accepted.
std::string complaint(const std::string& text) {
  try {
    (void)parse_rig(text, "a.toml");
    return {};
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Input);
    return std::string(error.what()) + (error.hint().empty() ? "" : " | " + error.hint());
  }
}

TEST(RigFile, ReadsEveryKey) {
  const Rig rig = parse_rig(R"(
format = 1
name = "all"
[panel]
width_px = 64
height_px = 48
pixel_width_mm = 0.3
pixel_height_mm = 0.31
[panel.layout]
columns = 2
rows = 1
offsets_px = [[0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [0.6, 0.5, 0.4, 0.3, 0.2, 0.1]]
[sheet]
pitch_subpx = 9.5
slant = -0.1
offset_lenses = 0.25
gap_mm = 3.0
refraction_shape = 0.5
spot_sigma_lenses = 0.03
channel_offset_subpx = [0.1, 0, -0.1]
[sheet.residual]
columns = 2
rows = 3
lenses = [0.01, 0.02, 0.03, 0.04, 0.05, 0.06]
[viewing]
distance_mm = 650
height_mm = -12.5
centre_mm = 310
[identity]
manufacturer = "ABC"
product = 4660
serial = "007"
edid_sha256 = "00ff"
[provenance]
tool = "by hand"
date = "2024-05-31"
)",
                            "all.toml");
  EXPECT_EQ(rig.name, "all");
  EXPECT_EQ(rig.panel.layout.offset(1, 0, 2), (SubpixelOffset{0.2, 0.1}));
  EXPECT_EQ(rig.panel.pixel_height.value, 0.31);
  EXPECT_EQ(rig.sheet.slant, -0.1);
  EXPECT_EQ(rig.sheet.channel_offset[2].value, -0.1);
  EXPECT_EQ(rig.sheet.residual.lenses.at(5), 0.06);
  EXPECT_EQ(rig.viewing.height.value, -12.5);
  EXPECT_EQ(rig.viewing.centre.value, 310.0);
  EXPECT_EQ(rig.identity.product, 4660u);
  ASSERT_EQ(rig.provenance.size(), 2u);
  EXPECT_EQ(rig.provenance[0].first, "tool");  // file order, not alphabetical
}

TEST(RigFile, DefaultsToStripesAndParallelZones) {
  const Rig rig = parse_rig(with(kSmall, "[viewing]\ndistance_mm = 500\n", ""), "a.toml");
  EXPECT_EQ(rig.panel.layout.name(), "rgb");
  EXPECT_TRUE(std::isinf(rig.viewing.distance.value));
}

TEST(RigFile, NamesTheLineAndTheNearestKeyOfAnUnknownOne) {
  EXPECT_EQ(complaint(with(kSmall, "pitch_subpx", "pich_subpx")),
            "a.toml:9: unknown key 'sheet.pich_subpx' | did you mean 'pitch_subpx'?");
  EXPECT_EQ(complaint(with(kSmall, "[viewing]", "[veiwing]")),
            "a.toml:12: unknown key 'veiwing' | did you mean 'viewing'?");
}

struct BadText {
  const char* from;
  const char* to;
  const char* says;
};
class RigFileComplaint : public ::testing::TestWithParam<BadText> {};

TEST_P(RigFileComplaint, BeginsWithTheLineNumber) {
  const BadText& bad = GetParam();
  const std::string said = complaint(with(kSmall, bad.from, bad.to));
  EXPECT_EQ(said.rfind(bad.says, 0), 0u) << said;
}

INSTANTIATE_TEST_SUITE_P(
    All, RigFileComplaint,
    ::testing::Values(
        BadText{"7.7", "\"7.7\"", "a.toml:9: 'sheet.pitch_subpx' is not a number"},
        BadText{"7.7", "nan", "a.toml:9: sheet.pitch_subpx: nan is not within"},
        BadText{"7.7", "0", "a.toml:9: sheet.pitch_subpx: 0 is not within"},
        BadText{"7.7", "-3", "a.toml:9: sheet.pitch_subpx: -3 is not within"},
        BadText{"7.7", "1e400", "a.toml:9: "},
        BadText{"gap_mm = 6", "gap_mm = -6", "a.toml:11: sheet.gap_mm: -6 is not greater than 0"},
        BadText{"48", "0", "a.toml:4: panel.width_px: 0 is not within 1 to 32768"},
        BadText{"48", "40000", "a.toml:4: panel.width_px: 40000 is not within 1 to 32768"},
        BadText{"48", "99999999999999", "a.toml:4: 'panel.width_px' is not within"},
        BadText{"48", "48.5", "a.toml:4: 'panel.width_px' is not a whole number"},
        BadText{"slant = 0.25\n", "", "a.toml:8: key 'sheet.slant' is missing"},
        BadText{"[sheet]", "[sheet]\nresidual = 3", "a.toml:9: 'sheet.residual' is not a section"},
        BadText{"[sheet]", "[sheet]\nchannel_offset_subpx = [1]", "a.toml:9: "},
        BadText{"gap_mm = 6", "gap_mm = 6\n[sheet.residual]\ncolumns=2\nrows=2\nlenses=[0,1]",
                "a.toml:15: sheet.residual.lenses: 2 values where columns * rows = 4"},
        BadText{"[sheet]", "layout = \"rgbw\"\n[sheet]", "a.toml:8: subpixel layout 'rgbw'"},
        BadText{"[sheet]", "layout = {columns=1,rows=1,offsets_px=[[9,9,9,9,9,9]]}\n[sheet]",
                "a.toml:8: subpixel layout: an offset"},
        BadText{"[sheet]", "layout = {columns=1,rows=1,offsets_px=[[1]]}\n[sheet]",
                "a.toml:8: a cell is a list of six numbers"},
        BadText{"[sheet]", "mounting = \"91\"\n[sheet]", "a.toml:8: mounting '91': not a known"},
        BadText{"[sheet]", "mounting = 90\n[sheet]", "a.toml:8: 'panel.mounting' is not a string"},
        BadText{"[sheet]", "bits = 12\n[sheet]", "a.toml:8: panel.bits: 12 is not 8 or 10"},
        BadText{"[sheet]", "bits = \"10\"\n[sheet]",
                "a.toml:8: 'panel.bits' is not a whole number"},
        BadText{"format = 1", "format = 2", "a.toml:1: unknown format; expected 1"},
        BadText{"[panel]", "[panel", "a.toml:3: "},
        BadText{"name = \"small\"", "name = 5", "a.toml:2: 'name' is not a string"},
        BadText{"500", "inf\n[identity]\nproduct = -1", "a.toml:15: 'identity.product'"}));

TEST(RigFile, KeepsEveryMounting) {
  for (const char* name : test::kMountingNames) {
    const Rig rig = parse_rig(
        with(kSmall, "[sheet]", "mounting = \"" + std::string(name) + "\"\n[sheet]"), "a.toml");
    EXPECT_EQ(mounting_name(rig.panel.mounting), name);
    EXPECT_EQ(parse_rig(rig_to_toml(rig), "a.toml"), rig) << name;
  }
}

TEST(RigFile, KeepsTheBitsOfADeepPanelAndWritesNoneForAUsualOne) {
  const Rig usual = parse_rig(kSmall, "a.toml");
  EXPECT_EQ(usual.panel.bits, 8);
  EXPECT_EQ(rig_to_toml(usual).find("bits"), std::string::npos);
  const Rig deep = parse_rig(with(kSmall, "[sheet]", "bits = 10\n[sheet]"), "a.toml");
  EXPECT_EQ(deep.panel.bits, 10);
  EXPECT_EQ(parse_rig(rig_to_toml(deep), "a.toml"), deep);
  EXPECT_EQ(fingerprint(deep), fingerprint(usual)) << "frames do not depend on the bits";
}

TEST(RigFile, ReportsAMissingFormat) {
  EXPECT_EQ(complaint("x = 1\n").rfind("a.toml:1: ", 0), 0u);
  EXPECT_EQ(complaint("").rfind("a.toml:1: key 'format' is missing", 0), 0u);
}

TEST(RigFile, SurvivesDeepNesting) {
  EXPECT_EQ(complaint("x = " + std::string(100000, '[')).rfind("a.toml:1: ", 0), 0u);
}

TEST(RigFile, SurvivesARoundTripBitForBit) {
  std::mt19937_64 random(2024);
  for (int r = 0; r < 400; ++r) {
    Rig rig = test::random_rig(random);
    rig.name = r % 3 == 0 ? "quoted \" back\\slash \t tab" : "";
    rig.identity.serial = "s";
    rig.sheet.offset = Lenses(r % 2 == 0 ? -0.0 : rig.sheet.offset.value * 1e-300);
    rig.provenance = {{"z key with spaces", "line\nbreak"}, {"a", "x"}, {"", "empty key"}};
    const Rig back = parse_rig(rig_to_toml(rig), "written");
    ASSERT_EQ(back, rig);
    ASSERT_EQ(std::bit_cast<uint64_t>(back.sheet.offset.value),
              std::bit_cast<uint64_t>(rig.sheet.offset.value));
    ASSERT_EQ(fingerprint(back), fingerprint(rig));
  }
}

TEST(RigFile, IsValidForEverySampleRig) {
  int rigs = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(LENTICULE_SOURCE_DIR) / "scenes/rigs")) {
    EXPECT_NO_THROW((void)load_rig(entry.path())) << entry.path();
    ++rigs;
  }
  EXPECT_GE(rigs, 4);
}

TEST(RigFile, IsReplacedAtomicallyWithoutLeftovers) {
  const test::ScratchFolder folder;
  const fs::path file = folder.path() / "rig.toml";
  save_rig(test::kiosk_rig(), file);
  save_rig(test::upright_rig(), file);
  EXPECT_EQ(load_rig(file), test::upright_rig());
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(RigFile, KeepsTheOldOneWhenItCannotBeWritten) {
  const test::ScratchFolder folder;
  const fs::path target = folder.path() / "rig.toml";
  fs::create_directories(target / "occupied");  // a rename onto a folder with content fails
  try {
    save_rig(test::kiosk_rig(), target);
    FAIL() << "written";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Failed);
    EXPECT_EQ(std::string(error.what()).rfind(target.string() + ": ", 0), 0u);
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
  EXPECT_THROW(save_rig(test::kiosk_rig(), folder.path() / "no/such/folder/rig.toml"), Error);
}

TEST(RigFile, ThatCannotBeReadIsAnInputError) {
  const test::ScratchFolder folder;
  const auto kind_of = [](const fs::path& file) {
    try {
      (void)load_rig(file);
      return ErrorKind::Failed;
    } catch (const Error& error) {
      return error.kind();
    }
  };
  EXPECT_EQ(kind_of(folder.path() / "missing.toml"), ErrorKind::Input);
  EXPECT_EQ(kind_of(folder.path()), ErrorKind::Input);
  const fs::path pipe = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(kind_of(pipe), ErrorKind::Input);  // reading does not wait for a writer
  const fs::path large = folder.path() / "large.toml";
  std::ofstream(large) << std::string((16u << 20) + 1, '#');
  EXPECT_EQ(kind_of(large), ErrorKind::Input);
}

}  // namespace
}  // namespace lenticule::optics
