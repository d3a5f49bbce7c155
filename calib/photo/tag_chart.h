// SPDX-License-Identifier: Apache-2.0
// SinglePhotoChart is the chart for calibrating with a single photograph: fringes, and tags that
// locate them on the panel.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "frames/frame.h"
#include "optics/rig.h"
#include "optics/vec.h"

struct apriltag_family;

namespace lenticule::calib {

/// ChartTag is a tag on the panel: a square with its white rim.
struct ChartTag {
  int id = 0;
  double left_px = 0.0;
  double top_px = 0.0;
  double cell_px = 0.0;

  /// Returns the corners of the tag proper, inside its white rim: left bottom, right bottom, right
  /// top, left top, in panel pixels (X, Y down).
  [[nodiscard]] std::array<Vec2, 4> corners_px() const;
  /// Returns true if a panel point is on the tag, its rim, or within `margin_px` of it.
  [[nodiscard]] bool covers(Vec2 panel_px, double margin_px) const;
};

/// ScalePatch detects scaling by a graphics card or a panel, which makes its squares of one pixel,
/// alternately lit and dark, darker than the grey of the same light beside them.
struct ScalePatch {
  double left_px = 0.0;
  double top_px = 0.0;
  double side_px = 0.0;  ///< side of each half
  [[nodiscard]] bool covers(Vec2 panel_px, double margin_px) const;
  /// Returns 0 for a point well inside the grey half, 1 well inside the squares; -1 elsewhere.
  [[nodiscard]] int half_at(Vec2 panel_px) const;
};

/// SinglePhotoChart describes the displayed chart. Light 1/2 + A/2 cos(2 pi s (1/P_c + d F/(3 W))),
/// s = 3 (X - W/2 + m0 (Y - H/2)): a comb of nearly the lens pitch, which the sheet turns into F
/// slow fringes. d alternates between +1 and -1 from band to band of rows: a position error of some
/// pixels shifts the fringes of neighbouring bands in opposite directions, an error of the pitch in
/// the same direction. This separates the two errors, so the tags need not be located to hundredths
/// of a pixel. In two bands d is +2 and -2: if the start is so wrong that one kind of band shows no
/// fringes, or fringes of the other sign, the other kinds reveal this.
struct SinglePhotoChart {
  optics::Rig start;                ///< pitch, slant and offset before the calibration
  double centre_pitch_subpx = 0.0;  ///< P_c: the effective pitch expected at the eye
  int fringes = 0;                  ///< F, across the panel
  int bands = 0;                    ///< number of bands of equal height
  double contrast = 0.9;            ///< A
  /// Tags from the top left: three rows of three, or four in the corners and one in the middle.
  /// Their ids depend on the starting rig, so that a photograph of another rig's chart is detected.
  std::vector<ChartTag> tags;
  std::vector<ScalePatch> patches;

  /// Returns the tag with this id, or null.
  [[nodiscard]] const ChartTag* tag(int id) const;
  /// Returns the band of a row: 0 to bands - 1.
  [[nodiscard]] int band_at(double y_px) const;
  /// Returns d of a band.
  [[nodiscard]] static double detuning(int band) {
    return kDetunings[static_cast<size_t>(band) % kDetunings.size()];
  }
  static constexpr std::array<double, 8> kDetunings = {1, -1, 2, -1, 1, -2, 1, -1};
  /// Returns the phase of the comb at a panel point, cycles.
  [[nodiscard]] double comb_phase(double x_px, double y_px, double detuning) const;
};

/// Returns true if the panel is large enough for the tags.
[[nodiscard]] bool has_room_for_tags(const optics::Rig& start);

/// Plans the chart for an eye at the rig's viewing distance (700 mm if infinite). Number of
/// fringes: 3 % of the lenses in a row, 24 to 60. Throws Error(Input) for an invalid rig and for a
/// panel too small for the tags: a cell of a tag is at least 7 lens pitches, or 6 if there are only
/// five tags, and a 192th of the panel's width.
[[nodiscard]] SinglePhotoChart plan_single_photo_chart(const optics::Rig& start);

/// Draws the chart's frame, with the panel's size, in sRGB codes of linear light.
[[nodiscard]] frames::WovenFrame draw_single_photo_chart(const SinglePhotoChart& chart);

/// Cells along a tag's side with its white rim, and the width of the rim.
inline constexpr int kTagCells = 10;
inline constexpr int kTagRimCells = 1;
/// Ids are 0 to kTagIds - 1.
inline constexpr int kTagIds = 587;

/// TagFamily owns the library's handle of the AprilTag family 36h11.
class TagFamily {
 public:
  TagFamily();
  ~TagFamily();
  TagFamily(const TagFamily&) = delete;
  TagFamily& operator=(const TagFamily&) = delete;

  [[nodiscard]] apriltag_family* get() const { return family_; }
  /// Returns kTagCells rows of kTagCells cells from the top, true = white. Requires an id of the
  /// family.
  [[nodiscard]] std::vector<bool> cells(int id) const;

 private:
  apriltag_family* family_;
};

/// PhotoLight is the light of a photograph, rows from the top.
struct PhotoLight {
  int width = 0;
  int height = 0;
  std::vector<float> light;  ///< mean of the channels
  /// Clipped part of the values that each pixel averages, in 255ths; empty: nothing was clipped.
  std::vector<uint8_t> clipped = {};
  std::vector<std::array<float, 3>> colours = {};  ///< red, green, blue; empty for grey pictures
};

struct TagSighting {
  int id = 0;
  /// Order of ChartTag::corners_px, picture pixels; (0, 0) is the corner of the first pixel.
  std::array<Vec2, 4> corners_px;
  double blur_px = 0.0;  ///< standard deviation of the blur of its cells; 0: unknown
};

/// Returns all tags of the family, sorted by id, each once (the clearest sighting), with corners
/// that all edges of the tag determine (tag_alignment.h). If fewer than `wanted` are found, also
/// searches blurred copies of the picture. Light that is not finite counts as black.
///
/// Thread safety: any thread; starts no threads.
[[nodiscard]] std::vector<TagSighting> find_tags(const PhotoLight& picture, size_t wanted);

// Locates a tag that was found by all of its edges: the lenses make every edge coarse, so that the
// outline alone leaves its corners uncertain.

/// Moves the corners of a tag so that its cells, blurred, fit the picture best. `white` is
/// TagFamily::cells() of its id. Returns the tag unchanged if no fit is found near it, as for a tag
/// that is partly hidden.
///
/// Thread safety: any thread.
[[nodiscard]] TagSighting aligned(const PhotoLight& picture, const TagSighting& tag,
                                  const std::vector<bool>& white);

}  // namespace lenticule::calib
