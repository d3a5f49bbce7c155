// SPDX-License-Identifier: Apache-2.0
// Summarises the frames of a scenario for each method.
#include <algorithm>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/render/bench_error.h"

namespace lenticule::bench {
namespace {

using nlohmann::json;

std::vector<double> values(const json& frames, const char* key) {
  std::vector<double> list;
  for (const json& frame : frames)
    if (frame.contains(key)) list.push_back(frame[key].get<double>());
  return list;
}

double sum(const std::vector<double>& list) {
  double total = 0.0;
  for (const double value : list) total += value;
  return total;
}

json mean(const std::vector<double>& list) {
  return list.empty() ? json() : json(sum(list) / static_cast<double>(list.size()));
}

json largest(const std::vector<double>& list) {
  return list.empty() ? json() : json(*std::ranges::max_element(list));
}

json smallest(const std::vector<double>& list) {
  return list.empty() ? json() : json(*std::ranges::min_element(list));
}

/// Returns the values of all eyes in all frames; `from` skips frames without a previous one.
std::vector<double> seen(const json& frames, const char* key, size_t from = 0) {
  std::vector<double> list;
  for (size_t n = from; n < frames.size(); ++n)
    for (const json& eye : frames[n]["eyes"])
      if (!eye[key].is_null()) list.push_back(eye[key].get<double>());
  return list;
}

json ratio(double part, double whole) {
  return whole > 0.0 ? json(part / whole) : json();
}

json saving(double seconds, double reference) {
  return reference > 0.0 ? json(1.0 - seconds / reference) : json();
}

std::vector<double> without_first(std::vector<double> list) {
  if (!list.empty()) list.erase(list.begin());
  return list;
}

void add_times(json& method, const json& reference_frames, double copy_s) {
  const json& frames = method["frames"];
  const std::vector<double> wall = values(frames, "wall_s");
  const std::vector<double> wall_reference = values(reference_frames, "wall_s");
  const double seconds = sum(wall);
  const double subpixels = sum(values(frames, "subpixels"));
  const double later = sum(without_first(wall));
  method["seconds_per_frame"] = mean(wall);
  method["first_s"] = wall.empty() ? json() : json(wall.front());
  method["later_s"] = mean(without_first(wall));
  method["of_full"] = ratio(seconds, sum(wall_reference));
  method["saved"] = saving(seconds, sum(wall_reference));
  method["later_saved"] = saving(later, sum(without_first(wall_reference)));
  const std::vector<double> cpu = values(frames, "cpu_s");
  const std::vector<double> cpu_reference = values(reference_frames, "cpu_s");
  method["cpu_of_full"] = ratio(sum(cpu), sum(cpu_reference));
  method["later_cpu_of_full"] = ratio(sum(without_first(cpu)), sum(without_first(cpu_reference)));
  method["rays_per_subpixel"] = ratio(sum(values(frames, "rays")), subpixels);
  method["over_copy"] = ratio(seconds, copy_s * static_cast<double>(wall.size()));
}

json mean_psnr(const std::vector<double>& mses) {
  std::vector<double> decibels;
  for (const double mse : mses)
    if (mse > 0.0) decibels.push_back(psnr_or_null(mse).get<double>());
  return mean(decibels);
}

void add_bounds(const json& frames, BoundTally& tally) {
  for (const json& frame : frames)
    if (frame.contains("bound") && frame.contains("share_over_e"))
      tally.add(frame["share_over_e"].get<double>(), frame["bound"].get<double>());
}

void add_errors(json& method) {
  const json& frames = method["frames"];
  const std::vector<double> mses = values(frames, "mse");
  method["psnr_mean_db"] = mean_psnr(mses);
  method["psnr_worst_db"] = psnr_or_null(mses.empty() ? 0.0 : *std::ranges::max_element(mses));
  const json view = largest(values(frames, "worst_view_mse"));
  method["worst_view_psnr_db"] = psnr_or_null(view.is_null() ? 0.0 : view.get<double>());
  method["max"] = largest(values(frames, "max"));
  for (const char* share : {"share_over_e", "share_over_8", "share_over_32"})
    method[share] = mean(values(frames, share));
  BoundTally bounds;
  add_bounds(frames, bounds);
  method["bound"] = bounds.figures();
}

void add_seen(json& method) {
  const json& frames = method["frames"];
  method["ssim_mean"] = mean(seen(frames, "ssim"));
  method["ssim_worst"] = smallest(seen(frames, "ssim"));
  method["flip_mean"] = mean(seen(frames, "flip_mean"));
  method["flip_p99_worst"] = largest(seen(frames, "flip_p99"));
  method["flicker_mean"] = mean(seen(frames, "flicker_mean", 1));
  method["flicker_largest"] = largest(seen(frames, "flicker_largest", 1));
}

}  // namespace

void BoundTally::add(double true_share, double bound) {
  ++frames_;
  if (true_share <= bound) ++within_;
  largest_share_ = std::max(largest_share_, true_share);
  largest_excess_ = std::max(largest_excess_, true_share - bound);
  bounds_ += bound;
}

json BoundTally::figures() const {
  if (frames_ == 0) return {};
  return {{"frames", frames_},
          {"within_percent", 100.0 * within_ / frames_},
          {"largest_share", largest_share_},
          {"largest_excess", largest_excess_},
          {"mean_bound", bounds_ / frames_}};
}

json bound_of_all(const json& scenarios) {
  BoundTally tally;
  for (const json& scenario : scenarios)
    for (const json& method : scenario["methods"])
      if (method.contains("frames")) add_bounds(method["frames"], tally);
  return tally.figures();
}

void summarize_errors(json& scenario, const json& tachyon) {
  const json reference_frames = scenario["methods"][0]["frames"];
  scenario["tachyon"] = tachyon;
  for (json& method : scenario["methods"]) {
    if (method["missing"].get<bool>()) continue;
    add_times(method, reference_frames, scenario["copy_s"].get<double>());
    // Both ratios come from interleaved runs, so their quotient does not depend on other load.
    method["over_tachyon"] = nullptr;
    if (tachyon.contains("ours_over_theirs") && !method["of_full"].is_null())
      method["over_tachyon"] =
          ratio(tachyon["ours_over_theirs"].get<double>(), method["of_full"].get<double>());
    if (&method == &scenario["methods"][0]) continue;
    add_errors(method);
    add_seen(method);
  }
}

}  // namespace lenticule::bench
