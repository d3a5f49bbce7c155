// SPDX-License-Identifier: Apache-2.0
#include <alsa/asoundlib.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <thread>

#include "base/error_kinds.h"
#include "base/owned.h"
#include "player/sound/sound_device.h"

namespace lenticule::player {
namespace {

constexpr unsigned kLatencyUs = 30'000;  ///< size of the device's buffer
constexpr int kBlocksThere = 8;          ///< more than the buffer holds

[[noreturn]] void refuse(const std::string& name, int error) {
  throw device_error("sound device '{}': {}", name, snd_strerror(error))
      .remedy(error == -EBUSY ? "another program uses it: end that program"
                              : "'aplay -L' lists the devices; --sound-device none plays silently");
}

void print_nothing(const char*, int, const char*, int, const char*, ...) {}

class AlsaDevice final : public SoundDevice {
 public:
  explicit AlsaDevice(const std::string& name) : name_(name) {
    snd_pcm_t* opened = nullptr;
    int error = snd_pcm_open(&opened, name.c_str(), SND_PCM_STREAM_PLAYBACK, SND_PCM_NONBLOCK);
    if (error < 0) refuse(name, error);
    pcm_.reset(opened);
    error = snd_pcm_set_params(opened, SND_PCM_FORMAT_S32, SND_PCM_ACCESS_RW_INTERLEAVED,
                               kSoundChannels, kSoundRate, 1, kLatencyUs);
    if (error < 0) refuse(name, error);
  }
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] Status wait(Nanoseconds) noexcept override {
    // A device starts by itself only when it is full.
    const snd_pcm_sframes_t room = snd_pcm_avail_update(pcm_.get());
    if (room < 0) return recover(static_cast<int>(room));
    const bool fits = room >= static_cast<snd_pcm_sframes_t>(kSoundBlock);
    if (fits && ++in_a_row_ < kBlocksThere) return Status::Ready;
    in_a_row_ = 0;
    if (fits) {  // a device without a clock ("null") always has room
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      return Status::NotYet;
    }
    if (snd_pcm_state(pcm_.get()) == SND_PCM_STATE_PREPARED) (void)snd_pcm_start(pcm_.get());
    const int error = snd_pcm_wait(pcm_.get(), 100);
    return error < 0 ? recover(error) : Status::NotYet;
  }
  [[nodiscard]] Nanoseconds heard_at(Nanoseconds now) noexcept override {
    snd_pcm_sframes_t delay = 0;
    if (snd_pcm_delay(pcm_.get(), &delay) < 0) delay = 0;
    return now + Nanoseconds(delay * 1'000'000'000 / kSoundRate);
  }
  [[nodiscard]] Status write(std::span<const float> block) noexcept override {
    std::ranges::transform(block, codes_.begin(), [](float x) {
      return static_cast<int32_t>(std::lrint(x * 2147483520.0F));
    });
    const snd_pcm_sframes_t done =
        snd_pcm_writei(pcm_.get(), codes_.data(), block.size() / kSoundChannels);
    return done < 0 ? recover(static_cast<int>(done)) : Status::Ready;
  }

 private:
  [[nodiscard]] Status recover(int error) noexcept {
    if (error == -EAGAIN) return Status::NotYet;
    return snd_pcm_recover(pcm_.get(), error, 1) < 0 ? Status::Lost : Status::Underrun;
  }

  std::string name_;
  Owned<snd_pcm_t, snd_pcm_close> pcm_;
  int in_a_row_ = 0;  ///< blocks without a wait
  std::array<int32_t, kSoundBlock * kSoundChannels> codes_{};
};

/// Returns the bytes of the EDID that the kernel has for a connector, of whichever graphics card.
std::optional<PanelCode> panel_on(const std::string& connector) {
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/sys/class/drm", ignored)) {
    std::ifstream file(entry.path() / "edid", std::ios::binary);
    PanelCode code{};
    if (entry.path().filename().string().ends_with("-" + connector) && file.ignore(8) &&
        file.read(reinterpret_cast<char*>(code.data()), code.size()))
      return code;
  }
  return std::nullopt;
}

std::optional<EldPanel> panel_of(snd_ctl_t* control, int device) {
  snd_ctl_elem_value_t* value = nullptr;
  snd_ctl_elem_info_t* info = nullptr;
  snd_ctl_elem_value_alloca(&value);
  snd_ctl_elem_info_alloca(&info);
  snd_ctl_elem_info_set_interface(info, SND_CTL_ELEM_IFACE_PCM);
  snd_ctl_elem_info_set_name(info, "ELD");
  snd_ctl_elem_info_set_device(info, static_cast<unsigned>(device));
  if (snd_ctl_elem_info(control, info) < 0) return std::nullopt;
  snd_ctl_elem_value_set_numid(value, snd_ctl_elem_info_get_numid(info));
  if (snd_ctl_elem_read(control, value) < 0) return std::nullopt;
  const auto* const bytes = static_cast<const uint8_t*>(snd_ctl_elem_value_get_bytes(value));
  return panel_of_eld({bytes, std::min<size_t>(snd_ctl_elem_info_get_count(info), 512)});
}

}  // namespace

std::unique_ptr<SoundDevice> open_alsa(const std::string& name) {
  // libasound prints to standard error, which belongs to the player.
  snd_lib_error_set_handler(print_nothing);
  return std::make_unique<AlsaDevice>(name);
}

PanelSound choose_sound(const std::optional<PanelCode>& panel,
                        const std::vector<SoundOutput>& outputs, const std::string& problem) {
  if (!panel) return {.problem = "the panel has no EDID", .remedy = "replace the cable"};
  for (const SoundOutput& one : outputs)
    if (one.panel && one.panel->code == *panel)
      return {.device = one.device, .card = one.card, .monitor = one.panel->name};
  if (!problem.empty()) return {.problem = problem, .remedy = "add the user to the group audio"};
  if (outputs.empty())
    return {.problem = "the machine has no sound card",
            .remedy = "load its driver, which is snd_hda_intel on most machines"};
  return {.problem = "no sound card says that one of its outputs has this panel (ELD)",
          .remedy = "use a panel, a cable and a port with sound, and look while it is on"};
}

PanelSound sound_of_panel(const std::string& connector) {
  constexpr int kMostCards = 32;
  std::vector<SoundOutput> outputs;
  std::string problem;
  snd_lib_error_set_handler(print_nothing);
  snd_ctl_card_info_t* info = nullptr;
  snd_ctl_card_info_alloca(&info);
  // snd_card_next() leaves out cards that this user may not open.
  for (int card = 0; card < kMostCards; ++card) {
    if (!std::filesystem::exists(fmt::format("/sys/class/sound/card{}", card))) continue;
    snd_ctl_t* opened = nullptr;
    const int error = snd_ctl_open(&opened, fmt::format("hw:{}", card).c_str(), SND_CTL_READONLY);
    if (error < 0) problem = fmt::format("sound card {}: {}", card, snd_strerror(error));
    if (error < 0) continue;
    const Owned<snd_ctl_t, snd_ctl_close> control(opened);
    (void)snd_ctl_card_info(opened, info);
    for (int device = -1; snd_ctl_pcm_next_device(opened, &device) == 0 && device >= 0;)
      outputs.push_back({fmt::format("plughw:{},{}", card, device),
                         snd_ctl_card_info_get_name(info), panel_of(opened, device)});
  }
  return choose_sound(panel_on(connector), outputs, problem);
}

std::unique_ptr<SoundDevice> record_wav(const std::string& file) {
  struct Wav {
    std::FILE* out = nullptr;
    uint32_t bytes = 0;
    void write_header() const {
      constexpr uint32_t kFrame = kSoundChannels * 2, kRate = kSoundRate, kPcm = 1;
      const uint32_t words[] = {0x46464952,
                                36 + bytes,
                                0x45564157,  // RIFF ... WAVE
                                0x20746d66,
                                16,
                                kPcm | kSoundChannels << 16,
                                kRate,
                                kRate * kFrame,
                                kFrame | 16 << 16,
                                0x61746164,
                                bytes};  // data
      (void)std::fwrite(words, sizeof words, 1, out);
    }
    ~Wav() {
      if (out == nullptr) return;
      std::rewind(out);
      write_header();
      std::fclose(out);
    }
  };
  const auto wav = std::make_shared<Wav>();
  wav->out = std::fopen(file.c_str(), "wbxe");
  if (wav->out == nullptr)
    throw failed_error("{}: {}", file, std::strerror(errno))
        .remedy(errno == EEXIST ? "remove it, or name another file"
                                : "name a file in a folder that you may write to");
  wav->write_header();
  return std::make_unique<SoundRecorder>("file:" + file, [wav](std::span<const float> block) {
    std::array<int16_t, kSoundBlock * kSoundChannels> codes{};
    std::ranges::transform(block, codes.begin(),
                           [](float x) { return static_cast<int16_t>(std::lrint(x * 32767.0F)); });
    constexpr uint32_t kMost = 0xf0000000;  // a WAV file cannot be longer
    if (wav->bytes < kMost && std::fwrite(codes.data(), 2 * block.size(), 1, wav->out) == 1)
      wav->bytes += static_cast<uint32_t>(block.size() * 2);
  });
}

}  // namespace lenticule::player
