// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/content_flags.h"

#include <CLI/CLI.hpp>

#include "frames/quilt.h"

namespace lenticule::player {

CLI::Option* declare_rig_flag(CLI::App& app, std::string& rig, const std::string& what) {
  return app.add_option("--rig", rig, what)
      ->type_name("RIG.toml")
      ->default_str("that of the connected panel, else a sample");
}

void declare_content_flags(CLI::App& app, ContentFlags& flags) {
  app.add_option("--grid", flags.grid, "tiles of the quilt, columns x rows: 8x6")
      ->type_name("COLUMNSxROWS");
  app.add_option("--views", flags.views,
                 "number of views: in a quilt whose last tiles are empty, to make from a picture "
                 "with depth, or to take from a woven frame")
      ->check(CLI::Range(1, frames::kMaxViews));
  app.add_option("--aspect", flags.aspect, "width / height of a view as it is displayed");
  app.add_flag("--invert", flags.invert, "the first view is that of the rightmost camera");
  app.add_option("--stereo", flags.stereo,
                 "two eyes' pictures in one: sbs (side by side), tb (left above right), hsbs or "
                 "htb (squeezed to half); none if only the name looks like stereo");
  app.add_option("--depth", flags.depth,
                 "depth of the picture: a picture, pattern or video, or the half of the picture "
                 "that contains it: right, left, bottom, top");
  app.add_option(
         "--depth-range", flags.depth_range,
         "disparity of the farthest and the nearest depth between the outermost views: percent of "
         "a view's width (-2:2), or pixels (-20px:20px); above 0 is in front of the panel")
      ->type_name("FAR:NEAR");
  app.add_flag("--invert-depth", flags.invert_depth, "black is near instead of white");
  app.add_option("--from-rig", flags.from_rig,
                 "the input is woven for this rig; it is split into views first");
  app.add_flag("--reweave", flags.reweave,
               "split a FILE.lts that was woven for another rig into views and weave them again, "
               "which costs sharpness");
}

void declare_weaving_flags(CLI::App& app, WeavingFlags& flags) {
  app.add_option("--filter", flags.filter,
                 "how neighbouring views are mixed: nearest, linear or gauss")
      ->capture_default_str();
  app.add_option("--fit", flags.fit, "views of another aspect: contain, cover or stretch")
      ->capture_default_str();
  app.add_option("--crosstalk", flags.crosstalk,
                 "compensate the light of neighbouring views: a percentage, or spot for the amount "
                 "that follows from the rig's lens spot")
      ->type_name("PERCENT|spot");
}

}  // namespace lenticule::player
