// SPDX-License-Identifier: Apache-2.0
#include "player/sources/pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <thread>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/print.h"
#include "frames/decoded_source.h"
#include "frames/image_io.h"
#include "frames/picture_codec.h"
#include "frames/sequence/sequence_reader.h"
#include "frames/views_input/stereo_pair.h"
#include "frames/weaving/reweave.h"
#include "optics/rig_file.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"
#include "player/sources/video_probe.h"
#include "player/sources/video_source.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using frames::FrameSource;
using frames::ViewInput;
using Kind = Content::Kind;

/// Limits for playback: a picture with more pixels is refused before memory is allocated for it. A
/// video decoder holds many pictures, so its limit is lower.
constexpr uint64_t kMostPlayedPixels = uint64_t{1} << 27;       ///< 16384 x 8192: 384 MiB
constexpr uint64_t kMostPlayedVideoPixels = uint64_t{1} << 26;  ///< 8192 x 8192
/// Larger pictures are not searched for two eyes: those of cameras have 50 million pixels.
constexpr uint64_t kMostSearchedPixels = uint64_t{1} << 26;
/// Limit of the pictures decoded ahead; two pictures are always allowed.
constexpr uint64_t kMostBytesAhead = uint64_t{1} << 30;
constexpr int kMaxDecoderThreads = 8;
constexpr int kMaxThreads = 16;
constexpr int kFewestFrames = 2;
/// Limits of views per source: each film has a thread and pictures, each video a process.
constexpr size_t kMostFilms = 128;
constexpr size_t kMostVideos = 16;
/// Limit for playback: 2 GiB, the size of 86 views of 3840x2160.
constexpr uint64_t kMostPlayedViewBytes = uint64_t{2} << 30;
constexpr auto kTimeout = std::chrono::minutes(2);
constexpr std::chrono::milliseconds kLongestWait{100};

uint64_t pixels_of(const frames::FrameGeometry& size) {
  return uint64_t(size.width) * uint64_t(size.height);
}

void check_size(const std::string& name, const frames::FrameGeometry& size,
                const PictureOptions& options, uint64_t most_pixels) {
  if (options.size) require_size_of_panel(name, size, *options.size);
  const uint64_t limit = options.most_pixels.value_or(
      options.plays ? most_pixels : std::numeric_limits<uint64_t>::max());
  if (pixels_of(size) > limit)
    throw input_error("{}: {}x{} pixels; the limit is {} million", name, size.width, size.height,
                      limit / 1'000'000)
        .remedy("make the views smaller; a panel shows only a fraction of so many pixels");
}

/// Returns all files of a pattern in a range. Throws Error(Usage) for a single picture,
/// Error(Input) that names the first missing file.
std::vector<fs::path> files_in_range(const std::string& text, FrameRange range) {
  if (!frames::FilePattern::looks_like_pattern(text))
    throw usage_error("--frames: '{}' is a single picture", text)
        .remedy("use a pattern such as 'out/%05d.png'");
  const frames::FilePattern pattern(text);
  std::vector<uint64_t> numbers = pattern.existing();
  std::erase_if(numbers, [&](uint64_t n) { return n < range.begin || n >= range.end; });
  std::vector<fs::path> files;
  for (uint64_t n = range.begin; n < range.end; ++n) {
    const size_t index = static_cast<size_t>(n - range.begin);
    if (index >= numbers.size() || numbers[index] != n)
      throw input_error("{}: no such file", pattern.path(n).string())
          .remedy("use a range of existing frames");
    files.push_back(pattern.path(n));
  }
  return files;
}

std::unique_ptr<FrameSource> open_files(const std::string& text, const PictureOptions& options) {
  std::vector<fs::path> files =
      options.frames ? files_in_range(text, *options.frames) : frames::list_frame_files(text);
  const uint64_t first = options.first_frame < files.size() ? options.first_frame : 0;
  frames::ImageSequenceOptions sequence{
      .pool_frames = std::max(options.pool_frames, kFewestFrames),
      .decoder_threads = options.decoder_threads,
      .first = first,
      .use = options.before_weaving ? frames::PictureUse::Views : frames::PictureUse::Woven};
  if (options.plays) sequence.pool_bytes = kMostBytesAhead;
  const std::string name = files.front().string();
  sequence.accept = [&](const frames::PictureInfo& info) {
    const auto size = frames::oriented_geometry(info.geometry, info.orientation);
    check_size(name, size, options, kMostPlayedPixels);
  };
  return std::make_unique<frames::ImageSequence>(std::move(files), sequence);
}

/// Opens a container, whose range has the numbers of the rendered sequence.
std::unique_ptr<FrameSource> open_container(const std::string& text,
                                            const PictureOptions& options) {
  frames::SequenceSourceOptions sequence{
      .pool_frames = std::max(options.pool_frames, kFewestFrames),
      .decoder_threads = options.decoder_threads,
      .first = options.first_frame};
  if (options.frames) {
    const uint64_t named_first = frames::SequenceReader(text).info().first_frame;
    if (options.frames->begin < named_first)
      throw input_error("{}: starts at frame {}", text, named_first)
          .remedy("use a range of existing frames");
    sequence.begin = options.frames->begin - named_first;
    sequence.end = options.frames->end - named_first;
  }
  return std::make_unique<frames::SequenceSource>(text, sequence);
}

// --- views ----------------------------------------------------------------------------------

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

bool is_video(const std::string& name) { return kind_of_file(name) == SourceKind::Video; }

/// Refuses depth in float files: depth is read as 8-bit codes, and float files have another scale.
void refuse_float_depth(const std::string& file) {
  const std::string extension = fs::path(file).extension().string();
  if (extension == ".exr" || extension == ".hdr")
    throw usage_error("--depth {}: floating-point depth is not supported", file)
        .remedy("store it as a grey picture in which white is near");
}

optics::Rig rig_of_woven(const Content& content) {
  const SourceSpec& source = content.source;
  const std::string& rig_file = source.content.from_rig;
  if (rig_file.empty()) {
    if (content.rig_toml.empty())
      throw input_error("{}: does not contain the rig that it was woven for", source.text)
          .remedy("use --from-rig RIG.toml");
    return optics::parse_rig(content.rig_toml, source.text + ": its rig");
  }
  auto [rig, identity] = optics::load_rig_and_identity(rig_file);
  if (source.kind != SourceKind::Sequence) return rig;
  const frames::SequenceReader reader(source.text);
  const frames::SequenceInfo& info = reader.info();
  const optics::RigMatch matched = optics::match(frames::rig_of(info), identity);
  // The frames were woven before the rig was trimmed, so the rig in the file is the correct one.
  if (matched == optics::RigMatch::Trimmed && !info.rig_toml.empty())
    return optics::parse_rig(info.rig_toml, source.text + ": its rig");
  if (matched != optics::RigMatch::Same)
    throw input_error("{}: was woven for another rig ({}), not for {} ({})", source.text,
                      info.rig_fingerprint, rig_file, identity.fingerprint)
        .remedy("use --reweave instead of --from-rig: the file contains its rig");
  return rig;
}

/// ViewsOpener opens the pictures of one source and states where its views lie in them.
class ViewsOpener {
 public:
  ViewsOpener(const Content& content, const PictureOptions& options)
      : content_(content), name_(content.source.text), options_(options) {}

  [[nodiscard]] std::unique_ptr<ViewInput> open() {
    switch (content_.kind) {
      case Kind::ViewFiles:
        return open_view_files();
      case Kind::OwnDepth:
        return open_with_own_depth();
      case Kind::OtherRig:
        return open_woven();
      case Kind::Quilt:
        return input_of(quilt_in(add_pictures(name_)));
      case Kind::Stereo:
        return content_.eyes.empty() ? input_of(eyes_in(add_pictures(name_))) : open_streams();
      case Kind::DepthInside:
        return input_of(depth_in(add_pictures(name_)));
      case Kind::Woven:
        break;
    }
    LENTICULE_CHECK(content_.kind != Kind::Woven);
    return nullptr;
  }

 private:
  using Arrangement = std::unique_ptr<frames::ViewArrangement>;

  const FrameSource& add_pictures(const std::string& name) {
    sources_.push_back(options_.pictures ? options_.pictures() : open_pictures(name, options_));
    return *sources_.back();
  }
  [[nodiscard]] std::unique_ptr<ViewInput> input_of(Arrangement arrangement) {
    const bool has_depth = content_.kind == Kind::OwnDepth || content_.kind == Kind::DepthInside;
    return std::make_unique<ViewInput>(std::move(sources_), std::move(arrangement), name_,
                                       has_depth ? frames::ViewCrop() : content_.crop);
  }
  [[nodiscard]] uint64_t most_view_bytes() const {
    return options_.plays ? kMostPlayedViewBytes : frames::kMostViewBytes;
  }
  [[nodiscard]] frames::DepthOptions depth_options() const {
    frames::DepthOptions depth = content_.depth_options;
    depth.zero_plane = content_.crop.zero_plane;
    depth.threads = options_.drawing_threads;
    depth.most_bytes = most_view_bytes();
    if (const auto budget = content_.source.content.depth_budget) {
      if (options_.rig == nullptr)
        throw Error(ErrorKind::Usage, "--depth-budget: depends on the panel, and none is known",
                    "add --rig, or use --depth-range");
      // At the depth of field a point moves by a lens from each subpixel under a lens to the next.
      const double pitch = options_.rig->sheet.pitch.value;
      depth.most = *budget * pitch * pitch / (3.0 * options_.rig->panel.width_px);
    }
    return depth;
  }
  /// Returns the stated aspect of a view of this size, or that of the pixels if they are not
  /// square.
  [[nodiscard]] std::optional<double> aspect_of(const frames::FrameGeometry& view,
                                                const FrameSource& pictures) const {
    return content_.aspect ? content_.aspect : frames::stated_aspect(view, pictures.pixel_aspect());
  }

  [[nodiscard]] std::unique_ptr<ViewInput> open_view_files() {
    const std::vector<std::string> names = names_of_views(content_.source);
    const int wanted = content_.source.content.views;
    if (wanted != 0 && static_cast<size_t>(wanted) != names.size())
      throw input_error("{}: has {} views, but --views is {}", name_, names.size(), wanted);
    const bool films = std::any_of(names.begin(), names.end(), [](const std::string& name) {
      return is_video(name) || frames::FilePattern::looks_like_pattern(name);
    });
    return films ? open_films(names) : open_still_views(names);
  }

  [[nodiscard]] std::unique_ptr<ViewInput> open_still_views(const std::vector<std::string>& names) {
    if (options_.frames)
      throw Error(ErrorKind::Usage, "--frames: not allowed for a single picture",
                  "use --frames with films, such as 'views:view%02d/%05d.png'");
    std::vector<fs::path> files(names.begin(), names.end());
    if (content_.rightmost_first) std::reverse(files.begin(), files.end());
    frames::ViewSet views = frames::read_views(files, content_.source.without_prefix(),
                                               content_.aspect, most_view_bytes());
    return std::make_unique<ViewInput>(std::move(views).cropped(content_.crop));
  }

  [[nodiscard]] std::unique_ptr<ViewInput> open_films(const std::vector<std::string>& names) {
    const bool videos = std::any_of(names.begin(), names.end(), is_video);
    const size_t most = videos ? kMostVideos : kMostFilms;
    if (names.size() > most)
      throw Error(
          ErrorKind::Input,
          fmt::format("{}: {} films; at most {} can be played together", name_, names.size(), most),
          "combine them into a quilt");
    options_.decoder_threads = 1;
    for (const std::string& name : names) {
      const FrameSource& film = add_pictures(name);
      if (film.geometry() != sources_.front()->geometry())
        throw input_error("{}: its size differs from that of {}", name, names[0])
            .remedy("all views must have the same size");
    }
    return input_of_views();
  }

  /// Returns an input of one source for each view.
  [[nodiscard]] std::unique_ptr<ViewInput> input_of_views() {
    const FrameSource& first = *sources_.front();
    return input_of(frames::arrange_pictures(first.geometry(), static_cast<int>(sources_.size()),
                                             aspect_of(first.geometry(), first),
                                             content_.rightmost_first));
  }

  [[nodiscard]] std::unique_ptr<ViewInput> open_streams() {
    for (const int stream : content_.eyes) {
      options_.stream = stream;
      (void)add_pictures(name_);
    }
    return input_of_views();
  }

  [[nodiscard]] std::unique_ptr<ViewInput> open_with_own_depth() {
    const std::string& depth = content_.source.content.depth;
    refuse_float_depth(depth);
    const FrameSource& colours = add_pictures(name_);
    (void)add_pictures(depth);
    const frames::FrameGeometry size = colours.geometry();
    return input_of(frames::arrange_depth({size.width, size.height}, {}, aspect_of(size, colours),
                                          depth_options()));
  }

  [[nodiscard]] std::unique_ptr<ViewInput> open_woven() {
    const optics::OpticalModel model(rig_of_woven(content_));
    const int wanted = content_.source.content.views;
    options_.before_weaving = false;  // subsampled chroma mixes pixels of different views
    const FrameSource& woven = add_pictures(name_);
    return input_of(frames::arrange_woven(
        woven.geometry(), model, wanted > 0 ? wanted : frames::views_in_woven(model.rig()), name_));
  }

  [[nodiscard]] Arrangement quilt_in(const FrameSource& pictures) const {
    const frames::FrameGeometry size = pictures.geometry();
    frames::QuiltLayout layout = content_.layout;
    if (!layout.aspect)
      layout.aspect = frames::stated_aspect(
          {.width = size.width / layout.columns, .height = size.height / layout.rows},
          pictures.pixel_aspect());
    return frames::arrange_quilt(size, layout, content_.rightmost_first, name_);
  }

  [[nodiscard]] Arrangement eyes_in(const FrameSource& pictures) const {
    const frames::FrameGeometry size = pictures.geometry();
    const frames::StereoLayout& stereo = content_.stereo;
    frames::StereoTiles tiles = frames::tiles_of(stereo, size);
    const frames::FrameGeometry eye{
        .width = size.width / (stereo.beside && !stereo.half ? 2 : 1),
        .height = size.height / (!stereo.beside && !stereo.half ? 2 : 1)};
    if (const auto aspect = aspect_of(eye, pictures)) tiles.layout.aspect = aspect;
    return frames::arrange_quilt(size, tiles.layout,
                                 tiles.rightmost_first != content_.rightmost_first, name_);
  }

  [[nodiscard]] Arrangement depth_in(const FrameSource& pictures) const {
    const auto windows = frames::depth_windows(pictures.geometry(), content_.depth, name_);
    const auto& [width, height] = windows.colour.size;
    return frames::arrange_depth(windows.colour.size, windows, aspect_of({width, height}, pictures),
                                 depth_options());
  }

  const Content& content_;
  const std::string& name_;
  PictureOptions options_;
  std::vector<std::unique_ptr<FrameSource>> sources_;
};

/// Returns false if headers tell that the pictures are not woven frames of the panel; of any
/// without one.
bool may_be_woven(const SourceSpec& source, const std::optional<frames::FrameGeometry>& panel) {
  if (source.kind == SourceKind::Video) {
    const VideoStream stream = probe_video(source.text).front();
    return stream.full_chroma && (!panel || stream.geometry == *panel);
  }
  std::error_code ignored;
  return !panel || !fs::is_regular_file(source.text, ignored) ||
         frames::probe_image(source.text) == *panel;
}

/// Looks for two eyes in the pixels, and says what it found.
std::optional<frames::StereoLayout> find_stereo(ViewInput& input, const std::string& name) {
  constexpr uint64_t kMostFrames = 73, kStep = 24;  // the first ones of a film may be black
  for (uint64_t n = 0; n < kMostFrames && n < input.frame_count().value_or(kMostFrames); ++n) {
    try {
      await_first(input, name);
    } catch (const Error&) {
      if (n == 0) throw;
      return std::nullopt;  // a short film
    }
    const frames::ViewSet& view = input.views();
    const frames::FrameGeometry size{.width = view.width(), .height = view.height()};
    const auto pair =
        n % kStep == 0 ? frames::find_stereo_pair({size, {view.pixel(0, 0, 0), size.frame_bytes()}})
                       : std::nullopt;
    input.release();
    if (!pair) continue;
    const auto& [beside, half, right_first] = pair->layout;
    say("{}: taken for two eyes {}: {:.0f}% of the detail is in both halves, at {:+.1f}% to "
        "{:+.1f}% of their width\n  --stereo none if it is not; --stereo {}{} --invert if near and "
        "far are exchanged\n",
        name, beside ? "side by side" : "above each other", 100 * pair->matching, 100 * pair->back,
        100 * pair->front, half ? "h" : "", beside ? "sbs" : "tb");
    return pair->layout;
  }
  return std::nullopt;
}

}  // namespace

int decoding_threads() { return std::clamp(all_threads() - 1, 1, kMaxDecoderThreads); }

int all_threads() {
  return std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, kMaxThreads);
}

std::unique_ptr<FrameSource> open_pictures(const std::string& text, const PictureOptions& options) {
  const SourceKind kind = kind_of_file(text);
  if (kind == SourceKind::Sequence) return open_container(text, options);
  if (kind != SourceKind::Video) return open_files(text, options);
  return open_video(
      {.file = text,
       .slots = options.pool_frames,
       .stream = options.stream,
       .frames = options.frames,
       .plays_again = options.plays_again,
       .before_weaving = options.before_weaving,
       .accept =
           [&](const frames::FrameGeometry& size) {
             check_size(text, size, options, kMostPlayedVideoPixels);
           },
       .most_bytes = options.plays ? kMostBytesAhead : std::numeric_limits<uint64_t>::max(),
       .hardware = options.hardware});
}

std::unique_ptr<ViewInput> open_views(const Content& content, const PictureOptions& options) {
  return ViewsOpener(content, options).open();
}

Content identify_by_pixels(const SourceSpec& source, const std::string& rig_fingerprint,
                           const std::optional<frames::FrameGeometry>& panel, bool views_wanted,
                           bool patterns_are_views) {
  static KnownFiles<std::vector<FileMark>, std::optional<frames::StereoLayout>> known_pairs;
  Content content = identify(source, rig_fingerprint, patterns_are_views);
  const bool has_pixels = source.kind == SourceKind::Video || source.kind == SourceKind::Pictures;
  if (content.kind != Kind::Woven || !has_pixels || !source.content.stereo.empty() ||
      (!views_wanted && may_be_woven(source, panel)))
    return content;
  const std::vector<FileMark> files = marks_of_source(source);
  std::optional<std::optional<frames::StereoLayout>> pair = known_pairs.find(files);
  if (!pair) {
    const Content flat{.kind = Kind::Quilt, .source = source};  // of one tile
    std::unique_ptr<ViewInput> input;
    try {
      input = open_views(flat, {.pool_frames = kFewestFrames, .most_pixels = kMostSearchedPixels});
    } catch (const Error&) {
      return content;  // opening it for its use tells why
    }
    known_pairs.add(files, *(pair = find_stereo(*input, source.text)));
  }
  if (*pair) content = {.kind = Kind::Stereo, .stereo = **pair, .source = source};
  return content;
}

bool await_next(ViewInput& input, const std::string& name) {
  const auto deadline = std::chrono::steady_clock::now() + kTimeout;
  while (std::chrono::steady_clock::now() < deadline) {
    switch (input.next()) {
      case frames::PullStatus::Ready:
        return true;
      case frames::PullStatus::End:
        return false;
      case frames::PullStatus::Failed:
        throw Error(ErrorKind::Input, input.failure(), frames::kDamagedRemedy);
      case frames::PullStatus::NotYet:
        if (interrupted()) return false;
        input.wait(kLongestWait);
    }
  }
  throw failed_error("{}: no picture arrived", name);
}

void await_first(ViewInput& input, const std::string& name) {
  if (await_next(input, name)) return;
  throw interrupted() ? failed_error("{}: no picture arrived", name)
                      : input_error("{}: has no frames", name);
}

frames::FrameDamage await_damage(ViewInput& input) {
  input.release();
  try {
    while (await_next(input, {})) input.release();
  } catch (const Error&) {  // ends it, too
  }
  return input.damage();
}

}  // namespace lenticule::player
