// SPDX-License-Identifier: Apache-2.0
// The optical model once more, slow and obvious: long double, every equation as it is written in
// docs/optics.md, every unknown found by bisection. Shares no formula code with optics/.
#pragma once

#include "optics/model.h"

namespace lenticule::test {

using Real = long double;

struct RealPoint {
  Real x = 0;
  Real y = 0;
};

struct RealEye {
  Real x = 0;
  Real y = 0;
  Real z = 0;  ///< infinite: x and y are tangents
};
RealEye real_eye(const optics::Eye& eye);

/// lambda_c(X, Y), panel pixels.
Real oracle_lens_coordinate(const optics::Rig& rig, RealPoint at_px, int channel);

/// Delta(L, E), millimetres.
RealPoint oracle_shift(const optics::Rig& rig, RealPoint lens_point, const RealEye& eye);

/// L with L - Delta(L, E) = Q, millimetres.
RealPoint oracle_lens_point(const optics::Rig& rig, RealPoint panel_point, const RealEye& eye);

/// Phi_E(Q).
Real oracle_phase(const optics::Rig& rig, RealPoint at_px, int channel, const RealEye& eye);

struct RealRay {
  RealPoint lens_point;
  Real tan_x = 0;
  Real tan_y = 0;
  long lens = 0;
  Real place = 0;
};
RealRay oracle_ray(const optics::Rig& rig, int i, int j, int channel);

}  // namespace lenticule::test
