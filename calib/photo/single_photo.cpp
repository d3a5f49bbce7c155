// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/single_photo.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/statistics.h"
#include "calib/photo/fringe_blocks.h"
#include "calib/photo/fringe_start.h"
#include "calib/photo/phase_plane.h"
#include "calib/photo/sheet_map.h"
#include "calib/photo/tag_finder.h"
#include "optics/model.h"

namespace lenticule::calib {
namespace {

constexpr int kMostSide = 2600;
constexpr int kGreen = 1;
constexpr size_t kLeastTags = 5;
constexpr double kMisplacedPx = 1.5;
constexpr double kMostSaturated = 0.5;
constexpr double kLeastCovered = 0.5;
constexpr double kLeastContrast = 0.05;
constexpr double kMostRmsLenses = 0.05;
constexpr double kMostLeftOut = 0.2;
constexpr double kWantedMaxLenses = 0.02;

/// Work holds all intermediate results, so that a refusal can report the progress.
struct Work {
  PhotoLight picture;
  int averaged =
      1;  ///< side of the square of photograph pixels that is averaged to one pixel of `picture`
  std::vector<TagSighting> tags;
  std::optional<PhotoPose> pose;
  std::optional<double> squares;  ///< light_of_squares
  FringeSamples fringes;
  optics::Rig rig;  ///< the rig known so far
  std::vector<FringeBlock> blocks;
  PlaneCorrection correction;
  double uneven_lenses = 0.0;  ///< residual before the sheet's shape was mapped
  /// Change of at, across and down if the camera was one standard error further away.
  LensPlane farther;
};

/// Appends the mean light of a square of pixels, and that of each channel, to the picture.
void append_mean(const CameraPicture& photograph, int left, int top, int side, PhotoLight& out) {
  float sum = 0.0F;
  std::array<float, 3> colours{};
  int clipped = 0;
  const auto channels = static_cast<size_t>(photograph.channels);
  for (int j = top; j < top + side; ++j) {
    const size_t row = static_cast<size_t>(j) * static_cast<size_t>(photograph.width);
    const size_t first = (row + static_cast<size_t>(left)) * channels;
    for (size_t k = first; k < first + static_cast<size_t>(side) * channels; ++k) {
      sum += photograph.light[k];
      clipped += photograph.light[k] >= kSaturatedLight ? 1 : 0;
      if (channels == colours.size()) colours[k % channels] += photograph.light[k];
    }
  }
  const int values = side * side * photograph.channels;
  out.light.push_back(sum / static_cast<float>(values));
  out.clipped.push_back(static_cast<uint8_t>(255 * clipped / values));
  for (float& colour : colours) colour /= static_cast<float>(side * side);
  if (channels == colours.size()) out.colours.push_back(colours);
}

void average_down(const CameraPicture& photograph, Work& work) {
  const int longer = std::max(photograph.width, photograph.height);
  work.averaged = std::max((longer + kMostSide - 1) / kMostSide, 1);
  PhotoLight& picture = work.picture;
  picture.width = photograph.width / work.averaged;
  picture.height = photograph.height / work.averaged;
  const size_t count = static_cast<size_t>(picture.width) * static_cast<size_t>(picture.height);
  picture.light.reserve(count);
  picture.clipped.reserve(count);
  for (int j = 0; j < picture.height; ++j)
    for (int i = 0; i < picture.width; ++i)
      append_mean(photograph, i * work.averaged, j * work.averaged, work.averaged, picture);
}

/// Scales priors, which refer to the photograph, to the averaged picture.
PhotoPriors scaled(PhotoPriors priors, int averaged) {
  if (priors.focal_px) {
    priors.focal_px->value /= averaged;
    priors.focal_px->sigma /= averaged;
  }
  return priors;
}

/// Refusal is the reason to stop, or nothing.
using Refusal = std::optional<std::string>;

/// Removes tags that are partly hidden: they are found, but at a wrong position.
std::vector<TagSighting> without_misplaced(const Work& work) {
  const double most = std::max(4.0 * upper_median(work.pose->tag_off_px), kMisplacedPx);
  std::vector<TagSighting> kept;
  for (size_t i = 0; i < work.tags.size(); ++i)
    if (work.pose->tag_off_px[i] <= most) kept.push_back(work.tags[i]);
  return kept;
}

/// Returns the part of the picture's longer side that the tags extend over.
double extent_of_tags(const Work& work) {
  Vec2 least{1e9, 1e9}, most{-1e9, -1e9};
  for (const TagSighting& tag : work.tags)
    for (const Vec2& corner : tag.corners_px) {
      least = {std::min(least.x, corner.x), std::min(least.y, corner.y)};
      most = {std::max(most.x, corner.x), std::max(most.y, corner.y)};
    }
  return std::max(most.x - least.x, most.y - least.y) /
         std::max(work.picture.width, work.picture.height);
}

/// Returns a refusal if the given camera data contradict the tags. Few pixels determine the camera
/// badly, so that a distance appears as another contradiction.
Refusal contradiction(const Work& work, const SinglePhotoChart& chart, const PhotoPriors& priors) {
  constexpr double kMostPull = 4.0, kLeastExtent = 0.3;
  const bool contradicts =
      work.pose->axis_pull > kMostPull ||
      (priors.focal_px && priors.distance_mm && work.pose->prior_pull > kMostPull);
  if (!contradicts) return std::nullopt;
  if (const double extent = extent_of_tags(work); extent < kLeastExtent)
    return fmt::format(
        "the chart takes only {:.0f} % of the picture's longer side: it was taken from "
        "too far away; go nearer",
        100.0 * extent);
  if (work.pose->axis_pull > kMostPull) {
    const Vec2 off =
        (work.pose->middle_px - Vec2{0.5 * work.picture.width, 0.5 * work.picture.height}) *
        work.averaged;
    return fmt::format(
        "the camera's axis is {:.0f} pixels to the side and {:.0f} down from the middle of the "
        "picture: it was cropped; give the whole photograph",
        off.x, off.y);
  }
  const auto found_without = [&](auto forget) {
    PhotoPriors fewer = scaled(priors, work.averaged);
    forget(fewer);
    return find_pose(work.tags, chart, work.picture.width, work.picture.height, fewer);
  };
  const auto by_focal = found_without([](PhotoPriors& p) { p.distance_mm.reset(); });
  const auto by_distance = found_without([](PhotoPriors& p) { p.focal_px.reset(); });
  if (!by_focal || !by_distance) return "distance and focal length contradict the tags";
  return fmt::format(
      "distance and focal length contradict the picture: {:.0f} pixels of focal length give this "
      "picture of the tags from {:.0f} mm, not {:.0f} mm, and at that distance the focal length "
      "would be {:.0f} pixels; if both are right the panel's size in the rig is wrong by {:.0f} %",
      priors.focal_px->value, by_focal->eye_mm.z, priors.distance_mm->value,
      by_distance->focal_px * work.averaged,
      100.0 * std::abs(by_focal->eye_mm.z / priors.distance_mm->value - 1.0));
}

Refusal place_camera(Work& work, const SinglePhotoChart& chart, const PhotoPriors& priors) {
  const auto try_tags = [&] {
    work.pose = find_pose(work.tags, chart, work.picture.width, work.picture.height,
                          scaled(priors, work.averaged));
  };
  try_tags();
  if (work.pose) {
    const std::vector<TagSighting> kept = without_misplaced(work);
    if (kept.size() >= kLeastTags && kept.size() < work.tags.size()) {
      work.tags = kept;
      try_tags();
    }
  }
  if (!work.pose) return "the tags fit no place of a camera in front of the panel";
  if (Refusal refusal = contradiction(work, chart, priors)) return refusal;
  constexpr double kMostCornerPx = 3.0;
  if (work.pose->corner_rms_px > kMostCornerPx)
    return fmt::format(
        "the tags deviate by {:.1f} pixels from a flat panel seen through a simple lens",
        work.pose->corner_rms_px);
  return std::nullopt;
}

/// Returns true if tags of the chart appear when the picture is mirrored.
bool is_mirrored(const PhotoLight& picture, const SinglePhotoChart& chart) {
  PhotoLight mirrored{picture.width, picture.height, picture.light};
  for (int row = 0; row < mirrored.height; ++row) {
    const auto begin = mirrored.light.begin() + static_cast<ptrdiff_t>(row) * mirrored.width;
    std::reverse(begin, begin + mirrored.width);
  }
  const std::vector<TagSighting> tags = find_tags(mirrored, kLeastTags);
  return std::ranges::count_if(tags, [&](const TagSighting& tag) {
           return chart.tag(tag.id) != nullptr;
         }) >= static_cast<ptrdiff_t>(kLeastTags);
}

Refusal find_camera(Work& work, const SinglePhotoChart& chart, const PhotoPriors& priors) {
  work.tags = find_tags(work.picture, chart.tags.size());
  const size_t foreign = std::erase_if(
      work.tags, [&](const TagSighting& tag) { return chart.tag(tag.id) == nullptr; });
  if (work.tags.size() < kLeastTags && foreign >= kLeastTags)
    return "the chart in the photograph was made for another rig";
  if (work.tags.size() < kLeastTags && is_mirrored(work.picture, chart))
    return "the photograph is mirrored: switch off the camera program's mirroring, or take the "
           "phone's back camera";
  if (work.tags.size() < kLeastTags)
    return fmt::format(
        "only {} of {} tags were found: the panel is not completely in the picture, too small, or "
        "out of focus",
        work.tags.size(), chart.tags.size());
  return place_camera(work, chart, priors);
}

/// Refuses scaled pictures. Scaling smears squares of one pixel to less light than they have. It
/// also scales the fringes, so that the fitted pitch would belong to another size.
Refusal evaluate_scale(Work& work, const SinglePhotoChart& chart) {
  constexpr double kLeastSquares = 0.8;
  work.squares = light_of_squares(work.picture, *work.pose, chart);
  if (!work.squares || *work.squares >= kLeastSquares) return std::nullopt;
  return fmt::format(
      "the chart was scaled before it was displayed: its squares of one pixel have {:.0f} % of the "
      "expected light; show it pixel by pixel",
      100.0 * *work.squares);
}

Refusal find_fringes(Work& work, const SinglePhotoChart& chart) {
  work.fringes = collect_fringes(work.picture, *work.pose, chart);
  if (work.fringes.saturated > kMostSaturated)
    return fmt::format("{:.0f} % of the fringes are clipped: expose less",
                       100.0 * work.fringes.saturated);
  if (work.fringes.covered < kLeastCovered)
    return fmt::format("only {:.0f} % of the fringes are in the picture",
                       100.0 * work.fringes.covered);
  const FringeCount count = count_fringes(work.fringes, chart);
  if (count.prominence < kLeastProminence)
    return "no fringes were found: the picture is blurred, the sheet is not on the panel, or its "
           "pitch differs by more than a tenth from the rig's";
  LensPlane plane = plane_of(chart.start);
  plane.across += count.more_lenses.x;
  plane.down += count.more_lenses.y;
  work.rig = with_plane(chart.start, plane);
  return std::nullopt;
}

void improve(Work& work, const LensPlane& add) {
  LensPlane plane = plane_of(work.rig);
  plane.at += add.at;
  plane.across += add.across;
  plane.down += add.down;
  work.rig = with_plane(work.rig, plane);
}

double median_contrast(const std::vector<FringeBlock>& blocks) {
  std::vector<double> values;
  for (const FringeBlock& block : blocks) values.push_back(block.contrast);
  return upper_median(std::move(values));
}

/// Returns the fraction of the blocks that are outliers.
double left_out(const Work& work) {
  if (work.blocks.empty()) return 1.0;
  return 1.0 - static_cast<double>(work.correction.used) / static_cast<double>(work.blocks.size());
}

/// Refines the plane in rounds: relative to a better plane, a block's own fringes are straighter.
void refine_plane(Work& work, const SinglePhotoChart& chart) {
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    work.blocks = measure_blocks(work.fringes, chart, work.rig);
    work.correction = fit_plane(work.blocks);
    improve(work, work.correction.add);
  }
}

Refusal fit_phases(Work& work, const SinglePhotoChart& chart) {
  work.blocks = measure_blocks(work.fringes, chart, work.rig);
  improve(work, search_plane(work.blocks));
  refine_plane(work, chart);
  work.uneven_lenses = work.correction.max_lenses;
  // The next map captures the part that the previous map smoothed away.
  constexpr int kMaps = 3;
  for (int map = 0; map < kMaps && work.correction.max_lenses > kWantedMaxLenses; ++map) {
    work.rig.sheet.residual =
        sum_of_maps(work.rig.sheet.residual, smooth_map(work.blocks, work.correction.residuals));
    refine_plane(work, chart);
  }
  if (median_contrast(work.blocks) < kLeastContrast)
    return "the fringes are too faint: the picture is blurred or the room too bright";
  if (left_out(work) > kMostLeftOut || work.blocks.size() < 20 ||
      work.correction.rms_lenses > kMostRmsLenses)
    return fmt::format(
        "the fringes do not fit an even sheet (rms {:.3f} lenses in {} of {} blocks): the picture "
        "is out of focus, a lamp is reflected, or the sheet came loose",
        work.correction.rms_lenses, work.correction.used, work.blocks.size());
  return std::nullopt;
}

// --- result -------------------------------------------------------------------------------------

/// Returns the plane as the eye sees the sheet: over panel points, with the effective pitch as P
/// and the phase at the panel's centre as `at`.
LensPlane effective_plane(const Work& work) {
  const optics::Panel& panel = work.rig.panel;
  const Vec3 eye = work.pose->eye_mm;
  LensPlane plane = plane_of(work.rig);
  const double wider = 1.0 + work.rig.sheet.gap.value / eye.z;
  plane.across /= wider;
  plane.down /= wider;
  const optics::OpticalModel model(work.rig);
  plane.at =
      model.phase(0.5 * panel.width_px, 0.5 * panel.height_px, kGreen, {eye.x, eye.y, eye.z});
  return plane;
}

using Matrix3 = std::array<std::array<double, 3>, 3>;

/// Returns the covariance of at, across and down from the scatter of the blocks and the camera's
/// distance.
Matrix3 plane_covariance(const Work& work) {
  const std::array<double, 3> farther = {work.farther.at, work.farther.across, work.farther.down};
  Matrix3 out{};
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j)
      out[i][j] = work.correction.covariance[3 * i + j] + farther[i] * farther[j];
  return out;
}

/// Effective holds effective pitch, slant and offset with their correlations.
struct Effective {
  std::array<Estimate, 3> estimates;
  std::vector<std::vector<double>> correlations;
};

/// Transforms the covariance of at, across and down to that of pitch, slant and offset.
Matrix3 carried_over(const Matrix3& covariance, const LensPlane& plane,
                     const optics::Panel& panel) {
  const double shape = double(panel.width_px) / panel.height_px;
  const double pitch = 3.0 * panel.width_px / plane.across;
  const Matrix3 slopes = {
      {{0.0, -pitch / plane.across, 0.0},
       {0.0, -plane.down * shape / (plane.across * plane.across), shape / plane.across},
       {1.0, 0.0, 0.0}}};
  Matrix3 out{};
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j)
      for (size_t k = 0; k < 9; ++k)
        out[i][j] += slopes[i][k / 3] * slopes[j][k % 3] * covariance[k / 3][k % 3];
  return out;
}

Effective effective_of(const Work& work) {
  const LensPlane plane = effective_plane(work);
  const optics::Panel& panel = work.rig.panel;
  const Matrix3 covariance = carried_over(plane_covariance(work), plane, panel);
  const double values[3] = {3.0 * panel.width_px / plane.across, work.rig.sheet.slant,
                            plane.at - std::round(plane.at)};
  Effective out;
  for (size_t i = 0; i < 3; ++i) {
    out.estimates[i] = {values[i], std::sqrt(covariance[i][i])};
    out.correlations.emplace_back();
    for (size_t j = 0; j < 3; ++j) {
      const double scale = std::sqrt(covariance[i][i] * covariance[j][j]);
      out.correlations[i].push_back(scale > 0.0 ? covariance[i][j] / scale : i == j ? 1.0 : 0.0);
    }
  }
  return out;
}

PanelField residual_field(const Work& work) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  PanelField field{work.fringes.columns, work.fringes.rows, {}};
  field.values.assign(static_cast<size_t>(field.columns) * static_cast<size_t>(field.rows), kNone);
  // Observed minus fitted lenses: fringes have the opposite sign.
  for (size_t i = 0; i < work.blocks.size(); ++i)
    field.values[work.blocks[i].block] = -work.correction.residuals[i];
  return field;
}

Viewpoint viewpoint_of(const Work& work, const Effective& effective) {
  Viewpoint v;
  v.name = "photograph";
  v.eye_mm = work.pose->eye_mm;
  v.eye_sigma_mm = work.pose->eye_sigma_mm;
  v.tilt_degrees = work.pose->tilt_degrees;
  v.effective_pitch_subpx = effective.estimates[0];
  v.slant = effective.estimates[1];
  v.effective_offset_lenses = effective.estimates[2];
  v.contrast = median_contrast(work.blocks);
  v.covered = std::min(work.fringes.covered, 1.0);
  v.blocks = work.correction.used;
  v.rms_lenses = work.correction.rms_lenses;
  v.max_lenses = work.correction.max_lenses;
  v.reprojection_rms_px = work.pose->corner_rms_px * work.averaged;
  v.residual = residual_field(work);
  return v;
}

/// Returns the variance of the phase at a panel point, for an eye at the estimated camera position,
/// that results from the uncertainty of this position.
double variance_of_place(const Work& work, const optics::OpticalModel& model, Vec2 panel_px) {
  const Vec3 e = work.pose->eye_mm;
  const auto phase = [&](double x, double y, double z) {
    return model.phase(panel_px.x, panel_px.y, kGreen, {e.x + x, e.y + y, e.z + z});
  };
  const std::array<double, 3> slopes = {0.5 * (phase(1, 0, 0) - phase(-1, 0, 0)),
                                        0.5 * (phase(0, 1, 0) - phase(0, -1, 0)),
                                        0.5 * (phase(0, 0, 1) - phase(0, 0, -1))};
  double variance = 0.0;
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j)
      variance += slopes[i] * slopes[j] * work.pose->doubted_eye[3 * i + j];
  return variance;
}

/// Returns the drift for this eye only, since the result is valid only there. With `placed`, the
/// eye is put at the measured millimetres; otherwise the eye is at the true position of the camera.
DriftPrediction drift_of(const Work& work, bool placed) {
  const Matrix3 c = plane_covariance(work);
  const optics::OpticalModel model(work.rig);
  DriftPrediction worst;
  worst.eye_mm = work.pose->eye_mm;
  for (const double x : {-0.5, 0.5}) {
    for (const double y : {-0.5, 0.5}) {
      double variance = c[0][0] + x * x * c[1][1] + y * y * c[2][2] +
                        2.0 * (x * c[0][1] + y * c[0][2] + x * y * c[1][2]);
      const optics::Panel& panel = work.rig.panel;
      if (placed)
        variance += variance_of_place(work, model,
                                      {(x + 0.5) * panel.width_px, (y + 0.5) * panel.height_px});
      const double off = 2.0 * std::sqrt(std::max(variance, 0.0));
      if (off < worst.worst_lenses) continue;
      worst.worst_lenses = off;
      worst.panel_x_px = (x + 0.5) * work.rig.panel.width_px;
      worst.panel_y_px = (y + 0.5) * work.rig.panel.height_px;
    }
  }
  return worst;
}

void add_warnings(const Work& work, const SinglePhotoChart& chart, bool confirmed,
                  Calibration& out) {
  if (work.tags.size() < chart.tags.size())
    out.warnings.push_back(
        fmt::format("{} of {} tags were found", work.tags.size(), chart.tags.size()));
  if (work.uneven_lenses > kWantedMaxLenses)
    out.warnings.push_back(
        fmt::format("the sheet is not even: up to {:.3f} lenses, which the rig's map corrects for "
                    "this eye; {:.3f} remain",
                    work.uneven_lenses, work.correction.max_lenses));
  const size_t outliers = work.blocks.size() - static_cast<size_t>(work.correction.used);
  if (20 * outliers > work.blocks.size())
    out.warnings.push_back(
        fmt::format("{} of {} blocks did not fit and were left out", outliers, work.blocks.size()));
  if (const double sigma = work.pose->eye_sigma_mm.z; sigma > 0.03 * work.pose->eye_mm.z)
    out.warnings.push_back(
        fmt::format("the distance of the camera is known only to {:.0f} mm: straight ahead, focal "
                    "length and distance cannot be separated",
                    sigma));
  if (!work.squares)
    out.warnings.emplace_back(
        "it cannot be checked whether the chart was shown pixel by pixel: the picture is too "
        "small");
  const double there = drift_of(work, false).worst_lenses;
  if (out.drift.worst_lenses > std::max(kWantedMaxLenses, 2.0 * there))
    out.warnings.push_back(
        fmt::format("an eye at the place of the camera sees phases right to {:.3f} lens, an eye "
                    "that is placed there by the stated distance to {:.2f}: the picture does not "
                    "show whether it was cropped{}",
                    there, out.drift.worst_lenses,
                    confirmed ? ""
                              : ", nor confirm the distance; give both "
                                "--distance and --focal-px"));
}

/// Adds the known values of the camera, also for a refusal.
void add_camera(const Work& work, Calibration& out) {
  if (!work.pose) return;
  out.camera.focal_px = work.pose->focal_px * work.averaged;
  out.camera.centre_x_px = work.pose->middle_px.x * work.averaged;
  out.camera.centre_y_px = work.pose->middle_px.y * work.averaged;
  out.camera.k1 = -work.pose->distortion;
}

void add_findings(const Work& work, const SinglePhotoChart& chart, const PhotoPriors& priors,
                  Calibration& out) {
  const Effective effective = effective_of(work);
  const Vec3 eye = work.pose->eye_mm;
  out.rig = work.rig;
  double& offset = out.rig.sheet.offset.value;
  offset -= std::round(offset);
  out.rig.viewing = {Millimetres(eye.y), Millimetres(eye.z)};
  out.viewpoints = {viewpoint_of(work, effective)};
  out.parameters = {{"effective_pitch_subpx", "subpixels", effective.estimates[0]},
                    {"slant", "px/px", effective.estimates[1]},
                    {"effective_offset_lenses", "lenses", effective.estimates[2]}};
  out.correlations = effective.correlations;
  out.drift = drift_of(work, true);
  out.verdict = Verdict::Effective;
  out.reasons = {
      "one photograph determines pitch and offset only for its place; the gap is that of the "
      "starting rig"};
  add_warnings(work, chart, priors.focal_px && priors.distance_mm, out);
}

/// Repeats the fit for a camera that was further away: the sheet bends light more at a small
/// distance, and a photograph from straight ahead does not determine its own distance.
void try_farther(Work& work, const SinglePhotoChart& chart, const PhotoPriors& priors) {
  const double sigma = work.pose->eye_sigma_mm.z;
  if (!std::isfinite(sigma)) return;
  Work other = work;
  PhotoPriors farther = scaled(priors, work.averaged);
  farther.focal_px.reset();
  farther.distance_mm = {work.pose->eye_mm.z + sigma, 0.01};
  other.pose = find_pose(work.tags, chart, work.picture.width, work.picture.height, farther);
  if (!other.pose) return;
  other.fringes = collect_fringes(other.picture, *other.pose, chart);
  if (fit_phases(other, chart)) return;
  const LensPlane here = effective_plane(work), there = effective_plane(other);
  work.farther = {there.at - here.at - std::round(there.at - here.at), there.across - here.across,
                  there.down - here.down};
}

Refusal measure_phases(Work& work, const SinglePhotoChart& chart, const PhotoPriors& priors) {
  if (Refusal refusal = find_camera(work, chart, priors)) return refusal;
  if (Refusal refusal = evaluate_scale(work, chart)) return refusal;
  if (Refusal refusal = find_fringes(work, chart)) return refusal;
  if (Refusal refusal = fit_phases(work, chart)) return refusal;
  if (const auto problem = optics::find_problem(work.rig))
    return problem->key + " would be " + problem->cause;
  return std::nullopt;
}

Refusal measure(Work& work, const SinglePhotoChart& chart, const PhotoPriors& priors) {
  if (Refusal refusal = measure_phases(work, chart, priors)) return refusal;
  try_farther(work, chart, priors);
  return std::nullopt;
}

}  // namespace

PhotoFindings measure_photo(const CameraPicture& photograph, const SinglePhotoChart& chart,
                            const PhotoPriors& priors) {
  Work work;
  work.rig = chart.start;
  average_down(photograph, work);
  PhotoFindings out;
  out.refusal = measure_phases(work, chart, priors).value_or("");
  out.averaged = work.averaged;
  out.width = work.picture.width;
  out.height = work.picture.height;
  out.tags = std::move(work.tags);
  out.pose = work.pose;
  out.rig = std::move(work.rig);
  out.contrast = work.blocks.empty() ? 0.0 : median_contrast(work.blocks);
  out.blocks = std::move(work.blocks);
  out.columns = work.fringes.columns;
  out.rows = work.fringes.rows;
  out.covered = std::min(work.fringes.covered, 1.0);
  out.saturated = work.fringes.saturated;
  return out;
}

Calibration fit_single_photo(const CameraPicture& photograph, const SinglePhotoChart& chart,
                             const PhotoPriors& priors) {
  LENTICULE_CHECK(photograph.channels > 0 &&
                  photograph.light.size() == static_cast<size_t>(photograph.width) *
                                                 static_cast<size_t>(photograph.height) *
                                                 static_cast<size_t>(photograph.channels));
  const auto began = std::chrono::steady_clock::now();
  Calibration out;
  out.rig = chart.start;
  Work work;
  work.rig = chart.start;
  average_down(photograph, work);
  if (const Refusal refusal = measure(work, chart, priors)) {
    out.reasons = {*refusal};
  } else {
    add_findings(work, chart, priors, out);
  }
  add_camera(work, out);
  out.seconds_computing =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  return out;
}

}  // namespace lenticule::calib
