// SPDX-License-Identifier: Apache-2.0
// Tests commands whose decoders of pictures or readers of models break: each command ends with an
// error of the file, or goes on without it.
#include <chrono>
#include <csignal>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "tests/commands/program.h"

namespace lenticule {
namespace {

namespace fs = std::filesystem;
using test::expect_end;
using test::ProcessResult;

/// Copies the programs, of which the fakes do what the text of a picture and the name of a model
/// say.
class ConfinedCommands : public test::CommandTest {
 protected:
  ConfinedCommands() {
    const fs::path programs = fs::path(LENTICULE_PROGRAM).parent_path();
    fs::create_directory(folder_ / "bin");
    for (const char* name : {"lenticule", "lenticule-tools"})
      fs::copy_file(programs / name, folder_ / "bin" / name);
    fs::copy_file(LENTICULE_FAKE_PICTURES, folder_ / "bin/lenticule-video");
    fs::copy_file(LENTICULE_READER_PROGRAM, folder_ / "bin/lenticule-reader");
    fs::copy_file(test::source_file("scenes/rigs/tiny.toml"), path("rig.toml"));
    write("crash.tif", "crash");
    write("liar.tif", "sends too many rows");
  }

  [[nodiscard]] ProcessResult run(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), path("bin/lenticule"));
    return test::run_process(arguments, {});
  }
};

TEST_F(ConfinedCommands, APictureThatEndsItsDecoderIsAnErrorOfEveryCommand) {
  const auto commands_with = [&](const std::string& picture) {
    return std::vector<std::vector<std::string>>{
        {"convert", picture, "-o", path("o.png")},
        {"weave", picture, "--grid", "1x1", "--rig", path("rig.toml"), "-o", path("o.png")},
        {"eye", picture, "--rig", path("rig.toml"), "--eye", "0,0,600", "-o", path("o.png")},
        {"compare", picture, picture}};
  };
  for (const std::vector<std::string>& command : commands_with(path("crash.tif"))) {
    SCOPED_TRACE(command.front());
    expect_end(run(command), 4, "crash.tif: its decoder was ended by signal 6",
               "save it again as PNG");
  }
  for (const std::vector<std::string>& command : commands_with(path("liar.tif"))) {
    SCOPED_TRACE(command.front());
    expect_end(run(command), 4, "liar.tif: its decoder answered out of order");
  }
  EXPECT_FALSE(fs::exists(path("o.png")));
}

TEST_F(ConfinedCommands, AModelIsShownWithoutATextureThatEndsItsDecoder) {
  write("paint.mtl", "newmtl paint\nmap_Kd crash.tif\n");
  write("model.obj",
        "mtllib paint.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl paint\nf 1/1 2/1 3/1\n");
  const ProcessResult shown = run({"scene", "show", path("model.obj"), "--json"});
  EXPECT_NE(shown.out.find("crash.tif: its decoder was ended by signal 6"), std::string::npos)
      << shown.out << shown.err;
  EXPECT_EQ(shown.exit_code, 0);
  expect_end(run({"render", path("model.obj"), "--rig", path("rig.toml"), "-o", path("o.png")}), 0,
             "crash.tif");
}

TEST_F(ConfinedCommands, AModelThatEndsItsReaderIsAnErrorOfEveryCommand) {
  fs::remove(folder_ / "bin/lenticule-reader");
  fs::copy_file(LENTICULE_FAKE_READER, folder_ / "bin/lenticule-reader");
  for (const char* name : {"crash.obj", "large-piece.obj", "noise.obj"}) {
    write(name, "v 0 0 0\n");
    for (const std::vector<std::string>& command : std::vector<std::vector<std::string>>{
             {"scene", "show", path(name)},
             {"render", path(name), "--rig", path("rig.toml"), "-o", path("o.png")}}) {
      SCOPED_TRACE(command.front());
      expect_end(run(command), 4, path(name), "its reader", "save it again");
    }
  }
}

TEST_F(ConfinedCommands, ACommandThatIsInterruptedWhileItReadsAModelEndsAsAnyInterruptedOne) {
  fs::remove(folder_ / "bin/lenticule-reader");
  fs::copy_file(LENTICULE_FAKE_READER, folder_ / "bin/lenticule-reader");
  write("spin.obj", "v 0 0 0\n");
  for (const auto& [signal, exit_code] : {std::pair(SIGINT, 130), {SIGTERM, 143}}) {
    const ProcessResult result =
        test::run_process({path("bin/lenticule"), "scene", "show", path("spin.obj")},
                          {.interrupt_signal = signal, .interrupt_after = std::chrono::seconds(2)});
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_EQ(result.out, "");
  }
}

}  // namespace
}  // namespace lenticule
