// SPDX-License-Identifier: Apache-2.0
// PreviewWindow shows on a desktop what two eyes see of a virtual display. The window belongs to
// lenticule-window, a program of its own, because a player on a kiosk needs no desktop.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "base/subprocess.h"
#include "base/unique_fd.h"
#include "display/scanout_recorder.h"
#include "frames/ring/shared_picture.h"

namespace lenticule::player {

/// Returns true for "window" and "window:...": a virtual display of the same form with a window.
[[nodiscard]] bool is_window_spec(std::string_view spec);
/// Returns the virtual display of a window, "virtual:..." for "window:...".
[[nodiscard]] std::string virtual_spec_of_window(std::string_view spec);

/// Passes each displayed picture to the window. Thread safety: as ScanoutRecorder.
class PreviewWindow final : public display::ScanoutRecorder {
 public:
  /// Starts the window's program and waits until its window is open. `sent` is the size of the
  /// pictures that are sent to the rig's panel. Throws Error(Failed) if the program is not
  /// installed, Error(Device) if there is no desktop.
  PreviewWindow(const std::string& rig_file, frames::FrameGeometry sent, int interrupt_fd);

  void record(const display::ShownFrame& shown,
              const display::ScanoutView& scanout) noexcept override;
  void finish() override {}

  /// Returns a descriptor that is readable once the window is closed or `interrupt_fd` is readable.
  [[nodiscard]] int stop_fd() const { return stop_.get(); }
  /// Throws Error(Failed) if the window's program has ended with an error.
  void check();

 private:
  frames::SharedPictureWriter pictures_;
  UniqueFd ready_;
  UniqueFd stop_;
  Subprocess program_;
};

}  // namespace lenticule::player
