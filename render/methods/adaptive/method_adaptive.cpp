// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/method_adaptive.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "base/error.h"
#include "render/accel/denormals.h"
#include "render/culling/last_frame.h"
#include "render/integrator/pbr_tracer.h"
#include "render/methods/adaptive/adaptive_frame.h"
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

/// Returns true if Embree accepts every ray of the rig as panel_rays.h makes it. The components are
/// linear in position and direction, so the outermost rays suffice.
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

bool is_shiny(const Scene& scene) {
  return scene.pbr != nullptr ||
         std::any_of(scene.materials.begin(), scene.materials.end(), [](const Material& material) {
           return material.specular > 0.0 || material.transmittance > 0.0;
         });
}

class AdaptiveMethod final : public Method {
 public:
  AdaptiveMethod(const optics::OpticalModel& model, const RenderOptions& options)
      : options_(with_little_culling(options)),
        full_options_(options),
        planes_(model, options.isa),
        reach_(reach_of(planes_)),
        full_tiles_(model, options),
        centre_(model, footprint_samples(1).front()),
        plan_{options_,
              planes_,
              full_tiles_,
              full_tiles_.plan(),
              centre_,
              lookup_kernel_for(options.isa),
              Agreement::for_error(options.tolerated_error)},
        arena_(options.threads > 0 ? options.threads : tbb::task_arena::automatic) {}

  [[nodiscard]] bool suits_rig() const { return one_plane_a_row(planes_); }

  RenderStatistics render(const Scene& scene, const Stage& stage,
                          frames::WovenFrame& out) override {
    const frames::FrameGeometry& geometry = out.geometry();
    const optics::Panel& panel = planes_.model().rig().panel;
    LENTICULE_CHECK(geometry.width == panel.width_px && geometry.height == panel.height_px &&
                    geometry.format == frames::PixelFormat::Rgb8);
    require_supported(scene, options_);
    if (options_.copy_unchanged && last_.shows(scene)) return last_.copy_to(out);
    if (!rays_fit(scene, planes_, reach_)) {
      before_ = {};
      return full().render(scene, stage, out);
    }
    const auto start = std::chrono::steady_clock::now();
    cancelled_ = false;
    const KeyGrid grid(planes_, stage, reach_, spacing_for(planes_, reach_, is_shiny(scene)));
    AdaptiveFrame frame(plan_, grid, scene, samples_, out);
    const Before before = std::exchange(before_, {});
    Before now;
    std::optional<UnchangedRegions> kept;
    if (options_.copy_unchanged && scene.pbr == nullptr) {
      now = {SceneObjects(scene), grid, frame.groups, {}};
      if (before.grid && before.grid->is_same(grid) && *before.groups == frame.groups)
        kept.emplace(planes_, grid.eyes(), scene, options_.soft, before.objects, now.objects);
      if (kept && kept->any()) frame.keep({&*kept, &last_.frame(), &before.bands});
    }
    Workers workers([&] { return AdaptiveWorker(frame); });
    bool pays = true;
    arena_.execute([&] {
      take_samples(frame, workers);
      mark_bends(frame);
      render_bands(workers, Bands::OnTrial);
      pays = trial_pays(workers);
      if (pays) render_bands(workers, Bands::Others);
    });
    RenderStatistics statistics =
        pays ? statistics_of(workers, out.bytes().size()) : full().render(scene, stage, out);
    statistics.completed = statistics.completed && !cancelled_;
    if (options_.copy_unchanged && statistics.completed) {
      last_.keep(scene, out);
      now.bands = std::move(frame.bands);
      if (pays && scene.pbr == nullptr)
        before_ = std::move(now);  // else the last frame has other samples
    }
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    statistics.seconds = elapsed.count();
    return statistics;
  }

 private:
  /// Returns method full, for metallic-roughness materials; for stages so flat or so deep that rays
  /// leave the range of single precision, since method full checks each ray; and for frames of
  /// which the audit rejects most bands.
  Method& full() {
    if (!full_) full_ = make_method_full(planes_.model(), full_options_);
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

  void take_samples(AdaptiveFrame& frame, Workers& workers) {
    constexpr int kRows = AdaptiveWorker::kSampleRows;
    const int pictures = frame.grid.pictures();
    const int blocks = (frame.grid.rows() + kRows - 1) / kRows * pictures;
    in_parallel(blocks, [&](int n) {
      workers.local().take_coarse_samples(n / pictures * kRows, n % pictures);
    });
    in_parallel(blocks, [&](int n) {
      workers.local().take_other_samples(n / pictures * kRows, n % pictures);
    });
  }

  void mark_bends(AdaptiveFrame& frame) {
    in_parallel(frame.grid.rows(),
                [&](int row) { frame.samples.mark_bends(row, plan_.agreement); });
  }

  /// Trial bands, spread over the frame, decide if the other bands are rendered this way.
  enum class Bands { OnTrial, Others };
  static bool is_on_trial(int band) {
    constexpr int kOneIn = 16;
    return band % kOneIn == kOneIn / 2;
  }

  void render_bands(Workers& workers, Bands which) {
    constexpr int kBand = AdaptiveWorker::kBand;
    in_parallel((planes_.rows() + kBand - 1) / kBand, [&](int band) {
      if (is_on_trial(band) == (which == Bands::OnTrial)) workers.local().render_band(band * kBand);
    });
  }

  /// Returns true if the method is faster than method full. Rejected bands are traced twice; if
  /// four fifths of the trial bands are rejected, method full is faster for the whole frame. A
  /// single band is not enough evidence.
  bool trial_pays(Workers& workers) const {
    uint64_t rendered = 0, retraced = 0;
    for (AdaptiveWorker& worker : workers) {
      const FrameCounts counts = worker.counts();
      rendered += counts.interpolated_subpixels + counts.traced_subpixels + counts.copied_subpixels;
      retraced += counts.retraced_subpixels;
    }
    const uint64_t band = static_cast<uint64_t>(AdaptiveWorker::kBand) * planes_.row_subpixels();
    return rendered <= band || 5 * retraced <= 4 * rendered;
  }

  static RenderStatistics statistics_of(Workers& workers, uint64_t subpixels) {
    RenderStatistics statistics;
    AuditCounts audit;
    for (AdaptiveWorker& worker : workers) {
      statistics += worker.counts();
      audit += worker.audit();
    }
    statistics.subpixels = subpixels;
    statistics.audited_subpixels = audit.sampled;
    statistics.audited_beyond = audit.beyond;
    statistics.beyond_bound = bound_of_share(audit);
    return statistics;
  }

  RenderOptions options_;
  RenderOptions full_options_;
  RowPlanes planes_;
  RayReach reach_;
  FullTiles full_tiles_;
  Footprint centre_;
  AdaptivePlan plan_;
  LastFrame last_;
  /// The input of the samples and of the last frame.
  struct Before {
    SceneObjects objects;
    std::optional<KeyGrid> grid;
    std::optional<SurfaceGroups> groups;
    std::vector<AdaptiveFrame::Band> bands;
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
  if (options.samples != 1)
    throw Error(ErrorKind::Usage, "method adaptive: takes one sample per subpixel",
                "use method full for several");
  auto method = std::make_unique<AdaptiveMethod>(model, options);
  if (!method->suits_rig()) return make_method_full(model, options);
  return method;
}

}  // namespace lenticule::render
