// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/content_flags.h"

#include <CLI/CLI.hpp>

#include "apps/lenticule/cli/option.h"
#include "frames/quilt.h"

namespace lenticule::cli {

CLI::Option* declare_rig_flag(CLI::App& app, std::string& rig, const std::string& what) {
  return add_option(app, "--rig RIG.toml", rig, what)
      ->default_str("that of the connected panel, else a sample");
}

void declare_content_flags(CLI::App& app, player::ContentFlags& flags) {
  app.option_defaults()->group("Layout of views");
  add_option(app, "--grid COLUMNSxROWS", flags.grid, "tiles of the quilt: 8x6");
  app.add_option("--views", flags.views,
                 "number of views\n"
                 "In a quilt whose last tiles are empty, to make from a picture with depth, or to "
                 "take from a woven frame.")
      ->check(CLI::Range(1, frames::kMaxViews));
  app.add_option("--aspect", flags.aspect, "width / height of a view as it is displayed");
  app.add_flag("--invert", flags.invert, "the first view is that of the rightmost camera");
  add_option(app, "--stereo sbs|tb|hsbs|htb|none", flags.stereo,
             "two eyes' pictures in one: side by side, top and bottom, squeezed to half\n"
             "Or another word of names, such as left-right; none if only the name looks like "
             "stereo.");
  add_option(app, "--depth FILE|SIDE", flags.depth,
             "depth of the picture: a file, or right, left, bottom or top\n"
             "The file is a picture, a pattern or a video; otherwise the half of the picture "
             "that contains the depth. right:half is a depth half as wide as the colours, "
             "right:quarter also half as high.");
  add_option(app, "--depth-range FAR:NEAR", flags.depth_range,
             "disparities between the outermost views, percent of the width: -2:2\n"
             "Of the farthest and the nearest depth; above 0 is in front of the panel. Or pixels: "
             "-20px:20px.");
  add_option(app, "--depth-distance NEAR:FAR", flags.depth_distance,
             "the depth is a distance from the camera: 0.5:20\n"
             "Of the nearest and the farthest depth, in any unit. Otherwise it is a disparity.");
  app.add_flag("--invert-depth", flags.invert_depth, "black is near instead of white");
  add_option(app, "--zero-plane DISPARITY", flags.zero_plane,
             "disparity that comes to lie in the panel plane: 1.5\n"
             "Percent of a view's width between the outermost views, or 20px; above 0 moves "
             "everything back.");
  app.add_option("--depth-budget", flags.depth_budget,
                 "how far depth may extend before and behind the panel: 1\n"
                 "In depths of field of the sheet; what is deeper is compressed.")
      ->check(CLI::PositiveNumber);
  add_option(app, "--from-rig RIG.toml", flags.from_rig,
             "the input is woven for this rig; it is split into views first");
  app.add_flag("--reweave", flags.reweave,
               "split a FILE.lts of another rig into views and weave them again\n"
               "This costs sharpness.");
  app.option_defaults()->group("Options");
}

void declare_weaving_flags(CLI::App& app, player::WeavingFlags& flags) {
  app.option_defaults()->group("Weaving");
  add_option(app, "--filter nearest|linear|gauss", flags.filter,
             "how neighbouring views are mixed\n"
             "The default is nearest for few views, which the lens sheet keeps apart, and "
             "linear for others.");
  add_option(app, "--fit contain|cover|stretch", flags.fit,
             "what to do about views of another aspect");
  add_option(app, "--crosstalk PERCENT|spot", flags.crosstalk,
             "compensate the light of neighbouring views\n"
             "spot takes the amount that follows from the rig's lens spot.");
  app.option_defaults()->group("Options");
}

}  // namespace lenticule::cli
