// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/content_flags.h"

#include <CLI/CLI.hpp>

#include "frames/quilt.h"

namespace lenticule::player {

void declare_content_flags(CLI::App& app, ContentFlags& flags) {
  app.add_option("--grid", flags.grid, "tiles of the quilt, columns x rows: 8x6")
      ->type_name("COLUMNSxROWS");
  app.add_option("--views", flags.views,
                 "views in the quilt if the last tiles are empty; or as many as are to be made of "
                 "a picture with depth, or taken from a woven frame")
      ->check(CLI::Range(1, frames::kMaxViews));
  app.add_option("--aspect", flags.aspect, "width / height of a view as it is meant to be seen");
  app.add_flag("--invert", flags.invert, "the first view is the rightmost camera's");
  app.add_option("--stereo", flags.stereo,
                 "two eyes' pictures in one: sbs (left and right), tb (left above right), hsbs or "
                 "htb (squeezed to half); none where a name only looks like it");
  app.add_option(
      "--depth", flags.depth,
      "the picture's depth: a picture, pattern or video, or the half of the picture that "
      "holds it: right, left, bottom, top");
  app.add_option("--depth-range", flags.depth_range,
                 "by how much the farthest and the nearest depth differ between the outermost "
                 "views: percent of a view's width (-2:2), or pixels (-20px:20px); more than 0 is "
                 "in front of the glass")
      ->type_name("FAR:NEAR");
  app.add_flag("--invert-depth", flags.invert_depth, "black is near, and not white");
  app.add_option("--from-rig", flags.from_rig,
                 "the input is woven for this rig: it is taken apart into views first");
  app.add_flag(
      "--reweave", flags.reweave,
      "a FILE.lts that was woven for another rig is taken apart into views and woven anew, "
      "which costs sharpness");
}

void declare_weaving_flags(CLI::App& app, WeavingFlags& flags) {
  app.add_option("--filter", flags.filter, "how views mix: nearest, linear or gauss")
      ->capture_default_str();
  app.add_option("--fit", flags.fit, "views of another aspect: contain, cover or stretch")
      ->capture_default_str();
  app.add_option("--crosstalk", flags.crosstalk,
                 "undo what eyes get of neighbouring views: a percentage, or spot for what the "
                 "rig's lens spot lets through")
      ->type_name("PERCENT|spot");
}

}  // namespace lenticule::player
