// SPDX-License-Identifier: Apache-2.0
// lenticule farm verify renders some frames again and compares them with the chunks: it finds a
// node whose processor or memory is faulty.
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <random>
#include <set>

#include "apps/lenticule-tools/farm/actions.h"
#include "apps/lenticule-tools/farm/planned_film.h"
#include "base/error.h"
#include "base/json_output.h"
#include "base/print.h"
#include "farm/work_folder.h"
#include "frames/sequence/sequence_reader.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"

namespace lenticule::tools {
namespace {

struct DoneChunk {
  farm::ChunkReport report;
  bool differing = false;  ///< another process reported other bytes
};

struct Difference {
  uint64_t frame = 0;
  uint64_t chunk = 0;
  std::string node;
  uint64_t subpixels = 0;  ///< all if the chunk cannot be decoded
};

std::vector<DoneChunk> done_chunks(const farm::WorkFolder& folder) {
  std::vector<DoneChunk> chunks;
  for (uint64_t number = 0; number < folder.plan().chunks(); ++number) {
    if (auto report = folder.done(number)) chunks.push_back({std::move(*report), false});
    if (auto other = folder.differing_report(number)) chunks.push_back({std::move(*other), true});
  }
  return chunks;
}

/// Returns (frame, index of its chunk), in ascending order: `sample` frames at random, and the
/// first frames of chunks that two nodes rendered with different bytes.
std::set<std::pair<uint64_t, size_t>> choose_frames(const std::vector<DoneChunk>& chunks,
                                                    uint64_t sample, uint64_t seed) {
  std::vector<std::pair<uint64_t, size_t>> all;
  std::set<std::pair<uint64_t, size_t>> chosen;
  std::set<uint64_t> disputed;
  for (const DoneChunk& chunk : chunks)
    if (chunk.differing) disputed.insert(chunk.report.chunk);
  for (size_t i = 0; i < chunks.size(); ++i) {
    const farm::ChunkReport& report = chunks[i].report;
    for (uint64_t frame = report.begin; frame < report.end; ++frame) {
      all.emplace_back(frame, i);
      if (disputed.count(report.chunk) > 0) chosen.insert(all.back());
    }
  }
  std::mt19937_64 random(seed);
  std::sample(all.begin(), all.end(), std::inserter(chosen, chosen.end()), sample, random);
  return chosen;
}

/// Compares one frame of a chunk with the same frame rendered here.
std::optional<Difference> compare(const farm::WorkFolder& folder, const DoneChunk& chunk,
                                  uint64_t frame, const frames::WovenFrame& rendered) {
  const frames::SequenceReader reader(folder.chunk_file(chunk.report));
  frames::WovenFrame there(rendered.geometry());
  Difference difference{
      .frame = frame, .chunk = chunk.report.chunk, .node = chunk.report.node, .subpixels = 0};
  const uint64_t index = frame - chunk.report.begin;
  if (reader.geometry() != rendered.geometry() || index >= reader.frame_count() ||
      !reader.make_decoder().decode(index, there.bytes())) {
    difference.subpixels = rendered.bytes().size();
    return difference;
  }
  for (size_t i = 0; i < rendered.bytes().size(); ++i)
    if (rendered.bytes()[i] != there.bytes()[i]) ++difference.subpixels;
  return difference.subpixels > 0 ? std::optional(difference) : std::nullopt;
}

nlohmann::json result_json(uint64_t checked, uint64_t seed,
                           const std::vector<Difference>& differences) {
  nlohmann::json out = {
      {"frames_checked", checked}, {"seed", seed}, {"differences", nlohmann::json::array()}};
  for (const Difference& one : differences)
    out["differences"].push_back({{"frame", one.frame},
                                  {"chunk", one.chunk},
                                  {"node", one.node},
                                  {"subpixels", one.subpixels}});
  return out;
}

}  // namespace

ExitCode farm_verify(const FarmVerifyFlags& flags) {
  const farm::WorkFolder folder(flags.folder);
  const std::vector<DoneChunk> chunks = done_chunks(folder);
  if (chunks.empty())
    throw Error(ErrorKind::Input, fmt::format("{}: no chunk is done", flags.folder));
  const uint64_t seed = flags.seed != 0 ? flags.seed : std::random_device{}();
  const auto chosen = choose_frames(chunks, flags.sample, seed);
  PlannedFilm film(folder.plan(), flags.threads);
  frames::WovenFrame rendered(film.renderer().geometry());
  std::vector<Difference> differences;
  player::Progress progress("verify", "frames", chosen.size());
  uint64_t checked = 0;
  std::optional<uint64_t> last;
  for (const auto& [frame, index] : chosen) {
    if (frame != last && !film.renderer().render(frame, rendered, player::interrupted))
      return player::interrupt_exit_code();
    last = frame;
    if (const auto difference = compare(folder, chunks[index], frame, rendered))
      differences.push_back(*difference);
    progress.update(++checked);
  }
  progress.finish();
  if (flags.json) {
    print_json(result_json(checked, seed, differences));
  } else {
    for (const Difference& one : differences)
      print_out("frame {}: {} subpixels differ in chunk {}, rendered by {}\n", one.frame,
                one.subpixels, one.chunk, one.node);
    print_out("{} frames rendered again, {} differ (seed {})\n", checked, differences.size(), seed);
  }
  return differences.empty() ? kOk : kQuality;
}

}  // namespace lenticule::tools
