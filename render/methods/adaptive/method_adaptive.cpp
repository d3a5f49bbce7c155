// SPDX-License-Identifier: Apache-2.0
// How a frame is made (docs/render/rendering-adaptive.md has the reasons and the formulas):
//
//   key_samples     what is sampled: a few cache views of the scene are traced on a coarse grid,
//                   and it is decided between which samples colours may be interpolated
//   adaptive_frame  what a frame and its threads share, which regions are as in the previous frame,
//                   and a thread's work on a band of rows: exact visibility by a row sweep, then a
//                   look-up of each subpixel's colour in the two nearest cache views
//   retrace         the subpixels whose colour is uncertain are shaded on the surface that is known
//                   already, with as much of their light as the samples around them agree on
//   audit           a few subpixels are traced as method full does, and tell how large errors are
//   bands           which bands are worth trying, from what the bands before have gained
//
// This file goes through the steps of a frame: it tries bands, leaves those to method full that the
// audit rejects or that cost more, and lets the audit of the whole frame state its error.
#include "render/methods/adaptive/method_adaptive.h"

#include <fmt/format.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "base/error.h"
#include "render/accel/denormals.h"
#include "render/integrator/pbr_tracer.h"
#include "render/methods/adaptive/adaptive_frame.h"
#include "render/methods/adaptive/audit.h"
#include "render/methods/method_full.h"
#include "render/rays/primary_rays.h"

namespace lenticule::render {
namespace {

const lookup_kernel::Kernel& lookup_kernel_for(Isa isa) {
  return LENTICULE_SELECT_KERNEL(isa, kLookupKernel);
}

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

/// Disables culling queries unless light is sampled: a query costs as much as tracing many rays,
/// and there are few samples; with soft light each sample has many rays.
RenderOptions with_little_culling(RenderOptions options) {
  options.use_shaft_culling = options.use_shaft_culling && options.soft.any();
  return options;
}

/// Returns the options of method full within method adaptive, which keeps the last frame itself.
RenderOptions without_copies(RenderOptions options) {
  options.copy_unchanged = false;
  return options;
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

class AdaptiveMethod final : public Method {
 public:
  AdaptiveMethod(const optics::OpticalModel& model, const RenderOptions& options)
      : options_(with_little_culling(options)),
        full_options_(without_copies(options)),
        planes_(model, options.isa),
        reach_(reach_of(planes_)),
        full_tiles_(std::make_shared<const FullTiles>(model, options)),
        centre_(model, footprint_samples(1).front()),
        plan_{options_,
              planes_,
              *full_tiles_,
              full_tiles_->plan(),
              centre_,
              lookup_kernel_for(options.isa),
              Tolerances::for_error(options.tolerated_error),
              selection_for(subpixels_of(planes_), options),
              most_mean_square(options)},
        arena_(options.threads > 0 ? options.threads : tbb::task_arena::automatic) {}

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

  [[nodiscard]] bool suits_rig() const { return one_plane_a_row(planes_); }

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
    const KeyGrid grid(planes_, stage, reach_, spacing_for(planes_, reach_, is_shiny(scene)));
    AdaptiveFrame frame(plan_, grid, scene, samples_, out);
    const Before before = std::exchange(before_, {});
    Before now;
    std::optional<UnchangedRegions> kept;
    if (options_.copy_unchanged && scene.pbr == nullptr) {
      now = {SceneObjects(scene), grid, frame.groups, {}, {}};
      if (before.grid && before.grid->is_same(grid) && *before.groups == frame.groups)
        kept.emplace(planes_, grid.eyes(), scene, options_.soft, before.objects, now.objects);
      if (kept && kept->any()) frame.keep({&*kept, &last_.frame(), &before.bands, &before.taken});
    }
    Workers workers([&] { return AdaptiveWorker(frame); });
    bool pays = true;
    arena_.execute([&] {
      pays = try_bands(frame, workers);
      if (!pays) return;
      audit_untried_bands(frame, workers);
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
    tbb::parallel_for(0, count, [&](int n) {
      if (cancelled()) return;
      const FlushDenormals flush;
      work(options_.tiles_backwards ? count - 1 - n : n);
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
    const auto is_expensive = [&](int64_t rays) {
      return 4 * time_of_set_up(primitives) > time_of_full(subpixels, rays) * 3 / 4;
    };
    if (options_.soft.any() || !is_expensive(0)) return false;
    const FlushDenormals flush;
    RecordingTracer tracer(options_);
    SampledSubpixels some(full_tiles_->packets(), full_tiles_->plan(), centre_);
    constexpr int kOneIn = 256;
    int64_t count = 0;
    for (int row = kBand / 2; row < planes_.rows(); row += 4 * kBand) {
      some.clear();
      for (size_t at = 0; at < planes_.row_subpixels(); at += kOneIn, ++count)
        some.add({.at = static_cast<int32_t>(at), .row = kBand / 2});
      some.trace(scene, row - kBand / 2, tracer);
    }
    const FrameCounts counts = tracer.counts();
    return is_expensive(static_cast<int64_t>(16 * (counts.shadow_rays + counts.secondary_rays)) /
                        std::max<int64_t>(count, 1));
  }

  static constexpr int kBand = AdaptiveWorker::kBand;
  static constexpr int kSampleRows = AdaptiveWorker::kSampleRows;

  /// Tries bands in steps, of which each decides where the next one is worth it. Returns false if
  /// the frame is to be left to method full as a whole: if hardly anything could be interpolated,
  /// or if the bands of the first step lose and none of them can be kept.
  [[nodiscard]] bool try_bands(AdaptiveFrame& frame, Workers& workers) {
    BandOrder order(static_cast<int>(frame.bands.size()));
    bool is_first = true;
    for (std::vector<int> due = order.next(); !due.empty(); due = order.next()) {
      const AdaptiveFrame::Taken samples = needed(frame, due);
      take_coarse_samples(frame, workers, samples);
      if (is_first && shows_small_parts(frame)) return false;
      take_other_samples(frame, workers, samples);
      in_parallel(static_cast<int>(due.size()),
                  [&](int n) { workers.local().render_band(due[static_cast<size_t>(n)] * kBand); });
      note_gains(frame, order);
      if (std::exchange(is_first, false) && order.loses()) return keeps_any(frame);
    }
    return true;
  }

  /// Returns true if a tried band is not left to method full.
  static bool keeps_any(const AdaptiveFrame& frame) {
    return std::ranges::any_of(
        frame.bands, [](const AdaptiveFrame::Band& band) { return band.tried && !band.retraced; });
  }

  /// Notes what the tried bands have gained. Those whose errors are so large that
  /// limit_mean_square() will leave them to method full have only cost time.
  void note_gains(const AdaptiveFrame& frame, BandOrder& order) const {
    std::vector<int> kept;
    ExpectedErrors errors{.bands = static_cast<double>(frame.bands.size())};
    for (int n = 0; n < static_cast<int>(frame.bands.size()); ++n) {
      const AdaptiveFrame::Band& band = frame.bands[static_cast<size_t>(n)];
      if (!band.tried) continue;
      order.note(n, gain_of(frame, band));
      ++errors.tried;
      if (band.retraced) continue;
      kept.push_back(n);
      errors.add(band.retracing, 1.0);
    }
    const auto errors_of = [&](int n) -> const AuditErrors& {
      return frame.bands[static_cast<size_t>(n)].retracing;
    };
    std::ranges::stable_sort(kept, std::greater(),
                             [&](int n) { return errors_of(n).mean_square(); });
    for (const int n : kept) {
      if (!exceeds_mean_square(errors)) break;
      errors.add(errors_of(n), -1.0);
      order.note(n, -frame.costs.costs(frame.bands[static_cast<size_t>(n)].counts).spent());
    }
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

  /// Lets the bands that were not tried count in the evaluation of the frame.
  void audit_untried_bands(AdaptiveFrame& frame, Workers& workers) {
    in_parallel(static_cast<int>(frame.bands.size()), [&](int n) {
      if (!frame.bands[static_cast<size_t>(n)].tried) workers.local().audit_untried_band(n * kBand);
    });
  }

  /// Leaves those bands to method full whose errors are largest, as many as are necessary for the
  /// limit of the frame's mean square. The order of the bands is that of the first selection; what
  /// is enough is judged by the second, at most kMeanSquareLooks times.
  void limit_mean_square(AdaptiveFrame& frame) const {
    if (options_.soft.any()) return;  // method full itself is off by its noise
    std::vector<AdaptiveFrame::Band*> worst;
    double left = 0.0;
    for (AdaptiveFrame::Band& band : frame.bands)
      if (band.tried && !band.retraced) {
        worst.push_back(&band);
        left += band.retracing.mean_square();
      }
    std::ranges::stable_sort(worst, std::greater(), [](const AdaptiveFrame::Band* band) {
      return band->retracing.mean_square();
    });
    size_t next = 0;
    for (int look = 1; look < kMeanSquareLooks && exceeds_mean_square(frame); ++look) {
      // Each look retraces the worst bands, until half of the mean square is gone; the last look
      // retraces all.
      const double enough = look == kMeanSquareLooks - 1 ? -1.0 : left / 2.0;
      while (next < worst.size() && left > enough) {
        left -= worst[next]->retracing.mean_square();
        worst[next++]->retraced = true;
      }
    }
  }

  [[nodiscard]] bool exceeds_mean_square(const AdaptiveFrame& frame) const {
    const AuditErrors errors = evaluation_of(frame);
    const double mean_square = options_.proven_rmse > 0.0
                                   ? bound_of_mean_square(errors)
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
    in_parallel(static_cast<int>(frame.bands.size()), [&](int n) {
      const AdaptiveFrame::Band& band = frame.bands[static_cast<size_t>(n)];
      if (!band.tried || band.retraced) workers.local().retrace_band(n * kBand);
    });
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

  /// Takes what is marked and not yet taken, in each of `cache_views` views.
  template <class Take>
  void take_marked(const std::vector<uint8_t>& marks, std::vector<uint8_t>& taken, int cache_views,
                   const Take& take) {
    in_parallel(static_cast<int>(marks.size()) * cache_views, [&](int n) {
      const auto at = static_cast<size_t>(n / cache_views);
      if (marks[at] != 0 && taken[at] == 0) take(n / cache_views, n % cache_views);
    });
    for (size_t n = 0; n < taken.size(); ++n) taken[n] = std::max(taken[n], marks[n]);
  }

  void take_coarse_samples(AdaptiveFrame& frame, Workers& workers,
                           const AdaptiveFrame::Taken& samples) {
    take_marked(samples.coarse, frame.taken.coarse, frame.grid.cache_views(),
                [&](int block, int cache_view) {
                  workers.local().take_coarse_samples(block * kSampleRows, cache_view);
                });
  }

  void take_other_samples(AdaptiveFrame& frame, Workers& workers,
                          const AdaptiveFrame::Taken& samples) {
    take_marked(samples.others, frame.taken.others, frame.grid.cache_views(),
                [&](int block, int cache_view) {
                  workers.local().take_other_samples(block * kSampleRows, cache_view);
                });
    take_marked(samples.bends, frame.taken.bends, 1,
                [&](int row, int) { frame.samples.mark_bends(row, plan_.tolerances); });
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

  /// Estimates the time that a tried band has saved against method full. Only counters decide, so
  /// that the bytes do not depend on the machine's speed.
  [[nodiscard]] static int64_t gain_of(const AdaptiveFrame& frame,
                                       const AdaptiveFrame::Band& band) {
    const BandCosts costs = frame.costs.costs(band.counts);
    return (band.retraced ? 0 : costs.full) - costs.spent();
  }

  [[nodiscard]] RenderStatistics statistics_of(const AdaptiveFrame& frame, Workers& workers,
                                               uint64_t subpixels) const {
    RenderStatistics statistics;
    for (AdaptiveWorker& worker : workers) statistics += worker.counts();
    const AuditErrors errors = evaluation_of(frame);
    const AuditCounts audit = errors.counts(options_.tolerated_error);
    statistics.subpixels = subpixels;
    statistics.audited_subpixels = audit.sampled;
    statistics.audited_beyond = audit.beyond;
    statistics.audited_rmse = std::sqrt(errors.mean_square());
    if (!keeps_any(frame)) return statistics;  // every band comes from method full
    statistics.beyond_bound = bound_of_share(audit);
    statistics.rmse_bound = std::sqrt(bound_of_mean_square(errors));
    return statistics;
  }

  RenderOptions options_;
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
};

}  // namespace

std::unique_ptr<Method> make_method_adaptive(const optics::OpticalModel& model,
                                             const RenderOptions& options) {
  if (!(options.tolerated_error >= 0.0) || !std::isfinite(options.tolerated_error))
    throw Error(ErrorKind::Usage, "--error: not a number of code values",
                "0 gives exactly the frames of method full; 2 is a good compromise");
  if (options.tolerated_error == 0.0) return make_method_full(model, options);
  if (options.proven_rmse > 0.0 && options.soft.any())
    throw Error(ErrorKind::Usage, "--psnr: cannot be promised with soft light, which is noise",
                "use --error, for example --error 2");
  if (options.samples != 1)
    throw Error(ErrorKind::Usage, "method adaptive: takes one sample per subpixel",
                "use method full for several");
  auto method = std::make_unique<AdaptiveMethod>(model, options);
  if (!method->suits_rig()) return make_method_full(model, options);
  return method;
}

void promise_psnr(double db, RenderOptions& options) {
  constexpr double kLeast = 20.0, kMost = 70.0;
  if (!(db >= kLeast && db <= kMost))
    throw Error(ErrorKind::Usage, fmt::format("--psnr {}: not in {} ... {} dB", db, kLeast, kMost),
                "40 is a good compromise; --error 0 is exact");
  options.proven_rmse = 255.0 / std::pow(10.0, db / 20.0);
  // A third of the mean square is left for errors that the audit could not see. A larger error
  // saves little more, and gives frames that need bands of method full to keep the promise.
  options.tolerated_error = options.proven_rmse;
}

}  // namespace lenticule::render
