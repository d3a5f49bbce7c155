// SPDX-License-Identifier: Apache-2.0
// DepthHistogram measures the depths that a frame's subpixels see, in units of the sheet's depth of
// field.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "frames/frame.h"
#include "optics/model.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// DepthHistogram counts subpixels by depth z, divided by the depth of field along the subpixel's
/// own ray; positive in front of the panel.
class DepthHistogram {
 public:
  static constexpr int kBinsPerDepth = 8;
  static constexpr int kReach = 16;  ///< depths of field to each side

  /// `views` is N, the number of subpixels per lens: within 1/N depths of field all views of a lens
  /// see the same content to within a lens pitch.
  explicit DepthHistogram(double views = 1.0);

  /// Adds one subpixel; `depth` is infinite if the subpixel sees nothing.
  void add(double depth, double z_mm);
  DepthHistogram& operator+=(const DepthHistogram& other);

  [[nodiscard]] uint64_t subpixels() const;
  [[nodiscard]] uint64_t nothing() const { return nothing_; }
  [[nodiscard]] uint64_t at_panel() const { return at_panel_; }  ///< part of within()
  [[nodiscard]] uint64_t within() const { return within_; }      ///< up to one depth of field away
  [[nodiscard]] uint64_t in_front() const { return in_front_; }  ///< more than one depth of field
  [[nodiscard]] uint64_t behind() const { return behind_; }      ///< more than one depth of field
  /// Panel z of the extreme visible points; -infinity and infinity if there are none.
  [[nodiscard]] double nearest_mm() const { return nearest_mm_; }
  [[nodiscard]] double farthest_mm() const { return farthest_mm_; }

  /// Bins from -kReach to kReach; depths beyond are counted in the first and the last bin.
  [[nodiscard]] const std::vector<uint64_t>& bins() const { return bins_; }
  /// Returns the lower end of a bin, in depths of field.
  [[nodiscard]] static double bin_begin(size_t bin);

 private:
  double views_;
  uint64_t nothing_ = 0, at_panel_ = 0, within_ = 0, in_front_ = 0, behind_ = 0;
  double nearest_mm_ = -std::numeric_limits<double>::infinity();
  double farthest_mm_ = std::numeric_limits<double>::infinity();
  std::vector<uint64_t> bins_;
};

/// Optional pictures of a frame's depths; both have the panel's size.
struct DepthPictures {
  /// Depth map with one pixel per green subpixel: grey within the depth of field, white at the
  /// panel; yellow to red in front, cyan to blue behind, by the number of times the depth doubles,
  /// up to eight times; black if nothing is seen. May be null.
  frames::WovenFrame* map = nullptr;
  /// Mask per subpixel: 255 if the subpixel sees content beyond the depth of field, or nothing;
  /// otherwise 0. May be null.
  frames::WovenFrame* beyond = nullptr;
};

/// Measures every subpixel of a frame by the row sweep. `threads` is the number of threads, 0 = all
/// cores; the results do not depend on it.
[[nodiscard]] DepthHistogram measure_depth(const optics::OpticalModel& model, const Scene& scene,
                                           int threads, const DepthPictures& pictures = {});

}  // namespace lenticule::render
