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
    fs::copy_file(LENTICULE_FAKE_PICTURES, folder_ / "bin/lenticule-pictures");
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

/// A triangle with a choice of each kind.
constexpr const char* kChoices = R"({"asset": {"version": "2.0"},
  "extensionsUsed": ["KHR_materials_variants"],
  "extensions": {"KHR_materials_variants": {"variants": [{"name": "red"}, {"name": "blue"}]}},
  "buffers": [{"byteLength": 68, "uri": "data:application/octet-stream;base64,)"
                                 "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"
                                 "AAAAAAAAgD8AAAAAAAAAAAAAAAAAAKBAAAAAAAAAAAA="
                                 R"("}],
  "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 8},
    {"buffer": 0, "byteOffset": 44, "byteLength": 24}],
  "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
      "min": [0, 0, 0], "max": [1, 1, 0]},
    {"bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1]},
    {"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"}],
  "materials": [{"name": "plain"}, {"name": "blue paint"}],
  "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0, "extensions":
    {"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [1]}]}}}]}],
  "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}],
  "nodes": [{"name": "shape", "mesh": 0},
    {"name": "front", "camera": 0, "translation": [0, 0, 4]},
    {"name": "far", "camera": 0, "translation": [0, 0, 9]}],
  "scenes": [{"name": "whole", "nodes": [0, 1, 2]}, {"name": "bare", "nodes": [0]}],
  "animations": [{"name": "rest", "channels": [], "samplers": []},
    {"name": "fly", "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
     "samplers": [{"input": 1, "output": 2}]}]})";

TEST_F(ConfinedCommands, CommandsTakeThePartsOfAModelByNameOrNumber) {
  write("model.gltf", kChoices);
  const auto show = [&](std::vector<std::string> more) {
    return run(test::joined({"scene", "show", path("model.gltf")}, more));
  };
  const ProcessResult text = show({});
  for (const char* row :
       {"cameras    1 front (chosen), 2 far\n", "animations 1 rest (chosen), 2 fly\n",
        "variants   1 red, 2 blue\n", "scenes     1 whole (chosen), 2 bare\n"})
    EXPECT_NE(text.out.find(row), std::string::npos) << row << text.out << text.err;
  const auto json = nlohmann::json::parse(
      show({"--scene-camera", "far", "--animation", "2", "--variant", "blue", "--json"}).out);
  EXPECT_EQ(json["cameras"][0]["name"], "front") << "the order stays that of the file";
  EXPECT_FALSE(json["cameras"][0]["chosen"]);
  EXPECT_TRUE(json["cameras"][1]["chosen"]);
  EXPECT_TRUE(json["animations"][1]["chosen"]);
  EXPECT_TRUE(json["variants"][1]["chosen"]);
  EXPECT_EQ(json["duration_seconds"], 1.0);
  const auto bare = nlohmann::json::parse(show({"--scene", "bare", "--json"}).out);
  EXPECT_TRUE(bare["cameras"].empty());
  expect_end(show({"--variant", "green"}), 4, "model.gltf: no variant 'green'",
             "1 'red', 2 'blue'");

  const auto render = [&](std::vector<std::string> more) {
    expect_end(run(test::joined({"render", path("model.gltf"), "--rig", path("rig.toml"),
                                 "--overwrite", "-o", path("seen.png")},
                                more)),
               0);
    return test::read_text(path("seen.png"));
  };
  const std::string front = render({});
  EXPECT_EQ(render({"--scene-camera", "1"}), front);
  EXPECT_NE(render({"--scene-camera", "far"}), front);
  expect_end(run({"depth", path("model.gltf"), "--rig", path("rig.toml"), "--scene-camera", "top"}),
             4, "no camera 'top'", "1 'front', 2 'far'");
  expect_end(run({"render", path("model.gltf"), "--rig", path("rig.toml"), "--fit",
                  "--scene-camera", "far", "-o", path("o.png")}),
             2, "--fit");
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
