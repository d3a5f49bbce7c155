// A wrong arrow, for the test of the check.
#include "display/display.h"
