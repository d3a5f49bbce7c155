// SPDX-License-Identifier: Apache-2.0
// PictureMaker makes JPEG pictures of the displayed frame, as it is and as an eye sees it. The
// simulation runs in this process, so that it takes no time from the player.
#pragma once

#include <fmt/format.h>
#include <sys/stat.h>
#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "apps/lenticule-web/http/access.h"
#include "apps/lenticule-web/http/message.h"
#include "apps/lenticule-web/link/control_link.h"
#include "base/error_kinds.h"
#include "frames/charts/charts.h"
#include "frames/frame.h"
#include "frames/ring/ring_layout.h"
#include "optics/eye_simulator.h"
#include "optics/model.h"
#include "optics/rig.h"
#include "optics/rig_file.h"

namespace lenticule::web {

/// SharedFrame is a copy of the frame that the player shares.
struct SharedFrame {
  frames::FrameGeometry geometry;
  size_t row_bytes = 0;
  std::vector<uint8_t> pixels;
  std::string rig_toml;
  uint64_t number = 0;
};

/// Thread safety: any thread. One picture is made at a time, so that pages take at most one core.
class PictureMaker {
 public:
  explicit PictureMaker(ControlLink& link) : link_(link) {}

  static constexpr int kMinWidth = 64;
  static constexpr int kMaxWidth = 1920;

  /// Return JPEG files. Throw Error, and HttpError 403 for a frame that shows a code to a sender
  /// who may not change anything: the code may hold a token that may.
  [[nodiscard]] std::string frame(int width, Rights rights) {
    const std::lock_guard one(one_picture_);
    const auto taken = take_frame_for(rights);
    return jpeg_of(reduced(taken->frame, std::clamp(width, kMinWidth, kMaxWidth)), kQuality);
  }
  [[nodiscard]] std::string eye(const optics::Eye& eye, int width, Rights rights) {
    const std::lock_guard one(one_picture_);
    const auto taken = take_frame_for(rights);
    const frames::FrameGeometry& size = taken->frame.geometry;
    width = std::clamp(width, std::min(kMinWidth, size.width), std::min(kMaxWidth, size.width));
    return jpeg_of(
        seen(*taken->model, taken->frame.pixels.data(), size, taken->frame.row_bytes, eye, width),
        kQuality);
  }
  /// Returns the optical model of the rig, with its trim, for which frames are woven now.
  [[nodiscard]] optics::OpticalModel model() { return *take_frame(std::chrono::seconds(2))->model; }
  /// Returns the text of that rig file.
  [[nodiscard]] std::string rig_toml() {
    return take_frame(std::chrono::seconds(2))->frame.rig_toml;
  }

  /// Copies the content of the memory that came with `answer`, the answer to `frame`. Throws
  /// Error(Failed) if the memory is smaller than the answer states, or changes all the time.
  [[nodiscard]] static SharedFrame copy_shared_frame(const nlohmann::ordered_json& answer,
                                                     int descriptor) {
    SharedFrame frame;
    const size_t width = number_in(answer, "width"), height = number_in(answer, "height");
    if (width == 0 || height == 0 || width > optics::kMaxPanelPixels ||
        height > optics::kMaxPanelPixels)
      fail("the player stated an absurd size");
    frame.geometry = {.width = static_cast<int>(width), .height = static_cast<int>(height)};
    frame.row_bytes = number_in(answer, "row_bytes");
    if (frame.row_bytes < width * 3 || frame.row_bytes > width * 16) fail("absurd rows");
    frame.number = number_in(answer, "frame");
    const SharedMemory memory(descriptor);
    const size_t bytes = frame.row_bytes * height;
    const uint8_t* const pixels = memory.at(number_in(answer, "pixels_at"), bytes);
    const size_t rig_bytes = number_in(answer, "rig_bytes");
    const uint8_t* const rig = memory.at(number_in(answer, "rig_at"), rig_bytes);
    const uint64_t wanted = number_in(answer, "serial");
    frame.pixels.assign(pixels, pixels + bytes);
    frame.rig_toml.assign(reinterpret_cast<const char*>(rig), rig_bytes);
    if (memory.serial() != wanted) fail("the frame was replaced while it was read");
    return frame;
  }

  /// Returns the picture with the average of each block of pixels; `width` is at most the frame's.
  [[nodiscard]] static optics::RgbPicture reduced(const SharedFrame& frame, int width) {
    width = std::clamp(width, 1, frame.geometry.width);
    const int height = height_of(frame.geometry, width);
    optics::RgbPicture picture{.width = width, .height = height, .pixels = {}};
    picture.pixels.resize(size_t{3} * static_cast<size_t>(width) * static_cast<size_t>(height));
    const auto edge = [](int k, int parts, int whole) {
      return static_cast<int>(static_cast<int64_t>(k) * whole / parts);
    };
    uint8_t* out = picture.pixels.data();
    for (int j = 0; j < height; ++j) {
      const int top = edge(j, height, frame.geometry.height);
      const int bottom = std::max(top + 1, edge(j + 1, height, frame.geometry.height));
      for (int i = 0; i < width; ++i) {
        const int left = edge(i, width, frame.geometry.width);
        const int right = std::max(left + 1, edge(i + 1, width, frame.geometry.width));
        std::array<uint32_t, 3> sum{};
        for (int y = top; y < bottom; ++y) {
          const uint8_t* in = frame.pixels.data() + static_cast<size_t>(y) * frame.row_bytes +
                              size_t{3} * static_cast<size_t>(left);
          for (int x = left; x < right; ++x, in += 3)
            for (size_t c = 0; c < 3; ++c) sum[c] += in[c];
        }
        const auto count = static_cast<uint32_t>((bottom - top) * (right - left));
        for (size_t c = 0; c < 3; ++c) *out++ = static_cast<uint8_t>((sum[c] + count / 2) / count);
      }
    }
    return picture;
  }

  [[nodiscard]] static std::string jpeg_of(const optics::RgbPicture& picture, int quality) {
    struct Deleter {
      void operator()(void* handle) const { (void)tjDestroy(handle); }
      void operator()(unsigned char* bytes) const { tjFree(bytes); }
    };
    const std::unique_ptr<void, Deleter> encoder(tjInitCompress());
    unsigned char* bytes = nullptr;
    unsigned long size = 0;
    const int failed =
        encoder == nullptr
            ? -1
            : tjCompress2(encoder.get(), picture.pixels.data(), picture.width, 0, picture.height,
                          TJPF_RGB, &bytes, &size, TJSAMP_420, quality, TJFLAG_FASTDCT);
    const std::unique_ptr<unsigned char, Deleter> owned(bytes);
    if (failed != 0) fail("the picture cannot be encoded");
    return {reinterpret_cast<const char*>(bytes), size};
  }

  /// Returns, as JPEG, what the eye sees of a chart that is white for this eye only. The chart is
  /// woven with the rig `woven` and seen through the sheet of the rig `sheet`, to compare both.
  [[nodiscard]] static std::string comb_picture(const optics::Rig& woven, const optics::Rig& sheet,
                                                const optics::Eye& eye) {
    const frames::WovenFrame chart =
        frames::draw_chart({.pattern = frames::ChartPattern::Comb, .rig = white_for(woven, eye)});
    return jpeg_of(without_colour(seen(optics::OpticalModel(sheet), chart.bytes().data(),
                                       chart.geometry(), chart.geometry().row_bytes(), eye,
                                       std::min(kCombWidth, chart.width()))),
                   kQuality);
  }

 private:
  using milliseconds = std::chrono::milliseconds;
  using steady_clock = std::chrono::steady_clock;
  /// A picture may show a frame that is this old, so that several pages cost the player one copy.
  static constexpr auto kFreshEnough = milliseconds(300);
  static constexpr int kTries = 5;
  static constexpr int kQuality = 85;

  [[noreturn]] static void fail(const std::string& cause) {
    throw failed_error("picture: {}", cause);
  }

  /// Returns the height of a picture of the same shape that is `width` pixels wide.
  static int height_of(const frames::FrameGeometry& size, int width) {
    return std::max(1, static_cast<int>(int64_t{size.height} * width / size.width));
  }
  static optics::RgbPicture seen(const optics::OpticalModel& model, const uint8_t* pixels,
                                 const frames::FrameGeometry& size, size_t row_bytes,
                                 const optics::Eye& eye, int width) {
    return optics::simulate_eye(
        model,
        {.pixels = pixels, .width = size.width, .height = size.height, .stride_bytes = row_bytes},
        eye, {.width = width, .height = height_of(size, width)});
  }

  static size_t number_in(const nlohmann::ordered_json& answer, const char* key) {
    const nlohmann::ordered_json& value = member(answer, key);
    if (!value.is_number_unsigned()) fail(fmt::format("the player did not state {}", key));
    return value.get<size_t>();
  }

  /// SharedMemory is memory that another process shares for reading.
  class SharedMemory {
   public:
    explicit SharedMemory(int descriptor) {
      struct stat status {};
      if (::fstat(descriptor, &status) != 0 || status.st_size <= 0) fail("no shared memory");
      mapping_ = frames::Mapping(descriptor, 0, static_cast<size_t>(status.st_size), PROT_READ);
      if (!mapping_) fail("the shared memory cannot be mapped");
    }

    /// Returns `bytes` bytes at `at`; throws if the memory is smaller.
    [[nodiscard]] const uint8_t* at(size_t at, size_t bytes) const {
      const auto all = mapping_.bytes();
      if (at > all.size() || bytes > all.size() - at) fail("the shared memory is too small");
      return all.data() + at;
    }
    [[nodiscard]] uint64_t serial() const {
      std::atomic_thread_fence(std::memory_order_seq_cst);
      uint64_t serial = 0;
      std::memcpy(&serial, at(0, sizeof serial), sizeof serial);
      std::atomic_thread_fence(std::memory_order_seq_cst);
      return serial;
    }

   private:
    frames::Mapping mapping_;
  };
  static constexpr int kCombWidth = 960;

  /// Returns the rig whose comb is white for the eye: that of a rig is white for an eye straight
  /// ahead, at its viewing line.
  static optics::Rig white_for(optics::Rig rig, const optics::Eye& eye) {
    constexpr int kGreen = 1;
    rig.viewing = {Millimetres(eye.y), Millimetres(eye.z_mm)};
    const optics::OpticalModel model(rig);
    const double x = 0.5 * rig.panel.width_px, y = 0.5 * rig.panel.height_px;
    const optics::Eye ahead{.x = 0.0, .y = eye.y, .z_mm = eye.z_mm};
    rig.sheet.offset = rig.sheet.offset +
                       Lenses(model.phase(x, y, kGreen, eye) - model.phase(x, y, kGreen, ahead));
    return rig;
  }

  /// Adds the channels: through a fine lens an eye sees one subpixel, of one colour, at each place.
  static optics::RgbPicture without_colour(optics::RgbPicture picture) {
    for (size_t k = 0; k + 2 < picture.pixels.size(); k += 3) {
      const int sum = picture.pixels[k] + picture.pixels[k + 1] + picture.pixels[k + 2];
      std::fill_n(picture.pixels.begin() + static_cast<ptrdiff_t>(k), 3,
                  static_cast<uint8_t>(std::min(sum, 255)));
    }
    return picture;
  }
  /// Taken is a frame and the optical model of its rig.
  struct Taken {
    SharedFrame frame;
    bool shows_code = false;
    std::shared_ptr<const optics::OpticalModel> model;
  };
  [[nodiscard]] std::shared_ptr<const Taken> take_frame(std::chrono::milliseconds oldest) {
    const std::lock_guard lock(mutex_);
    if (taken_ && steady_clock::now() - taken_at_ <= oldest) return taken_;
    auto taken = std::make_shared<Taken>();
    const bool showed_code = panel_shows_code();
    for (int tries = 1;; ++tries) {
      try {
        const ControlLink::Answer answer = link_.ask({{"do", "frame"}});
        if (!answer.descriptor) fail("the player sent no shared memory");
        taken->frame = copy_shared_frame(answer.body, answer.descriptor.get());
        break;
      } catch (const Error& error) {
        // Another client may have asked for a frame meanwhile.
        const bool again = error.kind() == ErrorKind::Failed && tries < kTries &&
                           std::string(error.what()).find("was replaced") != std::string::npos;
        if (!again) throw;
      }
    }
    taken->shows_code = showed_code || panel_shows_code();
    const bool same_rig = taken_ && taken_->frame.rig_toml == taken->frame.rig_toml;
    taken->model = same_rig ? taken_->model
                            : std::make_shared<const optics::OpticalModel>(
                                  optics::parse_rig(taken->frame.rig_toml, "the player's rig"));
    taken_ = taken;
    taken_at_ = steady_clock::now();
    return taken;
  }
  [[nodiscard]] std::shared_ptr<const Taken> take_frame_for(Rights rights) {
    auto taken = take_frame(kFreshEnough);
    if (taken->shows_code && rights != Rights::Change)
      throw HttpError(403, "the panel shows the code of an address", "wait until it ends");
    return taken;
  }
  [[nodiscard]] bool panel_shows_code() {
    return shown_instead(link_.ask({{"do", "status"}}).body) == "code";
  }

  ControlLink& link_;
  std::mutex one_picture_;  ///< held while a picture is made
  std::mutex mutex_;        ///< guards the members below
  std::shared_ptr<const Taken> taken_;
  std::chrono::steady_clock::time_point taken_at_{};
};

}  // namespace lenticule::web
