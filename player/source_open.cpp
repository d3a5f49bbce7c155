// SPDX-License-Identifier: Apache-2.0
#include "player/source_open.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <thread>
#include <utility>
#include <vector>

#include "frames/image_io.h"
#include "frames/image_sequence.h"
#include "frames/quilt.h"
#include "frames/ring/ring_player.h"
#include "frames/sequence/sequence_source.h"
#include "optics/error.h"
#include "optics/rig_file.h"
#include "player/quilt_source.h"
#include "player/still_source.h"
#include "player/video_program.h"
#include "player/video_source.h"
#include "player/views_source.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kRing = "ring:";
constexpr std::string_view kViewsPattern = "views:";
constexpr int kMaxDecoderThreads = 8;

/// One core is left to the player itself.
int decoder_threads() {
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  return std::clamp(cores - 1, 1, kMaxDecoderThreads);
}

OpenedSource open_ring(const SourceRequest& request, const std::string& socket) {
  if (socket.empty())
    throw Error(ErrorKind::Usage, "source 'ring:': no socket", "write ring:/run/user/1000/panel");
  if (request.frames)
    throw Error(ErrorKind::Usage, "--frames: a ring plays what its renderer sends",
                "give --frames to lenticule render");
  std::unique_ptr<frames::RingPlayer> ring =
      frames::RingPlayer::open({.socket = socket,
                                .geometry = request.panel,
                                .slots = request.slots,
                                .rig_fingerprint = request.rig_fingerprint,
                                .keep_for_loop = request.plays_again});
  OpenedSource opened;
  opened.loop_obstacle = [player = ring.get()] { return player->statistics().loop_obstacle; };
  opened.source = std::move(ring);
  opened.stall_hint =
      fmt::format("start a renderer: lenticule render SCENE --rig RIG -o ring:{}", socket);
  return opened;
}

std::vector<fs::path> files_in_range(const std::string& text, FrameRange range) {
  if (!frames::FilePattern::looks_like_pattern(text))
    throw Error(ErrorKind::Usage, fmt::format("--frames: '{}' is one picture", text),
                "write a pattern such as 'out/%05d.png'");
  const frames::FilePattern pattern(text);
  std::vector<uint64_t> numbers = pattern.existing();
  std::erase_if(numbers, [&](uint64_t n) { return n < range.begin || n >= range.end; });
  std::vector<fs::path> files;
  for (uint64_t n = range.begin; n < range.end; ++n) {
    const size_t index = static_cast<size_t>(n - range.begin);
    if (index >= numbers.size() || numbers[index] != n)
      throw Error(ErrorKind::Input, fmt::format("{}: no such file", pattern.path(n).string()),
                  "name a range of frames that exist");
    files.push_back(pattern.path(n));
  }
  return files;
}

void refuse_other_kinds(const std::string& text) {
  const std::string extension = fs::path(text).extension().string();
  constexpr std::array kNotYet = {".m3u", ".toml", ".json"};
  const bool not_yet = std::find(kNotYet.begin(), kNotYet.end(), extension) != kNotYet.end();
  std::error_code ignored;
  if (!not_yet && !fs::is_directory(text, ignored) && !text.empty()) return;
  throw Error(
      ErrorKind::Usage, fmt::format("source '{}': not a kind that can be played", text),
      "play ring:SOCKET, FILE.lts, a pattern such as 'out/%05d.png', one picture, a video, card or "
      "views");
}

void require_panel_size(const SourceRequest& request, const frames::FrameGeometry& geometry,
                        const std::string& name) {
  if (geometry == request.panel) return;
  throw Error(ErrorKind::Input,
              fmt::format("{}: {}x{} pixels, but the rig's panel has {}x{}", name, geometry.width,
                          geometry.height, request.panel.width, request.panel.height),
              "woven frames fit one panel, pixel for pixel: render or weave them for this rig");
}

OpenedSource open_pictures(const SourceRequest& request) {
  refuse_other_kinds(request.text);
  std::vector<fs::path> files = request.frames ? files_in_range(request.text, *request.frames)
                                               : frames::list_frame_files(request.text);
  const fs::path first = files.front();
  const uint64_t begin = request.first_frame < files.size() ? request.first_frame : 0;
  OpenedSource opened;
  opened.source = std::make_unique<frames::ImageSequence>(
      std::move(files), frames::ImageSequenceOptions{.pool_frames = std::max(request.slots, 2),
                                                     .decoder_threads = decoder_threads(),
                                                     .first = begin});
  require_panel_size(request, opened.source->geometry(), first.string());
  return opened;
}

/// The name in the rig that a container keeps.
std::string kept_rig_name(const frames::SequenceInfo& info) {
  try {
    return optics::parse_rig(info.rig_toml, "rig").name;
  } catch (const Error&) {
    return {};
  }
}

void require_same_rig(const SourceRequest& request, const frames::SequenceInfo& info) {
  if (info.kind == frames::SequenceKind::Views)
    throw Error(ErrorKind::Input, fmt::format("{}: holds views, not woven frames", request.text),
                "weave them for this rig first");
  if (info.rig_fingerprint.empty() || info.rig_fingerprint == request.rig_fingerprint) return;
  throw Error(ErrorKind::Input,
              fmt::format("{}: was woven for rig '{}' ({}), not for '{}' ({})", request.text,
                          kept_rig_name(info), info.rig_fingerprint, request.rig_name,
                          request.rig_fingerprint),
              "woven frames fit one panel: render them for this rig, or name the rig they are for");
}

/// Frames are numbered as they were rendered.
frames::SequenceSourceOptions sequence_options(const SourceRequest& request,
                                               const frames::SequenceInfo& info) {
  frames::SequenceSourceOptions options;
  options.pool_frames = std::max(request.slots, 2);
  options.decoder_threads = decoder_threads();
  options.first = request.first_frame;
  if (!request.frames) return options;
  if (request.frames->begin < info.first_frame)
    throw Error(ErrorKind::Input,
                fmt::format("{}: begins with frame {}", request.text, info.first_frame),
                "name a range of frames that exist");
  options.begin = request.frames->begin - info.first_frame;
  options.end = request.frames->end - info.first_frame;
  return options;
}

OpenedSource open_sequence(const SourceRequest& request) {
  // Looked at before its pool is allocated: a stranger's frames may be of any size.
  const frames::SequenceReader reader(request.text);
  require_same_rig(request, reader.info());
  require_panel_size(request, reader.geometry(), request.text);
  auto sequence = std::make_unique<frames::SequenceSource>(
      request.text, sequence_options(request, reader.info()));
  OpenedSource opened;
  opened.damaged_frames = [source = sequence.get()] { return source->damaged_frames(); };
  opened.source = std::move(sequence);
  return opened;
}

OpenedSource open_woven_here(const SourceRequest& request) {
  const bool is_set = request.text.starts_with(kViewsPattern);
  const std::string text = is_set ? request.text.substr(kViewsPattern.size()) : request.text;
  if (request.frames && (is_set || !frames::FilePattern::looks_like_pattern(text)))
    throw Error(ErrorKind::Usage, "--frames: that is one picture",
                "give --frames to a pattern such as 'out_qs8x6a0.75_%05d.png'");
  const QuiltSourceOptions options{.rig_file = request.rig_file,
                                   .pool_frames = std::max(request.slots, 3),
                                   .decoder_threads = decoder_threads(),
                                   .weaving_threads = decoder_threads()};
  OpenedSource opened;
  if (is_set) {
    opened.source =
        std::make_unique<QuiltSource>(frames::read_views(frames::FilePattern(text)), options);
    return opened;
  }
  std::vector<fs::path> files =
      request.frames ? files_in_range(text, *request.frames) : frames::list_frame_files(text);
  const frames::QuiltLayout layout = frames::quilt_layout_of_name(text).value();
  if (files.size() == 1)
    opened.source =
        std::make_unique<QuiltSource>(frames::read_quilt(files.front(), layout), options);
  else
    opened.source = std::make_unique<QuiltSource>(std::move(files), layout, options);
  return opened;
}

/// Woven frames as a video. Asked by its name, before pictures are.
OpenedSource open_woven_video(const SourceRequest& request) {
  OpenedSource opened;
  opened.source = open_video({.file = request.text,
                              .slots = request.slots,
                              .frames = request.frames,
                              .plays_again = request.plays_again});
  require_panel_size(request, opened.source->geometry(), request.text);
  return opened;
}

OpenedSource open_card(const SourceRequest& request) {
  if (request.frames)
    throw Error(ErrorKind::Usage, "--frames: a test card is one picture",
                "give --frames to a pattern such as 'out/%05d.png'");
  OpenedSource opened;
  opened.source = std::make_unique<StillSource>(draw_test_card(request.panel, request.card));
  return opened;
}

OpenedSource open_views(const SourceRequest& request) {
  LENTICULE_CHECK(request.trim != nullptr);
  if (request.frames)
    throw Error(ErrorKind::Usage, "--frames: numbered views are one picture",
                "give --frames to a pattern such as 'out/%05d.png'");
  OpenedSource opened;
  opened.source = std::make_unique<ViewsSource>(request.trim);
  return opened;
}

}  // namespace

bool is_woven_here(const std::string& source) {
  return source.starts_with(kViewsPattern) ||
         (!source.starts_with(kRing) && !looks_like_video(source) &&
          frames::quilt_layout_of_name(source).has_value());
}

OpenedSource open_source(const SourceRequest& request) {
  if (request.text == kCardSource) return open_card(request);
  if (request.text == kViewsSource) return open_views(request);
  if (request.text.starts_with(kRing)) return open_ring(request, request.text.substr(kRing.size()));
  if (frames::is_sequence_name(request.text)) return open_sequence(request);
  if (is_woven_here(request.text)) return open_woven_here(request);
  if (looks_like_video(request.text)) return open_woven_video(request);
  return open_pictures(request);
}

}  // namespace lenticule::player
