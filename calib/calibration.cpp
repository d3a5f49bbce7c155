// SPDX-License-Identifier: Apache-2.0
#include "calib/calibration.h"

namespace lenticule::calib {

const char* to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::Intrinsic:
      return "intrinsic";
    case Verdict::Effective:
      return "effective";
    case Verdict::Refused:
      return "refused";
  }
  return "refused";
}

}  // namespace lenticule::calib
