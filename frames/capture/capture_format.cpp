// SPDX-License-Identifier: Apache-2.0
#include "frames/capture/capture_format.h"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "base/error_kinds.h"

namespace lenticule::frames::capture {

// ---- format

namespace {

constexpr uint32_t kMostFormats = 256;
constexpr uint32_t kMostSizes = 256;
constexpr uint32_t kMostIntervals = 64;
constexpr FrameSize kUsualSize{.width = 1920, .height = 1080};
/// Formats for a display, best first.
constexpr std::array kDisplayed = {V4L2_PIX_FMT_RGB24, V4L2_PIX_FMT_BGR24, V4L2_PIX_FMT_YUYV,
                                   V4L2_PIX_FMT_UYVY,  V4L2_PIX_FMT_NV12,  V4L2_PIX_FMT_MJPEG,
                                   V4L2_PIX_FMT_JPEG,  V4L2_PIX_FMT_GREY};

FrameSize wanted_size(const FormatRequest& request) {
  if (request.width > 0 && request.height > 0) return {request.width, request.height};
  return request.display.width > 0 ? request.display : kUsualSize;
}

double pixels(const FrameSize& size) { return static_cast<double>(size.width) * size.height; }

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
  double cost;  ///< the lowest one is tried first
};

/// Returns the highest rate at which a camera delivers pictures of this size; 0 if it does not say.
double fastest(V4l2Device& device, uint32_t fourcc, const FrameSize& size) {
  double most = 0.0;
  for (uint32_t i = 0; i < kMostIntervals; ++i) {
    v4l2_frmivalenum offer{};
    offer.index = i;
    offer.pixel_format = fourcc;
    offer.width = static_cast<uint32_t>(size.width);
    offer.height = static_cast<uint32_t>(size.height);
    if (v4l2_call(device, VIDIOC_ENUM_FRAMEINTERVALS, &offer) != 0) break;
    const bool discrete = offer.type == V4L2_FRMIVAL_TYPE_DISCRETE;
    const v4l2_fract interval = discrete ? offer.discrete : offer.stepwise.min;
    if (interval.numerator > 0)
      most = std::max(most, static_cast<double>(interval.denominator) / interval.numerator);
    if (!discrete) break;
  }
  return most;
}

/// Returns the candidates in the order in which they are tried. The cost for a display is the
/// factors by which size and rate miss the request; for measuring, small pictures come last.
std::vector<Candidate> candidates(V4l2Device& device, const FormatRequest& request) {
  const std::vector<FormatOffer> offers = offered_formats(device);
  const FrameSize wanted = wanted_size(request);
  std::vector<uint32_t> known;
  if (request.for_display)
    known.assign(kDisplayed.begin(), kDisplayed.end());
  else
    std::ranges::transform(kLayouts, std::back_inserter(known), &PixelLayout::fourcc);
  std::vector<Candidate> found;
  for (const uint32_t fourcc : known) {
    const auto offer = std::ranges::find(offers, fourcc, &FormatOffer::fourcc);
    const bool named = request.pixel_format.empty() || request.pixel_format == fourcc_name(fourcc);
    if (offer == offers.end() || !named) continue;
    const FrameSize nearest = nearest_size(device, *offer, wanted);
    if (!request.for_display) {
      found.push_back({fourcc, nearest, pixels(nearest) < 0.5 * pixels(wanted) ? 1.0 : 0.0});
      continue;
    }
    std::vector<FrameSize> sizes = offer->sizes;
    sizes.push_back(nearest);
    for (const FrameSize& size : sizes) {
      const double rate = fastest(device, fourcc, size);
      const double misses = rate > 0.0 ? std::max(request.frames_per_second / rate, 1.0) : 1.0;
      found.push_back({fourcc, size, unlikeness(size, wanted) + std::log(misses)});
    }
  }
  std::ranges::stable_sort(found, {}, &Candidate::cost);
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
  throw device_error("{}: {} among {}", path, wanted, names)
      .remedy(request.pixel_format.empty() ? "use another camera" : "use one of those");
}

struct Signal {
  FrameSize size;
  double frames_per_second = 0.0;
};

/// Sets inputs for HDMI and similar to the size of the arriving signal, which they adopt only on
/// request. Returns nothing for a camera, which has its own timing.
std::optional<Signal> follow_signal(V4l2Device& device, V4l2System& system,
                                    const std::string& path) {
  v4l2_dv_timings timings{};
  const int error = v4l2_call(device, VIDIOC_QUERY_DV_TIMINGS, &timings);
  const bool unusable = error == ENOLINK || error == ENOLCK || error == ERANGE;
  const std::string problem = unusable ? error_text(error) : signal_problem(device);
  if (!problem.empty())
    throw device_error("{}: no usable signal: {}", path, problem)
        .remedy("switch on the device that is connected to this input");
  if (error != 0) return std::nullopt;
  const int refused = v4l2_call(device, VIDIOC_S_DV_TIMINGS, &timings);
  if (refused != 0) throw camera_failure(system, path, "follow the signal", refused);
  const v4l2_bt_timings& bt = timings.bt;
  const double total = static_cast<double>(V4L2_DV_BT_FRAME_WIDTH(&bt)) *
                       static_cast<double>(V4L2_DV_BT_FRAME_HEIGHT(&bt));
  return Signal{.size = {side(bt.width), side(bt.height)},
                .frames_per_second = total > 0 ? static_cast<double>(bt.pixelclock) / total : 0.0};
}

void require_progressive(const v4l2_pix_format& got, const std::string& path) {
  if (got.field == V4L2_FIELD_NONE || got.field == V4L2_FIELD_ANY) return;
  throw device_error("{}: the pictures are interlaced", path)
      .remedy("choose a progressive mode, or use another camera");
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

template <size_t N>
std::string text_of(const uint8_t (&bytes)[N]) {
  const char* const text = reinterpret_cast<const char*>(bytes);
  return {text, strnlen(text, N)};
}

/// Opens a node and queries its own capabilities, not those of the whole device: USB cameras have a
/// second node that is not a camera. Throws Error(Device).
std::unique_ptr<V4l2Device> open_node(V4l2System& system, const std::string& path,
                                      NodeFacts& facts) {
  OpenedDevice opened = system.open(path);
  v4l2_capability capability{};
  int error = opened.error;
  if (opened.device) error = v4l2_call(*opened.device, VIDIOC_QUERYCAP, &capability);
  if (error != 0) throw camera_failure(system, path, "open it", error);
  const bool own = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0;
  const uint32_t can = own ? capability.device_caps : capability.capabilities;
  constexpr uint32_t kNeeded = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  facts = {.name = text_of(capability.card),
           .bus = text_of(capability.bus_info),
           .captures = (can & kNeeded) == kNeeded};
  return std::move(opened.device);
}

/// Returns false for nodes that are not cameras.
bool describe(V4l2System& system, CameraListing& listing) try {
  NodeFacts facts;
  const std::unique_ptr<V4l2Device> device = open_node(system, listing.path, facts);
  if (!facts.captures) return false;
  listing.name = facts.name;
  listing.bus = facts.bus;
  listing.formats = offered_formats(*device);
  return true;
} catch (const Error& failure) {
  listing.problem = fmt::format("{}; {}", failure.what(), failure.hint());
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
std::string leaf(const std::string& path) { return path.substr(path.rfind('/') + 1); }

}  // namespace

std::vector<std::string> FormatOffer::size_names() const {
  std::vector<std::string> names;
  for (const FrameSize& size : sizes)
    names.push_back(fmt::format("{}x{}", size.width, size.height));
  return names;
}

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

std::string signal_problem(V4l2Device& device) {
  int number = 0;
  v4l2_input input{};
  if (v4l2_call(device, VIDIOC_G_INPUT, &number) != 0) return {};
  input.index = static_cast<uint32_t>(number);
  if (v4l2_call(device, VIDIOC_ENUMINPUT, &input) != 0) return {};
  if ((input.status & V4L2_IN_ST_NO_POWER) != 0) return "no power";
  if ((input.status & V4L2_IN_ST_NO_SIGNAL) != 0) return "no signal";
  return (input.status & V4L2_IN_ST_NO_ACCESS) != 0 ? "encrypted, for example by HDCP" : "";
}

AgreedFormat agree_on_format(V4l2Device& device, V4l2System& system, const std::string& path,
                             const FormatRequest& request) {
  const std::optional<Signal> signal = follow_signal(device, system, path);
  FormatRequest wanted = request;
  if (signal && request.for_display) wanted.display = signal->size;
  for (const Candidate& candidate : candidates(device, wanted)) {
    const std::optional<RawFormat> raw = try_candidate(device, system, path, candidate);
    if (!raw || (!request.pixel_format.empty() && fourcc_name(raw->fourcc) != request.pixel_format))
      continue;
    const FrameSize size = wanted_size(request);
    if (request.for_display && request.width > 0 &&
        (raw->width != size.width || raw->height != size.height))
      throw device_error("{}: has no pictures of {}x{}; the nearest are {}x{}", path, size.width,
                         size.height, raw->width, raw->height)
          .remedy("leave the size out, or use one that 'lenticule play SOURCE --preflight' lists");
    const double rate = agree_on_rate(device, request.frames_per_second);
    return {.raw = *raw,
            .frames_per_second = rate > 0.0 || !signal ? rate : signal->frames_per_second};
  }
  refuse_offer(device, path, request);
}

// ---- list of cameras

V4l2Node find_camera(V4l2System& system, const std::string& wanted) {
  if (wanted.empty()) return only_camera(system);
  for (const V4l2Node& node : system.nodes())
    if (wanted == node.path || wanted == node.stable_path || wanted == leaf(node.path) ||
        wanted == leaf(node.stable_path))
      return node;
  if (wanted.find('/') != std::string::npos) return {.path = wanted, .stable_path = {}};
  throw device_error("camera: none is called '{}'", wanted)
      .remedy("'lenticule calibrate camera --list' lists the cameras");
}

std::unique_ptr<V4l2Device> open_camera(V4l2System& system, const std::string& path,
                                        NodeFacts& facts) {
  std::unique_ptr<V4l2Device> device = open_node(system, path, facts);
  if (!facts.captures)
    throw device_error("{}: not a camera", path)
        .remedy("a USB camera has a second node for other data; use the other one");
  return device;
}

std::vector<CameraListing> list_cameras(V4l2System& system) {
  std::vector<CameraListing> cameras;
  for (const V4l2Node& node : system.nodes()) {
    CameraListing listing{.path = node.path, .stable_path = node.stable_path};
    if (describe(system, listing)) cameras.push_back(std::move(listing));
  }
  return cameras;
}

}  // namespace lenticule::frames::capture
