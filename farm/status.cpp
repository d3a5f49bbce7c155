// SPDX-License-Identifier: Apache-2.0
#include "farm/status.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <map>
#include <set>
#include <thread>

#include "base/error.h"
#include "base/json_output.h"
#include "base/numbers.h"
#include "base/temporary.h"
#include "base/text.h"
#include "farm/work_folder.h"

namespace lenticule::farm {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr size_t kSlowest = 5;
constexpr double kRateSeconds = 600.0;
constexpr size_t kNodesShown = 20;
constexpr size_t kFailuresShown = 5;
constexpr size_t kReaders = 8;          ///< threads that read reports
constexpr size_t kChunksOfReader = 64;  ///< fewer are not worth a thread

/// Span is the time in which a process rendered frames of a chunk.
struct Span {
  double end;
  uint64_t frames;
  double seconds;
};

/// Returns frames per second of the last ten minutes before `now`, or of the whole time if the farm
/// is younger.
double rate_of(const std::vector<Span>& spans, double now) {
  double begin = now;
  for (const Span& one : spans) begin = std::min(begin, one.end - one.seconds);
  begin = std::max(begin, now - kRateSeconds);
  double frames = 0.0;
  for (const Span& one : spans) {
    if (one.end < begin) continue;
    // A span that began earlier counts with its part of the time.
    const double inside = std::min(one.end, now) - std::max(begin, one.end - one.seconds);
    const double part = one.seconds > 0.0 ? std::clamp(inside / one.seconds, 0.0, 1.0) : 1.0;
    frames += part * static_cast<double>(one.frames);
  }
  return now - begin > 0.0 ? frames / (now - begin) : 0.0;
}

/// DoneChunk is a chunk's report, if the chunk is done, and the time at which it arrived.
struct DoneChunk {
  std::optional<ChunkReport> report{};
  double time = 0.0;
};

/// Reads all reports. Several threads wait for a network file system at the same time.
std::vector<DoneChunk> read_reports(const WorkFolder& folder, double now) {
  std::vector<DoneChunk> chunks(folder.plan().chunks());
  std::atomic<uint64_t> next{0};
  const auto read = [&] {
    for (uint64_t chunk = next++; chunk < chunks.size(); chunk = next++) {
      chunks[chunk].report = folder.done(chunk);
      if (!chunks[chunk].report) continue;
      const auto facts = folder.files().facts(folder.report_file(chunk));
      chunks[chunk].time = facts ? facts->changed : now;
    }
  };
  std::vector<std::jthread> threads;
  for (size_t i = 1; i < std::min(kReaders, chunks.size() / kChunksOfReader); ++i)
    threads.emplace_back(read);
  read();
  threads.clear();
  return chunks;
}

/// Returns the entries of a folder; those that can be read if the folder cannot be read to its end.
/// A listing that is late only delays what is shown.
std::vector<fs::path> entries_of(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
    entries.push_back(at->path());
  return entries;
}

/// Returns the chunks that two processes rendered with other bytes.
std::vector<uint64_t> differing_chunks(const WorkFolder& folder) {
  std::vector<uint64_t> chunks;
  for (const fs::path& file : entries_of(folder.path() / "reports")) {
    const std::string name = file.filename().string();
    if (!name.ends_with(".differs.json")) continue;
    const auto chunk = number_from<uint64_t>(name.substr(0, name.find('.')));
    if (chunk && *chunk < folder.plan().chunks() && folder.differing_report(*chunk))
      chunks.push_back(*chunk);
  }
  std::sort(chunks.begin(), chunks.end());
  return chunks;
}

/// Adds what the processes of one chunk report.
void add_attempts(const WorkFolder& folder, uint64_t chunk, double now, FarmStatus& status) {
  for (const fs::path& attempt : entries_of(folder.attempts_folder(chunk))) {
    const fs::path file = attempt / "progress.json";
    const auto facts = folder.files().facts(file);
    if (!facts) continue;
    const double silent = std::max(0.0, now - facts->changed);
    if (silent > kSilentSeconds) continue;
    try {
      const auto text = folder.files().read(file);
      if (!text) continue;
      status.running.push_back(
          {.progress = parse_chunk_progress(*text, file.string()), .silent_seconds = silent});
    } catch (const Error&) {  // being written at this moment: the chunk shows at the next look
    }
  }
}

/// Returns the chunks in progress.
std::vector<uint64_t> chunks_in_progress(const WorkFolder& folder, const std::vector<bool>& done) {
  std::vector<uint64_t> chunks;
  for (const fs::path& attempts : entries_of(folder.path() / "attempts")) {
    const auto chunk = number_from<uint64_t>(attempts.filename().string());
    if (chunk && *chunk < done.size() && !done[*chunk]) chunks.push_back(*chunk);
  }
  std::sort(chunks.begin(), chunks.end());
  return chunks;
}

void add_unfinished(const WorkFolder& folder, const std::vector<bool>& done, double now,
                    FarmStatus& status) {
  for (const uint64_t chunk : chunks_in_progress(folder, done))
    add_attempts(folder, chunk, now, status);
  std::set<uint64_t> running;
  for (const RunningChunk& one : status.running) running.insert(one.progress.chunk);
  for (uint64_t chunk = 0; chunk < done.size(); ++chunk) {
    if (done[chunk] || running.count(chunk) > 0) continue;
    const fs::path file = folder.failure_file(chunk);
    try {
      if (const auto text = folder.files().read(file)) {
        status.failed.push_back(parse_chunk_failure(*text, file.string()));
        continue;
      }
    } catch (const Error&) {  // counts as missing
    }
    status.missing.push_back(chunk);
  }
}

void add_nodes(const std::map<std::string, NodeStatus>& nodes, FarmStatus& status) {
  for (const auto& [name, node] : nodes) {
    status.nodes.push_back(node);
    if (node.frames > 0) status.nodes.back().frame_seconds /= static_cast<double>(node.frames);
  }
}

std::string duration_text(double seconds) {
  const auto whole = static_cast<uint64_t>(std::max(0.0, seconds) + 0.5);
  if (whole < 120) return fmt::format("{} s", whole);
  if (whole < 7200) return fmt::format("{} min", (whole + 30) / 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

std::string nodes_text(const FarmStatus& status) {
  std::string text = fmt::format("{:<24} {:>7} {:>8} {:>8} {:>9}\n", "node", "chunks", "frames",
                                 "running", "s/frame");
  for (size_t i = 0; i < std::min(status.nodes.size(), kNodesShown); ++i) {
    const NodeStatus& node = status.nodes[i];
    text += fmt::format("{:<24} {:>7} {:>8} {:>8} {:>9.2f}\n", escaped(node.node), node.chunks,
                        node.frames, node.running, node.frame_seconds);
  }
  if (status.nodes.size() > kNodesShown)
    text += fmt::format("and {} more nodes\n", status.nodes.size() - kNodesShown);
  return text;
}

}  // namespace

double folder_time(const fs::path& folder) {
  try {
    const TemporaryFile probe(folder / "now");
    struct stat status {};
    if (::fstat(probe.fd(), &status) == 0)
      return static_cast<double>(status.st_mtim.tv_sec) +
             1e-9 * static_cast<double>(status.st_mtim.tv_nsec);
  } catch (const Error&) {  // a folder that only others may write
  }
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration<double>(now).count();
}

FarmStatus read_status(const WorkFolder& folder, double now) {
  const Plan& plan = folder.plan();
  FarmStatus status{.chunks = plan.chunks(), .frames = plan.end - plan.begin};
  std::vector<bool> done(status.chunks);
  std::vector<Span> spans;
  std::map<std::string, NodeStatus> nodes;
  const std::vector<DoneChunk> chunks = read_reports(folder, now);
  for (uint64_t chunk = 0; chunk < status.chunks; ++chunk) {
    const auto& report = chunks[chunk].report;
    if (!report) continue;
    done[chunk] = true;
    ++status.chunks_done;
    const uint64_t frames = report->end - report->begin;
    status.frames_done += frames;
    status.bytes_done += report->bytes;
    spans.push_back({chunks[chunk].time, frames, report->seconds});
    NodeStatus& node = nodes[report->node];
    node.node = report->node;
    ++node.chunks;
    node.frames += frames;
    node.frame_seconds += report->render_seconds;
    status.slowest.push_back({chunk, report->node, report->seconds});
  }
  for (const uint64_t chunk : differing_chunks(folder))
    if (done[chunk]) status.differing.push_back(chunk);
  add_unfinished(folder, done, now, status);
  uint64_t frames_left = status.frames - status.frames_done;
  for (const RunningChunk& one : status.running) {
    NodeStatus& node = nodes[one.progress.node];
    node.node = one.progress.node;
    ++node.running;
    frames_left -= std::min(frames_left, one.progress.done);
    spans.push_back({now - one.silent_seconds, one.progress.done, one.progress.seconds});
  }
  add_nodes(nodes, status);
  std::stable_sort(status.slowest.begin(), status.slowest.end(),
                   [](const SlowChunk& a, const SlowChunk& b) { return a.seconds > b.seconds; });
  status.slowest.resize(std::min(status.slowest.size(), kSlowest));
  status.frames_per_second = rate_of(spans, now);
  if (status.complete()) {
    status.seconds_left = 0.0;
  } else if (status.frames_per_second > 0.0) {
    status.seconds_left = static_cast<double>(frames_left) / status.frames_per_second;
  }
  status.merged = folder.files().facts(plan.output).has_value();
  return status;
}

json status_json(const FarmStatus& status) {
  json out = {{"chunks", status.chunks},
              {"chunks_done", status.chunks_done},
              {"chunks_running", status.running.size()},
              {"chunks_failed", status.failed.size()},
              {"chunks_missing", status.missing.size()},
              {"frames", status.frames},
              {"frames_done", status.frames_done},
              {"bytes_done", status.bytes_done},
              {"frames_per_second", status.frames_per_second},
              {"seconds_left", status.seconds_left ? json(*status.seconds_left) : json()},
              {"complete", status.complete()},
              {"merged", status.merged},
              {"missing", ranges_text(status.missing)},
              {"differing", status.differing}};
  out["running"] = out["failed"] = out["slowest"] = out["nodes"] = json::array();
  for (const RunningChunk& one : status.running)
    out["running"].push_back({{"chunk", one.progress.chunk},
                              {"node", one.progress.node},
                              {"frames_done", one.progress.done},
                              {"frames", one.progress.count},
                              {"silent_seconds", one.silent_seconds}});
  for (const ChunkFailure& one : status.failed)
    out["failed"].push_back(
        {{"chunk", one.chunk}, {"node", one.node}, {"error", one.error}, {"hint", one.hint}});
  for (const SlowChunk& one : status.slowest)
    out["slowest"].push_back({{"chunk", one.chunk}, {"node", one.node}, {"seconds", one.seconds}});
  for (const NodeStatus& one : status.nodes)
    out["nodes"].push_back({{"node", one.node},
                            {"chunks", one.chunks},
                            {"frames", one.frames},
                            {"running", one.running},
                            {"frame_seconds", one.frame_seconds}});
  return out;
}

std::string status_text(const FarmStatus& status) {
  const double percent =
      100.0 * static_cast<double>(status.frames_done) / static_cast<double>(status.frames);
  std::string text = fmt::format("{} of {} frames ({:.1f} %), {} of {} chunks; {:.2f} frames/s",
                                 status.frames_done, status.frames, percent, status.chunks_done,
                                 status.chunks, status.frames_per_second);
  if (status.complete()) {
    text += status.merged ? "; merged\n" : "; ready to merge\n";
  } else {
    text += status.seconds_left ? fmt::format(", {} left\n", duration_text(*status.seconds_left))
                                : std::string("\n");
    text += fmt::format(
        "running {}, failed {}, missing {}{}\n", status.running.size(), status.failed.size(),
        status.missing.size(),
        status.missing.empty() ? "" : ": " + shortened(ranges_text(status.missing), 60));
  }
  for (size_t i = 0; i < std::min(status.failed.size(), kFailuresShown); ++i)
    text += fmt::format("failed: chunk {} on {}: {}\n", status.failed[i].chunk,
                        escaped(status.failed[i].node), escaped(status.failed[i].error));
  if (!status.differing.empty())
    text += fmt::format("rendered with different bytes by two nodes: chunks {}\n",
                        ranges_text(status.differing));
  if (!status.nodes.empty()) text += nodes_text(status);
  if (status.slowest.empty()) return text;
  text += "slowest:";
  for (const SlowChunk& one : status.slowest)
    text += fmt::format(" {} ({}, {})", one.chunk, duration_text(one.seconds), escaped(one.node));
  return text + "\n";
}

}  // namespace lenticule::farm
