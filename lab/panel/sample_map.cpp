// SPDX-License-Identifier: Apache-2.0
// Traces the camera's pixels through the lenses to the subpixels.
#include "lab/panel/sample_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "base/parallel_rows.h"
#include "lab/panel/portable_random.h"

namespace lenticule::lab {
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

}  // namespace lenticule::lab
