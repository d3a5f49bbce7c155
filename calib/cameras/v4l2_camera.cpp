// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/v4l2_camera.h"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <tuple>
#include <utility>

#include "base/error.h"
#include "calib/cameras/capture_stream.h"

namespace lenticule::calib {

// ---- format

namespace {

constexpr uint32_t kMostFormats = 256;
constexpr uint32_t kMostSizes = 256;
constexpr FrameSize kUsualSize{.width = 1920, .height = 1080};

FrameSize wanted_size(const FormatRequest& request) {
  return request.width > 0 && request.height > 0 ? FrameSize{request.width, request.height}
                                                 : kUsualSize;
}

double pixels(const FrameSize& size) {
  return static_cast<double>(size.width) * size.height;
}

/// Converts a driver's number; returns 0 if it does not fit.
int side(uint32_t length) {
  return length <= static_cast<uint32_t>(std::numeric_limits<int>::max()) ? static_cast<int>(length)
                                                                          : 0;
}

/// Returns the difference of two sizes, as factors of width and height.
double unlikeness(const FrameSize& a, const FrameSize& b) {
  if (a.width <= 0 || a.height <= 0) return std::numeric_limits<double>::infinity();
  return std::abs(std::log(static_cast<double>(a.width) / b.width)) +
         std::abs(std::log(static_cast<double>(a.height) / b.height));
}

std::vector<FrameSize> offered_sizes(V4l2Device& device, uint32_t fourcc) {
  std::vector<FrameSize> sizes;
  for (uint32_t i = 0; i < kMostSizes; ++i) {
    v4l2_frmsizeenum size{};
    size.index = i;
    size.pixel_format = fourcc;
    if (v4l2_call(device, VIDIOC_ENUM_FRAMESIZES, &size) != 0) break;
    if (size.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
      sizes.push_back({side(size.discrete.width), side(size.discrete.height)});
      continue;
    }
    sizes.push_back({side(size.stepwise.max_width), side(size.stepwise.max_height)});
    break;
  }
  return sizes;
}

v4l2_format asked_format(uint32_t fourcc, const FrameSize& size) {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  format.fmt.pix.width = static_cast<uint32_t>(size.width);
  format.fmt.pix.height = static_cast<uint32_t>(size.height);
  format.fmt.pix.pixelformat = fourcc;
  format.fmt.pix.field = V4L2_FIELD_NONE;
  format.fmt.pix.priv = V4L2_PIX_FMT_PRIV_MAGIC;  // declares that we use the extended fields
  return format;
}

/// Returns the size nearest to the requested one: as the driver answers, unless the driver only
/// lists discrete sizes.
FrameSize nearest_size(V4l2Device& device, const FormatOffer& offer, const FrameSize& wanted) {
  v4l2_format format = asked_format(offer.fourcc, wanted);
  FrameSize best{};
  if (v4l2_call(device, VIDIOC_TRY_FMT, &format) == 0 && format.fmt.pix.pixelformat == offer.fourcc)
    best = {side(format.fmt.pix.width), side(format.fmt.pix.height)};
  for (const FrameSize& size : offer.sizes)
    if (unlikeness(size, wanted) < unlikeness(best, wanted)) best = size;
  return best.width > 0 ? best : wanted;
}

struct Candidate {
  uint32_t fourcc;
  FrameSize size;
  bool large_enough;
};

/// Returns the candidates in the order in which they are tried.
std::vector<Candidate> candidates(V4l2Device& device, const FormatRequest& request) {
  const std::vector<FormatOffer> offers = offered_formats(device);
  const FrameSize wanted = wanted_size(request);
  std::vector<Candidate> found;
  for (const PixelLayout& layout : supported_layouts()) {
    if (!request.pixel_format.empty() && fourcc_name(layout.fourcc) != request.pixel_format)
      continue;
    for (const FormatOffer& offer : offers) {
      if (offer.fourcc != layout.fourcc) continue;
      const FrameSize size = nearest_size(device, offer, wanted);
      found.push_back({offer.fourcc, size, pixels(size) >= 0.5 * pixels(wanted)});
      break;
    }
  }
  std::stable_partition(found.begin(), found.end(),
                        [](const Candidate& candidate) { return candidate.large_enough; });
  return found;
}

[[noreturn]] void refuse_offer(V4l2Device& device, const std::string& path,
                               const FormatRequest& request) {
  std::string names;
  for (const FormatOffer& offer : offered_formats(device))
    names += (names.empty() ? "" : ", ") + fourcc_name(offer.fourcc);
  if (names.empty()) names = "nothing";
  const std::string wanted =
      request.pixel_format.empty() ? "no known pixel format" : "no " + request.pixel_format;
  throw Error(ErrorKind::Device, fmt::format("{}: {} among {}", path, wanted, names),
              request.pixel_format.empty() ? "use another camera" : "use one of those");
}

/// Sets inputs for HDMI and similar to the size of the arriving signal, which they adopt only on
/// request.
void follow_signal(V4l2Device& device, V4l2System& system, const std::string& path) {
  v4l2_dv_timings timings{};
  const int error = v4l2_call(device, VIDIOC_QUERY_DV_TIMINGS, &timings);
  if (error == ENOLINK || error == ENOLCK || error == ERANGE)
    throw Error(ErrorKind::Device, path + ": no usable signal: " + error_text(error),
                "switch on the device that is connected to this input");
  if (error != 0) return;  // a camera with its own timing
  const int refused = v4l2_call(device, VIDIOC_S_DV_TIMINGS, &timings);
  if (refused != 0) throw camera_failure(system, path, "follow the signal", refused);
}

void require_progressive(const v4l2_pix_format& got, const std::string& path) {
  if (got.field == V4L2_FIELD_NONE || got.field == V4L2_FIELD_ANY) return;
  throw Error(ErrorKind::Device, path + ": the pictures are interlaced",
              "choose a progressive mode, or use another camera");
}

RawFormat raw_format(const v4l2_pix_format& got) {
  const bool extended =
      got.priv == V4L2_PIX_FMT_PRIV_MAGIC;  // else the extended fields are undefined
  return {.fourcc = got.pixelformat,
          .width = side(got.width),
          .height = side(got.height),
          .bytes_per_line = got.bytesperline,
          .coding = {.colorspace = got.colorspace,
                     .ycbcr_enc = extended ? got.ycbcr_enc : 0,
                     .quantization = extended ? got.quantization : 0,
                     .xfer_func = extended ? got.xfer_func : 0}};
}

/// Returns the format that the driver made of the request; none if that format cannot be unpacked.
std::optional<RawFormat> try_candidate(V4l2Device& device, V4l2System& system,
                                       const std::string& path, const Candidate& candidate) {
  v4l2_format format = asked_format(candidate.fourcc, candidate.size);
  const int error = v4l2_call(device, VIDIOC_S_FMT, &format);
  if (error == EINVAL) return std::nullopt;
  if (error != 0) throw camera_failure(system, path, "set the format", error);
  if (layout_of(format.fmt.pix.pixelformat) == nullptr) return std::nullopt;
  require_progressive(format.fmt.pix, path);
  return raw_format(format.fmt.pix);
}

double agree_on_rate(V4l2Device& device, double wanted) {
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  v4l2_fract& interval = parameters.parm.capture.timeperframe;
  interval = {.numerator = 1000,
              .denominator = static_cast<uint32_t>(std::clamp(wanted, 0.1, 1000.0) * 1000.0)};
  if (v4l2_call(device, VIDIOC_S_PARM, &parameters) != 0) return 0.0;
  if ((parameters.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) == 0) return 0.0;
  if (interval.numerator == 0 || interval.denominator == 0) return 0.0;
  return static_cast<double>(interval.denominator) / interval.numerator;
}

}  // namespace

std::vector<FormatOffer> offered_formats(V4l2Device& device) {
  std::vector<FormatOffer> offers;
  for (uint32_t i = 0; i < kMostFormats; ++i) {
    v4l2_fmtdesc description{};
    description.index = i;
    description.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (v4l2_call(device, VIDIOC_ENUM_FMT, &description) != 0) break;
    offers.push_back({.fourcc = description.pixelformat,
                      .sizes = offered_sizes(device, description.pixelformat)});
  }
  return offers;
}

AgreedFormat agree_on_format(V4l2Device& device, V4l2System& system, const std::string& path,
                             const FormatRequest& request) {
  follow_signal(device, system, path);
  for (const Candidate& candidate : candidates(device, request)) {
    const std::optional<RawFormat> raw = try_candidate(device, system, path, candidate);
    if (!raw || (!request.pixel_format.empty() && fourcc_name(raw->fourcc) != request.pixel_format))
      continue;
    return {.raw = *raw, .frames_per_second = agree_on_rate(device, request.frames_per_second)};
  }
  refuse_offer(device, path, request);
}

// ---- list of cameras

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

/// Opens a node and queries its own capabilities, not those of the whole device: USB cameras have a
/// second node that is not a camera. Returns 0 or errno.
int open_node(V4l2System& system, const std::string& path, std::unique_ptr<V4l2Device>& device,
              NodeFacts& facts) {
  OpenedDevice opened = system.open(path);
  if (!opened.device) return opened.error;
  device = std::move(opened.device);
  v4l2_capability capability{};
  const int error = v4l2_call(*device, VIDIOC_QUERYCAP, &capability);
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
  std::unique_ptr<V4l2Device> device;
  NodeFacts facts;
  if (const int error = open_node(system, listing.path, device, facts); error != 0) {
    const Error failure = camera_failure(system, listing.path, "open it", error);
    listing.problem = fmt::format("{}; {}", failure.what(), failure.hint());
    return true;
  }
  if (!facts.captures) return false;
  listing.name = facts.name;
  listing.bus = facts.bus;
  listing.formats = formats_of(*device);
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

// ---- camera

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
      throw Error(ErrorKind::Usage, fmt::format("camera: {}: {} is out of range", name, value),
                  fmt::format("use {} to {}", low, high));
  if (!options.pixel_format.empty() && layout_named(options.pixel_format) == nullptr)
    throw Error(ErrorKind::Usage,
                fmt::format("camera: pixel format '{}' is not known", options.pixel_format),
                "YUYV, NV12, RGB3, MJPG, ... as 'lenticule calibrate camera --list' shows them");
}

class V4l2Camera final : public Camera {
 public:
  V4l2Camera(const V4l2Options& options, V4l2System& system, V4l2Node node)
      : node_(std::move(node)), to_skip_(options.skipped_pictures) {
    NodeFacts about;
    if (const int error = open_node(system, node_.path, device_, about); error != 0)
      throw camera_failure(system, node_.path, "open it", error);
    if (!about.captures)
      throw Error(ErrorKind::Device, node_.path + ": not a camera",
                  "a USB camera has a second node for other data; use the other one");
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
