// SPDX-License-Identifier: Apache-2.0
#include "frames/qr/qr_code.h"

#include <fmt/format.h>
#include <qrencode.h>

#include <algorithm>
#include <array>
#include <memory>

#include "base/error_kinds.h"

namespace lenticule::frames {
namespace {

constexpr size_t kMaxTextBytes = 500;
constexpr uint8_t kLight = 255;

}  // namespace

QrCode qr_code_of(const std::string& text) {
  if (text.empty() || text.size() > kMaxTextBytes)
    throw Error(
        ErrorKind::Usage,
        fmt::format("code: the text has {} bytes; expected 1 to {}", text.size(), kMaxTextBytes),
        "for example code:https://example.org");
  const std::unique_ptr<QRcode, decltype(&QRcode_free)> made(
      QRcode_encodeData(static_cast<int>(text.size()),
                        reinterpret_cast<const unsigned char*>(text.data()), 0, QR_ECLEVEL_M),
      &QRcode_free);
  if (made == nullptr) throw Error(ErrorKind::Usage, "code: the text cannot be encoded");
  QrCode code{.side = made->width};
  const size_t modules = static_cast<size_t>(code.side) * static_cast<size_t>(code.side);
  for (size_t k = 0; k < modules; ++k) code.dark.push_back(made->data[k] & 1u);
  return code;
}

QrPlace place_qr_code(const QrCode& code, const FrameGeometry& panel) {
  const int modules = code.side + 2 * kQrBorder;
  const int room = std::min(panel.width, panel.height);
  const int module_px = room / modules;
  if (module_px < 1)
    throw input_error("code: {} modules do not fit into {} pixels", modules, room)
        .remedy("use a shorter text");
  return {.left = (panel.width - modules * module_px) / 2,
          .top = (panel.height - modules * module_px) / 2,
          .module_px = module_px};
}

WovenFrame draw_qr_code(const QrCode& code, const FrameGeometry& panel) {
  const QrPlace place = place_qr_code(code, panel);
  const int side_px = (code.side + 2 * kQrBorder) * place.module_px;
  WovenFrame frame(panel);
  for (int j = 0; j < side_px; ++j) {
    uint8_t* out = frame.row(place.top + j) + size_t{3} * static_cast<size_t>(place.left);
    for (int i = 0; i < side_px; ++i, out += 3)
      if (!code.is_dark(i / place.module_px - kQrBorder, j / place.module_px - kQrBorder))
        std::fill_n(out, 3, kLight);
  }
  return frame;
}

std::string qr_terminal_text(const QrCode& code) {
  // Space, upper half, lower half and full block; a lit half is a light module.
  constexpr std::array<const char*, 4> kBlocks = {" ", "\u2580", "\u2584", "\u2588"};
  constexpr const char* kWhiteOnBlack = "\033[97;40m";
  constexpr const char* kReset = "\033[0m\n";
  std::string text;
  for (int y = -kQrBorder; y < code.side + kQrBorder; y += 2) {
    text += kWhiteOnBlack;
    for (int x = -kQrBorder; x < code.side + kQrBorder; ++x)
      text += kBlocks.at((code.is_dark(x, y) ? 0u : 1u) + (code.is_dark(x, y + 1) ? 0u : 2u));
    text += kReset;
  }
  return text;
}

}  // namespace lenticule::frames
