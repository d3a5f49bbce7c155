// SPDX-License-Identifier: Apache-2.0
// The measurement of `lenticule bench realtime`, its figures as JSON, and how they are printed and
// drawn.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "apps/lenticule-bench/realtime/live_renderer.h"

namespace lenticule::bench {

struct PlayerSetup {
  frames::Rate refresh{60, 1};
  int slots = 3;
};

/// Plays the frames of a renderer process on a virtual display, in this process. Returns
/// live_figures() with {"scene", "rig", "width", "height", "method", "tolerated_error",
/// "proven_rmse", "adapt_rate" (null: none), "interrupted", "player": {...}, "samples": [...],
/// "rmse", "psnr_db", "psnr_worst_db", "max"}; the last four are null if no sample was compared,
/// and a PSNR is null if the frames are equal. This process must not have other threads. Throws the
/// renderer's errors.
[[nodiscard]] nlohmann::json measure_realtime(const LiveSetup& setup, const PlayerSetup& player);

/// Returns the figures of one run: {"frames_rendered", "frames_shown", "seconds_shown",
/// "frames_per_s", "latency_ms": {"p50", "p99", "max", "mean"}, "latency_parts_ms": {"begin",
/// "scene", "render", "ring", "copy", "panel"} (means, which add up to the mean), "shares":
/// {"scene", "render", "ring", "copy", "wait", "other"} (of the renderer's time, which add up to
/// 1), "bound" (the largest share's name), "memory_mib": {"start", "tenth" and "end" (means of the
/// second and the last tenth of the frames), "peak", "in_use_tenth", "in_use_end" (allocated and
/// not freed)}, "error_range": {"least", "median", "most", "last"} (tolerated errors of all
/// frames), "course":
/// [{"at_s", "frames_per_s", "latency_ms", "tolerated_error", "audited_rmse"}]}.
/// `shown_ns` has the time at which each of `frames` appeared, 0 for never; further ones are
/// ignored. Figures of no frame are 0, and "bound" is "nothing".
[[nodiscard]] nlohmann::json live_figures(std::span<const FrameRecord> frames,
                                          std::span<const int64_t> shown_ns);

void print_realtime(const nlohmann::json& run);
/// Prints a row per run, if there are several.
void print_realtime_table(const nlohmann::json& runs);

/// Plots rate, tolerated error and error over time.
void plot_realtime(const nlohmann::json& run, const std::string& file);
}  // namespace lenticule::bench
