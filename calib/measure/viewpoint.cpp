// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/viewpoint.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "calib/measure/geometry.h"
#include "calib/measure/lens_spot.h"
#include "calib/measure/link_check.h"
#include "calib/measure/mark_moves.h"
#include "calib/measure/pitch_search.h"
#include "calib/measure/seen_pixels.h"
#include "calib/measure/visible_pixels.h"
#include "optics/effective_sheet.h"

namespace lenticule::calib {
namespace {

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

  void find_panel();
  void check_rig();
  void decode_geometry();
  [[nodiscard]] Fringes show_fringes(double pitch, double slant, int steps, Channels channels,
                                     const ChannelWeights& weights);
  void find_pitch();
  void refine_line(const Fringes& fringes);

  void measure_colours();
  void measure_fringes();
  [[nodiscard]] BlockGrid blocks_of(const Fringes& fringes) const;
  void measure_spot();
  void repeat();

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

void ViewpointRun::find_panel() {
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

/// Checks the rig code. Photographs are valid only if they show the patterns of the calibrated rig:
/// patterns of another pitch would give another pitch as the result.
void ViewpointRun::check_rig() {
  if (options_.adaptive) return;
  const RigCodeReadings& codes = capture_.codes();
  result_.rig_code_read = codes.read() > 0;
  check_codes(codes, rig_code_, options_.name);
}

void ViewpointRun::decode_geometry() {
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
  const DecodedPixels decoded{std::move(pixels_), std::move(positions[0]), std::move(positions[1])};
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

Fringes ViewpointRun::show_fringes(double pitch, double slant, int steps, Channels channels,
                                   const ChannelWeights& weights) {
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

void ViewpointRun::find_pitch() {
  const FringeTrials trials{panel_, panel_points_, [&](double pitch, double slant, int steps) {
                              return show_fringes(pitch, slant, steps, Channels{}, kEqualWeights);
                            }};
  const std::optional<FoundFringes> found =
      search_pitch(trials, optics::effective_sheet(start_.rig()).pitch.value,
                   start_.rig().sheet.slant, options_.adaptive);
  if (!found)
    fail(
        "no fringes are visible: the lens pitch is far from the starting one, or the pattern does "
        "not pass the sheet",
        "use a rig with a better pitch and slant, or check that the sheet is in focus");
  result_.line = found->peak.phase;
  refine_line(found->fringes);
  if (!options_.adaptive) return;
  const AliasFreeLine free = leave_aliases(trials, result_.line, *found);
  for (const int multiple : free.multiples)
    result_.warnings.push_back(
        fmt::format("the starting pitch was an alias: the lenses are {} times as wide", multiple));
  result_.line = free.line;
}

BlockGrid ViewpointRun::blocks_of(const Fringes& fringes) const {
  return average_blocks({fringes.fringe, fringes.waves, panel_points_}, pixels_, result_.width,
                        result_.height, block_px_, *map_, result_.line, panel_);
}

void ViewpointRun::refine_line(const Fringes& fringes) {
  for (int round = 0; round < 2; ++round) {
    const std::optional<LinearPhase> line = fit_linear(blocks_of(fringes), panel_);
    if (!line || !(line->per_px_x > 0.0))
      fail("the fringes do not agree with one sheet of lenses",
           "check that the rig's slant is about right");
    result_.line = *line;
  }
}

void ViewpointRun::measure_colours() {
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

void ViewpointRun::measure_fringes() {
  const double lenses = result_.line.per_px_x * panel_.width_px;
  const double detuned = 1.0 + std::min(0.02, kFineFringes / lenses);
  const double pitch = options_.adaptive ? result_.line.pitch_subpx() * detuned
                                         : optics::effective_sheet(start_.rig()).pitch.value;
  const double slant = options_.adaptive ? result_.line.slant() : start_.rig().sheet.slant;
  for (const int c : kChannelOrder) {
    const auto k = static_cast<size_t>(c);
    const Fringes fringes = show_fringes(pitch, slant, kFineSteps, Channels::only(c), weights_[k]);
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
  result_.covered = lit.empty() ? 0.0 : static_cast<double>(used) / static_cast<double>(lit.size());
}

void ViewpointRun::measure_spot() {
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

void ViewpointRun::repeat() {
  const Fringes again = show_fringes(result_.fringe.pitch_subpx, result_.fringe.slant, kRepeatSteps,
                                     Channels::only(1), weights_[1]);
  result_.drift_lenses = largest_change(result_.blocks[1], blocks_of(again), panel_);
}

}  // namespace

ViewpointMeasurement measure_viewpoint(frames::FrameSink& sink, Camera& camera,
                                       const optics::OpticalModel& start,
                                       const CaptureOptions& capture, const MeasureOptions& options,
                                       const CaptureProgress& progress) {
  return ViewpointRun(sink, camera, start, capture, options, progress).run();
}

}  // namespace lenticule::calib
