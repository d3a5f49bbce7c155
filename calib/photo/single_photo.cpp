// SPDX-License-Identifier: Apache-2.0
// A photograph is averaged down; its tags give the camera's place; the squares of one pixel show
// whether the chart was scaled; the spectrum of the fringes gives a first pitch and slant, and
// their phases, block by block, the exact ones and the shape of the sheet. Each step may refuse the
// photograph. The result states errors from the scatter of the blocks and from how well the picture
// determines the camera's distance, for which the fit is repeated from a little further away.
#include "calib/photo/single_photo.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <complex>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "base/statistics.h"
#include "calib/linear_algebra.h"
#include "optics/model.h"

namespace lenticule::calib {
namespace {

constexpr int kPlaneTerms = 3;
constexpr int kPlaceTerms = 10;
constexpr int kTerms = kPlaneTerms + kPlaceTerms;
constexpr size_t kLeastBlocks = 20;
using Row = Eigen::Matrix<double, 1, kTerms>;
using Normal = Eigen::Matrix<double, kTerms, kTerms>;
using Terms = Eigen::Matrix<double, kTerms, 1>;

/// Returns the coefficients of one block. More lenses mean fewer fringes, so the plane's terms are
/// negative. The terms of position are the additional fringes of a position error, proportional to
/// the band's detuning.
Row row_of(const FringeBlock& block) {
  const double x = block.x, y = block.y, d = block.detuning;
  Row row;
  row << -1.0, -x, -y, d, d * x, d * y, d * x * x, d * x * y, d * y * y, d * x * x * x,
      d * x * x * y, d * x * y * y, d * y * y * y;
  return row;
}

/// Sums each kind of band separately, because a position error rotates them differently.
std::map<double, std::complex<double>> sums_of(const std::vector<FringeBlock>& blocks,
                                               double across, double down) {
  std::map<double, std::complex<double>> sums;
  for (const FringeBlock& b : blocks) {
    const double cycles = b.phase + across * b.x + down * b.y;
    sums[b.detuning] += std::polar(b.weight, 2.0 * std::numbers::pi * cycles);
  }
  return sums;
}

double score(const std::vector<FringeBlock>& blocks, double across, double down) {
  double strength = 0.0;
  for (const auto& [detuning, sum] : sums_of(blocks, across, down)) strength += std::abs(sum);
  return strength;
}

double wrapped(double cycles) { return cycles - std::round(cycles); }

/// Returns the mean phase of all kinds of bands, each kind once. A position error moves the kinds
/// apart by less than half a cycle.
double mean_phase(const std::vector<FringeBlock>& blocks, const LensPlane& plane) {
  const auto sums = sums_of(blocks, plane.across, plane.down);
  if (sums.empty()) return 0.0;
  const auto cycles = [](const std::complex<double>& sum) {
    return std::arg(sum) / (2.0 * std::numbers::pi);
  };
  const double first = cycles(sums.begin()->second);
  double apart = 0.0;
  for (const auto& [detuning, sum] : sums) apart += wrapped(cycles(sum) - first);
  return first + apart / static_cast<double>(sums.size());
}

void refine(const std::vector<FringeBlock>& blocks, LensPlane& plane, double range, double step) {
  const LensPlane middle = plane;
  double best = -1.0;
  const int steps = static_cast<int>(std::lround(range / step));
  for (int j = -steps; j <= steps; ++j) {
    for (int i = -steps; i <= steps; ++i) {
      const double across = middle.across + i * step, down = middle.down + j * step;
      const double here = score(blocks, across, down);
      if (here <= best) continue;
      best = here;
      plane.across = across;
      plane.down = down;
    }
  }
}

/// Regression does steps of reweighted least squares.
class Regression {
 public:
  explicit Regression(const std::vector<FringeBlock>& blocks) : blocks_(blocks) {
    double sum = 0.0;
    for (const FringeBlock& b : blocks) sum += b.weight;
    for (const FringeBlock& b : blocks)
      weights_.push_back(b.weight * static_cast<double>(blocks.size()) / sum);
  }

  void step(double outlier_lenses) {
    normal_ = Normal::Zero();
    Terms right = Terms::Zero();
    for (size_t i = 0; i < blocks_.size(); ++i) {
      const double ratio = residual(i) / outlier_lenses;
      const double weight = weights_[i] / (1.0 + ratio * ratio);
      const Row row = row_of(blocks_[i]);
      normal_ += weight * row.transpose() * row;
      right += weight * residual(i) * row.transpose();
    }
    // Far weaker than a single block: only affects terms that no block determines.
    normal_.diagonal().array() += 1e-6;
    solution_ += solve_symmetric(normal_, right);
  }

  [[nodiscard]] double residual(size_t i) const {
    return wrapped(blocks_[i].phase - row_of(blocks_[i]).dot(solution_));
  }
  [[nodiscard]] double weight(size_t i) const { return weights_[i]; }
  [[nodiscard]] const Terms& solution() const { return solution_; }
  [[nodiscard]] Normal inverse() const { return inverse_of_symmetric(normal_); }

 private:
  const std::vector<FringeBlock>& blocks_;
  std::vector<double> weights_;
  Normal normal_ = Normal::Zero();
  Terms solution_ = Terms::Zero();
};

void summarize(const Regression& regression, PlaneCorrection& out) {
  // Four times the scatter of a normal distribution with this median.
  const double outlier = std::max(4.0 * 1.4826 * median_magnitude(out.residuals), 1e-4);
  double squares = 0.0, weights = 0.0;
  for (size_t i = 0; i < out.residuals.size(); ++i) {
    const double off = std::abs(out.residuals[i]);
    if (off > outlier) continue;
    ++out.used;
    squares += regression.weight(i) * off * off;
    weights += regression.weight(i);
    out.max_lenses = std::max(out.max_lenses, off);
  }
  out.rms_lenses = weights > 0.0 ? std::sqrt(squares / weights) : 0.0;
}

}  // namespace

LensPlane search_plane(const std::vector<FringeBlock>& blocks) {
  LensPlane plane;
  refine(blocks, plane, 1.6, 0.2);
  refine(blocks, plane, 0.2, 0.04);
  plane.at = -mean_phase(blocks, plane);
  return plane;
}

PlaneCorrection fit_plane(const std::vector<FringeBlock>& blocks) {
  PlaneCorrection out;
  out.residuals.assign(blocks.size(), 0.0);
  if (blocks.size() < kLeastBlocks) return out;
  constexpr double kOutlierLenses = 0.03;
  Regression regression(blocks);
  // The first steps use wide limits, so that with a start that is off by some tenths not all blocks
  // are outliers.
  for (const double wide : {10.0, 5.0, 3.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0})
    regression.step(wide * kOutlierLenses);
  for (size_t i = 0; i < blocks.size(); ++i) out.residuals[i] = regression.residual(i);
  summarize(regression, out);
  const Terms& solution = regression.solution();
  out.add = {solution[0], solution[1], solution[2]};
  const double freedom = std::max(out.used - kTerms, 1);
  Eigen::Map<Eigen::Matrix3d>(out.covariance.data()) =
      regression.inverse().topLeftCorner<kPlaneTerms, kPlaneTerms>() *
      (out.rms_lenses * out.rms_lenses * out.used / freedom);
  return out;
}

namespace {

constexpr int kColumns = 13;
constexpr int kRows = 8;
constexpr size_t kLeastMapBlocks = 100;
// Relative to the panel's width and height: about the distance of knots.
constexpr double kReachX = 0.06;
constexpr double kReachY = 0.09;

/// Returns the value at (x, y) of the plane through the surrounding blocks.
double smoothed(const std::vector<FringeBlock>& blocks, const std::vector<double>& residuals,
                double x, double y) {
  constexpr double kOutlierLenses = 0.03;
  Eigen::Vector3d plane = Eigen::Vector3d::Zero();
  for (int round = 0; round < 5; ++round) {
    Eigen::Matrix3d normal = 1e-9 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < blocks.size(); ++i) {
      const Eigen::Vector3d terms(1.0, (blocks[i].x - x) / kReachX, (blocks[i].y - y) / kReachY);
      const double off = (-residuals[i] - terms.dot(plane)) / kOutlierLenses;
      const double near = std::exp(-0.5 * (terms[1] * terms[1] + terms[2] * terms[2]));
      // No outlier is known in the first round.
      const double weight = near / (1.0 + (round > 0 ? off * off : 0.0));
      normal += weight * terms * terms.transpose();
      right -= weight * residuals[i] * terms;
    }
    plane = solve_symmetric(normal, right);
  }
  return plane[0];
}

}  // namespace

optics::ResidualMap smooth_map(const std::vector<FringeBlock>& blocks,
                               const std::vector<double>& residuals) {
  if (blocks.size() < kLeastMapBlocks) return {};
  optics::ResidualMap map{kColumns, kRows, {}};
  for (int r = 0; r < kRows; ++r)
    for (int c = 0; c < kColumns; ++c)
      map.lenses.push_back(
          smoothed(blocks, residuals, c / (kColumns - 1.0) - 0.5, r / (kRows - 1.0) - 0.5));
  return map;
}

optics::ResidualMap sum_of_maps(const optics::ResidualMap& a, const optics::ResidualMap& b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  optics::ResidualMap sum{std::max(a.columns, b.columns), std::max(a.rows, b.rows), {}};
  // The maps are evaluated on a panel with as many pixels as there are steps between knots.
  const int width = std::max(sum.columns - 1, 1), height = std::max(sum.rows - 1, 1);
  const optics::ResidualSpline first(a, width, height), second(b, width, height);
  for (int r = 0; r < sum.rows; ++r)
    for (int c = 0; c < sum.columns; ++c)
      sum.lenses.push_back(first.at(c, r).lenses + second.at(c, r).lenses);
  return sum;
}

PanelField residual_field(int columns, int rows, const std::vector<FringeBlock>& blocks,
                          const std::vector<double>& residuals) {
  PanelField field{columns, rows, {}};
  field.values.assign(static_cast<size_t>(columns) * static_cast<size_t>(rows),
                      std::numeric_limits<double>::quiet_NaN());
  if (residuals.size() == blocks.size())
    for (size_t k = 0; k < blocks.size(); ++k) field.values[blocks[k].block] = -residuals[k];
  return field;
}

namespace {

// Averages large photographs down, so that measuring takes at most a second.

/// AveragedPhoto is a photograph in which squares of pixels became one pixel each.
struct AveragedPhoto {
  PhotoLight light;
  int averaged = 1;  ///< side of the squares

  /// Scales priors, which refer to the photograph, to this picture.
  [[nodiscard]] PhotoPriors scaled(PhotoPriors priors) const {
    if (priors.focal_px) {
      priors.focal_px->value /= averaged;
      priors.focal_px->sigma /= averaged;
    }
    return priors;
  }
};

constexpr int kMostSide = 2600;

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

/// Returns a picture of at most 2600 pixels along its longer side.
AveragedPhoto average_down(const CameraPicture& photograph) {
  AveragedPhoto out;
  const int longer = std::max(photograph.width, photograph.height);
  out.averaged = std::max((longer + kMostSide - 1) / kMostSide, 1);
  PhotoLight& picture = out.light;
  picture.width = photograph.width / out.averaged;
  picture.height = photograph.height / out.averaged;
  const size_t count = static_cast<size_t>(picture.width) * static_cast<size_t>(picture.height);
  picture.light.reserve(count);
  picture.clipped.reserve(count);
  for (int j = 0; j < picture.height; ++j)
    for (int i = 0; i < picture.width; ++i)
      append_mean(photograph, i * out.averaged, j * out.averaged, out.averaged, picture);
  return out;
}

// Locates the camera of a photograph by the tags of the chart.

/// Refusal is the reason why a photograph cannot be used, or nothing.
using Refusal = std::optional<std::string>;

struct TaggedCamera {
  std::vector<TagSighting> tags;
  std::optional<PhotoPose> pose;
};

/// One of five tags may be hidden, and four of nine.
size_t least_tags(const SinglePhotoChart& chart) {
  return std::min<size_t>(chart.tags.size() - 1, 5);
}
constexpr double kMisplacedPx = 1.5;

/// Removes tags that are partly hidden: they are found, but at a wrong position.
std::vector<TagSighting> without_misplaced(const TaggedCamera& camera) {
  const double most = std::max(4.0 * upper_median(camera.pose->tag_off_px), kMisplacedPx);
  std::vector<TagSighting> kept;
  for (size_t i = 0; i < camera.tags.size(); ++i)
    if (camera.pose->tag_off_px[i] <= most) kept.push_back(camera.tags[i]);
  return kept;
}

/// Returns the part of the picture's longer side that the tags extend over.
double extent_of_tags(const AveragedPhoto& photo, const TaggedCamera& camera) {
  Vec2 least{1e9, 1e9}, most{-1e9, -1e9};
  for (const TagSighting& tag : camera.tags)
    for (const Vec2& corner : tag.corners_px) {
      least = {std::min(least.x, corner.x), std::min(least.y, corner.y)};
      most = {std::max(most.x, corner.x), std::max(most.y, corner.y)};
    }
  return std::max(most.x - least.x, most.y - least.y) /
         std::max(photo.light.width, photo.light.height);
}

/// Returns a refusal if the given camera data contradict the tags. Few pixels determine the camera
/// badly, so that a distance appears as another contradiction.
Refusal contradiction(const AveragedPhoto& photo, const TaggedCamera& camera,
                      const SinglePhotoChart& chart, const PhotoPriors& priors) {
  constexpr double kMostPull = 4.0, kLeastExtent = 0.3;
  const bool contradicts =
      camera.pose->axis_pull > kMostPull ||
      (priors.focal_px && priors.distance_mm && camera.pose->prior_pull > kMostPull);
  if (!contradicts) return std::nullopt;
  if (const double extent = extent_of_tags(photo, camera); extent < kLeastExtent)
    return fmt::format(
        "the chart takes only {:.0f} % of the picture's longer side: it was taken from "
        "too far away; go nearer",
        100.0 * extent);
  if (camera.pose->axis_pull > kMostPull) {
    const Vec2 off =
        (camera.pose->middle_px - Vec2{0.5 * photo.light.width, 0.5 * photo.light.height}) *
        photo.averaged;
    return fmt::format(
        "the camera's axis is {:.0f} pixels to the side and {:.0f} down from the middle of the "
        "picture: it was cropped; give the whole photograph",
        off.x, off.y);
  }
  const auto found_without = [&](auto forget) {
    PhotoPriors fewer = photo.scaled(priors);
    forget(fewer);
    return find_pose(camera.tags, chart, photo.light.width, photo.light.height, fewer);
  };
  const auto by_focal = found_without([](PhotoPriors& p) { p.distance_mm.reset(); });
  const auto by_distance = found_without([](PhotoPriors& p) { p.focal_px.reset(); });
  if (!by_focal || !by_distance) return "distance and focal length contradict the tags";
  return fmt::format(
      "distance and focal length contradict the picture: {:.0f} pixels of focal length give this "
      "picture of the tags from {:.0f} mm, not {:.0f} mm, and at that distance the focal length "
      "would be {:.0f} pixels; if both are right the panel's size in the rig is wrong by {:.0f} %",
      priors.focal_px->value, by_focal->eye_mm.z, priors.distance_mm->value,
      by_distance->focal_px * photo.averaged,
      100.0 * std::abs(by_focal->eye_mm.z / priors.distance_mm->value - 1.0));
}

Refusal place_camera(const AveragedPhoto& photo, const SinglePhotoChart& chart,
                     const PhotoPriors& priors, TaggedCamera& camera) {
  const auto try_tags = [&] {
    camera.pose =
        find_pose(camera.tags, chart, photo.light.width, photo.light.height, photo.scaled(priors));
  };
  try_tags();
  if (camera.pose) {
    const std::vector<TagSighting> kept = without_misplaced(camera);
    if (kept.size() >= least_tags(chart) && kept.size() < camera.tags.size()) {
      camera.tags = kept;
      try_tags();
    }
  }
  if (!camera.pose) return "the tags fit no place of a camera in front of the panel";
  if (Refusal refusal = contradiction(photo, camera, chart, priors)) return refusal;
  constexpr double kMostCornerPx = 3.0;
  if (camera.pose->corner_rms_px > kMostCornerPx)
    return fmt::format(
        "the tags deviate by {:.1f} pixels from a flat panel seen through a simple lens",
        camera.pose->corner_rms_px);
  return std::nullopt;
}

/// Returns true if tags of the chart appear when the picture is mirrored.
bool is_mirrored(const PhotoLight& picture, const SinglePhotoChart& chart) {
  PhotoLight mirrored{picture.width, picture.height, picture.light};
  for (int row = 0; row < mirrored.height; ++row) {
    const auto begin = mirrored.light.begin() + static_cast<ptrdiff_t>(row) * mirrored.width;
    std::reverse(begin, begin + mirrored.width);
  }
  const std::vector<TagSighting> tags = find_tags(mirrored, least_tags(chart));
  return std::ranges::count_if(tags, [&](const TagSighting& tag) {
           return chart.tag(tag.id) != nullptr;
         }) >= static_cast<ptrdiff_t>(least_tags(chart));
}

/// Finds tags and pose. Refuses photographs with too few tags, with tags of another rig's chart,
/// mirrored ones, and those whose tags contradict the priors or a flat panel; `camera` then has
/// the results until there.
Refusal locate_camera(const AveragedPhoto& photo, const SinglePhotoChart& chart,
                      const PhotoPriors& priors, TaggedCamera& camera) {
  camera.tags = find_tags(photo.light, chart.tags.size());
  const size_t foreign = std::erase_if(
      camera.tags, [&](const TagSighting& tag) { return chart.tag(tag.id) == nullptr; });
  if (camera.tags.size() >= least_tags(chart)) return place_camera(photo, chart, priors, camera);
  if (foreign >= least_tags(chart)) return "the chart in the photograph was made for another rig";
  if (is_mirrored(photo.light, chart))
    return "the photograph is mirrored: switch off the camera program's mirroring, or take the "
           "phone's back camera";
  return fmt::format(
      "only {} of {} tags were found: the panel is not completely in the picture, too small, or "
      "out of focus",
      camera.tags.size(), chart.tags.size());
}

// Fits pitch, slant, offset and residual map of the sheet to the fringes that one camera saw.

/// Largest residual of a sheet that counts as even.
constexpr double kEvenLenses = 0.02;

/// PlaneFit holds the steps of the fit; after a refusal those until there.
struct PlaneFit {
  FringeSamples fringes;
  FringeSums sums;  ///< made with a rig that is close to the present one
  optics::Rig rig;  ///< the rig known so far
  std::vector<FringeBlock> blocks;
  PlaneCorrection correction;
  double uneven_lenses = 0.0;  ///< residual before the sheet's shape was mapped

  /// Returns the fraction of the blocks that are outliers.
  [[nodiscard]] double left_out() const {
    if (blocks.empty()) return 1.0;
    return 1.0 - static_cast<double>(correction.used) / static_cast<double>(blocks.size());
  }
};

constexpr double kMostSaturated = 0.5;
constexpr double kLeastCovered = 0.5;
constexpr double kLeastContrast = 0.05;
constexpr double kMostRmsLenses = 0.05;
constexpr double kMostLeftOut = 0.2;

double median_contrast(const std::vector<FringeBlock>& blocks) {
  std::vector<double> values;
  for (const FringeBlock& block : blocks) values.push_back(block.contrast);
  return upper_median(std::move(values));
}

void improve(PlaneFit& fit, const LensPlane& add) {
  LensPlane plane = plane_of(fit.rig);
  plane.at += add.at;
  plane.across += add.across;
  plane.down += add.down;
  fit.rig = with_plane(fit.rig, plane);
}

/// Refines the plane in rounds: relative to a better plane, a block's own fringes are straighter.
void refine_plane(const SinglePhotoChart& chart, PlaneFit& fit) {
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    fit.blocks = measure_blocks(fit.sums, chart, fit.rig);
    fit.correction = fit_plane(fit.blocks);
    improve(fit, fit.correction.add);
  }
}

/// Counts the fringes: a first pitch and slant. Refuses photographs with clipped, missing or
/// invisible fringes.
Refusal locate_fringes(const SinglePhotoChart& chart, PlaneFit& fit) {
  if (fit.fringes.saturated > kMostSaturated)
    return fmt::format("{:.0f} % of the fringes are clipped: expose less",
                       100.0 * fit.fringes.saturated);
  if (fit.fringes.covered < kLeastCovered)
    return fmt::format("only {:.0f} % of the fringes are in the picture",
                       100.0 * fit.fringes.covered);
  const FringeCount count = count_fringes(fit.fringes, chart);
  if (count.prominence < kLeastProminence)
    return "no fringes were found: the picture is blurred, the sheet is not on the panel, or its "
           "pitch differs by more than a tenth from the rig's";
  LensPlane plane = plane_of(chart.start);
  plane.across += count.more_lenses.x;
  plane.down += count.more_lenses.y;
  fit.rig = with_plane(chart.start, plane);
  return std::nullopt;
}

/// Refuses a panel whose subpixels are not where the rig has them: the fringes of red and blue are
/// then ahead of those of green, everywhere alike. Refraction moves them by up to 0.02 lens.
Refusal contradicting_layout(const std::vector<FringeBlock>& blocks, const optics::Rig& rig) {
  constexpr double kMostLenses = 0.035;
  std::array<double, 3> ahead{};
  for (const size_t c : {size_t{0}, size_t{2}}) {
    std::complex<double> sum;
    for (const FringeBlock& b : blocks)
      sum += std::polar(b.weight, 2.0 * std::numbers::pi * (b.colour_phase[c] - b.colour_phase[1]));
    ahead[c] = std::arg(sum) / (2.0 * std::numbers::pi);
  }
  const auto place = [&](const optics::SubpixelLayout& layout, size_t c) {
    double sum = 0.0;
    for (const optics::PixelCell& cell : layout.table())
      sum += cell[c].x_px - cell[1].x_px + rig.sheet.slant * (cell[c].y_px - cell[1].y_px);
    return sum / static_cast<double>(layout.table().size());
  };
  const auto miss = [&](const optics::SubpixelLayout& layout) {
    double most = 0.0;
    for (const size_t c : {size_t{0}, size_t{2}}) {
      const double moved = place(layout, c) - place(rig.panel.layout, c);
      most = std::max(most, std::abs(wrapped(ahead[c] + 3.0 * moved / rig.sheet.pitch.value)));
    }
    return most;
  };
  double least = miss(rig.panel.layout);
  if (least <= kMostLenses) return std::nullopt;
  std::string fitting = "no usual layout fits: it may be PenTile";
  for (const char* name : {"rgb", "bgr", "vrgb", "vbgr"})
    if (const double one = miss(optics::SubpixelLayout::named(name)); one < 0.5 * least) {
      least = one;
      fitting = fmt::format("layout = \"{}\" fits to {:.3f}", name, one);
    }
  return fmt::format(
      "the panel's subpixels are not at the places of the rig's layout {}: the fringes of red and "
      "blue are {:.3f} and {:.3f} lens ahead of green's; {}",
      rig.panel.layout.name(), ahead[0], ahead[2], fitting);
}

/// Fits the phases of `fit.fringes`, starting at `fit.rig`. Refuses faint fringes and those that
/// fit no even sheet.
Refusal fit_phases(const SinglePhotoChart& chart, PlaneFit& fit) {
  fit.blocks = measure_blocks(sum_fringes(fit.fringes, chart, fit.rig), chart, fit.rig);
  improve(fit, search_plane(fit.blocks));
  fit.sums = sum_fringes(fit.fringes, chart, fit.rig);
  refine_plane(chart, fit);
  fit.uneven_lenses = fit.correction.max_lenses;
  // The next map captures the part that the previous map smoothed away.
  constexpr int kMaps = 3;
  for (int map = 0; map < kMaps && fit.correction.max_lenses > kEvenLenses; ++map) {
    fit.rig.sheet.residual =
        sum_of_maps(fit.rig.sheet.residual, smooth_map(fit.blocks, fit.correction.residuals));
    refine_plane(chart, fit);
  }
  if (median_contrast(fit.blocks) < kLeastContrast)
    return "the fringes are too faint: the picture is blurred or the room too bright";
  if (Refusal refusal = contradicting_layout(fit.blocks, fit.rig)) return refusal;
  if (fit.left_out() > kMostLeftOut || fit.blocks.size() < 20 ||
      fit.correction.rms_lenses > kMostRmsLenses)
    return fmt::format(
        "the fringes do not fit an even sheet (rms {:.3f} lenses in {} of {} blocks): the picture "
        "is out of focus, a lamp is reflected, or the sheet came loose",
        fit.correction.rms_lenses, fit.correction.used, fit.blocks.size());
  return std::nullopt;
}

// Computes a calibration, with standard errors and warnings, from the measurements of a single
// photograph.

/// PhotoMeasurement holds all intermediate results, so that a refusal can report the progress.
struct PhotoMeasurement {
  AveragedPhoto photo;
  TaggedCamera camera;
  PlaneFit sheet;
  /// Change of at, across and down if the camera was one standard error further away.
  LensPlane farther;
};

constexpr int kGreen = 1;

/// Returns the covariance of at, across and down from the scatter of the blocks and the camera's
/// distance.
Eigen::Matrix3d plane_covariance(const PhotoMeasurement& work) {
  const Eigen::Vector3d farther(work.farther.at, work.farther.across, work.farther.down);
  return Eigen::Map<const Eigen::Matrix3d>(work.sheet.correction.covariance.data()) +
         farther * farther.transpose();
}

/// Effective holds effective pitch, slant and offset with their correlations.
struct Effective {
  Estimate estimates[3]{};
  std::vector<std::vector<double>> correlations{};
};

/// Transforms the covariance of at, across and down to that of pitch, slant and offset.
Eigen::Matrix3d carried_over(const Eigen::Matrix3d& covariance, const LensPlane& plane,
                             const optics::Panel& panel) {
  const double shape = double(panel.width_px) / panel.height_px;
  const double pitch = 3.0 * panel.width_px / plane.across;
  const Eigen::Matrix3d slopes{
      {0.0, -pitch / plane.across, 0.0},
      {0.0, -plane.down * shape / (plane.across * plane.across), shape / plane.across},
      {1.0, 0.0, 0.0}};
  return slopes * covariance * slopes.transpose();
}

/// Returns the plane as the eye sees the sheet: over panel points, with the effective pitch as P
/// and the phase at the panel's centre as `at`.
LensPlane effective_plane(const optics::Rig& rig, const Vec3& eye_mm) {
  const optics::Panel& panel = rig.panel;
  LensPlane plane = plane_of(rig);
  const double wider = 1.0 + rig.sheet.gap.value / eye_mm.z;
  plane.across /= wider;
  plane.down /= wider;
  const optics::OpticalModel model(rig);
  plane.at = model.phase(0.5 * panel.width_px, 0.5 * panel.height_px, kGreen,
                         {eye_mm.x, eye_mm.y, eye_mm.z});
  return plane;
}

Effective effective_of(const PhotoMeasurement& work) {
  const LensPlane plane = effective_plane(work.sheet.rig, work.camera.pose->eye_mm);
  const optics::Panel& panel = work.sheet.rig.panel;
  const Eigen::Matrix3d covariance = carried_over(plane_covariance(work), plane, panel);
  const double values[3] = {3.0 * panel.width_px / plane.across, work.sheet.rig.sheet.slant,
                            plane.at - std::round(plane.at)};
  Effective out{.correlations = correlations_of(covariance)};
  for (int i = 0; i < 3; ++i) out.estimates[i] = {values[i], std::sqrt(covariance(i, i))};
  return out;
}

Viewpoint viewpoint_of(const PhotoMeasurement& work, const Effective& effective) {
  const PhotoPose& pose = *work.camera.pose;
  const PlaneFit& sheet = work.sheet;
  Viewpoint v;
  v.name = "photograph";
  v.eye_mm = pose.eye_mm;
  v.eye_sigma_mm = pose.eye_sigma_mm;
  v.tilt_degrees = pose.tilt_degrees;
  v.effective_pitch_subpx = effective.estimates[0];
  v.slant = effective.estimates[1];
  v.effective_offset_lenses = effective.estimates[2];
  v.contrast = median_contrast(sheet.blocks);
  v.covered = std::min(sheet.fringes.covered, 1.0);
  v.blocks = sheet.correction.used;
  v.rms_lenses = sheet.correction.rms_lenses;
  v.max_lenses = sheet.correction.max_lenses;
  v.reprojection_rms_px = pose.corner_rms_px * work.photo.averaged;
  v.residual = residual_field(sheet.fringes.columns, sheet.fringes.rows, sheet.blocks,
                              sheet.correction.residuals);
  return v;
}

/// Returns the variance of the phase at a panel point, for an eye at the estimated camera position,
/// that results from the uncertainty of this position.
double variance_of_place(const PhotoMeasurement& work, const optics::OpticalModel& model,
                         const std::array<double, 9>& eye_covariance, Vec2 panel_px) {
  const Vec3 e = work.camera.pose->eye_mm;
  const auto phase = [&](double x, double y, double z) {
    return model.phase(panel_px.x, panel_px.y, kGreen, {e.x + x, e.y + y, e.z + z});
  };
  const Eigen::Vector3d slopes(0.5 * (phase(1, 0, 0) - phase(-1, 0, 0)),
                               0.5 * (phase(0, 1, 0) - phase(0, -1, 0)),
                               0.5 * (phase(0, 0, 1) - phase(0, 0, -1)));
  return slopes.dot(Eigen::Map<const Eigen::Matrix3d>(eye_covariance.data()) * slopes);
}

/// Returns the drift for an eye at the measured place of the camera, since the result is valid only
/// there.
DriftPrediction drift_of(const PhotoMeasurement& work,
                         const std::array<double, 9>& eye_covariance) {
  const Eigen::Matrix3d covariance = plane_covariance(work);
  const optics::OpticalModel model(work.sheet.rig);
  DriftPrediction worst;
  worst.eye_mm = work.camera.pose->eye_mm;
  for (const double x : {-0.5, 0.5}) {
    for (const double y : {-0.5, 0.5}) {
      const Eigen::Vector3d corner(1.0, x, y);
      const optics::Panel& panel = work.sheet.rig.panel;
      const double variance =
          corner.dot(covariance * corner) +
          variance_of_place(work, model, eye_covariance,
                            {(x + 0.5) * panel.width_px, (y + 0.5) * panel.height_px});
      const double off = 2.0 * std::sqrt(std::max(variance, 0.0));
      if (off < worst.worst_lenses) continue;
      worst.worst_lenses = off;
      worst.panel_x_px = (x + 0.5) * work.sheet.rig.panel.width_px;
      worst.panel_y_px = (y + 0.5) * work.sheet.rig.panel.height_px;
    }
  }
  return worst;
}

/// Returns the largest change of a phase anywhere in the viewing zone if the gap is a tenth larger,
/// which looks the same from the place of the camera.
double lenses_of_gap(const PhotoMeasurement& work) {
  optics::Rig wider = work.sheet.rig;
  wider.sheet.gap.value *= 1.1;
  const optics::OpticalModel model(work.sheet.rig), other(wider);
  const Vec3 camera = work.camera.pose->eye_mm;
  const auto change = [&](Vec2 at, const Vec3& eye) {
    const optics::Eye from{eye.x, eye.y, eye.z};
    return other.phase(at.x, at.y, kGreen, from) - model.phase(at.x, at.y, kGreen, from);
  };
  double largest = 0.0;
  for (const Vec3& eye : zone_of(work.sheet.rig))
    for (const int x : {0, work.sheet.rig.panel.width_px})
      for (const int y : {0, work.sheet.rig.panel.height_px}) {
        const Vec2 at{double(x), double(y)};
        largest = std::max(largest, std::abs(change(at, eye) - change(at, camera)));
      }
  return largest;
}

void add_warnings(const PhotoMeasurement& work, const SinglePhotoChart& chart, bool confirmed,
                  Calibration& out) {
  const PlaneFit& sheet = work.sheet;
  const PhotoPose& pose = *work.camera.pose;
  if (work.camera.tags.size() < chart.tags.size())
    out.warnings.push_back(
        fmt::format("{} of {} tags were found", work.camera.tags.size(), chart.tags.size()));
  if (sheet.uneven_lenses > kEvenLenses)
    out.warnings.push_back(
        fmt::format("the sheet is not even: up to {:.3f} lenses, which the rig's map corrects for "
                    "this eye; {:.3f} remain",
                    sheet.uneven_lenses, sheet.correction.max_lenses));
  const size_t outliers = sheet.blocks.size() - static_cast<size_t>(sheet.correction.used);
  if (20 * outliers > sheet.blocks.size())
    out.warnings.push_back(fmt::format("{} of {} blocks did not fit and were left out", outliers,
                                       sheet.blocks.size()));
  if (const double sigma = pose.eye_sigma_mm.z; sigma > 0.03 * pose.eye_mm.z)
    out.warnings.push_back(
        fmt::format("the distance of the camera is known only to {:.0f} mm: straight ahead, focal "
                    "length and distance cannot be separated",
                    sigma));
  if (!sheet.fringes.squares)
    out.warnings.emplace_back(
        "photograph: too small to check whether the chart was shown pixel by pixel; take it nearer "
        "to the panel");
  out.warnings.push_back(fmt::format(
      "phases are certain to {:.2f} lens for an eye at the camera's place, to {:.2f} there if the "
      "picture was cropped, and to {:.1f} anywhere in the viewing zone, since one photograph does "
      "not show the gap: take three more from other places{}",
      out.at_camera_lenses, std::max(out.at_camera_lenses, out.drift.worst_lenses),
      std::hypot(out.at_camera_lenses, lenses_of_gap(work)),
      confirmed ? "" : ", or give both --distance and --focal-px"));
}

/// Adds rig, viewpoint, parameters, drift, verdict and warnings of a photograph that is not
/// refused.
void add_findings(const PhotoMeasurement& work, const SinglePhotoChart& chart,
                  const PhotoPriors& priors, Calibration& out) {
  const Effective effective = effective_of(work);
  const Vec3 eye = work.camera.pose->eye_mm;
  out.rig = work.sheet.rig;
  double& offset = out.rig.sheet.offset.value;
  offset -= std::round(offset);
  out.rig.viewing = {Millimetres(eye.y), Millimetres(eye.z)};
  out.viewpoints = {viewpoint_of(work, effective)};
  out.parameters = {{"effective_pitch_subpx", "subpixels", effective.estimates[0]},
                    {"slant", "px/px", effective.estimates[1]},
                    {"effective_offset_lenses", "lenses", effective.estimates[2]}};
  out.correlations = effective.correlations;
  out.drift = drift_of(work, work.camera.pose->doubted_eye);
  // 95 of 100 simulated phones are within 2.5 standard errors: a warp is no normal error.
  out.at_camera_lenses = 1.25 * drift_of(work, work.camera.pose->uncropped_eye).worst_lenses;
  out.verdict = Verdict::Effective;
  out.reasons = {
      "one photograph determines pitch and offset only for its place; the gap is that of the "
      "starting rig"};
  add_warnings(work, chart, priors.focal_px && priors.distance_mm, out);
}

/// Adds the known values of the camera, also for a refusal.
void add_camera(const PhotoMeasurement& work, Calibration& out) {
  if (!work.camera.pose) return;
  const PhotoPose& pose = *work.camera.pose;
  const double averaged = work.photo.averaged;
  out.camera = {pose.focal_px * averaged, pose.middle_px.x * averaged, pose.middle_px.y * averaged,
                -pose.distortion, 0.0};
}

/// Refuses scaled pictures. Scaling smears squares of one pixel to less light than they have. It
/// also scales the fringes, so that the fitted pitch would belong to another size.
Refusal evaluate_scale(const FringeSamples& fringes) {
  constexpr double kLeastSquares = 0.8;
  if (!fringes.squares || *fringes.squares >= kLeastSquares) return std::nullopt;
  return fmt::format(
      "the chart was scaled before it was displayed: its squares of one pixel have {:.0f} % of the "
      "expected light; show it pixel by pixel",
      100.0 * *fringes.squares);
}

/// Repeats the fit for a camera that was further away: the sheet bends light more at a small
/// distance, and a photograph from straight ahead does not determine its own distance.
void try_farther(PhotoMeasurement& work, const SinglePhotoChart& chart, const PhotoPriors& priors) {
  const PhotoLight& picture = work.photo.light;
  const PhotoPose& pose = *work.camera.pose;
  const double sigma = pose.eye_sigma_mm.z;
  if (!std::isfinite(sigma)) return;
  PhotoPriors farther = work.photo.scaled(priors);
  farther.focal_px.reset();
  farther.distance_mm = {pose.eye_mm.z + sigma, 0.01};
  const std::optional<PhotoPose> other =
      find_pose(work.camera.tags, chart, picture.width, picture.height, farther);
  if (!other) return;
  PlaneFit sheet = work.sheet;
  sheet.fringes = collect_fringes(picture, *other, chart);
  if (fit_phases(chart, sheet)) return;
  const LensPlane here = effective_plane(work.sheet.rig, pose.eye_mm);
  const LensPlane there = effective_plane(sheet.rig, other->eye_mm);
  work.farther = {there.at - here.at - std::round(there.at - here.at), there.across - here.across,
                  there.down - here.down};
}

Refusal measure_phases(PhotoMeasurement& work, const SinglePhotoChart& chart,
                       const PhotoPriors& priors) {
  if (Refusal refusal = locate_camera(work.photo, chart, priors, work.camera)) return refusal;
  work.sheet.fringes = collect_fringes(work.photo.light, *work.camera.pose, chart);
  if (Refusal refusal = evaluate_scale(work.sheet.fringes)) return refusal;
  if (Refusal refusal = locate_fringes(chart, work.sheet)) return refusal;
  if (Refusal refusal = fit_phases(chart, work.sheet)) return refusal;
  if (const auto problem = optics::find_problem(work.sheet.rig))
    return problem->key + " would be " + problem->cause;
  return std::nullopt;
}

}  // namespace

PhotoFindings measure_photo(const CameraPicture& photograph, const SinglePhotoChart& chart,
                            const PhotoPriors& priors, bool only_tags) {
  PhotoMeasurement work;
  work.photo = average_down(photograph);
  work.sheet.rig = chart.start;
  PhotoFindings out;
  const Refusal refusal = only_tags ? locate_camera(work.photo, chart, priors, work.camera)
                                    : measure_phases(work, chart, priors);
  out.refusal = refusal.value_or("");
  out.averaged = work.photo.averaged;
  out.width = work.photo.light.width;
  out.height = work.photo.light.height;
  out.tags = std::move(work.camera.tags);
  out.pose = work.camera.pose;
  out.rig = std::move(work.sheet.rig);
  out.contrast = work.sheet.blocks.empty() ? 0.0 : median_contrast(work.sheet.blocks);
  out.blocks = std::move(work.sheet.blocks);
  out.columns = work.sheet.fringes.columns;
  out.rows = work.sheet.fringes.rows;
  out.covered = std::min(work.sheet.fringes.covered, 1.0);
  out.saturated = work.sheet.fringes.saturated;
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
  PhotoMeasurement work;
  work.photo = average_down(photograph);
  work.sheet.rig = chart.start;
  if (const Refusal refusal = measure_phases(work, chart, priors)) {
    out.reasons = {*refusal};
  } else {
    try_farther(work, chart, priors);
    add_findings(work, chart, priors, out);
  }
  add_camera(work, out);
  out.seconds_computing =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  return out;
}

}  // namespace lenticule::calib
