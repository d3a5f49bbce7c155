// SPDX-License-Identifier: Apache-2.0
// The parts of `lenticule bench paper`: the six scenes and the methods of the paper that this
// renderer starts from, measured frame by frame into JSON, and its two tables made of that.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "optics/rig.h"

namespace lenticule::player {

/// What the paper says of one scene: seconds for the whole sequence.
struct PublishedTimes {
  const char* scene;
  int frames;
  double full_s;
  double lens_view_s;
  double interpolate_s;
};
[[nodiscard]] std::span<const PublishedTimes> published_times();

/// What the paper says of one frame of its teapot. The column that it calls RMSE is the mean of the
/// three channels' squared errors: only so does its PSNR follow from it.
struct PublishedQuality {
  int frame;
  double column;
  double psnr_db;
};
[[nodiscard]] std::span<const PublishedQuality> published_quality();

/// A method as it is by default, or read as literally as the paper can be: each micro-image from
/// the one before it, every point taken for the subpixel that is nearest.
struct PaperMethod {
  std::string name;  ///< with kLiteral at its end for the literal reading
  static constexpr std::string_view kLiteral = "-literal";

  [[nodiscard]] bool literal() const { return name.ends_with(kLiteral); }
  /// As make_method() takes it.
  [[nodiscard]] std::string method() const;
};
/// Every method of this build, and the literal readings of those that the paper has.
[[nodiscard]] const std::vector<std::string>& paper_method_names();

struct PaperSetup {
  optics::Rig rig;
  std::vector<std::string> methods;  ///< of paper_method_names(); the first is the reference
  int threads = 0;                   ///< 0 = all cores
  int depth = 5;
  int runs = 3;  ///< medians of times are taken over these
};

/// Consecutive frames of a sequence. Methods that remember the frame before start anew with each.
struct PaperSpan {
  std::string scene;  ///< of the built-in ones
  int first = 0;
  int count = 0;
};

/// Spans of `length` frames that begin at multiples of it: `spans` of them evenly spaced, or all
/// for 0. The last may be shorter.
[[nodiscard]] std::vector<PaperSpan> spans_of(const std::string& scene, int frames, int length,
                                              int spans);

/// Renders every frame of the span with every method, by turns, and compares with the reference.
/// {"scene", "first", "frames": [{"frame", "methods": {NAME: {"wall_s", "cpu_s", "build_s", "rays",
/// "subpixels", "traced", "projected", "interpolated", "missing", "mse": [r, g, b], "max",
/// "share_over_8", "share_over_32", "worst_view_mse"}}}]}; the reference has no errors. `done` is
/// called after each frame. Empty if interrupted.
[[nodiscard]] nlohmann::json measure_span(const PaperSetup& setup, const PaperSpan& span,
                                          const std::function<void()>& done);

/// Per method over all frames of a scene's spans: {"scene", "frames", "frames_of_sequence",
/// "primitives", "methods": [{"name", "seconds_per_frame", "cpu_seconds_per_frame",
/// "build_seconds_per_frame", "saved", "rays_per_subpixel", "traced", "missing", "psnr_mean_db",
/// "psnr_worst_db", "worst_frame", "worst_view_psnr_db", "max", "share_over_8",
/// "share_over_32"}]}; shares and "saved" from 0 to 1, PSNR null where nothing differs.
[[nodiscard]] nlohmann::json summarize(const std::string& scene,
                                       const std::vector<nlohmann::json>& spans);

/// The paper's tables with ours beside, from the summaries and spans.
void print_quality_table(const std::vector<nlohmann::json>& teapot_spans);
void print_time_table(const nlohmann::json& summaries);
void print_method_table(const nlohmann::json& summary);

/// One plot per scene: time of a frame against its error, a point for each method.
void plot_summary(const nlohmann::json& summary, const std::string& folder);

}  // namespace lenticule::player
