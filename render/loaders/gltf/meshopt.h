// SPDX-License-Identifier: Apache-2.0
// Decodes buffer views of EXT_meshopt_compression.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/loaders/gltf/json_at.h"

namespace lenticule::render::gltf {

/// Decodes `bytes` as the extension's object states. Throws Error(Input) for invalid properties and
/// damaged data.
[[nodiscard]] std::vector<uint8_t> decode_meshopt(std::span<const uint8_t> bytes,
                                                  const JsonAt& compression);

}  // namespace lenticule::render::gltf
