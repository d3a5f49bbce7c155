// SPDX-License-Identifier: Apache-2.0
// Reference implementations (oracles) in long double for `bench stability`: the optical model in
// the form of docs/panel/optics.md, a ray tracer that tests every ray against every primitive, and
// the picture that both make. They share no code with optics/ and render/ except the plain data of
// rigs and scenes. The ray tracer supports glowing, mirroring and transparent materials, and
// neither lights nor ambient light.
#pragma once

#include <cstdint>

#include "lab/stability/rows.h"
#include "optics/rig.h"
#include "render/scene/scene_description.h"

namespace lenticule::lab {

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

/// Renders the scene with plain_stage() and compares every subpixel with the oracle. A difference
/// of more than one code is a failure, unless the oracle gives the code for a slightly moved ray:
/// an outline lies between the two rays. The row's note states how many subpixels needed that.
[[nodiscard]] StabilityRow compare_with_oracle(const render::SceneDescription& scene,
                                               const optics::Rig& rig, const StabilitySize& size);
}  // namespace lenticule::lab
