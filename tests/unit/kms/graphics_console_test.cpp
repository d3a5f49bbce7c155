// SPDX-License-Identifier: Apache-2.0
// Tests that the text console is in graphics mode while frames are shown, and restored however the
// player ends.
#include "display/kms/device/graphics_console.h"

#include <fcntl.h>
#include <linux/kd.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>

#include "kms_stage.h"

namespace lenticule::test {

using display::GraphicsConsole;
using display::restore_console_now;

class Console : public ::testing::Test {
 protected:
  Console() { terminal->open_error = 0; }

  static void (*handler_of(int signal))(int) {
    struct sigaction action {};
    sigaction(signal, nullptr, &action);
    return action.sa_handler;
  }
  /// Runs `what` in a child process and returns the exit status.
  template <typename What>
  static int status_of_child(What what) {
    const pid_t child = fork();
    if (child == 0) {
      what();
      _exit(0);
    }
    int status = -1;
    EXPECT_EQ(waitpid(child, &status, 0), child);
    return status;
  }

  std::shared_ptr<FakeTerminal> terminal = std::make_shared<FakeTerminal>();
};

TEST_F(Console, SetsAndRestoresGraphicsMode) {
  {
    const GraphicsConsole console(terminal);
    EXPECT_TRUE(console.active());
    EXPECT_EQ(terminal->mode, KD_GRAPHICS);
  }
  EXPECT_EQ(terminal->mode, KD_TEXT);
  EXPECT_EQ(terminal->modes_set(), (std::vector<int>{KD_GRAPHICS, KD_TEXT}));
  EXPECT_EQ(terminal->opened, 0);
}

TEST_F(Console, DoesNothingWithoutAConfigurableTerminal) {
  const std::vector<std::function<void(FakeTerminal&)>> spoils = {
      [](FakeTerminal& t) { t.open_error = ENXIO; },   // a service without a terminal
      [](FakeTerminal& t) { t.get_error = ENOTTY; },   // a serial line or a terminal window
      [](FakeTerminal& t) { t.set_error = EPERM; },    // a terminal of another user
      [](FakeTerminal& t) { t.foreground = false; }};  // Ctrl-C would not arrive
  for (const auto& spoil : spoils) {
    const auto spoiled = std::make_shared<FakeTerminal>();
    spoiled->open_error = 0;
    spoil(*spoiled);
    EXPECT_FALSE(GraphicsConsole(spoiled).active());
    EXPECT_EQ(spoiled->mode, KD_TEXT);
    EXPECT_TRUE(spoiled->modes_set().empty());
    EXPECT_EQ(spoiled->opened, 0);
    EXPECT_EQ(handler_of(SIGHUP), SIG_DFL);
  }
}

TEST_F(Console, GraphicsModeOfAnotherProgramStays) {
  terminal->mode = KD_GRAPHICS;
  EXPECT_FALSE(GraphicsConsole(terminal).active());
  EXPECT_EQ(terminal->mode, KD_GRAPHICS);
  EXPECT_TRUE(terminal->modes_set().empty());
}

TEST_F(Console, HandlerThatExitsAtOnceRestoresOnlyOnce) {
  {
    const GraphicsConsole console(terminal);
    restore_console_now();
    EXPECT_EQ(terminal->mode, KD_TEXT);
    restore_console_now();
  }
  EXPECT_EQ(terminal->modes_set(), (std::vector<int>{KD_GRAPHICS, KD_TEXT}));
  restore_console_now();
  EXPECT_EQ(terminal->modes_set().size(), 2U);
}

TEST_F(Console, EveryDeadlySignalRestoresTextModeAndStillKills) {
  for (const int signal : {SIGHUP, SIGINT, SIGQUIT, SIGILL, SIGTRAP, SIGABRT, SIGBUS, SIGFPE,
                           SIGSEGV, SIGTERM, SIGSYS, SIGXCPU}) {
    int ends[2];
    ASSERT_EQ(pipe2(ends, O_CLOEXEC | O_NONBLOCK), 0);
    const int status = status_of_child([&] {
      // Sanitizers install handlers of their own.
      std::signal(signal, SIG_DFL);
      terminal->on_set = [&](int mode) {
        const char letter = mode == KD_TEXT ? 't' : 'g';
        (void)!write(ends[1], &letter, 1);
      };
      const GraphicsConsole console(terminal);
      raise(signal);
    });
    EXPECT_TRUE(WIFSIGNALED(status)) << signal;
    EXPECT_EQ(WTERMSIG(status), signal);
    char letters[8] = {};
    EXPECT_EQ(read(ends[0], letters, sizeof(letters)), 2) << signal;
    EXPECT_STREQ(letters, "gt");
    close(ends[0]);
    close(ends[1]);
  }
}

TEST_F(Console, SignalHandlersOfTheProgramAreKept) {
  static const auto mine = [](int) {};
  std::signal(SIGTERM, mine);
  {
    const GraphicsConsole console(terminal);
    EXPECT_EQ(handler_of(SIGTERM), static_cast<void (*)(int)>(mine));
    EXPECT_NE(handler_of(SIGHUP), SIG_DFL);
    EXPECT_EQ(handler_of(SIGTSTP), SIG_IGN) << "a stopped player would hold the panel";
  }
  EXPECT_EQ(handler_of(SIGTERM), static_cast<void (*)(int)>(mine));
  EXPECT_EQ(handler_of(SIGHUP), SIG_DFL);
  EXPECT_EQ(handler_of(SIGTSTP), SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
}

TEST_F(Console, KernelsCallsFindNoVirtualTerminalInASessionOfItsOwn) {
  const int status = status_of_child([] {
    if (setsid() < 0) _exit(2);
    const auto calls = display::make_terminal_calls();
    if (calls->open_controlling_terminal() != -ENXIO) _exit(3);
    if (GraphicsConsole(calls).active()) _exit(4);
  });
  EXPECT_EQ(status, 0);
}

TEST_F(Console, KernelsCallsLeaveAPseudoTerminalAlone) {
  const int status = status_of_child([] {
    const int terminal_end = posix_openpt(O_RDWR | O_NOCTTY);
    if (setsid() < 0 || terminal_end < 0 || grantpt(terminal_end) != 0 ||
        unlockpt(terminal_end) != 0)
      _exit(2);
    const int slave = open(ptsname(terminal_end), O_RDWR);  // becomes the controlling terminal
    if (slave < 0 || ioctl(slave, TIOCSCTTY, 0) != 0) _exit(3);
    const auto calls = display::make_terminal_calls();
    const int fd = calls->open_controlling_terminal();
    if (fd < 0 || !calls->is_foreground(fd)) _exit(4);
    int mode = 0;
    if (calls->get_mode(fd, mode) != -ENOTTY || calls->set_mode(fd, KD_GRAPHICS) != -ENOTTY)
      _exit(5);
    calls->close(fd);
    if (GraphicsConsole(calls).active()) _exit(6);
  });
  EXPECT_EQ(status, 0);
}

// --- as part of a display -------------------------------------------------------------------

class DisplayConsole : public KmsStage {
 protected:
  DisplayConsole() { machine.terminal->open_error = 0; }
};

TEST_F(DisplayConsole, IsInGraphicsModeWhileFramesAreShownAndDrawsAgainAfterwards) {
  card.show_console(connector->id, crtc);
  const auto before = card.displayed(crtc);
  open();
  EXPECT_EQ(machine.terminal->mode, KD_GRAPHICS);
  flip(1);
  machine.terminal->on_set = [&](int) {
    EXPECT_EQ(card.master_fd, -1);
    EXPECT_EQ(card.displayed(crtc), before);
  };
  show.reset();
  EXPECT_EQ(machine.terminal->mode, KD_TEXT);
  EXPECT_EQ(machine.terminal->opened, 0);
}

TEST_F(DisplayConsole, IsRestoredAfterEveryFailure) {
  card.commit_faults = {{.count = 1000, .error = EINVAL}};
  EXPECT_THROW(open(), Error);
  EXPECT_EQ(machine.terminal->mode, KD_TEXT);
  card.commit_faults.clear();
  machine.no_hotplug_monitor = true;
  EXPECT_THROW(open(), Error);
  EXPECT_EQ(machine.terminal->mode, KD_TEXT);
  EXPECT_EQ(machine.terminal->opened, 0);
}

TEST_F(DisplayConsole, IsRestoredWhileTheCardIsLost) {
  open();
  card.unplug();
  EXPECT_EQ(wait(seconds(1)).kind, EventKind::Lost);
  EXPECT_THROW(show->reconnect(), Error);
  EXPECT_EQ(machine.terminal->mode, KD_TEXT);
  card.gone = false;
  show->reconnect();
  EXPECT_EQ(machine.terminal->mode, KD_GRAPHICS);
}

TEST_F(DisplayConsole, StaysInGraphicsModeWhileTheLastFrameIsHeld) {
  options.exit = display::ExitPolicy::Hold;
  open();
  flip(1);
  show.reset();
  EXPECT_TRUE(machine.terminal->modes_set().empty()) << "text mode would take the panel";
}

}  // namespace lenticule::test
