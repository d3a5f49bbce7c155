// SPDX-License-Identifier: Apache-2.0
#include "player/sources/content_open.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include "base/error.h"
#include "frames/image_sequence.h"
#include "frames/sequence/sequence_reader.h"
#include "frames/weaving/reweave.h"
#include "optics/rig_file.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using frames::FrameSource;
using frames::ViewInput;
using Kind = ContentFormat::Kind;
using Sources = std::vector<std::unique_ptr<FrameSource>>;

/// Limits of views per source: each film has a thread and pictures, each video a process.
constexpr size_t kMostFilms = 128;
constexpr size_t kMostVideos = 16;
/// Limit for playback: 2 GiB, the size of 86 views of 3840x2160.
constexpr uint64_t kMostPlayedViewBytes = uint64_t{2} << 30;
constexpr auto kTimeout = std::chrono::minutes(1);
constexpr std::chrono::milliseconds kLook{100};

/// Expands "view%02d/%05d.png": returns the second pattern in each folder of the first.
std::vector<std::string> in_numbered_folders(const fs::path& text) {
  std::vector<std::string> films;
  for (const fs::path& folder : frames::list_frame_files(text.parent_path().string()))
    films.push_back((folder / text.filename()).string());
  return films;
}

/// Returns one name for each view.
std::vector<std::string> names_of_views(const SourceSpec& source) {
  std::vector<std::string> names = source.files();
  if (names.size() > 1) return names;
  const std::string text = source.without_prefix();
  if (frames::FilePattern::looks_like_pattern(fs::path(text).parent_path().string()))
    return in_numbered_folders(text);
  if (!frames::FilePattern::looks_like_pattern(text)) return names;
  names.clear();
  for (const fs::path& file : frames::list_frame_files(text)) names.push_back(file.string());
  return names;
}

bool is_video(const std::string& name) {
  return kind_of_file(name) == SourceKind::Video;
}

void require_count(const ContentRequest& request, size_t views) {
  const int wanted = request.source.content.views;
  if (wanted != 0 && static_cast<size_t>(wanted) != views)
    throw Error(ErrorKind::Input, fmt::format("{}: has {} views, but --views is {}",
                                              request.source.text, views, wanted));
}

uint64_t most_view_bytes(const ContentRequest& request) {
  return request.how.plays ? kMostPlayedViewBytes : frames::kMostViewBytes;
}

/// Returns the stated aspect, or that of the picture's pixels if they are not square.
std::optional<double> aspect_of(const std::optional<double>& stated, const FrameSource& source) {
  return stated ? stated : frames::stated_aspect(source.geometry(), source.pixel_aspect());
}

std::unique_ptr<ViewInput> open_still_views(const ContentRequest& request,
                                            const ContentFormat& detected,
                                            const std::vector<std::string>& names) {
  if (request.how.frames)
    throw Error(ErrorKind::Usage, "--frames: not allowed for a single picture",
                "use --frames with films, such as 'views:view%02d/%05d.png'");
  std::vector<fs::path> files(names.begin(), names.end());
  if (detected.rightmost_first) std::reverse(files.begin(), files.end());
  return std::make_unique<ViewInput>(frames::read_views(files, request.source.without_prefix(),
                                                        detected.aspect, most_view_bytes(request)));
}

std::unique_ptr<ViewInput> open_films(const ContentRequest& request, const ContentFormat& detected,
                                      const std::vector<std::string>& names) {
  const bool videos = std::any_of(names.begin(), names.end(), is_video);
  const size_t most = videos ? kMostVideos : kMostFilms;
  if (names.size() > most)
    throw Error(ErrorKind::Input,
                fmt::format("{}: {} films; at most {} can be played together", request.source.text,
                            names.size(), most),
                "combine them into a quilt");
  Sources films;
  PictureRequest how = request.how;
  how.decoder_threads = 1;
  for (const std::string& name : names) {
    films.push_back(open_pictures(name, how));
    if (films.back()->geometry() != films.front()->geometry())
      throw Error(ErrorKind::Input,
                  fmt::format("{}: its size differs from that of {}", name, names[0]),
                  "all views must have the same size");
  }
  auto arrangement = frames::arrange_pictures(
      films.front()->geometry(), static_cast<int>(names.size()),
      aspect_of(detected.aspect, *films.front()), detected.rightmost_first);
  return std::make_unique<ViewInput>(std::move(films), std::move(arrangement), request.source.text);
}

std::unique_ptr<ViewInput> open_view_files(const ContentRequest& request,
                                           const ContentFormat& detected) {
  const std::vector<std::string> names = names_of_views(request.source);
  require_count(request, names.size());
  const bool films = std::any_of(names.begin(), names.end(), [](const std::string& name) {
    return is_video(name) || frames::FilePattern::looks_like_pattern(name);
  });
  return films ? open_films(request, detected, names) : open_still_views(request, detected, names);
}

std::unique_ptr<ViewInput> input_of(Sources sources,
                                    std::unique_ptr<frames::ViewArrangement> arrangement,
                                    const ContentRequest& request) {
  return std::make_unique<ViewInput>(std::move(sources), std::move(arrangement),
                                     request.source.text);
}

/// Refuses depth in float files: depth is read as 8-bit codes, and float files have another scale.
void refuse_float_depth(const std::string& file) {
  const std::string extension = fs::path(file).extension().string();
  if (extension == ".exr" || extension == ".hdr")
    throw Error(ErrorKind::Usage,
                fmt::format("--depth {}: floating-point depth is not supported", file),
                "store it as a grey picture in which white is near");
}

std::unique_ptr<ViewInput> open_with_own_depth(const ContentRequest& request,
                                               const ContentFormat& detected) {
  refuse_float_depth(request.source.content.depth);
  Sources sources;
  sources.push_back(open_pictures(request.source.text, request.how));
  sources.push_back(open_pictures(request.source.content.depth, request.how));
  frames::DepthOptions options = detected.depth_options;
  options.threads = request.drawing_threads;
  options.most_bytes = most_view_bytes(request);
  auto arrangement = frames::arrange_depth(sources.front()->geometry(),
                                           aspect_of(detected.aspect, *sources.front()), options);
  return input_of(std::move(sources), std::move(arrangement), request);
}

optics::Rig rig_of_woven(const ContentRequest& request, const ContentFormat& detected) {
  const ContentFlags& flags = request.source.content;
  if (flags.from_rig.empty()) {
    if (detected.rig_toml.empty())
      throw Error(
          ErrorKind::Input,
          fmt::format("{}: does not contain the rig that it was woven for", request.source.text),
          "use --from-rig RIG.toml");
    return optics::parse_rig(detected.rig_toml, request.source.text + ": its rig");
  }
  auto [rig, identity] = optics::load_rig_and_identity(flags.from_rig);
  if (request.source.kind != SourceKind::Sequence) return rig;
  const frames::SequenceReader reader(request.source.text);
  const std::string& kept = reader.info().rig_fingerprint;
  const optics::RigMatch matched = optics::match(frames::rig_of(reader.info()), identity);
  // The frames were woven before the rig was trimmed, so the rig in the file is the correct one.
  if (matched == optics::RigMatch::Trimmed && !reader.info().rig_toml.empty())
    return optics::parse_rig(reader.info().rig_toml, request.source.text + ": its rig");
  if (matched != optics::RigMatch::Same)
    throw Error(ErrorKind::Input,
                fmt::format("{}: was woven for another rig ({}), not for {} ({})",
                            request.source.text, kept, flags.from_rig, identity.fingerprint),
                "use --reweave instead of --from-rig: the file contains its rig");
  return rig;
}

std::unique_ptr<ViewInput> open_other_rig(const ContentRequest& request,
                                          const ContentFormat& detected) {
  const optics::OpticalModel model(rig_of_woven(request, detected));
  const int wanted = request.source.content.views;
  PictureRequest how = request.how;
  how.before_weaving = false;  // subsampled chroma mixes pixels of different views
  Sources sources;
  sources.push_back(open_pictures(request.source.text, how));
  auto arrangement = frames::arrange_woven(
      sources.front()->geometry(), model, wanted > 0 ? wanted : frames::views_in_woven(model.rig()),
      request.source.text);
  return input_of(std::move(sources), std::move(arrangement), request);
}

std::unique_ptr<frames::ViewArrangement> arrangement_of(const ContentRequest& request,
                                                        const ContentFormat& detected,
                                                        const FrameSource& source) {
  const std::string& name = request.source.text;
  const frames::FrameGeometry picture = source.geometry();
  const double pixel_aspect = source.pixel_aspect();
  if (detected.kind == Kind::Quilt) {
    frames::QuiltLayout layout = detected.layout;
    if (!layout.aspect)
      layout.aspect = frames::stated_aspect(
          {.width = picture.width / layout.columns, .height = picture.height / layout.rows},
          pixel_aspect);
    return frames::arrange_quilt(picture, layout, detected.rightmost_first, name);
  }
  if (detected.kind == Kind::Stereo) {
    frames::StereoTiles tiles = frames::tiles_of(detected.stereo, picture);
    const bool beside = detected.stereo.beside && !detected.stereo.half;
    const bool above = !detected.stereo.beside && !detected.stereo.half;
    const frames::FrameGeometry eye{.width = picture.width / (beside ? 2 : 1),
                                    .height = picture.height / (above ? 2 : 1)};
    if (const auto stated = frames::stated_aspect(eye, pixel_aspect)) tiles.layout.aspect = stated;
    if (detected.aspect) tiles.layout.aspect = detected.aspect;
    return frames::arrange_quilt(picture, tiles.layout,
                                 tiles.rightmost_first != detected.rightmost_first, name);
  }
  LENTICULE_CHECK(detected.kind == Kind::DepthInside);
  frames::DepthOptions options = detected.depth_options;
  options.threads = request.drawing_threads;
  options.most_bytes = most_view_bytes(request);
  const bool beside =
      detected.depth == frames::DepthPlace::Left || detected.depth == frames::DepthPlace::Right;
  const frames::FrameGeometry colours{.width = picture.width / (beside ? 2 : 1),
                                      .height = picture.height / (beside ? 1 : 2)};
  const auto aspect =
      detected.aspect ? detected.aspect : frames::stated_aspect(colours, pixel_aspect);
  return frames::arrange_depth_in(picture, detected.depth, aspect, options, name);
}

}  // namespace

std::unique_ptr<ViewInput> open_views(const ContentRequest& request,
                                      const ContentFormat& detected) {
  LENTICULE_CHECK(detected.kind != Kind::Woven);
  if (detected.kind == Kind::ViewFiles) return open_view_files(request, detected);
  if (detected.kind == Kind::OwnDepth) return open_with_own_depth(request, detected);
  if (detected.kind == Kind::OtherRig) return open_other_rig(request, detected);
  Sources sources;
  sources.push_back(open_pictures(request.source.text, request.how));
  auto arrangement = arrangement_of(request, detected, *sources.front());
  return input_of(std::move(sources), std::move(arrangement), request);
}

void await_first(ViewInput& input, const std::string& name) {
  const auto deadline = std::chrono::steady_clock::now() + kTimeout;
  while (std::chrono::steady_clock::now() < deadline && !interrupted()) {
    switch (input.next()) {
      case frames::PullStatus::Ready:
        return;
      case frames::PullStatus::End:
        throw Error(ErrorKind::Input, fmt::format("{}: has no frames", name));
      case frames::PullStatus::Failed:
        throw Error(ErrorKind::Input, input.failure());
      case frames::PullStatus::NotYet:
        input.wait(kLook);
    }
  }
  throw Error(ErrorKind::Failed, fmt::format("{}: no picture arrived", name));
}

frames::FrameDamage await_damage(ViewInput& input) {
  input.release();
  const auto deadline = std::chrono::steady_clock::now() + kTimeout;
  while (std::chrono::steady_clock::now() < deadline && !interrupted()) {
    const frames::PullStatus status = input.next();
    if (status == frames::PullStatus::Ready) input.release();
    if (status == frames::PullStatus::NotYet) input.wait(kLook);
    if (status == frames::PullStatus::End || status == frames::PullStatus::Failed) break;
  }
  return input.damage();
}

}  // namespace lenticule::player
