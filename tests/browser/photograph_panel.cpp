// SPDX-License-Identifier: Apache-2.0
// Is the panel and the phone's camera of the tests in a browser.
//
//   photograph_panel rig RIG.toml
//     writes the rig that the panel's owner assumes
//   photograph_panel photo SHOWN.png PHOTO.jpg N
//     photographs the panel that shows a frame, from place N
//   photograph_panel error RIG.toml
//     prints the largest phase error of a rig, in lenses

#include <exception>
#include <string>
#include <vector>

#include "base/numbers.h"
#include "base/print.h"
#include "frames/image_io.h"
#include "optics/rig_file.h"
#include "tests/support/small_workshop.h"

int main(int argc, char** argv) {
  using namespace lenticule;
  try {
    test::HandHeldPhone phone;
    const std::vector<std::string> words(argv + 1, argv + argc);
    const std::string action = words.empty() ? "" : words[0];
    if (action == "rig" && words.size() == 2) {
      optics::save_rig(phone.start(), words[1]);
      return 0;
    }
    if (action == "photo" && words.size() == 4) {
      phone.photograph(frames::read_woven(words[1]), number_from<size_t>(words[3]).value_or(0),
                       words[2]);
      return 0;
    }
    if (action == "error" && words.size() == 2) {
      print_out("{:.4f}\n", phone.error_of(optics::load_rig(words[1])));
      return 0;
    }
    say("usage: photograph_panel rig RIG.toml | photo SHOWN.png PHOTO.jpg N | error RIG.toml\n");
  } catch (const std::exception& error) {
    say("photograph_panel: {}\n", std::string(error.what()));
  }
  return 2;
}
