// SPDX-License-Identifier: Apache-2.0
// How deep a frame is: what its subpixels see, in depths of field of the sheet.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "frames/frame.h"
#include "optics/model.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// Depth z over the depth of field along the subpixel's own ray, positive in front of the glass.
class DepthHistogram {
 public:
  static constexpr int kBinsPerDepth = 8;
  static constexpr int kReach = 16;  ///< depths of field to either side

  /// `views` is N, subpixels per lens: within 1/N depths of field all views of a lens see the same
  /// to within a lens pitch.
  explicit DepthHistogram(double views = 1.0);

  /// What one subpixel sees; infinite where that is nothing.
  void add(double depth, double z_mm);
  DepthHistogram& operator+=(const DepthHistogram& other);

  [[nodiscard]] uint64_t subpixels() const;
  [[nodiscard]] uint64_t nothing() const { return nothing_; }
  [[nodiscard]] uint64_t at_glass() const { return at_glass_; }  ///< part of within()
  [[nodiscard]] uint64_t within() const { return within_; }      ///< one depth of field
  [[nodiscard]] uint64_t in_front() const { return in_front_; }  ///< by more
  [[nodiscard]] uint64_t behind() const { return behind_; }      ///< by more
  /// z of what was seen; -infinity and infinity if there was nothing.
  [[nodiscard]] double nearest_mm() const { return nearest_mm_; }
  [[nodiscard]] double farthest_mm() const { return farthest_mm_; }

  /// From -kReach to kReach; what lies beyond is counted in the first and the last.
  [[nodiscard]] const std::vector<uint64_t>& bins() const { return bins_; }
  /// The lower end of a bin, in depths of field.
  [[nodiscard]] static double bin_begin(size_t bin);

 private:
  double views_;
  uint64_t nothing_ = 0, at_glass_ = 0, within_ = 0, in_front_ = 0, behind_ = 0;
  double nearest_mm_ = -std::numeric_limits<double>::infinity();
  double farthest_mm_ = std::numeric_limits<double>::infinity();
  std::vector<uint64_t> bins_;
};

/// What else to make of a frame's depths; both are of the panel's size.
struct DepthPictures {
  /// A pixel of what green sees: grey within the depth of field, white at the glass; yellow to red
  /// in front of it, cyan to blue behind it, by how often the depth doubles, up to eight times;
  /// black where there is nothing. Null for none.
  frames::WovenFrame* map = nullptr;
  /// Subpixel by subpixel 255 where something is seen beyond the depth of field, or nothing, else
  /// 0. Null for none.
  frames::WovenFrame* beyond = nullptr;
};

/// Looks at every subpixel of a frame, by the row sweep. `threads` 0 = all cores; the numbers do
/// not depend on them.
[[nodiscard]] DepthHistogram measure_depth(const optics::OpticalModel& model, const Scene& scene,
                                           int threads, const DepthPictures& pictures = {});

}  // namespace lenticule::render
