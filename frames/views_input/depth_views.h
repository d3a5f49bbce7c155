// SPDX-License-Identifier: Apache-2.0
// Views from one picture and its depth: every pixel is moved sideways by its disparity, nearer ones
// cover farther ones, and what no pixel reaches is filled from the farther side.
//
// With d the disparity between the outermost of N views, positive in front of the glass, the centre
// of pixel i lies in view v at x = i + 1/2 - d (v - (N - 1) / 2) / (N - 1): what is nearer than the
// glass moves left as the eye moves right. Neighbours whose disparities differ by at most
// kJoinedDisparity pixels are one surface, interpolated in linear light; elsewhere each keeps half
// a pixel. The source is taken for the picture of the camera in the middle.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "frames/frame.h"
#include "frames/quilt.h"
#include "frames/sequence/band_workers.h"

namespace lenticule::frames {

/// Between neighbours of one surface, in pixels between the outermost views: 3/4 pixel of
/// stretching in those.
inline constexpr double kJoinedDisparity = 1.5;
inline constexpr int kUsualDepthViews = 24;
inline constexpr double kUsualDisparity = 0.02;

struct DepthOptions {
  int views = kUsualDepthViews;    ///< at least 2
  double back = -kUsualDisparity;  ///< disparity of the farthest depth (code 0)
  double front = kUsualDisparity;  ///< and of the nearest (code 255)
  bool in_pixels = false;          ///< of a view; otherwise parts of its width
  bool black_is_near = false;
  int threads = 1;
  uint64_t most_bytes = kMostViewBytes;  ///< of all views together
};

/// Pixels of a part of a picture.
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

/// One thread; keeps the views' pictures and its working memory.
class DepthViews {
 public:
  /// Throws Error(Usage) for options that make no sense, Error(Input) for more bytes of views than
  /// most_bytes.
  DepthViews(int width, int height, const DepthOptions& options);
  ~DepthViews();

  /// `colour` has the constructor's size; `depth` may have another: the nearest of its pixels
  /// counts. The pictures, the leftmost first, are good until the next call.
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
  BandWorkers workers_;
  std::vector<std::unique_ptr<Scratch>> scratches_;
};

}  // namespace lenticule::frames
