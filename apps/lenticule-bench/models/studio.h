// SPDX-License-Identifier: Apache-2.0
// The studio that surrounds and lights the models of `lenticule bench models`: a formula, so that
// every renderer can be given the same picture of it.
#pragma once

#include <filesystem>

#include "optics/vec.h"

namespace lenticule::player {

/// Returns the light that arrives from the unit direction (x right, y up, z toward the viewer), in
/// linear light: grey walls, a large bright lamp at the upper left behind the viewer, a weaker one
/// to the right, and one overhead.
[[nodiscard]] Vec3 studio_light(Vec3 from);

/// Writes the studio as a latitude-longitude picture (Radiance RGBE), the direction -z in its
/// middle. Throws Error(Failed) if the file cannot be written.
void write_studio(const std::filesystem::path& file, int width, int height);

}  // namespace lenticule::player
