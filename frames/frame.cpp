// SPDX-License-Identifier: Apache-2.0
#include "frames/frame.h"

template class std::vector<uint8_t, lenticule::frames::CacheLineAllocator<uint8_t>>;
