// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"

#include <cstdio>
#include <cstdlib>

namespace lenticule {

void check_failed(const char* file, int line, const char* condition) noexcept {
  // Not say(): the part of lenticule that reads pictures has this function and no other of base/.
  std::fprintf(stderr, "%s:%d: this must hold and does not: %s\n", file, line, condition);
  std::abort();
}

}  // namespace lenticule
