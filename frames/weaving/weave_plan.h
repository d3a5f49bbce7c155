// SPDX-License-Identifier: Apache-2.0
// WeavePlan holds all values that weaving derives from a rig and the size of its views, computed
// once: the views and the picture point of each subpixel, as runs along which both change linearly.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/cpu.h"
#include "base/large_memory.h"
#include "frames/frame.h"
#include "frames/quilt.h"
#include "frames/weave.h"
#include "frames/weaving/weave_kernel.h"
#include "optics/model.h"

namespace lenticule::frames {

/// More views than this are woven by the reference (view numbers have 31 bits here).
inline constexpr int kMostPlannedViews = 1024;

/// ViewShape is the shape of views, without their content.
struct ViewShape {
  int count = 0;
  int width = 0;
  int height = 0;
  double aspect = 1.0;

  friend bool operator==(const ViewShape&, const ViewShape&) = default;
};
[[nodiscard]] ViewShape shape_of(const ViewSet& views);

/// WeavePlan is immutable once built. A 4K frame's plan takes about 45 MB and 0.35 s of one
/// core with AVX-512. Along each run view numbers are within 2^-15 view and columns within 2^-13
/// pixel of RowRayEvaluator's; with ViewFilter::Nearest the views are exactly the reference's.
///
/// Thread safety: any thread.
class WeavePlan {
 public:
  /// Builds the plan with `threads` threads; every instruction set gives the same plan. Throws
  /// Error(Usage) for more than kMostPlannedViews views.
  WeavePlan(const optics::OpticalModel& model, const ViewShape& shape, const WeaveOptions& options,
            int threads = 1, Isa isa = best_isa());

  /// Bar is a group of subpixels of one row that are black.
  struct Bar {
    int row;  ///< row in the block, 0..3
    uint32_t first, stride, count;
  };
  /// Block is four panel rows.
  struct Block {
    std::span<const weave_kernel::Set> sets;
    std::span<const WeavePlan::Bar> bars;
    const weave_kernel::Quad* quads;
  };
  [[nodiscard]] int block_count() const;
  [[nodiscard]] Block block(int index) const;

  [[nodiscard]] FrameGeometry geometry() const { return geometry_; }
  [[nodiscard]] const ViewShape& shape() const { return shape_; }
  [[nodiscard]] const WeaveOptions& options() const { return options_; }
  [[nodiscard]] int32_t view_step() const { return view_step_; }
  [[nodiscard]] int32_t view_most() const;
  /// Returns the filter of ViewFilter::Gauss. Lifetime: must not outlive the plan.
  [[nodiscard]] const weave_kernel::Spot& spot() const { return spot_; }
  /// Returns true if all sets have stride 1: colours lie side by side.
  [[nodiscard]] bool in_stripes() const { return stride_ == 1; }
  /// Returns true if places count from blue to red: subpixel 3 i + c of the plan is the panel's 3 i
  /// + 2 - c.
  [[nodiscard]] bool blue_first() const { return blue_first_; }
  /// Returns the largest number of picture rows that one block uses.
  [[nodiscard]] int rows_of_block() const { return rows_of_block_; }
  [[nodiscard]] size_t memory_bytes() const;

 private:
  friend class PlanBuilder;
  void make_spot(double sigma);

  /// Part holds several blocks, built by one thread.
  struct Part {
    LargeMemory memory;  ///< room for records; the first `count` are set
    size_t count = 0;
    std::vector<weave_kernel::Set> sets;
    std::vector<Bar> bars;
    struct Ends {
      size_t sets, bars;
    };
    std::vector<Ends> blocks;
    int most_rows = 2;  ///< largest number of picture rows that one of its blocks uses

    [[nodiscard]] weave_kernel::Quad* quads() const {
      return static_cast<weave_kernel::Quad*>(memory.data());
    }
    /// Makes room for a set with at most `records` records, and at once for those that will likely
    /// follow: memory that has to grow is cleared and copied again.
    void make_room(size_t records, size_t likely_to_follow);
  };

  FrameGeometry geometry_;
  ViewShape shape_;
  WeaveOptions options_;
  std::vector<uint16_t> spot_weights_;
  weave_kernel::Spot spot_{};
  int32_t view_step_ = 0;
  uint32_t stride_ = 1;
  bool blue_first_ = false;
  int rows_of_block_ = 2;
  std::vector<Part> parts_;
};

}  // namespace lenticule::frames
