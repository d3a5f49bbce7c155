// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/format_choice.h"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <limits>
#include <optional>

#include "calib/cameras/v4l2_device.h"

namespace lenticule::calib {
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

}  // namespace lenticule::calib
