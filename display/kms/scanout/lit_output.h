// SPDX-License-Identifier: Apache-2.0
// LitOutput is an active output with its scan-out buffers.
#pragma once

#include <memory>

#include "display/kms/scanout/kms_output.h"
#include "display/kms/scanout/scanout_pool.h"

namespace lenticule::display {

struct LitOutput {
  std::unique_ptr<KmsOutput> output;
  ScanoutPool buffers;         ///< released before the output
  KmsBuffer* front = nullptr;  ///< the displayed buffer
};

}  // namespace lenticule::display
