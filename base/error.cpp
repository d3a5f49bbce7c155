// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"

#include <cstdlib>

#include "base/print.h"

namespace lenticule {

void check_failed(const char* file, int line, const char* condition) noexcept {
  say("{}:{}: this must hold and does not: {}\n", file, line, condition);
  std::abort();
}

}  // namespace lenticule
