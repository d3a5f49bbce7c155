// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/v4l2_camera.h"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "calib/cameras/camera_controls.h"
#include "calib/cameras/capture_stream.h"
#include "calib/cameras/format_choice.h"
#include "calib/cameras/pixel_unpack.h"

namespace lenticule::calib {
namespace {

template <size_t N>
std::string text_of(const uint8_t (&bytes)[N]) {
  const char* const text = reinterpret_cast<const char*>(bytes);
  return {text, strnlen(text, N)};
}

/// NodeFacts describes a video node.
struct NodeFacts {
  std::string name;
  std::string bus;
  bool captures = false;  ///< captures pictures into mapped memory
};

/// Queries the node's own capabilities, not those of the whole device: USB cameras have a second
/// node that is not a camera. Returns 0 or errno.
int ask_node(V4l2Device& device, NodeFacts& facts) {
  v4l2_capability capability{};
  const int error = v4l2_call(device, VIDIOC_QUERYCAP, &capability);
  if (error != 0) return error;
  const bool own = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0;
  const uint32_t can = own ? capability.device_caps : capability.capabilities;
  constexpr uint32_t kNeeded = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  facts = {.name = text_of(capability.card),
           .bus = text_of(capability.bus_info),
           .captures = (can & kNeeded) == kNeeded};
  return 0;
}

std::vector<CameraFormat> formats_of(V4l2Device& device) {
  std::vector<CameraFormat> formats;
  for (const FormatOffer& offer : offered_formats(device)) {
    CameraFormat format{.pixel_format = fourcc_name(offer.fourcc),
                        .usable = layout_of(offer.fourcc) != nullptr,
                        .sizes = {}};
    for (const FrameSize& size : offer.sizes)
      format.sizes.push_back(fmt::format("{}x{}", size.width, size.height));
    formats.push_back(std::move(format));
  }
  return formats;
}

/// Returns false for nodes that are not cameras.
bool describe(V4l2System& system, CameraListing& listing) {
  const OpenedDevice opened = system.open(listing.path);
  NodeFacts facts;
  int error = opened.error;
  if (opened.device) error = ask_node(*opened.device, facts);
  if (error != 0) {
    const Error failure = camera_failure(system, listing.path, "open it", error);
    listing.problem = fmt::format("{}; {}", failure.what(), failure.hint());
    return true;
  }
  if (!facts.captures) return false;
  listing.name = facts.name;
  listing.bus = facts.bus;
  listing.formats = formats_of(*opened.device);
  return true;
}

V4l2Node only_camera(V4l2System& system) {
  const std::vector<CameraListing> cameras = list_cameras(system);
  if (cameras.empty())
    throw Error(ErrorKind::Device, "camera: none is connected",
                "connect one; 'ls /dev/video*' lists the kernel's video devices");
  if (cameras.size() == 1)
    return {.path = cameras.front().path, .stable_path = cameras.front().stable_path};
  std::string names;
  for (const CameraListing& camera : cameras)
    names += (names.empty() ? "" : ", ") +
             (camera.stable_path.empty() ? camera.path : camera.stable_path);
  throw Error(ErrorKind::Usage, "camera: several are connected",
              "choose one with --device: " + names);
}

/// Returns the last component of a path.
std::string leaf(const std::string& path) {
  return path.substr(path.rfind('/') + 1);
}

}  // namespace

V4l2Node find_camera(V4l2System& system, const std::string& wanted) {
  if (wanted.empty()) return only_camera(system);
  for (const V4l2Node& node : system.nodes())
    if (wanted == node.path || wanted == node.stable_path || wanted == leaf(node.path) ||
        wanted == leaf(node.stable_path))
      return node;
  if (wanted.find('/') != std::string::npos) return {.path = wanted, .stable_path = {}};
  throw Error(ErrorKind::Device, fmt::format("camera: none is called '{}'", wanted),
              "'lenticule calibrate camera --list' lists the cameras");
}

std::vector<CameraListing> list_cameras() {
  return list_cameras(linux_v4l2());
}

std::vector<CameraListing> list_cameras(V4l2System& system) {
  std::vector<CameraListing> cameras;
  for (const V4l2Node& node : system.nodes()) {
    CameraListing listing;
    listing.path = node.path;
    listing.stable_path = node.stable_path;
    if (describe(system, listing)) cameras.push_back(std::move(listing));
  }
  return cameras;
}

namespace {

constexpr Nanoseconds kLongestGrab = std::chrono::hours{1};

Nanoseconds frame_time(double frames_per_second) {
  if (frames_per_second <= 0.0) return Nanoseconds{0};
  return Nanoseconds{std::llround(1e9 / frames_per_second)};
}

void check_options(const V4l2Options& options) {
  const auto in = [](double value, double low, double high) {
    return value >= low && value <= high;
  };
  if (!in(options.refresh_hz, 1.0, 1000.0) || !in(options.exposure_periods, 1, 1000) ||
      !in(options.frames_per_second, 0.1, 1000.0) || !in(options.width, 0, 16384) ||
      !in(options.height, 0, 16384) || !in(options.skipped_pictures, 0, 1000))
    throw Error(
        ErrorKind::Usage, "camera: an option is out of range",
        "refresh and frame rate up to 1000 Hz, exposures of 1 to 1000 refreshes, sides up to "
        "16384");
  if (!options.pixel_format.empty() && layout_named(options.pixel_format) == nullptr)
    throw Error(ErrorKind::Usage,
                fmt::format("camera: pixel format '{}' is not known", options.pixel_format),
                "YUYV, NV12, RGB3, MJPG, ... as 'lenticule calibrate camera --list' shows them");
}

std::unique_ptr<V4l2Device> open_node(V4l2System& system, const V4l2Node& node, NodeFacts& facts) {
  OpenedDevice opened = system.open(node.path);
  int error = opened.error;
  if (opened.device) error = ask_node(*opened.device, facts);
  if (error != 0) throw camera_failure(system, node.path, "open it", error);
  if (!facts.captures)
    throw Error(ErrorKind::Device, node.path + ": not a camera",
                "a USB camera has a second node for other data; use the other one");
  return std::move(opened.device);
}

class V4l2Camera final : public Camera {
 public:
  V4l2Camera(const V4l2Options& options, V4l2System& system, V4l2Node node);

  [[nodiscard]] const CameraFacts& facts() const override { return facts_; }
  [[nodiscard]] GrabStatus grab(CameraPicture& out, Nanoseconds timeout,
                                Nanoseconds not_before) override;
  [[nodiscard]] Nanoseconds now() const override;
  [[nodiscard]] std::vector<std::string> drifted_controls() override;
  [[nodiscard]] std::string failure() const override { return failure_; }

 private:
  void lock_controls(V4l2System& system);
  void collect_facts(const NodeFacts& node, const AgreedFormat& agreed);
  [[nodiscard]] GrabStatus acquire_picture(CameraPicture& out, Nanoseconds deadline,
                                           Nanoseconds not_before);
  [[nodiscard]] bool unpack(const CapturedBuffer& buffer, CameraPicture& out);
  void stamp(const BufferStamp& stamp, CameraPicture& out);
  void close();

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

V4l2Camera::V4l2Camera(const V4l2Options& options, V4l2System& system, V4l2Node node)
    : node_(std::move(node)), to_skip_(options.skipped_pictures) {
  NodeFacts about;
  device_ = open_node(system, node_, about);
  const AgreedFormat agreed = agree_on_format(*device_, system, node_.path,
                                              {.width = options.width,
                                               .height = options.height,
                                               .frames_per_second = options.frames_per_second,
                                               .pixel_format = options.pixel_format});
  unpacker_ = std::make_unique<PixelUnpacker>(agreed.raw, node_.path);
  controls_ = std::make_unique<CameraControls>(
      *device_, ControlRequests{.refresh_hz = options.refresh_hz,
                                .exposure_periods = options.exposure_periods,
                                .gain = options.gain,
                                .white_balance_kelvin = options.white_balance_kelvin,
                                .focus = options.focus});
  lock_controls(system);
  stream_ = std::make_unique<CaptureStream>(*device_, system, node_.path);
  stream_->start(system, node_.path);
  lock_controls(system);  // some cameras forget the values at the start
  collect_facts(about, agreed);
  clock_.emplace(controls_->exposure(), frame_time(agreed.frames_per_second));
}

void V4l2Camera::lock_controls(V4l2System& system) {
  const int error = controls_->lock();
  if (error != 0) throw camera_failure(system, node_.path, "lock its controls", error);
}

void V4l2Camera::collect_facts(const NodeFacts& node, const AgreedFormat& agreed) {
  facts_ = {.name = node.name,
            .identity = node_.stable_path.empty() ? node.bus : node_.stable_path,
            .width = agreed.raw.width,
            .height = agreed.raw.height,
            .channels = unpacker_->channels(),
            .frames_per_second = agreed.frames_per_second,
            .pixel_format = fourcc_name(agreed.raw.fourcc),
            .unlocked = controls_->unlocked()};
  if (agreed.frames_per_second == 0.0) facts_.unlocked.emplace_back("the frame rate is not known");
}

GrabStatus V4l2Camera::grab(CameraPicture& out, Nanoseconds timeout, Nanoseconds not_before) {
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

GrabStatus V4l2Camera::acquire_picture(CameraPicture& out, Nanoseconds deadline,
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

bool V4l2Camera::unpack(const CapturedBuffer& buffer, CameraPicture& out) {
  if (buffer.damaged) return false;
  return to_skip_ > 0 || early_ || unpacker_->unpack(buffer.bytes, out);
}

void V4l2Camera::stamp(const BufferStamp& stamp, CameraPicture& out) {
  out.sequence = clock_->count(stamp.sequence);
  out.time = clock_->exposed_at(stamp, now());
  if (!clock_->unreliable() || clock_reported_) return;
  clock_reported_ = true;
  facts_.unlocked.emplace_back(
      "no usable timestamps: the time of arrival is used, which may be late");
}

/// Returns all resources to the driver, so that the camera can be opened again.
void V4l2Camera::close() {
  failure_ = fmt::format("{}: {}", node_.path, stream_->failure());
  stream_.reset();
  controls_.reset();
  device_.reset();
}

Nanoseconds V4l2Camera::now() const {
  if (device_) return device_->now();
  return std::chrono::steady_clock::now().time_since_epoch();
}

std::vector<std::string> V4l2Camera::drifted_controls() {
  if (!controls_) return {failure_};
  return controls_->drifted();
}

}  // namespace

std::unique_ptr<Camera> open_v4l2_camera(const V4l2Options& options) {
  return open_v4l2_camera(options, linux_v4l2());
}

std::unique_ptr<Camera> open_v4l2_camera(const V4l2Options& options, V4l2System& system) {
  check_options(options);
  return std::make_unique<V4l2Camera>(options, system, find_camera(system, options.device));
}

}  // namespace lenticule::calib
