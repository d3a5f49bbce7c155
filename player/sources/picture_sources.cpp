// SPDX-License-Identifier: Apache-2.0
#include "player/sources/picture_sources.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <thread>

#include "base/error.h"
#include "frames/image_io.h"
#include "frames/image_sequence.h"
#include "frames/sequence/sequence_source.h"
#include "player/sources/content_format.h"
#include "player/sources/source_spec.h"
#include "player/sources/video_source.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxDecoderThreads = 8;
constexpr int kMaxThreads = 16;
constexpr int kFewestFrames = 2;

uint64_t pixels_of(const frames::FrameGeometry& size) {
  return uint64_t(size.width) * uint64_t(size.height);
}

void check_size(const std::string& name, const frames::FrameGeometry& size,
                const PictureRequest& request, uint64_t most_pixels) {
  if (request.size && size != *request.size)
    throw Error(ErrorKind::Input,
                fmt::format("{}: {}x{} pixels, but the rig's panel has {}x{}", name, size.width,
                            size.height, request.size->width, request.size->height),
                remedy_of_unwoven(size));
  if (request.plays && pixels_of(size) > most_pixels)
    throw Error(ErrorKind::Input,
                fmt::format("{}: {}x{} pixels; the limit is {} million", name, size.width,
                            size.height, most_pixels / 1'000'000),
                "make the views smaller; a panel shows only a fraction of so many pixels");
}

std::unique_ptr<frames::FrameSource> open_files(const std::string& text,
                                                const PictureRequest& request) {
  std::vector<fs::path> files =
      request.frames ? files_in_range(text, *request.frames) : frames::list_frame_files(text);
  const uint64_t first = request.first_frame < files.size() ? request.first_frame : 0;
  frames::ImageSequenceOptions options{
      .pool_frames = std::max(request.pool_frames, kFewestFrames),
      .decoder_threads = request.decoder_threads,
      .first = first,
      .use = request.before_weaving ? frames::PictureUse::Views : frames::PictureUse::Woven};
  if (request.plays) options.pool_bytes = kMostBytesAhead;
  const std::string name = files.front().string();
  options.accept = [&](const frames::PictureInfo& info) {
    const auto size = frames::oriented_geometry(info.geometry, info.orientation);
    check_size(name, size, request, kMostPlayedPixels);
  };
  return std::make_unique<frames::ImageSequence>(std::move(files), options);
}

/// Opens a container; frames keep their numbers in the rendered sequence.
std::unique_ptr<frames::FrameSource> open_container(const std::string& text,
                                                    const PictureRequest& request) {
  frames::SequenceSourceOptions options{.pool_frames = std::max(request.pool_frames, kFewestFrames),
                                        .decoder_threads = request.decoder_threads,
                                        .first = request.first_frame};
  if (request.frames) {
    const uint64_t named_first = frames::SequenceReader(text).info().first_frame;
    if (request.frames->begin < named_first)
      throw Error(ErrorKind::Input, fmt::format("{}: starts at frame {}", text, named_first),
                  "use a range of existing frames");
    options.begin = request.frames->begin - named_first;
    options.end = request.frames->end - named_first;
  }
  return std::make_unique<frames::SequenceSource>(text, options);
}

}  // namespace

int decoding_threads() {
  return std::clamp(all_threads() - 1, 1, kMaxDecoderThreads);
}

int all_threads() {
  return std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, kMaxThreads);
}

std::vector<fs::path> files_in_range(const std::string& text, FrameRange range) {
  if (!frames::FilePattern::looks_like_pattern(text))
    throw Error(ErrorKind::Usage, fmt::format("--frames: '{}' is a single picture", text),
                "use a pattern such as 'out/%05d.png'");
  const frames::FilePattern pattern(text);
  std::vector<uint64_t> numbers = pattern.existing();
  std::erase_if(numbers, [&](uint64_t n) { return n < range.begin || n >= range.end; });
  std::vector<fs::path> files;
  for (uint64_t n = range.begin; n < range.end; ++n) {
    const size_t index = static_cast<size_t>(n - range.begin);
    if (index >= numbers.size() || numbers[index] != n)
      throw Error(ErrorKind::Input, fmt::format("{}: no such file", pattern.path(n).string()),
                  "use a range of existing frames");
    files.push_back(pattern.path(n));
  }
  return files;
}

std::unique_ptr<frames::FrameSource> open_pictures(const std::string& text,
                                                   const PictureRequest& request) {
  const SourceKind kind = kind_of_file(text);
  if (kind == SourceKind::Sequence) return open_container(text, request);
  if (kind != SourceKind::Video) return open_files(text, request);
  return open_video(
      {.file = text,
       .slots = request.pool_frames,
       .frames = request.frames,
       .plays_again = request.plays_again,
       .before_weaving = request.before_weaving,
       .accept =
           [&](const frames::FrameGeometry& size) {
             check_size(text, size, request, kMostPlayedVideoPixels);
           },
       .most_bytes = request.plays ? kMostBytesAhead : std::numeric_limits<uint64_t>::max(),
       .hardware = request.hardware});
}

}  // namespace lenticule::player
