// SPDX-License-Identifier: Apache-2.0
#include "render/shading/light_encoder.h"

#include <algorithm>
#include <cmath>

#include "render/shading/shading_kernel.h"

namespace lenticule::render {
namespace {

constexpr size_t kKnots = 4096;
constexpr float kWhite = 255.0F * kCodeParts;

}  // namespace

LightEncoder::LightEncoder(bool colour_managed) {
  if (!colour_managed) return;
  linear_ = &frames::linear_codes();
  for (size_t n = 0; n <= kKnots; ++n) {
    const double root = static_cast<double>(n) / kKnots;
    knots_.push_back(static_cast<float>(double{kWhite} * frames::srgb_from_linear(root * root)));
  }
  knots_.push_back(knots_.back());
}

uint16_t LightEncoder::parts(float light) const {
  const float held = light > 0.0F ? std::min(light, 1.0F) : 0.0F;
  if (knots_.empty()) return static_cast<uint16_t>(held * kWhite + 0.5F);
  const float at = std::sqrt(held) * kKnots;
  const auto knot = static_cast<size_t>(at);
  const float part = at - static_cast<float>(knot);
  return static_cast<uint16_t>(knots_[knot] + (knots_[knot + 1] - knots_[knot]) * part + 0.5F);
}

}  // namespace lenticule::render
