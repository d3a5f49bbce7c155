// SPDX-License-Identifier: Apache-2.0
// SoundDevice plays samples and says when they are heard: an ALSA device, or a recorder that takes
// its place in a file or a test.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "display/display.h"
#include "frames/sound/sound_ring.h"

namespace lenticule::player {

inline constexpr int kSoundRate = frames::SoundRing::kRate;
inline constexpr int kSoundChannels = frames::SoundRing::kChannels;
inline constexpr size_t kSoundBlock = 256;  ///< frames that are computed at once, 5.3 ms
/// Time by which a recorder is filled ahead.
inline constexpr std::chrono::milliseconds kSoundAhead{20};

using display::Nanoseconds;

/// Thread safety: one thread.
class SoundDevice {
 public:
  enum class Status { Ready, NotYet, Underrun, Lost };
  virtual ~SoundDevice() = default;
  [[nodiscard]] virtual const std::string& name() const = 0;
  /// Waits until a block fits, at most 100 ms. Underrun: it ran dry, and was started again.
  [[nodiscard]] virtual Status wait(Nanoseconds now) noexcept = 0;
  /// Returns the time at which the sample that is written next will be heard.
  [[nodiscard]] virtual Nanoseconds heard_at(Nanoseconds now) noexcept = 0;
  /// Writes a block.
  [[nodiscard]] virtual Status write(std::span<const float> block) noexcept = 0;
  /// The first picture appears at this time: a recording begins there.
  virtual void begin(Nanoseconds) noexcept {}
};

/// SoundRecorder passes on what would be heard from the first picture on.
class SoundRecorder final : public SoundDevice {
 public:
  using Sink = std::function<void(std::span<const float> block)>;
  /// `clock_ppm` is by how many millionths the recorder's clock is faster than the panel's.
  SoundRecorder(std::string name, Sink sink, double clock_ppm = 0.0)
      : name_(std::move(name)),
        sink_(std::move(sink)),
        ns_per_frame_(1e9 / (kSoundRate * (1.0 + clock_ppm * 1e-6))) {}

  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] Status wait(Nanoseconds now) noexcept override {
    return begun_ && heard_at(now) < now + kSoundAhead ? Status::Ready : Status::NotYet;
  }
  [[nodiscard]] Nanoseconds heard_at(Nanoseconds) noexcept override {
    return begin_ +
           Nanoseconds(static_cast<int64_t>(static_cast<double>(written_) * ns_per_frame_));
  }
  [[nodiscard]] Status write(std::span<const float> block) noexcept override {
    written_ += block.size() / kSoundChannels;
    sink_(block);
    return Status::Ready;
  }
  void begin(Nanoseconds time) noexcept override {
    if (!begun_) begin_ = time;
    begun_ = true;
  }

 private:
  std::string name_;
  Sink sink_;
  double ns_per_frame_;
  bool begun_ = false;
  Nanoseconds begin_{0};
  uint64_t written_ = 0;
};

/// Returns a recorder that writes a WAV file of 16 bits. Throws Error(Failed).
[[nodiscard]] std::unique_ptr<SoundDevice> record_wav(const std::string& file);
/// Opens an ALSA device. Throws Error(Device).
[[nodiscard]] std::unique_ptr<SoundDevice> open_alsa(const std::string& name);
/// Bytes 8 to 11 of an EDID: manufacturer and product.
using PanelCode = std::array<uint8_t, 4>;
struct EldPanel {
  PanelCode code{};
  std::string name{};
};
/// Reads an ELD (EDID-like data), what a graphics driver tells the sound driver about the panel on
/// an HDMI or DisplayPort output: HDA specification, 7.3.3.34. Returns none for an output without a
/// panel, and for other bytes.
[[nodiscard]] inline std::optional<EldPanel> panel_of_eld(std::span<const uint8_t> eld) {
  constexpr size_t kHeader = 4, kCode = 16, kName = 20, kMostName = 16;
  if (eld.size() < kName || (eld[0] >> 3 != 2 && eld[0] >> 3 != 31)) return std::nullopt;
  const size_t name = eld[4] & 31U, length = std::min(eld.size(), kHeader + size_t{eld[2]} * 4);
  if (name > kMostName || kName + name > length) return std::nullopt;
  EldPanel panel{.name = {eld.begin() + kName, eld.begin() + kName + static_cast<int>(name)}};
  std::copy_n(eld.begin() + kCode, panel.code.size(), panel.code.begin());
  return panel;
}

/// SoundOutput is a playback device of a sound card, with the panel that its ELD describes.
struct SoundOutput {
  std::string device{}, card{};
  std::optional<EldPanel> panel{};
};
/// PanelSound is the ALSA device for a panel's sound.
struct PanelSound {
  std::string device = "default";
  std::string card{};               ///< name of the card; empty if no device belongs to the panel
  std::string monitor{};            ///< name of the panel in its ELD
  std::string problem{}, remedy{};  ///< reason why no device belongs to the panel
};
/// Chooses among all devices; `panel` is none for a panel without EDID. `problem` is the reason why
/// a card could not be looked at, or empty.
[[nodiscard]] PanelSound choose_sound(const std::optional<PanelCode>& panel,
                                      const std::vector<SoundOutput>& outputs,
                                      const std::string& problem);
/// Returns the device for the panel on this connector of this machine ("HDMI-A-1").
[[nodiscard]] PanelSound sound_of_panel(const std::string& connector);

}  // namespace lenticule::player
