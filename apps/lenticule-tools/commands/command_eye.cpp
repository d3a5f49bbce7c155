// SPDX-License-Identifier: Apache-2.0
// lenticule eye simulates what an eye at a given place sees on a woven frame.

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/content_flags.h"
#include "apps/lenticule/cli/option.h"
#include "base/error_kinds.h"
#include "base/numbers.h"
#include "base/print.h"
#include "frames/image_io.h"
#include "frames/weave.h"
#include "optics/trim.h"
#include "player/process/rig_choice.h"

namespace lenticule::tools {
namespace {

struct EyeFlags {
  std::string woven;
  std::string rig;
  optics::Eye eye;
  optics::EyeOptions options;  ///< the size is the simulator's unless --size is given
  std::string output;
  bool json = false;
};

optics::EyeOptions parse_size(const std::string& text) {
  const auto size = numbers_from<int, 2>(text, 'x');
  const auto fits = [](int side) { return side >= 1 && side <= frames::kMaxImageSide; };
  if (!size || !fits((*size)[0]) || !fits((*size)[1]))
    throw usage_error("--size '{}': not width x height", text)
        .remedy("for example --size 1920x1080");
  optics::EyeOptions options;
  options.width = (*size)[0];
  options.height = (*size)[1];
  return options;
}

optics::Eye eye_at(Vec3 place) {
  if (!(place.z > 0.0))
    throw usage_error("--eye '{},{},{}': not in front of the panel", place.x, place.y, place.z)
        .remedy("millimetres right, up and away from the panel's centre: --eye -32,0,700");
  return {.x = place.x, .y = place.y, .z_mm = place.z};
}

ExitCode run_eye(const EyeFlags& flags) {
  const optics::Eye& eye = flags.eye;
  frames::check_writable_format(flags.output);
  const optics::OpticalModel model(optics::load_trimmed_rig(flags.rig));
  const optics::Panel& panel = model.rig().panel;
  const frames::WovenFrame woven = frames::read_woven(flags.woven);
  if (woven.width() != panel.width_px || woven.height() != panel.height_px)
    throw input_error("{}: {} x {} pixels, the rig's panel has {} x {}", flags.woven, woven.width(),
                      woven.height(), panel.width_px, panel.height_px)
        .remedy("use --rig with the rig that the frame was woven for");

  const frames::WovenFrame seen = frames::seen_by(model, woven.view(), eye, flags.options);
  frames::write_woven(seen.view(), flags.output);

  const nlohmann::json done = {{"output", flags.output},
                               {"width", seen.width()},
                               {"height", seen.height()},
                               {"rig_fingerprint", optics::fingerprint(model.rig())},
                               {"eye_mm", {eye.x, eye.y, eye.z_mm}}};
  if (flags.json)
    print_json(done);
  else
    print_out("{}: {} x {}, seen from {}, {}, {} mm\n", done["output"].get<std::string>(),
              seen.width(), seen.height(), eye.x, eye.y, eye.z_mm);
  return kOk;
}

}  // namespace

cli::Run declare_eye(CLI::App& app) {
  const auto flags = std::make_shared<EyeFlags>();
  app.add_option("FRAME", flags->woven, "woven frame of the rig's panel")->required();
  cli::declare_rig_flag(app, flags->rig, "rig that the frame is woven for");
  cli::add_triple(
      app, "--eye X,Y,Z", [flags](Vec3 place) { flags->eye = eye_at(place); },
      "place of the eye: mm right, up and away from the panel's centre")
      ->required();
  cli::add_option_function(
      app, "--size WxH", [flags](const std::string& text) { flags->options = parse_size(text); },
      "size of the picture")
      ->default_str("half the panel's pixels");
  cli::add_option(app, "-o,--output FILE", flags->output, "picture: .png, .tif, .exr or .ppm")
      ->required();
  app.add_flag("--json", flags->json, "print what was done as JSON");
  return [flags] {
    flags->rig = player::choose_rig({.given = flags->rig}).file;
    return run_eye(*flags);
  };
}

}  // namespace lenticule::tools
