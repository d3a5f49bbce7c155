// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/convert_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <utility>

#include "apps/lenticule-tools/offline/existing_output.h"
#include "apps/lenticule-tools/offline/video_writer.h"
#include "base/error.h"
#include "base/file.h"
#include "frames/image_io.h"
#include "frames/views_input/quilt_sidecar.h"
#include "frames/weaving/quilt_file.h"
#include "player/sources/source_spec.h"

namespace lenticule::tools {
namespace {

namespace fs = std::filesystem;

class VideoOutput final : public FrameOutput {
 public:
  explicit VideoOutput(const OutputRequest& request)
      : writer_({.file = request.target, .geometry = request.geometry, .rate = request.rate}) {}

  bool has(uint64_t) const override { return false; }
  Delivery deliver(uint64_t, const frames::FrameView& pixels) override {
    writer_.write(pixels);
    return Delivery::Done;
  }
  void finish() override { writer_.finish(); }

 private:
  VideoWriter writer_;
};

std::unique_ptr<FrameOutput> open_video_output(const OutputRequest& request) {
  if (request.resume)
    throw Error(ErrorKind::Usage, "--resume: not supported for video files",
                "convert to FILE.lts with --resume, then FILE.lts to a video");
  if (fs::path(request.target).extension() != ".mkv")
    throw Error(ErrorKind::Usage,
                fmt::format("-o {}: videos are written as Matroska", request.target),
                "use a name such as FILE.mkv");
  require_replaceable_video(request);
  return std::make_unique<VideoOutput>(request);
}

/// ViewFilesOutput writes one picture per view, for one frame or in one folder per view.
class ViewFilesOutput final : public FrameOutput {
 public:
  ViewFilesOutput(const OutputRequest& request, const frames::QuiltLayout& layout)
      : layout_(layout) {
    const fs::path text(player::parse_source(request.target).without_prefix());
    const std::string folder = text.parent_path().string();
    const std::string name = text.filename().string();
    if (frames::FilePattern::looks_like_pattern(folder)) {
      views_.emplace(folder);
      frames_.emplace(name);
      make_folders();
    } else {
      views_.emplace(text.string());
      if (request.range.count() > 1)
        throw Error(
            ErrorKind::Usage,
            fmt::format("-o {}: one name for {} frames", request.target, request.range.count()),
            "use a folder per view, for example -o 'views:view%02d/%05d.png'");
    }
    frames::check_writable_format(file(0, request.range.begin));
    require_replaceable_pictures(request,
                                 {.width = request.geometry.width / layout.columns,
                                  .height = request.geometry.height / layout.rows},
                                 [this](uint64_t frame) { return file(0, frame); });
  }

  /// Returns true if the last view's picture exists, because that is written last.
  bool has(uint64_t frame) const override {
    try {
      (void)frames::probe_image(file(last_view(), frame));
      return true;
    } catch (const Error&) {
      return false;
    }
  }
  Delivery deliver(uint64_t frame, const frames::FrameView& pixels) override {
    const frames::ViewSet views = frames::ViewSet::borrow(pixels, layout_);
    frames::WovenFrame picture({.width = views.width(), .height = views.height()});
    for (int view = 0; view < views.count(); ++view) {
      for (int row = 0; row < views.height(); ++row)
        std::copy_n(views.pixel(view, 0, row), picture.geometry().row_bytes(), picture.row(row));
      frames::write_woven(picture.view(), file(static_cast<uint64_t>(view), frame));
    }
    return Delivery::Done;
  }
  void finish() override {}

 private:
  [[nodiscard]] uint64_t last_view() const {
    return static_cast<uint64_t>(layout_.view_count()) - 1;
  }
  [[nodiscard]] fs::path file(uint64_t view, uint64_t frame) const {
    if (!frames_) return views_->path(view);
    return views_->path(view) / frames_->path(frame);
  }
  void make_folders() const {
    for (uint64_t view = 0; view <= last_view(); ++view) {
      std::error_code error;
      fs::create_directory(views_->path(view), error);
      if (error)
        throw Error(ErrorKind::Failed,
                    fmt::format("{}: {}", views_->path(view).string(), error.message()));
    }
  }

  frames::QuiltLayout layout_;
  std::optional<frames::FilePattern> views_;  ///< pattern of folders or of pictures
  std::optional<frames::FilePattern> frames_;
};

/// Writes a sidecar with the number of used tiles, which the name does not contain.
void write_sidecar(const std::string& target, uint64_t first, const frames::QuiltLayout& layout) {
  const fs::path picture = frames::FilePattern::looks_like_pattern(target)
                               ? frames::FilePattern(target).path(first)
                               : fs::path(target);
  nlohmann::json sidecar = {
      {"columns", layout.columns}, {"rows", layout.rows}, {"viewCount", layout.view_count()}};
  if (layout.aspect) sidecar["aspect"] = *layout.aspect;
  write_text_file(frames::sidecar_of(picture), sidecar.dump(2) + "\n");
}

}  // namespace

bool is_view_files(const std::string& target) {
  return player::parse_source(target).kind == player::SourceKind::ViewFiles;
}

std::string target_name(const ConvertTarget& target) {
  const std::string& name = target.request.target;
  const bool named = target.quilt && !is_view_files(name) && !name.ends_with(".lts");
  return named ? frames::quilt_name(name, *target.quilt).string() : name;
}

std::unique_ptr<FrameOutput> open_convert_output(const ConvertTarget& target) {
  OutputRequest request = target.request;
  if (is_view_files(request.target)) {
    LENTICULE_CHECK(target.quilt.has_value());
    return std::make_unique<ViewFilesOutput>(request, *target.quilt);
  }
  request.target = target_name(target);
  std::unique_ptr<FrameOutput> output =
      player::kind_of_file(request.target) == player::SourceKind::Video ? open_video_output(request)
                                                                        : open_output(request);
  const bool tiles_left =
      target.quilt && target.quilt->view_count() < target.quilt->columns * target.quilt->rows;
  if (tiles_left && !request.target.ends_with(".lts"))
    write_sidecar(request.target, request.range.begin, *target.quilt);
  return output;
}

}  // namespace lenticule::tools
