// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as what a sound driver says about a panel.
#include "player/sound/sound_device.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  (void)lenticule::player::panel_of_eld({data, size});
  return 0;
}
