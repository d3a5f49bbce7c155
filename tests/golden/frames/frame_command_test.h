// SPDX-License-Identifier: Apache-2.0
// A fixture for the tests of weave, eye and compare: a small rig, pictures, and a check for clear
// errors.
#pragma once

#include <algorithm>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "frames/image_io.h"
#include "tests/commands/program.h"

namespace lenticule::test {

class FrameCommandTest : public CommandTest {
 protected:
  static constexpr int kWidth = 48, kHeight = 32;

  void SetUp() override {
    CommandTest::SetUp();
    write("rig.toml", R"(format = 1
name = "small"
[panel]
width_px = 48
height_px = 32
pixel_width_mm = 0.2
pixel_height_mm = 0.2
layout = "rgb"
[sheet]
pitch_subpx = 7.5
slant = 0.2
offset_lenses = 0.1
gap_mm = 1.0
refraction_shape = 0.45
[viewing]
distance_mm = 600.0
height_mm = 0.0
)");
    before_ = listing();
  }

  [[nodiscard]] std::string picture(const std::string& name, int width, int height,
                                    uint8_t code) const {
    frames::WovenFrame frame({.width = width, .height = height});
    std::fill(frame.bytes().begin(), frame.bytes().end(), code);
    frames::write_woven(frame.view(), path(name));
    return path(name);
  }

  /// Writes a quilt of 3 x 2 tiles of 8 x 6 pixels, tile t filled with 40 (t + 1).
  [[nodiscard]] std::string quilt(const std::string& name) const {
    frames::WovenFrame frame({.width = 24, .height = 12});
    for (int y = 0; y < 12; ++y)
      for (int x = 0; x < 72; ++x)
        frame.row(y)[x] = static_cast<uint8_t>(40 * ((y < 6 ? 3 : 0) + x / 24 + 1));
    frames::write_woven(frame.view(), path(name));
    return path(name);
  }

  /// Writes the first half of a file.
  [[nodiscard]] std::string truncated(const std::string& whole, const std::string& name) const {
    std::filesystem::copy_file(whole, path(name));
    std::filesystem::resize_file(path(name), std::filesystem::file_size(whole) / 2);
    return path(name);
  }

  /// Expects the exit code and a message of one or two lines that names `object`.
  static void expect_failure(const ProcessResult& result, int exit_code,
                             const std::string& object) {
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_FALSE(result.timed_out);
    const size_t start = result.err.find("lenticule: ");
    ASSERT_NE(start, std::string::npos) << result.err;
    const std::string message = result.err.substr(start);
    EXPECT_LE(std::count(message.begin(), message.end(), '\n'), 2) << message;
    EXPECT_NE(message.find(object), std::string::npos) << message;
  }

  static nlohmann::json json_of(const ProcessResult& result) {
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(result.out, nullptr, false);
  }

  std::vector<std::string> before_;
};

}  // namespace lenticule::test
