// SPDX-License-Identifier: Apache-2.0
// The optical model of docs/optics.md once more, in long double and as it is written there, for
// `bench stability`. Shares no code with optics/ but the plain data of a rig.
#pragma once

#include <cstdint>

#include "optics/rig.h"

namespace lenticule::player {

using Real = long double;

/// Where a phase lies: in [-1/2, 1/2) of its lens, borders widened as docs/optics.md says.
struct OraclePlace {
  int64_t lens = 0;
  Real place = 0;
};
[[nodiscard]] OraclePlace oracle_place(Real phase);

/// The lens coordinate above a point of the glass, millimetres. Rigs without a residual map.
[[nodiscard]] Real oracle_lens_at(const optics::Rig& rig, Real x_mm, Real y_mm, int channel);

/// Phi_E of the subpixel; z may be infinite, x and y are tangents then.
struct OracleEye {
  Real x = 0;
  Real y = 0;
  Real z = 0;
};
[[nodiscard]] Real oracle_phase(const optics::Rig& rig, int i, int j, int channel,
                                const OracleEye& eye);
/// The centre of the viewing line.
[[nodiscard]] OracleEye oracle_design_eye(const optics::Rig& rig);

/// The ray that the subpixel sends through `lens`: x and tangent along the row.
struct OracleRay {
  Real lens_x_mm = 0;
  Real tan_x = 0;
};
[[nodiscard]] OracleRay oracle_ray(const optics::Rig& rig, int i, int j, int channel, int64_t lens);

}  // namespace lenticule::player
