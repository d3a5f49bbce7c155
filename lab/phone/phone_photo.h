// SPDX-License-Identifier: Apache-2.0
// Simulates photographs that a phone takes of a panel under a lens sheet: rays of the pixels are
// traced through the cross-section of the sheet (lens_section.h), then go through the processing of
// a phone. Shares no code with the calibration.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "frames/frame.h"
#include "lab/phone/lens_section.h"

namespace lenticule::lab {

/// Phone describes what is the same in all photographs of a phone. Lengths in pixels of the whole
/// sensor, whose pixels are `width` x `height`; relative lengths in its longer side.
struct Phone {
  int width = 4000;
  int height = 3000;
  double focal = 0.75;  ///< longer sides; 0.75 is 27 mm on 35 mm film
  /// Focal length that EXIF states, relative to the true one: it is rounded to whole millimetres.
  double stated_focal = 1.0;
  Vec2 axis;             ///< principal point minus the middle of the picture, longer sides
  double radial1 = 0.0;  ///< a ray with tangent r appears at r (1 + radial1 r^2 + radial2 r^4)
  double radial2 = 0.0;
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
[[nodiscard]] Photo photograph(const LensSection& sheet, const frames::FrameView& shown,
                               const Phone& phone, const Shot& shot);

/// Writes a JPEG file with EXIF data. Throws Error(Failed).
void write_photo(const Photo& photo, int quality, const std::filesystem::path& file);

/// Compresses and decompresses the photograph as write_photo() and a reader do.
void round_trip(Photo& photo, int quality);

// CameraRays is the geometry of one photograph: pose, focal length, distortion, and the motion of
// the hand while the rows are read.

/// CameraRays returns the ray of each pixel of one photograph.
///
/// Lifetime: must not outlive phone and shot. Thread safety: any thread.
class CameraRays {
 public:
  CameraRays(const Phone& phone, const Shot& shot);

  /// Ray starts at the eye of the camera. Panel frame, mm.
  struct Ray {
    Vec3 eye;
    Vec3 direction;
  };
  /// Returns the ray of the point (u, v) of the sensor, pixels.
  [[nodiscard]] Ray ray(double u, double v) const;
  /// Returns the pixel at which a panel point appears, without distortion and motion.
  [[nodiscard]] Vec2 about(Vec2 panel_mm) const;

 private:
  const Phone& phone_;
  const Shot& shot_;
  double longer_, focal_px_ = 0.0;
  Vec2 axis_px_;
  Vec3 forward_, right_, down_;
};

// Exposes the sensor of a phone to a panel: the rays of its pixels reach lit pixels through the
// lens sheet, and the sensor adds its noise.

inline constexpr float kWallLight = 0.03F;  ///< light of the wall around the panel

/// SensorWindow is the part of the sensor on which the panel appears, in pixels.
struct SensorWindow {
  int left = 0, top = 0, right = 0, bottom = 0;
  [[nodiscard]] int width() const { return right - left; }
  [[nodiscard]] int height() const { return bottom - top; }
};

/// Mosaic is the linear light of each pixel of a window, in its own channel.
struct Mosaic {
  SensorWindow window;
  std::vector<float> light;
};

/// Returns the channel of a pixel of the sensor's mosaic: RGGB.
inline int mosaic_channel(int i, int j) {
  return j % 2 == 0 ? i % 2 : 1 + i % 2;
}

/// Returns the exposure of the pixels near the panel that shows `shown` (RGB codes, sRGB).
[[nodiscard]] Mosaic expose(const LensSection& sheet, const frames::FrameView& shown,
                            const Phone& phone, const Shot& shot);

// Turns the exposure of a sensor into codes as phones do: merged exposures, interpolated colours,
// local tone mapping, a contrast curve and sharpening.

/// Returns the photograph of an exposure, with the wall around its window; EXIF data are missing.
/// `hdr` merges two exposures and maps the tones strongly.
[[nodiscard]] Photo develop(Mosaic mosaic, const Phone& phone, bool hdr);
}  // namespace lenticule::lab
