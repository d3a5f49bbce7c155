// SPDX-License-Identifier: Apache-2.0
#include "player/sources/content.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <string_view>
#include <utility>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "base/text.h"
#include "frames/image_io.h"
#include "frames/sequence/sequence_reader.h"
#include "player/sources/video_probe.h"

namespace lenticule::player {
namespace {

using Kind = Content::Kind;

constexpr double kSameAspect = 0.005;

/// Parses "8x6", columns by rows, into the layout. Throws Error(Usage).
void read_grid(const std::string& text, frames::QuiltLayout& layout) {
  const auto grid = numbers_from<int, 2>(text, 'x');
  if (!grid || (*grid)[0] < 1 || (*grid)[1] < 1)
    throw usage_error("--grid '{}': not columns x rows", text)
        .remedy("for example --grid 8x6, or 1x1 for an ordinary picture");
  layout.columns = (*grid)[0];
  layout.rows = (*grid)[1];
}

/// Parses a number, followed by nothing, "%" or "px". Returns nothing for other text.
std::optional<frames::Disparity> disparity_of(std::string_view text) {
  const auto number = take_number<double>(text);
  const bool in_pixels = text == "px";
  if (!number || (!in_pixels && !text.empty() && text != "%")) return std::nullopt;
  return frames::Disparity{.value = in_pixels ? *number : *number / 100.0, .in_pixels = in_pixels};
}

frames::Disparity parse_zero_plane(const std::string& text) {
  if (const auto disparity = disparity_of(text)) return *disparity;
  throw usage_error("--zero-plane '{}': not a disparity", text)
      .remedy("for example --zero-plane 1.5, in percent of the width, or 20px");
}

/// Parses "0.5:20", distances in any unit. Returns the ratio of the farthest to the nearest.
double parse_distances(const std::string& text) {
  constexpr double kMostRatio = 1e6;  // a larger one exceeds the precision of a disparity
  const auto distances = numbers_from<double, 2>(text, ':').value_or(std::array{0.0, 0.0});
  const double ratio = distances[1] / distances[0];
  if (distances[0] > 0.0 && ratio > 1.0 && ratio <= kMostRatio) return ratio;
  throw usage_error("--depth-distance '{}': not two distances", text)
      .remedy("the nearest and the farthest, for example --depth-distance 0.5:20; at most 1:1e6");
}

/// Parses "-2:2" in percent of a view's width, or "-20px:20px": the disparities of the farthest and
/// the nearest depth. Throws Error(Usage).
void read_depth_range(const std::string& text, frames::DepthOptions& options) {
  std::string_view rest(text);
  const auto back = disparity_of(take_until(rest, ':')), front = disparity_of(rest);
  if (!back || !front || back->in_pixels != front->in_pixels)
    throw usage_error("--depth-range '{}': not two disparities", text)
        .remedy("for example --depth-range -2:2, in percent of the width, or -20px:20px");
  options.back = back->value;
  options.front = front->value;
  options.in_pixels = back->in_pixels;
}

/// Returns the file, or the first one of a pattern, if there is one.
std::optional<std::filesystem::path> first_file(const std::string& text) {
  if (!frames::FilePattern::looks_like_pattern(text)) return text;
  const frames::FilePattern pattern(text);
  const std::vector<uint64_t> numbers = pattern.existing();
  if (numbers.empty()) return std::nullopt;
  return pattern.path(numbers.front());
}

bool says_stereo(const ContentFlags& flags) {
  return !flags.stereo.empty() && flags.stereo != "none";
}

void refuse_other_flags(const ContentFlags& flags) {
  const int kinds = (flags.grid.empty() ? 0 : 1) + (flags.stereo.empty() ? 0 : 1) +
                    (flags.depth.empty() ? 0 : 1) + (flags.from_rig.empty() ? 0 : 1);
  if (kinds > 1)
    throw Error(ErrorKind::Usage, "--grid, --stereo, --depth and --from-rig exclude each other",
                "use one of them");
}

void require_agreement(const std::string& text, const frames::QuiltSidecar& sidecar,
                       const frames::QuiltLayout& named, const ContentFlags& flags) {
  const std::string file = frames::sidecar_of(text).filename().string();
  if (flags.grid.empty() && (sidecar.columns != named.columns || sidecar.rows != named.rows))
    throw input_error("{}: its name says {} x {} tiles, {} {} x {}", text, named.columns,
                      named.rows, file, *sidecar.columns, *sidecar.rows)
        .remedy("rename one of them, or use --grid");
  const bool aspects_differ = sidecar.aspect && named.aspect &&
                              std::abs(*sidecar.aspect / *named.aspect - 1.0) > kSameAspect;
  if (!flags.aspect && aspects_differ)
    throw input_error("{}: its name says an aspect of {}, {} {}", text, *named.aspect, file,
                      *sidecar.aspect)
        .remedy("rename one of them, or use --aspect");
}

/// Combines the name, the sidecar and the flags; later ones override earlier ones.
Content quilt(const SourceSpec& source, const std::optional<frames::QuiltSidecar>& sidecar) {
  const ContentFlags& flags = source.content;
  const auto named = frames::quilt_layout_of_name(source.text);
  Content content{.kind = Kind::Quilt};
  frames::QuiltLayout& layout = content.layout;
  if (named) layout = *named;
  if (sidecar && sidecar->zoom != 1.0) layout.zoom = sidecar->zoom;
  if (sidecar && sidecar->columns) {
    if (named) require_agreement(source.text, *sidecar, *named, flags);
    layout.columns = *sidecar->columns;
    layout.rows = *sidecar->rows;
    layout.views = sidecar->views.value_or(0);
    if (sidecar->aspect) layout.aspect = sidecar->aspect;
    content.rightmost_first = sidecar->inverted;
  }
  if (!flags.grid.empty()) {
    read_grid(flags.grid, layout);
    layout.views = 0;
  }
  if (flags.views != 0) layout.views = flags.views;
  if (flags.aspect) layout.aspect = flags.aspect;
  frames::check_quilt_layout(layout, source.text);
  content.crop.zoom = layout.zoom;
  return content;
}

Content with_depth(const ContentFlags& flags, const std::optional<frames::QuiltSidecar>& sidecar) {
  Content content{.kind = Kind::DepthInside};
  frames::DepthOptions& options = content.depth_options;
  if (sidecar && sidecar->depth) {
    content.depth.place = *sidecar->depth;
    content.aspect = sidecar->aspect;
    options.black_is_near = sidecar->black_is_near;
    options.back *= sidecar->depthiness;
    options.front *= sidecar->depthiness;
  }
  if (const auto layout = frames::parse_depth_layout(flags.depth))
    content.depth = *layout;
  else if (!flags.depth.empty())
    content.kind = Kind::OwnDepth;
  if (!flags.depth_range.empty()) read_depth_range(flags.depth_range, options);
  if (!flags.depth_distance.empty()) options.distance_ratio = parse_distances(flags.depth_distance);
  options.black_is_near = options.black_is_near != flags.invert_depth;
  if (flags.views != 0) options.views = flags.views;
  return content;
}

Content stereo(const frames::StereoLayout& layout, const ContentFlags& flags) {
  if (flags.views != 0 && flags.views != 2)
    throw usage_error("--views {}: stereo has two views", flags.views);
  return {.kind = Kind::Stereo, .stereo = layout};
}

/// Returns true for the names of formats that may have two eyes' pictures in one file.
bool may_have_two_eyes(const std::string& file) {
  constexpr std::string_view kNames[] = {".mpo", ".exr", ".heic", ".heif", ".hif", ".avif"};
  const std::string extension = lower_case(std::filesystem::path(file).extension().string());
  return std::ranges::find(kNames, extension) != std::end(kNames);
}

/// Returns the layout that the file itself states: in pictures for two eyes and in videos. `first`
/// is the source's first file, if there is one.
std::optional<frames::StereoLayout> tagged_stereo(
    const SourceSpec& source, const std::optional<std::filesystem::path>& first) {
  const std::string& text = source.text;
  if (first && frames::is_jps_name(text)) return frames::read_jps_tag(*first);
  if (first && may_have_two_eyes(text) &&
      frames::probe_picture(*first, frames::PictureUse::Views).two_eyes)
    return frames::StereoLayout{.beside = true};
  if (source.kind != SourceKind::Video) return std::nullopt;
  const std::optional<VideoStereo> tag = probe_video(text).front().stereo;
  if (!tag) return std::nullopt;
  const bool beside = tag->layout == "side by side";
  if (!beside && tag->layout != "top and bottom")
    throw Error(
        ErrorKind::Input,
        fmt::format(
            "{}: its stereo tag says '{}'; only side by side and top and bottom are supported",
            text, tag->layout),
        "use --stereo none to play it unchanged");
  return frames::StereoLayout{.beside = beside, .half = tag->half, .right_first = tag->right_first};
}

/// Returns the layout that tag and name state. A tag comes first, but may leave open whether the
/// eyes are squeezed.
std::optional<frames::StereoLayout> stated_stereo(
    const SourceSpec& source, const std::optional<std::filesystem::path>& first) {
  const auto named = frames::stereo_of_name(source.text);
  auto tagged = tagged_stereo(source, first);
  if (!tagged) return named;
  tagged->half = tagged->half || (named && named->half && named->beside == tagged->beside);
  return tagged;
}

/// Returns the streams of a video that has one for each eye, as 3-D cameras write it in AVI.
std::vector<int> streams_of_eyes(const SourceSpec& source) {
  if (source.kind != SourceKind::Video) return {};
  const std::vector<VideoStream> streams = probe_video(source.text);
  const bool eyes = streams.size() == 2 && streams[0].geometry == streams[1].geometry &&
                    streams[0].rate == streams[1].rate && streams[1].refusal.empty();
  return eyes ? std::vector<int>{streams[0].index, streams[1].index} : std::vector<int>();
}

Content other_rig(const ContentFlags& flags) {
  if (!flags.grid.empty() || flags.aspect || flags.invert)
    throw Error(ErrorKind::Usage, "--from-rig: the input is a woven frame, not a quilt",
                "leave out --grid, --aspect and --invert");
  return {.kind = Kind::OtherRig};
}

Content container(const SourceSpec& source, const std::string& rig_fingerprint) {
  const ContentFlags& flags = source.content;
  if (!flags.grid.empty() || !flags.stereo.empty() || !flags.depth.empty())
    throw usage_error("{}: --grid, --stereo and --depth do not apply to a .lts", source.text)
        .remedy("leave them out: the file states how its views lie");
  const frames::SequenceReader reader(source.text);
  const frames::SequenceInfo& info = reader.info();
  if (info.kind == frames::SequenceKind::Views) {
    LENTICULE_CHECK(info.views.has_value());
    Content content{.kind = Kind::Quilt};
    content.layout = {.columns = info.views->columns,
                      .rows = info.views->rows,
                      .views = info.views->count,
                      .aspect = flags.aspect};
    if (info.views->aspect > 0.0 && !content.layout.aspect)
      content.layout.aspect = info.views->aspect;
    content.rightmost_first = info.views->rightmost_first;
    return content;
  }
  const bool other = !info.rig_fingerprint.empty() && info.rig_fingerprint != rig_fingerprint;
  if (!flags.reweave || !other) return {};
  Content content = other_rig(flags);
  content.rig_toml = info.rig_toml;
  return content;
}

/// Returns the format of a source without prefix, container or --from-rig.
Content picture(const SourceSpec& source, bool patterns_are_views) {
  const std::string& text = source.text;
  const ContentFlags& flags = source.content;
  const bool may_be_stereo = flags.stereo.empty();
  if (!flags.depth.empty() && !frames::parse_depth_layout(flags.depth))
    return with_depth(flags, std::nullopt);
  if (says_stereo(flags)) return stereo(frames::parse_stereo(flags.stereo), flags);
  const auto first = first_file(text);
  auto sidecar = first ? frames::read_sidecar_of(*first) : std::nullopt;
  if (!flags.depth.empty() || (flags.grid.empty() && sidecar && sidecar->depth))
    return with_depth(flags, sidecar);
  const bool says_grid = !flags.grid.empty() || (sidecar && sidecar->columns);
  if (says_grid || frames::quilt_layout_of_name(text)) return quilt(source, sidecar);
  if (may_be_stereo)
    if (const auto stated = stated_stereo(source, first)) return stereo(*stated, flags);
  if (frames::is_rgbd_name(text)) return with_depth(flags, std::nullopt);
  if (may_be_stereo) {
    if (std::vector<int> eyes = streams_of_eyes(source); !eyes.empty()) {
      Content content = stereo({}, flags);
      content.eyes = std::move(eyes);
      return content;
    }
    if (first && (sidecar = frames::read_quilt_comment(*first))) return quilt(source, sidecar);
  }
  if (patterns_are_views && frames::FilePattern::looks_like_pattern(text))
    return {.kind = Kind::ViewFiles};
  if (frames::mentions_quilt(text) && may_be_stereo)
    throw input_error("{}: its name says qs, but not the grid of a quilt", text)
        .remedy("name it like city_qs8x6a0.75.png, or use --grid 8x6; woven frames: --stereo none");
  return {.kind = Kind::Woven};
}

/// Returns the format of pictures that come in live, which flags state alone.
Content live(const SourceSpec& source, int cameras) {
  const ContentFlags& flags = source.content;
  if (!flags.depth.empty() && !frames::parse_depth_layout(flags.depth))
    throw usage_error("--depth {}: live pictures have no file", flags.depth)
        .remedy("name the side of the picture that holds the depth: --depth right");
  const bool states = !flags.grid.empty() || !flags.depth.empty() || !flags.stereo.empty();
  if (cameras > 1 && states)
    throw usage_error("{}: --grid, --stereo and --depth do not apply to several cameras",
                      source.text)
        .remedy("each camera is a view, from left to right; --invert exchanges their order");
  if (cameras > 1) {
    Content content{.kind = Kind::Quilt};
    content.layout = {.columns = cameras, .rows = 1, .views = cameras, .aspect = flags.aspect};
    return content;
  }
  if (!flags.depth.empty()) return with_depth(flags, std::nullopt);
  if (!flags.grid.empty()) return quilt(source, std::nullopt);
  return says_stereo(flags) ? stereo(frames::parse_stereo(flags.stereo), flags) : Content{};
}

Content content_of(const SourceSpec& source, const std::string& rig_fingerprint,
                   bool patterns_are_views) {
  if (source.kind == SourceKind::ViewFiles) {
    if (source.without_prefix().empty())
      throw usage_error("source '{}': no files", source.text)
          .remedy("for example 'views:view%02d.png' or 'views:left.png|right.png'");
    return {.kind = Kind::ViewFiles};
  }
  if (!source.takes_layout()) return {};
  if (!source.content.from_rig.empty()) return other_rig(source.content);
  if (source.kind == SourceKind::Ring) return live(source, 1);
  if (source.kind == SourceKind::Live)
    return live(source, static_cast<int>(parse_capture(source.text).devices.size()));
  if (source.kind == SourceKind::Sequence) return container(source, rig_fingerprint);
  return picture(source, patterns_are_views);
}

/// Refuses flags that would have no effect, since the user expects one.
void refuse_idle_flags(const SourceSpec& source, Kind kind) {
  const ContentFlags& flags = source.content;
  const bool has_depth = kind == Kind::OwnDepth || kind == Kind::DepthInside;
  const bool about_depth = !flags.depth_range.empty() || !flags.depth_distance.empty() ||
                           flags.invert_depth || flags.depth_budget;
  if (!has_depth && about_depth)
    throw usage_error("--depth-range, --depth-budget: {} has no depth", source.text)
        .remedy("name the depth with --depth; pictures for two eyes only move, with --zero-plane");
  const bool about_views =
      flags.views != 0 || flags.aspect || flags.invert || !flags.zero_plane.empty();
  if (kind == Kind::Woven && about_views && source.takes_layout())
    throw Error(
        ErrorKind::Usage,
        fmt::format("{}: --views, --aspect, --invert and --zero-plane do not apply to woven frames",
                    source.text),
        "if it contains views, describe them with --grid, --stereo, --depth or 'views:'");
}

}  // namespace

const char* remedy_of_unwoven(const frames::FrameGeometry& size) {
  constexpr double kWidestOfOneEye = 2.5;  // cinema has 2.4, two eyes of 4:3 have 2.67
  if (size.width > kWidestOfOneEye * size.height)
    return "it is as wide as two eyes side by side: use --stereo sbs, or _sbs in its name; a very "
           "wide ordinary one: --grid 1x1";
  return "an ordinary picture or film: use --grid 1x1, or _qs1x1 in its name; two eyes side by "
         "side: --stereo sbs; woven frames: make them for this panel, as RGB or 4:4:4";
}

void require_size_of_panel(const std::string& name, const frames::FrameGeometry& size,
                           const frames::FrameGeometry& panel, const char* remedy) {
  if (size != panel)
    throw input_error("{}: {}x{} pixels, but the rig's panel has {}x{}", name, size.width,
                      size.height, panel.width, panel.height)
        .remedy(remedy != nullptr ? remedy : remedy_of_unwoven(size));
}

void check_layout(const ContentFlags& flags) {
  refuse_other_flags(flags);
  frames::QuiltLayout layout;
  frames::DepthOptions depth;
  if (!flags.grid.empty()) read_grid(flags.grid, layout);
  if (says_stereo(flags)) (void)frames::parse_stereo(flags.stereo);
  const std::string name = std::filesystem::path(flags.depth).filename().string();
  if (!name.empty() && !frames::parse_depth_layout(flags.depth) &&
      name.find_first_of(".%") == std::string::npos)
    throw usage_error("--depth '{}': neither a side nor a file", name)
        .remedy("right, left, bottom or top, or the name of a file with its extension");
  if (!flags.depth_range.empty()) read_depth_range(flags.depth_range, depth);
  if (!flags.depth_distance.empty()) (void)parse_distances(flags.depth_distance);
  if (!flags.zero_plane.empty()) (void)parse_zero_plane(flags.zero_plane);
}

Content identify(const SourceSpec& source, const std::string& rig_fingerprint,
                 bool patterns_are_views) {
  const ContentFlags& flags = source.content;
  check_layout(flags);
  Content content = content_of(source, rig_fingerprint, patterns_are_views);
  if (content.kind == Kind::ViewFiles && !flags.grid.empty())
    throw Error(ErrorKind::Usage, "--grid: the input is a pattern of views, not a quilt");
  refuse_idle_flags(source, content.kind);
  if (flags.aspect) content.aspect = flags.aspect;
  if (!flags.zero_plane.empty()) content.crop.zero_plane = parse_zero_plane(flags.zero_plane);
  if (flags.invert) content.rightmost_first = !content.rightmost_first;
  content.source = source;
  return content;
}

}  // namespace lenticule::player
