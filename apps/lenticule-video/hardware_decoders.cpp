// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-video/hardware_decoders.h"

#include <dirent.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "base/owned.h"
#include "base/unique_fd.h"
#include "frames/capture/v4l2_device.h"

namespace lenticule::video {
namespace {

using frames::capture::LinuxDevice;
using frames::capture::v4l2_call;

constexpr size_t kMostNodes = 64;
constexpr uint32_t kMostFormats = 64;
constexpr uint32_t kMostSizes = 256;

constexpr std::array<uint32_t, 6> kCoded = {V4L2_PIX_FMT_H264,  V4L2_PIX_FMT_HEVC,
                                            V4L2_PIX_FMT_VP8,   V4L2_PIX_FMT_VP9,
                                            V4L2_PIX_FMT_MPEG4, V4L2_PIX_FMT_MPEG2};

std::vector<int> video_nodes() {
  std::vector<int> numbers;
  const Owned<DIR, ::closedir> folder(::opendir("/dev"));
  if (!folder) return numbers;
  while (const dirent* const entry = ::readdir(folder.get()))
    if (const int number = frames::capture::node_number(entry->d_name); number >= 0)
      numbers.push_back(number);
  std::ranges::sort(numbers);
  if (numbers.size() > kMostNodes) numbers.resize(kMostNodes);
  return numbers;
}

/// Returns the type of the queue that takes packets; none if the device is not from memory to
/// memory.
std::optional<uint32_t> packet_queue(LinuxDevice& device) {
  v4l2_capability about{};
  if (v4l2_call(device, VIDIOC_QUERYCAP, &about) != 0) return std::nullopt;
  const bool of_node = (about.capabilities & V4L2_CAP_DEVICE_CAPS) != 0;
  const uint32_t can = of_node ? about.device_caps : about.capabilities;
  if ((can & V4L2_CAP_STREAMING) == 0) return std::nullopt;
  if ((can & V4L2_CAP_VIDEO_M2M_MPLANE) != 0) return V4L2_BUF_TYPE_VIDEO_OUTPUT_MPLANE;
  if ((can & V4L2_CAP_VIDEO_M2M) != 0) return V4L2_BUF_TYPE_VIDEO_OUTPUT;
  return std::nullopt;
}

/// Adds the largest size that the driver states for the format.
void add_largest_size(LinuxDevice& device, CodedFormat& format) {
  for (uint32_t i = 0; i < kMostSizes; ++i) {
    v4l2_frmsizeenum size{};
    size.index = i;
    size.pixel_format = format.fourcc;
    if (v4l2_call(device, VIDIOC_ENUM_FRAMESIZES, &size) != 0) return;
    const bool single = size.type == V4L2_FRMSIZE_TYPE_DISCRETE;
    const uint32_t width = single ? size.discrete.width : size.stepwise.max_width;
    const uint32_t height = single ? size.discrete.height : size.stepwise.max_height;
    format.most_width = std::max(format.most_width, width);
    format.most_height = std::max(format.most_height, height);
    if (!single) return;
  }
}

std::vector<CodedFormat> coded_formats(LinuxDevice& device, uint32_t queue) {
  std::vector<CodedFormat> formats;
  for (uint32_t i = 0; i < kMostFormats; ++i) {
    v4l2_fmtdesc description{};
    description.index = i;
    description.type = queue;
    if (v4l2_call(device, VIDIOC_ENUM_FMT, &description) != 0) break;
    const uint32_t fourcc = description.pixelformat;
    const auto is_same = [fourcc](const CodedFormat& known) { return known.fourcc == fourcc; };
    if (std::ranges::find(kCoded, fourcc) == kCoded.end()) continue;
    if (std::ranges::any_of(formats, is_same)) continue;
    add_largest_size(device, formats.emplace_back(CodedFormat{.fourcc = fourcc}));
  }
  return formats;
}

std::vector<CodedFormat> formats_of(const std::string& node) {
  UniqueFd fd(::open(node.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  struct stat status {};
  if (!fd || ::fstat(fd.get(), &status) != 0 || !S_ISCHR(status.st_mode)) return {};
  LinuxDevice device(std::move(fd));
  const std::optional<uint32_t> queue = packet_queue(device);
  return queue ? coded_formats(device, *queue) : std::vector<CodedFormat>{};
}

}  // namespace

std::vector<HardwareDecoder> find_hardware_decoders() {
  std::vector<HardwareDecoder> found;
  for (const int number : video_nodes()) {
    std::string node = "/dev/video" + std::to_string(number);
    std::vector<CodedFormat> formats = formats_of(node);
    if (!formats.empty()) found.push_back({std::move(node), std::move(formats)});
  }
  return found;
}

}  // namespace lenticule::video
