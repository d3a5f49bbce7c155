// SPDX-License-Identifier: Apache-2.0
// One video stream of a file, frame after frame in the order of showing.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule-video/av_handles.h"
#include "apps/lenticule-video/stream_pixels.h"

namespace lenticule::video {

/// Demuxers and decoders that are let at a file; the rest of FFmpeg's some hundreds stay shut.
[[nodiscard]] const char* allowed_containers();
[[nodiscard]] const char* allowed_codecs();

/// The regular file of that name, opened for reading. Throws Error(Input). Before confine().
[[nodiscard]] int open_clip_file(const std::string& name);

/// An opened container. Nothing is opened by name, whatever the file says.
class Container {
 public:
  /// `name` is for messages. Throws Error(Input) when it is no video file.
  Container(const int& fd, std::string name);
  [[nodiscard]] AVFormatContext& format() { return *format_; }
  [[nodiscard]] const std::string& name() const { return name_; }
  /// The wanted stream, or the first with pictures. Throws Error(Input) when there is none.
  [[nodiscard]] AVStream& video_stream(std::optional<int> wanted);

 private:
  std::string name_;
  AvIo io_;
  AvInput format_;  // last: uses io_
};

/// One thread. The descriptor must outlive it.
class ClipReader {
 public:
  enum class Step { Frame, End };

  /// Throws Error(Input) for what cannot be decoded.
  ClipReader(const int& fd, std::string name, std::optional<int> stream, int threads);

  [[nodiscard]] const AVStream& stream() const { return *stream_; }
  /// The next picture. Packets that cannot be decoded are left out and counted.
  [[nodiscard]] Step next();
  [[nodiscard]] const AVFrame& frame() const { return *frame_; }
  /// Time stamp of frame(), or AV_NOPTS_VALUE.
  [[nodiscard]] int64_t time() const { return frame_->best_effort_timestamp; }
  [[nodiscard]] uint64_t broken_packets() const { return broken_; }
  /// Frames that came although the decoder found errors in them.
  [[nodiscard]] uint64_t faulty_frames() const { return faulty_; }

  /// Goes on from the last key frame at or before `time`; false if the file cannot be sought in.
  [[nodiscard]] bool seek(int64_t time);
  /// Opens everything anew: the first frame comes next, whatever the container can. Throws as the
  /// constructor.
  void reopen();

 private:
  void open();
  void open_decoder();
  [[nodiscard]] bool feed();

  const int& fd_;
  std::string name_;
  std::optional<int> wanted_;
  int threads_;
  std::unique_ptr<Container> container_;
  AVStream* stream_ = nullptr;
  AvCodec codec_;
  AvPacket packet_;
  AvFrame frame_;
  bool draining_ = false;
  uint64_t broken_ = 0;
  uint64_t faulty_ = 0;
  int read_errors_ = 0;
};

}  // namespace lenticule::video
