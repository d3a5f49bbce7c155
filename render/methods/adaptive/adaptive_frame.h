// SPDX-License-Identifier: Apache-2.0
// One frame of method adaptive, and the work of each thread on it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "frames/frame.h"
#include "render/methods/adaptive/audit.h"
#include "render/methods/adaptive/key_samples.h"
#include "render/methods/adaptive/retrace.h"
#include "render/methods/method_full.h"
#include "render/options/render_options.h"
#include "render/row_sweep/row_planes.h"
#include "render/row_sweep/row_sweep.h"
#include "render/scene/scene.h"
#include "render/scene/scene_objects.h"
#include "render/scene/surface_groups.h"
#include "render/shading/light_encoder.h"

namespace lenticule::render {

/// GroundRow computes once per row what its subpixels share. Thread safety: used by one thread.
/// Lifetime: the scene and the planes must outlive the object.
class GroundRow {
 public:
  /// The scene must have a ground shadow.
  GroundRow(const Scene& scene, const RowPlanes& planes);

  /// Begins a row whose rays go to `eyes` on the viewing line (mm; tangents of parallel rays).
  void start(const RowPlane& plane, const Interval& eyes);
  /// Returns the range on the panel of the rays that may cross the shadow; empty if none does.
  [[nodiscard]] const Interval& range_mm() const { return range_mm_; }
  /// Returns light_beyond() of a ray of the row.
  [[nodiscard]] double light(double x_mm, double tan_x, int channel) const;

 private:
  void set_range(const RowPlane& plane, const Interval& eyes);

  const Scene& scene_;
  const RowPlanes& planes_;
  std::array<Vec3, 4> corners_mm_;  ///< corners of the ground, in the panel frame
  std::optional<GroundShadow::Row> row_;
  Interval range_mm_;
};

/// UnchangedRegions finds the regions of the panel that look the same as in the previous frame: no
/// changed object is visible through the region, casts a shadow there or changes the ambient light
/// there. The regions are bands of rows and columns of some pixels. Thread safety: immutable after
/// construction.
class UnchangedRegions {
 public:
  static constexpr int kBandRows = 16;
  static constexpr int kColumnPixels = 32;

  /// Finds the unchanged regions for rays that go to `eyes` on the viewing line (mm; tangents for
  /// parallel rays). If the frames differ in more than individual objects, no region is unchanged.
  /// Regions that show view-dependent surfaces always count as changed, since reflections are not
  /// followed.
  UnchangedRegions(const RowPlanes& planes, const Interval& eyes, const Scene& scene,
                   const SoftLight& soft, const SceneObjects& before, const SceneObjects& now);

  [[nodiscard]] bool any() const { return kept_ > 0; }
  [[nodiscard]] bool whole_band(int band) const {
    return lost_in_band_[static_cast<size_t>(band)] == 0;
  }
  /// Returns true if a ray of the row that leaves the panel at x_mm is in an unchanged region.
  [[nodiscard]] bool at(int row, double x_mm) const;

 private:
  struct Patch {
    Interval x_mm, y_mm;
  };
  void mark_all_changed();
  bool mark_changes(const Scene& scene, const SoftLight& soft, const SceneObjects& before,
                    const SceneObjects& now);
  void mark_changed(const Bounds& box);
  void mark_changed(const Patch& patch);
  void mark_shadow_changed(const Bounds& box, const SceneLight& light, const SoftLight& soft,
                           const Bounds& within);
  [[nodiscard]] Patch seen_through(const Bounds& box) const;

  const RowPlanes& planes_;
  Interval eyes_;
  Affine panel_from_scene_;
  int bands_, columns_;
  double x_first_, columns_per_mm_;
  std::vector<Interval> band_y_mm_;
  std::vector<uint8_t> lost_;  ///< [band][column]; 1 = changed
  std::vector<int> lost_in_band_;
  size_t kept_ = 0;
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
  AdaptiveFrame(const AdaptivePlan& of, const KeyGrid& keys, const Scene& scene, KeySamples& memory,
                frames::WovenFrame& frame);

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

  /// Marks of the samples that were taken: the coarse ones and the others of blocks of
  /// AdaptiveWorker::kSampleRows rows of samples, and the bends of rows.
  struct Taken {
    std::vector<uint8_t> coarse, others, bends;
  };
  Taken taken;

  /// Unchanged regions, which reuse the samples in `memory` from the previous frame.
  struct Kept {
    const UnchangedRegions* parts = nullptr;  ///< null: no unchanged regions
    const frames::WovenFrame* frame = nullptr;
    const std::vector<Band>* bands = nullptr;
    const Taken* taken = nullptr;

    [[nodiscard]] bool at(int row, double x_mm) const {
      return parts != nullptr && parts->at(row, x_mm);
    }
  };
  Kept kept;
  /// Sets the unchanged regions. Lifetime: the objects that `what` points to must outlive the
  /// frame.
  void keep(const Kept& what);
};

/// AdaptiveWorker renders bands of one frame. The calling thread must flush denormals. Thread
/// safety: used by one thread.
class AdaptiveWorker {
 public:
  static constexpr int kBand = TilePlan::kRows;  ///< rows
  static constexpr int kBlock = 4;               ///< rows and columns of coarse samples in a packet
  static constexpr int kSampleRows = kBlock * KeySamples::kCoarse;
  /// Factor of the number of soft-light rays for audited subpixels, so that their own noise does
  /// not distort the audit.
  static constexpr int kFinerAudit = 4;

  /// Lifetime: `frame` must outlive the object.
  explicit AdaptiveWorker(AdaptiveFrame& frame);

  /// Takes the coarse samples of kSampleRows rows of one cache view.
  void take_coarse_samples(int first_row, int cache_view);
  /// Takes the other samples, after the coarse ones of these rows and of the rows below.
  void take_other_samples(int first_row, int cache_view);
  /// Renders kBand rows of the panel. A band that the audit rejects is marked for retrace_band().
  void render_band(int first_row);
  /// Counts the audited subpixels of a band that was not tried, and so has no errors.
  void audit_untried_band(int first_row);
  /// Renders the band with method full's exact bytes.
  void retrace_band(int first_row);

  /// Returns the counters of the bands rendered so far.
  [[nodiscard]] FrameCounts counts();

 private:
  /// Selects exact tracing for the audit; otherwise weak rays are skipped.
  void evaluate_exactly(bool exactly);
  struct SamplePlace {
    int row, column;
  };
  void list_sample(int cache_view, SamplePlace place);
  void list_if_changed(int cache_view, SamplePlace place, bool was_taken);
  void trace_samples(int cache_view);
  void set_sample(int cache_view, size_t lane);
  void render_row(int first_row, int row);
  void copy_row(int first_row, int row);
  [[nodiscard]] bool is_whole_band_unchanged(int first_row) const;
  [[nodiscard]] bool is_unchanged(int row, size_t at, const KeyGrid::Between& between) const;
  void arrange_rays();
  void look_up(const KeyGrid::Between& between);
  void find_cells(const KeyGrid::Between& between);
  void add_sampled(int first_row, int row, bool copied);
  void add_uncertain(int first_row, int row, size_t at, const KeyGrid::Between& between);
  void sort_row(int first_row, int row, const KeyGrid::Between& between);
  [[nodiscard]] RowPlane plane_of(int row) const;
  [[nodiscard]] uint8_t backdrop_code(int row, size_t at) const;
  [[nodiscard]] bool is_made(size_t begin, size_t end) const;
  /// Returns true if shading the other subpixels of a band would take longer than method full takes
  /// for all of it.
  [[nodiscard]] bool is_shading_expensive() const;
  /// Returns true if the audit rejects a band for its lookups alone, so that the other subpixels
  /// need not be shaded.
  [[nodiscard]] bool are_lookups_rejected(int first_row) const;
  /// Returns true if a band has errors that full() should remove: too many beyond the tolerated
  /// error, of which `noise` would be there in any case, or too large ones.
  [[nodiscard]] bool is_rejected(const AuditErrors& retracing, uint64_t noise = 0) const;
  void write_uncertain(int first_row);
  /// Audits a band. If it is `given_up`, not all of its subpixels have been shaded, and method full
  /// will render it.
  void audit_band(int first_row, bool given_up, const AdaptiveFrame::Band& known);
  [[nodiscard]] bool is_beyond(uint8_t code, uint8_t exact) const;
  uint64_t count_noise(int first_row);

  AdaptiveFrame& frame_;
  ColourTracer colours_;
  ColourTracer::Colours found_;
  RowSweep::Worker sweep_;
  SweptRow swept_;
  std::optional<GroundRow> ground_;
  bool flat_row_ = true;         ///< the backdrop shows one colour in all of the row
  const float* x_mm_ = nullptr;  ///< per subpixel of the last swept row
  const float* tan_x_ = nullptr;
  std::vector<float> arranged_x_, arranged_tan_;
  UncertainSubpixels uncertain_;
  SampledSubpixels sampled_;
  std::unique_ptr<FullTiles::Worker> full_;  ///< created when a band is retraced
  LightResolver resolver_;
  std::vector<RayPacket> packet_;  ///< a single packet
  std::array<SamplePlace, kPacket> sample_places_{};
  size_t listed_ = 0;                            ///< elements of sample_places_ in use
  std::vector<uint32_t> keys_;                   ///< see lookup_kernel::SampleRows
  std::vector<lookup_kernel::Corners> corners_;  ///< corners of the same cells
  std::array<int, 2> keys_row_{-1, -1};
  std::vector<uint32_t> group_of_cut_;
  /// Look-up results of a row, see lookup_kernel::Found.
  struct FoundRow {
    std::vector<uint8_t> codes, states;
    std::vector<int32_t> left, cell[2];
    std::vector<float> of_right, part[2];

    explicit FoundRow(size_t subpixels);
    [[nodiscard]] lookup_kernel::Found arrays();
    [[nodiscard]] std::array<LightResolver::Place, 2> places(size_t at) const;
  };
  FoundRow found_row_;
  AdaptiveFrame::Band band_;  ///< costs of the band so far
  FrameCounts counts_;        ///< origin of the colours of the subpixels
};

}  // namespace lenticule::render
