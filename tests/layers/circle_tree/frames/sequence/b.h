// SPDX-License-Identifier: Apache-2.0
// Half of an include cycle, for the test of the check.
#include "frames/ring/a.h"
