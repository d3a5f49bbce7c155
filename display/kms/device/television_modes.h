// SPDX-License-Identifier: Apache-2.0
// Lists the television modes (VICs of CTA-861) that a sink may accept as YCbCr 4:2:0 only.
#pragma once

#include <xf86drmMode.h>

#include <cstdint>
#include <span>

namespace lenticule::display {

struct TelevisionMode {
  uint8_t vic = 0;
  int width = 0;
  int height = 0;
  int hertz = 0;
  int clock_mhz_x10 = 0;  ///< pixel clock in units of 100 kHz
};

/// Returns the modes with 2160 lines or more; smaller ones do not need 4:2:0.
[[nodiscard]] std::span<const TelevisionMode> television_modes();

/// Returns true if the mode has the size, rate and pixel clock of one of these, or 1000/1001 of
/// them.
[[nodiscard]] bool is_one_of(const drmModeModeInfo& mode, std::span<const uint8_t> vics);

}  // namespace lenticule::display
