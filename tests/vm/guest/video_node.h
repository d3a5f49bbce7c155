// SPDX-License-Identifier: Apache-2.0
// Drives a video node of vivid by hand: controls by name, formats, buffers in both directions.
#pragma once

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>

#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "drm_card.h"

namespace lenticule::vm {

class VideoNode {
 public:
  static constexpr uint32_t buffer_count = 4;

  VideoNode(const std::string& path, v4l2_buf_type type)
      : fd_(checked(open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC), path)), type_(type) {}
  ~VideoNode() {
    ioctl(fd_.get(), VIDIOC_STREAMOFF, &type_);
    for (uint8_t* mapped : mapped_) munmap(mapped, frame_bytes_);
  }
  VideoNode(const VideoNode&) = delete;
  VideoNode& operator=(const VideoNode&) = delete;

  template <typename T>
  void call(unsigned long request, T* argument, const char* what) {
    checked(ioctl(fd_.get(), request, argument), what);
  }

  // Sets a control, or presses a button.
  void set_control(const std::string& name, int value) {
    const auto id = control_called(name);
    if (!id) throw std::runtime_error("no control '" + name + "'");
    v4l2_control setting{*id, value};
    call(VIDIOC_S_CTRL, &setting, name.c_str());
  }

  // Connects the HDMI input to the output of the same vivid, or to the driver's test picture.
  void set_loop(bool looped) {
    // Before Linux 6.12 a switch; since then a list: test picture, nothing, the outputs.
    if (control_called("Loop Video"))
      set_control("Loop Video", looped ? 1 : 0);
    else
      set_control("HDMI 000-0 Is Connected To", looped ? 2 : 0);
  }

  // Sets a format; fields not set in `wanted` keep the driver's values. Returns the driver's
  // result.
  v4l2_pix_format choose(const v4l2_pix_format& wanted) {
    v4l2_format format{};
    format.type = type_;
    format.fmt.pix = wanted;
    call(VIDIOC_S_FMT, &format, "format");
    const v4l2_pix_format& got = format.fmt.pix;
    if (got.width != wanted.width || got.height != wanted.height ||
        got.pixelformat != wanted.pixelformat)
      throw std::runtime_error("the driver does not take this format");
    frame_bytes_ = got.sizeimage;
    return got;
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
      void* mapped = mmap(nullptr, frame_bytes_, PROT_READ | PROT_WRITE, MAP_SHARED, fd_.get(),
                          buffer.m.offset);
      if (mapped == MAP_FAILED) throw std::runtime_error("cannot map a buffer");
      mapped_.push_back(static_cast<uint8_t*>(mapped));
    }
  }

  void start(const std::vector<uint8_t>& contents) {
    for (uint32_t i = 0; i < mapped_.size(); ++i) {
      std::memcpy(mapped_[i], contents.data(), contents.size());
      v4l2_buffer buffer = buffer_number(i);
      call(VIDIOC_QBUF, &buffer, "queue a buffer");
    }
    call(VIDIOC_STREAMON, &type_, "start");
  }

  // Waits for the next completed buffer and returns it to the driver.
  void next() {
    v4l2_buffer buffer = take_done();
    call(VIDIOC_QBUF, &buffer, "queue a buffer");
  }

  // Sends one picture. An output repeats its newest picture until the next one.
  void send(const std::vector<uint8_t>& contents) {
    v4l2_buffer buffer = take_done();
    std::memcpy(mapped_[buffer.index], contents.data(), contents.size());
    buffer.bytesused = frame_bytes_;
    call(VIDIOC_QBUF, &buffer, "queue a buffer");
  }

 private:
  std::optional<uint32_t> control_called(const std::string& name) const {
    v4l2_query_ext_ctrl control{};
    do {
      control.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
      if (ioctl(fd_.get(), VIDIOC_QUERY_EXT_CTRL, &control) != 0) return std::nullopt;
    } while (control.name != name);
    return control.id;
  }

  v4l2_buffer take_done() {
    const auto event = static_cast<short>(type_ == V4L2_BUF_TYPE_VIDEO_CAPTURE ? POLLIN : POLLOUT);
    pollfd waiting{fd_.get(), event, 0};
    if (poll(&waiting, 1, 10000) != 1) throw std::runtime_error("no buffer for 10 s");
    v4l2_buffer buffer = buffer_number(0);
    call(VIDIOC_DQBUF, &buffer, "take a buffer");
    return buffer;
  }

  v4l2_buffer buffer_number(uint32_t index) const {
    v4l2_buffer buffer{};
    buffer.index = index;
    buffer.type = type_;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.bytesused = type_ == V4L2_BUF_TYPE_VIDEO_OUTPUT ? frame_bytes_ : 0;
    return buffer;
  }

  Descriptor fd_;
  v4l2_buf_type type_;
  uint32_t frame_bytes_ = 0;
  std::vector<uint8_t*> mapped_;
};

}  // namespace lenticule::vm
