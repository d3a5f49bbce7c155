// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/v4l2_camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <tuple>
#include <utility>

#include "base/error_kinds.h"
#include "frames/capture/capture_stream.h"

namespace lenticule::calib {

namespace {

constexpr Nanoseconds kLongestGrab = std::chrono::hours{1};

Nanoseconds frame_time(double frames_per_second) {
  if (frames_per_second <= 0.0) return Nanoseconds{0};
  return Nanoseconds{std::llround(1e9 / frames_per_second)};
}

void check_options(const V4l2Options& options) {
  for (const auto& [name, value, low, high] :
       {std::tuple("refresh rate in Hz", options.refresh_hz, 1.0, 1000.0),
        {"refreshes per exposure", options.exposure_periods, 1.0, 1000.0},
        {"pictures per second", options.frames_per_second, 0.1, 1000.0},
        {"width", options.width, 0.0, 16384.0},
        {"height", options.height, 0.0, 16384.0},
        {"number of skipped pictures", options.skipped_pictures, 0.0, 1000.0}})
    if (!(value >= low && value <= high))
      throw usage_error("camera: {}: {} is out of range", name, value)
          .remedy(fmt::format("use {} to {}", low, high));
  if (!options.pixel_format.empty() && layout_named(options.pixel_format) == nullptr)
    throw usage_error("camera: pixel format '{}' is not known", options.pixel_format)
        .remedy("YUYV, NV12, RGB3, MJPG, ... as 'lenticule calibrate camera --list' shows them");
}

class V4l2Camera final : public Camera {
 public:
  V4l2Camera(const V4l2Options& options, V4l2System& system, V4l2Node node)
      : node_(std::move(node)), to_skip_(options.skipped_pictures) {
    NodeFacts about;
    device_ = open_camera(system, node_.path, about);
    const AgreedFormat agreed = agree_on_format(*device_, system, node_.path, options);
    unpacker_ = std::make_unique<PixelUnpacker>(agreed.raw, node_.path);
    controls_ = std::make_unique<CameraControls>(*device_, options);
    lock_controls(system);
    stream_ = std::make_unique<CaptureStream>(*device_, system, node_.path);
    stream_->start(system, node_.path);
    lock_controls(system);  // some cameras forget the values at the start
    collect_facts(about, agreed);
    clock_.emplace(controls_->exposure(), frame_time(agreed.frames_per_second));
  }

  [[nodiscard]] const CameraFacts& facts() const override { return facts_; }

  [[nodiscard]] GrabStatus grab(CameraPicture& out, Nanoseconds timeout,
                                Nanoseconds not_before) override {
    if (!stream_) return GrabStatus::Gone;
    const Nanoseconds deadline = now() + std::clamp(timeout, Nanoseconds{0}, kLongestGrab);
    early_ = false;
    GrabStatus status = acquire_picture(out, deadline, not_before);
    while ((to_skip_ > 0 || early_) &&
           (status == GrabStatus::Ready || status == GrabStatus::Corrupt)) {
      if (to_skip_ > 0) --to_skip_;
      status = acquire_picture(out, deadline, not_before);
    }
    if (status == GrabStatus::Gone) close();
    return status;
  }

  [[nodiscard]] Nanoseconds now() const override {
    if (device_) return device_->now();
    return std::chrono::steady_clock::now().time_since_epoch();
  }

  [[nodiscard]] std::vector<std::string> drifted_controls() override {
    if (!controls_) return {failure_};
    return controls_->drifted();
  }

  [[nodiscard]] std::string failure() const override { return failure_; }

 private:
  void lock_controls(V4l2System& system) {
    const int error = controls_->lock();
    if (error != 0) throw camera_failure(system, node_.path, "lock its controls", error);
  }

  void collect_facts(const NodeFacts& node, const AgreedFormat& agreed) {
    facts_ = {.name = node.name,
              .identity = node_.stable_path.empty() ? node.bus : node_.stable_path,
              .width = agreed.raw.width,
              .height = agreed.raw.height,
              .channels = unpacker_->channels(),
              .frames_per_second = agreed.frames_per_second,
              .pixel_format = fourcc_name(agreed.raw.fourcc),
              .unlocked = controls_->unlocked()};
    if (agreed.frames_per_second == 0.0)
      facts_.unlocked.emplace_back("the frame rate is not known");
  }

  [[nodiscard]] GrabStatus acquire_picture(CameraPicture& out, Nanoseconds deadline,
                                           Nanoseconds not_before) {
    CapturedBuffer buffer;
    const GrabStatus status = stream_->acquire(buffer, deadline);
    if (status != GrabStatus::Ready) return status;
    stamp(buffer.stamp, out);
    early_ = out.time < not_before;
    const bool whole = unpack(buffer, out);
    if (!stream_->give_back(buffer.index)) return GrabStatus::Gone;
    return whole ? GrabStatus::Ready : GrabStatus::Corrupt;
  }

  [[nodiscard]] bool unpack(const CapturedBuffer& buffer, CameraPicture& out) {
    if (buffer.damaged) return false;
    return to_skip_ > 0 || early_ || unpacker_->unpack(buffer.bytes, out);
  }

  void stamp(const BufferStamp& stamp, CameraPicture& out) {
    out.sequence = clock_->count(stamp.sequence);
    out.time = clock_->exposed_at(stamp, now());
    if (!clock_->unreliable() || clock_reported_) return;
    clock_reported_ = true;
    facts_.unlocked.emplace_back(
        "no usable timestamps: the time of arrival is used, which may be late");
  }

  /// Returns all resources to the driver, so that the camera can be opened again.
  void close() {
    failure_ = fmt::format("{}: {}", node_.path, stream_->failure());
    stream_.reset();
    controls_.reset();
    device_.reset();
  }

  // Members are destroyed from the last to the first: the stream before its device.
  V4l2Node node_;
  std::unique_ptr<V4l2Device> device_;
  std::unique_ptr<CameraControls> controls_;
  std::unique_ptr<CaptureStream> stream_;
  std::unique_ptr<PixelUnpacker> unpacker_;
  std::optional<ExposureClock> clock_;
  CameraFacts facts_;
  std::string failure_;
  int to_skip_;
  bool early_ = false;  ///< the last picture was exposed before the requested time
  bool clock_reported_ = false;
};

}  // namespace

std::unique_ptr<Camera> open_v4l2_camera(const V4l2Options& options, V4l2System& system) {
  check_options(options);
  return std::make_unique<V4l2Camera>(options, system, find_camera(system, options.device));
}

}  // namespace lenticule::calib
