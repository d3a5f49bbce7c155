// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/camera_list.h"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/error.h"
#include "calib/cameras/format_choice.h"
#include "calib/cameras/v4l2_camera.h"
#include "calib/cameras/v4l2_failure.h"

namespace lenticule::calib {
namespace {

template <size_t N>
std::string text_of(const uint8_t (&bytes)[N]) {
  const char* const text = reinterpret_cast<const char*>(bytes);
  return {text, strnlen(text, N)};
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

}  // namespace lenticule::calib
