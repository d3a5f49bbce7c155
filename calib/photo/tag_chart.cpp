// SPDX-License-Identifier: Apache-2.0
// libapriltag finds tags by their outline. The lenses make every edge coarse, so that the outline
// alone leaves the corners uncertain: then all cells of a tag, blurred, are fitted to the picture
// by Gauss-Newton steps on a projective map, two lights and a blur. Each value of the model is a
// sum of few cells, so that a tag takes a few milliseconds.
#include "calib/photo/tag_chart.h"

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>

#include "base/error_kinds.h"
#include "base/statistics.h"
#include "calib/calibration.h"
#include "frames/srgb.h"

namespace lenticule::calib {
namespace {

/// Lens pitches across a cell of a tag: as many as there is room for.
constexpr double kMostPitchesPerCell = 12.0, kLeastPitchesPerCell = 7.0;
/// A tag in each corner and one in the middle have room for larger cells than nine.
constexpr double kLeastPitchesPerCellOfFive = 6.0;
constexpr double kUsualCellPx = 20.0;
/// Cells as wide as this part of a panel that fills the picture of a phone have some of its pixels.
constexpr double kLeastCellPart = 1.0 / 192.0;
constexpr int kTagsAcross = 3;
constexpr int kBands = 8;

double effective_pitch(const optics::Rig& rig) {
  return rig.sheet.pitch.value * (1.0 + rig.sheet.gap.value / viewing_distance_mm(rig));
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

/// Returns the largest cell with room for nine tags, or for five. Fringes need at least as much
/// space as tags.
double most_cell_px(const optics::Panel& panel, bool five) {
  const double across = kTagCells * (five ? 2.0 : 3.0);
  return std::floor(std::min(panel.width_px / (2.0 * across), panel.height_px / (1.5 * across)));
}

/// Returns the smallest cell that is seen through the sheet.
double least_cell_px(const optics::Rig& rig, double pitches) {
  return std::ceil(
      std::max(kLeastCellPart * rig.panel.width_px, pitches * rig.sheet.pitch.value / 3.0));
}

/// Places tags near the corners and in the centre, and if there is room, near the middles of the
/// sides. Fringes outside the tags show the sheet up to the panel's border; a map without them is a
/// guess there.
std::vector<ChartTag> place_tags(const optics::Rig& rig) {
  const bool five = least_cell_px(rig, kLeastPitchesPerCell) > most_cell_px(rig.panel, false);
  const double wanted = std::max(kUsualCellPx, least_cell_px(rig, kMostPitchesPerCell));
  const double cell = std::min(wanted, most_cell_px(rig.panel, five)), size = kTagCells * cell;
  const double width = rig.panel.width_px, height = rig.panel.height_px;
  if (!has_room_for_tags(rig))
    throw input_error("{}: {} x {} pixels are too few for five tags of {:.0f} pixels",
                      rig.name.empty() ? "rig" : rig.name, width, height,
                      kTagCells * least_cell_px(rig, kLeastPitchesPerCellOfFive))
        .remedy("calibrate with photographs of all patterns, which need no tags");
  constexpr double kInsetX = 0.05, kInsetY = 0.075;
  const double left = std::max(cell, kInsetX * width), top = std::max(cell, kInsetY * height);
  std::vector<ChartTag> tags;
  const std::vector<int> ids = tag_ids(rig);
  for (int k = 0; k < kTagsAcross * kTagsAcross; k += five ? 2 : 1) {
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
  return least_cell_px(start, kLeastPitchesPerCellOfFive) <= most_cell_px(start.panel, true);
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
  const auto found = std::ranges::find(tags, id, &ChartTag::id);
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

TagFamily::TagFamily() : family_(tag36h11_create()) {
  LENTICULE_CHECK(family_ != nullptr && family_->total_width == kTagCells &&
                  family_->ncodes == kTagIds);
}

TagFamily::~TagFamily() { tag36h11_destroy(family_); }

std::vector<bool> TagFamily::cells(int id) const {
  LENTICULE_CHECK(id >= 0 && id < kTagIds);
  const std::unique_ptr<image_u8_t, decltype(&image_u8_destroy)> picture(
      apriltag_to_image(family_, id), image_u8_destroy);
  LENTICULE_CHECK(picture && picture->width == kTagCells && picture->height == kTagCells);
  std::vector<bool> white;
  for (int r = 0; r < kTagCells; ++r)
    for (int c = 0; c < kTagCells; ++c)
      white.push_back(picture->buf[r * picture->stride + c] > 127);
  return white;
}

namespace {

struct Release {
  void operator()(image_u8_t* picture) const { image_u8_destroy(picture); }
  void operator()(apriltag_detector_t* detector) const { apriltag_detector_destroy(detector); }
  void operator()(zarray_t* detections) const { apriltag_detections_destroy(detections); }
};
template <class T>
using Owned = std::unique_ptr<T, Release>;

/// Returns the light that a two hundredth of the pixels exceeds: white, even with glints.
float white_level(const PhotoLight& picture) {
  std::vector<float> light = picture.light;
  std::erase_if(light, [](float value) { return !std::isfinite(value); });
  if (light.empty()) return 1.0F;
  const size_t place = light.size() - 1 - light.size() / 200;
  return std::max(value_in_order(std::move(light), place), 1e-6F);
}

/// Converts means of squares to eight bits of linear light: a curve would move the tags' edges.
Owned<image_u8_t> eight_bits(const PhotoLight& picture, int side) {
  Owned<image_u8_t> out(image_u8_create(static_cast<unsigned>(picture.width / side),
                                        static_cast<unsigned>(picture.height / side)));
  LENTICULE_CHECK(out != nullptr);
  const float white = white_level(picture);
  for (int j = 0; j < out->height; ++j)
    for (int i = 0; i < out->width; ++i) {
      float sum = 0.0F;
      for (int k = 0; k < side * side; ++k) {
        const int pixel = (side * j + k / side) * picture.width + side * i + k % side;
        const float light = picture.light[static_cast<size_t>(pixel)];
        sum += light > 0.0F ? std::min(light / white, 1.0F) : 0.0F;  // NaN: black
      }
      out->buf[j * out->stride + i] =
          static_cast<uint8_t>(std::lround(255.0F * sum / static_cast<float>(side * side)));
    }
  return out;
}

bool is_credible(const apriltag_detection_t& detection) {
  constexpr int kMostWrongBits = 1;
  constexpr float kLeastMargin = 15.0F;
  return detection.id >= 0 && detection.id < kTagIds && detection.hamming <= kMostWrongBits &&
         detection.decision_margin >= kLeastMargin;
}

/// Best holds the clearest sighting of each tag.
using Best = std::map<int, std::pair<float, TagSighting>>;

/// `side` is that of the squares of pixels that became one of the picture.
Best detect(apriltag_detector_t& detector, image_u8_t& picture, double side) {
  const Owned<zarray_t> found(apriltag_detector_detect(&detector, &picture));
  Best best;
  for (int i = 0; found && i < zarray_size(found.get()); ++i) {
    apriltag_detection_t* detection = nullptr;
    zarray_get(found.get(), i, &detection);
    if (!is_credible(*detection)) continue;
    auto& [margin, sighting] = best[detection->id];
    if (margin >= detection->decision_margin) continue;
    margin = detection->decision_margin;
    sighting.id = detection->id;
    for (size_t corner = 0; corner < 4; ++corner)
      sighting.corners_px[corner] = {side * detection->p[corner][0],
                                     side * detection->p[corner][1]};
  }
  return best;
}

}  // namespace

std::vector<TagSighting> find_tags(const PhotoLight& picture, size_t wanted) {
  constexpr int kLeastSide = 96;  // the library requires a minimum size
  if (picture.width < kLeastSide || picture.height < kLeastSide) return {};
  const TagFamily family;  // outlives its detector
  const Owned<apriltag_detector_t> detector(apriltag_detector_create());
  LENTICULE_CHECK(detector != nullptr);
  apriltag_detector_add_family_bits(detector.get(), family.get(), 1);
  detector->nthreads = 1;
  detector->quad_decimate = 1.0F;
  Best all;
  // The sharp picture is searched first; tags hidden by noise are searched in blurred pictures, and
  // those that wide lenses cut into stripes in a smaller one. Corners are always refined in the
  // sharp picture.
  for (const int side : {1, 3}) {
    const Owned<image_u8_t> grey = eight_bits(picture, side);
    for (const float blur_px : {0.0F, 0.8F, 1.6F, 2.4F}) {
      if (all.size() >= wanted) break;
      detector->quad_sigma = blur_px;
      all.merge(detect(*detector, *grey, side));
    }
  }
  std::vector<TagSighting> tags;
  for (const auto& [id, sighting] : all)
    tags.push_back(aligned(picture, sighting.second, family.cells(id)));
  return tags;
}

namespace {

/// Unknowns: the map to cells of the tag from pixels, the light of black, that of white minus that
/// of black, and the standard deviation of the blur in cells.
constexpr int kMapCount = 8, kBlack = 8, kRise = 9, kBlur = 10, kCount = 11;
using Unknowns = Eigen::Matrix<double, kCount, 1>;
using Square = Eigen::Matrix<double, kCount, kCount>;

constexpr double kLeastBlur = 0.05, kMostBlur = 0.6;

/// Places of the corners in cells, in the order of TagSighting.
constexpr double kNear = kTagRimCells, kFar = kTagCells - kTagRimCells;
constexpr std::array<Vec2, 4> kCorners = {
    {{kNear, kFar}, {kFar, kFar}, {kFar, kNear}, {kNear, kNear}}};

/// Normalized converts pixels to numbers near 1, for the sake of the equations.
struct Normalized {
  Vec2 middle;
  double scale = 1.0;

  [[nodiscard]] Vec2 of(Vec2 pixel) const { return (pixel - middle) * (1.0 / scale); }
  [[nodiscard]] Vec2 pixel(Vec2 at) const { return at * scale + middle; }
};

constexpr int kSpan = 5, kReach = kSpan / 2;
/// Weights holds the parts that the cells around a place have in its blurred light, along one side
/// of the tag, then their derivatives by the place and by the blur.
using Weights = Eigen::Matrix<double, kSpan, 3>;

Weights weights_at(double place_in_cell, double blur) {
  Weights out;
  std::array<double, kSpan + 1> below{}, density{}, moment{};
  for (size_t k = 0; k <= kSpan; ++k) {
    const double z = (static_cast<double>(k) - kReach - place_in_cell) / blur;
    below[k] = 0.5 * std::erfc(-z / std::numbers::sqrt2);
    density[k] = std::exp(-0.5 * z * z) / (blur * std::numbers::sqrt2 / std::numbers::inv_sqrtpi);
    moment[k] = -z * density[k];
  }
  below.front() = 0.0;  // the outer cells stand for all that are further away
  below.back() = 1.0;
  for (size_t k = 0; k < kSpan; ++k)
    out.row(static_cast<Eigen::Index>(k)) << below[k + 1] - below[k], density[k] - density[k + 1],
        moment[k + 1] - moment[k];
  return out;
}

/// BlurredTag evaluates a tag with one blur: between places in steps, weights are interpolated.
class BlurredTag {
 public:
  /// Light of the cells, 1 for white, with a rim of fringes, half as light.
  using Light = Eigen::Matrix<double, kTagCells + 2 * kReach, kTagCells + 2 * kReach>;

  static Light light_of(const std::vector<bool>& white) {
    Light out = Light::Constant(0.5);
    for (int k = 0; k < kTagCells * kTagCells; ++k)
      out(k / kTagCells + kReach, k % kTagCells + kReach) =
          white[static_cast<size_t>(k)] ? 1.0 : 0.0;
    return out;
  }

  BlurredTag(const Light& light, double blur) : light_(light) {
    for (int k = 0; k <= kSteps; ++k) steps_.push_back(weights_at(double(k) / kSteps, blur));
  }

  /// Returns the light at a place on the tag: the value, the derivatives by y and by the blur of
  /// the rows; in the first row, the value, the derivatives by x and by the blur of the columns.
  [[nodiscard]] Eigen::Matrix3d at(Vec2 cell) const {
    const int column = static_cast<int>(cell.x), row = static_cast<int>(cell.y);
    const Weights across = weights(cell.x - column), down = weights(cell.y - row);
    return down.transpose() * (light_.block<kSpan, kSpan>(row, column) * across).eval();
  }

 private:
  static constexpr int kSteps = 256;
  [[nodiscard]] Weights weights(double place_in_cell) const {
    const double at = place_in_cell * kSteps;
    const auto below = static_cast<size_t>(at);
    const double part = at - static_cast<double>(below);
    return (1.0 - part) * steps_[below] + part * steps_[below + 1];
  }

  const Light& light_;
  std::vector<Weights> steps_;
};

/// Returns the map that takes the four corners to kCorners, if they are no degenerate square.
std::optional<Unknowns> start_of(const TagSighting& tag, const Normalized& normalized) {
  Eigen::Matrix<double, kMapCount, kMapCount> equations;
  Eigen::Matrix<double, kMapCount, 1> wanted;
  for (int k = 0; k < 4; ++k) {
    const Vec2 p = normalized.of(tag.corners_px[static_cast<size_t>(k)]);
    const Vec2 q = kCorners[static_cast<size_t>(k)];
    equations.row(2 * k) << p.x, p.y, 1.0, 0.0, 0.0, 0.0, -q.x * p.x, -q.x * p.y;
    equations.row(2 * k + 1) << 0.0, 0.0, 0.0, p.x, p.y, 1.0, -q.y * p.x, -q.y * p.y;
    wanted[2 * k] = q.x;
    wanted[2 * k + 1] = q.y;
  }
  Unknowns out = Unknowns::Zero();
  out.head<kMapCount>() = equations.fullPivLu().solve(wanted);
  if (!out.allFinite()) return std::nullopt;
  return out;
}

/// Returns the pixel of a place in cells.
Vec2 pixel_of(const Unknowns& u, Vec2 cell, const Normalized& normalized) {
  Eigen::Matrix2d lines;
  lines << u[0] - cell.x * u[6], u[1] - cell.x * u[7], u[3] - cell.y * u[6], u[4] - cell.y * u[7];
  const Eigen::Vector2d at = lines.inverse() * Eigen::Vector2d(cell.x - u[2], cell.y - u[5]);
  return normalized.pixel({at.x(), at.y()});
}

/// Part is a rectangle of pixels.
struct Part {
  int left, top, right, bottom;  ///< right and bottom are excluded
};

Part around(const PhotoLight& picture, const TagSighting& tag) {
  Vec2 least = tag.corners_px[0], most = least;
  for (const Vec2& corner : tag.corners_px) {
    least = {std::min(least.x, corner.x), std::min(least.y, corner.y)};
    most = {std::max(most.x, corner.x), std::max(most.y, corner.y)};
  }
  const double rim = 0.2 * std::max(most.x - least.x, most.y - least.y);
  return {std::max(static_cast<int>(least.x - rim), 0),
          std::max(static_cast<int>(least.y - rim), 0),
          std::min(static_cast<int>(most.x + rim), picture.width),
          std::min(static_cast<int>(most.y + rim), picture.height)};
}

/// Alignment is the fit of one tag.
class Alignment {
 public:
  Alignment(const PhotoLight& picture, const TagSighting& tag, const std::vector<bool>& white,
            const Normalized& normalized)
      : picture_(picture),
        light_(BlurredTag::light_of(white)),
        normalized_(normalized),
        part_(around(picture, tag)) {}

  /// Sums the normal equations at the unknowns. Returns the mean squared residual.
  double equations(const Unknowns& u, Square& square, Unknowns& right) const {
    square.setZero();
    right.setZero();
    const BlurredTag blurred(light_, u[kBlur]);
    double sum = 0.0;
    int count = 0;
    for (int j = part_.top; j < part_.bottom; ++j)
      for (int i = part_.left; i < part_.right; ++i) {
        const double light =
            picture_.light[static_cast<size_t>(j) * static_cast<size_t>(picture_.width) +
                           static_cast<size_t>(i)];
        if (!std::isfinite(light)) continue;
        Unknowns slope;
        const auto expected = value(blurred, u, normalized_.of({i + 0.5, j + 0.5}), slope);
        if (!expected) continue;
        const double rest = light - *expected;
        square.noalias() += slope * slope.transpose();
        right += slope * rest;
        sum += rest * rest;
        ++count;
      }
    return count > kCount ? sum / count : std::numeric_limits<double>::infinity();
  }

 private:
  /// Returns the light that the unknowns predict, with its derivatives; nothing outside the middle
  /// of the rim, where fringes begin.
  static std::optional<double> value(const BlurredTag& blurred, const Unknowns& u, Vec2 p,
                                     Unknowns& slope) {
    constexpr double kMargin = 0.5 * kTagRimCells;
    const double w = u[6] * p.x + u[7] * p.y + 1.0;
    const Vec2 q{(u[0] * p.x + u[1] * p.y + u[2]) / w, (u[3] * p.x + u[4] * p.y + u[5]) / w};
    if (!(std::min(q.x, q.y) > kMargin && std::max(q.x, q.y) < kTagCells - kMargin))
      return std::nullopt;
    const Eigen::Matrix3d at = blurred.at(q);
    const double x = u[kRise] * at(0, 1) / w, y = u[kRise] * at(1, 0) / w;
    const double both = x * q.x + y * q.y;
    slope << x * p.x, x * p.y, x, y * p.x, y * p.y, y, -both * p.x, -both * p.y, 1.0, at(0, 0),
        u[kRise] * (at(0, 2) + at(2, 0));
    return u[kBlack] + u[kRise] * at(0, 0);
  }

  const PhotoLight& picture_;
  BlurredTag::Light light_;
  Normalized normalized_;
  Part part_;
};

/// Returns the unknowns of the best fit; nothing if the steps do not settle.
std::optional<Unknowns> settled(const Alignment& alignment, Unknowns u) {
  constexpr int kMostSteps = 12;
  constexpr double kSettled = 1e-4;
  constexpr double kStartBlur = 0.2;
  u[kBlur] = kStartBlur;
  Square square;
  Unknowns right;
  // The lights alone first: they enter linearly.
  u[kRise] = 1.0;
  if (!std::isfinite(alignment.equations(u, square, right))) return std::nullopt;
  const Eigen::Vector2d lights =
      square.block<2, 2>(kBlack, kBlack).ldlt().solve(right.segment<2>(kBlack));
  u[kBlack] = lights[0];
  u[kRise] = 1.0 + lights[1];
  double before = alignment.equations(u, square, right);
  for (int step = 0; step < kMostSteps; ++step) {
    const Unknowns change = square.ldlt().solve(right);
    Unknowns next = u + change;
    next[kBlur] = std::clamp(next[kBlur], kLeastBlur, kMostBlur);
    if (!next.allFinite() || !(next[kRise] > 0.0)) return std::nullopt;
    const double now = alignment.equations(next, square, right);
    if (!(now < 4.0 * before)) return std::nullopt;
    u = next;
    if (std::abs(now - before) <= kSettled * before) return u;
    before = now;
  }
  return std::nullopt;
}

}  // namespace

TagSighting aligned(const PhotoLight& picture, const TagSighting& tag,
                    const std::vector<bool>& white) {
  constexpr double kMostCells = 0.5;  ///< farthest move of a corner
  const Vec2 diagonal = tag.corners_px[2] - tag.corners_px[0];
  const Normalized normalized{(tag.corners_px[0] + tag.corners_px[2]) * 0.5,
                              std::max(std::hypot(diagonal.x, diagonal.y), 1.0)};
  const auto start = start_of(tag, normalized);
  if (!start) return tag;
  const auto found = settled(Alignment(picture, tag, white, normalized), *start);
  if (!found) return tag;
  TagSighting out = tag;
  const double cell_px = normalized.scale / (std::numbers::sqrt2 * (kFar - kNear));
  const double most_px = kMostCells * cell_px;
  out.blur_px = (*found)[kBlur] * cell_px;
  for (size_t k = 0; k < kCorners.size(); ++k) {
    out.corners_px[k] = pixel_of(*found, kCorners[k], normalized);
    const Vec2 moved = out.corners_px[k] - tag.corners_px[k];
    if (!(std::hypot(moved.x, moved.y) <= most_px)) return tag;
  }
  return out;
}

}  // namespace lenticule::calib
