// SPDX-License-Identifier: Apache-2.0
// DepthViews draws views from one picture and its depth: every pixel moves sideways by its
// disparity, nearer pixels cover farther ones, and holes are filled from the farther side.
//
// With d the disparity between the outermost of N views, positive in front of the panel, the centre
// of pixel i in view v is at x = i + 1/2 - d (v - (N - 1) / 2) / (N - 1): a point nearer than the
// panel moves left as the eye moves right. Neighbours whose disparities differ by at most
// kJoinedDisparity pixels are one surface, interpolated in linear light; elsewhere each neighbour
// keeps half a pixel. The source counts as the picture of the middle camera.
#pragma once

#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "base/worker_threads.h"
#include "frames/frame.h"
#include "frames/quilt.h"

namespace lenticule::frames {

/// Largest disparity difference between neighbours of one surface, in pixels between the outermost
/// views: a stretch of 3/4 pixel in the outermost views.
inline constexpr double kJoinedDisparity = 1.5;
inline constexpr int kUsualDepthViews = 24;
inline constexpr double kUsualDisparity = 0.02;

struct DepthOptions {
  int views = kUsualDepthViews;    ///< at least 2
  double back = -kUsualDisparity;  ///< disparity of the farthest depth (code 0)
  double front = kUsualDisparity;  ///< disparity of the nearest depth (code 255)
  bool in_pixels = false;          ///< true: pixels of a view; false: fractions of the width
  /// Farthest distance divided by the nearest one, if codes are distances: disparities are linear
  /// in the reciprocal of a distance. 1: codes are disparities.
  double distance_ratio = 1.0;
  Disparity zero_plane = {};  ///< subtracted from all disparities
  /// Largest disparity after that, to either side, as a fraction of the width: if one is larger,
  /// all are compressed, those near 0 hardly.
  double most = std::numeric_limits<double>::infinity();
  bool black_is_near = false;
  int threads = 1;
  uint64_t most_bytes = kMostViewBytes;  ///< limit for all views together
};

/// PictureWindow refers to the pixels of a part of a picture.
struct PictureWindow {
  const uint8_t* pixels = nullptr;
  size_t stride_bytes = 0;
  int width = 0;
  int height = 0;

  [[nodiscard]] const uint8_t* row(int j) const {
    return pixels + static_cast<size_t>(j) * stride_bytes;
  }
};
[[nodiscard]] PictureWindow window_of(const FrameView& picture);

/// DepthViews keeps the views' pictures and its working memory.
///
/// Thread safety: one thread.
class DepthViews {
 public:
  /// Throws Error(Usage) for invalid options, Error(Input) if the views need more than most_bytes.
  DepthViews(int width, int height, const DepthOptions& options);
  ~DepthViews();

  /// Draws the views, the leftmost first. `colour` has the constructor's size; `depth` may have
  /// another size and is sampled at its nearest pixels. The pictures are valid until the next call.
  [[nodiscard]] std::span<const FrameView> draw(const PictureWindow& colour,
                                                const PictureWindow& depth);

 private:
  struct Scratch;
  struct Target;
  void draw_row(int row, const PictureWindow& colour, const PictureWindow& depth, Scratch& scratch);
  void read_row(int row, const PictureWindow& colour, const PictureWindow& depth,
                Scratch& scratch) const;
  void move_row(double turn, Scratch& scratch) const;
  void fill_holes(Scratch& scratch) const;
  void paint_row(const Scratch& scratch, uint8_t* to) const;

  int width_;
  int height_;
  DepthOptions options_;
  std::vector<double> disparity_of_code_;
  std::vector<WovenFrame> pictures_;
  std::vector<FrameView> views_;
  WorkerThreads workers_;
  std::vector<std::unique_ptr<Scratch>> scratches_;
};

}  // namespace lenticule::frames
