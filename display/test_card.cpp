// SPDX-License-Identifier: Apache-2.0
#include "display/test_card.h"

#include <algorithm>

namespace lenticule::display {
namespace {

using frames::Colour;
using frames::fill_box;
using frames::kCellHeight;
using frames::kCellWidth;
using frames::kGlyphHeight;
using frames::set_pixel;
using frames::WovenFrame;

constexpr Colour kBlack = {0, 0, 0};
constexpr Colour kWhite = {255, 255, 255};
constexpr Colour kRed = {255, 0, 0};
constexpr Colour kGreen = {0, 255, 0};
constexpr Colour kBlue = {0, 0, 255};
/// The result of a link that averages red and blue over two pixels.
constexpr Colour kMeanOfRedAndBlue = {128, 0, 128};

/// Minimum number of character cells, if the pixels allow more than one per dot.
constexpr int kColumns = 44;
constexpr int kLines = 22;
constexpr int kFrameLines = 3;  ///< the border: white, black, white
constexpr int kSmallestPatches = 24;
constexpr const char* kLegend =
    "a white line along every edge; lines of one pixel are crisp; the halves of CHROMA differ in "
    "brightness; eight steps each in DARK and LIGHT";
constexpr std::array<const char*, 4> kCaptions = {"1 PIXEL", "CHROMA", "DARK", "LIGHT"};

/// Sheet is the area for text and patches inside the border and the corner marks.
class Sheet {
 public:
  Sheet(const frames::FrameGeometry& geometry, int scale) : geometry_(geometry), scale_(scale) {}

  [[nodiscard]] int corner() const { return 4 * scale_; }
  [[nodiscard]] int left() const { return kFrameLines + corner() + 2 * scale_; }
  [[nodiscard]] int top() const { return left(); }
  [[nodiscard]] int width() const { return geometry_.width - 2 * left(); }
  [[nodiscard]] size_t columns(int text_scale) const {
    return static_cast<size_t>(std::max(1, width() / (kCellWidth * text_scale)));
  }
  [[nodiscard]] int bottom() const { return geometry_.height - top(); }
  [[nodiscard]] int line() const { return kCellHeight * scale_; }
  [[nodiscard]] int scale() const { return scale_; }

  /// Returns the patches with a line of captions above; none if they would be too small.
  [[nodiscard]] std::optional<CardLayout::Patches> patches() const {
    const int gap = 4 * scale_;
    const int each = (width() - 3 * gap) / 4;
    const int high = geometry_.height / 5;
    if (each < kSmallestPatches || high < kSmallestPatches) return std::nullopt;
    const auto box = [&](int i) {
      return CardBox{left() + i * (each + gap), bottom() - high, each, high};
    };
    return CardLayout::Patches{box(0), box(1), box(2), box(3)};
  }

 private:
  frames::FrameGeometry geometry_;
  int scale_;
};

/// Typesetter places lines one below the other.
class Typesetter {
 public:
  Typesetter(const Sheet& sheet, CardLayout& layout, int bottom)
      : sheet_(sheet), layout_(layout), y_(sheet.top()), bottom_(bottom) {}

  void headline(const std::string& text) {
    const int scale =
        text.size() <= sheet_.columns(2 * sheet_.scale()) ? 2 * sheet_.scale() : sheet_.scale();
    for (const std::string& line : frames::wrap_text(text, sheet_.columns(scale))) {
      put(sheet_.left(), scale, line);
      y_ += kCellHeight * scale;
    }
    y_ += sheet_.line() / 2;
  }

  /// Places a row, with the label in a separate column if there is space for one.
  void row(const CardText::Row& row, size_t label_columns) {
    constexpr size_t kRoomForText = 20;
    const size_t columns = sheet_.columns(sheet_.scale());
    const bool beside = columns >= label_columns + kRoomForText;
    const size_t indent = beside ? label_columns : 0;
    if (!row.label.empty()) put(sheet_.left(), sheet_.scale(), row.label);
    if (!beside && !row.label.empty()) y_ += sheet_.line();
    for (const std::string& line : frames::wrap_text(row.text, columns - indent)) {
      put(sheet_.left() + static_cast<int>(indent) * kCellWidth * sheet_.scale(), sheet_.scale(),
          line);
      y_ += sheet_.line();
    }
    y_ += sheet_.line() / 4;
  }

  [[nodiscard]] bool all_fitted() const { return all_fitted_; }

 private:
  void put(int x, int scale, const std::string& text) {
    if (y_ + kGlyphHeight * scale > bottom_) {
      all_fitted_ = false;
      return;
    }
    layout_.texts.push_back({x, y_, scale, text});
  }

  const Sheet& sheet_;
  CardLayout& layout_;
  int y_;
  int bottom_;
  bool all_fitted_ = true;
};

size_t label_columns(const std::vector<CardText::Row>& rows) {
  size_t longest = 0;
  for (const CardText::Row& row : rows) longest = std::max(longest, row.label.size());
  return longest + 2;
}

/// Lays out the card; returns true if all of the text fits.
bool lay_out(const frames::FrameGeometry& geometry, const CardText& text, int scale,
             bool with_patches, CardLayout& layout) {
  const Sheet sheet(geometry, scale);
  layout = {.scale = scale, .texts = {}, .patches = {}};
  if (with_patches) layout.patches = sheet.patches();
  std::vector<CardText::Row> rows = text.rows;
  int bottom = sheet.bottom();
  if (layout.patches) {
    rows.push_back({"check", kLegend});
    bottom = layout.patches->lines.y - sheet.line() - sheet.line() / 2;
  }
  Typesetter typesetter(sheet, layout, bottom);
  typesetter.headline(text.headline);
  const size_t columns = label_columns(rows);
  for (const CardText::Row& row : rows) typesetter.row(row, columns);
  if (!layout.patches) return typesetter.all_fitted();
  const std::array<CardBox, 4> boxes = {layout.patches->lines, layout.patches->chroma,
                                        layout.patches->dark, layout.patches->light};
  bool captions_fit = true;
  for (size_t i = 0; i < boxes.size(); ++i) {
    const CardBox& box = boxes.at(i);
    const std::string caption = kCaptions.at(i);
    captions_fit &= static_cast<int>(caption.size()) * kCellWidth * scale <= box.width;
    layout.texts.push_back({box.x, box.y - sheet.line(), scale, caption});
  }
  return typesetter.all_fitted() && captions_fit;
}

void draw_border(WovenFrame& frame, const frames::FrameGeometry& geometry, int corner) {
  const int w = geometry.width;
  const int h = geometry.height;
  for (int i = 0; i < kFrameLines; ++i) {
    const Colour& colour = i % 2 == 0 ? kWhite : kBlack;
    fill_box(frame, {i, i, w - 2 * i, 1}, colour);
    fill_box(frame, {i, h - 1 - i, w - 2 * i, 1}, colour);
    fill_box(frame, {i, i, 1, h - 2 * i}, colour);
    fill_box(frame, {w - 1 - i, i, 1, h - 2 * i}, colour);
  }
  // Coloured corner marks reveal a picture that is rotated or mirrored.
  const int far_x = w - kFrameLines - corner;
  const int far_y = h - kFrameLines - corner;
  fill_box(frame, {kFrameLines, kFrameLines, corner, corner}, kRed);
  fill_box(frame, {far_x, kFrameLines, corner, corner}, kGreen);
  fill_box(frame, {kFrameLines, far_y, corner, corner}, kBlue);
  fill_box(frame, {far_x, far_y, corner, corner}, kWhite);
}

void draw_lines(WovenFrame& frame, const CardBox& box) {
  const int third = box.width / 3;
  for (int y = 0; y < box.height; ++y)
    for (int x = 0; x < 3 * third; ++x) {
      const int parity = x < third ? x : x < 2 * third ? y : x + y;
      set_pixel(frame, box.x + x, box.y + y, parity % 2 == 0 ? kWhite : kBlack);
    }
}

void draw_chroma(WovenFrame& frame, const CardBox& box) {
  const int half = box.width / 2;
  for (int y = 0; y < box.height; ++y)
    for (int x = 0; x < half; ++x)
      // Alternates with the panel's columns, because links average pairs that begin with an even
      // column.
      set_pixel(frame, box.x + x, box.y + y, (box.x + x) % 2 == 0 ? kRed : kBlue);
  fill_box(frame, {box.x + half, box.y, box.width - half, box.height}, kMeanOfRedAndBlue);
}

void draw_steps(WovenFrame& frame, const CardBox& box, int (*level)(int)) {
  const int each = box.width / kCardSteps;
  for (int i = 0; i < kCardSteps; ++i) {
    const auto grey = static_cast<uint8_t>(level(i));
    fill_box(frame, {box.x + i * each, box.y, each, box.height}, {grey, grey, grey});
  }
}

}  // namespace

CardLayout lay_out_card(const frames::FrameGeometry& geometry, const CardText& text) {
  CardLayout layout;
  const int most =
      std::min(geometry.width / (kCellWidth * kColumns), geometry.height / (kCellHeight * kLines));
  for (const bool with_patches : {true, false})
    for (int scale = std::max(most, 1); scale >= 1; --scale)
      if (lay_out(geometry, text, scale, with_patches, layout)) return layout;
  return layout;
}

frames::WovenFrame draw_test_card(const frames::FrameGeometry& geometry, const CardText& text) {
  frames::WovenFrame frame(geometry);
  const CardLayout layout = lay_out_card(geometry, text);
  draw_border(frame, geometry, Sheet(geometry, layout.scale).corner());
  if (layout.patches) {
    draw_lines(frame, layout.patches->lines);
    draw_chroma(frame, layout.patches->chroma);
    draw_steps(frame, layout.patches->dark, dark_step);
    draw_steps(frame, layout.patches->light, light_step);
  }
  for (const PlacedText& placed : layout.texts)
    draw_text(frame, placed.x, placed.y, placed.scale, placed.text, kWhite);
  return frame;
}

}  // namespace lenticule::display
