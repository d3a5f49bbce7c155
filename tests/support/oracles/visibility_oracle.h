// SPDX-License-Identifier: Apache-2.0
// Reference implementation of primary visibility: tries one subpixel's ray against every primitive
// in double precision.
#pragma once

#include <cstdint>
#include <vector>

#include "optics/model.h"
#include "render/scene/scene.h"

namespace lenticule::test {

/// A surface that a ray hits, or may hit if it is displaced by a tolerance.
struct OracleHit {
  uint32_t geometry = 0;
  uint32_t primitive = 0;
  bool certain = false;                    ///< true if every displaced ray hits
  bool met = false;                        ///< true if the ray itself hits
  double z_mm = 0.0;                       ///< hit's z in the panel frame
  double z_low_mm = 0.0, z_high_mm = 0.0;  ///< range over all displaced rays
};

struct OracleTolerance {
  double ray_mm = 0.0;     ///< sideways displacement
  double relative = 4e-7;  ///< and this share of the coordinates, for single precision
};

/// A line (x + tan_x z, y + tan_y z, z), usually of a subpixel.
struct OracleRay {
  double x_mm = 0.0, y_mm = 0.0, tan_x = 0.0, tan_y = 0.0;
};
[[nodiscard]] OracleRay oracle_ray(const optics::OpticalModel& model, int i, int j, int channel);

/// Returns all hits behind z = start_mm, in no order.
[[nodiscard]] std::vector<OracleHit> oracle_hits(const render::Scene& scene, const OracleRay& ray,
                                                 double start_mm,
                                                 const OracleTolerance& tolerance = {});

/// The surface that the code under test reports for a ray.
struct SeenSurface {
  bool nothing = true;
  uint32_t geometry = 0;
  uint32_t primitive = 0;
  double z_mm = 0.0;
};
enum class Evaluation {
  Right,
  Close,  ///< another surface, but the ray passes its edge, or both are at one depth, within
          ///< tolerance
  Wrong,
};
[[nodiscard]] Evaluation evaluate(const std::vector<OracleHit>& hits, const SeenSurface& seen);

}  // namespace lenticule::test
