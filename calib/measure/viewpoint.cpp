// SPDX-License-Identifier: Apache-2.0
// A place is measured in this order: marks and visible pixels; the panel point of each pixel, from
// wide waves; the pitch of the lenses, from fringes at the starting pitch and its multiples; the
// colours of panel and link; the phases of the fringes of each colour at the found pitch; the light
// under a lens, from combs; and green's fringes once more, which shows whether something moved.
// docs/panel/calibration-method.md explains each pattern.
#include "calib/measure/viewpoint.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/error.h"
#include "calib/measure/frame_marks.h"
#include "optics/panel.h"

namespace lenticule::calib {
namespace {

/// Intact links leak well below 2 %; chroma subsampling leaks 20 % and more.
constexpr double kMostLeak = 0.08;
/// Half of the pixels lit give half of the light; scaling mixes codes, whose mean is much darker.
constexpr double kMostImbalance = 0.08;

double total(const MeanColour& colour) { return colour[0] + colour[1] + colour[2]; }

/// Returns the light of the panel's channels that gives the camera's channels.
Eigen::Vector3d panel_light(const LinkPictures& pictures, const MeanColour& seen) {
  Eigen::Matrix3d response;
  for (int d = 0; d < 3; ++d)
    for (int c = 0; c < 3; ++c)
      response(c, d) = pictures.flat[static_cast<size_t>(d)][static_cast<size_t>(c)];
  return response.colPivHouseholderQr().solve(Eigen::Vector3d(seen[0], seen[1], seen[2]));
}

/// Returns the light in the two channels that should be dark, relative to the lit channel.
double leak_of(const LinkPictures& pictures, int channel) {
  const Eigen::Vector3d light =
      panel_light(pictures, pictures.columns[static_cast<size_t>(channel)]);
  double others = 0.0;
  for (int d = 0; d < 3; ++d)
    if (d != channel) others += std::abs(light[d]);
  return light[channel] > 0.0 ? others / light[channel] : 1.0;
}

}  // namespace

MeanColour mean_colour(const CameraPicture& picture, const CameraPicture& dark,
                       const std::vector<uint32_t>& pixels) {
  MeanColour sum{};
  const auto channels = static_cast<size_t>(picture.channels);
  for (const uint32_t i : pixels)
    for (size_t c = 0; c < 3; ++c) {
      const size_t at = i * channels + std::min(c, channels - 1);
      sum[c] += double{picture.light[at]} - double{dark.light[at]};
    }
  for (double& s : sum) s /= static_cast<double>(std::max<size_t>(1, pixels.size()));
  return sum;
}

ChannelWeights weights_for(const LinkPictures& pictures, int panel_channel) {
  const MeanColour& seen = pictures.flat[static_cast<size_t>(panel_channel)];
  const double sum = std::max(seen[0], 0.0) + std::max(seen[1], 0.0) + std::max(seen[2], 0.0);
  if (pictures.camera_channels != 3 || !(sum > 0.0)) return kEqualWeights;
  ChannelWeights weights{};
  for (size_t c = 0; c < 3; ++c) weights[c] = static_cast<float>(std::max(seen[c], 0.0) / sum);
  return weights;
}

LinkCheck check_link(const LinkPictures& pictures) {
  LinkCheck check;
  double worst_half = 0.0;
  for (int d = 0; d < 3; ++d) {
    const auto k = static_cast<size_t>(d);
    const double half = total(pictures.columns[k]) / std::max(total(pictures.flat[k]), 1e-9);
    worst_half = std::max(worst_half, std::abs(half - 0.5));
    if (pictures.camera_channels == 3)
      check.chroma_leak = std::max(check.chroma_leak, leak_of(pictures, d));
  }
  check.chroma_subsampled = check.chroma_leak > kMostLeak || worst_half > 2.0 * kMostImbalance;
  if (check.chroma_subsampled)
    check.findings.push_back(fmt::format(
        "The link does not transmit the colour of every pixel (4:2:0 or 4:2:2): columns of one "
        "colour leak {:.0f} % into the others. Set the output to RGB or 4:4:4 at full range.",
        100.0 * check.chroma_leak));
  const double checks = total(pictures.checks) / std::max(total(pictures.white), 1e-9);
  check.scaled = std::abs(checks - 0.5) > kMostImbalance && !check.chroma_subsampled;
  if (check.scaled)
    check.findings.push_back(fmt::format(
        "Squares of one pixel give {:.0f} % of white light instead of 50 %: the panel scales or "
        "sharpens the picture. Use its own resolution and switch its picture processing off.",
        100.0 * checks));
  return check;
}

namespace {

// The patterns of a viewpoint, in their order.

/// Numbers of phase steps of the fringes: at the starting pitch, at its multiples, for the phases
/// of each colour, and for green's repetition at the end.
constexpr int kCoarseSteps = 8, kAliasSteps = 4, kFineSteps = 8, kRepeatSteps = 4;
constexpr int kSpotBins = 16;  ///< combs for the lens spot
/// Green comes first: its line is kept, and the longer the time until green is repeated, the more
/// of a drift is detected.
constexpr std::array<int, 3> kChannelOrder = {1, 2, 0};

/// Returns the levels of the wide waves along one axis.
std::array<WaveLevel, 3> levels_of(const optics::Rig& rig, bool vertical) {
  return wave_levels(vertical ? rig.panel.height_px : rig.panel.width_px,
                     rig.sheet.pitch.value / 3.0);
}

/// Returns the first patterns: the dark panel with marks 0, 1 and 2, and the white panel.
std::vector<Pattern> locating_patterns() {
  std::vector<Pattern> patterns;
  for (int mark = 0; mark < 3; ++mark)
    patterns.push_back({.shape = Flat{}, .channels = {}, .mark = mark});
  patterns.push_back({.shape = Flat{{1.0, 1.0, 1.0}}, .channels = {}, .mark = 3});
  return patterns;
}

}  // namespace

int pattern_count(const MeasureOptions& options) {
  const int geometry = 2 * (4 + 4 + 8);
  const int aliases = options.adaptive ? 2 * kAliasSteps : 0;
  const int link_and_spot = options.link_and_spot ? 4 + kSpotBins : 0;
  return 4 + geometry + kCoarseSteps + aliases + 3 + link_and_spot + 3 * kFineSteps + kRepeatSteps;
}

std::vector<Pattern> photo_patterns(const optics::Rig& start) {
  std::vector<Pattern> patterns = locating_patterns();
  const auto step = [&](auto shape, int steps, Channels channels) {
    for (const double phase : phase_steps(steps)) {
      shape.phase = phase;
      patterns.push_back({.shape = shape, .channels = channels});
    }
  };
  for (const bool vertical : {false, true})
    for (const WaveLevel& level : levels_of(start, vertical))
      step(Wave{.vertical = vertical, .period_px = level.period_px, .phase = 0.0}, level.steps, {});
  const Fringe fringe{.pitch_subpx = optics::effective_sheet(start).pitch.value,
                      .slant = start.sheet.slant,
                      .phase = 0.0};
  step(fringe, kCoarseSteps, {});
  for (int c = 0; c < 3; ++c)
    patterns.push_back({.shape = Flat{{1.0, 1.0, 1.0}}, .channels = Channels::only(c)});
  for (const int c : kChannelOrder) step(fringe, kFineSteps, Channels::only(c));
  step(fringe, kRepeatSteps, Channels::only(1));
  const RigCode code(optics::fingerprint(start));
  for (size_t n = 0; n < patterns.size(); ++n) {
    patterns[n].mark = static_cast<int>(n) % kMarkCounts;
    patterns[n].code = code.of_pattern(n);
  }
  return patterns;
}

namespace {

// The pixels that see the panel, and their panel points.

/// PictureBlocks divides a camera's picture into squares.
struct PictureBlocks {
  int width = 0;  ///< size of the picture
  int height = 0;
  int side_px = 16;
};

/// DecodedPixels holds camera pixels, as indices into their picture, and the decoded panel point of
/// each; NaN where it could not be decoded.
struct DecodedPixels {
  std::vector<uint32_t> pixels;
  std::vector<float> x;
  std::vector<float> y;
};

/// SeenPixels holds pixels that see the panel, and their points on the smooth map.
struct SeenPixels {
  DecodedPixels decoded;
  std::vector<Vec2> panel_points;
};

/// Returns the means over the blocks of which at least a third was decoded.
std::vector<Sighting> mean_sightings(const DecodedPixels& decoded, const PictureBlocks& blocks) {
  const auto& [pixels, x, y] = decoded;
  const auto& [width, height, side_px] = blocks;
  const int columns = (width + side_px - 1) / side_px;
  const int rows = (height + side_px - 1) / side_px;
  std::vector<std::vector<Sighting>> members(static_cast<size_t>(columns) *
                                             static_cast<size_t>(rows));
  for (size_t n = 0; n < pixels.size(); ++n) {
    if (std::isnan(x[n]) || std::isnan(y[n])) continue;
    const int i = static_cast<int>(pixels[n]) % width;
    const int j = static_cast<int>(pixels[n]) / width;
    members[static_cast<size_t>(j / side_px) * static_cast<size_t>(columns) +
            static_cast<size_t>(i / side_px)]
        .push_back({.camera_px = {i + 0.5, j + 0.5}, .panel_px = {x[n], y[n]}});
  }
  std::vector<Sighting> sightings;
  for (const std::vector<Sighting>& block : members) {
    if (static_cast<int>(block.size()) < side_px * side_px / 3) continue;
    Sighting mean{.camera_px = {}, .panel_px = {}};
    for (const Sighting& s : block) {
      mean.camera_px = mean.camera_px + s.camera_px;
      mean.panel_px = mean.panel_px + s.panel_px;
    }
    const double share = 1.0 / static_cast<double>(block.size());
    mean.camera_px = mean.camera_px * share;
    mean.panel_px = mean.panel_px * share;
    sightings.push_back(mean);
  }
  return sightings;
}

/// Returns the pixels near their points on the map and inside the panel, without those that see the
/// marks. `lens_px` is the width of a lens in panel pixels.
SeenPixels pixels_near_map(const DecodedPixels& decoded, const PictureBlocks& blocks,
                           const PanelMap& map, const optics::Panel& panel, double lens_px,
                           const MarkCells& marks) {
  const auto& [pixels, x, y] = decoded;
  // A pixel sees, through its lens, up to half a lens beside the smooth map, and more because of
  // noise.
  const double limit = std::max(3.0, 1.2 * lens_px) + 6.0 * map.typical_error_px();
  SeenPixels kept;
  for (size_t n = 0; n < pixels.size(); ++n) {
    const Vec2 camera{static_cast<int>(pixels[n]) % blocks.width + 0.5,
                      static_cast<int>(pixels[n]) / blocks.width + 0.5};
    const Vec2 p = map.at(camera);
    const bool near = std::abs(p.x - x[n]) < limit && std::abs(p.y - y[n]) < limit;
    const bool inside = p.x > 0.0 && p.y > 0.0 && p.x < panel.width_px && p.y < panel.height_px;
    if (!near || !inside || marks.covers(p.x, p.y)) continue;
    kept.decoded.pixels.push_back(pixels[n]);
    kept.decoded.x.push_back(x[n]);
    kept.decoded.y.push_back(y[n]);
    kept.panel_points.push_back(p);
  }
  return kept;
}

// The search of the pitch.

/// Fraction of the light that waves or fringes must modulate.
constexpr double kLeastModulation = 0.03;

constexpr int kMostMultiple = 3;  ///< largest multiple of the starting pitch that is tried
/// Largest error of the starting pitch, relative to the number of lenses across the panel.
constexpr double kCaptureRange = 0.13;
constexpr double kLeastCoherent =
    0.12;                           ///< fraction of the fringes' light that one phase must explain
constexpr double kLeastLead = 2.0;  ///< ratio to the next best phase
constexpr double kAliasPart =
    0.4;  ///< fraction of the first pattern's coherence, at a multiple of its pitch

/// Pitches to try when the starting one shows no fringes, as multiples of it.
constexpr std::array<double, 5> kOtherPitches = {1.0, 0.5, 2.0, 1.0 / 3.0, 3.0};

LinearPhase phase_for(double pitch, double slant) {
  return {.constant = 0.0, .per_px_x = 3.0 / pitch, .per_px_y = 3.0 * slant / pitch};
}

/// Fringes are the waves of a fringe pattern in camera pixels.
struct Fringes {
  Fringe fringe;
  std::vector<Complex> waves;
  double contrast = 0.0;
};

struct FoundFringes {
  Fringes fringes;
  FringePeak peak;
};

/// Returns the profile's standard deviation about its middle, above its floor.
double sigma_of(const std::vector<double>& profile, double floor) {
  const auto bins = static_cast<double>(profile.size());
  double sum = 0.0, square = 0.0;
  for (size_t b = 0; b < profile.size(); ++b) {
    const double place = (static_cast<double>(b) + 0.5) / bins - 0.5;
    const double light = std::max(0.0, profile[b] - floor);
    sum += light;
    square += light * place * place;
  }
  // The comb itself is one bin wide.
  const double comb = 1.0 / (12.0 * bins * bins);
  return sum > 0.0 ? std::sqrt(std::max(square / sum - comb, 0.25 * comb)) : 0.0;
}

/// Returns the crosstalk for an eye in the middle of one of two views: the light of the other view
/// divided by the light of its own.
double two_view_crosstalk(const std::vector<double>& profile) {
  const size_t bins = profile.size();
  double own = 0.0, other = 0.0;
  for (size_t b = 0; b < bins; ++b) {
    const double place = (static_cast<double>(b) + 0.5) / static_cast<double>(bins) - 0.5;
    (std::abs(place) < 0.25 ? own : other) += profile[b];
  }
  return own > 0.0 ? other / own : 1.0;
}

/// SpotSum measures the sharpness of lenses: the light seen while only one place under each lens is
/// lit, place after place.
class SpotSum {
 public:
  /// Takes `blocks`, the deviation of each part of the panel from the straight phase of the combs.
  ///
  /// Lifetime: `blocks` must outlive the sum.
  SpotSum(int bins, const BlockGrid& blocks, const LinearPhase& drawn, const optics::Panel& panel)
      : blocks_(blocks), profile_(static_cast<size_t>(bins)) {
    for (const PhaseBlock& block : blocks.blocks)
      shifts_.push_back((block.phase - drawn.at(block.panel_px, panel)) * bins);
  }

  /// Adds the picture of the comb at bin (b + 1/2) / bins - 1/2.
  void add(int bin, const GreyPicture& picture, const GreyPicture& dark,
           const std::vector<uint32_t>& pixels, int block_px) {
    const auto bins = static_cast<int>(profile_.size());
    for (const uint32_t pixel : pixels) {
      const int x = static_cast<int>(pixel) % picture.width / block_px;
      const int y = static_cast<int>(pixel) / picture.width / block_px;
      const auto n = static_cast<size_t>(y * blocks_.columns + x);
      if (blocks_.blocks[n].pixels == 0) continue;
      // A block whose phase is larger than the drawn one shows this bin at a larger place.
      const double at = bin + shifts_[n];
      const double whole = std::floor(at);
      const double light = double{picture.light[pixel]} - double{dark.light[pixel]};
      const int first = ((static_cast<int>(whole) % bins) + bins) % bins;
      profile_[static_cast<size_t>(first)] += light * (1.0 - (at - whole));
      profile_[static_cast<size_t>((first + 1) % bins)] += light * (at - whole);
    }
  }

  [[nodiscard]] LensSpot result() const {
    LensSpot spot;
    const double all = std::accumulate(profile_.begin(), profile_.end(), 0.0);
    if (!(all > 0.0)) return spot;
    for (const double light : profile_) spot.profile.push_back(light / all);
    const double floor = std::max(0.0, *std::min_element(spot.profile.begin(), spot.profile.end()));
    spot.veiling_glare = floor * static_cast<double>(spot.profile.size());
    spot.sigma_lenses = sigma_of(spot.profile, floor);
    spot.two_view_crosstalk = two_view_crosstalk(spot.profile);
    return spot;
  }

 private:
  const BlockGrid& blocks_;
  std::vector<double> shifts_;  ///< shift of each block, bins
  std::vector<double> profile_;
};

constexpr int kBlocksAcross = 80;     ///< blocks across the picture
constexpr double kLeastPart = 0.02;   ///< fraction of the camera's picture that shows the panel
constexpr double kFineFringes = 8.0;  ///< fringes across the panel: enough to average drift

/// Returns the coherence of the light in all blocks.
double coherence_of(const BlockGrid& grid) {
  double coherent = 0.0, all = 0.0;
  for (const PhaseBlock& block : grid.blocks) {
    const double light = block.strength * block.pixels;
    coherent += light * block.coherence;
    all += light;
  }
  return all > 0.0 ? coherent / all : 0.0;
}

class ViewpointRun {
 public:
  ViewpointRun(frames::FrameSink& sink, Camera& camera, const optics::OpticalModel& start,
               const CaptureOptions& capture, const MeasureOptions& options,
               const CaptureProgress& progress)
      : start_(start),
        panel_(start.rig().panel),
        options_(options),
        rig_code_(optics::fingerprint(start.rig())),
        capture_(sink, camera, panel_, named(capture, options), progress) {
    if (!options.adaptive) capture_.show_code(rig_code_);
  }

  ViewpointMeasurement run() {
    result_.name = options_.name;
    try {
      measure();
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::Quality) check_moves();
      throw;
    }
    result_.counts = capture_.counts();
    result_.doubles = capture_.doubles();
    if (!options_.adaptive) result_.mark_moves = capture_.moves();
    return std::move(result_);
  }

 private:
  static CaptureOptions named(CaptureOptions capture, const MeasureOptions& options) {
    capture.place = options.name;
    capture.patterns = pattern_count(options);
    return capture;
  }

  void measure() {
    find_panel();
    decode_geometry();
    find_pitch();
    measure_colours();
    measure_fringes();
    if (options_.link_and_spot) measure_spot();
    repeat();
    check_rig();
  }

  [[noreturn]] void fail(const std::string& cause, const std::string& remedy) const {
    const std::string where = options_.adaptive ? "calibrate" : options_.name;
    throw Error(ErrorKind::Quality, where + ": " + cause, remedy);
  }

  /// Throws if photographs could not be measured because the camera was moved between them.
  void check_moves() const {
    if (options_.adaptive) return;
    if (const std::optional<MarkStep> step = find_step(capture_.moves()))
      fail(moved_between(step->picture) + ", or the panel did", "photograph this place again");
  }

  /// Shows phase-stepped versions of a pattern and sums them over the measured pixels.
  template <class Shape>
  PhaseSum step_phases(Shape shape, int steps, Channels channels, const ChannelWeights& weights) {
    std::vector<Pattern> patterns;
    for (const double phase : phase_steps(steps)) {
      shape.phase = phase;
      patterns.push_back({.shape = shape, .channels = channels});
    }
    PhaseSum sum(pixels_.size(), steps);
    capture_.capture(patterns, [&](const Pattern& pattern, const CameraPicture& picture) {
      sum.add(grey_of(picture, weights), pixels_, std::get<Shape>(pattern.shape).phase);
    });
    return sum;
  }

  std::vector<CameraPicture> show_all(const std::vector<Pattern>& patterns) {
    std::vector<CameraPicture> pictures;
    capture_.capture(patterns, [&](const Pattern&, const CameraPicture& picture) {
      pictures.push_back(picture);
    });
    return pictures;
  }

  void find_panel() {
    std::vector<CameraPicture> pictures = show_all(locating_patterns());
    std::array<GreyPicture, 3> marks = {grey_of(pictures[0]), grey_of(pictures[1]),
                                        grey_of(pictures[2])};
    white_ = grey_of(pictures[3]);
    result_.width = white_.width;
    result_.height = white_.height;
    block_px_ = std::max(4, white_.width / kBlocksAcross);
    pixels_ = visible_pixels(marks[0], white_);
    result_.white_light = mean_of(white_, pixels_) - mean_of(marks[0], pixels_);
    if (part_of(pixels_, white_) < kLeastPart)
      fail("the camera sees no panel that changes from dark to white",
           "point it at the whole panel, and darken the room");
    std::optional<MarkReader> reader = MarkReader::find(marks, white_);
    if (!reader)
      fail("the marks in the panel's middle are not seen",
           options_.adaptive
               ? "check that the panel is in focus and nothing hides its middle"
               : "check that the panel is in focus, nothing hides its middle, and the first four "
                 "photographs show the first four patterns");
    capture_.check_marks(std::move(*reader));
    dark_ = std::move(marks[0]);
    dark_colour_ = std::move(pictures[0]);
    white_colour_ = std::move(pictures[3]);
  }

  /// Checks the rig code. Photographs are valid only if they show the patterns of the calibrated
  /// rig: patterns of another pitch would give another pitch as the result.
  void check_rig() {
    if (options_.adaptive) return;
    const RigCodeReadings& codes = capture_.codes();
    result_.rig_code_read = codes.read() > 0;
    check_codes(codes, rig_code_, options_.name);
  }

  void decode_geometry() {
    std::array<std::vector<float>, 2> positions;
    for (const bool vertical : {false, true}) {
      const auto levels = levels_of(start_.rig(), vertical);
      const auto sum_of = [&](const WaveLevel& level) {
        return step_phases(Wave{.vertical = vertical, .period_px = level.period_px, .phase = 0.0},
                           level.steps, Channels{}, kEqualWeights);
      };
      const PhaseSum first = sum_of(levels[0]);
      const PhaseSum second = sum_of(levels[1]);
      const std::array<PhaseSum, 3> sums = {first, second, sum_of(levels[2])};
      const double white = mean_of(white_, pixels_) - mean_of(dark_, pixels_);
      positions[vertical ? 1 : 0] =
          decode_positions(levels, sums, static_cast<float>(kLeastModulation * white));
    }
    check_rig();  // first, because another rig's waves would be decoded to wrong positions
    const PictureBlocks blocks{result_.width, result_.height, block_px_};
    const DecodedPixels decoded{std::move(pixels_), std::move(positions[0]),
                                std::move(positions[1])};
    map_ = PanelMap::fit(mean_sightings(decoded, blocks));
    if (!map_)
      fail("the panel points in the camera's picture cannot be decoded",
           "check that the panel is sharp in the camera's picture and nothing covers it");
    SeenPixels seen =
        pixels_near_map(decoded, blocks, *map_, panel_, start_.rig().sheet.pitch.value / 3.0,
                        MarkCells::of(panel_, !options_.adaptive));
    if (static_cast<double>(seen.panel_points.size()) <
        0.3 * static_cast<double>(decoded.pixels.size()))
      fail("most panel points that the camera sees contradict each other",
           "check whether the camera moves, or the sheet has reflections");
    for (const Sighting& s : mean_sightings(seen.decoded, blocks))
      result_.geometry.push_back({.camera_px = s.camera_px,
                                  .panel_px = s.panel_px,
                                  .sigma_px = std::max(0.02, map_->typical_error_px())});
    pixels_ = std::move(seen.decoded.pixels);
    panel_points_ = std::move(seen.panel_points);
  }

  [[nodiscard]] Fringes show_fringes(double pitch, double slant, int steps, Channels channels = {},
                                     const ChannelWeights& weights = kEqualWeights) {
    const Fringe fringe{.pitch_subpx = pitch, .slant = slant, .phase = 0.0};
    const PhaseSum sum = step_phases(fringe, steps, channels, weights);
    Fringes fringes{.fringe = fringe, .waves = sum.waves(), .contrast = 0.0};
    double wave = 0.0, mean = 0.0;
    for (size_t n = 0; n < fringes.waves.size(); ++n) {
      wave += std::abs(fringes.waves[n]);
      mean += sum.means()[n] - dark_.light[pixels_[n]];
    }
    fringes.contrast = mean > 0.0 ? wave / mean : 0.0;
    return fringes;
  }

  void find_pitch() {
    const std::optional<FoundFringes> found =
        search_pitch(optics::effective_sheet(start_.rig()).pitch.value, start_.rig().sheet.slant);
    if (!found)
      fail(
          "no fringes are visible: the lens pitch is far from the starting one, or the pattern "
          "does "
          "not pass the sheet",
          "use a rig with a better pitch and slant, or check that the sheet is in focus");
    result_.line = found->peak.phase;
    refine_line(found->fringes);
    if (options_.adaptive) leave_aliases(*found);
  }

  /// Returns the peak of fringes near a start; nothing if they are too weak or ambiguous.
  [[nodiscard]] std::optional<FringePeak> peak_of(const Fringes& fringes,
                                                  const LinearPhase& start) const {
    const double lenses = std::abs(start.per_px_x) * panel_.width_px;
    std::optional<FringePeak> peak = find_fringes({fringes.fringe, fringes.waves, panel_points_},
                                                  start, kCaptureRange * lenses + 6.0, panel_);
    const bool good = peak && fringes.contrast > kLeastModulation &&
                      peak->height > kLeastCoherent && peak->height > kLeastLead * peak->second;
    return good ? peak : std::nullopt;
  }

  /// Returns the fringes of the first pitch that shows some: the nominal one or, if patterns may
  /// depend on pictures, a small multiple or fraction of it.
  [[nodiscard]] std::optional<FoundFringes> search_pitch(double nominal_pitch, double slant) {
    for (const double factor : kOtherPitches) {
      const double pitch = nominal_pitch * factor;
      if (pitch < optics::kMinPitchSubpixels || pitch > panel_.width_px / 4.0) continue;
      Fringes fringes = show_fringes(pitch, slant, kCoarseSteps);
      if (const auto peak = peak_of(fringes, phase_for(pitch, slant)))
        return FoundFringes{std::move(fringes), *peak};
      if (!options_.adaptive) break;
    }
    return std::nullopt;
  }

  /// Returns true if fringes appear at a multiple of the pitch. Only at the true pitch do the slow
  /// fringes disappear when the pattern gets wider by an integer factor: neighbouring lenses then
  /// see different phases.
  [[nodiscard]] bool multiple_shows_fringes(int factor, double first_coherence) {
    const double pitch = result_.line.pitch_subpx() * factor;
    if (pitch > panel_.width_px / 4.0) return false;
    const double slant = result_.line.slant();
    const Fringes fringes = show_fringes(pitch, slant, kAliasSteps);
    const std::optional<FringePeak> peak = find_fringes(
        {fringes.fringe, fringes.waves, panel_points_}, phase_for(pitch, slant), 6.0, panel_);
    return peak && peak->height * fringes.contrast > kAliasPart * first_coherence;
  }

  /// Leaves aliases: fringes also appear at an integer fraction of the pitch, so multiples are
  /// tried as long as fringes appear there. `first` is the fringes at which the line was found.
  void leave_aliases(const FoundFringes& first) {
    const double first_coherence = first.peak.height * first.fringes.contrast;
    LinearPhase& line = result_.line;
    for (int multiple = 2; multiple <= kMostMultiple;) {
      if (!multiple_shows_fringes(multiple, first_coherence)) {
        ++multiple;
        continue;
      }
      result_.warnings.push_back(fmt::format(
          "the starting pitch was an alias: the lenses are {} times as wide", multiple));
      line = {.constant = line.constant / multiple,
              .per_px_x = line.per_px_x / multiple,
              .per_px_y = line.per_px_y / multiple};
      multiple = 2;
    }
  }

  void refine_line(const Fringes& fringes) {
    for (int round = 0; round < 2; ++round) {
      const std::optional<LinearPhase> line = fit_linear(blocks_of(fringes), panel_);
      if (!line || !(line->per_px_x > 0.0))
        fail("the fringes do not agree with one sheet of lenses",
             "check that the rig's slant is about right");
      result_.line = *line;
    }
  }

  void measure_colours() {
    std::vector<Pattern> patterns;
    for (int c = 0; c < 3; ++c)
      patterns.push_back({.shape = Flat{{1.0, 1.0, 1.0}}, .channels = Channels::only(c)});
    if (options_.link_and_spot) {
      for (int c = 0; c < 3; ++c)
        patterns.push_back({.shape = Columns{}, .channels = Channels::only(c)});
      patterns.push_back({.shape = Checks{}, .channels = {}});
    }
    LinkPictures pictures{.camera_channels = white_colour_.channels,
                          .white = mean_colour(white_colour_, dark_colour_, pixels_)};
    size_t k = 0;
    capture_.capture(patterns, [&](const Pattern&, const CameraPicture& picture) {
      const MeanColour mean = mean_colour(picture, dark_colour_, pixels_);
      if (k < 3)
        pictures.flat[k] = mean;
      else if (k < 6)
        pictures.columns[k - 3] = mean;
      else
        pictures.checks = mean;
      ++k;
    });
    for (int c = 0; c < 3; ++c) weights_[static_cast<size_t>(c)] = weights_for(pictures, c);
    if (options_.link_and_spot) result_.link = check_link(pictures);
  }

  void measure_fringes() {
    const double lenses = result_.line.per_px_x * panel_.width_px;
    const double detuned = 1.0 + std::min(0.02, kFineFringes / lenses);
    const double pitch = options_.adaptive ? result_.line.pitch_subpx() * detuned
                                           : optics::effective_sheet(start_.rig()).pitch.value;
    const double slant = options_.adaptive ? result_.line.slant() : start_.rig().sheet.slant;
    for (const int c : kChannelOrder) {
      const auto k = static_cast<size_t>(c);
      const Fringes fringes =
          show_fringes(pitch, slant, kFineSteps, Channels::only(c), weights_[k]);
      if (c == 1) {
        refine_line(fringes);
        result_.fringe = fringes.fringe;
        result_.contrast = fringes.contrast;
      }
      result_.blocks[k] = blocks_of(fringes);
      result_.channel_contrast[k] = fringes.contrast * coherence_of(result_.blocks[k]);
    }
    if (result_.contrast < kLeastModulation)
      fail(fmt::format("the fringes have a contrast of {:.1f} % only", 100.0 * result_.contrast),
           "check that the camera is focused on the sheet and the room is dark");
    int used = 0;
    for (const PhaseBlock& block : result_.blocks[1].blocks) used += block.pixels;
    const std::vector<uint32_t> lit = visible_pixels(dark_, white_);
    result_.covered =
        lit.empty() ? 0.0 : static_cast<double>(used) / static_cast<double>(lit.size());
  }

  [[nodiscard]] BlockGrid blocks_of(const Fringes& fringes) const {
    return average_blocks({fringes.fringe, fringes.waves, panel_points_}, pixels_, result_.width,
                          result_.height, block_px_, *map_, result_.line, panel_);
  }

  void measure_spot() {
    std::vector<Pattern> patterns;
    for (int bin = 0; bin < kSpotBins; ++bin)
      patterns.push_back({.shape = Comb{.phase = result_.line,
                                        .place = (bin + 0.5) / kSpotBins - 0.5,
                                        .width = 1.0 / kSpotBins},
                          .channels = {}});
    SpotSum spot(kSpotBins, result_.blocks[1], result_.line, panel_);
    int bin = 0;
    capture_.capture(patterns, [&](const Pattern&, const CameraPicture& picture) {
      spot.add(bin++, grey_of(picture), dark_, pixels_, block_px_);
    });
    result_.spot = spot.result();
  }

  void repeat() {
    const Fringes again = show_fringes(result_.fringe.pitch_subpx, result_.fringe.slant,
                                       kRepeatSteps, Channels::only(1), weights_[1]);
    result_.drift_lenses = largest_change(result_.blocks[1], blocks_of(again), panel_);
  }

  const optics::OpticalModel& start_;
  const optics::Panel& panel_;
  MeasureOptions options_;
  RigCode rig_code_;
  PatternCapture capture_;
  ViewpointMeasurement result_;

  GreyPicture dark_;
  GreyPicture white_;
  CameraPicture dark_colour_;
  CameraPicture white_colour_;
  std::vector<uint32_t> pixels_;
  std::vector<Vec2> panel_points_;  ///< points of the smooth map, one per pixel
  std::optional<PanelMap> map_;
  int block_px_ = 16;
  std::array<ChannelWeights, 3> weights_{kEqualWeights, kEqualWeights, kEqualWeights};
};

}  // namespace

ViewpointMeasurement measure_viewpoint(frames::FrameSink& sink, Camera& camera,
                                       const optics::OpticalModel& start,
                                       const CaptureOptions& capture, const MeasureOptions& options,
                                       const CaptureProgress& progress) {
  return ViewpointRun(sink, camera, start, capture, options, progress).run();
}

}  // namespace lenticule::calib
