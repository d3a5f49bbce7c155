// SPDX-License-Identifier: Apache-2.0
// From a wish to a lit panel: find, choose, inherit or light up.
#pragma once

#include <memory>

#include "display/kms/kms_display.h"
#include "display/kms/kms_output.h"
#include "display/kms/scanout_pool.h"

namespace lenticule::display {

struct LitOutput {
  std::unique_ptr<KmsOutput> output;
  ScanoutPool buffers;  ///< released before the output
  KmsBuffer* front = nullptr;
};

/// `options` with all services filled in. Throws as open_kms_display().
[[nodiscard]] LitOutput light_output(const KmsOptions& options);

}  // namespace lenticule::display
