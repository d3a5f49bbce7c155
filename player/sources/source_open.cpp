// SPDX-License-Identifier: Apache-2.0
#include "player/sources/source_open.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "base/error.h"
#include "frames/image_sequence.h"
#include "frames/qr/qr_code.h"
#include "frames/ring/ring_player.h"
#include "frames/sequence/sequence_source.h"
#include "optics/rig_file.h"
#include "optics/wall/wall.h"
#include "player/sources/content_open.h"
#include "player/sources/joined_source.h"
#include "player/sources/still_source.h"
#include "player/sources/views_source.h"
#include "player/sources/weaving_source.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

optics::RigIdentity present_rig(const SourceRequest& request) {
  return request.trim ? request.trim->identity() : request.identity;
}

OpenedSource open_ring(const SourceRequest& request) {
  const std::string socket = request.spec.without_prefix();
  if (socket.empty())
    throw Error(ErrorKind::Usage, "source 'ring:': no socket",
                "for example ring:/run/user/1000/panel");
  if (request.frames)
    throw Error(ErrorKind::Usage,
                "--frames: not allowed for a ring, which plays what its renderer sends",
                "use --frames with lenticule render");
  std::unique_ptr<frames::RingPlayer> ring =
      frames::RingPlayer::open({.socket = socket,
                                .geometry = request.panel,
                                .slots = request.slots,
                                .rig_fingerprint = optics::to_text(present_rig(request)),
                                .on_other_trim =
                                    [warnings = request.warnings](const std::string& difference) {
                                      if (warnings) warnings->add(difference);
                                    },
                                .keep_for_loop = request.plays_again});
  OpenedSource opened;
  opened.loop_obstacle = [player = ring.get()] { return player->statistics().loop_obstacle; };
  opened.source = std::move(ring);
  opened.woven_elsewhere = true;
  opened.stall_hint =
      fmt::format("start a renderer: lenticule render SCENE --rig RIG -o ring:{}", socket);
  return opened;
}

void refuse_other_kinds(const SourceSpec& source) {
  const std::string& text = source.text;
  const std::string extension = fs::path(text).extension().string();
  if (source.has_pictures() && extension != ".m3u" && extension != ".json" && !text.empty()) return;
  throw Error(ErrorKind::Usage, fmt::format("source '{}': unknown kind of source", text),
              "use ring:SOCKET, FILE.lts, a pattern such as 'out/%05d.png', one picture, a video, "
              "LIST.toml, a folder, card, black, views or code:TEXT");
}

void require_panel_size(const SourceRequest& request, const frames::FrameGeometry& geometry,
                        const std::string& name) {
  if (geometry == request.panel) return;
  throw Error(ErrorKind::Input,
              fmt::format("{}: {}x{} pixels, but the rig's panel has {}x{}", name, geometry.width,
                          geometry.height, request.panel.width, request.panel.height),
              "woven frames fit one panel, pixel for pixel: render or weave them for this rig");
}

PictureRequest picture_request(const SourceRequest& request) {
  return {.frames = request.frames,
          .first_frame = request.first_frame,
          .pool_frames = std::max(request.slots, 2),
          .decoder_threads = decoding_threads(),
          .plays_again = request.plays_again,
          .before_weaving = false,
          .plays = true,
          .hardware = request.video_hardware};
}

OpenedSource open_woven_pictures(const SourceRequest& request) {
  refuse_other_kinds(request.spec);
  OpenedSource opened;
  PictureRequest how = picture_request(request);
  how.size = request.panel;
  opened.source = open_pictures(request.spec.text, how);
  opened.woven_elsewhere = true;
  return opened;
}

/// Returns the name in the rig that a container stores.
std::string kept_rig_name(const frames::SequenceInfo& info) {
  try {
    return optics::parse_rig(info.rig_toml, "rig").name;
  } catch (const Error&) {
    return {};
  }
}

void require_same_rig(const SourceRequest& request, const frames::SequenceInfo& info) {
  const optics::RigIdentity theirs = frames::rig_of(info), ours = present_rig(request);
  const optics::RigMatch matched = optics::match(theirs, ours);
  if (matched == optics::RigMatch::Same) return;
  if (matched == optics::RigMatch::Trimmed) {
    if (request.warnings)
      request.warnings->add(
          fmt::format("{}: {}", request.spec.text, optics::trim_difference(theirs, ours)));
    return;
  }
  throw Error(
      ErrorKind::Input,
      fmt::format("{}: was woven for rig '{}' ({}), not for '{}' ({})", request.spec.text,
                  kept_rig_name(info), info.rig_fingerprint, request.rig_name, ours.fingerprint),
      "woven frames fit one panel: render them for this rig, or use --reweave, which weaves them "
      "again and costs sharpness");
}

OpenedSource open_sequence(const SourceRequest& request) {
  // The size is checked before the pool is allocated, because an untrusted file may state any size.
  const frames::SequenceReader reader(request.spec.text);
  require_same_rig(request, reader.info());
  require_panel_size(request, reader.geometry(), request.spec.text);
  OpenedSource opened;
  opened.source = open_pictures(request.spec.text, picture_request(request));
  opened.woven_elsewhere = true;
  return opened;
}

FormatQuery meaning_request(const SourceRequest& request) {
  return {.source = request.spec, .rig_fingerprint = present_rig(request).fingerprint};
}

/// Opens a source that is woven here. Quilts are large: only a few are kept ahead, beside the
/// requested number of woven frames.
OpenedSource open_woven_here(const SourceRequest& request, const ContentFormat& detected) {
  constexpr int kPicturesAhead = 4;
  ContentRequest content{.source = request.spec,
                         .how = picture_request(request),
                         .drawing_threads = decoding_threads()};
  content.how.pool_frames = kPicturesAhead;
  content.how.before_weaving = true;
  OpenedSource opened;
  opened.source = std::make_unique<WeavingSource>(
      open_views(content, detected),
      WeavingSourceOptions{.rig_file = request.rig_file,
                           .rig = request.rig,
                           .name = request.spec.text,
                           .pipeline = {.weave = weave_options(request.weaving),
                                        .crosstalk = request.weaving.crosstalk,
                                        .threads = decoding_threads()},
                           .pool_frames = std::max(request.slots, 3),
                           .plays_again = request.plays_again});
  return opened;
}

OpenedSource open_card(const SourceRequest& request) {
  if (request.frames)
    throw Error(ErrorKind::Usage, "--frames: not allowed for a test card",
                "use --frames with a pattern such as 'out/%05d.png'");
  OpenedSource opened;
  opened.source = std::make_unique<StillSource>(draw_test_card(request.panel, request.card));
  return opened;
}

OpenedSource open_black(const SourceRequest& request) {
  if (request.frames)
    throw Error(ErrorKind::Usage, "--frames: not allowed for a black frame",
                "use --frames with a pattern such as 'out/%05d.png'");
  OpenedSource opened;
  opened.source = std::make_unique<StillSource>(frames::WovenFrame(request.panel));
  return opened;
}

OpenedSource open_code(const SourceRequest& request) {
  if (request.frames)
    throw Error(ErrorKind::Usage, "--frames: not allowed for a code",
                "use --frames with a pattern such as 'out/%05d.png'");
  OpenedSource opened;
  opened.source = std::make_unique<StillSource>(
      frames::draw_qr_code(frames::qr_code_of(request.spec.coded), request.panel));
  return opened;
}

OpenedSource open_views_of_rig(const SourceRequest& request) {
  LENTICULE_CHECK(request.trim != nullptr);
  if (request.frames)
    throw Error(ErrorKind::Usage, "--frames: not allowed for numbered views",
                "use --frames with a pattern such as 'out/%05d.png'");
  OpenedSource opened;
  opened.source = std::make_unique<ViewsSource>(request.trim);
  return opened;
}

// --- walls ----------------------------------------------------------------------------------

/// Returns the same source for one panel of the wall.
SourceRequest request_of_panel(const SourceRequest& request, const WallPart& part) {
  SourceRequest own = request;
  own.wall.clear();
  own.panel = part.panel;
  own.identity = part.identity;
  own.rig_name = part.rig.name;
  own.card = part.card;
  if (own.spec.has_pictures()) own.spec.text = optics::file_of_panel(own.spec.text, part.name);
  return own;
}

void refuse_on_wall(const SourceRequest& request) {
  const SourceKind kind = request.spec.kind;
  const bool plays = kind == SourceKind::Sequence || kind == SourceKind::Pictures ||
                     kind == SourceKind::Card || kind == SourceKind::Black ||
                     kind == SourceKind::Code;
  if (!plays)
    throw Error(ErrorKind::Usage,
                fmt::format("source '{}': cannot be played on a wall", request.spec.text),
                "a wall plays films that were rendered for it: lenticule render --wall");
}

/// Views are woven for a rig of a file, and a wall gives its panels other viewing lines.
void require_woven(const SourceRequest& own) {
  if (!own.spec.has_pictures()) return;
  if (detect_content_format(meaning_request(own)).kind == ContentFormat::Kind::Woven) return;
  throw Error(
      ErrorKind::Usage,
      fmt::format("{}: has views, and the panels of a wall play woven frames", own.spec.text),
      "weave them for each panel: lenticule rig wall --rigs, lenticule weave");
}

OpenedSource open_on_wall(const SourceRequest& request) {
  refuse_on_wall(request);
  std::vector<JoinedSource::Part> parts;
  for (const WallPart& panel : request.wall) {
    const SourceRequest own = request_of_panel(request, panel);
    require_woven(own);
    parts.push_back({.name = own.spec.text, .source = open_source(own).source});
  }
  OpenedSource opened;
  opened.source = std::make_unique<JoinedSource>(std::move(parts), request.panel);
  return opened;
}

}  // namespace

OpenedSource open_source(const SourceRequest& request) {
  if (!request.wall.empty()) return open_on_wall(request);
  if (request.spec.kind == SourceKind::Card) return open_card(request);
  if (request.spec.kind == SourceKind::Black) return open_black(request);
  if (request.spec.kind == SourceKind::RigViews) return open_views_of_rig(request);
  if (request.spec.kind == SourceKind::Code) return open_code(request);
  if (request.spec.kind == SourceKind::Ring) return open_ring(request);
  const ContentFormat detected = detect_content_format(meaning_request(request));
  if (detected.kind != ContentFormat::Kind::Woven) return open_woven_here(request, detected);
  if (request.spec.kind == SourceKind::Sequence) return open_sequence(request);
  return open_woven_pictures(request);
}

}  // namespace lenticule::player
