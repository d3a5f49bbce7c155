// SPDX-License-Identifier: Apache-2.0
// Draws overlays into boxes, which replace rectangles of frames.
//
// An overlay lies in the plane of the panel: a pixel of it has one colour and one alpha for every
// view, so that each eye sees it at the same place; nothing is woven. Where alpha is 255 the bytes
// of the picture replace those of the frame, where it is 0 the frame stays as it is to the bit, and
// between, light is mixed and not codes, subpixel by subpixel, as in transitions.
//
// Frames of a source are shared and constant. So the frame copier copies a frame to scan-out memory
// as always, and then replaces rectangles of it: draw() copies the pixels under an overlay into a
// box, with the overlays below, blends, and the display writes the box to its place on a turned or
// mirrored panel. Memory is allocated, and pictures are read and scaled, when the set is made, on a
// thread that may wait; a clock writes its few letters again when they change.
//
// Which overlays a frame has is decided when it is taken from its source (OverlayMoment): a frame
// that is copied again, for a snapshot or a panel that came back, looks as it did.
#include "player/playback/overlay.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "base/text.h"
#include "frames/image_io.h"
#include "frames/qr/qr_code.h"
#include "frames/srgb.h"
#include "frames/text.h"

namespace lenticule::player {
namespace {

constexpr std::array<std::string_view, 4> kKinds = {"picture", "text", "clock", "code"};
constexpr std::array<std::string_view, 9> kPlaces = {"top left",    "top",    "top right",
                                                     "left",        "middle", "right",
                                                     "bottom left", "bottom", "bottom right"};
constexpr size_t kMaxTextBytes = 500;
constexpr size_t kMaxFileBytes = 4096;
constexpr size_t kMaxClock = 40;
constexpr double kMaxSeconds = 1e6, kRounding = 1e-6;
constexpr double kLineHeight = 0.05, kCodeHeight = 0.25;
/// Distance from the edges of the panel, as a part of its height.
constexpr double kMargin = 0.02;
constexpr int kPadding = 3;           ///< dots around a text
constexpr uint8_t kBackground = 216;  ///< alpha of the black behind a text: legible over white

[[noreturn]] void refuse(std::string_view key, const std::string& cause,
                         const std::string& remedy = {}) {
  throw usage_error("{}: {}", key, cause).remedy(remedy);
}

double number(const std::string& key, const nlohmann::json& value, double most) {
  const double given = value.is_number() ? value.get<double>() : -1.0;
  const bool begins = key == "from_s";
  if (given >= 0.0 && given <= most && (given > 0.0 || begins)) return given;
  refuse(key, fmt::format("not a number {} 0 and at most {}", begins ? "from" : "above", most));
}

/// Returns the blended code for each alpha, code of an overlay and code of a frame, in this order.
const std::vector<uint8_t>& blended_codes() {
  static const std::vector<uint8_t> table = [] {
    std::vector<uint8_t> codes(size_t{1} << 24);
    const std::array<double, 256>& light = frames::linear_of_codes();
    for (size_t n = 0; n < codes.size(); ++n) {
      const double part = static_cast<double>(n >> 16) / 255.0;
      codes[n] =
          frames::code_from_linear(part * light[n >> 8 & 255] + (1.0 - part) * light[n & 255]);
    }
    return codes;
  }();
  return table;
}

/// Throws Error(Usage) that names the first letter that the font does not have.
void check_letters(std::string_view key, std::string_view text) {
  for (size_t n = 0; n < text.size(); ++n) {
    const auto byte = static_cast<uint8_t>(text[n]);
    if ((byte >= ' ' && byte <= '~') || (byte == '\n' && key == "text")) continue;
    const size_t length = byte < 0xc0 ? 1 : byte < 0xe0 ? 2 : byte < 0xf0 ? 3 : 4;
    refuse(key, fmt::format("the font has no letter '{}'", escaped(text.substr(n, length))),
           "use printable ASCII, or a picture of the text");
  }
}

/// Writes the time into `text`, and returns the part that was written.
std::string_view clock_text(const std::string& format, std::time_t now,
                            std::array<char, kMaxClock + 1>& text) noexcept {
  std::tm local{};
  ::localtime_r(&now, &local);
  return {text.data(), std::strftime(text.data(), text.size(), format.c_str(), &local)};
}

void check_clock(const std::string& format) {
  constexpr std::string_view kConversions = "aAbBcCdDeFgGhHIjklmMpPrRSTuUVwWxXyYzZ%";
  for (size_t at = 0; (at = format.find('%', at)) != std::string::npos; at += 2) {
    if (at + 1 < format.size() && format[at + 1] == '-') ++at;
    if (at + 1 == format.size() || kConversions.find(format[at + 1]) == std::string_view::npos)
      refuse("clock", fmt::format("'{}': not a format of strftime", format.substr(0, 64)),
             "for example \"%H:%M\" or \"%A %-d %B\"");
  }
  constexpr std::time_t kLongNames = 1790164800;  // a Wednesday in September
  std::array<char, kMaxClock + 1> text{};
  if (clock_text(format, kLongNames, text).empty())
    refuse("clock", fmt::format("the time has more than {} letters", kMaxClock));
}

int pixels(const std::optional<double>& height, double usual, const frames::FrameGeometry& panel) {
  return std::max(1, static_cast<int>(std::lround(height.value_or(usual) * panel.height)));
}

/// Returns the codes of a picture whose pixels are the means of the light that falls on them.
std::vector<uint8_t> scaled(const frames::TextureImage& from, int width, int height) {
  std::vector<uint8_t> codes;
  const double dx = double{1} * from.width / width, dy = double{1} * from.height / height;
  const auto overlap = [](int pixel, double begin, double end) {
    return std::max(0.0, std::min(pixel + 1.0, end) - std::max<double>(pixel, begin));
  };
  const std::array<double, 256>& light = frames::linear_of_codes();
  const auto value = [&](size_t at) -> double {
    if (from.codes.empty()) return from.rgba[at];
    return at % 4 == 3 ? from.codes[at] / 255.0 : light[from.codes[at]];
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      std::array<double, 4> sums{};
      for (int j = static_cast<int>(y * dy); j < from.height && j < (y + 1) * dy; ++j) {
        for (int i = static_cast<int>(x * dx); i < from.width && i < (x + 1) * dx; ++i) {
          const size_t pixel = 4 * (static_cast<size_t>(j) * static_cast<size_t>(from.width) +
                                    static_cast<size_t>(i));
          const double opaque = overlap(i, x * dx, (x + 1) * dx) *
                                overlap(j, y * dy, (y + 1) * dy) * value(pixel + 3);
          for (size_t c = 0; c < 3; ++c) sums[c] += opaque * value(pixel + c);
          sums[3] += opaque;
        }
      }
      for (size_t c = 0; c < 3; ++c)
        codes.push_back(frames::code_from_linear(sums[3] > 0.0 ? sums[c] / sums[3] : 0.0));
      codes.push_back(frames::code_from_encoded(static_cast<float>(sums[3] / (dx * dy))));
    }
  }
  return codes;
}

/// Returns the size on a panel of a picture that has `own` in its file. Throws Error(Input) if the
/// panel has no room for it.
frames::FrameGeometry placed_size(const OverlaySpec& spec, const frames::FrameGeometry& own,
                                  const frames::FrameGeometry& panel) {
  const int height = spec.height ? pixels(spec.height, 1.0, panel) : own.height;
  const double width_px = double{1} * own.width * height / own.height;
  const int width = std::max(1, static_cast<int>(std::lround(width_px)));
  if (width > panel.width || height > panel.height)
    throw input_error("{}: {}x{} pixels, but the panel has {}x{}", spec.content, width, height,
                      panel.width, panel.height)
        .remedy("state a smaller height, for example height = 0.1");
  return {width, height};
}

/// FilePicture is a picture that a file holds, perhaps reduced, and its size there.
struct FilePicture {
  frames::FrameGeometry own;
  frames::TextureImage texture;
};

void place_picture(const FilePicture& file, Overlay& overlay) {
  const auto [width, height, format] = placed_size(overlay.spec, file.own, overlay.panel);
  const frames::TextureImage& picture = file.texture;
  const bool is_as_stored =
      picture.width == width && picture.height == height && !picture.codes.empty();
  const std::vector<uint8_t> codes = is_as_stored ? picture.codes : scaled(picture, width, height);
  overlay.size = {width, height};
  overlay.colours = frames::WovenFrame(overlay.size);
  overlay.alpha.resize(codes.size() / 4);
  for (size_t n = 0; n < overlay.alpha.size(); ++n) {
    std::copy_n(&codes[4 * n], 3, &overlay.colours.bytes()[3 * n]);
    overlay.alpha[n] = codes[4 * n + 3];
  }
}

/// Writes lines of text. Allocates only if they are larger than any before.
void write(Overlay& overlay, std::span<const std::string_view> lines) {
  size_t columns = 0;
  for (const std::string_view line : lines) columns = std::max(columns, line.size());
  const auto dots = [&overlay](size_t cells, int cell) {
    return (static_cast<int>(cells) * cell - 1 + 2 * kPadding) * overlay.dot_px;
  };
  overlay.size = {dots(columns, frames::kCellWidth), dots(lines.size(), frames::kCellHeight)};
  frames::WovenFrame& colours = overlay.colours;
  if (colours.width() < overlay.size.width) colours = frames::WovenFrame(overlay.size);
  overlay.alpha.resize(colours.bytes().size() / 3);
  std::ranges::fill(colours.bytes(), uint8_t{0});
  int y = kPadding * overlay.dot_px;
  for (const std::string_view line : lines) {
    frames::draw_text(colours, kPadding * overlay.dot_px, y, overlay.dot_px, line, {255, 255, 255});
    y += frames::kCellHeight * overlay.dot_px;
  }
  for (size_t n = 0; n < overlay.alpha.size(); ++n)
    overlay.alpha[n] = std::max(colours.bytes()[3 * n], kBackground);
}

void write_clock(Overlay& overlay, std::time_t now) {
  std::array<char, kMaxClock + 1> text{};
  const std::string_view line =
      clock_text(overlay.spec.content, now, text).substr(0, overlay.columns);
  if (overlay.written == line) return;
  overlay.written = line;
  write(overlay, {&line, 1});
}

void begin_text(Overlay& overlay) {
  const frames::FrameGeometry& panel = overlay.panel;
  overlay.dot_px =
      std::max(1, pixels(overlay.spec.height, kLineHeight, panel) / frames::kCellHeight);
  const auto room = [&overlay](int px, int cell) {
    return (px / overlay.dot_px + 1 - 2 * kPadding) / cell;
  };
  const int columns = room(panel.width, frames::kCellWidth);
  overlay.columns = static_cast<size_t>(std::max(1, columns));
  std::vector<std::string> lines;
  for (std::string_view rest = overlay.spec.content; !rest.empty();)
    for (std::string& line : frames::wrap_text(take_until(rest, '\n'), overlay.columns))
      lines.push_back(std::move(line));
  // Memory for any time that a clock may show.
  if (overlay.spec.kind == OverlaySpec::Kind::Clock)
    lines = {std::string(std::min(kMaxClock, overlay.columns), ' ')};
  if (columns < 1 || std::ssize(lines) > room(panel.height, frames::kCellHeight))
    throw input_error("{}: does not fit the panel", to_string(overlay.spec))
        .remedy("state a smaller height, or shorten the text");
  overlay.written.reserve(kMaxClock);
  write(overlay, std::vector<std::string_view>(lines.begin(), lines.end()));
}

/// `picture` is that of the file, for all panels.
Overlay made(const OverlaySpec& spec, uint32_t bit, const frames::FrameGeometry& panel, size_t part,
             const FilePicture& picture) {
  Overlay overlay{.spec = spec, .bit = bit, .panel = panel, .part = part};
  if (spec.kind == OverlaySpec::Kind::Picture) {
    place_picture(picture, overlay);
  } else if (spec.kind == OverlaySpec::Kind::Code) {
    const frames::QrCode code = frames::qr_code_of(spec.content);
    const int room = std::min({pixels(spec.height, kCodeHeight, panel), panel.width, panel.height});
    const int side =
        frames::place_qr_code(code, {room, room}).module_px * (code.side + 2 * frames::kQrBorder);
    overlay.colours = frames::draw_qr_code(code, {side, side});
    overlay.alpha.assign(overlay.colours.bytes().size() / 3, 255);
    overlay.size = overlay.colours.geometry();
  } else {
    begin_text(overlay);
  }
  const bool opaque = std::ranges::all_of(overlay.alpha, [](uint8_t one) { return one == 255; });
  if (!opaque) {
    (void)blended_codes();  // takes a tenth of a second the first time
    overlay.blended.resize(overlay.colours.bytes().size());
  }
  return overlay;
}

}  // namespace

OverlaySpec parse_overlay(const nlohmann::json& keys) {
  OverlaySpec spec;
  std::string_view kind;
  for (const auto& [key, value] : keys.items()) {
    const auto named = std::ranges::find(kKinds, key);
    if (named != kKinds.end()) {
      if (!kind.empty()) refuse(key, fmt::format("not together with {}", kind));
      kind = *named;
      spec.kind = static_cast<OverlaySpec::Kind>(named - kKinds.begin());
      if (value.is_string()) spec.content = value.get<std::string>();
      const size_t most = spec.kind == OverlaySpec::Kind::Picture ? kMaxFileBytes : kMaxTextBytes;
      if (spec.content.empty() || spec.content.size() > most ||
          spec.content.find('\0') != std::string::npos)
        refuse(key, fmt::format("not a text of 1 to {} bytes", most));
    } else if (key == "at") {
      const auto place =
          std::ranges::find(kPlaces, value.is_string() ? value.get<std::string>() : "");
      if (place == kPlaces.end())
        refuse(key, fmt::format("no such place: {}", value.dump().substr(0, 64)),
               fmt::format("one of {}", fmt::join(kPlaces, ", ")));
      spec.place = static_cast<size_t>(place - kPlaces.begin());
    } else if (key == "height") {
      spec.height = number(key, value, 1.0);
    } else if (key == "from_s" || key == "for_s") {
      (key == "from_s" ? spec.from_s : spec.for_s.emplace()) = number(key, value, kMaxSeconds);
    } else {
      refuse(key.substr(0, 64), "unknown key",
             "an overlay has picture, text, clock or code; and at, height, from_s, for_s");
    }
  }
  if (kind.empty())
    refuse("content", "nothing to show", "state a picture, a text, a clock or a code");
  if (kind == "text" || kind == "clock") check_letters(kind, spec.content);
  if (kind == "clock") check_clock(spec.content);
  return spec;
}

nlohmann::ordered_json overlays_json(std::span<const OverlaySpec> overlays) {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (const OverlaySpec& overlay : overlays) {
    nlohmann::ordered_json keys;
    keys[kKinds.at(static_cast<size_t>(overlay.kind))] = overlay.content;
    keys["at"] = kPlaces.at(overlay.place);
    if (overlay.height) keys["height"] = *overlay.height;
    if (overlay.from_s > 0.0) keys["from_s"] = overlay.from_s;
    if (overlay.for_s) keys["for_s"] = *overlay.for_s;
    all.push_back(std::move(keys));
  }
  return all;
}

std::string to_string(const OverlaySpec& overlay) {
  const bool secret = overlay.kind == OverlaySpec::Kind::Code;
  return fmt::format("{}{}, {}", kKinds.at(static_cast<size_t>(overlay.kind)),
                     secret ? "" : " " + overlay.content, kPlaces.at(overlay.place));
}

void OverlayBox::copy_into(std::span<uint8_t> picture, const frames::FrameGeometry& size, int x,
                           int y) const noexcept {
  const int first = std::max(left, x), top_row = std::max(top, y);
  const int end = std::min(left + pixels.geometry.width, x + size.width);
  const int bottom = std::min(top + pixels.geometry.height, y + size.height);
  for (int row = top_row; row < bottom && first < end; ++row)
    std::copy_n(pixels.row(row - top) + ptrdiff_t{3} * (first - left), 3 * (end - first),
                picture.data() + static_cast<size_t>(row - y) * size.row_bytes() +
                    ptrdiff_t{3} * (first - x));
}

OverlaySet::OverlaySet(std::span<const OverlaySpec> overlays,
                       std::span<const frames::FrameGeometry> panels,
                       const std::function<void(const Error&)>& left_out) {
  for (size_t n = 0; n < overlays.size(); ++n) {
    try {
      std::vector<Overlay> drawn;
      FilePicture picture;
      if (overlays[n].kind == OverlaySpec::Kind::Picture) {
        picture.own = frames::probe_picture(overlays[n].content).geometry;
        for (const frames::FrameGeometry& panel : panels)  // before a large one takes memory
          (void)placed_size(overlays[n], picture.own, panel);
        picture.texture = frames::read_texture(overlays[n].content);
      }
      for (size_t part = 0; part < panels.size(); ++part)
        drawn.push_back(made(overlays[n], 1U << n, panels[part], part, picture));
      std::ranges::move(drawn, std::back_inserter(overlays_));
    } catch (const Error& error) {
      if (!left_out) throw;
      left_out(error);
    }
  }
}

uint32_t OverlaySet::due_at(double seconds) const noexcept {
  uint32_t mask = 0;
  for (const Overlay& overlay : overlays_) {
    const double since = seconds - overlay.spec.from_s + kRounding;
    if (since >= 0.0 && since < overlay.spec.for_s.value_or(INFINITY)) mask |= overlay.bit;
  }
  return mask;
}

void OverlaySet::add_words(uint32_t mask, std::vector<std::string>& words) const {
  for (const Overlay& overlay : overlays_)
    if ((mask & overlay.bit) != 0 && overlay.part == 0) words.push_back(to_string(overlay.spec));
}

void OverlaySet::draw(const frames::FrameView& frame, uint32_t mask, std::time_t now,
                      std::vector<OverlayBox>& boxes) noexcept {
  for (Overlay& overlay : overlays_) {
    if ((mask & overlay.bit) == 0 || overlay.part >= std::max<size_t>(1, frame.parts.size()))
      continue;
    if (overlay.spec.kind == OverlaySpec::Kind::Clock) write_clock(overlay, now);
    const frames::FrameGeometry &size = overlay.size, &panel = overlay.panel;
    // Places an overlay that leaves no room for the margins in the middle of what is left.
    const auto place = [&panel](int room, size_t third) {
      const int margin = std::min(static_cast<int>(kMargin * panel.height), room / 2);
      return margin + (room - 2 * margin) * static_cast<int>(third) / 2;
    };
    OverlayBox box{.left = place(panel.width - size.width, overlay.spec.place % 3),
                   .top = place(panel.height - size.height, overlay.spec.place / 3),
                   .part = overlay.part};
    if (overlay.blended.empty()) {
      box.pixels = overlay.colours.view();
      boxes.push_back(box);
      continue;
    }
    const uint8_t* const codes = blended_codes().data();
    const std::span<uint8_t> out = std::span(overlay.blended).first(size.frame_bytes());
    OverlayBox{.pixels = frame.parts.empty() ? frame : frame.parts[overlay.part]}.copy_into(
        out, size, box.left, box.top);
    for (const OverlayBox& below : boxes)
      if (below.part == overlay.part) below.copy_into(out, size, box.left, box.top);
    for (int y = 0; y < size.height; ++y) {
      const uint8_t* colours = overlay.colours.row(y);
      const uint8_t* alpha = overlay.alpha.data() +
                             static_cast<size_t>(y) * static_cast<size_t>(overlay.colours.width());
      uint8_t* to = out.data() + static_cast<size_t>(y) * size.row_bytes();
      for (int x = 0; x < size.width; ++x, ++alpha, colours += 3, to += 3) {
        if (*alpha == 0) continue;
        for (size_t c = 0; c < 3; ++c)
          to[c] = *alpha == 255 ? colours[c] : codes[*alpha << 16 | colours[c] << 8 | to[c]];
      }
    }
    box.pixels = {.geometry = size, .bytes = out};
    boxes.push_back(box);
  }
}

}  // namespace lenticule::player
