// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"

#include <cstdio>
#include <cstdlib>

namespace lenticule {

void check_failed(const char* file, int line, const char* condition) noexcept {
  // Does not call say(): the library that reads pictures links this function, but nothing else from
  // base/.
  std::fprintf(stderr, "%s:%d: bug in lenticule: expected %s\n", file, line, condition);
  std::abort();
}

}  // namespace lenticule
