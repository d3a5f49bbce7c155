// SPDX-License-Identifier: Apache-2.0
// lenticule bench farm measures what a farm costs beside rendering: the status of many chunks, and
// the merge against cp. From the measured figures it simulates farms of up to 10 000 nodes.
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "apps/lenticule-bench/farm/bench_chunk.h"
#include "apps/lenticule-bench/farm/simulation.h"
#include "apps/lenticule-bench/farm/sparse_film.h"
#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_timing.h"
#include "apps/lenticule-tools/offline/scratch_folder.h"
#include "base/error.h"
#include "base/file.h"
#include "base/print.h"
#include "base/temporary.h"
#include "farm/merge.h"
#include "farm/status.h"
#include "frames/sequence/predictor_choice.h"
#include "frames/sequence/sequence_joiner.h"
#include "frames/sequence/sequence_writer.h"
#include "player/process/child_process.h"
#include "player/process/interrupt.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct FarmBenchFlags {
  std::string folder;
  uint64_t chunks = 10'000;
  uint64_t merge_mib = 2048;
  uint64_t sparse_gb = 0;
  int runs = 3;
  double frame_seconds = 160.0;
  double scene_mb = 1000.0;
  double frame_mb = 10.0;
  bool cold = false;
  bool json = false;
};

farm::Plan bench_plan(const fs::path& folder, uint64_t frames, uint64_t chunk_frames,
                      frames::FrameGeometry geometry) {
  farm::Plan plan;
  plan.program = "lenticule";
  plan.arguments = {"builtin:demo"};
  plan.end = frames;
  plan.chunk_frames = chunk_frames;
  plan.film.geometry = geometry;
  plan.film.rig_fingerprint = "0123456789abcdef";
  plan.film.software = "lenticule";
  plan.output = (folder / "film.lts").string();
  return plan;
}

/// Writes reports and sparse chunks, as many nodes would.
void fake_chunks(const farm::WorkFolder& folder) {
  const std::string digits = frames::digest_of_text("");
  for (uint64_t number = 0; number < folder.plan().chunks(); ++number) {
    const farm::Chunk chunk = folder.plan().chunk(number);
    farm::ChunkReport report{.plan = folder.identity(), .chunk = number};
    report.begin = chunk.begin;
    report.end = chunk.end;
    report.digest = digits;
    report.bytes = 100'000'000;
    report.first_bands = report.last_bands =
        std::vector<uint64_t>(36, number * 0x9E3779B97F4A7C15U);
    report.node = fmt::format("node{:05}", number % 200);
    report.seconds = report.render_seconds = 600.0;
    std::ofstream(folder.report_file(number)) << farm::chunk_report_to_json(report);
    std::ofstream(folder.chunk_file(report)).flush();
    fs::resize_file(folder.chunk_file(report), report.bytes);
  }
}

json measure_status(const fs::path& scratch, const FarmBenchFlags& flags) {
  const fs::path work = scratch / "status";
  farm::WorkFolder::create(work, bench_plan(scratch, 10 * flags.chunks, 10, {3840, 2160}),
                           "lenticule");
  fake_chunks(farm::WorkFolder(work));
  std::vector<double> seconds;
  uint64_t done = 0;
  for (int run = 0; run < flags.runs && !interrupted(); ++run) {
    const double begin = seconds_now();
    const farm::WorkFolder folder(work);
    done = farm::read_status(folder, farm::folder_time(work)).chunks_done;
    seconds.push_back(seconds_now() - begin);
  }
  return {{"chunks", flags.chunks}, {"chunks_done", done}, {"seconds", median(seconds)}};
}

/// Fills a frame with bytes that do not compress.
void fill_noise(frames::WovenFrame& frame, uint64_t number) {
  uint64_t state = number + 1;
  for (uint8_t& byte : frame.bytes()) {
    state ^= state << 13U;
    state ^= state >> 7U;
    state ^= state << 17U;
    byte = static_cast<uint8_t>(state >> 32U);
  }
}

void write_noise_chunk(const farm::WorkFolder& folder, uint64_t number) {
  make_bench_chunk(folder, number,
                   [](const fs::path& file, const frames::SequenceInfo& info,
                      const farm::Chunk& chunk, farm::ChunkReport& report) {
                     frames::SequenceWriter writer(file, info,
                                                   {.part_of_film = {.first = chunk.begin}});
                     frames::WovenFrame frame(info.geometry);
                     for (uint64_t n = chunk.begin; n < chunk.end; ++n) {
                       fill_noise(frame, n);
                       writer.append(frame.view());
                       report.last_bands = frames::band_digests(frame.view());
                       if (n == chunk.begin) report.first_bands = report.last_bands;
                     }
                     writer.finish();
                   });
}

/// Takes the files of a folder out of the page cache.
void forget_pages(const fs::path& folder) {
  for (const auto& entry : fs::directory_iterator(folder)) {
    const OpenedFile file = open_regular_file(entry.path(), UINT64_MAX);
    (void)::fdatasync(file.descriptor.get());
    (void)::posix_fadvise(file.descriptor.get(), 0, 0, POSIX_FADV_DONTNEED);
  }
}

/// Merges chunks and copies their files with cp, by turns. Both write the copy to the disk.
json measure_merge(const fs::path& scratch, const FarmBenchFlags& flags) {
  constexpr uint64_t kChunkFrames = 8;
  const frames::FrameGeometry geometry{3840, 2160};
  const uint64_t frames = std::max<uint64_t>(1, (flags.merge_mib << 20U) / geometry.frame_bytes());
  const fs::path work = scratch / "merge";
  farm::WorkFolder::create(work, bench_plan(scratch, frames, kChunkFrames, geometry), "lenticule");
  const farm::WorkFolder folder(work);
  for (uint64_t chunk = 0; chunk < folder.plan().chunks() && !interrupted(); ++chunk)
    write_noise_chunk(folder, chunk);
  std::vector<double> merge, copy;
  double peak = 0.0;
  uint64_t bytes = 0;
  for (int run = 0; run < flags.runs && !interrupted(); ++run) {
    if (flags.cold) forget_pages(work / "chunks");
    reset_peak_resident();
    double begin = seconds_now();
    bytes = farm::merge_film(folder, scratch / "film.lts").bytes;
    merge.push_back(seconds_now() - begin);
    peak = std::max(peak, peak_resident_mib());
    fs::remove(scratch / "film.lts");
    if (flags.cold) forget_pages(work / "chunks");
    begin = seconds_now();
    const auto run_shell = [](const std::string& line) {
      return run_child({"/bin/sh", "-c", line}, std::chrono::hours(1)).exit_code;
    };
    if (run_shell(fmt::format("cp -r '{0}/chunks' '{1}/copy' && sync '{1}'/copy/*", work.string(),
                              scratch.string())) != 0)
      throw Error(ErrorKind::Failed, "cp: failed");
    copy.push_back(seconds_now() - begin);
    fs::remove_all(scratch / "copy");
  }
  return {{"bytes", bytes},
          {"cold", flags.cold},
          {"merge_seconds", median(merge)},
          {"cp_seconds", median(copy)},
          {"speed_of_cp", median(copy) / median(merge)},
          {"merge_bytes_per_second", static_cast<double>(bytes) / median(merge)},
          {"peak_mib", peak}};
}

/// Merges sparse chunks to a film whose blocks are freed while it is written: what the disk does
/// not limit.
json measure_sparse_merge(const fs::path& scratch, const FarmBenchFlags& flags) {
  constexpr uint64_t kChunkFrames = 40;
  const frames::FrameGeometry geometry{3840, 2160};
  const uint64_t frames = 1'000'000'000 / geometry.frame_bytes() * flags.sparse_gb;
  const fs::path work = scratch / "sparse";
  farm::WorkFolder::create(work, bench_plan(work, frames, kChunkFrames, geometry), "lenticule");
  const farm::WorkFolder folder(work);
  for (uint64_t chunk = 0; chunk < folder.plan().chunks() && !interrupted(); ++chunk)
    write_sparse_chunk(folder, chunk);
  const FilmDiscarder discarder(work);
  reset_peak_resident();
  const double begin = seconds_now();
  farm::MergeOptions options;
  options.stops = [](uint64_t) { return interrupted(); };
  const uint64_t bytes = farm::merge_film(folder, work / "film.lts", options).bytes;
  return {{"bytes", bytes},
          {"merge_seconds", seconds_now() - begin},
          {"peak_mib", peak_resident_mib()}};
}

json simulate(const FarmBenchFlags& flags, double merge_rate, uint64_t nodes,
              uint64_t chunk_frames) {
  SimulatedFarm farm;
  farm.nodes = nodes;
  farm.chunk_frames = chunk_frames;
  farm.frame_seconds = flags.frame_seconds;
  farm.scene_bytes = 1e6 * flags.scene_mb;
  farm.frame_bytes = 1e6 * flags.frame_mb;
  farm.merge_bytes_per_second = merge_rate;
  const SimulatedRun run = simulate_farm(farm);
  return {{"nodes", nodes},
          {"chunk_frames", chunk_frames},
          {"render_seconds", run.render_seconds},
          {"merge_seconds", run.merge_seconds},
          {"efficiency", run.efficiency},
          {"store_busy", run.store_busy},
          {"metadata_busy", run.metadata_busy},
          {"scheduler_busy", run.scheduler_busy},
          {"lost", run.lost},
          {"repeated", run.repeated},
          {"failures", run.failures}};
}

void print_simulation(const json& rows) {
  print_out("{:>6} {:>6} {:>9} {:>8} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6}\n", "nodes", "chunk",
            "render h", "merge h", "eff %", "store", "names", "sched", "lost", "again");
  const auto percent = [](const json& part) { return 100.0 * part.get<double>(); };
  for (const json& row : rows)
    print_out(
        "{:>6} {:>6} {:>9.2f} {:>8.2f} {:>6.1f} {:>6.1f} {:>6.1f} {:>6.1f} {:>6.1f} {:>6.1f}\n",
        row["nodes"].get<uint64_t>(), row["chunk_frames"].get<uint64_t>(),
        row["render_seconds"].get<double>() / 3600.0, row["merge_seconds"].get<double>() / 3600.0,
        percent(row["efficiency"]), percent(row["store_busy"]), percent(row["metadata_busy"]),
        percent(row["scheduler_busy"]), percent(row["lost"]), percent(row["repeated"]));
}

ExitCode measure_farm(const FarmBenchFlags& flags) {
  const TemporaryFolder scratch(flags.folder.empty() ? fs::temp_directory_path()
                                                     : fs::path(flags.folder));
  json result = {{"machine", machine_json()}};
  result["status"] = measure_status(scratch.path(), flags);
  if (!interrupted()) result["merge"] = measure_merge(scratch.path(), flags);
  if (flags.sparse_gb > 0 && !interrupted())
    result["sparse_merge"] = measure_sparse_merge(scratch.path(), flags);
  if (interrupted()) return interrupt_exit_code();
  const double rate = result["merge"]["merge_bytes_per_second"].get<double>();
  result["simulation"] = json::array();
  for (const uint64_t nodes : {10U, 100U, 1000U, 10'000U})
    for (const uint64_t chunk : {1U, 10U, 32U})
      result["simulation"].push_back(simulate(flags, rate, nodes, chunk));
  if (flags.json) {
    print_json(result);
    return kOk;
  }
  const json& status = result["status"];
  const json& merge = result["merge"];
  print_out("{}\n", machine_text());
  print_out("status of {} chunks   {:.2f} s\n", status["chunks"].get<uint64_t>(),
            status["seconds"].get<double>());
  print_out("merge of {} MiB, {}   {:.2f} s, {:.0f} % of cp's speed, {:.0f} MiB of memory\n",
            merge["bytes"].get<uint64_t>() >> 20U, flags.cold ? "from the disk" : "cached",
            merge["merge_seconds"].get<double>(), 100.0 * merge["speed_of_cp"].get<double>(),
            merge["peak_mib"].get<double>());
  if (const json& sparse = result["sparse_merge"]; !sparse.is_null())
    print_out("merge of {:.0f} GB, sparse   {:.0f} s, {:.2f} GB/s, {:.0f} MiB of memory\n",
              1e-9 * sparse["bytes"].get<double>(), sparse["merge_seconds"].get<double>(),
              1e-9 * sparse["bytes"].get<double>() / sparse["merge_seconds"].get<double>(),
              sparse["peak_mib"].get<double>());
  print_out("simulated: 100 000 frames of {:g} s, {:g} MB of scene, {:g} MB a frame; percent\n",
            flags.frame_seconds, flags.scene_mb, flags.frame_mb);
  print_simulation(result["simulation"]);
  return kOk;
}

}  // namespace

Run declare_bench_farm(CLI::App& app) {
  auto flags = std::make_shared<FarmBenchFlags>();
  app.add_option("--folder", flags->folder, "folder for the files (default: the temporary one)");
  app.add_option("--chunks", flags->chunks, "number of chunks whose status is read")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--merge-mib", flags->merge_mib, "size of the film to merge, MiB")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_flag("--cold", flags->cold,
               "read the chunks from the disk, not from the page cache, for merge and cp");
  app.add_option("--sparse-gb", flags->sparse_gb,
                 "also merge a film of this size, GB, that takes no room on the disk")
      ->check(CLI::Range(0, 100'000))
      ->capture_default_str();
  app.add_option("--runs", flags->runs, "number of runs; medians are reported")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_option("--frame-seconds", flags->frame_seconds, "simulated time of a frame")
      ->check(CLI::Range(0.01, 1e6))
      ->capture_default_str();
  app.add_option("--scene-mb", flags->scene_mb, "simulated scene that each process reads, MB")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  app.add_option("--frame-mb", flags->frame_mb, "simulated size of a frame, MB")
      ->check(CLI::Range(0.0, 1e4))
      ->capture_default_str();
  app.add_flag("--json", flags->json, "print as JSON");
  return [flags] { return measure_farm(*flags); };
}

}  // namespace lenticule::player
