// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/television_modes.h"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "display/kms/device/connector.h"

namespace lenticule::display {
namespace {

// vic, width, height, hertz, pixel clock / 100 kHz
constexpr std::array kModes = {
    TelevisionMode{93, 3840, 2160, 24, 2970},     TelevisionMode{94, 3840, 2160, 25, 2970},
    TelevisionMode{95, 3840, 2160, 30, 2970},     TelevisionMode{96, 3840, 2160, 50, 5940},
    TelevisionMode{97, 3840, 2160, 60, 5940},     TelevisionMode{98, 4096, 2160, 24, 2970},
    TelevisionMode{99, 4096, 2160, 25, 2970},     TelevisionMode{100, 4096, 2160, 30, 2970},
    TelevisionMode{101, 4096, 2160, 50, 5940},    TelevisionMode{102, 4096, 2160, 60, 5940},
    TelevisionMode{103, 3840, 2160, 24, 2970},    TelevisionMode{104, 3840, 2160, 25, 2970},
    TelevisionMode{105, 3840, 2160, 30, 2970},    TelevisionMode{106, 3840, 2160, 50, 5940},
    TelevisionMode{107, 3840, 2160, 60, 5940},    TelevisionMode{114, 3840, 2160, 48, 5940},
    TelevisionMode{115, 4096, 2160, 48, 5940},    TelevisionMode{116, 3840, 2160, 48, 5940},
    TelevisionMode{117, 3840, 2160, 100, 11880},  TelevisionMode{118, 3840, 2160, 120, 11880},
    TelevisionMode{119, 3840, 2160, 100, 11880},  TelevisionMode{120, 3840, 2160, 120, 11880},
    TelevisionMode{121, 5120, 2160, 24, 3960},    TelevisionMode{122, 5120, 2160, 25, 3960},
    TelevisionMode{123, 5120, 2160, 30, 3960},    TelevisionMode{124, 5120, 2160, 48, 7425},
    TelevisionMode{125, 5120, 2160, 50, 7425},    TelevisionMode{126, 5120, 2160, 60, 7425},
    TelevisionMode{127, 5120, 2160, 100, 14850},  TelevisionMode{193, 5120, 2160, 120, 14850},
    TelevisionMode{194, 7680, 4320, 24, 11880},   TelevisionMode{195, 7680, 4320, 25, 11880},
    TelevisionMode{196, 7680, 4320, 30, 11880},   TelevisionMode{197, 7680, 4320, 48, 23760},
    TelevisionMode{198, 7680, 4320, 50, 23760},   TelevisionMode{199, 7680, 4320, 60, 23760},
    TelevisionMode{200, 7680, 4320, 100, 47520},  TelevisionMode{201, 7680, 4320, 120, 47520},
    TelevisionMode{202, 7680, 4320, 24, 11880},   TelevisionMode{203, 7680, 4320, 25, 11880},
    TelevisionMode{204, 7680, 4320, 30, 11880},   TelevisionMode{205, 7680, 4320, 48, 23760},
    TelevisionMode{206, 7680, 4320, 50, 23760},   TelevisionMode{207, 7680, 4320, 60, 23760},
    TelevisionMode{208, 7680, 4320, 100, 47520},  TelevisionMode{209, 7680, 4320, 120, 47520},
    TelevisionMode{210, 10240, 4320, 24, 14850},  TelevisionMode{211, 10240, 4320, 25, 14850},
    TelevisionMode{212, 10240, 4320, 30, 14850},  TelevisionMode{213, 10240, 4320, 48, 29700},
    TelevisionMode{214, 10240, 4320, 50, 29700},  TelevisionMode{215, 10240, 4320, 60, 29700},
    TelevisionMode{216, 10240, 4320, 100, 59400}, TelevisionMode{217, 10240, 4320, 120, 59400},
    TelevisionMode{218, 4096, 2160, 100, 11880},  TelevisionMode{219, 4096, 2160, 120, 11880},
};

bool same_mode(const drmModeModeInfo& mode, const TelevisionMode& listed) {
  // 1000/1001 differs by one in a thousand; the next rate by four in a hundred.
  constexpr double kTolerance = 0.0015;
  const double clock = mode.clock / 100.0 / listed.clock_mhz_x10;
  const double rate = refresh_of(mode).hertz() / listed.hertz;
  return mode.hdisplay == listed.width && mode.vdisplay == listed.height &&
         std::abs(clock - 1) < kTolerance && std::abs(rate - 1) < kTolerance;
}

}  // namespace

std::span<const TelevisionMode> television_modes() {
  return kModes;
}

bool is_one_of(const drmModeModeInfo& mode, std::span<const uint8_t> vics) {
  return std::any_of(kModes.begin(), kModes.end(), [&](const TelevisionMode& listed) {
    return std::find(vics.begin(), vics.end(), listed.vic) != vics.end() && same_mode(mode, listed);
  });
}

}  // namespace lenticule::display
