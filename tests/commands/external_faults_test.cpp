// SPDX-License-Identifier: Apache-2.0
// Tests that the film continues on full and read-only disks, removed folders, flooded sockets and
// closed terminals.
#include <fcntl.h>
#include <pty.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "base/unix_address.h"
#include "frames/ring/listen_socket.h"
#include "frames/ring/ring_renderer.h"
#include "optics/rig_file.h"
#include "tests/commands/player_stage.h"
#include "tests/commands/sequence_films.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {
namespace {

namespace fs = std::filesystem;

class ExternalFaults : public PlayerTest {
 protected:
  void SetUp() override {
    PlayerTest::SetUp();
    write_film("film", 100);
    fs::create_directories(path("run"));
  }
  [[nodiscard]] std::string film() const { return path("film/%03d.png"); }

  /// Returns true if this process may mount file systems for its children. Otherwise the tests
  /// cause the same errors by other means.
  [[nodiscard]] static bool may_mount() {
    static const bool may =
        run_process({"/bin/sh", "-c", "unshare -m mount -t tmpfs -o size=64k none /mnt"})
            .exit_code == 0;
    return may;
  }
  /// Returns a command that runs `words` after `mounts` in a mount namespace of their own.
  [[nodiscard]] static std::vector<std::string> among(const std::string& mounts,
                                                      const std::vector<std::string>& words) {
    const std::vector<std::string> all =
        joined({"/usr/bin/env", "unshare", "-m", "sh", "-c",
                "mount --make-rprivate / && " + mounts + " && exec \"$@\"", "sh"},
               words);
    return all;
  }
  /// Returns the path of a file in the player's mount namespace.
  [[nodiscard]] std::string seen_by_player(const std::string& file) const {
    return "/proc/" + std::to_string(player_->pid()) + "/root" + file;
  }
  /// Limits the size of every file that the player writes to `bytes` from now on.
  void limit_files(rlim_t bytes) const {
    rlimit limit{};
    ASSERT_EQ(prlimit(player_->pid(), RLIMIT_FSIZE, nullptr, &limit), 0);
    limit.rlim_cur = std::min(bytes, limit.rlim_max);
    ASSERT_EQ(prlimit(player_->pid(), RLIMIT_FSIZE, &limit, nullptr), 0);
  }
  static void fill(const std::string& file) {
    const int fd = open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    ASSERT_GE(fd, 0) << file;
    const std::string block(4096, 'x');
    while (write_some(fd, block) > 0) continue;
    close(fd);
  }
  static ssize_t write_some(int fd, const std::string& text) {
    return ::write(fd, text.data(), text.size());
  }
  [[nodiscard]] bool has_started() const {
    return comes_true([this] { return frames_shown() > 0; });
  }
  [[nodiscard]] json stats(const std::string& file) const {
    return json::parse(std::ifstream(file), nullptr, false);
  }
};

TEST_F(ExternalFaults, AFullRuntimeFolderIsReportedOnceAndTheFilmContinues) {
  const std::string run = path("run");
  std::vector<std::string> words =
      play_words(film(), {"--loop", "forever", "--stats", run + "/stats.json"});
  const bool mounts = may_mount();
  if (mounts) words = among("mount -t tmpfs -o size=64k none " + run, words);
  start(words);
  ASSERT_TRUE(has_started());
  const std::string seen = mounts ? seen_by_player(run) : run;
  ASSERT_TRUE(comes_true([&] { return fs::exists(seen + "/stats.json"); }));
  if (mounts)
    fill(seen + "/fill");
  else
    limit_files(16);
  ASSERT_TRUE(comes_true([&] { return says_about("write_problems", "stats.json: cannot write"); }));
  EXPECT_TRUE(film_continues());
  if (mounts)
    fs::remove(seen + "/fill");
  else
    limit_files(RLIM_INFINITY);
  const uint64_t shown = frames_shown();
  EXPECT_TRUE(comes_true([&] {
    const json written = stats(seen + "/stats.json");
    return written.is_object() && written.value("shown", uint64_t{0}) > shown;
  })) << "it is tried again";
  const ProcessResult played = quit();
  EXPECT_EQ(played.exit_code, 143) << played.err;
  const size_t first = played.err.find("cannot write");
  EXPECT_NE(first, std::string::npos) << played.err;
  EXPECT_EQ(played.err.find("cannot write", first + 1), std::string::npos) << played.err;
  EXPECT_NE(played.err.find("written again"), std::string::npos) << played.err;
}

TEST_F(ExternalFaults, PlaysOnAReadOnlyRoot) {
  fs::create_directories(path("out"));
  const std::vector<std::string> outputs = {"--loop",   "forever",
                                            "--stats",  path("out/stats.json"),
                                            "--record", "checksums:" + path("out/sums")};
  const bool mounts = may_mount();
  std::vector<std::string> words = play_words(film(), outputs);
  const std::string socket = path("run/c.sock");
  std::replace(words.begin(), words.end(), path("c.sock"), socket);
  if (mounts)
    words = among(
        "mount -t tmpfs -o size=64k none " + path("run") + " && mount -o remount,bind,ro /", words);
  start(words);
  socket_ = mounts ? seen_by_player(socket) : socket;
  ASSERT_TRUE(has_started());
  if (!mounts) limit_files(0);
  ASSERT_TRUE(comes_true([&] { return says_about("write_problems", "stats.json"); }));
  const json trim = asked({"trim", "--offset-by", "0.25"});
  EXPECT_EQ(trim.value("saved", true), false) << trim.dump();
  EXPECT_EQ(trim.value("offset_lenses", 0.0), 0.25) << "it holds all the same";
  EXPECT_EQ(ctl({"snapshot", path("snap.png")}).exit_code, 1);
  EXPECT_TRUE(film_continues());
  if (mounts) {
    EXPECT_TRUE(says_about("write_problems", "sums"));
  }
  expect_end(quit(), 1);
}

TEST_F(ExternalFaults, PlaysVideosWithoutTmp) {
  expect_end(run({"convert", film(), "-o", path("clip.mkv"), "--rate", "30"}), 0);
  std::vector<std::string> words =
      joined({"/usr/bin/env", "-u", "XDG_RUNTIME_DIR", "-u", "RUNTIME_DIRECTORY"},
             play_words(path("clip.mkv"), {"--loop", "forever"}));
  if (may_mount()) {
    // The test's folder and the programs may lie in /tmp, so they are mounted at /mnt; /tmp itself
    // is empty.
    fs::create_directories(path("programs"));
    const std::string programs = fs::path(LENTICULE_PROGRAM).parent_path().string();
    for (std::string& word : words)
      for (const auto& [from, to] : {std::pair{programs + "/", "/mnt/programs/"},
                                     std::pair{folder_.string() + "/", "/mnt/"}})
        if (word.starts_with(from)) word.replace(0, from.size(), to);
    words = among("mount --bind " + programs + " " + path("programs") + " && mount --rbind " +
                      folder_.string() + " /mnt && mount -t tmpfs -o ro,size=4k none /tmp",
                  words);
  } else {
    words.insert(words.begin() + 1, "RUNTIME_DIRECTORY=" + path("gone"));
  }
  start(words);
  ASSERT_TRUE(has_started());
  EXPECT_TRUE(film_continues());
  EXPECT_EQ(quit().exit_code, 143);
}

TEST_F(ExternalFaults, PlaysOnWhenTheLogsDiskIsFull) {
  const std::string log = may_mount() ? path("run/log") : "/dev/full";
  // SIGHUP would end a player that has a controlling terminal.
  std::vector<std::string> words =
      joined({"/bin/sh", "-c", "exec \"$@\" 2>" + log, "sh", "/usr/bin/env", "setsid"},
             play_words(film(), {"--loop", "forever"}));
  if (may_mount()) words = among("mount -t tmpfs -o size=16k none " + path("run"), words);
  start(words);
  ASSERT_TRUE(has_started());
  if (may_mount()) fill(seen_by_player(path("run/fill")));
  for (int k = 0; k < 3; ++k) {
    player_->signal(SIGHUP);  // makes the player log a reload
    EXPECT_TRUE(film_continues());
  }
  EXPECT_EQ(quit().exit_code, 143);
}

TEST_F(ExternalFaults, PlaysOnWhileTheControlSocketIsFlooded) {
  start(play_words(film(), {"--loop", "forever", "--record", "checksums:" + path("sums")}));
  ASSERT_TRUE(has_started());
  std::atomic<bool> over{false};
  const auto flood = [&] {
    const UnixAddress address = unix_address(socket_);
    std::vector<UniqueFd> held;
    while (!over) {
      UniqueFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
      if (::connect(fd.get(), address.get(), address.bytes) != 0) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        continue;
      }
      const std::string noise = held.size() % 2 == 0 ? "{" : "{\"do\":\"stats\"}\n";
      (void)::send(fd.get(), noise.data(), noise.size(), MSG_NOSIGNAL);
      held.push_back(std::move(fd));
      if (held.size() > 40) held.erase(held.begin(), held.begin() + 20);
    }
  };
  std::vector<std::thread> attackers;
  for (int k = 0; k < 3; ++k) attackers.emplace_back(flood);
  // Each request uses a connection of its own; some are answered in spite of the flood.
  EXPECT_TRUE(film_continues(120));
  over = true;
  for (std::thread& attacker : attackers) attacker.join();
  EXPECT_TRUE(film_continues());
  ASSERT_TRUE(comes_true([&] { return ctl({"status"}).exit_code == 0; }));
  expect_end(quit(), 143);
}

TEST_F(ExternalFaults, SixteenIdleClientsDoNotBlockANewOne) {
  start(play_words(film(), {"--loop", "forever"}));
  ASSERT_TRUE(has_started());
  const UnixAddress address = unix_address(socket_);
  std::vector<UniqueFd> idle;
  for (int k = 0; k < 16; ++k) {
    idle.emplace_back(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    ASSERT_EQ(::connect(idle.back().get(), address.get(), address.bytes), 0);
  }
  EXPECT_EQ(ctl({"status"}).exit_code, 0);
  EXPECT_EQ(quit().exit_code, 143);
}

TEST_F(ExternalFaults, PlaysOnWhenTheStatisticsFolderIsRemoved) {
  fs::create_directories(path("out"));
  start(play_words(film(), {"--loop", "forever", "--stats", path("out/stats.json")}));
  ASSERT_TRUE(has_started());
  fs::remove_all(path("out"));
  ASSERT_TRUE(comes_true([&] { return says_about("write_problems", "stats.json"); }));
  EXPECT_TRUE(film_continues());
  EXPECT_EQ(quit().exit_code, 1) << "the statistics are missing";
}

TEST_F(ExternalFaults, AnIncompleteOutputAtTheEndIsExitCodeOne) {
  const auto play = [&](std::vector<std::string> more) {
    return run(joined({"play", "card", "--rig", path("rig.toml"), "--display", "virtual:48x32@60",
                       "--clock", "simulated", "--duration", "1"},
                      more),
               {.largest_file_bytes = 10});
  };
  for (const std::vector<std::string>& output :
       {std::vector<std::string>{"--stats", path("stats.json")},
        {"--record", "checksums:" + path("sums")},
        {"--record", "png:" + path("shown")}}) {
    expect_end(play(output), 1, "cannot write", " vblanks, ");
  }
}

TEST_F(ExternalFaults, RefusesUnwritableOutputsBeforePlaying) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  for (const std::vector<std::string>& output :
       {std::vector<std::string>{"--stats", path("none/stats.json")},
        {"--stats", path("pipe")},
        {"--stats", "/dev/null"},
        {"--stats", path("film")},
        {"--record", "checksums:" + path("none/sums")},
        {"--record", "checksums:" + path("pipe")},
        {"--record", "png:" + path("pipe")}}) {
    const ProcessResult played = run(joined(
        {"play", film(), "--rig", path("rig.toml"), "--display", "virtual:48x32@60"}, output));
    expect_end(played, 1, "cannot write");
    EXPECT_EQ(played.err.find("playback continues"), std::string::npos) << played.err;
  }
}

// --- signals ----------------------------------------------------------------------------------

TEST_F(ExternalFaults, AClosedTerminalEndsThePlayerCleanly) {
  int terminal = -1;
  const pid_t child = forkpty(&terminal, nullptr, nullptr, nullptr);
  ASSERT_GE(child, 0);
  if (child == 0) {
    std::vector<std::string> words =
        play_words(film(), {"--loop", "forever", "--stats", path("stats.json")});
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    execv(argv[0], argv.data());
    _exit(127);
  }
  socket_ = path("c.sock");
  EXPECT_TRUE(has_started());
  close(terminal);
  int status = 0;
  const bool ended = comes_true([&] { return waitpid(child, &status, WNOHANG) == child; });
  if (!ended) kill(child, SIGKILL);
  ASSERT_TRUE(ended);
  ASSERT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 129);
  EXPECT_EQ(stats(path("stats.json")).value("outcome", ""), "interrupted");
  EXPECT_FALSE(fs::exists(path("c.sock")));
}

TEST_F(ExternalFaults, AHangupEndsAPlayerWithoutAControlSocket) {
  expect_end(run({"play", film(), "--rig", path("rig.toml"), "--display", "virtual:48x32@60",
                  "--loop", "forever", "--stats", path("stats.json")},
                 {.interrupt_signal = SIGHUP, .interrupt_after = std::chrono::milliseconds(1500)}),
             129);
  EXPECT_EQ(stats(path("stats.json")).value("outcome", ""), "interrupted");
}

TEST_F(ExternalFaults, WithoutATerminalAHangupReloadsTheList) {
  write_picture("other.png", 7);
  write("list.toml", "loop = \"forever\"\n[[item]]\nsource = \"film/%03d.png\"\n");
  start(joined({"/usr/bin/env", "setsid"}, play_words(path("list.toml"))));
  ASSERT_TRUE(has_started());
  write("list.toml", "loop = \"forever\"\n[[item]]\nsource = \"other.png\"\n");
  player_->signal(SIGHUP);
  ASSERT_TRUE(comes_true([&] { return displayed_level() == 7; }));
  expect_end(quit(), 143, "reloading");
}

// --- sequences without a frame ----------------------------------------------------------------

/// Films whose files are damaged while they are played. They have more frames than the pool.
class DamagedFilm : public ExternalFaults {
 protected:
  static constexpr int kNewLevel = 200;

  void SetUp() override {
    ExternalFaults::SetUp();
    write_film("new", kNewLevel);
    for (const auto& [name, level] : {std::pair("film", 100), {"new", kNewLevel}}) {
      const std::string film = path(name);
      write_sequence(film + ".lts", path("rig.toml"), static_cast<uint8_t>(level));
      expect_end(run({"convert", film + "/%03d.png", "-o", film + ".mkv", "--rate", "30"}), 0);
    }
  }
  [[nodiscard]] std::vector<std::string> files(const std::string& film) const {
    if (film.find('%') == std::string::npos) return {film};
    std::vector<std::string> all;
    for (int k = 0; k < kFilmFrames; ++k)
      all.push_back(film.substr(0, film.find('%')) + "00" + std::to_string(k) + ".png");
    return all;
  }
  /// Overwrites the files without replacing them, as cp and rsync --inplace do.
  void overwrite(const std::string& film,
                 const std::function<std::string(std::string)>& bytes) const {
    for (const std::string& file : files(film)) {
      const std::string now = bytes(file);
      std::ofstream(path(file), std::ios::binary) << now;
    }
  }
  void overwrite_with_noise(const std::string& film) const {
    overwrite(film, [this](const std::string& file) {
      return std::string(fs::file_size(path(file)), '\x5a');
    });
  }
  void overwrite_with_new(const std::string& film) const {
    overwrite(film,
              [this](const std::string& file) { return read_text(path("new" + file.substr(4))); });
  }
  void start_film(const std::string& film, std::vector<std::string> more) {
    more.insert(more.end(), {"--slots", film.ends_with(".mkv") ? "8" : "5"});
    start(play_words(path(film), std::move(more)));
    ASSERT_TRUE(has_started());
  }
  [[nodiscard]] bool has_problem() const {
    return comes_true([&] { return status().value("last_problem", "") != ""; });
  }
  [[nodiscard]] bool shows_new() const {
    return comes_true([this] { return displayed_level() >= kNewLevel; });
  }
};

TEST_F(DamagedFilm, StaysOnThePanelUntilTheNewOneIsWhole) {
  for (const std::string film : {"film.lts", "film/%03d.png", "film.mkv"}) {
    start_film(film, {"--loop", film == "film.lts" ? "1000" : "forever"});
    EXPECT_TRUE(comes_true([&] { return asked({"stats"})["statistics"].value("loops", 0) > 1; }));
    overwrite_with_noise(film);
    EXPECT_TRUE(has_problem()) << film;
    EXPECT_LT(displayed_level(), kNewLevel) << film;
    overwrite(film, [](const std::string&) { return ""; });
    overwrite_with_new(film);
    EXPECT_TRUE(shows_new()) << film << status();
    EXPECT_TRUE(film_continues()) << film;
    EXPECT_EQ(quit().exit_code, 143) << film;
  }
}

TEST_F(DamagedFilm, WithoutAReplacementIsFollowedByATestCard) {
  start_film("film.lts", {"--loop", "forever"});
  overwrite("film.lts", [](const std::string&) { return ""; });
  EXPECT_TRUE(comes_true([&] { return status()["displayed"]["source"] == "card"; })) << status();
  overwrite_with_new("film.lts");
  EXPECT_TRUE(comes_true([&] { return status()["displayed"]["source"] != "card"; })) << status();
  EXPECT_EQ(quit().exit_code, 143);
}

class EmptySequence : public ExternalFaults {
 protected:
  void wait_for_ring() const {
    ASSERT_TRUE(comes_true([this] { return fs::exists(path("ring.sock")); }));
  }
  [[nodiscard]] std::unique_ptr<frames::RingRenderer> renderer() const {
    return frames::RingRenderer::connect(
        path("ring.sock"),
        {.name = "test",
         .rig_fingerprint = optics::fingerprint(optics::load_rig(path("rig.toml"))),
         .rate = std::nullopt,
         .frame_count = std::nullopt},
        kPlayerTimeout);
  }
  void say_goodbye_without_a_frame() const { renderer()->finish(); }
  void send_frame() const {
    const auto one = renderer();
    std::span<uint8_t> pixels;
    ASSERT_EQ(one->acquire(0, kPlayerTimeout, pixels), frames::RingStatus::Ok);
    std::fill(pixels.begin(), pixels.end(), uint8_t{9});
    ASSERT_EQ(one->publish(), frames::RingStatus::Ok);
    one->finish();
  }
};

TEST_F(EmptySequence, ALoopingRingWaitsForTheNextRenderer) {
  start(play_words("ring:" + path("ring.sock"), {"--loop", "forever", "--wait", "forever"}));
  wait_for_ring();
  say_goodbye_without_a_frame();
  say_goodbye_without_a_frame();
  send_frame();
  EXPECT_TRUE(comes_true([this] { return displayed_level() == 9; }));
  EXPECT_EQ(quit().exit_code, 143);
}

TEST_F(EmptySequence, ARendererThatFreezesIsAProblemUntilItContinues) {
  start(play_words("ring:" + path("ring.sock"), {"--loop", "forever", "--wait", "forever"}));
  wait_for_ring();
  const auto one = renderer();
  const auto send = [&](uint64_t number) {
    std::span<uint8_t> pixels;
    ASSERT_EQ(one->acquire(number, kPlayerTimeout, pixels), frames::RingStatus::Ok);
    ASSERT_EQ(one->publish(), frames::RingStatus::Ok);
  };
  send(0);
  EXPECT_TRUE(comes_true([this] { return status()["state"] == "stalled"; }));
  EXPECT_TRUE(says_about("reason", "no frame arrives"));
  for (uint64_t number = 1; status()["state"] == "stalled"; ++number) send(number);
  EXPECT_EQ(status()["state"], "playing");
  const ProcessResult played = quit();
  EXPECT_NE(played.err.find("no frame arrives"), std::string::npos) << played.err;
  EXPECT_NE(played.err.find("continues after"), std::string::npos) << played.err;
}

TEST_F(EmptySequence, ALoopingRingWaitsWithoutAControlSocket) {
  start({LENTICULE_PROGRAM, "play", "ring:" + path("ring.sock"), "--rig", path("rig.toml"),
         "--display", "virtual:48x32@60", "--loop", "forever", "--wait", "forever", "--stats",
         path("stats.json")});
  wait_for_ring();
  say_goodbye_without_a_frame();
  send_frame();
  EXPECT_TRUE(comes_true([this] {
    const json written = stats(path("stats.json"));
    return written.is_object() && written.value("shown", 0) > 0;
  }));
  player_->signal(SIGTERM);
  EXPECT_EQ(player_->wait(kPlayerTimeout).exit_code, 143);
}

TEST_F(EmptySequence, AsTheOnlySourceIsAnInputError) {
  start({LENTICULE_PROGRAM, "play", "ring:" + path("ring.sock"), "--rig", path("rig.toml"),
         "--display", "virtual:48x32@60"});
  wait_for_ring();
  say_goodbye_without_a_frame();
  expect_end(player_->wait(kPlayerTimeout), 4, "contains no frame");
}

TEST_F(EmptySequence, InAListIsSkippedWithAReason) {
  write("list.toml",
        "[[item]]\nsource = \"ring:" + path("ring.sock") +
            "\"\nwait_s = 60\n[[item]]\nsource = \"film/%03d.png\"\nloops = \"forever\"\n");
  start(play_words(path("list.toml")));
  wait_for_ring();
  say_goodbye_without_a_frame();
  EXPECT_TRUE(film_continues());
  EXPECT_EQ(status().value("items_skipped", 0), 1);
  const ProcessResult played = quit();
  EXPECT_NE(played.err.find("it contains no frame"), std::string::npos) << played.err;
}

}  // namespace
}  // namespace lenticule::test
