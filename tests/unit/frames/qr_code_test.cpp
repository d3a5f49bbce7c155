// SPDX-License-Identifier: Apache-2.0
#include "frames/qr/qr_code.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <utility>

#include "optics/eye_simulator.h"
#include "optics/rig_file.h"
#include "tests/support/error_matchers.h"

namespace lenticule::frames {
namespace {

constexpr const char* kAddress =
    "http://192.168.178.20:8420/enter?token=0123456789abcdef0123456789abcdef";

TEST(QrCode, HasTheThreeFinderPatterns) {
  const QrCode code = qr_code_of(kAddress);
  ASSERT_GE(code.side, 21);
  EXPECT_EQ((code.side - 17) % 4, 0) << "a side that the standard has";
  for (const auto& [x, y] : {std::pair(0, 0), {code.side - 7, 0}, {0, code.side - 7}})
    for (int j = 0; j < 7; ++j)
      for (int i = 0; i < 7; ++i) {
        const int ring = std::max(std::abs(i - 3), std::abs(j - 3));
        EXPECT_EQ(code.is_dark(x + i, y + j), ring != 2) << x << " " << y << " " << i << " " << j;
      }
  EXPECT_FALSE(code.is_dark(-1, 0));
  EXPECT_FALSE(code.is_dark(0, code.side));
}

TEST(QrCode, RefusesTextsOfTheWrongLength) {
  EXPECT_EQ(test::error_of([] { (void)qr_code_of(""); }).kind(), ErrorKind::Usage);
  EXPECT_EQ(test::error_of([] { (void)qr_code_of(std::string(501, 'x')); }).kind(),
            ErrorKind::Usage);
  EXPECT_GT(qr_code_of(std::string(500, 'x')).side, 21);
}

TEST(QrCode, RefusesAPanelWithFewerPixelsThanModules) {
  const QrCode code = qr_code_of(kAddress);
  EXPECT_EQ(test::error_of([&] { (void)draw_qr_code(code, {.width = 400, .height = 40}); }).kind(),
            ErrorKind::Input);
}

// Reads the middle of each module in what an eye sees: the code is in the plane of the panel, so
// that every eye reads the same one.
TEST(QrCode, IsReadableThroughTheLensesFromEveryPlace) {
  for (const char* name : {"scenes/rigs/kiosk-27-1080.toml", "scenes/rigs/kiosk-27-4k.toml"}) {
    const optics::Rig rig = optics::load_rig(std::string(LENTICULE_SOURCE_DIR) + "/" + name);
    const QrCode code = qr_code_of(kAddress);
    const FrameGeometry panel{.width = rig.panel.width_px, .height = rig.panel.height_px};
    const WovenFrame frame = draw_qr_code(code, panel);
    const QrPlace place = place_qr_code(code, panel);
    for (const double x : {-250.0, -31.0, 0.0, 31.0, 200.0}) {
      const optics::RgbPicture seen =
          optics::simulate_eye(optics::OpticalModel(rig),
                               {.pixels = frame.bytes().data(),
                                .width = panel.width,
                                .height = panel.height,
                                .stride_bytes = panel.row_bytes()},
                               {.x = x, .y = 40.0, .z_mm = 600.0},
                               {.width = panel.width / 2, .height = panel.height / 2});
      int wrong = 0;
      for (int v = 0; v < code.side; ++v)
        for (int u = 0; u < code.side; ++u) {
          // The mean of a quarter of the module, as a camera sees it.
          const int reach = std::max(1, place.module_px / 8);
          const int cx = (place.left + (u + kQrBorder) * place.module_px + place.module_px / 2) / 2;
          const int cy = (place.top + (v + kQrBorder) * place.module_px + place.module_px / 2) / 2;
          int sum = 0, count = 0;
          for (int j = cy - reach; j <= cy + reach; ++j)
            for (int i = cx - reach; i <= cx + reach; ++i)
              for (size_t c = 0; c < 3; ++c, ++count)
                sum += seen.pixels[(static_cast<size_t>(j) * static_cast<size_t>(seen.width) +
                                    static_cast<size_t>(i)) *
                                       3 +
                                   c];
          wrong += (sum < 128 * count) != code.is_dark(u, v) ? 1 : 0;
        }
      EXPECT_EQ(wrong, 0) << name << " from " << x << " mm";
    }
  }
}

TEST(QrCode, InATerminalTwoRowsOfModulesAreOneLine) {
  const QrCode code = qr_code_of("x");
  const std::string text = qr_terminal_text(code);
  const auto lines = std::count(text.begin(), text.end(), '\n');
  EXPECT_EQ(lines, (code.side + 2 * kQrBorder + 1) / 2);
}

}  // namespace
}  // namespace lenticule::frames
