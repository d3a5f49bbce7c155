// SPDX-License-Identifier: Apache-2.0
// A reference implementation (oracle) of the optical model in docs/panel/optics.md, in long double
// and in the form of that page, for `bench stability`. It shares no code with optics/ except the
// plain data of a rig.
#pragma once

#include <cstdint>

#include "optics/rig.h"

namespace lenticule::bench {

using Real = long double;

/// Position of a phase: in [-1/2, 1/2) of its lens, borders widened as docs/panel/optics.md states.
struct OraclePlace {
  int64_t lens = 0;
  Real place = 0;
};
[[nodiscard]] OraclePlace oracle_place(Real phase);

/// Returns the lens coordinate above a point of the panel in millimetres. For rigs without a
/// residual map.
[[nodiscard]] Real oracle_lens_at(const optics::Rig& rig, Real x_mm, Real y_mm, int channel);

/// Returns Phi_E of the subpixel; z may be infinite, then x and y are tangents.
struct OracleEye {
  Real x = 0;
  Real y = 0;
  Real z = 0;
};
[[nodiscard]] Real oracle_phase(const optics::Rig& rig, int i, int j, int channel,
                                const OracleEye& eye);
/// Returns the centre of the viewing line.
[[nodiscard]] OracleEye oracle_design_eye(const optics::Rig& rig);

/// The ray that the subpixel sends through `lens`: x and tangent along the row.
struct OracleRay {
  Real lens_x_mm = 0;
  Real tan_x = 0;
};
[[nodiscard]] OracleRay oracle_ray(const optics::Rig& rig, int i, int j, int channel, int64_t lens);

}  // namespace lenticule::bench
