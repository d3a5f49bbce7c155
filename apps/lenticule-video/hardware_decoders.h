// SPDX-License-Identifier: Apache-2.0
// find_hardware_decoders lists the video decoders of the machine that take coded packets from
// memory and return pictures to memory (V4L2 stateful decoders).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace lenticule::video {

/// A coded format that a decoder accepts.
struct CodedFormat {
  uint32_t fourcc = 0;       ///< V4L2_PIX_FMT_H264 and the like
  uint32_t most_width = 0;   ///< limit in pixels; 0 = the driver states none
  uint32_t most_height = 0;  ///< limit in pixels; 0 = the driver states none
};

struct HardwareDecoder {
  std::string node;  ///< "/dev/video10"
  std::vector<CodedFormat> formats;
};

/// Returns the decoders that accept at least one of H.264, HEVC, VP8, VP9, MPEG-4 and MPEG-2, in
/// the order of their nodes. Devices that cannot be opened, or that answer oddly, are left out.
/// Every loop over a driver's answers is bounded.
[[nodiscard]] std::vector<HardwareDecoder> find_hardware_decoders();

}  // namespace lenticule::video
