// SPDX-License-Identifier: Apache-2.0
#include "player/sources/open_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "base/print.h"
#include "frames/qr/qr_code.h"
#include "frames/ring/ring_player.h"
#include "frames/sequence/sequence_reader.h"
#include "optics/rig_file.h"
#include "optics/wall/wall.h"
#include "player/sources/joined_source.h"
#include "player/sources/pictures.h"
#include "player/sources/still_source.h"

namespace lenticule::player {
namespace {

/// Bounds the memory when many renderers connect with different trims.
constexpr size_t kMostWarnings = 100;
/// Pictures with views that are kept before they are woven: the slots of a renderer's ring.
constexpr int kPicturesAhead = 4;

optics::RigIdentity present_rig(const OpenContext& context) {
  return context.rig ? context.rig->identity() : context.identity;
}

void warn(const OpenContext& context, const std::string& warning) {
  if (context.warnings) context.warnings->add(warning);
}

// --- frames that are generated here ---------------------------------------------------------

frames::WovenFrame draw_still(const SourceSpec& source, const OpenContext& context) {
  if (source.kind == SourceKind::Card) return draw_test_card(context.panel, context.card);
  if (source.kind == SourceKind::Black) return frames::WovenFrame(context.panel);
  return frames::draw_qr_code(frames::qr_code_of(source.coded), context.panel);
}

OpenedSource open_still(const SourceSpec& source, const OpenContext& context, const char* what) {
  if (context.frames)
    throw usage_error("--frames: not allowed for {}", what)
        .remedy("use --frames with a pattern such as 'out/%05d.png'");
  if (source.kind != SourceKind::RigViews)
    return {.source = std::make_unique<StillSource>(draw_still(source, context))};
  LENTICULE_CHECK(context.rig != nullptr);
  return {.source = std::make_unique<StillSource>(context.rig)};
}

// --- frames that were woven elsewhere -------------------------------------------------------

void refuse_other_kinds(const SourceSpec& source) {
  const std::string& text = source.text;
  if (source.has_pictures() && !text.empty()) return;
  throw usage_error("source '{}': unknown kind of source", text)
      .remedy(
          "use ring:SOCKET, v4l2:DEVICE, FILE.lts, a pattern such as 'out/%05d.png', one "
          "picture, a video, "
          "LIST.toml, .m3u or .json, a folder, card, black, views or code:TEXT");
}

/// Returns the name in the rig that a container stores.
std::string kept_rig_name(const frames::SequenceInfo& info) {
  try {
    return optics::parse_rig(info.rig_toml, "rig").name;
  } catch (const Error&) {
    return {};
  }
}

/// Checks a container before its pool is allocated, because an untrusted file may state any size.
void require_frames_of_this_panel(const std::string& file, const OpenContext& context) {
  const frames::SequenceReader reader(file);
  const optics::RigIdentity theirs = frames::rig_of(reader.info()), ours = present_rig(context);
  const optics::RigMatch matched = optics::match(theirs, ours);
  if (matched == optics::RigMatch::Trimmed)
    warn(context, fmt::format("{}: {}", file, optics::trim_difference(theirs, ours)));
  else if (matched != optics::RigMatch::Same)
    throw Error(
        ErrorKind::Input,
        fmt::format("{}: was woven for rig '{}' ({}), not for '{}' ({})", file,
                    kept_rig_name(reader.info()), reader.info().rig_fingerprint, context.rig_name,
                    ours.fingerprint),
        "woven frames fit one panel: render them for this rig, or use --reweave, which weaves them "
        "again and costs sharpness");
  require_size_of_panel(
      file, reader.geometry(), context.panel,
      "woven frames fit one panel, pixel for pixel: render or weave them for this rig");
}

PictureOptions picture_options(const OpenContext& context) {
  return {.frames = context.frames,
          .first_frame = context.first_frame,
          .pool_frames = std::max(context.slots, 2),
          .decoder_threads = decoding_threads(),
          .drawing_threads = decoding_threads(),
          .plays_again = context.plays_again,
          .before_weaving = false,
          .plays = true,
          .hardware = context.video_hardware};
}

OpenedSource open_woven(const SourceSpec& source, const OpenContext& context) {
  PictureOptions options = picture_options(context);
  if (source.kind == SourceKind::Sequence) {
    require_frames_of_this_panel(source.text, context);
  } else {
    refuse_other_kinds(source);
    options.size = context.panel;
  }
  return {.source = open_pictures(source.text, options), .woven_elsewhere = true};
}

// --- views ----------------------------------------------------------------------------------

/// Opens views, which are woven here. Quilts are large: only a few are kept ahead, beside the
/// requested number of woven frames.
OpenedSource open_and_weave(const Content& content, const OpenContext& context,
                            OpenedCapture live = {}, bool from_renderer = false) {
  LENTICULE_CHECK(context.rig != nullptr);
  PictureOptions options = picture_options(context);
  options.pool_frames = kPicturesAhead;
  options.before_weaving = true;
  const optics::Rig rig = context.rig->rig();
  options.rig = &rig;
  if (live.pictures) options.pictures = [&live] { return std::move(live.pictures); };
  auto views = open_views(content, options);
  return {.source = std::make_unique<WeavingSource>(
              std::move(views), WeavingSourceOptions{.name = content.source.text,
                                                     .rig = context.rig,
                                                     .weaving = context.weaving,
                                                     .threads = decoding_threads(),
                                                     .pool_frames = std::max(context.slots, 3),
                                                     .plays_again = context.plays_again,
                                                     .live = live.statistics,
                                                     .from_renderer = from_renderer}),
          .live = live.statistics};
}

// --- frames and views of a renderer -----------------------------------------------------------

/// Returns the size of a renderer's pictures: that of the panel, unless "?size=" states another
/// one.
frames::FrameGeometry size_of_ring(const SourceSpec& source, const OpenContext& context) {
  constexpr std::string_view kSize = "?size=";
  const size_t option = source.text.find('?');
  if (option == std::string::npos) return context.panel;
  const std::string_view text = std::string_view(source.text).substr(option);
  const auto size =
      text.starts_with(kSize) ? numbers_from<int, 2>(text.substr(kSize.size()), 'x') : std::nullopt;
  if (!size || frames::geometry_problem({.width = (*size)[0], .height = (*size)[1]},
                                        frames::kMinSlots) != nullptr)
    throw usage_error("source '{}': not a size of views", source.text)
        .remedy("for example 'ring:/run/user/1000/panel?size=3360x3360' --grid 8x6");
  return {.width = (*size)[0], .height = (*size)[1]};
}

frames::RingContent ring_content(const Content& content, const frames::FrameGeometry& size) {
  using frames::RingContent;
  const std::string& name = content.source.text;
  const auto rect = [](const frames::DepthWindows::Window& window) {
    return frames::RingRect{.left = static_cast<uint16_t>(window.left),
                            .top = static_cast<uint16_t>(window.top),
                            .width = static_cast<uint16_t>(window.size.width),
                            .height = static_cast<uint16_t>(window.size.height)};
  };
  if (content.kind == Content::Kind::DepthInside) {
    const auto windows = frames::depth_windows(size, content.depth, name);
    return {.kind = RingContent::Colours,
            .aspect = content.aspect.value_or(0.0),
            .colours = rect(windows.colour),
            .depth = rect(windows.depth)};
  }
  frames::StereoTiles tiles{.layout = content.layout};
  if (content.kind == Content::Kind::Stereo) tiles = frames::tiles_of(content.stereo, size);
  (void)frames::tile_size(size, tiles.layout, name);
  return {.kind = RingContent::Quilt,
          .columns = static_cast<uint16_t>(tiles.layout.columns),
          .rows = static_cast<uint16_t>(tiles.layout.rows),
          .views = static_cast<uint16_t>(tiles.layout.view_count()),
          .rightmost_first =
              static_cast<uint16_t>(tiles.rightmost_first != content.rightmost_first ? 1 : 0),
          .aspect = content.aspect ? *content.aspect : tiles.layout.aspect.value_or(0.0)};
}

OpenedSource open_ring(const SourceSpec& source, const OpenContext& context) {
  const std::string socket = source.without_prefix();
  if (socket.empty())
    throw Error(ErrorKind::Usage, "source 'ring:': no socket",
                "for example ring:/run/user/1000/panel");
  if (context.frames)
    throw Error(ErrorKind::Usage,
                "--frames: not allowed for a ring, which plays what its renderer sends",
                "use --frames with lenticule render");
  frames::RingOptions options{.socket = socket,
                              .geometry = context.panel,
                              .slots = context.slots,
                              .rig_fingerprint = optics::to_text(present_rig(context)),
                              .on_other_trim =
                                  [warnings = context.warnings](const std::string& difference) {
                                    if (warnings) warnings->add(difference);
                                  },
                              .keep_for_loop = context.plays_again};
  const Content content = identify(source, {});
  if (content.kind == Content::Kind::Woven) {
    if (size_of_ring(source, context) != context.panel)
      throw usage_error("{}: woven frames have the size of the panel", source.text)
          .remedy("leave ?size= out, or state the layout of views: --grid 8x6");
    auto ring = frames::RingPlayer::open(options);
    auto* const player = ring.get();
    return {.source = std::move(ring),
            .loop_obstacle = [player] { return player->loop_obstacle(); },
            .stall_hint = "start a renderer: lenticule render SCENE --rig RIG -o ring:" + socket,
            .woven_elsewhere = true};
  }
  options.geometry = size_of_ring(source, context);
  options.slots = kPicturesAhead;
  options.rig_fingerprint.clear();
  options.content = ring_content(content, options.geometry);
  options.keep_for_loop = false;
  OpenedSource opened =
      open_and_weave(content, context, {.pictures = frames::RingPlayer::open(options)}, true);
  opened.stall_hint = "start a renderer of views: docs/content/ring.md";
  return opened;
}

// --- pictures that come in live -------------------------------------------------------------

OpenedSource open_live(const SourceSpec& source, const OpenContext& context) {
  if (context.frames)
    throw Error(ErrorKind::Usage, "--frames: live pictures have no numbers to choose",
                "use --duration");
  const Content content = identify(source, present_rig(context).fingerprint);
  OpenedCapture live = open_capture(source.text, context.panel);
  if (content.kind != Content::Kind::Woven)
    return open_and_weave(content, context, std::move(live));
  require_size_of_panel(source.text, live.pictures->geometry(), context.panel);
  return {.source = std::move(live.pictures),
          .live = std::move(live.statistics),
          .woven_elsewhere = true};
}

// --- walls ----------------------------------------------------------------------------------

void refuse_on_wall(const SourceSpec& source) {
  using enum SourceKind;
  constexpr SourceKind kPlayed[] = {Sequence, Pictures, Card, Black, Code};
  if (std::ranges::find(kPlayed, source.kind) == std::end(kPlayed))
    throw usage_error("source '{}': cannot be played on a wall", source.text)
        .remedy("a wall plays films that were rendered for it: lenticule render --wall");
}

/// Views are woven for a rig of a file, and a wall gives its panels other viewing lines.
void require_woven(const SourceSpec& source, const OpenContext& context) {
  if (identify(source, context.identity.fingerprint).kind == Content::Kind::Woven) return;
  throw usage_error("{}: has views, and the panels of a wall play woven frames", source.text)
      .remedy("weave them for each panel: lenticule rig wall --rigs, lenticule weave");
}

OpenedSource open_on_wall(const SourceSpec& source, const OpenContext& context) {
  refuse_on_wall(source);
  std::vector<JoinedSource::Part> parts;
  for (const WallPart& part : context.wall) {
    SourceSpec own = source;
    if (own.has_pictures()) own.text = optics::file_of_panel(own.text, part.name);
    OpenContext panel = context;
    panel.wall.clear();
    panel.panel = part.panel;
    panel.identity = part.identity;
    panel.rig_name = part.rig.name;
    panel.card = part.card;
    require_woven(own, panel);
    parts.push_back({.name = own.text, .source = open_source(own, panel).source});
  }
  return {.source = std::make_unique<JoinedSource>(std::move(parts), context.panel)};
}

}  // namespace

OpenedSource open_source(const SourceSpec& source, const OpenContext& context) {
  if (!context.wall.empty()) return open_on_wall(source, context);
  constexpr std::pair<SourceKind, const char*> kDrawn[] = {
      {SourceKind::Card, "a test card"},
      {SourceKind::Black, "a black frame"},
      {SourceKind::Code, "a code"},
      {SourceKind::RigViews, "numbered views"}};
  for (const auto& [kind, what] : kDrawn)
    if (source.kind == kind) return open_still(source, context, what);
  if (source.kind == SourceKind::Ring) return open_ring(source, context);
  if (source.kind == SourceKind::Live) return open_live(source, context);
  const std::string rig = present_rig(context).fingerprint;
  // The panels of a wall play nothing but woven frames.
  const Content content =
      context.rig ? identify_by_pixels(source, rig, context.panel) : identify(source, rig);
  return content.kind == Content::Kind::Woven ? open_woven(source, context)
                                              : open_and_weave(content, context);
}

void RigWarnings::add(const std::string& warning) {
  {
    const std::lock_guard lock(mutex_);
    const bool known = std::find(warnings_.begin(), warnings_.end(), warning) != warnings_.end();
    if (known || warnings_.size() >= kMostWarnings) return;
    warnings_.push_back(warning);
  }
  say("lenticule: {}\n  render or weave it again to apply the trim\n", warning);
}

std::vector<std::string> RigWarnings::all() const {
  const std::lock_guard lock(mutex_);
  return warnings_;
}

}  // namespace lenticule::player
