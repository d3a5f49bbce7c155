// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/existing_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <system_error>

#include "base/error.h"
#include "frames/image_io.h"
#include "frames/sequence/sequence_reader.h"

namespace lenticule::tools {
namespace {

namespace fs = std::filesystem;

/// Limit of the numbers to check: an input of unknown length could have any.
constexpr uint64_t kMostPictures = uint64_t{1} << 20;

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw Error(ErrorKind::Input, fmt::format("{}: exists already: {}", file.string(), what),
              "use another name, or --overwrite");
}

bool may_replace(const OutputRequest& request) {
  return request.resume || request.overwrite;
}

bool is_there(const fs::path& file) {
  std::error_code error;
  return fs::exists(file, error);
}

/// Returns the last two parts of a path: the folder's name and the file's.
std::string short_name(const std::string& file) {
  std::error_code error;
  const fs::path whole = fs::weakly_canonical(file, error);
  if (error || !whole.has_parent_path()) return file;
  return (whole.parent_path().filename() / whole.filename()).string();
}

/// Refuses a readable container that was made from other input.
void require_same_film(const OutputRequest& request, const fs::path& file,
                       const frames::SequenceInfo& there) {
  const frames::SequenceInfo wanted = request.sequence.value_or(frames::SequenceInfo{});
  const std::string& made_from = request.sequence ? wanted.made_from : request.made_from;
  if (there.geometry != request.geometry)
    refuse(file,
           fmt::format("frames of {}x{} pixels, not of {}x{}", there.geometry.width,
                       there.geometry.height, request.geometry.width, request.geometry.height));
  if (there.kind != wanted.kind) refuse(file, "contains another kind of frames");
  if (optics::match(frames::rig_of(there), request.rig) == optics::RigMatch::Other)
    refuse(file, fmt::format("made for another rig ({})", there.rig_fingerprint));
  if (!there.made_from.empty() && !made_from.empty() && there.made_from != made_from)
    refuse(file, fmt::format("made from {}, not from {}", there.made_from, made_from));
}

}  // namespace

std::string made_from(const std::string& input, const std::string& camera) {
  const std::string scene = input.starts_with("builtin:") ? input : short_name(input);
  return camera.empty() ? scene : fmt::format("{} with {}", scene, short_name(camera));
}

void require_replaceable_film(const OutputRequest& request) {
  if (may_replace(request)) return;
  for (const fs::path& file : {fs::path(request.target), fs::path(request.target + ".part")}) {
    if (!is_there(file)) continue;
    std::optional<frames::SequenceInfo> there;
    try {
      there = frames::SequenceReader(file).info();
    } catch (const Error&) {
      refuse(file, "not a film that can be read");
    }
    require_same_film(request, file, *there);
  }
}

void require_replaceable_pictures(const OutputRequest& request,
                                  const frames::FrameGeometry& geometry,
                                  const std::function<fs::path(uint64_t)>& file) {
  if (may_replace(request)) return;
  const uint64_t count = std::min(request.range.count(), kMostPictures);
  for (uint64_t n = request.range.begin; n < request.range.begin + count; ++n) {
    const fs::path picture = file(n);
    if (!is_there(picture)) continue;
    std::optional<frames::FrameGeometry> there;
    try {
      there = frames::probe_image(picture);
    } catch (const Error&) {
      refuse(picture, "not a picture that can be read");
    }
    if (there->width != geometry.width || there->height != geometry.height)
      refuse(picture, fmt::format("a picture of {}x{} pixels, not of {}x{}", there->width,
                                  there->height, geometry.width, geometry.height));
  }
}

void require_replaceable_video(const OutputRequest& request) {
  if (!may_replace(request) && is_there(request.target))
    refuse(request.target, "a video does not record its rig and scene");
}

}  // namespace lenticule::tools
