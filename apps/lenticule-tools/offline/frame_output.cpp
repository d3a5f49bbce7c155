// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/frame_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>

#include "apps/lenticule-tools/offline/existing_output.h"
#include "apps/lenticule-tools/offline/sequence_output.h"
#include "base/error.h"
#include "base/large_memory.h"
#include "base/temporary.h"
#include "frames/image_io.h"
#include "frames/ring/ring_renderer.h"
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
  explicit PictureFiles(const OutputRequest& request) : geometry_(request.geometry) {
    if (frames::FilePattern::looks_like_pattern(request.target)) {
      pattern_.emplace(request.target);
    } else if (request.range.count() > 1) {
      throw Error(
          ErrorKind::Usage,
          fmt::format("-o {}: one name for {} frames", request.target, request.range.count()),
          "use a number in the name, for example -o 'out/%05d.png'");
    }
    single_ = request.target;
    frames::check_writable_format(file(request.range.begin));
    require_writable_folder(file(request.range.begin));
    require_replaceable_pictures(request, geometry_, [this](uint64_t n) { return file(n); });
  }

  bool has(uint64_t frame) const override {
    if (!fs::exists(file(frame))) return false;
    try {
      return frames::probe_image(file(frame)) == geometry_;
    } catch (const Error&) {
      return false;  // not a complete picture: render it again
    }
  }

  Delivery deliver(uint64_t frame, const frames::FrameView& pixels) override {
    frames::write_woven(pixels, file(frame));
    return Delivery::Done;
  }

  void finish() override {}

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
        geometry_(request.geometry),
        timeout_(request.ring_timeout_seconds) {
    if (socket_.empty())
      throw Error(ErrorKind::Usage, "-o ring: the socket is missing",
                  "for example -o ring:/run/x.sock");
    hello_.rig_fingerprint = optics::to_text(request.rig);
    hello_.rate = request.rate;
    hello_.frame_count = request.range.count();
    connect();
  }

  bool has(uint64_t) const override { return false; }

  Delivery deliver(uint64_t frame, const frames::FrameView& pixels) override {
    while (!player::interrupted()) {
      // Connects again if the player was restarted meanwhile; it receives this frame first.
      if (!ring_) connect();
      if (!ring_) break;
      std::span<uint8_t> slot;
      frames::RingStatus status = ring_->acquire(frame, kWaitSlice, slot);
      if (status == frames::RingStatus::Ok) {
        if (slot.size() < pixels.bytes.size())
          throw Error(ErrorKind::Input,
                      fmt::format("{}: the slots are too small for a frame", socket_.string()));
        std::copy(pixels.bytes.begin(), pixels.bytes.end(), slot.begin());
        status = ring_->publish();
        if (status == frames::RingStatus::Ok) {
          if (++delivered_ % kFramesPerReturn == 0) return_free_memory();
          return Delivery::Done;
        }
      }
      if (status == frames::RingStatus::Gone) ring_.reset();
    }
    return Delivery::Interrupted;
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
      throw Error(ErrorKind::Input,
                  fmt::format("{}: the player's panel has {}x{} pixels, the rig {}x{}",
                              socket_.string(), ring_->geometry().width, ring_->geometry().height,
                              geometry_.width, geometry_.height));
  }

  fs::path socket_;
  frames::FrameGeometry geometry_;
  std::chrono::duration<double> timeout_;
  frames::RendererHello hello_;
  std::unique_ptr<frames::RingRenderer> ring_;
  uint64_t delivered_ = 0;
};

}  // namespace

std::unique_ptr<FrameOutput> open_output(const OutputRequest& request) {
  if (player::parse_source(request.target).kind == player::SourceKind::Ring)
    return std::make_unique<RingOutput>(request);
  if (request.target.ends_with(".lts")) {
    require_writable_folder(request.target);
    require_replaceable_film(request);
    return open_sequence_output(request);
  }
  if (player::kind_of_file(request.target) != player::SourceKind::Pictures)
    throw Error(ErrorKind::Usage, fmt::format("-o {}: neither a .lts nor pictures", request.target),
                "use FILE.lts, of which 'lenticule convert' makes a video, or 'out/%05d.png'");
  return std::make_unique<PictureFiles>(request);
}

}  // namespace lenticule::tools
