// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/tag_chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "calib/photo/tag_finder.h"
#include "frames/srgb.h"

namespace lenticule::calib {
namespace {

/// Lens pitches across a cell of a tag: as many as there is room for.
constexpr double kMostPitchesPerCell = 12.0, kLeastPitchesPerCell = 7.0;
constexpr double kLeastCellPx = 20.0;
constexpr double kArmsLengthMm = 700.0;
constexpr int kTagsAcross = 3;
constexpr int kBands = 8;

double effective_pitch(const optics::Rig& rig) {
  const double z = rig.viewing.distance.value;
  const double distance = std::isfinite(z) ? z : kArmsLengthMm;
  return rig.sheet.pitch.value * (1.0 + rig.sheet.gap.value / distance);
}

/// Returns an id for each tag: the remainder identifies the tag, the quotient is a digit of the
/// rig's fingerprint. One tag has the same id for another rig in one of 65 cases; five equal ids by
/// chance are practically impossible.
std::vector<int> tag_ids(const optics::Rig& rig) {
  constexpr int kTags = kTagsAcross * kTagsAcross;
  constexpr uint64_t kDigits = kTagIds / kTags;
  uint64_t number = std::stoull(optics::fingerprint(rig), nullptr, 16);
  std::vector<int> ids;
  for (int k = 0; k < kTags; ++k, number /= kDigits)
    ids.push_back(static_cast<int>(number % kDigits) * kTags + k);
  return ids;
}

/// Returns the largest cell with room for all tags. Fringes need at least as much space as tags.
double most_cell_px(const optics::Panel& panel) {
  constexpr double kAllTags = kTagsAcross * kTagCells;
  return std::floor(
      std::min(panel.width_px / (2.0 * kAllTags), panel.height_px / (1.5 * kAllTags)));
}

/// Returns the smallest cell that is seen through the sheet.
double least_cell_px(const optics::Rig& rig) {
  return std::ceil(std::max(kLeastCellPx, kLeastPitchesPerCell * rig.sheet.pitch.value / 3.0));
}

double tag_cell_px(const optics::Rig& rig) {
  const double wanted =
      std::ceil(std::max(kLeastCellPx, kMostPitchesPerCell * rig.sheet.pitch.value / 3.0));
  return std::min(wanted, most_cell_px(rig.panel));
}

/// Places tags near the corners, near the middles of the sides and in the centre. Fringes outside
/// the tags show the sheet up to the panel's border; a map without them is a guess there.
std::vector<ChartTag> place_tags(const optics::Rig& rig) {
  const double cell = tag_cell_px(rig), size = kTagCells * cell;
  const double width = rig.panel.width_px, height = rig.panel.height_px;
  if (!has_room_for_tags(rig))
    throw Error(ErrorKind::Input,
                fmt::format("{}: {} x {} pixels are too few for nine tags of {:.0f} pixels",
                            rig.name.empty() ? "rig" : rig.name, width, height,
                            kTagCells * least_cell_px(rig)),
                "calibrate with several photographs, which do not need tags");
  constexpr double kInsetX = 0.05, kInsetY = 0.075;
  const double left = std::max(cell, kInsetX * width), top = std::max(cell, kInsetY * height);
  std::vector<ChartTag> tags;
  const std::vector<int> ids = tag_ids(rig);
  for (int k = 0; k < kTagsAcross * kTagsAcross; ++k) {
    const double across = (k % kTagsAcross) / (kTagsAcross - 1.0);
    const double down = (k / kTagsAcross) / (kTagsAcross - 1.0);
    tags.push_back({ids[static_cast<size_t>(k)],
                    std::round(left + across * (width - size - 2.0 * left)),
                    std::round(top + down * (height - size - 2.0 * top)), cell});
  }
  return tags;
}

/// Places patches to the left and to the right of the middle tag, half way to the next tags.
std::vector<ScalePatch> place_patches(const std::vector<ChartTag>& tags) {
  std::vector<ScalePatch> patches;
  const ChartTag& middle = tags[tags.size() / 2];
  const double side = std::floor(kTagCells * middle.cell_px / 3.0);
  const double down = std::floor(0.5 * (kTagCells * middle.cell_px - side));
  for (const ChartTag& beside : {tags[tags.size() / 2 - 1], tags[tags.size() / 2 + 1]})
    patches.push_back({std::round(0.5 * (middle.left_px + beside.left_px) +
                                  0.5 * kTagCells * middle.cell_px - side),
                       middle.top_px + down, side});
  return patches;
}

void draw_patch(const ScalePatch& patch, frames::WovenFrame& frame) {
  const int side = static_cast<int>(patch.side_px);
  const int left = static_cast<int>(patch.left_px), top = static_cast<int>(patch.top_px);
  const uint8_t grey = frames::code_from_linear(0.5);
  for (int j = top; j < top + side; ++j)
    for (int i = left; i < left + 2 * side; ++i)
      std::fill_n(frame.row(j) + 3 * static_cast<ptrdiff_t>(i), 3,
                  i < left + side    ? grey
                  : (i + j) % 2 == 0 ? uint8_t{255}
                                     : uint8_t{0});
}

void draw_tag(const ChartTag& tag, const TagFamily& family, frames::WovenFrame& frame) {
  const std::vector<bool> white = family.cells(tag.id);
  const int cell = static_cast<int>(tag.cell_px);
  const int left = static_cast<int>(tag.left_px), top = static_cast<int>(tag.top_px);
  for (int j = 0; j < kTagCells * cell; ++j) {
    for (int i = 0; i < kTagCells * cell; ++i) {
      const bool is_white = white[static_cast<size_t>(j / cell * kTagCells + i / cell)];
      std::fill_n(frame.row(top + j) + 3 * static_cast<ptrdiff_t>(left + i), 3,
                  is_white ? uint8_t{255} : uint8_t{0});
    }
  }
}

/// Wave holds the codes over one period. Its steps are so fine that light is accurate to 2e-4, a
/// twentieth of the coarsest code.
class Wave {
 public:
  explicit Wave(double contrast) {
    for (size_t step = 0; step < codes_.size(); ++step) {
      const double phase = static_cast<double>(step) / static_cast<double>(codes_.size());
      codes_[step] =
          frames::code_from_linear(0.5 + 0.5 * contrast * std::cos(2.0 * std::numbers::pi * phase));
    }
  }
  [[nodiscard]] uint8_t code(double phase) const {
    const double steps = (phase - std::floor(phase)) * static_cast<double>(codes_.size());
    return codes_[static_cast<size_t>(steps + 0.5) % codes_.size()];
  }

 private:
  std::array<uint8_t, 1 << 14> codes_{};
};

void draw_fringes(const SinglePhotoChart& chart, const Wave& wave, int j, uint8_t* row) {
  const optics::Panel& panel = chart.start.panel;
  const double detuning = SinglePhotoChart::detuning(chart.band_at(j + 0.5));
  for (int i = 0; i < panel.width_px; ++i) {
    for (int c = 0; c < 3; ++c) {
      const Vec2 at = panel.subpixel_centre_px(i, j, c);
      *row++ = wave.code(chart.comb_phase(at.x, at.y, detuning));
    }
  }
}

}  // namespace

bool has_room_for_tags(const optics::Rig& start) {
  return least_cell_px(start) <= most_cell_px(start.panel);
}

std::array<Vec2, 4> ChartTag::corners_px() const {
  const double near = kTagRimCells * cell_px, far = (kTagCells - kTagRimCells) * cell_px;
  return {Vec2{left_px + near, top_px + far}, Vec2{left_px + far, top_px + far},
          Vec2{left_px + far, top_px + near}, Vec2{left_px + near, top_px + near}};
}

bool ChartTag::covers(Vec2 panel_px, double margin_px) const {
  const double size = kTagCells * cell_px;
  const auto within = [&](double at, double begin) {
    return at >= begin - margin_px && at <= begin + size + margin_px;
  };
  return within(panel_px.x, left_px) && within(panel_px.y, top_px);
}

bool ScalePatch::covers(Vec2 panel_px, double margin_px) const {
  return panel_px.x >= left_px - margin_px && panel_px.x <= left_px + 2.0 * side_px + margin_px &&
         panel_px.y >= top_px - margin_px && panel_px.y <= top_px + side_px + margin_px;
}

int ScalePatch::half_at(Vec2 panel_px) const {
  constexpr double kRim = 0.2;  // fraction of a half that lenses and blur may mix
  const double x = (panel_px.x - left_px) / side_px, y = (panel_px.y - top_px) / side_px;
  if (!(y > kRim && y < 1.0 - kRim)) return -1;
  if (x > kRim && x < 1.0 - kRim) return 0;
  return x > 1.0 + kRim && x < 2.0 - kRim ? 1 : -1;
}

const ChartTag* SinglePhotoChart::tag(int id) const {
  const auto found = std::find_if(tags.begin(), tags.end(),
                                  [&](const ChartTag& candidate) { return candidate.id == id; });
  return found != tags.end() ? &*found : nullptr;
}

int SinglePhotoChart::band_at(double y_px) const {
  const int band = static_cast<int>(y_px * bands / start.panel.height_px);
  return std::clamp(band, 0, bands - 1);
}

double SinglePhotoChart::comb_phase(double x_px, double y_px, double detuning) const {
  const double width = start.panel.width_px;
  const double s =
      3.0 * (x_px - 0.5 * width + start.sheet.slant * (y_px - 0.5 * start.panel.height_px));
  return s * (1.0 / centre_pitch_subpx + detuning * fringes / (3.0 * width));
}

SinglePhotoChart plan_single_photo_chart(const optics::Rig& start) {
  optics::validate_rig(start, start.name.empty() ? "rig" : start.name);
  constexpr double kDetuning = 0.03;
  SinglePhotoChart chart;
  chart.start = start;
  chart.centre_pitch_subpx = effective_pitch(start);
  const double lenses = 3.0 * start.panel.width_px / chart.centre_pitch_subpx;
  chart.fringes = static_cast<int>(std::lround(std::clamp(kDetuning * lenses, 24.0, 60.0)));
  chart.bands = kBands;
  chart.tags = place_tags(start);
  chart.patches = place_patches(chart.tags);
  return chart;
}

frames::WovenFrame draw_single_photo_chart(const SinglePhotoChart& chart) {
  const optics::Panel& panel = chart.start.panel;
  frames::WovenFrame frame({panel.width_px, panel.height_px, frames::PixelFormat::Rgb8});
  const Wave wave(chart.contrast);
  for (int j = 0; j < panel.height_px; ++j) draw_fringes(chart, wave, j, frame.row(j));
  const TagFamily family;
  for (const ChartTag& tag : chart.tags) draw_tag(tag, family, frame);
  for (const ScalePatch& patch : chart.patches) draw_patch(patch, frame);
  return frame;
}

}  // namespace lenticule::calib
