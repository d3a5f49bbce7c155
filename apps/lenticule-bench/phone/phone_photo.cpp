// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/phone/phone_photo.h"

#include <array>
#include <cmath>

#include "apps/lenticule-bench/phone/development.h"
#include "apps/lenticule-bench/phone/exposure.h"

namespace lenticule::bench {
namespace {

/// Returns the EXIF orientation of a phone that is turned by about this angle.
int orientation_of(double roll_degrees) {
  // A sensor turned clockwise by 90 degrees stores the scene turned counter-clockwise.
  constexpr std::array<int, 4> kOrientations = {1, 6, 3, 8};
  const auto quarter = static_cast<int>(std::lround(roll_degrees / 90.0));
  return kOrientations[static_cast<size_t>((quarter % 4 + 4) % 4)];
}

}  // namespace

Photo photograph(const LensSection& sheet, const frames::FrameView& shown, const Phone& phone,
                 const Shot& shot) {
  Photo photo = develop(expose(sheet, shown, phone, shot), phone, shot.hdr);
  // 35 mm film has a longer side of 36 mm.
  photo.stated_focal_35mm = std::round(36.0 * phone.focal * phone.stated_focal);
  photo.orientation = orientation_of(shot.roll_degrees);
  return photo;
}

}  // namespace lenticule::bench
