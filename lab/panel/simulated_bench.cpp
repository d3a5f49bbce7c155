// SPDX-License-Identifier: Apache-2.0
// The bench: one clock, the last two frames, and their pictures from the present viewpoint. Tracing
// the camera's pixels through the lenses is slow, so the subpixels that each pixel sees are found
// once for each viewpoint (SampleMap); the picture of a frame is then a sum over table entries.
#include "lab/panel/simulated_bench.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "base/parallel_rows.h"
#include "lab/panel/portable_random.h"

namespace lenticule::lab {

/// Number of copies of every ray of a mosaic pixel, moved along the lens, which is uniform along
/// its axis. Without copies most rays would be lost on the two other colours, and white would look
/// coarse. Rays that hit another colour than the pixel's are kept only once.
inline constexpr size_t kMosaicCopies = 6;

/// SampleRow holds the samples of one camera row.
struct SampleRow {
  int first = 0;  ///< column of the first pixel that sees the panel
  std::vector<uint16_t>
      lit;  ///< number of lit subpixels that each pixel, counted from `first`, sees
  std::vector<float> scale;           ///< vignetting over number of samples, for each pixel
  std::vector<uint32_t> haze_block;   ///< block around each pixel (block_light)
  std::vector<SubpixelId> subpixels;  ///< subpixels of all pixels, one after the other
  double panel_y =
      0.5;  ///< mean height on the panel of the points that the row sees, 0 top, 1 bottom
};

/// Haze is scattered light: it reaches the camera from the neighbourhood instead of straight
/// through the lens.
struct Haze {
  double part = 0.0;
  double lit_area = 1.0;      ///< lit fraction of the panel, without the black matrix
  std::vector<float> blocks;  ///< block_light
};

class SampleMap {
 public:
  /// Traces the whole picture with `threads` helpers; the result does not depend on their number.
  SampleMap(const optics::Panel& true_panel, const SheetShape& shape, const SubpixelFinder& finder,
            const SimulatedCamera& camera, uint64_t seed, int threads);

  [[nodiscard]] const SampleRow& row(int row) const { return rows_[static_cast<size_t>(row)]; }

  /// Computes the light of the camera's pixels, row by row, one value each in the pixel's own
  /// colour; 0 for pixels that do not see the panel.
  void gather(const DrivenFrame& frame, const LightTable& table, const Haze& haze,
              std::vector<float>& light, int threads) const;

 private:
  void gather_row(int row, const DrivenFrame& frame, const LightTable& table, float* light) const;
  void mix_haze(int row, const Haze& haze, const LightTable& table, float* light) const;

  SimulatedCamera camera_;
  std::vector<SampleRow> rows_;
};

namespace {

constexpr size_t kJitterSets = 1024;
constexpr size_t kQuantiles = 4096;
constexpr double kMarginPx = 8.0;      // panel pixels around the panel that are traced too
constexpr double kBubbleSpread = 1.5;  // lens pitches

/// Jitter is the start of one ray in its pixel and in the pupil.
struct Jitter {
  double x_px = 0.0;
  double y_px = 0.0;
  double pupil_x = 0.0;
  double pupil_y = 0.0;
};

/// Returns the distribution function of a pixel's square and a Gaussian, one axis; positions in
/// pixels.
double blur_below(double place, double sigma) {
  if (sigma <= 0.0) return std::clamp(place + 0.5, 0.0, 1.0);
  const auto primitive = [sigma](double t) {
    return t * 0.5 * std::erfc(-t / (sigma * std::numbers::sqrt2)) +
           sigma * std::exp(-0.5 * t * t / (sigma * sigma)) / std::sqrt(2.0 * std::numbers::pi);
  };
  return primitive(place + 0.5) - primitive(place - 0.5);
}

/// Returns quantiles of the blur: the positions below which 1/2, 3/2, ... steps lie, dense enough
/// for samples.
std::vector<double> blur_quantiles(double sigma) {
  std::vector<double> places(kQuantiles);
  for (size_t step = 0; step < kQuantiles; ++step) {
    const double part = (static_cast<double>(step) + 0.5) / kQuantiles;
    double low = -0.5 - 8.0 * sigma;
    double high = -low;
    for (int halving = 0; halving < 40; ++halving) {
      const double middle = 0.5 * (low + high);
      (blur_below(middle, sigma) < part ? low : high) = middle;
    }
    places[step] = 0.5 * (low + high);
  }
  return places;
}

/// Makes sets of jitters; each pixel picks one at random. Within a set the positions in the pixel
/// follow an additive sequence with the plastic number, which leaves no large holes.
std::vector<Jitter> make_jitters(const SimulatedCamera& camera, uint64_t seed) {
  PortableRandom random(seed);
  const std::vector<double> quantiles = blur_quantiles(camera.psf_sigma_px);
  std::vector<Jitter> jitters;
  for (size_t set = 0; set < kJitterSets + kMosaicCopies; ++set) {
    const double start_x = random.uniform();
    const double start_y = random.uniform();
    for (int sample = 0; sample < camera.samples; ++sample) {
      double whole = 0.0;
      const double x = std::modf(start_x + sample * 0.7548776662466927, &whole);
      const double y = std::modf(start_y + sample * 0.5698402909980532, &whole);
      const double radius = std::sqrt(random.uniform());
      const double angle = random.uniform(0.0, 2.0 * std::numbers::pi);
      jitters.push_back({quantiles[static_cast<size_t>(x * kQuantiles)],
                         quantiles[static_cast<size_t>(y * kQuantiles)], radius * std::cos(angle),
                         radius * std::sin(angle)});
    }
  }
  return jitters;
}

/// Footprint is the part of the apex surface that one camera pixel sees.
struct Footprint {
  Vec2 centre;
  Vec2 per_column;  // millimetres per camera pixel
  Vec2 per_row;
};

/// Scene holds all inputs of tracing, for all rows.
struct Scene {
  const optics::Panel& panel;
  const SheetShape& shape;
  const SubpixelFinder& finder;
  const SimulatedCamera& camera;
  const CameraRays& rays;
  const std::vector<Jitter>& jitters;
  const std::array<double, 3>& indices;  // refractive indices of the sheet, one per colour
  Vec2 px_per_mm;                        // scale of the panel, whose rows count down
  uint64_t seed;
};

std::vector<std::optional<Vec2>> corners_of_row(const Scene& scene, int row) {
  std::vector<std::optional<Vec2>> corners(static_cast<size_t>(scene.camera.width) + 1);
  for (size_t column = 0; column < corners.size(); ++column) {
    const Vec2 picture{static_cast<double>(column), static_cast<double>(row)};
    corners[column] = scene.shape.meet(scene.rays.position(), scene.rays.direction(picture));
  }
  return corners;
}

bool near_panel(const optics::Panel& panel, Vec2 point) {
  const double x = panel.x_px(point.x);
  const double y = panel.y_px(point.y);
  return x > -kMarginPx && y > -kMarginPx && x < panel.width_px + kMarginPx &&
         y < panel.height_px + kMarginPx;
}

/// PixelTracer traces one pixel's rays, through lenses that are uniform over the pixel.
class PixelTracer {
 public:
  PixelTracer(const Scene& scene, const Footprint& footprint, int column, int row)
      : scene_(scene),
        footprint_(footprint),
        centre_px_{scene.panel.x_px(footprint.centre.x), scene.panel.y_px(footprint.centre.y)},
        colour_(mosaic_colour(scene.camera, column, row)),
        lenses_(scene.shape.lenses_at(footprint.centre, colour_)),
        across_(lenses_.across()),
        stance_(scene.shape.stance_at(footprint.centre)),
        bubbly_(scene.shape.in_bubble(footprint.centre)),
        chance_(scramble(scene.seed ^ (static_cast<uint64_t>(row) << 32) ^
                         static_cast<uint64_t>(column) * 0x9e3779b97f4a7c15ULL)) {}

  /// Appends the hit subpixels and returns their number.
  uint16_t trace(std::vector<SubpixelId>& subpixels) {
    const auto samples = static_cast<size_t>(scene_.camera.samples);
    // The following sets are for the copies; there are that many more sets than are chosen from.
    const Jitter* jitters = &scene_.jitters[chance_ % kJitterSets * samples];
    const size_t before = subpixels.size();
    for (size_t sample = 0; sample < samples; ++sample) {
      const Vec2 moved = moved_by(jitters[sample]);
      const Vec3 direction = direction_to(moved, jitters[sample]);
      if (!scene_.camera.bayer) {
        const std::optional<SubpixelId> hit = find_in_all_colours(moved, direction);
        if (hit) subpixels.push_back(*hit);
        continue;
      }
      const std::optional<Vec2> shift = shift_of_ray(moved, direction);
      if (!shift) continue;
      for (size_t copy = 0; copy < kMosaicCopies; ++copy) {
        const Jitter& other = jitters[copy * samples + sample];
        add_mosaic_hit(along_lens(moved, moved_by(other)) + *shift, copy == 0, subpixels);
      }
    }
    return static_cast<uint16_t>(subpixels.size() - before);
  }

 private:
  [[nodiscard]] Vec2 moved_by(const Jitter& jitter) const {
    return footprint_.per_column * jitter.x_px + footprint_.per_row * jitter.y_px;
  }

  [[nodiscard]] Vec3 direction_to(Vec2 moved, const Jitter& jitter) const {
    const Vec3 target = stance_.point + stance_.tangent * moved.x + Vec3{0, moved.y, 0};
    const Vec3 from = scene_.rays.pupil_point(jitter.pupil_x, jitter.pupil_y);
    return stance_.local(normalized(target - from));
  }

  /// Returns `moved`, shifted along its lens to the position of `other`.
  [[nodiscard]] Vec2 along_lens(Vec2 moved, Vec2 other) const {
    const Vec2 step = other - moved;
    const double slide = across_.x * step.y - across_.y * step.x;
    return moved + Vec2{-across_.y * slide, across_.x * slide};
  }

  /// Adds a hit of a mosaic pixel. Hits of other colours than the pixel's count in the first copy
  /// only, which the light table compensates.
  void add_mosaic_hit(Vec2 moved, bool first_copy, std::vector<SubpixelId>& subpixels) const {
    const std::optional<SubpixelId> hit = find_at(moved);
    if (!hit) return;
    const bool own = static_cast<int>(*hit % 4) == colour_;
    if (own || first_copy) subpixels.push_back(*hit);
  }

  /// Finds the subpixel for a camera without mosaic, which sees each channel's light through the
  /// index of that channel.
  std::optional<SubpixelId> find_in_all_colours(Vec2 moved, Vec3 direction) {
    const std::optional<SubpixelId> hit = find_subpixel(moved, direction);
    if (!hit || *hit % 4 == 1) return hit;
    LensStack& stack = lenses_.stack;
    const double own = stack.index;
    stack.index = scene_.indices[*hit % 4];
    const bool disperses = stack.index != own;
    const std::optional<SubpixelId> bent = disperses ? find_subpixel(moved, direction) : hit;
    stack.index = own;
    return bent && *bent % 4 == *hit % 4 ? bent : hit;
  }

  std::optional<SubpixelId> find_subpixel(Vec2 moved, Vec3 direction) {
    const std::optional<Vec2> shift = shift_of_ray(moved, direction);
    if (!shift) return std::nullopt;
    return find_at(moved + *shift);
  }

  [[nodiscard]] std::optional<SubpixelId> find_at(Vec2 moved) const {
    return scene_.finder.find(centre_px_.x + moved.x * scene_.px_per_mm.x,
                              centre_px_.y + moved.y * scene_.px_per_mm.y);
  }

  /// Returns the offset from the aimed point of the apex surface to the landing point, millimetres.
  std::optional<Vec2> shift_of_ray(Vec2 moved, Vec3 direction) {
    const double coordinate =
        lenses_.coordinate + lenses_.gradient.x * moved.x + lenses_.gradient.y * moved.y;
    const double pitch = lenses_.stack.pitch_mm;
    const double u = (coordinate - std::round(coordinate)) * pitch;
    const Vec3 d{across_.x * direction.x + across_.y * direction.y,
                 across_.x * direction.y - across_.y * direction.x, direction.z};
    const std::optional<Vec2> landing = land(lenses_.stack, {u, 0.0}, d);
    if (!landing) return std::nullopt;
    Vec2 shift{landing->x - u, landing->y};
    if (bubbly_) shift.x += scattered() * pitch;
    return Vec2{across_.x * shift.x - across_.y * shift.y,
                across_.y * shift.x + across_.x * shift.y};
  }

  double scattered() {
    chance_ = scramble(chance_ + 0x9e3779b97f4a7c15ULL);
    return (static_cast<double>(chance_ >> 11) * 0x1p-52 - 1.0) * kBubbleSpread;
  }

  const Scene& scene_;
  Footprint footprint_;
  Vec2 centre_px_;
  int colour_;
  LocalLenses lenses_;
  Vec2 across_;
  Stance stance_;
  bool bubbly_;
  uint64_t chance_;
};

Footprint footprint_of(Vec2 top_left, Vec2 top_right, Vec2 bottom_left, Vec2 bottom_right) {
  return {(top_left + top_right + bottom_left + bottom_right) * 0.25,
          (top_right + bottom_right - top_left - bottom_left) * 0.5,
          (bottom_left + bottom_right - top_left - top_right) * 0.5};
}

float scale_of(const Scene& scene, int column, int row) {
  double scale = 1.0 / scene.camera.samples;
  if (scene.camera.vignetting) {
    const double cosine = scene.rays.cosine(scene.rays.direction({column + 0.5, row + 0.5}));
    scale *= cosine * cosine * cosine * cosine;
  }
  return static_cast<float>(scale);
}

void add_unseen_pixel(SampleRow& samples) {
  samples.lit.push_back(0);
  samples.scale.push_back(0.0F);
  samples.haze_block.push_back(0);
}

SampleRow trace_row(const Scene& scene, int row) {
  const std::vector<std::optional<Vec2>> top = corners_of_row(scene, row);
  const std::vector<std::optional<Vec2>> bottom = corners_of_row(scene, row + 1);
  SampleRow samples;
  double panel_y = 0.0;
  int seen = 0;
  for (int column = 0; column < scene.camera.width; ++column) {
    const auto at = static_cast<size_t>(column);
    const bool meets = top[at] && top[at + 1] && bottom[at] && bottom[at + 1];
    const Footprint footprint =
        meets ? footprint_of(*top[at], *top[at + 1], *bottom[at], *bottom[at + 1]) : Footprint{};
    if (!meets || !near_panel(scene.panel, footprint.centre)) {
      if (seen > 0) add_unseen_pixel(samples);
      continue;
    }
    if (seen++ == 0) samples.first = column;
    samples.lit.push_back(PixelTracer(scene, footprint, column, row).trace(samples.subpixels));
    samples.scale.push_back(scale_of(scene, column, row));
    samples.haze_block.push_back(haze_block(scene.panel, scene.panel.x_px(footprint.centre.x),
                                            scene.panel.y_px(footprint.centre.y)));
    panel_y += scene.panel.y_px(footprint.centre.y) / scene.panel.height_px;
  }
  if (seen > 0) samples.panel_y = std::clamp(panel_y / seen, 0.0, 1.0);
  return samples;
}

}  // namespace

SampleMap::SampleMap(const optics::Panel& true_panel, const SheetShape& shape,
                     const SubpixelFinder& finder, const SimulatedCamera& camera, uint64_t seed,
                     int threads)
    : camera_(camera), rows_(static_cast<size_t>(camera.height)) {
  const CameraRays rays(camera);
  const std::vector<Jitter> jitters = make_jitters(camera, seed);
  const std::array<double, 3>& indices = shape.sheet().index;
  const Vec2 px_per_mm{1.0 / true_panel.pixel_width.value, -1.0 / true_panel.pixel_height.value};
  const Scene scene{true_panel, shape, finder, camera, rays, jitters, indices, px_per_mm, seed};
  for_rows(
      camera.height, [&](int row) { rows_[static_cast<size_t>(row)] = trace_row(scene, row); },
      threads);
}

void SampleMap::gather(const DrivenFrame& frame, const LightTable& table, const Haze& haze,
                       std::vector<float>& light, int threads) const {
  const auto width = static_cast<size_t>(camera_.width);
  light.assign(width * rows_.size(), 0.0F);
  const auto gather_one = [&](int row) {
    float* values = &light[static_cast<size_t>(row) * width];
    gather_row(row, frame, table, values);
    if (haze.part > 0.0) mix_haze(row, haze, table, values);
  };
  for_rows(camera_.height, gather_one, threads);
}

void SampleMap::gather_row(int row, const DrivenFrame& frame, const LightTable& table,
                           float* light) const {
  const SampleRow& samples = rows_[static_cast<size_t>(row)];
  const SubpixelId* subpixel = samples.subpixels.data();
  const uint8_t* codes = frame.codes.data();
  for (size_t pixel = 0; pixel < samples.lit.size(); ++pixel) {
    const int column = samples.first + static_cast<int>(pixel);
    const auto& own = table[static_cast<size_t>(mosaic_colour(camera_, column, row))];
    float sum = 0.0F;
    for (unsigned n = samples.lit[pixel]; n > 0; --n, ++subpixel) {
      sum += own[*subpixel % 4][codes[*subpixel]];
    }
    light[column] = sum * samples.scale[pixel];
  }
}

void SampleMap::mix_haze(int row, const Haze& haze, const LightTable& table, float* light) const {
  const SampleRow& samples = rows_[static_cast<size_t>(row)];
  for (size_t pixel = 0; pixel < samples.lit.size(); ++pixel) {
    const int column = samples.first + static_cast<int>(pixel);
    const auto own_colour = static_cast<size_t>(mosaic_colour(camera_, column, row));
    const auto& own = table[own_colour];
    const float* block = &haze.blocks[size_t{samples.haze_block[pixel]} * 3];
    double spread = 0.0;
    for (size_t c = 0; c < 3; ++c) {
      const double hits = camera_.bayer && c == own_colour ? kMosaicCopies : 1.0;
      spread += hits * double{own[c][255]} * double{block[c]};
    }
    spread *= haze.lit_area / 3.0 * camera_.samples * double{samples.scale[pixel]};
    light[column] =
        static_cast<float>((1.0 - haze.part) * double{light[column]} + haze.part * spread);
  }
}

// The clock, the frames and the pictures.

namespace {

using calib::CameraFacts;
using calib::GrabStatus;
using calib::Nanoseconds;

constexpr double kNanosecondsPerMs = 1e6;
constexpr double kForgotten = 1e-5;  // smaller remainders of an old frame are ignored
constexpr int kBandPeriodRows = 90;

double ms_of(Nanoseconds time) { return static_cast<double>(time.count()) / kNanosecondsPerMs; }
Nanoseconds nanoseconds_of_ms(double ms) {
  return Nanoseconds(std::llround(ms * kNanosecondsPerMs));
}

/// Returns the panel with its true layout. Throws Error(Input) for an impossible set-up.
optics::Panel checked_panel(optics::Panel panel, const SimulatedSheet& sheet,
                            const SimulatedPanelLink& link, const SimulatedCamera& camera) {
  check_sheet(sheet, panel);
  check_link(link);
  check_camera(camera);
  if (link.actual_layout) panel.layout = *link.actual_layout;
  return panel;
}

CameraFacts facts_of(const SimulatedCamera& camera) {
  CameraFacts facts;
  facts.name = "simulated camera";
  facts.width = camera.width;
  facts.height = camera.height;
  facts.channels = camera.bayer ? 3 : 1;
  facts.frames_per_second = camera.frames_per_second;
  facts.pixel_format = "simulated";
  if (camera.gain_drift > 0.0) facts.unlocked.emplace_back("no manual exposure");
  return facts;
}

}  // namespace

SimulatedBench::SimulatedBench(const optics::Panel& panel, const SimulatedSheet& sheet,
                               const SimulatedPanelLink& link, const SimulatedCamera& camera,
                               uint64_t seed)
    : panel_(checked_panel(panel, sheet, link, camera)),
      sheet_(sheet),
      link_(link),
      camera_(camera),
      seed_(seed),
      shape_(panel_, sheet, 0.0),
      finder_(panel_, sheet.black_matrix),
      sensor_(camera, scramble(seed + 1)),
      facts_(facts_of(camera)),
      code_light_(light_of_codes(link)),
      table_(light_table(camera, code_light_, 1.0 - sheet.black_matrix)),
      camera_starts_ms_(PortableRandom(seed).uniform(0.0, 1000.0 / camera.frames_per_second)) {
  const frames::WovenFrame black(geometry());
  current_.driven = drive(black.view(), Chroma::Full);
  previous_.driven = current_.driven;
  // Hits of a mosaic pixel's own colour count in every copy.
  if (camera.bayer)
    for (size_t own = 0; own < 3; ++own)
      for (float& light : table_[own][own]) light /= static_cast<float>(kMosaicCopies);
}

SimulatedBench::~SimulatedBench() = default;

frames::FrameGeometry SimulatedBench::geometry() const {
  return {panel_.width_px, panel_.height_px, frames::PixelFormat::Rgb8};
}

void SimulatedBench::forget_viewpoint() {
  map_.reset();
  current_.light.clear();
  previous_.light.clear();
}

void SimulatedBench::move_camera(Vec3 position_mm, Vec3 look_at_mm, double roll_degrees) {
  SimulatedCamera moved = camera_;
  moved.position_mm = position_mm;
  moved.look_at_mm = look_at_mm;
  moved.roll_degrees = roll_degrees;
  check_camera(moved);
  camera_ = moved;
  forget_viewpoint();
}

void SimulatedBench::set_thermal_stretch(double relative) {
  if (!(std::abs(relative) <= 0.1)) {
    throw Error(ErrorKind::Input, "simulated sheet: thermal stretch: out of range",
                "it must be -0.1 to 0.1");
  }
  shape_ = SheetShape(panel_, sheet_, relative);
  forget_viewpoint();
}

/// Adds to the current frame what a slow panel still shows of the previous one.
void SimulatedBench::keep_leftover_of_old_frame(double ms_since_shown) {
  if (current_.light.empty() || previous_.light.empty() || link_.response_ms <= 0.0) return;
  const auto left = static_cast<float>(std::exp(-ms_since_shown / link_.response_ms));
  if (double{left} < kForgotten) return;
  for (size_t i = 0; i < current_.light.size(); ++i) {
    current_.light[i] += (previous_.light[i] - current_.light[i]) * left;
  }
}

frames::ShowResult SimulatedBench::show(const frames::FrameView& frame,
                                        std::chrono::nanoseconds timeout) {
  LENTICULE_CHECK(frame.geometry == geometry());
  const double period_ms = 1000.0 / link_.refresh_hz;
  const double vblank_ms = (std::floor(ms_of(now_) / period_ms + 1e-6) + 1.0) * period_ms;
  const Nanoseconds vblank = nanoseconds_of_ms(vblank_ms);
  if (vblank - now_ > timeout) {
    now_ += std::max(timeout, Nanoseconds(0));
    return frames::ShowResult::TimedOut;
  }
  keep_leftover_of_old_frame(vblank_ms - shown_at_ms_);
  std::swap(previous_, current_);
  current_.driven = drive(frame, link_.chroma);
  add_logo(link_, panel_, current_.driven);
  current_.light.clear();
  now_ = vblank;
  shown_at_ms_ = vblank_ms;
  ++shown_frames_;
  if (camera_.shake_mm > 0.0) forget_viewpoint();
  return frames::ShowResult::Shown;
}

void SimulatedBench::trace_if_needed() {
  if (map_) return;
  SimulatedCamera shaken = camera_;
  if (camera_.shake_mm > 0.0) {
    PortableRandom random(seed_ ^ scramble(shown_frames_));
    const Vec3 moved{random.gaussian(), random.gaussian(), random.gaussian()};
    shaken.position_mm += moved * camera_.shake_mm;
    shaken.position_mm.z = std::max(shaken.position_mm.z, 1.0);
  }
  map_ =
      std::make_unique<SampleMap>(panel_, shape_, finder_, shaken, scramble(seed_ + 2), threads_);
}

const std::vector<float>& SimulatedBench::light_of(ShownFrame& frame) {
  trace_if_needed();
  if (frame.light.empty()) {
    Haze haze{sheet_.haze, 1.0 - sheet_.black_matrix, {}};
    if (haze.part > 0.0) haze.blocks = block_light(frame.driven, panel_, code_light_);
    map_->gather(frame.driven, table_, haze, frame.light, threads_);
  }
  return frame.light;
}

double SimulatedBench::start_of_picture_ms(uint64_t picture) const {
  return camera_starts_ms_ + static_cast<double>(picture) * 1000.0 / camera_.frames_per_second;
}

double SimulatedBench::length_of_picture_ms() const {
  return camera_.exposure_ms + camera_.rolling_shutter_ms;
}

/// Returns the first picture that ends after now and was not taken yet.
uint64_t SimulatedBench::next_picture() const {
  const double earliest_start = ms_of(now_) - length_of_picture_ms() - camera_starts_ms_;
  const double number = std::floor(earliest_start * camera_.frames_per_second / 1000.0) + 1.0;
  return std::max(pictures_, static_cast<uint64_t>(std::max(0.0, number)));
}

GrabStatus SimulatedBench::grab(calib::CameraPicture& out, Nanoseconds timeout,
                                Nanoseconds not_before) {
  const Nanoseconds deadline = now_ + std::max(timeout, Nanoseconds(0));
  while (true) {
    if (pictures_left_ == 0) return GrabStatus::Gone;
    const uint64_t picture = next_picture();
    const double start_ms = start_of_picture_ms(picture);
    const Nanoseconds end = nanoseconds_of_ms(start_ms + length_of_picture_ms());
    if (end > deadline) {
      now_ = deadline;
      return GrabStatus::TimedOut;
    }
    now_ = std::max(now_, end);
    pictures_ = picture + 1;
    if (pictures_left_ > 0) --pictures_left_;
    out.sequence = picture;
    out.time = nanoseconds_of_ms(start_ms + length_of_picture_ms() / 2.0);
    if (out.time < not_before) continue;
    expose(picture);
    sensor_.develop(exposed_, picture, out, threads_);
    return GrabStatus::Ready;
  }
}

double SimulatedBench::row_begins_ms(int row, uint64_t picture) const {
  return start_of_picture_ms(picture) + camera_.rolling_shutter_ms * row / camera_.height;
}

double SimulatedBench::old_part_of_row(int row, uint64_t picture) const {
  const double switched = shown_at_ms_ + link_.scan_out_ms * map_->row(row).panel_y;
  return old_frame_part(row_begins_ms(row, picture), camera_.exposure_ms, switched,
                        link_.response_ms);
}

double SimulatedBench::gain_of_row(int row, uint64_t picture) const {
  PortableRandom random(scramble(seed_ + 3) ^ picture);
  const double drift = 1.0 + camera_.gain_drift * random.gaussian();
  const double phase = random.uniform(0.0, 2.0 * std::numbers::pi);
  const double wave = std::sin(2.0 * std::numbers::pi * row / kBandPeriodRows + phase);
  return std::max(0.0, drift) * (1.0 + camera_.row_banding * wave) *
         backlight_mean(row_begins_ms(row, picture), camera_.exposure_ms, link_.pwm_hz,
                        link_.pwm_duty);
}

void SimulatedBench::expose(uint64_t picture) {
  light_of(current_);
  bool both_frames = false;
  for (int row = 0; row < camera_.height && !both_frames; ++row) {
    both_frames = old_part_of_row(row, picture) > kForgotten;
  }
  if (both_frames) light_of(previous_);
  exposed_.resize(current_.light.size());
  const auto expose_one = [&](int row) {
    expose_row(row, picture, both_frames);
    if (camera_.highlight_half_width > 0.0) add_highlight(row);
  };
  for_rows(camera_.height, expose_one, threads_);
}

void SimulatedBench::expose_row(int row, uint64_t picture, bool both_frames) {
  const size_t first = static_cast<size_t>(row) * static_cast<size_t>(camera_.width);
  const size_t last = first + static_cast<size_t>(camera_.width);
  const auto old_part = static_cast<float>(both_frames ? old_part_of_row(row, picture) : 0.0);
  const auto gain = static_cast<float>(gain_of_row(row, picture));
  const auto ambient = static_cast<float>(camera_.ambient);
  for (size_t i = first; i < last; ++i) {
    const float now = current_.light[i];
    const float light = both_frames ? now + (previous_.light[i] - now) * old_part : now;
    exposed_[i] = light * gain + ambient;
  }
}

/// Adds the reflection: twice full scale inside, decreasing to zero over a tenth of the half axes.
void SimulatedBench::add_highlight(int row) {
  const double y = ((row + 0.5) / camera_.height - camera_.highlight_y) /
                   std::max(camera_.highlight_half_height, 1e-6);
  if (std::abs(y) > 1.1) return;
  float* values = &exposed_[static_cast<size_t>(row) * static_cast<size_t>(camera_.width)];
  for (int column = 0; column < camera_.width; ++column) {
    const double x =
        ((column + 0.5) / camera_.width - camera_.highlight_x) / camera_.highlight_half_width;
    const double inside = std::clamp((1.1 - std::hypot(x, y)) * 10.0, 0.0, 1.0);
    values[column] += static_cast<float>(2.0 * inside);
  }
}

double SimulatedBench::ground_truth_phase(double x_px, double y_px, int channel, Vec3 eye,
                                          LightMiddle middle) const {
  const optics::Panel& panel = panel_;
  const Vec2 point{panel.x_mm(x_px), panel.y_mm(y_px)};
  const std::optional<TrueView> view = true_view(shape_, point, channel, eye, middle);
  return view ? view->phase : std::numeric_limits<double>::quiet_NaN();
}

std::optional<Vec2> SimulatedBench::ground_truth_in_picture(double x_px, double y_px) const {
  const optics::Panel& panel = panel_;
  const SimulatedCamera& camera = camera_;
  const Vec2 point{panel.x_mm(x_px), panel.y_mm(y_px)};
  const std::optional<TrueView> view =
      true_view(shape_, point, 1, camera.position_mm, LightMiddle::Centroid);
  if (!view) return std::nullopt;
  return CameraRays(camera).project(view->aim);
}

}  // namespace lenticule::lab
