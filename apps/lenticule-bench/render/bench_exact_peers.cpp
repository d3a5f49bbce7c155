// SPDX-License-Identifier: Apache-2.0
// lenticule bench exact --peers runs another ray tracer on the same scene, interleaved with this
// renderer.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <string_view>
#include <thread>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_timing.h"
#include "apps/lenticule-bench/render/bench_exact.h"
#include "apps/lenticule-tools/offline/scratch_folder.h"
#include "base/error.h"
#include "base/print.h"
#include "lab/judges/peers.h"
#include "player/process/child_process.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {
namespace {

using lab::PeerJob;

/// The results of one peer; `failure` is empty if there was no error.
struct PeerRuns {
  const lab::Peer* peer = nullptr;
  std::string program;
  std::string scene_file;
  std::vector<double> seconds;
  std::string failure;
};

void write_text(const std::string& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw Error(ErrorKind::Failed, fmt::format("{}: cannot write", file));
}

PeerRuns prepare(const lab::Peer& peer, const render::SceneDescription& scene,
                 const tools::ScratchFolder& folder) {
  PeerRuns runs;
  runs.peer = &peer;
  const auto program = player::find_program(peer.program);
  if (!program) {
    runs.failure = "not installed (scripts/packages bench)";
    return runs;
  }
  runs.program = *program;
  runs.scene_file = folder.file(fmt::format("scene.{}", peer.extension));
  write_text(runs.scene_file, peer.write_scene(scene));
  return runs;
}

ProgramRun start_peer(const PeerRuns& runs, const PeerJob& job, int limit_s) {
  std::vector<std::string> arguments = runs.peer->arguments(runs.scene_file, job);
  arguments.insert(arguments.begin(), runs.program);
  return player::run_child(arguments, std::chrono::seconds(limit_s));
}

/// Runs a peer, unless it has failed before.
void run_peer(PeerRuns& runs, const PeerJob& job, int limit_s) {
  if (!runs.failure.empty() || player::interrupted()) return;
  const ProgramRun result = start_peer(runs, job, limit_s);
  const auto seconds = runs.peer->traced_seconds(result.output);
  if (result.timed_out)
    runs.failure = fmt::format("ended after {} s, the limit", limit_s);
  else if (result.exit_code != 0)
    runs.failure = fmt::format("failed with exit code {}", result.exit_code);
  else if (!seconds || *seconds == 0.0)
    runs.failure = "does not report its ray tracing time";
  else
    runs.seconds.push_back(*seconds);
}

void keep_picture(const ExactFlags& flags, const PeerRuns& runs, const PeerJob& job,
                  const std::string& scene) {
  if (flags.peer_pictures.empty() || !runs.failure.empty()) return;
  constexpr double kSmall = 640.0 * 360.0;
  PeerJob small = job;
  const PeerJob size = lab::peer_picture(kSmall, static_cast<double>(job.width) / job.height);
  small.width = size.width;
  small.height = size.height;
  const std::string name =
      fmt::format("{}-{}.ppm", std::filesystem::path(scene).stem().string(), runs.peer->program);
  small.picture = (std::filesystem::path(flags.peer_pictures) / name).string();
  (void)start_peer(runs, small, flags.peer_limit_s);
}

/// Returns "tree" for "builtin:tree" and "builtin:tree:9".
std::string short_name(const std::string& scene) {
  const size_t begin = scene.find(':') + 1;
  return scene.substr(begin, scene.find(':', begin) - begin);
}

nlohmann::json row_of(const PeerRuns& runs, const PeerJob& job, double our_mray_s,
                      const std::string& scene) {
  nlohmann::json row = {{"name", runs.peer->name}, {"runs", runs.seconds.size()}};
  if (!runs.failure.empty()) row["failure"] = runs.failure;
  if (runs.seconds.empty()) return row;
  const auto rays = static_cast<uint64_t>(job.width) * static_cast<uint64_t>(job.height);
  const double rate = mega_per_second(rays, median(runs.seconds));
  const double target = runs.peer->target(short_name(scene));
  row["seconds"] = median(runs.seconds);
  row["mray_s"] = rate;
  row["ours_over_theirs"] = rate > 0.0 ? our_mray_s / rate : 0.0;
  row["target"] = target;
  row["within_target"] = our_mray_s >= target * rate;
  return row;
}

PeerJob job_of(const ExactFlags& flags, const BenchScene& bench) {
  const optics::Panel& panel = bench.setup().rig.panel;
  const double aspect =
      panel.width_px * panel.pixel_width.value / (panel.height_px * panel.pixel_height.value);
  const double rays =
      flags.peer_mrays > 0.0 ? flags.peer_mrays * 1e6 : static_cast<double>(bench.subpixels());
  PeerJob job = lab::peer_picture(rays, aspect);
  job.max_depth = flags.depth;
  job.threads =
      flags.threads > 0 ? flags.threads : static_cast<int>(std::thread::hardware_concurrency());
  return job;
}

}  // namespace

nlohmann::json measure_peers(const ExactFlags& flags, const std::string& scene) {
  BenchScene bench(exact_setup(flags, scene));
  const PeerJob job = job_of(flags, bench);
  const tools::ScratchFolder folder;
  std::vector<PeerRuns> runs;
  for (const lab::Peer& peer : lab::peers()) {
    runs.push_back(prepare(peer, bench.description(), folder));
    keep_picture(flags, runs.back(), job, short_name(scene));
  }
  const auto method = bench.method(bench.options(flags.depth));
  std::vector<double> ours;
  for (int run = 0; run < flags.runs && !player::interrupted(); ++run) {
    ours.push_back(bench.render(*method).seconds);
    for (PeerRuns& peer : runs) run_peer(peer, job, flags.peer_limit_s);
  }
  const double our_rate = mega_per_second(bench.subpixels(), median(ours));
  nlohmann::json rows = nlohmann::json::array();
  for (const PeerRuns& peer : runs) rows.push_back(row_of(peer, job, our_rate, scene));
  return {{"scene", scene},         {"width", job.width},           {"height", job.height},
          {"threads", job.threads}, {"ours_seconds", median(ours)}, {"ours_mray_s", our_rate},
          {"rows", std::move(rows)}};
}

void print_peers(const nlohmann::json& r) {
  print_out("{}: {} threads each; theirs a picture of {} x {}\n", r["scene"].get<std::string>(),
            r["threads"].get<int>(), r["width"].get<int>(), r["height"].get<int>());
  print_out("  {:<10} {:>8.2f} M primary rays/s {:>9.2f} s\n", "ours",
            r["ours_mray_s"].get<double>(), r["ours_seconds"].get<double>());
  for (const auto& row : r["rows"]) {
    print_out("  {:<10} ", row["name"].get<std::string>());
    if (row.contains("mray_s"))
      print_out("{:>8.3f} M primary rays/s {:>9.2f} s, ours {:.1f} x", row["mray_s"].get<double>(),
                row["seconds"].get<double>(), row["ours_over_theirs"].get<double>());
    if (row.contains("target") && row["target"].get<double>() > 0.0)
      print_out(" (at least {:.0f} x: {})", row["target"].get<double>(),
                row["within_target"].get<bool>() ? "met" : "missed");
    if (row.contains("failure"))
      print_out("{}{}", row.contains("mray_s") ? "; then " : "", row["failure"].get<std::string>());
    print_out("\n");
  }
}

}  // namespace lenticule::bench
