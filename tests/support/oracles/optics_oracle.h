// SPDX-License-Identifier: Apache-2.0
// Reference implementation of the optical model, slow and simple: long double, every equation as
// written in docs/panel/optics.md, every unknown found by bisection. It shares no formula code with
// optics/.
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
  Real z = 0;  ///< if infinite, x and y are tangents
};
RealEye real_eye(const optics::Eye& eye);

/// Returns lambda_c(X, Y) for panel pixels.
Real oracle_lens_coordinate(const optics::Rig& rig, RealPoint at_px, int channel);

/// Returns Delta(L, E) in millimetres.
RealPoint oracle_shift(const optics::Rig& rig, RealPoint lens_point, const RealEye& eye);

/// Returns L with L - Delta(L, E) = Q, in millimetres.
RealPoint oracle_lens_point(const optics::Rig& rig, RealPoint panel_point, const RealEye& eye);

/// Returns Phi_E(Q).
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
