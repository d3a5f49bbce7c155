// SPDX-License-Identifier: Apache-2.0
// Checks that lenticule.h compiles as the first and only include of a C++ program.
#include <lenticule.h>

lenticule_status header_alone_cxx(lenticule_ring** ring);

lenticule_status header_alone_cxx(lenticule_ring** ring) {
  lenticule_hello hello = LENTICULE_HELLO_INIT;
  return lenticule_ring_connect("/nowhere", &hello, 0, ring);
}
