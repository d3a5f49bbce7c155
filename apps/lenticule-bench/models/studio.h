// SPDX-License-Identifier: Apache-2.0
// The renderer's studio as a picture, so that every renderer can be given the same one.
#pragma once

#include <filesystem>

namespace lenticule::bench {

/// Writes render::studio_light() as a latitude-longitude picture (Radiance RGBE), the direction -z
/// in its middle. Throws Error(Failed) if the file cannot be written.
void write_studio(const std::filesystem::path& file, int width, int height);

}  // namespace lenticule::bench
