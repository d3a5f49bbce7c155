// A wrong library, for the test of the check.
#include <xf86drm.h>
