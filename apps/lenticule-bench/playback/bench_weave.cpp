// SPDX-License-Identifier: Apache-2.0
// lenticule bench weave compares the fast weaver with copying the woven frame's bytes, by views,
// filter, threads and kernel, in interleaved runs.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstring>
#include <memory>
#include <thread>
#include <vector>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "base/print.h"
#include "frames/weaving/fast_weaver.h"
#include "lab/reference_weaver.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {
namespace {

using frames::ViewFilter;

struct WeaveBenchFlags : RunFlags {
  bool quick = false;
};

struct Case {
  int columns, rows;  ///< tiles of the quilt
  int width, height;  ///< size of a view
  ViewFilter filter;
  int threads;
  bool all_kernels = false;  ///< measures all kernels of this machine instead of the best
};

struct CaseResult {
  Case what{};
  std::string kernel;
  double copy_ms = 0.0, weave_ms = 0.0, ratio = 0.0;
  /// Processor time of the calling thread, the minimum of all runs, which other programs disturb
  /// least.
  double copy_thread_ms = 0.0, weave_thread_ms = 0.0;
  double plan_ms = 0.0, plan_mib = 0.0, reference_ms = 0.0;
};

template <class Work>
double milliseconds(const Work& work, clockid_t clock = CLOCK_MONOTONIC) {
  return 1e3 * seconds_by(clock, work);
}

frames::ViewSet noise_views(const Case& what) {
  frames::WovenFrame quilt({.width = what.columns * what.width, .height = what.rows * what.height});
  uint32_t state = 1;
  for (uint8_t& byte : quilt.bytes()) {
    state = state * 1664525u + 1013904223u;
    byte = static_cast<uint8_t>(state >> 24);
  }
  return {std::move(quilt), {.columns = what.columns, .rows = what.rows}};
}

/// Copies as the weaver divides the work: one contiguous part per thread.
void copy_by_threads(const frames::WovenFrame& from, frames::WovenFrame& to, int threads) {
  const size_t bytes = from.bytes().size(), all = static_cast<size_t>(threads);
  const auto copy = [&](size_t n) {
    const size_t begin = bytes * n / all, end = bytes * (n + 1) / all;
    std::memcpy(to.bytes().data() + begin, from.bytes().data() + begin, end - begin);
  };
  std::vector<std::jthread> helpers;
  for (size_t n = 1; n < all; ++n) helpers.emplace_back(copy, n);
  copy(0);
}

/// Returns the estimated time of a whole frame from a few rows.
double reference_ms(const frames::ViewSet& views, const optics::OpticalModel& model,
                    const frames::WeaveOptions& options) {
  const optics::Panel& panel = model.rig().panel;
  frames::WovenFrame frame({.width = panel.width_px, .height = panel.height_px});
  const int rows = std::min(frame.height(), 48), first = (frame.height() - rows) / 2;
  const auto some_rows = [&] {
    lab::weave_rows(views, model, options, first, first + rows, frame);
  };
  return milliseconds(some_rows) * frame.height() / rows;
}

/// Weaves and copies in interleaved runs.
void time_kernel(const frames::ViewSet& views, std::shared_ptr<const frames::WeavePlan> plan,
                 frames::WeaveKernel kernel, int runs, CaseResult& result) {
  const int threads = result.what.threads;
  frames::WovenFrame frame(plan->geometry()), copy(plan->geometry());
  frames::FastWeaver weaver(std::move(plan), threads, kernel);
  result.kernel = frames::to_string(kernel);
  weaver.weave(views, frame);
  copy_by_threads(frame, copy, threads);
  std::vector<double> weave_ms, copy_ms, ratios;
  std::vector<double> weave_thread_ms, copy_thread_ms;
  for (int run = 0; run < runs && !player::interrupted(); ++run) {
    weave_thread_ms.push_back(
        milliseconds([&] { weave_ms.push_back(milliseconds([&] { weaver.weave(views, frame); })); },
                     CLOCK_THREAD_CPUTIME_ID));
    copy_thread_ms.push_back(milliseconds(
        [&] { copy_ms.push_back(milliseconds([&] { copy_by_threads(frame, copy, threads); })); },
        CLOCK_THREAD_CPUTIME_ID));
    ratios.push_back(weave_ms.back() / copy_ms.back());
  }
  if (ratios.empty()) return;
  result.weave_thread_ms = *std::min_element(weave_thread_ms.begin(), weave_thread_ms.end());
  result.copy_thread_ms = *std::min_element(copy_thread_ms.begin(), copy_thread_ms.end());
  result.weave_ms = median(weave_ms);
  result.copy_ms = median(copy_ms);
  result.ratio = median(ratios);
}

/// Kernels that take a tenth of a second or more get fewer runs.
constexpr int kSlowRuns = 3;
int runs_of(const Case& what, frames::WeaveKernel kernel, int runs) {
  const bool slow = what.filter == ViewFilter::Gauss || kernel == frames::WeaveKernel::Plain ||
                    kernel == frames::WeaveKernel::Transposed;
  return slow ? std::min(runs, kSlowRuns) : runs;
}

void measure(const Case& what, const optics::OpticalModel& model, int runs,
             std::vector<CaseResult>& results) {
  const frames::ViewSet views = noise_views(what);
  const frames::WeaveOptions options{.filter = what.filter, .fit = frames::PictureFit::Stretch};
  std::shared_ptr<const frames::WeavePlan> plan;
  CaseResult result;
  result.what = what;
  result.plan_ms = milliseconds([&] {
    plan = std::make_shared<const frames::WeavePlan>(model, frames::shape_of(views), options,
                                                     what.threads);
  });
  result.plan_mib = static_cast<double>(plan->memory_bytes()) / (1 << 20);
  result.reference_ms = reference_ms(views, model, options);
  for (const frames::WeaveKernel kernel : frames::kWeaveKernels) {
    if (player::interrupted() || !frames::kernel_suits(kernel, *plan)) continue;
    if (!what.all_kernels && kernel != frames::best_kernel(*plan)) continue;
    time_kernel(views, plan, kernel, runs_of(what, kernel, runs), result);
    results.push_back(result);
  }
}

std::vector<Case> cases(bool quick) {
  const Case usual{9, 5, 820, 460, ViewFilter::Linear, 1, true};
  std::vector<Case> list = {usual};
  if (std::thread::hardware_concurrency() > 1)
    list.push_back({9, 5, 820, 460, ViewFilter::Linear, 2, true});
  if (quick) return list;
  list.push_back({9, 5, 820, 460, ViewFilter::Nearest, 1});
  list.push_back({9, 5, 820, 460, ViewFilter::Gauss, 1});
  list.push_back({4, 2, 1920, 1080, ViewFilter::Linear, 1});
  list.push_back({8, 8, 512, 512, ViewFilter::Linear, 1});
  list.push_back({11, 8, 372, 682, ViewFilter::Linear, 1});
  return list;
}

nlohmann::json to_json(const CaseResult& r) {
  return {{"views", r.what.columns * r.what.rows},
          {"view_size", fmt::format("{}x{}", r.what.width, r.what.height)},
          {"view_width", r.what.width},
          {"view_height", r.what.height},
          {"filter", frames::to_string(r.what.filter)},
          {"threads", r.what.threads},
          {"kernel", r.kernel},
          {"copy_ms", r.copy_ms},
          {"weave_ms", r.weave_ms},
          {"copy_thread_ms", r.copy_thread_ms},
          {"weave_thread_ms", r.weave_thread_ms},
          {"weave_per_copy", r.ratio},
          {"weave_per_copy_thread", r.weave_thread_ms / r.copy_thread_ms},
          {"reference_ms", r.reference_ms},
          {"plan_ms", r.plan_ms},
          {"plan_mib", r.plan_mib}};
}

void print_cases(const nlohmann::json& cases) {
  print_out("Times of the clock are medians, those of a thread the least ones.\n");
  constexpr Column kColumns[] = {{"views", "views"},
                                 {"of", "view_size"},
                                 {"filter", "filter"},
                                 {"threads", "threads"},
                                 {"kernel", "kernel"},
                                 {"copy ms", "copy_ms", "{:.2f}"},
                                 {"weave ms", "weave_ms", "{:.2f}"},
                                 {"ratio", "weave_per_copy", "{:.2f}"},
                                 {"thread: copy ms", "copy_thread_ms", "{:.2f}"},
                                 {"weave ms", "weave_thread_ms", "{:.2f}"},
                                 {"ratio", "weave_per_copy_thread", "{:.2f}"},
                                 {"reference", "reference_ms"},
                                 {"plan ms", "plan_ms"}};
  print_table(cases, kColumns);
}

ExitCode run(const WeaveBenchFlags& flags) {
  const optics::OpticalModel model(lab::bench_rig(flags.rig));
  std::vector<CaseResult> results;
  for (const Case& what : cases(flags.quick)) {
    measure(what, model, flags.runs, results);
    if (player::interrupted()) return player::interrupt_exit_code();
  }
  nlohmann::json rows = nlohmann::json::array();
  for (const CaseResult& result : results) rows.push_back(to_json(result));
  if (flags.json) {
    print_json({{"benchmark", "weave"},
                {"machine", machine_json()},
                {"rig", model.rig().name},
                {"frame_bytes", size_t{3} * static_cast<size_t>(model.rig().panel.width_px) *
                                    static_cast<size_t>(model.rig().panel.height_px)},
                {"cases", rows}});
    return kOk;
  }
  print_out("{}\n{}, {} x {}\n", machine_text(), model.rig().name, model.rig().panel.width_px,
            model.rig().panel.height_px);
  print_cases(rows);
  return kOk;
}

}  // namespace

cli::Run declare_bench_weave(CLI::App& app) {
  auto flags = std::make_shared<WeaveBenchFlags>();
  flags->runs = 15;
  declare_run_flags(app, *flags);
  app.add_flag("--quick", flags->quick, "measure only 45 views with the linear filter");
  return [flags]() -> ExitCode { return run(*flags); };
}

}  // namespace lenticule::bench
