// SPDX-License-Identifier: Apache-2.0
// lenticule-window shows on a desktop what two eyes see of the pictures that a player sends to its
// virtual display. It is the only program that is linked with SDL; the player starts it.
#include <SDL2/SDL.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "apps/lenticule-window/eye_pictures.h"
#include "base/error_kinds.h"
#include "base/main_function.h"
#include "base/owned.h"
#include "frames/ring/shared_picture.h"
#include "optics/trim.h"

namespace lenticule::window {
namespace {

constexpr ErrorStyle kErrors{.program = "lenticule-window"};
constexpr int kFirstWidth = 1280;
constexpr int kPollMs = 10;  ///< time between two checks for a new picture

struct Flags {
  std::string rig;
  int pictures = -1;
  int ready = -1;
};

[[noreturn]] void fail(const char* what, const std::string& why = SDL_GetError()) {
  throw device_error("window: cannot {}: {}", what, why)
      .remedy("run this in a desktop session, with DISPLAY or WAYLAND_DISPLAY set");
}

struct SdlSession {
  SdlSession() {
    if (SDL_Init(SDL_INIT_VIDEO) != 0) fail("open a display");
    // Without a desktop, SDL falls back to drivers that show nothing or take the whole panel.
    const std::string driver = SDL_GetCurrentVideoDriver();
    if (driver != "x11" && driver != "wayland")
      fail("open a display", "SDL found no desktop, only '" + driver + "'");
  }
  ~SdlSession() { SDL_Quit(); }
  SdlSession(const SdlSession&) = delete;
  SdlSession& operator=(const SdlSession&) = delete;
};

/// Window is the window, with the eyes that its mouse and its keys move.
class Window {
 public:
  explicit Window(const Flags& flags)
      : model_(optics::load_trimmed_rig(flags.rig)),
        panel_(model_.rig().panel),
        pictures_(flags.pictures, panel_.sent_size().width, panel_.sent_size().height),
        ready_(flags.ready),
        eyes_(model_) {
    const optics::PixelGrid eye =
        eye_size(panel_, look_, {kFirstWidth, kFirstWidth});  // as high as its width needs
    window_.reset(SDL_CreateWindow("lenticule", SDL_WINDOWPOS_UNDEFINED, SDL_WINDOWPOS_UNDEFINED,
                                   kFirstWidth, eye.height, SDL_WINDOW_RESIZABLE));
    if (!window_) fail("open a window");
  }

  /// Shows pictures until the window is closed or the player ends.
  void run() {
    draw();
    report_ready();
    while (!closed_ && player_lives()) {
      SDL_Event event;
      for (int got = SDL_WaitEventTimeout(&event, kPollMs); got != 0; got = SDL_PollEvent(&event))
        handle(event);
      if (pictures_.read(words_)) {
        woven_ = seen_frame(words_, panel_);
        changed_ = true;
      }
      if (changed_) draw();
    }
  }

 private:
  void handle(const SDL_Event& event) {
    const optics::PixelGrid size = window_size();
    switch (event.type) {
      case SDL_QUIT:
        closed_ = true;
        return;
      case SDL_MOUSEMOTION:
        eyes_.follow_mouse(static_cast<double>(event.motion.x) / size.width,
                           static_cast<double>(event.motion.y) / size.height);
        break;
      case SDL_MOUSEWHEEL:
        eyes_.step_back(-event.wheel.y);
        break;
      case SDL_KEYDOWN:
        press(event.key.keysym.sym);
        break;
      case SDL_WINDOWEVENT:
        break;
      default:
        return;
    }
    changed_ = true;
  }

  void press(SDL_Keycode key) {
    if (key == SDLK_q || key == SDLK_ESCAPE) closed_ = true;
    if (key == SDLK_c) eyes_.centre();
    if (key == SDLK_a) look_ = look_ == Look::Anaglyph ? Look::SideBySide : Look::Anaglyph;
  }

  [[nodiscard]] optics::PixelGrid window_size() const {
    optics::PixelGrid size;
    SDL_GetWindowSize(window_.get(), &size.width, &size.height);
    return size;
  }

  void draw() {
    changed_ = false;
    const optics::Eye at = eyes_.middle();
    SDL_SetWindowTitle(
        window_.get(),
        fmt::format("lenticule: {} eyes at {:.0f}, {:.0f}, {:.0f} mm",
                    look_ == Look::Anaglyph ? "red-cyan," : "left | right,", at.x, at.y, at.z_mm)
            .c_str());
    SDL_Surface* const screen = SDL_GetWindowSurface(window_.get());
    if (screen == nullptr) fail("draw into the window");
    if (woven_.width() == 0) {
      SDL_FillRect(screen, nullptr, 0);
    } else {
      frames::WovenFrame picture =
          window_picture(model_, woven_, eyes_, look_, {screen->w, screen->h});
      const Owned<SDL_Surface, SDL_FreeSurface> surface(SDL_CreateRGBSurfaceWithFormatFrom(
          picture.bytes().data(), picture.width(), picture.height(), 24,
          static_cast<int>(picture.geometry().row_bytes()), SDL_PIXELFORMAT_RGB24));
      if (!surface || SDL_BlitSurface(surface.get(), nullptr, screen, nullptr) != 0)
        fail("draw into the window");
    }
    if (SDL_UpdateWindowSurface(window_.get()) != 0) fail("draw into the window");
  }

  void report_ready() const {
    const char byte = 1;
    if (::write(ready_, &byte, 1) != 1)
      throw Error(ErrorKind::Failed, "player: ended before its window was open");
  }
  /// Returns false once the player has closed its end of the pipe.
  [[nodiscard]] bool player_lives() const {
    pollfd pipe{.fd = ready_, .events = 0, .revents = 0};
    return ::poll(&pipe, 1, 0) == 0;
  }

  SdlSession sdl_;
  optics::OpticalModel model_;
  const optics::Panel panel_;
  frames::SharedPictureReader pictures_;
  int ready_;
  EyePair eyes_;
  Look look_ = Look::SideBySide;
  Owned<SDL_Window, SDL_DestroyWindow> window_;
  std::vector<uint32_t> words_;
  frames::WovenFrame woven_;  ///< empty until the first picture
  bool changed_ = false;
  bool closed_ = false;
};

}  // namespace
}  // namespace lenticule::window

int main(int argc, char** argv) {
  using namespace lenticule::window;
  if (const int code = lenticule::prepare_program(kErrors); code != lenticule::kOk) return code;
  CLI::App app(
      "Shows what two eyes see of the pictures of a player.\n"
      "Example: lenticule play FILM --rig RIG --display window");
  Flags flags;
  app.add_option("--rig", flags.rig, "rig file of the player")->required();
  app.add_option("--pictures", flags.pictures, "descriptor of the shared pictures")->required();
  app.add_option("--ready", flags.ready,
                 "descriptor of a pipe: one byte is written when the window is open")
      ->required();
  if (const auto code = lenticule::parse_arguments<CLI::ParseError>(app, argc, argv, kErrors))
    return *code;
  return lenticule::run_reporting_errors(
      [&flags] {
        Window(flags).run();
        return lenticule::kOk;
      },
      kErrors);
}
