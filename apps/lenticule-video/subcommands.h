// SPDX-License-Identifier: Apache-2.0
// The subcommands of lenticule-video, one function each. Each returns an exit code of
// base/exit_code.h or throws an Error.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "frames/rational.h"

namespace lenticule::video {

/// Prints {"container": ..., "streams": [...]} on standard output.
[[nodiscard]] int run_probe(const std::string& file);

enum class Decoder {
  Auto,  ///< hardware if a device can, else software
  Software,
  Hardware,
};

struct DecodeRequest {
  std::string file;
  std::string ring;             ///< path of the socket
  std::string rig_fingerprint;  ///< used if the ring requires one
  std::optional<int> stream;    ///< default: the first with pictures
  /// Time stamps become numbers of frames at this rate; without it, frames are numbered in turn.
  std::optional<frames::Rate> rate;
  uint64_t begin = 0;  ///< the clip consists of frames [begin, end) of the file
  uint64_t end = std::numeric_limits<uint64_t>::max();
  uint64_t from = 0;                  ///< first frame of the clip to decode
  uint64_t position = 0;              ///< position of that frame among all frames shown so far
  uint64_t known_frame = 0;           ///< a frame of the file with a known time stamp
  std::optional<int64_t> known_time;  ///< its time stamp, used for seeking
  bool loop = false;
  bool before_weaving = false;  ///< accept subsampled chroma
  int orientation = 1;          ///< EXIF number: rotation of the frames
  int threads = 0;              ///< 0 = one per core, at most four
  Decoder decoder = Decoder::Auto;
  pid_t parent = 0;  ///< exit with this process; 0 = independent
};
[[nodiscard]] int run_decode(const DecodeRequest& request);

struct SoundRequest {
  std::string file;
  int ring_fd = -1;                 ///< descriptor of the player's SoundRing
  int stream = 0;                   ///< index of the one with the sound
  std::optional<frames::Rate> fps;  ///< rate of the pictures; none: a still picture's sound
  uint64_t frames = 0;              ///< pictures of a round; 0 = those of the file
  uint64_t begin = 0;               ///< number in the film of the first one
  uint64_t from = 0;                ///< picture of the first round to start with
  pid_t parent = 0;
};
[[nodiscard]] int run_sound(const SoundRequest& request);

struct EncodeRequest {
  int width = 0;
  int height = 0;
  std::string rate = "60";
  std::string codec = "ffv1";  ///< or "x264rgb"
  pid_t parent = 0;
};
[[nodiscard]] int run_encode(const EncodeRequest& request);

}  // namespace lenticule::video
