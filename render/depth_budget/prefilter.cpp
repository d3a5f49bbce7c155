// SPDX-License-Identifier: Apache-2.0
#include "render/depth_budget/prefilter.h"

#include <fmt/format.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "optics/row_rays.h"
#include "render/accel/denormals.h"
#include "render/options/render_options.h"
#include "render/rays/primary_rays.h"
#include "render/row_sweep/row_sweep.h"

namespace lenticule::render {

DepthOfField::DepthOfField(const optics::OpticalModel& model)
    : straight_mm_(model.depth_of_field_mm()), kappa_(1.0 - model.rig().sheet.refraction_shape) {}

double DepthOfField::along_mm(double tan_x, double tan_y) const {
  const double down = 1.0 + kappa_ * std::min(tan_y * tan_y, 1.0);
  const double all = down + kappa_ * std::min(tan_x * tan_x, 1.0);
  return straight_mm_ * down / (all * std::sqrt(all));
}

/// The depth of field first grows with t_y and then falls, or only falls, so the minimum is at
/// an end.
double DepthOfField::least_mm() const { return std::min(along_mm(1.0, 0.0), along_mm(1.0, 1.0)); }

namespace {

/// Wraps a value to [-1/2, 1/2).
double wrapped(double value) { return value - std::floor(value + 0.5); }

int largest_odd(int count) { return count - (count + 1) % 2; }

/// Steps from one place to the next: down, and across the lens.
struct Steps {
  double down = 0.0;
  double across = 0.0;
};

/// Returns the steps. For the numbers of rays that beam_rays() returns, rank-1 lattices: of all
/// lattices, those whose mean over sine waves in front of and behind sheets of several slants is
/// closest to the mean over the whole beam. For other numbers, powers of the root of r^3 = r + 1,
/// whose multiples fill a square evenly.
Steps steps_for(int rays) {
  struct Lattice {
    int rays, down, across;
  };
  constexpr Lattice kLattices[] = {{5, 2, 3}, {9, 2, 5}, {17, 4, 2}, {33, 14, 4}, {65, 18, 61}};
  for (const Lattice& lattice : kLattices)
    if (lattice.rays == rays)
      return {static_cast<double>(lattice.down) / rays, static_cast<double>(lattice.across) / rays};
  constexpr double kRoot = 1.3247179572447460;
  return {1.0 / kRoot, 1.0 / (kRoot * kRoot)};
}

}  // namespace

Prefilter prefilter_named(const std::string& name) {
  if (name == "off") return Prefilter::Off;
  if (name == "depth") return Prefilter::Depth;
  if (name == "beam") return Prefilter::Beam;
  if (name == "exhaustive") return Prefilter::Exhaustive;
  throw Error(ErrorKind::Usage, fmt::format("prefilter '{}': unknown", name),
              "use off, depth, beam or exhaustive");
}

std::vector<SubpixelPlace> beam_samples(int count) {
  const int rays = largest_odd(count);
  const Steps steps = steps_for(rays);
  std::vector<SubpixelPlace> places = {{}};
  for (int k = 1; k <= rays / 2; ++k)
    for (const double side : {1.0, -1.0})
      places.push_back({.x = side * k / rays,
                        .y = side * wrapped(k * steps.down),
                        .lens = side * wrapped(k * steps.across)});
  return places;
}

int beam_rays(double depth, int most) {
  const double wanted = 2.0 * (1.0 + depth);
  int rays = 5;
  while (rays < most && rays < wanted) rays = 2 * rays - 1;
  return rays <= most ? rays : largest_odd(most);
}

namespace {

constexpr int kColours = 3;
/// Largest number of neighbours to each side: enough for sheets with very many subpixels per lens.
constexpr int kFarthestNeighbour = 8;

}  // namespace

DepthPrefilter::DepthPrefilter(const optics::OpticalModel& model, const TilePlan& plan,
                               const RenderOptions& options)
    : plan_(plan),
      depth_of_field_(model),
      least_depth_of_field_mm_(depth_of_field_.least_mm()),
      options_(options),
      everything_(options.prefilter == Prefilter::Beam),
      distance_mm_(model.rig().viewing.distance.value),
      reach_(std::clamp(static_cast<int>(std::ceil(model.rig().sheet.pitch.value / kColours)), 1,
                        kFarthestNeighbour)) {
  // The rule for weak rays is valid for a single ray per subpixel, but not for a sum.
  options_.skip_weak_rays = false;
  // Covers all results of beam_rays().
  for (double depth = 0.0; depth < 2.0 * options.prefilter_samples; depth += 0.5)
    beams_.try_emplace(beam_rays(depth, options.prefilter_samples));
  for (auto& [rays, footprints] : beams_)
    for (const SubpixelPlace place : beam_samples(rays)) footprints.emplace_back(model, place);
}

int DepthPrefilter::rays_for(double z_mm, const PanelRay& middle) const {
  const double depth = std::abs(z_mm) / depth_of_field_.along_mm(middle.tan_x, middle.tan_y);
  return everything_ || depth > 1.0 ? beam_rays(depth, options_.prefilter_samples) : 1;
}

DepthPrefilter::Worker::Worker(const DepthPrefilter& prefilter, const Scene& scene)
    : prefilter_(prefilter),
      scene_(scene),
      panel_from_scene_(scene.scene_from_panel.inverse()),
      start_mm_(primary_start_mm(scene.near_mm, prefilter.distance_mm_)),
      notes_(scene),
      encoder_(scene.colour_managed),
      tracer_(prefilter.options_),
      packet_(1) {
  init_packets(packet_);
}

FrameCounts DepthPrefilter::Worker::counts() const {
  FrameCounts all = counts_;
  return all += tracer_.counts();
}

DepthRecorder& DepthPrefilter::Worker::start(const Tile& tile) {
  notes_.start(tile);
  return notes_;
}

void DepthPrefilter::Worker::average(const Tile& tile, PrimaryPackets::Maker& maker,
                                     std::span<float> light) {
  if (!encode(light)) return;
  listed_.clear();
  maker.prepare(packet_);
  for (int column = 0; column < tile.columns; ++column) list_column(tile, column, maker);
  trace_listed(tile);
  for (const Listed& s : listed_)
    light[s.target] = (light[s.target] + s.sum) / static_cast<float>(s.rays);
}

/// Computes the code values. Returns false if no subpixel of the tile is averaged.
bool DepthPrefilter::Worker::encode(std::span<const float> light) {
  const auto left = [&](float z) { return prefilter_.surely_left(double{z}); };
  if (std::ranges::all_of(notes_.z_mm(), left)) return false;
  codes_.resize(light.size());
  std::ranges::transform(light, codes_.begin(), [&](float l) { return encoder_.code(l); });
  return true;
}

void DepthPrefilter::Worker::list_column(const Tile& tile, int column,
                                         PrimaryPackets::Maker& maker) {
  bool made = false;
  for (int row = 0; row < tile.rows; ++row) {
    const int subpixel = prefilter_.plan_.subpixel(tile, column, row);
    if (subpixel < 0 || subpixel >= prefilter_.plan_.row_subpixels()) continue;
    const int target = row * tile.columns + column;
    const double z_mm = notes_.z_mm()[static_cast<size_t>(target)];
    if (prefilter_.surely_left(z_mm)) continue;
    if (neighbours_agree(tile, column, row)) {
      // The exact direction of the ray does not matter for this statistic.
      counts_.prefilter_rays_left_out += static_cast<uint64_t>(prefilter_.rays_for(z_mm, {}) - 1);
      continue;
    }
    if (!made) maker.columns(column, packet_);
    made = true;
    const auto lane = static_cast<size_t>(row);
    if (packet_[0].valid[lane] == 0) continue;
    const PanelRay middle = panel_ray(panel_from_scene_, packet_[0], lane);
    const int rays = prefilter_.rays_for(z_mm, middle);
    if (rays == 1) continue;
    ++counts_.prefiltered_subpixels;
    counts_.prefilter_rays += static_cast<uint64_t>(rays - 1);
    listed_.push_back({.target = static_cast<uint32_t>(target),
                       .subpixel = subpixel,
                       .row = row,
                       .rays = rays,
                       .places = &prefilter_.beams_.at(rays),
                       .middle = middle});
  }
}

/// Compares with neighbours inside the tile; at the tile's borders there are fewer.
bool DepthPrefilter::Worker::neighbours_agree(const Tile& tile, int column, int row) const {
  const TilePlan& plan = prefilter_.plan_;
  const int code = codes_[static_cast<size_t>(row * tile.columns + column)];
  for (int r = std::max(row - 1, 0); r <= std::min(row + 1, tile.rows - 1); ++r) {
    const int reach = r == row ? prefilter_.reach_ : 1;
    // Directly above or below on the panel.
    const int middle = column + plan.shift(r) - plan.shift(row);
    for (int k = -reach; k <= reach; ++k) {
      const int c = middle + kColours * k;
      if (c < 0 || c >= tile.columns) continue;
      const int subpixel = plan.subpixel(tile, c, r);
      if (subpixel < 0 || subpixel >= plan.row_subpixels()) continue;
      if (std::abs(codes_[static_cast<size_t>(r * tile.columns + c)] - code) > kAgreement)
        return false;
    }
  }
  return true;
}

void DepthPrefilter::Worker::load(const Tile& tile, std::span<const Listed> subpixels, int number) {
  for (size_t r = 0; r < kPacket; ++r) {
    // Idle lanes repeat the last ray.
    const Listed& s = subpixels[std::min(r, subpixels.size() - 1)];
    const bool takes_part = r < subpixels.size() && number < s.rays;
    packet_[0].valid[r] = takes_part ? -1 : 0;
    if (!takes_part && number >= s.rays) continue;
    channel_[r] = s.subpixel % kColours;
    seeds_[r] = sampling::subpixel_seed(tile.row_begin + s.row, s.subpixel, number);
    set_panel_ray(scene_, start_mm_, (*s.places)[static_cast<size_t>(number)].displaced(s.middle),
                  packet_[0], r);
  }
}

void DepthPrefilter::Worker::trace_listed(const Tile& tile) {
  for (size_t first = 0; first < listed_.size(); first += kPacket) {
    const std::span<Listed> some =
        std::span(listed_).subspan(first, std::min(kPacket, listed_.size() - first));
    const int most = std::ranges::max_element(some, {}, &Listed::rays)->rays;
    for (int number = 1; number < most; ++number) {
      load(tile, some, number);
      tracer_.set_seeds(seeds_);
      tracer_.trace_lanes(scene_, prefilter_.plan_, channel_, packet_[0], light_);
      for (size_t r = 0; r < some.size(); ++r)
        if (packet_[0].valid[r] != 0) some[r].sum += light_[r];
    }
  }
}

namespace {

constexpr double kNothing = std::numeric_limits<double>::infinity();

using Colour = std::array<uint8_t, 3>;

Colour between(const Colour& a, const Colour& b, double part) {
  Colour mixed{};
  for (size_t c = 0; c < 3; ++c)
    mixed[c] = static_cast<uint8_t>(std::lround(a[c] + part * (b[c] - a[c])));
  return mixed;
}

Colour colour_of(double depth) {
  constexpr double kDoublings = 3.0;
  constexpr Colour kWhite{255, 255, 255}, kGrey{96, 96, 96};
  if (std::isinf(depth)) return {};
  const double off = std::abs(depth);
  if (off <= 1.0) return between(kWhite, kGrey, off);
  const double part = std::min(std::log2(off) / kDoublings, 1.0);
  return depth > 0.0 ? between({255, 220, 0}, {200, 0, 0}, part)
                     : between({0, 220, 255}, {0, 0, 200}, part);
}

/// RowMeter measures rows for one thread.
class RowMeter {
 public:
  RowMeter(const RowSweep& sweep, const optics::OpticalModel& model)
      : sweep_(sweep),
        evaluator_(model),
        depth_of_field_(model),
        histogram_{.views = model.rig().sheet.pitch.value} {}

  void measure(int row, const DepthPictures& pictures) {
    sweep_.sweep(row, swept_);
    evaluator_.evaluate(row, 0, evaluator_.model().rig().panel.width_px, rays_);
    for (size_t s = 0; s < rays_.size(); ++s) {
      const double depth = depth_at(s);
      histogram_.add(depth, double{swept_.z_mm[s]});
      if (pictures.map != nullptr && s % 3 == 1)
        std::ranges::copy(colour_of(depth), pictures.map->row(row) + s - 1);
      if (pictures.beyond != nullptr)
        pictures.beyond->row(row)[s] = std::abs(depth) > 1.0 ? 255 : 0;
    }
  }
  [[nodiscard]] const DepthHistogram& histogram() const { return histogram_; }

 private:
  [[nodiscard]] double depth_at(size_t s) const {
    if (swept_.cut[s] == SweptRow::kNothing) return kNothing;
    return double{swept_.z_mm[s]} / depth_of_field_.along_mm(rays_.tan_x[s], rays_.tan_y[s]);
  }

  RowSweep::Worker sweep_;
  optics::RowRayEvaluator evaluator_;
  DepthOfField depth_of_field_;
  DepthHistogram histogram_;
  SweptRow swept_;
  optics::RowRays rays_;
};

}  // namespace

void DepthHistogram::add(double depth, double subpixel_z_mm) {
  if (!std::isfinite(depth)) {
    ++nothing;
    return;
  }
  const double off = std::abs(depth);
  if (off * views <= 1.0) ++at_panel;
  ++(off <= 1.0 ? within : depth > 0.0 ? in_front : behind);
  nearest_mm = std::max(nearest_mm, subpixel_z_mm);
  farthest_mm = std::min(farthest_mm, subpixel_z_mm);
  const double bin = std::floor((depth + kReach) * kBinsPerDepth);
  const auto last = static_cast<double>(bins.size() - 1);
  ++bins[static_cast<size_t>(std::clamp(bin, 0.0, last))];
}

DepthHistogram& DepthHistogram::operator+=(const DepthHistogram& other) {
  nothing += other.nothing;
  at_panel += other.at_panel;
  within += other.within;
  in_front += other.in_front;
  behind += other.behind;
  nearest_mm = std::max(nearest_mm, other.nearest_mm);
  farthest_mm = std::min(farthest_mm, other.farthest_mm);
  for (size_t bin = 0; bin < bins.size(); ++bin) bins[bin] += other.bins[bin];
  return *this;
}

DepthHistogram measure_depth(const optics::OpticalModel& model, const Scene& scene, int threads,
                             const DepthPictures& pictures) {
  const RowPlanes planes(model);
  const RowSweep sweep(planes, scene);
  constexpr int kBand = 16;  // rows in ascending order share work
  tbb::enumerable_thread_specific<RowMeter> meters([&] { return RowMeter(sweep, model); });
  tbb::task_arena arena(arena_threads(threads));
  arena.execute([&] {
    tbb::parallel_for(0, (planes.rows() + kBand - 1) / kBand, [&](int band) {
      const FlushDenormals flush;
      const int end = std::min((band + 1) * kBand, planes.rows());
      for (int row = band * kBand; row < end; ++row) meters.local().measure(row, pictures);
    });
  });
  DepthHistogram sum{.views = model.rig().sheet.pitch.value};
  for (const RowMeter& meter : meters) sum += meter.histogram();
  return sum;
}

}  // namespace lenticule::render
