// SPDX-License-Identifier: Apache-2.0
// One frame of method adaptive, and what each thread does for it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "frames/frame.h"
#include "render/methods/adaptive/audit.h"
#include "render/methods/adaptive/colour_tracer.h"
#include "render/methods/adaptive/drawn_subpixels.h"
#include "render/methods/adaptive/kept_parts.h"
#include "render/methods/adaptive/key_samples.h"
#include "render/methods/adaptive/light_settler.h"
#include "render/methods/adaptive/uncertain_subpixels.h"
#include "render/methods/full_tiles.h"
#include "render/row_sweep/row_sweep.h"
#include "render/scene/surface_groups.h"
#include "render/shading/light_encoder.h"

namespace lenticule::render {

/// How a rig's frames are made; outlives them.
struct AdaptivePlan {
  const RenderOptions& options;
  const RowPlanes& planes;
  const FullTiles& full;
  const TilePlan& tiles;    ///< of `full`
  const Footprint& centre;  ///< of subpixels
  const lookup_kernel::Kernel& kernel;
  Agreement agreement;
};

/// Shared by the threads: first samples are taken, then bends marked, then bands of rows rendered.
struct AdaptiveFrame {
  /// `memory` is taken for the samples.
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
  std::array<uint8_t, 24> backdrop{};  ///< codes of eight pixels, where it is flat
  /// Where it is: rays that are far from everything are not made.
  std::optional<Interval> eyes;

  /// What the audit said of a band.
  struct Band {
    AuditCounts mending, judging;
    bool mended = false;
  };
  std::vector<Band> bands;

  /// What looks as it did before: samples there are those of `memory`.
  struct Kept {
    const KeptParts* parts = nullptr;  ///< null: nothing
    const frames::WovenFrame* frame = nullptr;
    const std::vector<Band>* bands = nullptr;

    [[nodiscard]] bool at(int row, double x_mm) const {
      return parts != nullptr && parts->at(row, x_mm);
    }
  };
  Kept kept;
  /// What it points to must outlive it, too.
  void keep(const Kept& what);
};

/// How the subpixels of a thread's bands got their colour.
struct AdaptiveCounts {
  uint64_t interpolated = 0;  ///< between samples, or nothing was seen
  uint64_t shaded = 0;        ///< by themselves, with light that samples settled or that was traced
  uint64_t copied = 0;        ///< looked the same in the frame before
  uint64_t mended = 0;        ///< traced in full, in bands that the audit sent back
  AuditCounts audit;          ///< of frames as they are delivered
};

/// Of one thread and frame. Calling threads must flush denormals.
class AdaptiveWorker {
 public:
  static constexpr int kBand = TilePlan::kRows;  ///< rows
  static constexpr int kBlock = 4;  ///< rows and columns of samples in a packet of coarse ones
  static constexpr int kSampleRows = kBlock * KeySamples::kCoarse;
  /// What is drawn for the audit takes so many times the rays of soft light, not to judge by its
  /// own noise.
  static constexpr int kFinerAudit = 4;

  /// `frame` must outlive it.
  explicit AdaptiveWorker(AdaptiveFrame& frame);

  /// The coarse samples of kSampleRows rows of one picture.
  void take_coarse_samples(int first_row, int picture);
  /// The others, when coarse ones of those rows and of those below are there.
  void take_other_samples(int first_row, int picture);
  /// kBand rows of the panel.
  void render_band(int first_row);

  [[nodiscard]] const AdaptiveCounts& counts() const { return counts_; }
  [[nodiscard]] RayCounts rays();
  /// See FullTiles::Worker.
  [[nodiscard]] uint64_t background() const { return full_ ? full_->background() : 0; }

 private:
  /// For the audit. Otherwise rays are left out that bring little.
  void judge_exactly(bool exactly);
  struct SamplePlace {
    int row, column;
  };
  void list_sample(int picture, SamplePlace place);
  void list_unless_kept(int picture, SamplePlace place);
  void trace_samples(int picture);
  void set_sample(int picture, size_t lane);
  void render_row(int first_row, int row);
  void copy_row(int first_row, int row);
  [[nodiscard]] bool is_whole_band_kept(int first_row) const;
  [[nodiscard]] bool is_kept(int row, size_t at, const KeyGrid::Between& between) const;
  void arrange_rays();
  void look_up(const KeyGrid::Between& between);
  void find_cells(const KeyGrid::Between& between);
  void add_drawn(int first_row, int row);
  void add_uncertain(int first_row, int row, size_t at, const KeyGrid::Between& between);
  void sort_row(int first_row, int row, const KeyGrid::Between& between);
  [[nodiscard]] uint8_t backdrop_code(int row, size_t at) const;
  void write_uncertain(int first_row);
  void audit_band(int first_row, const AdaptiveFrame::Band& known);
  [[nodiscard]] bool is_beyond(uint8_t code, uint8_t exact) const;
  uint64_t count_noise(int first_row);
  void mend_band(int first_row);

  AdaptiveFrame& frame_;
  ColourTracer colours_;
  ColourTracer::Colours found_;
  RowSweep::Worker sweep_;
  SweptRow swept_;
  const float* x_mm_ = nullptr;  ///< by subpixel, of the row that was swept last
  const float* tan_x_ = nullptr;
  std::vector<float> arranged_x_, arranged_tan_;
  UncertainSubpixels uncertain_;
  DrawnSubpixels drawn_;
  std::unique_ptr<FullTiles::Worker> full_;  ///< made when a band is mended
  LightSettler settler_;
  std::vector<RayPacket> packet_;  ///< one
  std::array<SamplePlace, kPacket> sample_places_{};
  size_t listed_ = 0;  ///< of sample_places_
  std::vector<uint32_t> keys_;
  std::array<int, 2> keys_row_{-1, -1};
  std::vector<uint32_t> group_of_cut_;
  /// What a row's look-up found, see lookup_kernel::Found.
  struct FoundRow {
    std::vector<uint8_t> codes, states;
    std::vector<int32_t> left, cell[2];
    std::vector<float> of_right, part[2];

    explicit FoundRow(size_t subpixels);
    [[nodiscard]] lookup_kernel::Found arrays();
    [[nodiscard]] std::array<LightSettler::Place, 2> places(size_t at) const;
  };
  FoundRow found_row_;
  AdaptiveCounts counts_;
};

}  // namespace lenticule::render
