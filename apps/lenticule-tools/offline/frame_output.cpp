// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/frame_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <system_error>

#include "base/error_kinds.h"
#include "base/large_memory.h"
#include "base/print.h"
#include "base/temporary.h"
#include "frames/image_io.h"
#include "frames/ring/ring_renderer.h"
#include "frames/sequence/sequence_reader.h"
#include "frames/sequence/sequence_writer.h"
#include "player/process/interrupt.h"
#include "player/sources/source_spec.h"

namespace lenticule::tools {
namespace {

using Clock = std::chrono::steady_clock;
namespace fs = std::filesystem;

/// Longest delay until a signal is noticed during a wait.
constexpr std::chrono::milliseconds kWaitSlice{200};

/// Creates the last folder of the path if only that is missing, and checks that files can be
/// created in it.
void require_writable_folder(const fs::path& file) {
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  std::error_code error;
  // The check below reports any error, and an existing folder is none.
  fs::create_directory(folder, error);
  const TemporaryFile probe(file);
}

class PictureFiles final : public FrameOutput {
 public:
  explicit PictureFiles(const OutputRequest& request) : geometry_(request.film.geometry) {
    if (frames::FilePattern::looks_like_pattern(request.target)) {
      pattern_.emplace(request.target);
    } else if (request.range.count() > 1) {
      throw usage_error("-o {}: one name for {} frames", request.target, request.range.count())
          .remedy("use a number in the name, for example -o 'out/%05d.png'");
    }
    single_ = request.target;
    frames::check_writable_format(file(request.range.begin));
    require_writable_folder(file(request.range.begin));
    require_replaceable_pictures(request, geometry_, [this](uint64_t n) { return file(n); });
  }

  bool has(uint64_t frame) const override {
    try {
      return frames::probe_image(file(frame)) == geometry_;
    } catch (const Error&) {
      return false;  // no complete picture: render it again
    }
  }

  bool deliver(uint64_t frame, const frames::FrameView& pixels) override {
    frames::write_woven(pixels, file(frame));
    return true;
  }

 private:
  [[nodiscard]] fs::path file(uint64_t frame) const {
    return pattern_ ? pattern_->path(frame) : fs::path(single_);
  }

  frames::FrameGeometry geometry_;
  std::optional<frames::FilePattern> pattern_;
  std::string single_;
};

class RingOutput final : public FrameOutput {
 public:
  explicit RingOutput(const OutputRequest& request)
      : socket_(player::parse_source(request.target).without_prefix()),
        geometry_(request.film.geometry),
        timeout_(request.ring_timeout_seconds) {
    if (socket_.empty())
      throw Error(ErrorKind::Usage, "-o ring: the socket is missing",
                  "for example -o ring:/run/x.sock");
    hello_.rig_fingerprint = optics::to_text(frames::rig_of(request.film));
    hello_.rate = request.film.rate;
    hello_.frame_count = request.range.count();
    connect();
  }

  bool deliver(uint64_t frame, const frames::FrameView& pixels) override {
    while (!player::interrupted()) {
      // Connects again if the player was restarted meanwhile; it receives this frame first.
      if (!ring_) connect();
      if (!ring_) break;
      std::span<uint8_t> slot;
      frames::RingStatus status = ring_->acquire(frame, kWaitSlice, slot);
      if (status == frames::RingStatus::Ok) {
        if (slot.size() < pixels.bytes.size())
          throw input_error("{}: the slots are too small for a frame", socket_.string());
        std::copy(pixels.bytes.begin(), pixels.bytes.end(), slot.begin());
        status = ring_->publish();
        if (status == frames::RingStatus::Ok) {
          if (++delivered_ % kFramesPerReturn == 0) return_free_memory();
          return true;
        }
      }
      if (status == frames::RingStatus::Gone) ring_.reset();
    }
    return false;
  }

  void finish() override {
    if (ring_) ring_->finish();
  }

 private:
  /// Waits for a player in slices, so that a signal ends the wait; ring_ is empty then.
  void connect() {
    const auto deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(timeout_);
    while (!player::interrupted()) {
      const bool last = Clock::now() + kWaitSlice >= deadline;
      try {
        ring_ = frames::RingRenderer::connect(socket_, hello_, kWaitSlice);
        break;
      } catch (const Error& error) {
        if (error.kind() != ErrorKind::Device || last) throw;
      }
    }
    if (ring_ && ring_->geometry() != geometry_)
      throw input_error("{}: the player's panel has {}x{} pixels, the rig {}x{}", socket_.string(),
                        ring_->geometry().width, ring_->geometry().height, geometry_.width,
                        geometry_.height);
  }

  fs::path socket_;
  frames::FrameGeometry geometry_;
  std::chrono::duration<double> timeout_;
  frames::RendererHello hello_;
  std::unique_ptr<frames::RingRenderer> ring_;
  uint64_t delivered_ = 0;
};

class SequenceOutput final : public FrameOutput {
 public:
  explicit SequenceOutput(const OutputRequest& request)
      : first_(request.range.begin),
        writer_(request.target, request.film,
                {.resume = request.resume, .max_error = request.max_error}) {}

  bool has(uint64_t frame) const override { return frame - first_ < writer_.frame_count(); }

  bool deliver(uint64_t frame, const frames::FrameView& pixels) override {
    LENTICULE_CHECK(frame - first_ == writer_.frame_count());
    writer_.append(pixels);
    return true;
  }

  void finish() override { writer_.finish(); }

 private:
  uint64_t first_;
  frames::SequenceWriter writer_;
};

/// Limit of the numbers to check: an input of unknown length could have any.
constexpr uint64_t kMostPictures = uint64_t{1} << 20;

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw input_error("{}: exists already: {}", file.string(), what)
      .remedy("use another name, or --overwrite");
}

bool may_replace(const OutputRequest& request) { return request.resume || request.overwrite; }

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
  const frames::SequenceInfo& wanted = request.film;
  if (there.geometry != wanted.geometry)
    refuse(file, fmt::format("frames of {}x{} pixels, not of {}x{}", there.geometry.width,
                             there.geometry.height, wanted.geometry.width, wanted.geometry.height));
  if (there.kind != wanted.kind) refuse(file, "contains another kind of frames");
  if (optics::match(frames::rig_of(there), frames::rig_of(wanted)) == optics::RigMatch::Other)
    refuse(file, fmt::format("made for another rig ({})", there.rig_fingerprint));
  if (there.max_error < wanted.max_error)
    refuse(file, fmt::format("its subpixels are off by at most {}, not by {}", there.max_error,
                             wanted.max_error));
  if (!there.made_from.empty() && !wanted.made_from.empty() && there.made_from != wanted.made_from)
    refuse(file, fmt::format("made from {}, not from {}", there.made_from, wanted.made_from));
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

std::string program_version() { return fmt::format("lenticule {}", LENTICULE_VERSION); }

std::unique_ptr<FrameOutput> open_output(const OutputRequest& request) {
  if (player::parse_source(request.target).kind == player::SourceKind::Ring)
    return std::make_unique<RingOutput>(request);
  if (request.target.ends_with(".lts")) {
    require_writable_folder(request.target);
    require_replaceable_film(request);
    return std::make_unique<SequenceOutput>(request);
  }
  if (player::kind_of_file(request.target) != player::SourceKind::Pictures)
    throw usage_error("-o {}: neither a .lts nor pictures", request.target)
        .remedy("use FILE.lts, of which 'lenticule convert' makes a video, or 'out/%05d.png'");
  return std::make_unique<PictureFiles>(request);
}

void say_how_to_resume(const std::string& target) {
  if (!player::interrupted()) return;
  if (target.ends_with(".lts") || frames::FilePattern::looks_like_pattern(target))
    say("{}: unfinished; to go on, repeat the command with --resume, and without --overwrite\n",
        target);
  else if (player::kind_of_file(target) == player::SourceKind::Video)
    say("{}: unfinished, and removed; a .lts could be continued with --resume\n", target);
}

}  // namespace lenticule::tools
