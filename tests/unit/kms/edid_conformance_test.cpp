// SPDX-License-Identifier: Apache-2.0
// Compares our EDID reader with Debian's edid-decode on a few thousand random EDIDs and on every
// file of the folders named below or in LENTICULE_EDIDS.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <optional>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "display/kms/device/connector.h"
#include "display/kms/device/edid.h"
#include "tests/support/process.h"
#include "tests/support/random_edids.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {
namespace {

namespace fs = std::filesystem;
using display::PixelSize;

constexpr const char* kEdidDecode = "/usr/bin/edid-decode";

/// Returns the number of random EDIDs; each takes a process of edid-decode.
/// LENTICULE_RANDOM_EDIDS=400 makes a longer run, as scripts/test --all does.
uint64_t random_edid_count() {
  const char* const wanted = std::getenv("LENTICULE_RANDOM_EDIDS");
  return wanted ? std::stoull(wanted) : 120;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::optional<std::smatch> find_line(const std::vector<std::string>& lines, const char* pattern) {
  const std::regex expression(pattern);
  std::smatch match;
  for (const std::string& line : lines)
    if (std::regex_search(line, match, expression)) return match;
  return std::nullopt;
}

/// The part of edid-decode's output that our reader covers.
struct Evaluation {
  std::string manufacturer;
  uint32_t product = 0;
  uint32_t serial_number = 0;
  std::optional<int> bits_per_colour;
  bool deep_colour = false;
  bool offers_ycbcr = false;
  std::vector<uint8_t> only_as_420;
  std::optional<PixelSize> base_native, displayid_native, displayid_preferred;
};

/// Returns the rest of the first line that begins with the text.
std::optional<std::string> rest_after(const std::vector<std::string>& lines, const char* text) {
  for (const std::string& line : lines)
    if (line.starts_with(text)) return line.substr(std::strlen(text));
  return std::nullopt;
}

/// Returns the number that follows the text, in the first such line.
std::optional<uint32_t> number_after(const std::vector<std::string>& lines, const char* text) {
  for (const std::string& line : lines)
    if (line.starts_with(text) && std::isdigit(static_cast<uint8_t>(line[std::strlen(text)])) != 0)
      return static_cast<uint32_t>(std::stoul(line.substr(std::strlen(text))));
  return std::nullopt;
}

/// Returns true if a line has both texts, in this order.
bool has_line(const std::vector<std::string>& lines, const char* text, const char* later) {
  return std::ranges::any_of(lines, [&](const std::string& line) {
    const size_t at = line.find(text);
    return at != std::string::npos && line.find(later, at + std::strlen(text)) != std::string::npos;
  });
}

/// Returns the first progressive size of the indented lines after the headline "Preferred Video
/// Timing if ...", of one timing or several.
std::optional<PixelSize> size_below(const std::vector<std::string>& lines, const char* parsed) {
  static const std::regex kSize("^  .*?(\\d+)x(\\d+)(i?)\\s");
  const std::string headline = "Preferred Video Timing";
  auto at = std::ranges::find_if(lines, [&](const std::string& line) {
    return line.starts_with(headline + parsed) || line.starts_with(headline + "s" + parsed);
  });
  if (at == lines.end()) return std::nullopt;
  std::smatch match;
  for (++at; at != lines.end() && at->starts_with("  "); ++at)
    if (std::regex_search(*at, match, kSize) && match[3].str().empty())
      return PixelSize{std::stoi(match[1].str()), std::stoi(match[2].str())};
  return std::nullopt;
}

std::vector<uint8_t> vics_of_420_blocks(const std::vector<std::string>& lines) {
  std::vector<uint8_t> vics;
  static const std::regex kVic("^    VIC +(\\d+):");
  std::smatch match;
  bool inside = false;
  for (const std::string& line : lines) {
    if (!line.starts_with("    ")) inside = line == "  YCbCr 4:2:0 Video Data Block:";
    if (inside && std::regex_search(line, match, kVic))
      vics.push_back(static_cast<uint8_t>(std::stoi(match[1].str())));
  }
  return vics;
}

std::optional<PixelSize> native_of_displayid(const std::vector<std::string>& lines) {
  const std::string label = "Display native pixel format: ";
  for (const std::string& line : lines) {
    const size_t at = line.find(label);
    PixelSize size;
    if (at != std::string::npos &&
        std::sscanf(line.c_str() + at + label.size(), "%dx%d", &size.width, &size.height) == 2 &&
        size.width != 0 && size.height != 0)
      return size;
  }
  return std::nullopt;
}

Evaluation evaluate(const fs::path& file) {
  const auto result = test::run_process({kEdidDecode, "--skip-hex-dump", "-n", "-p", file.string()},
                                        {.timeout = std::chrono::seconds(60)});
  const std::vector<std::string> lines = lines_of(result.out);
  Evaluation said;
  if (const auto maker = rest_after(lines, "    Manufacturer: ")) said.manufacturer = *maker;
  said.product = number_after(lines, "    Model: ").value_or(0);
  said.serial_number = number_after(lines, "    Serial Number: ").value_or(0);
  if (const auto bits = number_after(lines, "    Bits per primary color channel: "))
    said.bits_per_colour = static_cast<int>(*bits);
  said.deep_colour = rest_after(lines, "    DC_30bit").has_value();
  said.offers_ycbcr =
      has_line(lines, "Supported color formats: ", "YCrCb") ||
      rest_after(lines, "  Supports YCbCr 4:2") || rest_after(lines, "  Supports YCbCr 4:4") ||
      rest_after(lines, "  YCbCr 4:2:0 ") || has_line(lines, "Supported bpc for YCbCr 4", "") ||
      has_line(lines, "(aspect ", "YCbCr 4:2:0");
  said.only_as_420 = vics_of_420_blocks(lines);
  said.base_native = size_below(lines, " if only Block 0 is parsed");
  said.displayid_native = native_of_displayid(lines);
  said.displayid_preferred = size_below(lines, " if Block 0 and DisplayID Blocks are parsed");
  return said;
}

class EdidConformance : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto version = test::run_process({kEdidDecode, "--version"});
    ASSERT_EQ(version.exit_code, 0) << "scripts/packages test installs edid-decode";
  }

  void compare(const std::vector<uint8_t>& bytes, const std::string& name) {
    write_bytes(file_, bytes);
    const Evaluation said = evaluate(file_);
    const display::EdidReading read = display::read_edid(bytes);
    ASSERT_TRUE(read.identity) << name << ": " << display::edid_problem_name(read.problem);
    EXPECT_EQ(read.identity->manufacturer, said.manufacturer) << name;
    EXPECT_EQ(read.identity->product, said.product) << name;
    EXPECT_EQ(read.identity->serial_number, said.serial_number) << name;
    EXPECT_EQ(read.bits_per_colour, said.bits_per_colour) << name;
    EXPECT_EQ(read.deep_colour, said.deep_colour) << name;
    EXPECT_EQ(read.offers_ycbcr, said.offers_ycbcr) << name;
    EXPECT_EQ(read.only_as_420, said.only_as_420) << name;
    expect_same(read.base_native, said.base_native, name + ", first timing");
    expect_same(read.displayid_native, said.displayid_native, name + ", DisplayID's native");
    expect_same(read.displayid_preferred, said.displayid_preferred, name + ", DisplayID preferred");
    ++compared_;
  }

  static void expect_same(std::optional<PixelSize> read, std::optional<PixelSize> said,
                          const std::string& name) {
    const auto text = [](std::optional<PixelSize> size) {
      return size ? std::to_string(size->width) + "x" + std::to_string(size->height) : "none";
    };
    EXPECT_EQ(text(read), text(said)) << name;
  }

  void compare_folder(const fs::path& folder) {
    std::error_code error;
    for (const auto& entry : fs::recursive_directory_iterator(folder, error)) {
      if (!entry.is_regular_file()) continue;
      const std::vector<uint8_t> bytes = read_bytes(entry.path());
      // The folders hold other files and damaged EDIDs, which our reader rejects.
      if (display::read_edid(bytes).problem != display::EdidProblem::None) continue;
      compare(bytes, entry.path().string());
    }
  }

  test::ScratchFolder folder_;
  fs::path file_ = folder_ / "edid";
  int compared_ = 0;
};

}  // namespace

TEST_F(EdidConformance, AgreesWithEdidDecodeOnRandomEdids) {
  const uint64_t count = random_edid_count();
  for (uint64_t number = 0; number < count && !HasFailure(); ++number)
    compare(random_edid(number), "random EDID " + std::to_string(number));
  EXPECT_EQ(compared_, static_cast<int>(count));
}

TEST_F(EdidConformance, AgreesWithEdidDecodeOnInstalledEdids) {
  compare_folder(LENTICULE_SOURCE_DIR "/tests/fuzz/corpus/edid");
  compare_folder("/usr/libexec/installed-tests/colord");
  compare_folder("/usr/lib/firmware/edid");
  if (const char* folder = std::getenv("LENTICULE_EDIDS")) compare_folder(folder);
  RecordProperty("edids", compared_);
  EXPECT_GT(compared_, 0);
}

TEST_F(EdidConformance, AgreesWithEdidDecodeOnTelevisionModes) {
  for (const display::TelevisionMode& mode : display::kTelevisionModes) {
    const auto result = test::run_process({kEdidDecode, "--vic", std::to_string(mode.vic)});
    const std::vector<std::string> lines = lines_of(result.out);
    const auto match = find_line(lines, "(\\d+)x(\\d+) +([\\d.]+) Hz.* ([\\d.]+) MHz");
    ASSERT_TRUE(match) << int{mode.vic} << ": " << result.out;
    EXPECT_EQ(std::stoi((*match)[1].str()), mode.width) << int{mode.vic};
    EXPECT_EQ(std::stoi((*match)[2].str()), mode.height) << int{mode.vic};
    EXPECT_NEAR(std::stod((*match)[3].str()), mode.hertz, 1e-3) << int{mode.vic};
    EXPECT_NEAR(std::stod((*match)[4].str()) * 10, mode.clock_mhz_x10, 1e-3) << int{mode.vic};
  }
}

}  // namespace lenticule::test
