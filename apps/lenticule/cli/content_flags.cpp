// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/content_flags.h"

#include <CLI/CLI.hpp>

#include "frames/quilt.h"

namespace lenticule::cli {

CLI::Option* declare_rig_flag(CLI::App& app, std::string& rig, const std::string& what) {
  return app.add_option("--rig", rig, what)
      ->type_name("RIG.toml")
      ->default_str("that of the connected panel, else a sample");
}

void declare_content_flags(CLI::App& app, player::ContentFlags& flags) {
  app.option_defaults()->group("Layout of views");
  app.add_option("--grid", flags.grid, "tiles of the quilt: 8x6")->type_name("COLUMNSxROWS");
  app.add_option("--views", flags.views,
                 "number of views\n"
                 "In a quilt whose last tiles are empty, to make from a picture with depth, or to "
                 "take from a woven frame.")
      ->check(CLI::Range(1, frames::kMaxViews));
  app.add_option("--aspect", flags.aspect, "width / height of a view as it is displayed");
  app.add_flag("--invert", flags.invert, "the first view is that of the rightmost camera");
  app.add_option("--stereo", flags.stereo,
                 "two eyes' pictures in one: side by side, top and bottom, squeezed to half\n"
                 "Or another word of names, such as left-right; none if only the name looks like "
                 "stereo.")
      ->type_name("sbs|tb|hsbs|htb|none");
  app.add_option("--depth", flags.depth,
                 "depth of the picture: a file, or right, left, bottom or top\n"
                 "The file is a picture, a pattern or a video; otherwise the half of the picture "
                 "that contains the depth. right:half is a depth half as wide as the colours, "
                 "right:quarter also half as high.")
      ->type_name("FILE|SIDE");
  app.add_option(
         "--depth-range", flags.depth_range,
         "disparities between the outermost views, percent of the width: -2:2\n"
         "Of the farthest and the nearest depth; above 0 is in front of the panel. Or pixels: "
         "-20px:20px.")
      ->type_name("FAR:NEAR");
  app.add_option("--depth-distance", flags.depth_distance,
                 "the depth is a distance from the camera: 0.5:20\n"
                 "Of the nearest and the farthest depth, in any unit. Otherwise it is a disparity.")
      ->type_name("NEAR:FAR");
  app.add_flag("--invert-depth", flags.invert_depth, "black is near instead of white");
  app.add_option("--zero-plane", flags.zero_plane,
                 "disparity that comes to lie in the panel plane: 1.5\n"
                 "Percent of a view's width between the outermost views, or 20px; above 0 moves "
                 "everything back.")
      ->type_name("DISPARITY");
  app.add_option("--depth-budget", flags.depth_budget,
                 "how far depth may extend before and behind the panel: 1\n"
                 "In depths of field of the sheet; what is deeper is compressed.")
      ->check(CLI::PositiveNumber);
  app.add_option("--from-rig", flags.from_rig,
                 "the input is woven for this rig; it is split into views first")
      ->type_name("RIG.toml");
  app.add_flag("--reweave", flags.reweave,
               "split a FILE.lts of another rig into views and weave them again\n"
               "This costs sharpness.");
  app.option_defaults()->group("Options");
}

void declare_weaving_flags(CLI::App& app, player::WeavingFlags& flags) {
  app.option_defaults()->group("Weaving");
  app.add_option("--filter", flags.filter,
                 "how neighbouring views are mixed\n"
                 "The default is nearest for few views, which the lens sheet keeps apart, and "
                 "linear for others.")
      ->type_name("nearest|linear|gauss");
  app.add_option("--fit", flags.fit, "what to do about views of another aspect")
      ->type_name("contain|cover|stretch")
      ->capture_default_str();
  app.add_option("--crosstalk", flags.crosstalk,
                 "compensate the light of neighbouring views\n"
                 "spot takes the amount that follows from the rig's lens spot.")
      ->type_name("PERCENT|spot");
  app.option_defaults()->group("Options");
}

}  // namespace lenticule::cli
