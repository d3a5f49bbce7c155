// SPDX-License-Identifier: Apache-2.0
// The parts of `lenticule bench paper`, which measures the six scenes and the methods of the paper
// on which this renderer is based, frame by frame as JSON, and prints the paper's two tables from
// that.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "optics/rig.h"

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

/// A method with its defaults, or in the literal reading of the paper: each micro-image from the
/// previous one, every point assigned to the nearest subpixel.
struct PaperMethod {
  std::string name;  ///< ends with kLiteral for the literal reading
  static constexpr std::string_view kLiteral = "-literal";

  [[nodiscard]] bool literal() const { return name.ends_with(kLiteral); }
  /// Returns the name for make_method().
  [[nodiscard]] std::string method() const;
};
/// Returns every method of this build, and the literal readings of the paper's methods.
[[nodiscard]] const std::vector<std::string>& paper_method_names();

struct PaperSetup {
  optics::Rig rig;
  /// Names from paper_method_names(); the first is the reference.
  std::vector<std::string> methods;
  int threads = 0;  ///< 0 = all cores
  int depth = 5;
  int runs = 3;  ///< times are medians of these
};

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

/// Renders every frame of the span with every method, interleaved, and compares it with the
/// reference. Returns {"scene", "first", "frames": [{"frame", "methods": {NAME: {"wall_s", "cpu_s",
/// "build_s", "rays", "subpixels", "traced", "projected", "interpolated", "missing", "mse": [r, g,
/// b], "max", "share_over_8", "share_over_32", "worst_view_mse"}}}]}; the reference has no errors.
/// `done` is called after each frame. Empty if interrupted.
[[nodiscard]] nlohmann::json measure_span(const PaperSetup& setup, const PaperSpan& span,
                                          const std::function<void()>& done);

/// Returns, per method over all frames of a scene's spans: {"scene", "frames",
/// "frames_of_sequence", "primitives", "methods": [{"name", "seconds_per_frame",
/// "cpu_seconds_per_frame", "build_seconds_per_frame", "saved", "rays_per_subpixel", "traced",
/// "missing", "psnr_mean_db", "psnr_worst_db", "worst_frame", "worst_view_psnr_db", "max",
/// "share_over_8", "share_over_32"}]}; shares and "saved" are from 0 to 1, PSNR is null if equal.
[[nodiscard]] nlohmann::json summarize(const std::string& scene,
                                       const std::vector<nlohmann::json>& spans);

/// Print the paper's tables with the measured values beside the published ones, from the summaries
/// and spans.
void print_quality_table(const std::vector<nlohmann::json>& teapot_spans);
void print_time_table(const nlohmann::json& summaries);
void print_method_table(const nlohmann::json& summary);

/// Writes one plot per scene: time of a frame against its error, a point for each method.
void plot_summary(const nlohmann::json& summary, const std::string& folder);
}  // namespace lenticule::bench
