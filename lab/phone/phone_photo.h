// SPDX-License-Identifier: Apache-2.0
// Simulates photographs that a phone takes by hand of a panel under a lens sheet: the light of the
// sheet's lenses (lens_sheet.h) goes through the processing of a phone. Shares no formula with the
// calibration.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "frames/frame.h"
#include "lab/panel/lens_sheet.h"

namespace lenticule::lab {

/// Wave is a part of the smooth error that the correction of a phone's lens leaves in its pictures.
/// Lengths in the longer side of the picture.
struct Wave {
  Vec2 turns_per_side;  ///< wave vector
  double turns = 0.0;   ///< phase at the middle of the picture
  Vec2 shift;           ///< largest displacement of a point in the picture
};

/// Phone describes what is the same in all photographs of a phone. Lengths in pixels of the whole
/// sensor, whose pixels are `width` x `height`; relative lengths in its longer side.
struct Phone {
  int width = 4000;
  int height = 3000;    ///< films have 9/16 of the width
  double focal = 0.75;  ///< longer sides; 0.75 is 27 mm on 35 mm film
  /// Focal length that EXIF states, relative to the true one: it is rounded to whole millimetres.
  double stated_focal = 1.0;
  Vec2 axis;             ///< principal point minus the middle of the picture, longer sides
  double radial1 = 0.0;  ///< a ray with tangent r appears at r (1 + radial1 r^2 + radial2 r^4)
  double radial2 = 0.0;
  Vec2 tangential;           ///< Brown's two terms: the lenses of the objective are not centred
  std::vector<Wave> warp;    ///< the sum of all displaces the picture
  double readout_s = 0.02;   ///< time from the first to the last row
  double vignetting = 0.25;  ///< missing part of the light in the corners
  double shot_noise = 0.01;  ///< standard deviation at full light, relative
  double read_noise = 0.004;
  double blur_px = 1.6;       ///< width of the square that a pixel averages
  double sharpening = 0.5;    ///< fraction of the difference from the blurred picture that is added
  double tone_mapping = 0.1;  ///< exponent that brightens dark parts of the picture
  double curve = 0.05;        ///< strength of the S-shaped contrast curve, codes relative to 255
  double exposure = 0.8;      ///< light of a white panel in the middle
  int jpeg_quality = 92;
};

/// Shot describes one photograph.
struct Shot {
  Vec3 eye_mm{0.0, 0.0, 700.0};
  Vec2 look_at_mm;            ///< panel point in the direction of the middle of the sensor
  double roll_degrees = 0.0;  ///< 180: the phone is upside down
  double breathing = 0.0;     ///< relative change of the focal length by focusing
  Vec2 stabilisation;         ///< shift of the axis by the stabiliser, longer sides
  Vec3 drift_mm_s;            ///< motion of the hand during the readout
  Vec3 turn_degrees_s;        ///< rotation about the camera's axes during the readout
  double exposure_s = 0.0;    ///< exposure of each row, during which the hand moves
  bool hdr = false;  ///< two exposures, apart by the hand's motion, merged and strongly mapped
  double room_light = 0.02;  ///< light of the room reflected by the panel, relative to white
  uint64_t seed = 1;
};

/// Photo is a finished photograph as the sensor stores it: rows from the top, RGB codes.
struct Photo {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> codes;
  double stated_focal_35mm = 0.0;  ///< EXIF FocalLengthIn35mmFilm
  int orientation = 1;             ///< EXIF
};

/// Takes a photograph of the panel that shows `shown` (RGB codes, sRGB). Only pixels near the panel
/// are computed; a dark wall is around it. Equal arguments give equal codes.
[[nodiscard]] Photo photograph(const SheetShape& sheet, const frames::FrameView& shown,
                               const Phone& phone, const Shot& shot);

/// Writes a JPEG file with EXIF data. Throws Error(Failed).
void write_photo(const Photo& photo, int quality, const std::filesystem::path& file);

/// Compresses and decompresses the photograph as write_photo() and a reader do.
void round_trip(Photo& photo, int quality);

}  // namespace lenticule::lab
