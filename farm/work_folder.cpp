// SPDX-License-Identifier: Apache-2.0
#include "farm/work_folder.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <set>
#include <thread>
#include <type_traits>

#include "base/numbers.h"
#include "base/text.h"

namespace lenticule::farm {
namespace {

namespace fs = std::filesystem;

using nlohmann::json;
using optics::JsonFields;
using optics::parse_json;

/// Passes the keys and fields of a report, of progress or of a failure to `each`.
template <class Record, class Each>
void each_field(Record& r, Each&& each) {
  using Plain = std::remove_const_t<Record>;
  each("node", r.node);
  each("chunk", r.chunk);
  if constexpr (std::is_same_v<Plain, ChunkFailure>) {
    each("error", r.error);
    each("hint", r.hint);
  } else if constexpr (std::is_same_v<Plain, ChunkProgress>) {
    each("done", r.done);
    each("count", r.count);
    each("seconds", r.seconds);
  } else {
    each("plan", r.plan);
    each("begin", r.begin);
    each("end", r.end);
    each("digest", r.digest);
    each("bytes", r.bytes);
    each("first_bands", r.first_bands);
    each("last_bands", r.last_bands);
    each("isa", r.isa);
    each("threads", r.threads);
    each("seconds", r.seconds);
    each("render_seconds", r.render_seconds);
    each("extra_seconds", r.extra_seconds);
    each("started", r.started);
  }
}

template <class Value>
const Value& json_of(const Value& value) {
  return value;
}
std::string json_of(const std::vector<uint64_t>& bands) {
  std::string text;
  for (const uint64_t band : bands) text += fmt::format("{:016x}", band);
  return text;
}

void read_value(const JsonFields& fields, const char* key, std::string& value) {
  value = fields.text(key);
}
void read_value(const JsonFields& fields, const char* key, uint64_t& value) {
  value = fields.whole(key, UINT64_MAX);
}
void read_value(const JsonFields& fields, const char* key, int& value) {
  value = static_cast<int>(fields.whole(key, 1U << 20U));
}
void read_value(const JsonFields& fields, const char* key, double& value) {
  value = fields.number(key, 0.0);
}
void read_value(const JsonFields& fields, const char* key, std::vector<uint64_t>& bands) {
  constexpr size_t kDigits = 16;
  const std::string text = fields.text(key);
  for (size_t at = 0; at < text.size(); at += kDigits) {
    const auto digits = std::string_view(text).substr(at, kDigits);
    const auto band = number_from<uint64_t>(digits, 16);
    if (!band || digits.size() != kDigits) fields.fail(key, "not digests of 16 digits");
    bands.push_back(*band);
  }
}

constexpr std::chrono::milliseconds kLook{500};

[[noreturn]] void refuse_missing(const WorkFolder& folder, const std::vector<uint64_t>& missing) {
  throw input_error("{}: {} of {} chunks are missing: {}", folder.path().string(), missing.size(),
                    folder.plan().chunks(), shortened(ranges_text(missing), 200))
      .remedy(
          "run commands.txt again, which skips what is done, or call farm submit again; --partial "
          "joins "
          "the frames before the first missing chunk");
}

/// Waits for missing chunks. Returns those that stay missing.
std::vector<uint64_t> await_chunks(const WorkFolder& folder, const MergeOptions& options) {
  std::vector<uint64_t> missing = missing_chunks(folder);
  for (std::chrono::milliseconds waited{0}; !missing.empty() && waited < options.wait;
       waited += kLook) {
    if (options.stops(missing.front())) break;
    options.pause(kLook);
    std::erase_if(missing, [&](uint64_t chunk) { return folder.done(chunk).has_value(); });
  }
  return missing;
}

/// Refuses a chunk of which two processes rendered other bytes.
void refuse_differing(const WorkFolder& folder, const ChunkReport& report) {
  const auto other = folder.differing_report(report.chunk);
  if (!other || other->digest == report.digest) return;
  throw input_error("{}: chunk {}: {} and {} rendered different bytes", folder.path().string(),
                    report.chunk, report.node, other->node)
      .remedy(fmt::format("lenticule farm verify finds the node that is wrong; then remove the two "
                          "reports of the chunk, {} among them, and render it again",
                          folder.report_file(report.chunk).string()));
}

// A listing that is late only delays what is shown.

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

/// Returns the chunks that two processes rendered with other bytes, in ascending order as the names
/// of their reports.
std::vector<uint64_t> differing_chunks(const WorkFolder& folder) {
  std::vector<uint64_t> chunks;
  for (const fs::path& file : entries_of(folder.path() / "reports")) {
    const std::string name = file.filename().string();
    if (!name.ends_with(".differs.json")) continue;
    const auto chunk = number_from<uint64_t>(name.substr(0, name.find('.')));
    if (chunk && *chunk < folder.plan().chunks() && folder.differing_report(*chunk))
      chunks.push_back(*chunk);
  }
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
      status.running.push_back({.progress = parse_record<ChunkProgress>(*text, file.string()),
                                .silent_seconds = silent});
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
        status.failed.push_back(parse_record<ChunkFailure>(*text, file.string()));
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

template <class Record>
Record parse_record(std::string_view text, const std::string& source) {
  const json object = parse_json(text, source);
  const JsonFields fields(object, source);
  Record record;
  each_field(record, [&](const char* key, auto& value) { read_value(fields, key, value); });
  return record;
}

template <class Record>
std::string record_to_json(const Record& record) {
  json object;
  each_field(record, [&](const char* key, const auto& value) { object[key] = json_of(value); });
  return json_text(object) + "\n";
}

template std::string record_to_json(const ChunkReport&);
template std::string record_to_json(const ChunkProgress&);
template std::string record_to_json(const ChunkFailure&);
template ChunkReport parse_record(std::string_view, const std::string&);
template ChunkProgress parse_record(std::string_view, const std::string&);
template ChunkFailure parse_record(std::string_view, const std::string&);

std::vector<uint64_t> missing_chunks(const WorkFolder& folder) {
  std::vector<uint64_t> missing;
  for (uint64_t chunk = 0; chunk < folder.plan().chunks(); ++chunk)
    if (!folder.done(chunk)) missing.push_back(chunk);
  return missing;
}

MergeResult merge_film(const WorkFolder& folder, const std::filesystem::path& film,
                       const MergeOptions& options) {
  const std::vector<uint64_t> missing = await_chunks(folder, options);
  MergeResult result;
  result.chunks = missing.empty() ? folder.plan().chunks() : missing.front();
  if (!missing.empty() && (!options.partial || result.chunks == 0)) refuse_missing(folder, missing);
  SequenceJoiner joiner(film, folder.plan().film);
  for (uint64_t chunk = 0; chunk < result.chunks; ++chunk) {
    if (options.stops(chunk)) return {.stopped = true};
    const auto report = folder.done(chunk);
    if (!report) refuse_missing(folder, {chunk});
    refuse_differing(folder, *report);
    const std::filesystem::path file = folder.chunk_file(*report);
    try {
      joiner.append({.file = file,
                     .digest = report->digest,
                     .first_bands = report->first_bands,
                     .last_bands = report->last_bands});
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::Input) throw;
      folder.forget(chunk);
      throw input_error("chunk {}: {}", chunk, error.what())
          .remedy(
              fmt::format("the chunk counts as missing now: run lenticule farm render {} {}, or "
                          "call farm submit again",
                          folder.path().string(), chunk));
    }
    const uint64_t frames = folder.plan().chunk(chunk).end - folder.plan().begin;
    if (joiner.frame_count() != frames)
      throw input_error("{}: has {} frames too few or too many", file.string(),
                        frames > joiner.frame_count() ? frames - joiner.frame_count()
                                                      : joiner.frame_count() - frames);
  }
  joiner.finish();
  result.frames = joiner.frame_count();
  result.bytes = joiner.bytes_written();
  return result;
}

std::string ranges_text(const std::vector<uint64_t>& numbers) {
  std::string text;
  for (size_t at = 0; at < numbers.size();) {
    size_t last = at;
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    text += text.empty() ? "" : ",";
    text += last == at ? fmt::format("{}", numbers[at])
                       : fmt::format("{}-{}", numbers[at], numbers[last]);
    at = last + 1;
  }
  return text;
}

double folder_time(const fs::path& folder) {
  try {
    const TemporaryFile probe(folder / "now");
    struct stat status {};
    if (::fstat(probe.fd(), &status) == 0) return seconds_of(status.st_mtim);
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
