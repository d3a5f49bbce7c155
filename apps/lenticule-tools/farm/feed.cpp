// SPDX-License-Identifier: Apache-2.0
// lenticule farm feed passes frames to a player in their order while the farm renders: each frame
// once, as soon as its chunk and all chunks before it are done.
#include <fmt/format.h>
#include <poll.h>

#include <optional>

#include "apps/lenticule-tools/farm/actions.h"
#include "apps/lenticule-tools/offline/frame_output.h"
#include "base/error.h"
#include "base/json_output.h"
#include "base/print.h"
#include "farm/work_folder.h"
#include "frames/sequence/sequence_reader.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "player/sources/source_spec.h"

namespace lenticule::tools {
namespace {

constexpr int kLookMilliseconds = 250;

/// Waits for a chunk; returns none if interrupted.
std::optional<farm::ChunkReport> await_chunk(const farm::WorkFolder& folder, uint64_t chunk) {
  while (!player::interrupted()) {
    if (auto report = folder.done(chunk)) return report;
    pollfd query{.fd = player::interrupt_fd(), .events = POLLIN, .revents = 0};
    (void)poll(&query, 1, kLookMilliseconds);
  }
  return std::nullopt;
}

/// Delivers the frames of a chunk; returns false if interrupted. Opens a file again that cannot be
/// read: a network file system takes an opened file away when another node renames one to its name.
bool deliver_chunk(const farm::WorkFolder& folder, const farm::ChunkReport& report,
                   FrameOutput& output, frames::WovenFrame& frame) {
  const std::filesystem::path file = folder.chunk_file(report);
  uint64_t next = report.begin;
  for (const bool again : {false, true}) {
    const frames::SequenceReader reader(file);
    if (reader.geometry() != frame.geometry() || reader.frame_count() != report.end - report.begin)
      throw Error(ErrorKind::Input, fmt::format("{}: not the frames of the plan", file.string()));
    frames::FrameDecoder decoder = reader.make_decoder();
    for (; next < report.end && decoder.decode(next - report.begin, frame.bytes()); ++next)
      if (output.deliver(next, frame.view()) == Delivery::Interrupted) return false;
    if (next == report.end) return true;
    if (again) break;
  }
  throw Error(ErrorKind::Input, fmt::format("{}: frame {} is damaged", file.string(), next),
              "lenticule farm merge names the command that renders the chunk again");
}

}  // namespace

ExitCode farm_feed(const FarmFeedFlags& flags) {
  const farm::WorkFolder folder(flags.folder);
  const farm::Plan& plan = folder.plan();
  if (player::parse_source(flags.output).kind != player::SourceKind::Ring)
    throw Error(ErrorKind::Usage, fmt::format("{}: not a ring", flags.output),
                "for example lenticule farm feed DIR ring:/run/player.sock");
  OutputRequest request{.target = flags.output, .range = {plan.begin, plan.end}};
  request.geometry = plan.film.geometry;
  request.rig = frames::rig_of(plan.film);
  request.rate = plan.film.rate;
  request.ring_timeout_seconds = flags.ring_timeout;
  const std::unique_ptr<FrameOutput> output = open_output(request);
  frames::WovenFrame frame(plan.film.geometry);
  player::Progress progress("feed", "frames", plan.end - plan.begin);
  uint64_t delivered = 0;
  for (uint64_t chunk = 0; chunk < plan.chunks(); ++chunk) {
    const auto report = await_chunk(folder, chunk);
    if (!report || !deliver_chunk(folder, *report, *output, frame)) break;
    delivered += report->end - report->begin;
    progress.update(delivered);
  }
  if (!player::interrupted()) output->finish();
  progress.finish();
  if (flags.json)
    print_json({{"frames", plan.end - plan.begin},
                {"frames_delivered", delivered},
                {"interrupted", player::interrupted()}});
  return player::interrupt_exit_code();
}

}  // namespace lenticule::tools
