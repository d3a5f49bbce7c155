// SPDX-License-Identifier: Apache-2.0
// What lenticule-video does, one function per subcommand. Each returns an exit code of
// base/exit_code.h or throws an Error.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

namespace lenticule::video {

/// {"container": ..., "streams": [...]} on standard output.
[[nodiscard]] int run_probe(const std::string& file);

struct DecodeRequest {
  std::string file;
  std::string ring;             ///< socket
  std::string rig_fingerprint;  ///< for a ring that wants one
  std::optional<int> stream;    ///< the first one with pictures unless told otherwise
  uint64_t begin = 0;           ///< frames [begin, end) of the file are the clip
  uint64_t end = std::numeric_limits<uint64_t>::max();
  uint64_t from = 0;                  ///< begin with this frame of the clip
  uint64_t position = 0;              ///< of that frame among all that were ever shown
  uint64_t known_frame = 0;           ///< frame of the file that has ...
  std::optional<int64_t> known_time;  ///< ... this time stamp, to be sought for
  bool loop = false;
  bool before_weaving = false;  ///< chroma of lower resolution is let through
  int orientation = 1;          ///< of EXIF: how frames are turned
  int threads = 0;              ///< 0: as many as cores, four at most
  pid_t parent = 0;             ///< ends with this process; 0 = does not care
};
[[nodiscard]] int run_decode(const DecodeRequest& request);

/// Decodes pictures for `parent`; see picture_messages.h.
[[nodiscard]] int run_pictures(pid_t parent);

struct EncodeRequest {
  std::string file;  ///< "-" is standard output, which must be a file
  int width = 0;
  int height = 0;
  std::string rate = "60";
  std::string codec = "ffv1";    ///< or "x264rgb"
  std::string pixels = "rgb24";  ///< FFmpeg's name of what comes in
  std::string matrix;            ///< of Y'CbCr: bt709, smpte170m, ...
  std::string range;             ///< tv or pc
  std::string transfer;          ///< bt709, linear, ...
  pid_t parent = 0;
};
[[nodiscard]] int run_encode(const EncodeRequest& request);

}  // namespace lenticule::video
