// A forbidden include, for the test of the check.
#include "display/display.h"
