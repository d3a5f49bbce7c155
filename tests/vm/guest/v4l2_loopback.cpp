// SPDX-License-Identifier: Apache-2.0
// Runs in the guest: sends a picture through vivid's HDMI output into its HDMI input.
//   vm_v4l2_loopback OUTPUT INPUT          prints the number of bytes that arrived changed
#include <cstdio>
#include <random>
#include <vector>

#include "video_node.h"

namespace lenticule::vm {
namespace {

constexpr uint32_t width = 1280, height = 720, frame_bytes = width * height * 3;

void choose_rgb(VideoNode& node) {
  v4l2_pix_format wanted{};
  wanted.width = width;
  wanted.height = height;
  wanted.pixelformat = V4L2_PIX_FMT_RGB24;
  node.choose(wanted);
  if (node.frame_bytes() != frame_bytes) throw std::runtime_error("rows have padding");
}

std::vector<uint8_t> noise() {
  std::mt19937 random(1);
  std::vector<uint8_t> bytes(frame_bytes);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
  return bytes;
}

int loop(const std::string& output_path, const std::string& input_path) {
  VideoNode output(output_path, V4L2_BUF_TYPE_VIDEO_OUTPUT);
  VideoNode input(input_path, V4L2_BUF_TYPE_VIDEO_CAPTURE);
  choose_rgb(output);
  input.set_control("Loop Video", 1);
  input.set_control("OSD Text Mode", 2);
  output.map_buffers();
  const std::vector<uint8_t> sent = noise();
  output.start(&sent);
  // The input copies the timings of the arriving signal, as a capture card would; otherwise it
  // shows its own noise.
  v4l2_dv_timings timings{};
  input.call(VIDIOC_QUERY_DV_TIMINGS, &timings, "no signal");
  input.call(VIDIOC_S_DV_TIMINGS, &timings, "timings");
  choose_rgb(input);
  input.map_buffers();
  input.start(nullptr);
  for (uint32_t i = 0; i < 2 * VideoNode::buffer_count;
       ++i) {  // the first pictures may be older than the signal
    output.next(false);
    input.next(false);
  }
  const std::vector<uint8_t> seen = input.next(true);
  size_t differing = 0;
  for (size_t i = 0; i < sent.size(); ++i) differing += sent[i] != seen[i];
  std::printf("%zu of %zu bytes differ\n", differing, sent.size());
  return differing == 0 ? 0 : 1;
}

}  // namespace
}  // namespace lenticule::vm

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "vm_v4l2_loopback OUTPUT INPUT\n");
    return 2;
  }
  try {
    return lenticule::vm::loop(argv[1], argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "vm_v4l2_loopback: %s\n", error.what());
    return 2;
  }
}
