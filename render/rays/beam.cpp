// SPDX-License-Identifier: Apache-2.0
#include "render/rays/beam.h"

#include <initializer_list>

namespace lenticule::render {

Interval operator*(Interval a, Interval b) {
  Interval product;
  for (const double factor : {a.low, a.high}) {
    product.extend(factor * b.low);
    product.extend(factor * b.high);
  }
  return product;
}

void Beam::extend(const Beam& other) {
  x_mm.extend(other.x_mm);
  tan_x.extend(other.tan_x);
  y_mm.extend(other.y_mm);
  tan_y.extend(other.tan_y);
  start_mm = other.start_mm;
}

}  // namespace lenticule::render
