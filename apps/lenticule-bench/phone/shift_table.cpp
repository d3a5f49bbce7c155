// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/phone/shift_table.h"

#include <algorithm>
#include <cmath>

namespace lenticule::bench {

ShiftTable::ShiftTable(const LensSection& sheet) : sheet_(sheet) {
  values_.resize(size_t{3} * kSteps * kSteps);
}

void ShiftTable::evaluate(double tan_across, double tan_along, int channel, Table& out) {
  const double a = std::clamp(tan_across / kStep + kSteps / 2.0, 0.0, kSteps - 2.0);
  const double b = std::clamp(tan_along / kStep + kSteps / 2.0, 0.0, kSteps - 2.0);
  const int i = static_cast<int>(a), j = static_cast<int>(b);
  const auto fa = static_cast<float>(a - i), fb = static_cast<float>(b - j);
  const auto& v00 = table(i, j, channel);
  const auto& v10 = table(i + 1, j, channel);
  const auto& v01 = table(i, j + 1, channel);
  const auto& v11 = table(i + 1, j + 1, channel);
  const float w00 = (1 - fa) * (1 - fb), w10 = fa * (1 - fb), w01 = (1 - fa) * fb, w11 = fa * fb;
  for (size_t k = 0; k < kPlaces; ++k) {
    out[k].x = w00 * v00[k].x + w10 * v10[k].x + w01 * v01[k].x + w11 * v11[k].x;
    out[k].y = w00 * v00[k].y + w10 * v10[k].y + w01 * v01[k].y + w11 * v11[k].y;
  }
}

const ShiftTable::Table& ShiftTable::table(int i, int j, int channel) {
  std::optional<Table>& made =
      values_[(static_cast<size_t>(channel) * kSteps + static_cast<size_t>(j)) * kSteps +
              static_cast<size_t>(i)];
  if (!made) made = trace((i - kSteps / 2) * kStep, (j - kSteps / 2) * kStep, channel);
  return *made;
}

ShiftTable::Table ShiftTable::trace(double tan_across, double tan_along, int channel) const {
  Table out;
  const auto apex = sheet_.trace(0.0, tan_across, tan_along, channel);
  for (int k = 0; k < kPlaces; ++k) {
    const auto shift = sheet_.trace((k + 0.5) / kPlaces - 0.5, tan_across, tan_along, channel);
    Offset& o = out[static_cast<size_t>(k)];
    if (!shift || !apex) {
      o = {std::nanf(""), std::nanf("")};
      continue;
    }
    const double across = shift->across - apex->across, along = shift->along - apex->along;
    const optics::Panel& panel = sheet_.panel();
    o.x = static_cast<float>((across * sheet_.across().x + along * sheet_.along().x) /
                             panel.pixel_width.value);
    o.y = static_cast<float>(-(across * sheet_.across().y + along * sheet_.along().y) /
                             panel.pixel_height.value);
  }
  return out;
}

}  // namespace lenticule::bench
