// SPDX-License-Identifier: Apache-2.0
// lenticule eye simulates what an eye at a given place sees on a woven frame.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <memory>
#include <string>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/triple.h"
#include "base/print.h"
#include "frames/image_io.h"
#include "optics/eye_simulator.h"
#include "optics/trim.h"

namespace lenticule::player {
namespace {

struct EyeFlags {
  std::string woven;
  std::string rig;
  std::string eye;
  std::string size;
  std::string output;
  bool json = false;
};

/// Parses "1920x1080"; 0 x 0, the simulator's default, if not given.
optics::EyeOptions read_size(const std::string& text) {
  optics::EyeOptions options;
  if (text.empty()) return options;
  const char* const end = text.data() + text.size();
  const auto width = std::from_chars(text.data(), end, options.width);
  const bool cross = width.ec == std::errc() && width.ptr != end && *width.ptr == 'x';
  const auto height = std::from_chars(cross ? width.ptr + 1 : end, end, options.height);
  const auto fits = [](int side) { return side >= 1 && side <= frames::kMaxImageSide; };
  if (!cross || height.ec != std::errc() || height.ptr != end || !fits(options.width) ||
      !fits(options.height))
    throw Error(ErrorKind::Usage, fmt::format("--size '{}': not width x height", text),
                "for example --size 1920x1080");
  return options;
}

optics::Eye read_eye(const std::string& text) {
  const Vec3 place = parse_triple("--eye", text);
  if (!(place.z > 0.0))
    throw Error(ErrorKind::Usage, fmt::format("--eye '{}': not in front of the panel", text),
                "millimetres right, up and away from the panel's centre: --eye -32,0,700");
  return {.x = place.x, .y = place.y, .z_mm = place.z};
}

ExitCode run_eye(const EyeFlags& flags) {
  const optics::Eye eye = read_eye(flags.eye);
  const optics::EyeOptions options = read_size(flags.size);
  frames::check_writable_format(flags.output);
  const optics::OpticalModel model(optics::load_trimmed_rig(flags.rig));
  const optics::Panel& panel = model.rig().panel;
  const frames::WovenFrame woven = frames::read_woven(flags.woven);
  if (woven.width() != panel.width_px || woven.height() != panel.height_px)
    throw Error(ErrorKind::Input,
                fmt::format("{}: {} x {} pixels, the rig's panel has {} x {}", flags.woven,
                            woven.width(), woven.height(), panel.width_px, panel.height_px),
                "this frame was woven for another rig");

  const optics::RgbPicture seen =
      optics::simulate_eye(model,
                           {.pixels = woven.bytes().data(),
                            .width = woven.width(),
                            .height = woven.height(),
                            .stride_bytes = woven.geometry().row_bytes()},
                           eye, options);
  const frames::FrameView picture{{.width = seen.width, .height = seen.height}, seen.pixels};
  frames::write_woven(picture, flags.output);

  const nlohmann::json done = {{"output", flags.output},
                               {"width", seen.width},
                               {"height", seen.height},
                               {"rig_fingerprint", optics::fingerprint(model.rig())},
                               {"eye_mm", {eye.x, eye.y, eye.z_mm}}};
  if (flags.json)
    print_json(done);
  else
    print_out("{}: {} x {}, seen from {}, {}, {} mm\n", done["output"].get<std::string>(),
              seen.width, seen.height, eye.x, eye.y, eye.z_mm);
  return kOk;
}

}  // namespace

Run declare_eye(CLI::App& app) {
  const auto flags = std::make_shared<EyeFlags>();
  app.add_option("woven", flags->woven, "woven frame of the rig's panel")->required();
  app.add_option("--rig", flags->rig, "rig file")->required();
  app.add_option("--eye", flags->eye,
                 "place of the eye, mm right, up and away from the panel's centre: X,Y,Z")
      ->required();
  app.add_option("--size", flags->size, "size of the picture, WxH (half the panel's pixels)");
  app.add_option("-o,--output", flags->output, "picture: .png, .tif, .exr or .ppm")->required();
  app.add_flag("--json", flags->json, "print what was done as JSON");
  return [flags] { return run_eye(*flags); };
}

}  // namespace lenticule::player
