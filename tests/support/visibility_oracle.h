// SPDX-License-Identifier: Apache-2.0
// What one subpixel's ray can see, tried against every primitive in double precision: the slow
// oracle of everything that finds primary visibility.
#pragma once

#include <cstdint>
#include <vector>

#include "optics/model.h"
#include "render/scene/scene.h"

namespace lenticule::testing {

/// A surface that a ray meets, or may meet if it were moved by a tolerance.
struct OracleHit {
  uint32_t geometry = 0;
  uint32_t primitive = 0;
  bool certain = false;                    ///< met wherever the ray is moved
  bool met = false;                        ///< met by the ray itself
  double z_mm = 0.0;                       ///< panel frame, where it is met
  double z_low_mm = 0.0, z_high_mm = 0.0;  ///< over all moved rays
};

struct OracleTolerance {
  double ray_mm = 0.0;     ///< moved sideways
  double relative = 4e-7;  ///< and by this part of the coordinates: single precision
};

/// The line of a subpixel, or of anything else: (x + tan_x z, y + tan_y z, z).
struct OracleRay {
  double x_mm = 0.0, y_mm = 0.0, tan_x = 0.0, tan_y = 0.0;
};
[[nodiscard]] OracleRay oracle_ray(const optics::OpticalModel& model, int i, int j, int channel);

/// All that lies behind z = start_mm, in no order.
[[nodiscard]] std::vector<OracleHit> oracle_hits(const render::Scene& scene, const OracleRay& ray,
                                                 double start_mm,
                                                 const OracleTolerance& tolerance = {});

/// What somebody says a ray sees.
struct SeenSurface {
  bool nothing = true;
  uint32_t geometry = 0;
  uint32_t primitive = 0;
  double z_mm = 0.0;
};
enum class Judgement {
  Right,
  Close,  ///< another surface, but the ray passes its edge, or both lie at one depth, within
          ///< tolerance
  Wrong,
};
[[nodiscard]] Judgement judge(const std::vector<OracleHit>& hits, const SeenSurface& seen);

}  // namespace lenticule::testing
