// SPDX-License-Identifier: Apache-2.0
#include "farm/merge.h"

#include <fmt/format.h>

#include <thread>

#include "base/error.h"
#include "base/text.h"
#include "frames/sequence/sequence_joiner.h"

namespace lenticule::farm {
namespace {

constexpr std::chrono::milliseconds kLook{500};

void pause_of(const MergeOptions& options) {
  if (options.pause) {
    options.pause(kLook);
  } else {
    std::this_thread::sleep_for(kLook);
  }
}

[[noreturn]] void refuse_missing(const WorkFolder& folder, const std::vector<uint64_t>& missing) {
  throw Error(
      ErrorKind::Input,
      fmt::format("{}: {} of {} chunks are missing: {}", folder.path().string(), missing.size(),
                  folder.plan().chunks(), shortened(ranges_text(missing), 200)),
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
    pause_of(options);
    std::erase_if(missing, [&](uint64_t chunk) { return folder.done(chunk).has_value(); });
  }
  return missing;
}

/// Refuses a chunk of which two processes rendered other bytes.
void refuse_differing(const WorkFolder& folder, const ChunkReport& report) {
  const auto other = folder.differing_report(report.chunk);
  if (!other || other->digest == report.digest) return;
  throw Error(ErrorKind::Input,
              fmt::format("{}: chunk {}: {} and {} rendered different bytes",
                          folder.path().string(), report.chunk, report.node, other->node),
              fmt::format("lenticule farm verify finds the node that is wrong; then remove the two "
                          "reports of the chunk, {} among them, and render it again",
                          folder.report_file(report.chunk).string()));
}

}  // namespace

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
  frames::SequenceJoiner joiner(film, folder.plan().film);
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
      throw Error(
          ErrorKind::Input, fmt::format("chunk {}: {}", chunk, error.what()),
          fmt::format("the chunk counts as missing now: run lenticule farm render {} {}, or "
                      "call farm submit again",
                      folder.path().string(), chunk));
    }
    const uint64_t frames = folder.plan().chunk(chunk).end - folder.plan().begin;
    if (joiner.frame_count() != frames)
      throw Error(ErrorKind::Input,
                  fmt::format("{}: has {} frames too few or too many", file.string(),
                              frames > joiner.frame_count() ? frames - joiner.frame_count()
                                                            : joiner.frame_count() - frames));
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

}  // namespace lenticule::farm
