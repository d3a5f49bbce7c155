// SPDX-License-Identifier: Apache-2.0
#include "small_farm.h"

#include "farm/sequence_joiner.h"
#include "frames/sequence/band_codec.h"
#include "frames/sequence/sequence_format.h"
#include "frames/sequence/sequence_writer.h"

namespace lenticule::test {
namespace {

farm::WorkFolder create(const std::filesystem::path& folder, const farm::Plan& plan) {
  farm::WorkFolder::create(folder, plan, "/usr/bin/lenticule");
  return farm::WorkFolder(folder);
}

farm::Plan with_output(farm::Plan plan, const std::string& output) {
  plan.output = output;
  return plan;
}

}  // namespace

frames::WovenFrame farm_frame(uint64_t number) {
  frames::WovenFrame frame(kFarmGeometry);
  for (int j = 0; j < kFarmGeometry.height; ++j)
    for (size_t s = 0; s < kFarmGeometry.row_bytes(); ++s)
      frame.row(j)[s] = static_cast<uint8_t>(s * (3 + number / 40) + static_cast<size_t>(j) * 5 +
                                             (j < 10 ? number / 7 : number));
  return frame;
}

farm::Plan small_plan(uint64_t begin, uint64_t end, uint64_t chunk_frames) {
  farm::Plan plan;
  plan.program = "lenticule 1";
  plan.arguments = {"builtin:demo", "--rig=/rigs/a 'b.toml"};
  plan.begin = begin;
  plan.end = end;
  plan.chunk_frames = chunk_frames;
  plan.film.geometry = kFarmGeometry;
  plan.film.rate = frames::make_rate(24, 1);
  plan.film.first_frame = begin;
  plan.film.rig_fingerprint = "0123456789abcdef";
  plan.film.software = "lenticule 1";
  plan.inputs = {{"scene", "00ff"}};
  plan.timing = {.frames = 3,
                 .start_seconds = 2.0,
                 .frame_seconds = 10.0,
                 .slowest_seconds = 12.0,
                 .peak_bytes = uint64_t{700} << 20,
                 .threads = 4};
  return plan;
}

SmallFarm::SmallFarm(const farm::Plan& plan)
    : work_(create(folder_ / "work", with_output(plan, (folder_ / "film.lts").string()))) {}

bool SmallFarm::render(uint64_t number, const std::string& node, bool other_bytes,
                       double seconds) const {
  const farm::Chunk chunk = plan().chunk(number);
  std::filesystem::create_directories(work_.attempts_folder(number));
  const TemporaryFolder attempt(work_.attempts_folder(number));
  const auto file = attempt.path() / "chunk.lts";
  frames::SequenceInfo info = plan().film;
  info.first_frame = chunk.begin;
  const uint64_t first = chunk.begin - plan().begin;
  const uint64_t key = first - first % frames::kPredictorInterval;
  frames::SequenceWriter writer(file, info,
                                {.threads = 1,
                                 .part_of_film = {.first = first,
                                                  .predictors = frames::choose_predictors(
                                                      farm_frame(plan().begin + key).view(),
                                                      frames::choose_band_rows(kFarmGeometry))}});
  farm::ChunkReport report{.plan = work_.identity(), .chunk = number};
  report.begin = chunk.begin;
  report.end = chunk.end;
  report.node = node;
  report.isa = "baseline";
  report.seconds = report.render_seconds = seconds;
  for (uint64_t n = chunk.begin; n < chunk.end; ++n) {
    frames::WovenFrame frame = farm_frame(n);
    if (other_bytes) frame.bytes()[7] ^= 1;
    writer.append(frame.view());
    if (n == chunk.begin) report.first_bands = farm::band_digests(frame.view());
    report.last_bands = farm::band_digests(frame.view());
  }
  writer.finish();
  report.digest = farm::digest_of_file(file);
  report.bytes = std::filesystem::file_size(file);
  return work_.finish_chunk(attempt.path(), file, report);
}

void SmallFarm::render_all() const {
  for (uint64_t chunk = plan().chunks(); chunk-- > 0;) (void)render(chunk);
}

std::vector<uint8_t> SmallFarm::film_of_one_run() const {
  const auto file = folder_ / "whole.lts";
  frames::SequenceWriter writer(file, plan().film, {.threads = 1});
  for (uint64_t n = plan().begin; n < plan().end; ++n) writer.append(farm_frame(n).view());
  writer.finish();
  return read_bytes(file);
}

std::filesystem::path SmallFarm::chunk_file(uint64_t chunk) const {
  return work_.chunk_file(work_.report(chunk).value());
}

}  // namespace lenticule::test
