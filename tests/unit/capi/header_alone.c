/* SPDX-License-Identifier: Apache-2.0 */
/* lenticule.h must compile as the first and only include. */
#include <lenticule.h>

lenticule_status header_alone(lenticule_ring** ring);

lenticule_status header_alone(lenticule_ring** ring) {
  lenticule_hello hello = LENTICULE_HELLO_INIT;
  return lenticule_ring_connect("/nowhere", &hello, 0, ring);
}
