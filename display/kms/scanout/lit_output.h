// SPDX-License-Identifier: Apache-2.0
// A panel that shows our picture, and the buffers that it can show.
#pragma once

#include <memory>

#include "display/kms/scanout/kms_output.h"
#include "display/kms/scanout/scanout_pool.h"

namespace lenticule::display {

struct LitOutput {
  std::unique_ptr<KmsOutput> output;
  ScanoutPool buffers;         ///< released before the output
  KmsBuffer* front = nullptr;  ///< what the panel shows
};

}  // namespace lenticule::display
