// SPDX-License-Identifier: Apache-2.0
#include "lab/fixtures.h"

#include <fmt/format.h>

#include <filesystem>
#include <limits>
#include <system_error>

#include "base/error.h"
#include "optics/trim.h"

namespace lenticule::lab {

optics::Rig kiosk_rig() {
  optics::Rig rig;
  rig.name = "kiosk 27-inch 4K";
  rig.panel.width_px = 3840;
  rig.panel.height_px = 2160;
  rig.panel.pixel_width = Millimetres(0.15567);
  rig.panel.pixel_height = Millimetres(0.15567);
  rig.sheet.pitch = Subpixels(7.701);
  rig.sheet.slant = 0.2521;
  rig.sheet.gap = Millimetres(2.238);
  rig.sheet.refraction_shape = 0.4444444444444444;
  rig.viewing.distance = Millimetres(700.0);
  return rig;
}

optics::Rig paper_rig() {
  optics::Rig rig;
  rig.name = "64 lenses of 8 pixels";
  rig.panel.width_px = 512;
  rig.panel.height_px = 384;
  rig.panel.pixel_width = Millimetres(0.25);
  rig.panel.pixel_height = Millimetres(0.25);
  rig.sheet.pitch = Subpixels(24.0);
  rig.sheet.offset = Lenses(0.5);
  rig.sheet.gap = Millimetres(4.0);
  rig.sheet.refraction_shape = 0.4444444444444444;
  rig.sheet.spot_sigma = Lenses(0.02);
  rig.viewing.distance = Millimetres(std::numeric_limits<double>::infinity());
  return rig;
}

optics::Rig coarser_rig(const optics::Rig& rig, int factor) {
  if (factor == 1) return rig;
  optics::Rig coarser = rig;
  coarser.panel.width_px /= factor;
  coarser.panel.height_px /= factor;
  coarser.name += fmt::format(", {} x {}", coarser.panel.width_px, coarser.panel.height_px);
  coarser.panel.pixel_width = Millimetres(factor * rig.panel.pixel_width.value);
  coarser.panel.pixel_height = Millimetres(factor * rig.panel.pixel_height.value);
  coarser.sheet.gap = Millimetres(factor * rig.sheet.gap.value);
  return coarser;
}

optics::Rig bench_rig(const std::string& file) {
  return file.empty() ? kiosk_rig() : optics::load_trimmed_rig(file);
}

ScratchFolder::ScratchFolder() : folder_(std::filesystem::temp_directory_path()) {}

std::string ScratchFolder::ring_socket() const {
  const std::filesystem::path folder = folder_.path() / "ring";
  std::error_code error;
  std::filesystem::create_directory(folder, error);
  if (error)
    throw Error(ErrorKind::Failed,
                folder.string() + ": cannot create the folder: " + error.message());
  return (folder / "ring.sock").string();
}
}  // namespace lenticule::lab
