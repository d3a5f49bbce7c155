// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/tag_family.h"

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>

#include <memory>

#include "base/error.h"

namespace lenticule::calib {

TagFamily::TagFamily() : family_(tag36h11_create()) {
  LENTICULE_CHECK(family_ != nullptr && family_->total_width == kTagCells &&
                  family_->ncodes == kTagIds);
}

TagFamily::~TagFamily() {
  tag36h11_destroy(family_);
}

std::vector<bool> TagFamily::cells(int id) const {
  LENTICULE_CHECK(id >= 0 && id < kTagIds);
  const std::unique_ptr<image_u8_t, decltype(&image_u8_destroy)> picture(
      apriltag_to_image(family_, id), image_u8_destroy);
  LENTICULE_CHECK(picture && picture->width == kTagCells && picture->height == kTagCells);
  std::vector<bool> white;
  for (int r = 0; r < kTagCells; ++r)
    for (int c = 0; c < kTagCells; ++c)
      white.push_back(picture->buf[r * picture->stride + c] > 127);
  return white;
}

}  // namespace lenticule::calib
