// SPDX-License-Identifier: Apache-2.0
// The parts of `lenticule bench paper`, which measures the six scenes and the methods of the paper
// on which this renderer is based, frame by frame as JSON, and prints the paper's two tables from
// that.
#pragma once

#include <nlohmann/json.hpp>
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

/// Returns every method of this build, and with "-literal" at the end of their names the literal
/// readings of the paper's methods: each micro-image from the previous one, every point assigned to
/// the nearest subpixel.
[[nodiscard]] const std::vector<std::string>& paper_method_names();

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

/// Returns, per method over all frames of a scene's spans, which are measure_error()'s results with
/// "first": {"scene", "frames", "frames_of_sequence", "methods": [{"name", "frames": [...],
/// "cpu_seconds_per_frame", "build_seconds_per_frame", "traced", "missing", and what add_times()
/// and add_errors() add}]}; shares and savings are from 0 to 1, a PSNR is null if equal.
[[nodiscard]] nlohmann::json summarize(const std::string& scene,
                                       const std::vector<nlohmann::json>& spans);
}  // namespace lenticule::bench
