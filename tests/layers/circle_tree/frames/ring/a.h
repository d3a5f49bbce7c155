// SPDX-License-Identifier: Apache-2.0
// Half of a circle, for the test of the check.
#include "frames/sequence/b.h"
