// SPDX-License-Identifier: Apache-2.0
// Tests temporary files and folders: leftovers of killed processes are removed, files in use stay.
#include "base/temporary.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <functional>
#include <thread>

#include "base/error.h"
#include "base/file.h"
#include "tests/support/scratch_folder.h"

namespace lenticule {
namespace {

using test::ScratchFolder;
namespace fs = std::filesystem;

/// Runs `work` in a child process, which then waits; kills the child at the end of the scope.
class Owner {
 public:
  explicit Owner(const std::function<void()>& work) {
    std::array<int, 2> ready{};
    if (pipe(ready.data()) != 0) std::abort();
    pid_ = fork();
    if (pid_ == 0) {
      work();
      (void)!write(ready[1], "x", 1);
      while (true) pause();
    }
    close(ready[1]);
    char byte = 0;
    started_ = read(ready[0], &byte, 1) == 1;
    close(ready[0]);
  }
  ~Owner() { kill_it(); }
  Owner(const Owner&) = delete;
  Owner& operator=(const Owner&) = delete;
  [[nodiscard]] bool started() const { return started_; }
  void kill_it() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }

 private:
  pid_t pid_ = -1;
  bool started_ = false;
};

TEST(TemporaryFile, ReplacesItsTargetWhenKept) {
  const ScratchFolder folder;
  write_text_file(folder / "a", "old");
  {
    TemporaryFile file(folder / "a");
    ASSERT_EQ(write(file.fd(), "new", 3), 3);
    EXPECT_EQ(read_text_file(folder / "a", 100), "old");
    file.replace_target();
  }
  EXPECT_EQ(read_text_file(folder / "a", 100), "new");
  EXPECT_EQ(folder.entries(), 1u);
}

TEST(TemporaryFile, IsRemovedUnlessKept) {
  const ScratchFolder folder;
  { const TemporaryFile file(folder / "a"); }
  EXPECT_EQ(folder.entries(), 0u);
}

TEST(TemporaryFile, ReplacesTheTargetOfALink) {
  const ScratchFolder folder;
  write_text_file(folder / "a", "old");
  fs::create_symlink("a", folder / "link");
  write_text_file(folder / "link", "new");
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_EQ(read_text_file(folder / "a", 100), "new");
}

TEST(TemporaryFile, RefusesTargetsThatAreNotRegularFiles) {
  const ScratchFolder folder;
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_THROW(TemporaryFile(folder / "pipe"), Error);
  EXPECT_THROW(TemporaryFile(folder.path()), Error);
  EXPECT_THROW(TemporaryFile(folder / "none" / "a"), Error);
  EXPECT_EQ(folder.entries(), 1u);
}

/// The mode of a new file follows the umask, and writing does not change the umask.
TEST(TemporaryFile, HasTheModeOfTheUmask) {
  const ScratchFolder folder;
  const mode_t before = umask(027);
  write_text_file(folder / "a", "x");
  EXPECT_EQ(umask(before), 027u);
  struct stat status {};
  ASSERT_EQ(stat((folder / "a").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777u, 0640u);
}

TEST(TextFiles, DoNotChangeTheUmaskOfOtherThreads) {
  const ScratchFolder folder;
  const mode_t before = umask(077);
  std::atomic<bool> done{false};
  std::thread writer([&] {
    for (int n = 0; n < 50; ++n) write_text_file(folder / "text", "x");
    done = true;
  });
  int others = 0;
  const fs::path mine = folder / "mine";
  while (!done) {
    const int fd = open(mine.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    struct stat status {};
    if (fd < 0 || fstat(fd, &status) != 0 || (status.st_mode & 0777u) != 0600u) ++others;
    close(fd);
    unlink(mine.c_str());
  }
  writer.join();
  umask(before);
  EXPECT_EQ(others, 0);
}

TEST(Leftovers, OfAKilledProcessAreRemovedAndFilesInUseStay) {
  const ScratchFolder folder;
  Owner dead([&] { new TemporaryFile(folder / "a"); });
  Owner alive([&] { new TemporaryFile(folder / "b"); });
  ASSERT_TRUE(dead.started() && alive.started());
  EXPECT_EQ(sweep_leftovers(folder.path()), 0u);
  EXPECT_EQ(folder.entries(), 2u);
  dead.kill_it();
  EXPECT_EQ(sweep_leftovers(folder.path()), 1u);
  EXPECT_EQ(folder.entries(), 1u);
  alive.kill_it();
  { const TemporaryFile next(folder / "c"); }  // creating a temporary file removes leftovers
  EXPECT_EQ(folder.entries(), 0u);
}

TEST(Leftovers, FoldersOfAKilledProcessAreRemovedWithTheirContents) {
  const ScratchFolder folder;
  Owner owner([&] {
    const auto* kept = new TemporaryFolder(folder.path());
    write_text_file(kept->path() / "a", "x");
  });
  ASSERT_TRUE(owner.started());
  { const TemporaryFolder other(folder.path()); }
  EXPECT_EQ(folder.entries(), 1u);
  owner.kill_it();
  { const TemporaryFolder other(folder.path()); }
  EXPECT_EQ(folder.entries(), 0u);
}

/// A child that inherited the file, such as an encoder, counts as an owner.
TEST(Leftovers, OfAProcessWhoseChildStillWritesStay) {
  const ScratchFolder folder;
  std::array<int, 2> child{};
  ASSERT_EQ(pipe(child.data()), 0);
  Owner owner([&] {
    new TemporaryFile(folder / "a");
    const pid_t heir = fork();
    if (heir == 0)
      while (true) pause();
    (void)!write(child[1], &heir, sizeof heir);
  });
  pid_t heir = 0;
  ASSERT_EQ(read(child[0], &heir, sizeof heir), ssize_t{sizeof heir});
  owner.kill_it();
  EXPECT_EQ(sweep_leftovers(folder.path()), 0u);
  ASSERT_GT(heir, 0);
  kill(heir, SIGKILL);
  for (int tries = 0; tries < 1000 && sweep_leftovers(folder.path()) == 0; ++tries) usleep(10000);
  EXPECT_EQ(folder.entries(), 0u);
  close(child[0]);
  close(child[1]);
}

TEST(Leftovers, OtherFilesAreNeverRemoved) {
  const ScratchFolder folder;
  for (const char* name : {".lenticule-1-0.tmp", "lenticule-1-0.unfinished", ".lenticule-notes",
                           "a.unfinished", ".lenticule-unfinished-x", "film.lts.part"})
    write_text_file(folder / name, "x");
  write_text_file(folder / "keep", "x");
  fs::create_symlink("keep", folder / ".lenticule-9-9.unfinished");
  ASSERT_EQ(mkfifo((folder / ".lenticule-9-8.unfinished").c_str(), 0600), 0);
  EXPECT_EQ(sweep_leftovers(folder.path()), 0u);
  EXPECT_EQ(folder.entries(), 9u);
}

}  // namespace
}  // namespace lenticule
