// SPDX-License-Identifier: Apache-2.0
// Tests output that cannot be printed, and untrusted names in messages and results.
#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "tests/commands/program.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {
namespace {

using nlohmann::json;

/// Sets the title of a terminal, clears the screen and starts a forged line.
constexpr const char* kHostile = "\x1b]0;owned\x07\x1b[2J\nlenticule: all is well\xc2\x9b\xff";

class Output : public CommandTest {
 protected:
  const std::string rig = source_file("scenes/rigs/kiosk-27-1080.toml");

  /// Runs `script` in a shell; "$1" is the program, "$2" the rig and "$3" the test's folder.
  [[nodiscard]] ProcessResult shell(const std::string& script) const {
    return run_process({"/bin/sh", "-c", script, "sh", LENTICULE_PROGRAM, rig, folder_.string()});
  }

  /// Expects nothing but printable text and line ends.
  static void expect_harmless(const std::string& text) {
    for (const char c : text)
      EXPECT_TRUE(c == '\n' || (c >= ' ' && c != 0x7f) || static_cast<unsigned char>(c) >= 0xa0)
          << "byte " << static_cast<int>(c) << " in "
          << json(text).dump(-1, ' ', true, json::error_handler_t::replace);
    EXPECT_EQ(text.find("\nlenticule: all is well"), std::string::npos) << text;
    EXPECT_EQ(text.find('\x9b'), std::string::npos);
  }
};

constexpr const char* kPlay =
    R"("$1" play card --rig "$2" --display virtual --duration 1 --stats "$3/stats.json")";

TEST_F(Output, PlayingContinuesWhenTheLogsDiskIsFull) {
  expect_end(shell(std::string(kPlay) + " 2>/dev/full"), 0);
  const json stats = json::parse(std::ifstream(path("stats.json")));
  EXPECT_EQ(stats.at("outcome"), "finished");
}

TEST_F(Output, PlayingContinuesWhenTheLogsReaderIsGone) {
  const ProcessResult played =
      shell("{ " + std::string(kPlay) + " 2>&1 >/dev/null; echo $? >\"$3/code\"; } | true");
  std::string code;
  std::ifstream(path("code")) >> code;
  EXPECT_EQ(code, "0") << played.err;
}

TEST_F(Output, DroppedLogLinesAreCountedInTheStatistics) {
  // The picture is read before the panel is found; only then is a line due.
  expect_end(shell(R"("$1" play card --rig "$2" --display kms:HDMI-A-99 --wait-for-panel 1 )"
                   R"(--stats "$3/stats.json" 2>/dev/full)"),
             3);
  const json stats = json::parse(std::ifstream(path("stats.json")));
  EXPECT_GE(stats.at("log_lines_dropped").get<int>(), 1) << stats.dump(1);
}

TEST_F(Output, ErrorsThatCannotBePrintedKeepTheirExitCode) {
  EXPECT_EQ(shell(R"("$1" rig show "$3/none.toml" 2>/dev/full)").exit_code, 4);
  EXPECT_EQ(shell(R"("$1" rig sohw 2>/dev/full)").exit_code, 2);
  EXPECT_EQ(shell(R"("$1" rig show "$3/none.toml" 2>&-)").exit_code, 4);
}

TEST_F(Output, ResultsThatCannotBePrintedAreAFailureWithAReason) {
  for (const char* command : {"rig show \"$2\"", "rig show \"$2\" --json", "rig check \"$2\"",
                              "scene list", "scene teapot", "completion bash", "man", "bench list",
                              "bench list --json", "--help", "rig --help", "--version",
                              "play card --rig \"$2\" --display virtual --duration 0.2 --json"}) {
    expect_end(shell(std::string("\"$1\" ") + command + " >/dev/full"), 1,
               "standard output: cannot write: No space left on device");
  }
  expect_end(shell(R"("$1" rig show "$2" >&-)"), 1, "standard output: cannot write");
}

TEST_F(Output, NamesFromOutsideAreEscapedInMessages) {
  const std::string name = path(kHostile);
  for (const auto& arguments : std::vector<std::vector<std::string>>{
           {"rig", "show", name},
           {"render", name, "--rig", rig, "-o", path("o.png")},
           {"play", name + ".lts", "--rig", rig},
           {"play", "ring:" + name, "--rig", rig, "--wait", "1"},
           {"convert", name, "-o", path("o.lts")},
           {"compare", name, name},
           {"eye", name, "--rig", rig, "--eye", "0,0,700", "-o", path("o.png")},
           {"ctl", "--socket", name, "status"},
           {kHostile},
           {"rig", kHostile},
           {"rig", "show", rig, std::string("--") + kHostile},
           {"scene", kHostile, "-o", path("o.nff")}}) {
    const ProcessResult result = run(arguments);
    EXPECT_NE(result.exit_code, 0) << result.out;
    EXPECT_EQ(result.signal, 0);
    expect_harmless(result.err + result.out);
    EXPECT_NE(result.err.find("\\x1b]0;owned\\x07"), std::string::npos) << result.err;
  }
}

TEST_F(Output, NamesFromOutsideAreEscapedInResults) {
  const std::string name = path("\x1b[31m\xff.toml");
  std::filesystem::copy_file(rig, name);
  for (const char* action : {"show", "check"}) {
    const ProcessResult text = run({"rig", action, name});
    EXPECT_EQ(text.exit_code, 0) << text.err;
    expect_harmless(text.out + text.err);
    const ProcessResult as_json = run({"rig", action, name, "--json"});
    EXPECT_EQ(as_json.exit_code, 0) << as_json.err;
    expect_harmless(as_json.out);
    EXPECT_TRUE(json::accept(as_json.out)) << as_json.out;
  }
}

TEST_F(Output, APlaylistsTitlesAndItemsAreEscaped) {
  write("list.toml", "format = 1\n[[item]]\nsource = \"\\u001b[2J\\u0007\\u009b.png\"\n");
  const ProcessResult played = run({"play", path("list.toml"), "--rig", rig, "--display", "virtual",
                                    "--stats", path("stats.json"), "--json"});
  EXPECT_NE(played.exit_code, 0);
  expect_harmless(played.err);
  expect_harmless(played.out);
  expect_harmless(read_text(path("stats.json")));
}

TEST_F(Output, ErrorsAreJsonOnRequest) {
  struct Case {
    std::vector<std::string> arguments;
    int exit_code;
    const char* kind;
  };
  for (const Case& one : std::vector<Case>{
           {{"rig", "show", path("none.toml"), "--json"}, 4, "input"},
           {{"rig", "show", path(kHostile), "--json"}, 4, "input"},
           {{"rig", "sohw", "--json"}, 2, "usage"},
           {{"--json"}, 2, "usage"},
           {{"play", "--json"}, 2, "usage"},
           {{"play", path("none.png"), "--rig", rig, "--display", "virtual", "--json"}, 4, "input"},
           {{"ctl", "--socket", path("none"), "status", "--json"}, 3, "device"}}) {
    const ProcessResult result = run(one.arguments);
    EXPECT_EQ(result.exit_code, one.exit_code) << result.err;
    EXPECT_TRUE(result.out.empty()) << result.out;
    ASSERT_FALSE(result.err.empty());
    const std::string lines = result.err.substr(0, result.err.size() - 1);
    const json error = json::parse(lines.substr(lines.rfind('\n') + 1), nullptr, false);
    ASSERT_TRUE(error.is_object()) << result.err;
    EXPECT_EQ(error.at("kind"), one.kind) << result.err;
    EXPECT_EQ(error.at("exit_code"), one.exit_code);
    EXPECT_FALSE(error.at("error").get<std::string>().empty());
    EXPECT_TRUE(error.at("hint").is_string());
  }
}

TEST_F(Output, SuggestsTheNearestCommandOrFlag) {
  struct Case {
    std::vector<std::string> arguments;
    const char* error;
    const char* hint;
  };
  for (const Case& one :
       std::vector<Case>{{{"plya", "film.lts", "--rig", rig},
                          "no command 'plya'",
                          "did you mean 'play'? see lenticule --help"},
                         {{"rig", "shwo", rig},
                          "rig: no command 'shwo'",
                          "did you mean 'show'? see lenticule rig --help"},
                         {{"calibrate", "photo"},
                          "calibrate: no command 'photo'",
                          "did you mean 'photos'? see lenticule calibrate --help"},
                         {{"rig", "show", rig, "--jsno"},
                          "rig show: no flag '--jsno'",
                          "did you mean '--json'? see lenticule rig show --help"},
                         {{"play", "card", "--rgi=" + rig},
                          "play: no flag '--rgi'",
                          "did you mean '--rig'? see lenticule play --help"},
                         {{"xyzzy"}, "no command 'xyzzy'", "see lenticule --help"},
                         {{"rig"}, "rig: a command is missing", "see lenticule rig --help"},
                         {{"rig", "show", rig, "more"},
                          "rig show: 'more' was not expected",
                          "see lenticule rig show --help"}}) {
    const ProcessResult result = run(one.arguments);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_EQ(result.err, std::string("lenticule: ") + one.error + "\n  " + one.hint + "\n");
  }
}

// --- the pages about statistics -----------------------------------------------------------------

/// Adds the object's keys, and those of objects in it as "outer.inner".
void add_keys(const json& object, const std::string& outer, std::set<std::string>& keys) {
  for (const auto& [key, value] : object.items()) {
    keys.insert(outer + key);
    if (value.is_object()) add_keys(value, outer + key + ".", keys);
  }
}

std::string page(const std::string& name) { return read_text(source_file("docs/play/" + name)); }

/// Returns the names in the first cells of the page's tables.
std::set<std::string> documented_keys(const std::string& text) {
  const std::regex row("(?:^|\n)\\| (`[a-z0-9_.]+`(?:, `[a-z0-9_.]+`)*) \\|"), name("[a-z0-9_.]+");
  std::set<std::string> keys;
  for (std::sregex_iterator at(text.begin(), text.end(), row), end; at != end; ++at) {
    const std::string cell = (*at)[1];
    for (std::sregex_iterator key(cell.begin(), cell.end(), name); key != end; ++key)
      keys.insert(key->str());
  }
  return keys;
}

TEST_F(Output, ThePageOfStatisticsNamesEveryKeyAndNoOther) {
  const std::string tiny = path("tiny.toml");
  std::filesystem::copy_file(source_file("scenes/rigs/tiny.toml"), tiny);
  ASSERT_EQ(run({"render", "builtin:gears:1", "--rig", tiny, "-o", path("film.lts")}).exit_code, 0);
  ASSERT_EQ(run({"rig", "trim", tiny, "--offset-by", "0.01"}).exit_code, 0);
  write("list.toml", "[[item]]\nsource = \"film.lts\"\n");
  write("wall.toml",
        "format = 1\nviewer_mm = [0, 0, 500]\n[[panel]]\nname = \"one\"\nrig = \"tiny.toml\"\n"
        "centre_mm = [-12.5, 0, 0]\n[[panel]]\nname = \"two\"\nrig = \"tiny.toml\"\n"
        "centre_mm = [12.5, 0, 0]\n");
  std::set<std::string> keys;
  const auto play = [&](std::vector<std::string> words, int exit_code) {
    words.insert(words.begin(), "play");
    words.insert(words.end(), {"--duration", "0.5", "--stats", path("stats.json")});
    expect_end(run(words), exit_code);
    add_keys(json::parse(std::ifstream(path("stats.json"))), "", keys);
  };
  play({path("film.lts"), "--rig", tiny, "--display", "virtual", "--clock", "simulated", "--safe",
        "--record", "checksums:" + path("sums")},
       0);
  play({path("list.toml"), "--rig", tiny, "--display", "virtual", "--control", path("c.sock"),
        "--proof", "journal"},
       0);
  play({"black", "--wall", path("wall.toml"), "--display", "virtual"}, 0);
  play({path("film.lts"), "--rig", tiny, "--display", "virtual", "--step", "two", "--leader",
        "--step-address", path("step.sock")},
       0);
  play({"card", "--rig", tiny, "--display", "kms:HDMI-A-99", "--wait-for-panel", "1"}, 3);

  const std::string text = page("statistics.md") + page("step.md") + page("sound.md");
  const auto named = [&](const std::string& key) {
    return text.find("`" + key + "`") != std::string::npos;
  };
  for (const std::string& key : keys)
    EXPECT_TRUE(named(key) || named(key.substr(key.rfind('.') + 1))) << key << " is missing";
  // These need a graphics card or a camera.
  keys.insert(
      {"exactness", "kms", "kms.largest_skew_us", "kms.one_commit", "live", "video_decoder"});
  for (const std::string& key : documented_keys(page("statistics.md")))
    EXPECT_TRUE(keys.contains(key)) << key << " does not exist";
}

}  // namespace
}  // namespace lenticule::test
