// SPDX-License-Identifier: Apache-2.0
// Runs in the guest: sends a picture through vivid's HDMI output into its HDMI input.
//   vm_v4l2_loopback OUTPUT INPUT          prints how many of the bytes came back different
#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>

#include <cstdio>
#include <random>
#include <vector>

#include "drm_card.h"

namespace lenticule::vm {
namespace {

constexpr uint32_t width = 1280, height = 720, buffer_count = 4, frame_bytes = width * height * 3;

// A video node with its memory-mapped buffers.
class VideoNode {
 public:
  VideoNode(const std::string& path, v4l2_buf_type type)
      : fd_(checked(open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC), path)), type_(type) {}
  ~VideoNode() {
    ioctl(fd_.get(), VIDIOC_STREAMOFF, &type_);
    for (uint8_t* mapped : mapped_) munmap(mapped, frame_bytes);
  }
  VideoNode(const VideoNode&) = delete;
  VideoNode& operator=(const VideoNode&) = delete;

  template <typename T>
  void call(unsigned long request, T* argument, const char* what) {
    checked(ioctl(fd_.get(), request, argument), what);
  }

  void set_control(const std::string& name, int value) {
    v4l2_query_ext_ctrl control{};
    do {
      control.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
      call(VIDIOC_QUERY_EXT_CTRL, &control, ("no control '" + name + "'").c_str());
    } while (control.name != name);
    v4l2_control setting{control.id, value};
    call(VIDIOC_S_CTRL, &setting, name.c_str());
  }

  void choose_rgb() {
    v4l2_format format{};
    format.type = type_;
    call(VIDIOC_G_FMT, &format, "format");
    format.fmt.pix.width = width;
    format.fmt.pix.height = height;
    format.fmt.pix.pixelformat = V4L2_PIX_FMT_RGB24;
    call(VIDIOC_S_FMT, &format, "format");
    const v4l2_pix_format& got = format.fmt.pix;
    if (got.width != width || got.height != height || got.sizeimage != frame_bytes)
      throw std::runtime_error("the driver does not take 1280x720 RGB");
  }

  void map_buffers() {
    v4l2_requestbuffers request{};
    request.count = buffer_count;
    request.type = type_;
    request.memory = V4L2_MEMORY_MMAP;
    call(VIDIOC_REQBUFS, &request, "buffers");
    for (uint32_t i = 0; i < request.count; ++i) {
      v4l2_buffer buffer = buffer_number(i);
      call(VIDIOC_QUERYBUF, &buffer, "buffer");
      void* mapped = mmap(nullptr, frame_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd_.get(),
                          buffer.m.offset);
      if (mapped == MAP_FAILED) throw std::runtime_error("cannot map a buffer");
      mapped_.push_back(static_cast<uint8_t*>(mapped));
    }
  }

  void start(const std::vector<uint8_t>* contents) {
    for (uint32_t i = 0; i < mapped_.size(); ++i) {
      if (contents) std::memcpy(mapped_[i], contents->data(), frame_bytes);
      v4l2_buffer buffer = buffer_number(i);
      call(VIDIOC_QBUF, &buffer, "queue a buffer");
    }
    call(VIDIOC_STREAMON, &type_, "start");
  }

  // Waits for the next done buffer, hands it back to the driver, and returns its pixels.
  std::vector<uint8_t> next(bool copy) {
    const auto event = static_cast<short>(type_ == V4L2_BUF_TYPE_VIDEO_CAPTURE ? POLLIN : POLLOUT);
    pollfd waiting{fd_.get(), event, 0};
    if (poll(&waiting, 1, 10000) != 1) throw std::runtime_error("no buffer for 10 s");
    v4l2_buffer buffer = buffer_number(0);
    call(VIDIOC_DQBUF, &buffer, "take a buffer");
    std::vector<uint8_t> pixels;
    if (copy) pixels.assign(mapped_[buffer.index], mapped_[buffer.index] + frame_bytes);
    call(VIDIOC_QBUF, &buffer, "queue a buffer");
    return pixels;
  }

 private:
  v4l2_buffer buffer_number(uint32_t index) const {
    v4l2_buffer buffer{};
    buffer.index = index;
    buffer.type = type_;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.bytesused = type_ == V4L2_BUF_TYPE_VIDEO_OUTPUT ? frame_bytes : 0;
    return buffer;
  }

  Descriptor fd_;
  v4l2_buf_type type_;
  std::vector<uint8_t*> mapped_;
};

std::vector<uint8_t> noise() {
  std::mt19937 random(1);
  std::vector<uint8_t> bytes(frame_bytes);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
  return bytes;
}

int loop(const std::string& output_path, const std::string& input_path) {
  VideoNode output(output_path, V4L2_BUF_TYPE_VIDEO_OUTPUT);
  VideoNode input(input_path, V4L2_BUF_TYPE_VIDEO_CAPTURE);
  output.choose_rgb();
  input.set_control("Loop Video", 1);
  input.set_control("OSD Text Mode", 2);
  output.map_buffers();
  const std::vector<uint8_t> sent = noise();
  output.start(&sent);
  // The input takes its timings from what arrives, as a capture card would; otherwise it shows
  // its own noise.
  v4l2_dv_timings timings{};
  input.call(VIDIOC_QUERY_DV_TIMINGS, &timings, "no signal");
  input.call(VIDIOC_S_DV_TIMINGS, &timings, "timings");
  input.choose_rgb();
  input.map_buffers();
  input.start(nullptr);
  for (uint32_t i = 0; i < 2 * buffer_count; ++i) {  // the first ones may be of before the signal
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
