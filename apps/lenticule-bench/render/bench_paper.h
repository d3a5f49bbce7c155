// SPDX-License-Identifier: Apache-2.0
// The parts of `lenticule bench paper`, which measures the six scenes and the methods of the paper
// on which this renderer is based, frame by frame as JSON, and prints the paper's two tables from
// that.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace lenticule::bench {

/// Published times of one scene: seconds for the whole sequence.
struct PublishedTimes {
  const char* scene;
  int frames;
  double full_s;
  double lens_view_s;
  double interpolate_s;
};
[[nodiscard]] std::span<const PublishedTimes> published_times();

/// Published quality of one frame of the teapot. The column that the paper calls RMSE is the mean
/// of the three channels' squared errors; its PSNR is consistent only with that.
struct PublishedQuality {
  int frame;
  double column;
  double psnr_db;
};
[[nodiscard]] std::span<const PublishedQuality> published_quality();

/// Consecutive frames of a sequence. Methods that keep data of the last frame start from scratch
/// with each span.
struct PaperSpan {
  std::string scene;  ///< name of a built-in scene
  int first = 0;
  int count = 0;
};

/// Returns spans of `length` frames that begin at multiples of it: `spans` evenly spaced ones, or
/// all if 0. The last may be shorter.
[[nodiscard]] std::vector<PaperSpan> spans_of(const std::string& scene, int frames, int length,
                                              int spans);

}  // namespace lenticule::bench
