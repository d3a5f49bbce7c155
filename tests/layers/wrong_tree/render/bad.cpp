// A forbidden library, for the test of the check.
#include <xf86drm.h>

int best() {
  return isa_avx512::kBest;
}
