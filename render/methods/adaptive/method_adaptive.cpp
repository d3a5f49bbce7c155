// SPDX-License-Identifier: Apache-2.0
// How a frame is made (docs/render/adaptive.md has the reasons and the formulas):
//
//   key_samples        what is sampled: a few cache views of the scene are traced on a coarse
//                      grid, and it is decided between which samples colours may be interpolated
//   unchanged_regions  which regions of the panel are as in the previous frame
//   retrace            the subpixels whose colour is uncertain are shaded on the surface that is
//                      known already, with as much of their light as the samples around them agree
//                      on
//   audit              a few subpixels are traced as method full does, and tell how large errors
//                      are and which bands are worth trying
//
// This file has what a frame and its threads share, and a thread's work: exact visibility of a row
// by a row sweep, then a look-up of each subpixel's colour in the two nearest cache views. Then it
// goes through the steps of a frame: it tries bands, leaves those to method full that the audit
// rejects or that cost more, and lets the audit of the whole frame state its error.
//
// The work of a step is a series of parallel loops over small items (a row, some packets, a tile)
// of several bands, so that many cores are busy to the end of each loop. No item waits for another.
#include <fmt/format.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/error.h"
#include "frames/frame.h"
#include "render/accel/denormals.h"
#include "render/integrator/pbr_tracer.h"
#include "render/methods/adaptive/audit.h"
#include "render/methods/adaptive/key_samples.h"
#include "render/methods/adaptive/retrace.h"
#include "render/methods/adaptive/unchanged_regions.h"
#include "render/methods/method.h"
#include "render/methods/method_full.h"
#include "render/options/render_options.h"
#include "render/rays/primary_rays.h"
#include "render/row_sweep/row_planes.h"
#include "render/row_sweep/row_sweep.h"
#include "render/scene/scene.h"
#include "render/scene/surface_groups.h"
#include "render/scene/texture.h"
#include "render/shading/light_encoder.h"

namespace lenticule::render {
namespace {

// ---- a frame and the work of each thread on it

constexpr int kBand = TilePlan::kRows;  ///< rows
constexpr int kBlock = 4;               ///< rows and columns of coarse samples in a packet
constexpr int kSampleRows = kBlock * KeySamples::kCoarse;
// Numbers of parts into which work is divided, so that each takes less than a millisecond.
constexpr int kSampleParts = 16;    ///< samples of kSampleRows rows of a cache view
constexpr int kAuditParts = 16;     ///< audited subpixels of a band
constexpr int kShadingParts = 128;  ///< uncertain subpixels of a band
/// Bands that are rendered at the same time, for each thread. Each takes up to 64 bytes for each of
/// its subpixels, if these are uncertain.
constexpr int kBandsPerThread = 2;
constexpr size_t kMostBandBytes = size_t{1} << 29;
/// Factor of the number of soft-light rays for audited subpixels, so that their own noise does
/// not distort the audit.
constexpr int kFinerAudit = 4;
/// Largest share of a band's subpixels that may exceed the tolerated error.
constexpr double kMostBeyond = 0.03;
/// Largest mean square of a band's errors, as a multiple of the frame's: bands with less make up
/// for it.
constexpr double kMostOfBand = 2.0;

/// GroundRow computes once per row what its subpixels share. Thread safety: used by one thread.
/// Lifetime: the scene and the planes must outlive the object.
class GroundRow {
 public:
  /// The scene must have a ground shadow.
  GroundRow(const Scene& scene, const RowPlanes& planes)
      : scene_(scene),
        planes_(planes),
        corners_mm_(scene.backdrop.ground_shadow->corners(scene.scene_from_panel.inverse())) {}

  /// Begins a row whose rays go to `eyes` on the viewing line (mm; tangents of parallel rays).
  void start(const RowPlane& plane, const Interval& eyes) {
    set_range(plane, eyes);
    if (range_mm_.empty()) return;
    row_.emplace(*scene_.backdrop.ground_shadow, scene_.scene_from_panel, plane.lens_y_mm,
                 plane.tan_y);
  }

  /// Returns the range on the panel of the rays that may cross the shadow; empty if none does.
  [[nodiscard]] const Interval& range_mm() const { return range_mm_; }

  /// Returns light_beyond() of a ray of the row.
  [[nodiscard]] double light(double x_mm, double tan_x, int channel) const {
    return component(scene_.backdrop.colour, channel) * row_->light_left(x_mm, tan_x);
  }

 private:
  /// The plane cuts the ground in a line, which the eyes see between its ends.
  void set_range(const RowPlane& plane, const Interval& eyes) {
    const auto above_plane = [&](Vec3 p) { return p.y - plane.lens_y_mm - plane.tan_y * p.z; };
    range_mm_ = {};
    for (size_t n = 0; n < corners_mm_.size(); ++n) {
      const Vec3 a = corners_mm_[n], b = corners_mm_[(n + 1) % corners_mm_.size()];
      const double from = above_plane(a), to = above_plane(b);
      if ((from > 0.0) == (to > 0.0)) continue;
      const Vec3 at = a + (b - a) * (from / (from - to));
      if (!extend_by_view({at.x, at.z}, planes_.inverse_z(), eyes, range_mm_)) {
        range_mm_ = kEverywhere;
        return;
      }
    }
  }

  const Scene& scene_;
  const RowPlanes& planes_;
  std::array<Vec3, 4> corners_mm_;  ///< corners of the ground, in the panel frame
  std::optional<GroundShadow::Row> row_;
  Interval range_mm_;
};

/// AdaptivePlan holds the data for a rig's frames. Lifetime: outlives the frames.
struct AdaptivePlan {
  const RenderOptions& options;
  const RowPlanes& planes;
  const FullTiles& full;
  const TilePlan& tiles;    ///< the tiles of `full`
  const Footprint& centre;  ///< centre of subpixels
  const lookup_kernel::Kernel& kernel;
  Tolerances tolerances;
  AuditSelection selection;
  double most_mean_square;  ///< limit of a frame's mean squared error, in code values squared
};

/// AdaptiveFrame is shared by the threads. The steps are: take samples, mark bends, render bands of
/// rows.
struct AdaptiveFrame {
  /// Reuses `memory` for the samples.
  AdaptiveFrame(const AdaptivePlan& of, const KeyGrid& keys, const Scene& whole, KeySamples& memory,
                frames::WovenFrame& frame)
      : plan(of),
        grid(keys),
        scene(whole),
        out(frame),
        samples(memory),
        groups(whole),
        sweep(of.planes, whole),
        encoder(whole.colour_managed),
        start_mm(primary_start_mm(scene.near_mm, of.planes.model().rig().viewing.distance.value)),
        beams(whole),
        costs{.subpixels = of.planes.row_subpixels() * size_t{kBand},
              .has_pbr = whole.pbr != nullptr,
              .is_soft = of.options.soft.any()} {
    for (size_t at = 0; at < backdrop.size(); ++at)
      backdrop[at] = encoder.code(
          static_cast<float>(component(scene.backdrop.colour, static_cast<int>(at % 3))));
    if (scene.backdrop.flat() || scene.backdrop.ground_shadow) eyes = keys.eyes();
    samples.begin(keys);
    const auto parts = [](int all, int part) {
      return static_cast<size_t>((all + part - 1) / part);
    };
    bands.resize(parts(of.planes.rows(), kBand));
    for (auto* blocks : {&taken.coarse, &taken.others})
      blocks->resize(parts(keys.rows(), kSampleRows));
    taken.bends.resize(static_cast<size_t>(keys.rows()));
  }

  const AdaptivePlan& plan;
  const KeyGrid& grid;
  const Scene& scene;
  frames::WovenFrame& out;
  KeySamples& samples;
  SurfaceGroups groups;
  RowSweep sweep;
  LightEncoder encoder;
  double start_mm;
  BeamTester beams;
  BandCostModel costs;
  std::array<uint8_t, 24> backdrop{};  ///< codes of eight pixels in rows of one backdrop colour
  /// Places on the viewing line to which rays go, if the backdrop has one colour beside the shadow
  /// on the ground: rays far from that and from all objects are not made.
  std::optional<Interval> eyes;

  /// Audit results and costs of a band of rows.
  struct Band {
    AuditErrors retracing, evaluation;
    bool tried = false;     ///< rendered by this method
    bool retraced = false;  ///< left to method full, or tried and rejected
    BandCounts counts;
  };
  std::vector<Band> bands;
  int look = 0;  ///< number of sets of bands that limit_mean_square() rejected

  /// Marks of the samples that were taken: the coarse ones and the others of blocks of
  /// kSampleRows rows of samples, and the bends of rows.
  struct Taken {
    std::vector<uint8_t> coarse, others, bends;
  };
  Taken taken;

  /// Unchanged regions, which reuse the samples in `memory` from the previous frame.
  struct Kept {
    const UnchangedRegions& parts;
    const frames::WovenFrame& frame;
    const std::vector<Band>& bands;
    const Taken& taken;
  };
  std::optional<Kept> kept;

  /// Returns true if samples of the block that begins at a row of samples are kept.
  [[nodiscard]] bool are_kept(std::vector<uint8_t> Taken::*of, int row) const {
    return kept && (kept->taken.*of)[static_cast<size_t>(row / kSampleRows)] != 0;
  }
};

/// Returns part `part` of the elements of a list, which is divided into `parts` of whole packets.
template <class Element>
std::span<Element> part_of(std::span<Element> list, int part, int parts) {
  const size_t packets = (list.size() + kPacket - 1) / kPacket;
  const auto begin = [&](int n) {
    const size_t first = packets * static_cast<size_t>(n) / static_cast<size_t>(parts);
    return std::min(first * kPacket, list.size());
  };
  return list.subspan(begin(part), begin(part + 1) - begin(part));
}

struct SamplePlace {
  int row, column;
};

/// SampleList holds samples to be traced, in the order of their packets.
struct SampleList {
  int first_row, cache_view;
  std::vector<SamplePlace> places;
};

/// BandWork holds a band that is being rendered. Threads may work on different rows and packets.
struct BandWork {
  int first_row = 0;
  bool is_unchanged = false;             ///< copied as a whole
  bool is_given_up = false;              ///< left to method full, without shading
  std::array<BandCounts, kBand> counts;  ///< one per row
  std::atomic<uint64_t> audit_rays;
  std::vector<SampledSubpixel> sampled;
  UncertainBand uncertain;
};

/// AdaptiveWorker does pieces of the work on one frame. The calling thread must flush denormals.
/// Thread safety: used by one thread.
class AdaptiveWorker {
 public:
  /// Lifetime: `frame` must outlive the object.
  explicit AdaptiveWorker(AdaptiveFrame& frame)
      : frame_(frame),
        colours_(frame.plan.options, frame.plan.tiles),
        sweep_(frame.sweep),
        shader_(frame.plan.tiles),
        sampled_tracer_(frame.plan.full.packets(), frame.plan.tiles, frame.plan.centre),
        resolver_(frame.samples, frame.grid, frame.plan.tolerances, frame.scene.colour_managed,
                  frame.plan.options.soft),
        keys_(frame.grid.row_samples()),
        corners_(3 * frame.grid.row_samples()),
        found_row_(frame.plan.planes.row_subpixels()) {
    init_packets({&packet_, 1});
    if (frame.scene.backdrop.ground_shadow) ground_.emplace(frame.scene, frame.plan.planes);
    colours_.tracer().integrate_area_lights(true);
    evaluate_exactly(false);
  }

  /// Lists the coarse samples of kSampleRows rows.
  void list_coarse_samples(SampleList& list) const {
    constexpr int kStep = KeySamples::kCoarse;
    const bool were_taken = frame_.are_kept(&AdaptiveFrame::Taken::coarse, list.first_row);
    for (int column = 0; column < frame_.grid.columns(); column += kBlock * kStep)
      for (int n = 0; n < kBlock * kBlock; ++n)
        list_if_changed(list, {list.first_row + n / kBlock * kStep, column + n % kBlock * kStep},
                        were_taken);
  }

  /// Interpolates the other samples or lists them, after the coarse ones of these rows and of the
  /// rows below are taken. With sampled light none is interpolated, since more samples average out
  /// the noise.
  void list_other_samples(SampleList& list) const {
    constexpr int kStep = KeySamples::kCoarse;
    const bool may_fill = !frame_.plan.options.soft.any();
    const bool were_taken = frame_.are_kept(&AdaptiveFrame::Taken::others, list.first_row);
    const int cache_view = list.cache_view;
    const int end = std::min(list.first_row + kSampleRows, frame_.grid.rows());
    for (int row = list.first_row; row < end; row += kStep)
      for (int column = 0; column < frame_.grid.columns(); column += kStep) {
        const bool were_traced = were_taken && !frame_.samples.is_filled(row, cache_view, column);
        if (may_fill && frame_.samples.fill(row, cache_view, column, frame_.plan.tolerances))
          continue;
        for (const SamplePlace& place : {SamplePlace{row, column + 1}, SamplePlace{row + 1, column},
                                         SamplePlace{row + 1, column + 1}})
          list_if_changed(list, place, were_traced);
      }
  }

  /// Takes a part of the listed samples.
  void take_samples(SampleList& list, int part) {
    const std::span<SamplePlace> places = part_of(std::span(list.places), part, kSampleParts);
    for (size_t first = 0; first < places.size(); first += kPacket)
      trace_samples(list.cache_view,
                    places.subspan(first, std::min(kPacket, places.size() - first)));
  }

  /// Begins a band, and selects what the audit samples: nothing of a band that is copied with its
  /// results.
  void begin_band(BandWork& band) const {
    band.is_unchanged = is_whole_band_unchanged(band.first_row);
    band.counts = {};
    band.audit_rays = 0;
    band.uncertain.clear(frame_.plan.tiles);
    band.sampled.clear();
    if (band.is_unchanged) return;
    band.sampled = sampled_of(band.first_row);
    sampled_tracer_.sort(band.sampled);
  }

  /// Renders a row of a band except for its uncertain subpixels, which it lists.
  void render_row(BandWork& band, int in_band) {
    const int row = band.first_row + in_band;
    if (row >= frame_.plan.planes.rows()) return;
    if (band.is_unchanged) return copy_row(row);
    const KeyGrid::Between between = frame_.grid.between(row);
    find_cells(between);
    flat_row_ = frame_.scene.backdrop.flat();
    if (ground_) {
      ground_->start(plane_of(row), *frame_.eyes);
      flat_row_ = ground_->range_mm().empty();
    }
    sweep_.sweep(row, swept_, frame_.eyes, ground_ ? ground_->range_mm() : Interval{});
    const bool in_order = sweep_.rays().subpixel.empty();
    x_mm_ = (in_order ? sweep_.rays().x_mm : swept_.x_mm).data();
    tan_x_ = (in_order ? sweep_.rays().tan_x : swept_.tan_x).data();
    group_of_cut_.clear();
    for (const SweptCut& cut : swept_.cuts)
      group_of_cut_.push_back(frame_.groups.of(cut.geometry, cut.primitive));
    band.counts[static_cast<size_t>(in_band)].cuts = static_cast<uint32_t>(swept_.cuts.size());
    group_of_cut_.push_back(SurfaceGroups::kNothing);  // read, but not used, in lanes without a cut
    look_up(between);
    sort_row(band, in_band, between);
    std::copy_n(found_row_.codes.data(), frame_.plan.planes.row_subpixels(), frame_.out.row(row));
  }

  /// Traces a part of a band's sampled subpixels.
  void trace_sampled(BandWork& band, int part) {
    evaluate_exactly(true);
    const FrameCounts before = colours_.tracer().counts();
    sampled_tracer_.trace(frame_.scene, band.first_row,
                          part_of(std::span(band.sampled), part, kAuditParts), colours_.tracer());
    const FrameCounts after = colours_.tracer().counts();
    band.audit_rays +=
        after.shadow_rays + after.secondary_rays - before.shadow_rays - before.secondary_rays;
    evaluate_exactly(false);
  }

  /// Decides if a band is given up, after its rows are rendered and its audit is traced. Otherwise
  /// orders its uncertain subpixels for shading.
  void decide(BandWork& band) const {
    band.is_given_up =
        !band.is_unchanged && (are_lookups_rejected(band) || is_shading_expensive(band));
    if (!band.is_given_up) band.uncertain.order(frame_.plan.tiles);
  }

  /// Shades a part of a band's ordered uncertain subpixels.
  void shade(const BandWork& band, int part) {
    shader_.shade(frame_.scene, frame_.start_mm, band.first_row, band.uncertain,
                  part_of(band.uncertain.ordered(), part, kShadingParts), colours_.tracer(),
                  [&](const UncertainSubpixel& s, float light) {
                    frame_.out.row(band.first_row + s.row)[s.at] = frame_.encoder.code(light);
                  });
  }

  /// Ends a band whose subpixels are shaded, unless it is given up. A band that the audit rejects
  /// is marked for retracing.
  void end_band(BandWork& band) {
    const auto number = static_cast<size_t>(band.first_row / kBand);
    AdaptiveFrame::Band& result = frame_.bands[number];
    if (band.is_unchanged) {
      result = frame_.kept->bands[number];
      return;
    }
    AuditErrors retracing, evaluation;
    for (const SampledSubpixel& s : band.sampled) {
      uint8_t& code = frame_.out.row(band.first_row + s.row)[s.at];
      const uint8_t exact = frame_.encoder.code(s.light);
      (s.draw == Draw::Retracing ? retracing : evaluation).add(code, exact);
      code = exact;
    }
    result = {
        .retracing = retracing, .evaluation = evaluation, .tried = true, .counts = counts_of(band)};
    if (band.is_given_up) result.counts.shaded = 0;
    result.retraced = band.is_given_up || is_rejected(result.retracing);
    if (result.retraced && !band.is_given_up && frame_.plan.options.soft.any())
      result.retraced = is_rejected(result.retracing, count_noise(band));
  }

  /// Counts the audited subpixels of a band unless it was tried: it is left to method full, and so
  /// has no errors.
  void audit_if_untried(int number) const {
    AdaptiveFrame::Band& band = frame_.bands[static_cast<size_t>(number)];
    if (band.tried) return;
    band.evaluation.add_exact(static_cast<uint64_t>(
        std::ranges::count(sampled_of(number * kBand), Draw::Evaluation, &SampledSubpixel::draw)));
  }

  /// Renders a tile with method full's exact bytes.
  void retrace_tile(int number) {
    if (!full_)
      full_ = std::make_unique<FullTiles::Worker>(frame_.plan.full, frame_.scene, frame_.beams);
    full_->render(frame_.plan.tiles.tile(number), frame_.out);
  }

  /// Returns the counters of the bands rendered so far.
  [[nodiscard]] FrameCounts counts() {
    FrameCounts counts = counts_;
    counts += colours_.tracer().counts();
    if (full_) counts += full_->counts();
    return counts;
  }

 private:
  /// Selects exact tracing for the audit; otherwise weak rays are skipped.
  void evaluate_exactly(bool exactly) {
    PacketTracer& tracer = colours_.tracer();
    tracer.multiply_samples(exactly ? kFinerAudit : 1);
    tracer.tolerate(exactly ? 0.0F : frame_.plan.tolerances.noticed(frame_.scene.colour_managed));
  }

  void list_if_changed(SampleList& list, SamplePlace place, bool was_taken) const {
    if (place.row >= frame_.grid.rows() || place.column >= frame_.grid.columns()) return;
    const int view = list.cache_view;
    if (!was_taken || !frame_.kept->parts.at(frame_.grid.panel_row(place.row, view),
                                             frame_.grid.ray(place.row, view, place.column).x_mm))
      list.places.push_back(place);
  }

  /// Traces a packet of samples; idle lanes repeat the last one.
  void trace_samples(int cache_view, std::span<const SamplePlace> places) {
    std::array<uint32_t, kPacket> seeds{};
    for (size_t lane = 0; lane < kPacket; ++lane) {
      const SamplePlace& place = places[std::min(lane, places.size() - 1)];
      packet_.valid[lane] = lane < places.size() ? -1 : 0;
      if (colours_.tracer().needs_seeds())
        seeds[lane] = sampling::subpixel_seed(place.row, place.column, 1 + cache_view);
      set_panel_ray(frame_.scene, frame_.start_mm,
                    frame_.grid.ray(place.row, cache_view, place.column), packet_, lane);
    }
    colours_.tracer().set_seeds(seeds);
    colours_.trace(frame_.scene, frame_.groups,
                   frame_.plan.tolerances.noticed(frame_.scene.colour_managed), packet_, found_);
    for (size_t lane = 0; lane < places.size(); ++lane) set_sample(cache_view, places[lane], lane);
  }

  void set_sample(int cache_view, const SamplePlace& place, size_t lane) {
    if (found_.group[lane] == SurfaceGroups::kNothing)
      return frame_.samples.set_nothing(place.row, cache_view, place.column);
    KeySamples::Sample sample{.group = found_.group[lane],
                              .way = found_.notes.way[lane],
                              .light = {.lit = found_.notes.lit[lane],
                                        .hidden = found_.notes.hidden[lane],
                                        .secondary_way = found_.notes.secondary_way[lane],
                                        .around = found_.notes.around[lane]}};
    if (frame_.plan.options.soft.shadow_samples > 0)
      for (size_t area_light = 0; area_light < sample.light.seen.size(); ++area_light)
        sample.light.seen[area_light] =
            KeySamples::Light::parts_of_area_light(found_.notes.seen[area_light][lane]);
    for (size_t c = 0; c < 3; ++c) {
      sample.value[c] = frame_.encoder.parts(found_.light[c][lane]);
      sample.light.secondary[c] = found_.secondary[c][lane];
    }
    frame_.samples.set(place.row, cache_view, place.column, sample);
  }

  void copy_row(int row) {
    const size_t count = frame_.plan.planes.row_subpixels();
    std::copy_n(frame_.kept->frame.row(row), count, frame_.out.row(row));
    counts_.copied_subpixels += count;
  }

  /// Returns true if the band can be copied: no content that its subpixels see and no sample that
  /// they are interpolated from has changed. Retraced bands are not copied, since rendering again
  /// would give other bytes.
  [[nodiscard]] bool is_whole_band_unchanged(int first_row) const {
    const int band = first_row / kBand;
    if (!frame_.kept || !frame_.kept->parts.whole_band(band) ||
        frame_.kept->bands[static_cast<size_t>(band)].retraced)
      return false;
    const KeyGrid::Between first = frame_.grid.between(first_row);
    const KeyGrid::Between last =
        frame_.grid.between(std::min(first_row + kBand, frame_.plan.planes.rows()) - 1);
    return !frame_.samples.rows_changed(std::min(first.above[0], first.above[1]),
                                        std::max(last.above[0], last.above[1]) + 1);
  }

  /// Returns true if a single subpixel can be copied. Subpixels selected by the audit cannot, since
  /// the previous frame holds their exact code instead of the interpolated one.
  [[nodiscard]] bool is_unchanged(int row, size_t at, const KeyGrid::Between& between) const {
    if (!frame_.kept || !frame_.kept->parts.at(row, double{x_mm_[at]}) ||
        frame_.kept->bands[static_cast<size_t>(row / kBand)].retraced)
      return false;
    const auto n = static_cast<uint32_t>(at);
    const AuditSelection& selection = frame_.plan.selection;
    const SampledPair sampled = selection.pair(static_cast<uint32_t>(row), n / selection.one_in());
    if (n == sampled.retracing || n == sampled.evaluation) return false;
    return resolver_.is_as_before(between, found_row_.places(at));
  }

  void look_up(const KeyGrid::Between& between) {
    const size_t count = frame_.plan.planes.row_subpixels();
    const lookup_kernel::SampleRows interval{
        .key = keys_.data(),
        .corners = corners_.data(),
        .plane = static_cast<int>(frame_.samples.row_samples()),
        .part = {between.part[0], between.part[1]}};
    const lookup_kernel::Row row{.x = x_mm_,
                                 .tan = tan_x_,
                                 .z = swept_.z_mm.data(),
                                 .cut = swept_.cut.data(),
                                 .group = group_of_cut_.data(),
                                 .count = static_cast<int>(count),
                                 .most_apart = frame_.plan.tolerances.apart};
    frame_.plan.kernel.look_up(frame_.grid.lookup(), interval, row, found_row_.arrays());
  }

  /// Finds the cells around a row. The rows of even and of odd views change at different panel
  /// rows.
  void find_cells(const KeyGrid::Between& between) {
    for (int cache_view = 0; cache_view < frame_.grid.cache_views(); ++cache_view) {
      const auto odd = static_cast<size_t>(cache_view % 2);
      if (between.above[odd] == keys_row_[odd]) continue;
      const auto first = static_cast<size_t>(cache_view * frame_.grid.stride());
      frame_.samples.find_cells(between.above[odd], cache_view, frame_.plan.tolerances,
                                &keys_[first], &corners_[first]);
    }
    std::copy_n(between.above, 2, keys_row_.begin());
  }

  /// Returns the subpixels of a band that the audit samples.
  [[nodiscard]] std::vector<SampledSubpixel> sampled_of(int first_row) const {
    std::vector<SampledSubpixel> sampled;
    const auto count = static_cast<uint32_t>(frame_.plan.planes.row_subpixels());
    const AuditSelection& selection = frame_.plan.selection;
    const int end = std::min(first_row + kBand, frame_.plan.planes.rows());
    for (int row = first_row; row < end; ++row)
      for (uint32_t stretch = 0; stretch * selection.one_in() < count; ++stretch) {
        const SampledPair pair = selection.pair(static_cast<uint32_t>(row), stretch);
        for (const auto& [at, draw] : {std::pair(pair.retracing, Draw::Retracing),
                                       std::pair(pair.evaluation, Draw::Evaluation)})
          if (at < count)
            sampled.push_back({.at = static_cast<int32_t>(at),
                               .row = static_cast<uint16_t>(row - first_row),
                               .draw = draw});
      }
    return sampled;
  }

  void add_uncertain(UncertainBand::Row& row, int in_band, size_t at,
                     const KeyGrid::Between& between) {
    const auto cut_number = static_cast<size_t>(swept_.cut[at]);
    const SweptCut& cut = swept_.cuts[cut_number];
    const uint32_t group = group_of_cut_[cut_number];
    // Filled in place, since a copy would stall on recent writes.
    UncertainSubpixel& added = row.subpixels.emplace_back();
    added.at = static_cast<int32_t>(at);
    added.row = static_cast<uint16_t>(in_band);
    added.x_mm = x_mm_[at];
    added.tan_x = tan_x_[at];
    added.z_mm = swept_.z_mm[at];
    added.geometry = cut.geometry;
    added.primitive = cut.primitive;
    added.group = group;
    resolver_.resolve({.rows = between,
                       .places = found_row_.places(at),
                       .group = group,
                       .channel = static_cast<int>(at % 3)},
                      added.resolved, row.area_lights);
  }

  /// Writes the colours of subpixels that see nothing, and lists the unresolved ones.
  void sort_row(BandWork& band, int in_band, const KeyGrid::Between& between) {
    static_assert(lookup_kernel::kFound == 0 && lookup_kernel::kNothing == 1);
    constexpr uint64_t kAllNothing = 0x0101010101010101;
    const size_t count = frame_.plan.planes.row_subpixels();
    const int row = band.first_row + in_band;
    UncertainBand::Row& uncertain = band.uncertain.row(static_cast<size_t>(in_band));
    uncertain.plane = plane_of(row);
    uint64_t unknown = 0, copied = 0, nothing = 0;
    for (size_t first = 0; first < count; first += sizeof(uint64_t)) {
      uint64_t eight;  // states; the array is slightly longer than the row
      std::memcpy(&eight, found_row_.states.data() + first, sizeof eight);
      if (eight == 0) continue;
      const bool is_flat = flat_row_ || (ground_ && !is_made(first, first + sizeof eight));
      if (is_flat && eight == kAllNothing) {
        std::memcpy(found_row_.codes.data() + first,
                    frame_.backdrop.data() + first % frame_.backdrop.size(), sizeof eight);
        nothing += std::min(sizeof eight, count - first);
        continue;
      }
      const size_t end = std::min(first + sizeof eight, count);
      for (size_t at = first; at < end; ++at) {
        if (found_row_.states[at] == lookup_kernel::kNothing) {
          found_row_.codes[at] = backdrop_code(row, at);
          ++nothing;
        }
        if (found_row_.states[at] != lookup_kernel::kUnknown) continue;
        if (is_unchanged(row, at, between)) {
          found_row_.codes[at] = frame_.kept->frame.row(row)[at];
          ++copied;
          continue;
        }
        add_uncertain(uncertain, in_band, at, between);
        ++unknown;
      }
    }
    counts_.traced_subpixels += unknown;
    counts_.copied_subpixels += copied;
    counts_.interpolated_subpixels += count - unknown - copied;
    BandCounts& counts = band.counts[static_cast<size_t>(in_band)];
    counts.seen = static_cast<uint32_t>(count - nothing);
    counts.shaded = static_cast<uint32_t>(unknown + copied);
  }

  [[nodiscard]] RowPlane plane_of(int row) const {
    const RowPlanes& planes = frame_.plan.planes;
    return planes.plane_at(row + planes.height_in_row(0));
  }

  /// Returns the code of a subpixel that meets nothing. Rays that were not made see no shadow.
  [[nodiscard]] uint8_t backdrop_code(int row, size_t at) const {
    if (flat_row_ || (ground_ && !is_made(at, at + 1))) return frame_.backdrop[at % 3];
    const auto channel = static_cast<int>(at % 3);
    const double x = double{x_mm_[at]}, tan = double{tan_x_[at]};
    if (ground_) return frame_.encoder.code(static_cast<float>(ground_->light(x, tan, channel)));
    const Scene& scene = frame_.scene;
    const RowPlane plane = plane_of(row);
    const Vec3 from = scene.scene_from_panel.point({x, plane.lens_y_mm, 0.0});
    const Vec3 way = scene.scene_from_panel.vector({-tan, -plane.tan_y, -1.0});
    return frame_.encoder.code(
        static_cast<float>(light_beyond(scene.backdrop, from, way, channel)));
  }

  /// Returns true if any of the subpixels [begin, end) has a ray.
  [[nodiscard]] bool is_made(size_t begin, size_t end) const {
    const PlaneRays& rays = sweep_.rays();
    return !rays.subpixel.empty() || (end > rays.first && begin < rays.end);
  }

  [[nodiscard]] static BandCounts counts_of(const BandWork& band) {
    BandCounts sum{.audited = static_cast<uint32_t>(band.sampled.size()),
                   .rays = band.audit_rays.load()};
    for (const BandCounts& row : band.counts) {
      sum.seen += row.seen;
      sum.shaded += row.shaded;
      sum.cuts += row.cuts;
    }
    return sum;
  }

  /// Returns true if shading the other subpixels of a band would take longer than method full takes
  /// for all of it.
  [[nodiscard]] bool is_shading_expensive(const BandWork& band) const {
    const BandCosts costs = frame_.costs.costs(counts_of(band));
    return costs.shading > costs.full;
  }

  /// Returns true if the audit rejects a band for its lookups alone, so that the other subpixels
  /// need not be shaded.
  [[nodiscard]] bool are_lookups_rejected(const BandWork& band) const {
    if (frame_.plan.options.soft.any()) return false;  // noise is subtracted from the audit
    AuditErrors retracing;
    for (const SampledSubpixel& s : band.sampled) {
      if (s.draw != Draw::Retracing) continue;
      const uint8_t exact = frame_.encoder.code(s.light);
      const bool is_uncertain = std::ranges::binary_search(band.uncertain.row(s.row).subpixels,
                                                           s.at, {}, &UncertainSubpixel::at);
      retracing.add(is_uncertain ? exact : frame_.out.row(band.first_row + s.row)[s.at], exact);
    }
    return is_rejected(retracing);
  }

  /// Returns true if a band has errors that full() should remove: too many beyond the tolerated
  /// error, of which `noise` would be there in any case, or too large ones. A promised mean square
  /// asks for the latter only.
  [[nodiscard]] bool is_rejected(const AuditErrors& retracing, uint64_t noise = 0) const {
    const RenderOptions& options = frame_.plan.options;
    AuditCounts counts = retracing.counts(options.tolerated_error);
    counts.beyond -= std::min(counts.beyond, noise);
    if (options.proven_rmse == 0.0 && needs_retracing(counts, kMostBeyond)) return true;
    // With soft light, method full itself is off by its noise.
    return !options.soft.any() && retracing.mean_square() - 2.0 * retracing.standard_error() >
                                      kMostOfBand * frame_.plan.most_mean_square;
  }

  /// Returns the number of samples of Draw::Retracing whose code under method full exceeds the
  /// tolerated error due to sampling noise alone. The audited subpixels are exact in the frame.
  uint64_t count_noise(BandWork& band) {
    colours_.tracer().tolerate(0.0F);
    colours_.tracer().integrate_area_lights(false);
    sampled_tracer_.trace(frame_.scene, band.first_row, band.sampled, colours_.tracer());
    colours_.tracer().integrate_area_lights(true);
    evaluate_exactly(false);
    AuditErrors noise;
    for (const SampledSubpixel& s : band.sampled)
      if (s.draw == Draw::Retracing)
        noise.add(frame_.encoder.code(s.light), frame_.out.row(band.first_row + s.row)[s.at]);
    return noise.counts(frame_.plan.options.tolerated_error).beyond;
  }

  AdaptiveFrame& frame_;
  ColourTracer colours_;
  ColourTracer::Colours found_;
  RowSweep::Worker sweep_;
  SweptRow swept_;
  std::optional<GroundRow> ground_;
  bool flat_row_ = true;         ///< the backdrop shows one colour in all of the row
  const float* x_mm_ = nullptr;  ///< per subpixel of the last swept row
  const float* tan_x_ = nullptr;
  UncertainShader shader_;
  SampledTracer sampled_tracer_;
  std::unique_ptr<FullTiles::Worker> full_;  ///< created when a band is retraced
  LightResolver resolver_;
  RayPacket packet_{};
  std::vector<uint32_t> keys_;                   ///< see lookup_kernel::SampleRows
  std::vector<lookup_kernel::Corners> corners_;  ///< corners of the same cells
  std::array<int, 2> keys_row_{-1, -1};
  std::vector<uint32_t> group_of_cut_;
  /// Look-up results of a row, see lookup_kernel::Found.
  struct FoundRow {
    std::vector<uint8_t> codes, states;
    std::vector<int32_t> left, cell[2];
    std::vector<float> of_right, part[2];

    explicit FoundRow(size_t subpixels) {
      const size_t room = subpixels + lookup_kernel::kLanes;
      for (auto* bytes : {&codes, &states}) bytes->resize(room);
      for (auto* numbers : {&left, &cell[0], &cell[1]}) numbers->resize(room);
      for (auto* parts : {&of_right, &part[0], &part[1]}) parts->resize(room);
    }
    [[nodiscard]] lookup_kernel::Found arrays() {
      return {.codes = codes.data(),
              .states = states.data(),
              .left = left.data(),
              .of_right = of_right.data(),
              .cell = {cell[0].data(), cell[1].data()},
              .part = {part[0].data(), part[1].data()}};
    }
    [[nodiscard]] std::array<LightResolver::Place, 2> places(size_t at) const {
      const auto odd = static_cast<size_t>(left[at] & 1);
      return {LightResolver::Place{cell[0][at], part[0][at], 1.0F - of_right[at], odd},
              LightResolver::Place{cell[1][at], part[1][at], of_right[at], 1 - odd}};
    }
  };
  FoundRow found_row_;
  FrameCounts counts_;  ///< origin of the colours of the subpixels
};

// ---- the method

/// Returns true if all subpixels of a row have one height, as with vertical stripes.
bool one_plane_a_row(const RowPlanes& planes) {
  for (int row = 0; row < planes.rows(); ++row)
    if (planes.planes_of(row) != 1 || planes.height_in_row(row) != planes.height_in_row(0))
      return false;
  return true;
}

/// Returns true if Embree accepts every ray of the rig as set_panel_ray() makes it. The components
/// are linear in position and direction, so the outermost rays suffice.
bool rays_fit(const Scene& scene, const RowPlanes& planes, const RayReach& reach) {
  const double start_mm =
      primary_start_mm(scene.near_mm, planes.model().rig().viewing.distance.value);
  for (const double y_px : {0.0, static_cast<double>(planes.rows())})
    for (const double x : {reach.panel_mm.low, reach.panel_mm.high})
      for (const double eye : {reach.eyes.low, reach.eyes.high}) {
        const RowPlane plane = planes.plane_at(y_px);
        const double tan = planes.inverse_z() > 0.0 ? (eye - x) * planes.inverse_z() : eye;
        const Affine& to_scene = scene.scene_from_panel;
        const Vec3 from{x + start_mm * tan, plane.lens_y_mm + start_mm * plane.tan_y, start_mm};
        if (!fit_for_embree(to_scene.point(from), to_scene.vector({-tan, -plane.tan_y, -1.0})))
          return false;
      }
  return true;
}

bool is_shiny(const Scene& scene) {
  return scene.pbr != nullptr ||
         std::any_of(scene.materials.begin(), scene.materials.end(), [](const Material& material) {
           return material.specular > 0.0 || material.transmittance > 0.0;
         });
}

/// Root mean square error at which the audit aims, as a multiple of the tolerated error.
constexpr double kMostOfError = 2.0;

/// Returns the limit of a frame's mean squared error.
double most_mean_square(const RenderOptions& options) {
  const double rmse =
      options.proven_rmse > 0.0 ? options.proven_rmse : kMostOfError * options.tolerated_error;
  return rmse * rmse;
}

uint64_t subpixels_of(const RowPlanes& planes) {
  return uint64_t{planes.row_subpixels()} * static_cast<uint64_t>(planes.rows());
}

/// Both selections are denser for a small E: a single sample that is off by half of the code values
/// would otherwise decide about the whole frame.
AuditSelection selection_for(uint64_t subpixels, const RenderOptions& options) {
  constexpr double kSmall = 0.5;
  constexpr uint32_t kDense = kSampledOneIn / 4;
  if (options.proven_rmse > 0.0) {
    const uint32_t one_in = sampled_one_in_for(most_mean_square(options), subpixels);
    return AuditSelection{one_in, std::max(one_in, kDense)};
  }
  return options.tolerated_error < kSmall ? AuditSelection{kDense, kDense} : AuditSelection{};
}

/// Returns the number of bands that are rendered at the same time.
size_t bands_at_once(const RowPlanes& planes, int threads) {
  const auto bands = static_cast<size_t>((planes.rows() + kBand - 1) / kBand);
  const size_t fit = kMostBandBytes / (planes.row_subpixels() * kBand * 64);
  return std::clamp(std::min(fit, size_t{kBandsPerThread} * static_cast<size_t>(threads)),
                    size_t{1}, bands);
}

class AdaptiveMethod final : public Method {
 public:
  AdaptiveMethod(const optics::OpticalModel& model, const RenderOptions& options,
                 const ItemWatcher& watcher)
      : options_(options),
        watcher_(watcher),
        full_options_(options),
        planes_(model, options.isa),
        reach_(reach_of(planes_)),
        full_tiles_(std::make_shared<const FullTiles>(model, options)),
        centre_(model, footprint_samples(1).front()),
        plan_{options_,
              planes_,
              *full_tiles_,
              full_tiles_->plan(),
              centre_,
              LENTICULE_SELECT_KERNEL(options.isa, kLookupKernel),
              Tolerances::for_error(options.tolerated_error),
              selection_for(subpixels_of(planes_), options),
              most_mean_square(options)},
        arena_(arena_threads(options.threads)),
        band_works_(bands_at_once(planes_, arena_.max_concurrency())) {
    // A culling query costs as much as tracing many rays, and there are few samples, which have
    // many rays with soft light only.
    if (!options.soft.any()) options_.use_shaft_culling = false;
    full_options_.copy_unchanged = false;  // this method keeps the last frame itself
  }

  bool set_tolerated_error(double error) override {
    LENTICULE_CHECK(error > 0.0 && std::isfinite(error) && options_.proven_rmse == 0.0);
    if (error == options_.tolerated_error) return true;
    options_.tolerated_error = error;
    plan_.tolerances = Tolerances::for_error(error);
    plan_.most_mean_square = most_mean_square(options_);
    plan_.selection = selection_for(subpixels_of(planes_), options_);
    // Frames and samples of another error are not reused.
    last_ = {};
    before_ = {};
    return true;
  }

  /// Returns false if method full renders this rig or keeps this promise faster. Proofs that
  /// sampled one in three subpixels took 0.87 to 1.05 of its time in four scenes, those that
  /// sampled one in two 1.02 to 1.12, and up to 1.7 where they proved too little.
  [[nodiscard]] bool suits() const {
    constexpr uint32_t kLeastOneIn = 3;
    return one_plane_a_row(planes_) && plan_.selection.one_in() >= kLeastOneIn;
  }

  RenderStatistics render(const Scene& scene, const Stage& stage,
                          frames::WovenFrame& out) override {
    const frames::FrameGeometry& geometry = out.geometry();
    const optics::Panel& panel = planes_.model().rig().panel;
    LENTICULE_CHECK(geometry.width == panel.width_px && geometry.height == panel.height_px &&
                    geometry.format == frames::PixelFormat::Rgb8);
    require_supported(scene, options_);
    if (options_.copy_unchanged && last_.shows(scene)) return last_.copy_to(out);
    if (!rays_fit(scene, planes_, reach_) || is_set_up_expensive(scene)) {
      before_ = {};
      const RenderStatistics statistics = full().render(scene, stage, out);
      if (options_.copy_unchanged && statistics.completed) last_.keep(scene, out, statistics);
      return statistics;
    }
    const auto start = std::chrono::steady_clock::now();
    cancelled_ = false;
    loops_ = 0;
    const KeyGrid grid(planes_, stage, reach_, cache_views_for(planes_, reach_, is_shiny(scene)));
    AdaptiveFrame frame(plan_, grid, scene, samples_, out);
    const Before before = std::exchange(before_, {});
    Before now;
    std::optional<UnchangedRegions> kept;
    if (options_.copy_unchanged && scene.pbr == nullptr) {
      now = {SceneObjects(scene), grid, frame.groups, {}, {}};
      if (before.grid && before.grid->is_same(grid) && *before.groups == frame.groups)
        kept.emplace(planes_, grid.eyes(), scene, options_.soft, before.objects, now.objects);
      if (kept && kept->any()) {
        frame.kept.emplace(AdaptiveFrame::Kept{*kept, last_.frame(), before.bands, before.taken});
        samples_.watch_changes();
      }
    }
    Workers workers([&] { return AdaptiveWorker(frame); });
    bool pays = true;
    arena_.execute([&] {
      pays = try_bands(frame, workers);
      if (!pays) return;
      in_parallel(static_cast<int>(frame.bands.size()),
                  [&](int n) { workers.local().audit_if_untried(n); });
      limit_mean_square(frame);
      retrace_bands(frame, workers);
    });
    RenderStatistics statistics =
        pays ? statistics_of(frame, workers, out.bytes().size()) : full().render(scene, stage, out);
    statistics.completed = statistics.completed && !cancelled_;
    if (options_.copy_unchanged && statistics.completed) {
      last_.keep(scene, out, statistics);
      now.bands = std::move(frame.bands);
      now.taken = std::move(frame.taken);
      if (pays && scene.pbr == nullptr)
        before_ = std::move(now);  // else the last frame has other samples
    }
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    statistics.seconds = elapsed.count();
    return statistics;
  }

 private:
  /// Returns method full, for stages so flat or so deep that rays leave the range of single
  /// precision, since method full checks each ray; and for frames that it renders faster.
  Method& full() {
    if (!full_) full_ = make_method_full(full_tiles_, planes_.model().rig(), full_options_);
    return *full_;
  }

  using Workers = tbb::enumerable_thread_specific<AdaptiveWorker>;

  /// Polls for cancellation before each piece of work.
  bool cancelled() {
    if (!cancelled_ && options_.cancelled && options_.cancelled()) cancelled_ = true;
    return cancelled_;
  }

  template <class Work>
  void in_parallel(int count, const Work& work) {
    const int loop = loops_++;
    tbb::parallel_for(0, count, [&](int n) {
      if (cancelled()) return;
      const FlushDenormals flush;
      if (watcher_) watcher_(loop, false);
      work(options_.tiles_backwards ? count - 1 - n : n);
      if (watcher_) watcher_(loop, true);
    });
  }

  /// Returns true if a scene has so many primitives that finding their surfaces and rows, once a
  /// frame, costs more than a quarter of the time of method full. Traces some hundred subpixels to
  /// learn how many rays start from each.
  [[nodiscard]] bool is_set_up_expensive(const Scene& scene) {
    int64_t primitives = static_cast<int64_t>(scene.spheres.size() + scene.cones.size());
    for (const MeshShape& mesh : scene.meshes)
      primitives += static_cast<int64_t>(mesh.triangles.size());
    const auto subpixels = static_cast<int64_t>(subpixels_of(planes_));
    // `rays`: of each subpixel, in sixteenths, if all see a surface.
    const auto is_expensive = [&](int64_t rays) {
      return 4 * primitives * kPrimitive > subpixels * (kPrimary + kRay * rays / 16) * 3 / 4;
    };
    if (options_.soft.any() || !is_expensive(0)) return false;
    const FlushDenormals flush;
    RecordingTracer tracer(options_);
    SampledTracer sampled_tracer(full_tiles_->packets(), full_tiles_->plan(), centre_);
    std::vector<SampledSubpixel> some;
    constexpr int kOneIn = 256;
    int64_t count = 0;
    for (int row = kBand / 2; row < planes_.rows(); row += 4 * kBand) {
      some.clear();
      for (size_t at = 0; at < planes_.row_subpixels(); at += kOneIn, ++count)
        some.push_back({.at = static_cast<int32_t>(at), .row = kBand / 2});
      sampled_tracer.trace(scene, row - kBand / 2, some, tracer);
    }
    const FrameCounts counts = tracer.counts();
    return is_expensive(static_cast<int64_t>(16 * (counts.shadow_rays + counts.secondary_rays)) /
                        std::max<int64_t>(count, 1));
  }

  /// Tries bands in steps, of which each decides where the next one is worth it. Returns false if
  /// the frame is to be left to method full as a whole: if hardly anything could be interpolated,
  /// or if the bands of the first step lose and none of them can be kept.
  [[nodiscard]] bool try_bands(AdaptiveFrame& frame, Workers& workers) {
    BandOrder order(static_cast<int>(frame.bands.size()));
    bool is_first = true;
    for (std::vector<int> due = order.next(); !due.empty(); due = order.next()) {
      const AdaptiveFrame::Taken samples = needed(frame, due);
      take_samples(frame, samples.coarse, frame.taken.coarse, &AdaptiveWorker::list_coarse_samples,
                   workers);
      if (is_first && shows_small_parts(frame)) return false;
      take_samples(frame, samples.others, frame.taken.others, &AdaptiveWorker::list_other_samples,
                   workers);
      const std::vector<int> rows = newly_taken(samples.bends, frame.taken.bends);
      in_parallel(static_cast<int>(rows.size()), [&](int n) {
        frame.samples.mark_bends(rows[static_cast<size_t>(n)], plan_.tolerances);
      });
      for (size_t first = 0; first < due.size(); first += band_works_.size())
        render_bands(
            std::span(due).subspan(first, std::min(band_works_.size(), due.size() - first)),
            workers);
      note_gains(frame, order);
      if (std::exchange(is_first, false) && order.loses()) return keeps_any(frame);
    }
    return true;
  }

  /// Renders bands, not more than there are elements of band_works_.
  void render_bands(std::span<const int> numbers, Workers& workers) {
    /// Does work(worker, band, part) for all parts of all bands.
    const auto each = [&](int parts, const auto& work) {
      in_parallel(static_cast<int>(numbers.size()) * parts, [&](int n) {
        work(workers.local(), band_works_[static_cast<size_t>(n / parts)], n % parts);
      });
    };
    for (size_t n = 0; n < numbers.size(); ++n) band_works_[n].first_row = numbers[n] * kBand;
    each(1, [](AdaptiveWorker& worker, BandWork& band, int) { worker.begin_band(band); });
    each(kAuditParts + kBand, [](AdaptiveWorker& worker, BandWork& band, int part) {
      if (part < kAuditParts)
        worker.trace_sampled(band, part);
      else
        worker.render_row(band, part - kAuditParts);
    });
    each(1, [](AdaptiveWorker& worker, BandWork& band, int) { worker.decide(band); });
    each(kShadingParts,
         [](AdaptiveWorker& worker, const BandWork& band, int part) { worker.shade(band, part); });
    each(1, [](AdaptiveWorker& worker, BandWork& band, int) { worker.end_band(band); });
  }

  /// Returns true if a tried band is not left to method full.
  static bool keeps_any(const AdaptiveFrame& frame) {
    return std::ranges::any_of(
        frame.bands, [](const AdaptiveFrame::Band& band) { return band.tried && !band.retraced; });
  }

  /// Notes the time that the tried bands have saved against method full, as estimated from
  /// counters, so that the bytes do not depend on the machine's speed. Those whose errors are so
  /// large that limit_mean_square() will leave them to method full have only cost time.
  void note_gains(const AdaptiveFrame& frame, BandOrder& order) const {
    ExpectedErrors errors{.bands = static_cast<double>(frame.bands.size())};
    for (int n = 0; n < static_cast<int>(frame.bands.size()); ++n) {
      const AdaptiveFrame::Band& band = frame.bands[static_cast<size_t>(n)];
      if (!band.tried) continue;
      const BandCosts costs = frame.costs.costs(band.counts);
      order.note(n, (band.retraced ? 0 : costs.full) - costs.spent());
      ++errors.tried;
      if (!band.retraced) errors.add(band.retracing, 1.0);
    }
    for (const size_t n : worst_first(frame)) {
      if (!exceeds_mean_square(errors)) break;
      errors.add(frame.bands[n].retracing, -1.0);
      order.note(static_cast<int>(n), -frame.costs.costs(frame.bands[n].counts).spent());
    }
  }

  /// Returns the tried bands that are not left to method full, those with the largest errors first.
  static std::vector<size_t> worst_first(const AdaptiveFrame& frame) {
    std::vector<size_t> kept;
    for (size_t n = 0; n < frame.bands.size(); ++n)
      if (frame.bands[n].tried && !frame.bands[n].retraced) kept.push_back(n);
    std::ranges::stable_sort(kept, std::greater(),
                             [&](size_t n) { return frame.bands[n].retracing.mean_square(); });
    return kept;
  }

  /// ExpectedErrors holds what the first selection says of the errors of the tried bands.
  struct ExpectedErrors {
    double bands = 0.0;         ///< number of all bands of the frame
    double tried = 0.0;         ///< number of tried bands
    double mean_squares = 0.0;  ///< sum over the bands that are kept
    double variance = 0.0;      ///< variance of mean_squares

    /// Adds the errors of a band, or removes them with the weight -1.
    void add(const AuditErrors& band, double weight) {
      mean_squares += weight * band.mean_square();
      variance += weight * band.standard_error() * band.standard_error();
    }
  };

  /// Returns true if limit_mean_square() will probably not accept these errors. A bound that must
  /// be proven leaves room for a part of them. An estimate must be below the limit by two standard
  /// errors of the whole frame. Few tried bands may show far too large a mean square: they get
  /// the benefit of up to two of their own standard errors.
  [[nodiscard]] bool exceeds_mean_square(const ExpectedErrors& errors) const {
    if (options_.soft.any()) return false;
    const double most = errors.tried * plan_.most_mean_square;
    if (options_.proven_rmse > 0.0) return errors.mean_squares > 0.4 * most;
    const double tried = std::sqrt(errors.tried / errors.bands);
    const double deviation = std::sqrt(std::max(errors.variance, 0.0));
    return errors.mean_squares + 2.0 * (tried - (1.0 - tried)) * deviation > most;
  }

  /// Leaves those bands to method full whose errors are largest, as many as are necessary for the
  /// limit of the frame's mean square. The order of the bands is that of the first selection; what
  /// is enough is judged by the second, in at most kMeanSquareLooks looks.
  void limit_mean_square(AdaptiveFrame& frame) const {
    if (options_.soft.any()) return;  // method full itself is off by its noise
    const std::vector<size_t> worst = worst_first(frame);
    double left = 0.0;
    for (const AdaptiveFrame::Band& band : frame.bands)
      if (band.tried && !band.retraced) left += band.retracing.mean_square();
    size_t next = 0;
    while (frame.look < kMeanSquareLooks - 1 && exceeds_mean_square(frame)) {
      // The worst bands are retraced before each look, until half of the mean square is gone; all
      // are before the last.
      const double enough = ++frame.look == kMeanSquareLooks - 1 ? -1.0 : left / 2.0;
      while (next < worst.size() && left > enough) {
        AdaptiveFrame::Band& band = frame.bands[worst[next++]];
        left -= band.retracing.mean_square();
        band.retraced = true;
      }
    }
  }

  [[nodiscard]] bool exceeds_mean_square(const AdaptiveFrame& frame) const {
    const AuditErrors errors = evaluation_of(frame);
    const double mean_square = options_.proven_rmse > 0.0
                                   ? bound_of_mean_square(errors, frame.look)
                                   : errors.mean_square() + 2.0 * errors.standard_error();
    return mean_square > plan_.most_mean_square;
  }

  /// Returns the evaluation of the frame as it is delivered: bands of method full have no errors.
  static AuditErrors evaluation_of(const AdaptiveFrame& frame) {
    AuditErrors errors;
    for (const AdaptiveFrame::Band& band : frame.bands)
      if (band.retraced)
        errors.add_exact(band.evaluation.sampled());
      else
        errors += band.evaluation;
    return errors;
  }

  /// Renders the bands that were rejected or not tried.
  void retrace_bands(AdaptiveFrame& frame, Workers& workers) {
    std::vector<int> tiles;
    for (int n = 0; n < static_cast<int>(frame.bands.size()); ++n) {
      AdaptiveFrame::Band& band = frame.bands[static_cast<size_t>(n)];
      band.retraced = band.retraced || !band.tried;
      const int per_band = plan_.tiles.per_band();
      for (int tile = 0; band.retraced && tile < per_band; ++tile)
        tiles.push_back(n * per_band + tile);
    }
    in_parallel(static_cast<int>(tiles.size()),
                [&](int n) { workers.local().retrace_tile(tiles[static_cast<size_t>(n)]); });
  }

  /// Marks the samples that bands need: the rows around them with their neighbours, for the bends,
  /// and the coarse ones of the blocks beside these, see KeySamples::fill().
  [[nodiscard]] AdaptiveFrame::Taken needed(const AdaptiveFrame& frame,
                                            const std::vector<int>& bands) const {
    AdaptiveFrame::Taken needed{.coarse = std::vector<uint8_t>(frame.taken.coarse.size()),
                                .others = std::vector<uint8_t>(frame.taken.others.size()),
                                .bends = std::vector<uint8_t>(frame.taken.bends.size())};
    const auto mark = [](std::vector<uint8_t>& marks, int first, int last) {
      for (int n = std::max(first, 0); n <= last && n < static_cast<int>(marks.size()); ++n)
        marks[static_cast<size_t>(n)] = 1;
    };
    for (const int band : bands) {
      const int first_row = band * kBand;
      const KeyGrid::Between first = frame.grid.between(first_row);
      const KeyGrid::Between last =
          frame.grid.between(std::min(first_row + kBand, planes_.rows()) - 1);
      const int above = std::min(first.above[0], first.above[1]);
      const int below = std::max(last.above[0], last.above[1]) + 1;
      mark(needed.bends, above, below);
      const int block = std::max(above - 1, 0) / kSampleRows;
      const int last_block = (below + 1) / kSampleRows;
      mark(needed.others, block, last_block);
      mark(needed.coarse, block - 1, last_block + 1);
    }
    return needed;
  }

  /// Returns the numbers of what is marked and not yet taken, which is taken afterwards.
  static std::vector<int> newly_taken(const std::vector<uint8_t>& marks,
                                      std::vector<uint8_t>& taken) {
    std::vector<int> numbers;
    for (size_t n = 0; n < marks.size(); ++n)
      if (marks[n] != 0 && std::exchange(taken[n], uint8_t{1}) == 0)
        numbers.push_back(static_cast<int>(n));
    return numbers;
  }

  /// Takes the samples that `list_samples` lists in the marked blocks that are not yet taken.
  void take_samples(const AdaptiveFrame& frame, const std::vector<uint8_t>& marks,
                    std::vector<uint8_t>& taken,
                    void (AdaptiveWorker::*list_samples)(SampleList&) const, Workers& workers) {
    std::vector<SampleList> lists;
    for (const int block : newly_taken(marks, taken))
      for (int view = 0; view < frame.grid.cache_views(); ++view)
        lists.push_back({block * kSampleRows, view, {}});
    in_parallel(static_cast<int>(lists.size()),
                [&](int n) { (workers.local().*list_samples)(lists[static_cast<size_t>(n)]); });
    in_parallel(static_cast<int>(lists.size()) * kSampleParts, [&](int n) {
      workers.local().take_samples(lists[static_cast<size_t>(n / kSampleParts)], n % kSampleParts);
    });
  }

  /// Returns true if most of the coarse samples taken so far show another surface or another colour
  /// than those beside and below them. Hardly any subpixel could be interpolated, and the other
  /// samples would be lost time. Scenes that gain from the method agree in at least three of five
  /// places, scenes of small parts or fine textures in less than every other one. Where few places
  /// show a surface, it may be one that is small beside the distance of the samples and gains
  /// nevertheless: so less than one in four decides.
  [[nodiscard]] bool shows_small_parts(const AdaptiveFrame& frame) const {
    if (options_.soft.any()) return false;  // each subpixel has many rays
    constexpr int kStep = KeySamples::kCoarse;
    constexpr int64_t kFew = 1024, kMany = 4096;
    const int most_apart = std::max(plan_.tolerances.alike, plan_.tolerances.unlike);
    int64_t seen = 0, alike = 0;
    for (int row = 0; row + kStep < frame.grid.rows(); row += kStep) {
      const auto is_taken = [&](int at) {
        return frame.taken.coarse[static_cast<size_t>(at / kSampleRows)] != 0;
      };
      if (!is_taken(row) || !is_taken(row + kStep)) continue;
      for (int cache_view = 0; cache_view < frame.grid.cache_views(); ++cache_view)
        for (int column = 0; column + kStep < frame.grid.columns(); column += kStep) {
          if (samples_.shows_nothing(row, cache_view, column)) continue;
          ++seen;
          alike += samples_.shows_one_surface(row, cache_view, column, most_apart) ? 1 : 0;
        }
    }
    return seen >= kFew && (seen < kMany ? 4 : 2) * alike < seen;
  }

  [[nodiscard]] RenderStatistics statistics_of(const AdaptiveFrame& frame, Workers& workers,
                                               uint64_t subpixels) const {
    RenderStatistics statistics;
    for (AdaptiveWorker& worker : workers) statistics += worker.counts();
    for (size_t n = 0; n < frame.bands.size(); ++n) {
      if (!frame.bands[n].retraced) continue;
      const int rows = std::min(kBand, planes_.rows() - static_cast<int>(n) * kBand);
      const uint64_t retraced = planes_.row_subpixels() * static_cast<uint64_t>(rows);
      statistics.retraced_subpixels += retraced;
      if (!frame.bands[n].tried) statistics.traced_subpixels += retraced;
    }
    const AuditErrors errors = evaluation_of(frame);
    const AuditCounts audit = errors.counts(options_.tolerated_error);
    statistics.subpixels = subpixels;
    statistics.audited_subpixels = audit.sampled;
    statistics.audited_beyond = audit.beyond;
    statistics.audited_rmse = std::sqrt(errors.mean_square());
    if (!keeps_any(frame)) return statistics;  // every band comes from method full
    statistics.beyond_bound = bound_of_share(audit, frame.look);
    statistics.rmse_bound = std::sqrt(bound_of_mean_square(errors, frame.look));
    return statistics;
  }

  RenderOptions options_;
  ItemWatcher watcher_;
  int loops_ = 0;  ///< parallel loops of the frame so far
  RenderOptions full_options_;
  RowPlanes planes_;
  RayReach reach_;
  std::shared_ptr<const FullTiles> full_tiles_;
  Footprint centre_;
  AdaptivePlan plan_;
  LastFrame last_;
  /// The input of the samples and of the last frame.
  struct Before {
    SceneObjects objects;
    std::optional<KeyGrid> grid;
    std::optional<SurfaceGroups> groups;
    std::vector<AdaptiveFrame::Band> bands;
    AdaptiveFrame::Taken taken;
  };
  Before before_;
  KeySamples samples_;            ///< memory is kept from frame to frame
  std::unique_ptr<Method> full_;  ///< created when needed
  std::atomic<bool> cancelled_{false};
  tbb::task_arena arena_;
  std::vector<BandWork> band_works_;  ///< memory is kept from frame to frame
};

}  // namespace

std::unique_ptr<Method> make_method_adaptive(const optics::OpticalModel& model,
                                             const RenderOptions& options,
                                             const ItemWatcher& watcher) {
  if (!(options.tolerated_error >= 0.0) || !std::isfinite(options.tolerated_error))
    throw Error(ErrorKind::Usage, "--error: not a number of code values, 0 or more",
                "0 gives exactly the frames of method full; 2 is a good compromise");
  if (options.tolerated_error == 0.0) return make_method_full(model, options);
  if (options.proven_rmse > 0.0 && options.soft.any())
    throw Error(ErrorKind::Usage, "--psnr: cannot be promised with soft light, which is noise",
                "use --error, for example --error 2");
  if (options.samples != 1)
    throw Error(ErrorKind::Usage, "method adaptive: takes one sample per subpixel",
                "use method full for several");
  auto method = std::make_unique<AdaptiveMethod>(model, options, watcher);
  if (!method->suits()) return make_method_full(model, options);
  return method;
}

void promise_psnr(double db, RenderOptions& options) {
  constexpr double kLeast = 20.0, kMost = 70.0;
  if (!(db >= kLeast && db <= kMost))
    throw Error(ErrorKind::Usage, fmt::format("--psnr {}: not in {} ... {} dB", db, kLeast, kMost),
                "40 is a good compromise; --error 0 is exact");
  options.proven_rmse = 255.0 / std::pow(10.0, db / 20.0);
  // Half of the mean square is left for errors that the audit could not see. A larger error saves
  // little more, and gives frames that need bands of method full to keep the promise.
  options.tolerated_error = options.proven_rmse;
}

}  // namespace lenticule::render
