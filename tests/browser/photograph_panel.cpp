// SPDX-License-Identifier: Apache-2.0
// Is the panel and the phone's camera of the tests in a browser.
//
//   photograph_panel rig RIG.toml            writes the rig that the panel's owner assumes
//   photograph_panel photo SHOWN.png PHOTO.png  photographs the panel that shows a frame
#include <exception>
#include <string>

#include "base/print.h"
#include "frames/image_io.h"
#include "optics/rig_file.h"
#include "tests/support/phone_camera.h"

int main(int argc, char** argv) {
  using namespace lenticule;
  try {
    test::PhoneCamera camera;
    const std::string action = argc > 1 ? argv[1] : "";
    if (action == "rig" && argc == 3) {
      optics::save_rig(camera.start(), argv[2]);
      return 0;
    }
    if (action == "photo" && argc == 4) {
      frames::write_woven(camera.photograph(frames::read_woven(argv[2])).view(), argv[3]);
      return 0;
    }
    say("usage: photograph_panel rig RIG.toml | photo SHOWN.png PHOTO.png\n");
  } catch (const std::exception& error) {
    say("photograph_panel: {}\n", std::string(error.what()));
  }
  return 2;
}
