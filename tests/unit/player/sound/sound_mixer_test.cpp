// SPDX-License-Identifier: Apache-2.0
// Plays films of flashes and clicks on the virtual display in simulated time, records what is
// heard, and compares the times. Every case is the same on every run.
#include "player/sound/sound_mixer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <vector>

#include "display/virtual/virtual_display.h"
#include "player/playback/playback.h"
#include "tests/support/allocation_count.h"
#include "tests/support/fakes/fake_source.h"
#include "tests/support/fakes/faulty_display.h"

namespace lenticule::player {
namespace {

using std::chrono::milliseconds;
using test::EventFate;

constexpr frames::FrameGeometry kSmall{.width = 16, .height = 8};
constexpr double kMost = 0.010;  ///< seconds between a flash and its click

class VblankHook final : public test::VirtualFaults {
 public:
  std::function<void(uint64_t)> before_vblank;
  EventFate fate(uint64_t sequence) noexcept override {
    if (before_vblank) before_vblank(sequence);
    return EventFate::Deliver;
  }
  display::Nanoseconds event_delay(uint64_t) noexcept override { return display::Nanoseconds{0}; }
};

/// Frames whose numbers restart in each round and jump at cuts; every 15th of each item flashes.
class FlashSource final : public test::PlainSource {
 public:
  explicit FlashSource(uint64_t first = 0) : number_(first) {}
  uint64_t frames = 120, rounds = 1;
  std::optional<frames::Rate> own_rate = frames::Rate{60, 1};
  std::vector<uint64_t> items = {0};  ///< numbers of the items that follow each other
  std::function<bool(uint64_t)> is_late;

  void jump_by(uint64_t frames_ahead) {
    number_ += frames_ahead;
    ++cut_;
  }
  [[nodiscard]] frames::FrameGeometry geometry() const override { return kSmall; }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return own_rate; }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override {
    if (number_ >= frames) {
      number_ = 0;
      if (++round_ == rounds) round_ = 0, ++item_;
    }
    if (item_ == items.size()) return frames::PullStatus::End;
    if (is_late && is_late(pulled_)) return frames::PullStatus::NotYet;
    ++pulled_;
    const bool flashes = number_ % 15 == 7;
    pixels_ = frames::WovenFrame(kSmall);
    std::ranges::fill(pixels_.bytes(), static_cast<uint8_t>(flashes ? 255 : 0));
    out = {.frame = pixels_.view(),
           .number = number_++,
           .token = 0,
           .item = static_cast<uint32_t>(items[item_])};
    return frames::PullStatus::Ready;
  }
  [[nodiscard]] uint64_t cut() const override { return cut_; }

 private:
  frames::WovenFrame pixels_{kSmall};
  uint64_t number_, round_ = 0, item_ = 0, pulled_ = 0, cut_ = 0;
};

/// Remembers when flashes were displayed.
class FlashRecorder final : public display::ScanoutRecorder {
 public:
  void record(const display::ShownFrame& shown,
              const display::ScanoutView& scanout) noexcept override {
    const double now = std::chrono::duration<double>(shown.time).count();
    if (begin < 0.0) begin = now;
    if ((scanout.pixels[0] & 0xff) > 128) flashes.push_back(now);
  }
  void finish() override {}
  double begin = -1.0;
  std::vector<double> flashes;
};

class Sound : public testing::Test {
 protected:
  std::shared_ptr<display::SimulatedClock> clock = std::make_shared<display::SimulatedClock>();
  std::shared_ptr<VblankHook> hook = std::make_shared<VblankHook>();
  std::shared_ptr<FlashRecorder> panel = std::make_shared<FlashRecorder>();
  frames::Rate refresh{60, 1};
  PlaybackControl control;
  SoundClock sound;
  SoundMixer mixer{sound};
  PlaybackOptions options{.filling = Filling::InPresenter, .control = &control, .sound = &sound};
  std::vector<float> heard;  ///< left channel
  double heard_from = 0.0;   ///< time of its first sample
  std::map<uint64_t, ItemSamples> items;
  std::function<float(uint64_t item, uint64_t place)> film = click;
  std::function<bool()> decodes = [] { return true; };
  uint64_t serials = 0;
  double ppm = 0.0;

  /// A click of 1 ms begins with each flash of a film of 60 frames a second.
  static float click(uint64_t, uint64_t place) {
    return place % 12'000 >= 5'600 && place % 12'000 < 5'648 ? 0.5F : 0.0F;
  }
  void add_sound(uint64_t item, uint64_t frames) {
    ItemSamples& made = items[item];
    made.serial = ++serials;
    made.fps = frames::Rate{60, 1};
    made.frames = frames;
    SoundSlot& slot = mixer.slots()[items.size() - 1];
    slot.samples.store(&made);
    slot.item.store(item);
    mixer.time_of(item).item.store(item);
  }
  static constexpr uint64_t kBed = 100;  ///< number among `items`
  /// Puts a bed under these items, of which every sample is different.
  void add_bed(const std::vector<uint64_t>& laid) {
    ItemSamples& made = items[kBed];
    made.serial = ++serials;
    made.bed = 1;
    film = [](uint64_t item, uint64_t place) {
      return item == kBed ? 0.1F + static_cast<float>(place % 9973) / 20'000.0F
                          : click(item, place);
    };
    mixer.bed_slot().samples.store(&made);
    for (const uint64_t item : laid) mixer.set_bed(item, 1);
  }
  [[nodiscard]] float bed_sample(uint64_t place) const { return film(kBed, place); }
  /// Returns the largest sample that is heard in a part of the recording, in seconds of the film.
  [[nodiscard]] float loudest(double from_s, double to_s) const {
    const auto at = [&](double s) {
      return heard.begin() + std::lround((s + panel->begin - heard_from) * kSoundRate);
    };
    return *std::max_element(at(from_s), at(to_s));
  }
  /// Returns the seconds in which the sound of item 0 was heard, and in which it was missing.
  [[nodiscard]] double heard_s() { return static_cast<double>(mixer.time_of(0).heard) / 48'000; }
  [[nodiscard]] double silent_s() { return static_cast<double>(mixer.time_of(0).silent) / 48'000; }
  /// Writes what a decoder would write.
  void decode() {
    for (auto& [item, made] : items) {
      frames::SoundRing decoder(UniqueFd(::dup(made.ring.fd())));
      std::vector<frames::SoundRing::Frame> piece;
      const uint64_t round = made.frames * 800;
      for (uint64_t left = decodes() ? decoder.room() : 0; left > 0; --left, ++written[item]) {
        const float x = film(item, round == 0 ? written[item] : written[item] % round);
        piece.push_back({x, x});
      }
      decoder.write(piece);
    }
  }
  std::map<uint64_t, uint64_t> written;

  PlayResult play_film(frames::FrameSource& source) {
    SoundRecorder device(
        "test",
        [this](std::span<const float> block) {
          for (size_t k = 0; k < block.size(); k += kSoundChannels) heard.push_back(block[k]);
        },
        ppm);
    std::vector<float> block(kSoundBlock * kSoundChannels);
    sound.advance = [&](display::Nanoseconds now) {
      const SoundAnchor anchor = sound.anchor.read();
      if (anchor.due_ns == 0) return;
      if (heard.empty()) heard_from = static_cast<double>(anchor.begun_ns) * 1e-9;
      device.begin(display::Nanoseconds(static_cast<int64_t>(anchor.begun_ns)));
      while (device.wait(now) == SoundDevice::Status::Ready) {
        decode();
        const long before = allocations;
        mixer.render(block, device.heard_at(now));
        allocated += allocations - before;
        (void)device.write(block);
      }
    };
    const auto display = test::open_virtual_display(
        {.geometry = kSmall, .refresh = refresh, .clock = clock, .recorder = panel}, hook);
    return play(*display, source, options);
  }
  long allocated = 0;

  [[nodiscard]] std::vector<double> clicks() const {
    std::vector<double> times;
    for (size_t k = 1; k < heard.size(); ++k)
      if (std::abs(heard[k]) > 0.1F && std::abs(heard[k - 1]) <= 0.1F)
        if (times.empty() || time_of(k) - times.back() > 0.05) times.push_back(time_of(k));
    return times;
  }
  [[nodiscard]] double time_of(size_t sample) const {
    return heard_from + static_cast<double>(sample) / (kSoundRate * (1.0 + ppm * 1e-6));
  }
  std::vector<double> jumps;  ///< times at which the source jumped
  /// Returns the largest distance of a flash from the nearest click. Leaves out flashes that are
  /// displayed just when the sound begins anew, with a fade.
  [[nodiscard]] double worst(double from = -1.0) const {
    const std::vector<double> heard_at = clicks();
    double most = 0.0;
    for (const double flash : panel->flashes) {
      double nearest = 1e9;
      for (const double one : heard_at) nearest = std::min(nearest, std::abs(one - flash));
      const bool at_jump = std::ranges::any_of(
          jumps, [&](double jump) { return flash > jump && flash < jump + 0.1; });
      if (flash > from && !at_jump) most = std::max(most, nearest);
    }
    return most;
  }
};

TEST_F(Sound, ClicksComeWithTheirFlashesInEveryRound) {
  add_sound(0, 120);
  FlashSource source;
  source.rounds = 125;  // 1,000 flashes
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  ASSERT_EQ(panel->flashes.size(), 1000U);
  EXPECT_EQ(clicks().size(), 1000U);
  EXPECT_LT(worst(), 0.001);
  EXPECT_EQ(mixer.counts().jumps.get(), 0U);
  EXPECT_EQ(mixer.counts().underruns.get(), 0U);
}

TEST_F(Sound, RoundsJoinWithoutASampleLostOrChanged) {
  // A film of which every sample is different, with a period that no block has.
  film = [](uint64_t, uint64_t place) { return static_cast<float>(place % 9973) / 20'000.0F; };
  add_sound(0, 7);
  FlashSource source;
  source.frames = 7;
  source.rounds = 200;
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  const size_t first = 1;  // after the start
  size_t wrong = 0;
  for (size_t k = first; k + 2000 < 200 * 7 * 800; ++k)
    wrong += heard[k] != film(0, k % (7 * 800)) ? 1 : 0;
  EXPECT_EQ(wrong, 0U);
}

TEST_F(Sound, RenderingAllocatesNothing) {
  add_sound(0, 120);
  FlashSource source;
  source.rounds = 5;
  (void)play_film(source);
  EXPECT_EQ(allocated, 0);
}

TEST_F(Sound, ClocksThatAreApartAreFollowedAtTheStartAndAfterADay) {
  constexpr uint64_t kDay = 24 * 3600 * 60;  ///< frames
  for (const double apart : {200.0, -200.0})
    for (const uint64_t first : {uint64_t{0}, kDay}) {
      ppm = apart;
      heard.clear();
      panel = std::make_shared<FlashRecorder>();
      items.clear();
      written.clear();
      sound.anchor.publish({});
      add_sound(0, 2 * kDay);
      items[0].first = static_cast<double>(first) * 800.0;
      FlashSource source(first);
      source.frames = first + 120 * 30;
      EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
      EXPECT_EQ(panel->flashes.size(), 240U);
      EXPECT_LT(worst(), 0.0025) << apart << " ppm from frame " << first;
      EXPECT_EQ(mixer.counts().jumps.get(), 0U);
    }
}

TEST_F(Sound, FollowsAPanelThatPlaysTheFilmSlower) {
  refresh = {60000, 1001};  // 60 frames a second are locked to 59.94
  add_sound(0, 120);
  FlashSource source;
  source.rounds = 30;
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  EXPECT_LT(worst(), 0.001);
  EXPECT_EQ(mixer.counts().jumps.get(), 0U);
}

TEST_F(Sound, FollowsACadenceOfUnequalFrames) {
  add_sound(0, 120);
  items[0].fps = frames::Rate{24, 1};
  film = [](uint64_t, uint64_t place) {  // 15 frames of 24 a second last 30,000 samples
    return place % 30'000 >= 14'000 && place % 30'000 < 14'048 ? 0.5F : 0.0F;
  };
  items[0].frames = 0;  // the test's decoder counts rounds of 60 frames a second
  FlashSource source;
  source.own_rate = frames::Rate{24, 1};
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  ASSERT_EQ(panel->flashes.size(), 8U);
  EXPECT_LT(worst(), 0.017) << "a frame is shown at the vblank before its time";
}

TEST_F(Sound, IsSilentDuringAPauseAndContinuesWithThePicture) {
  add_sound(0, 600);
  FlashSource source;
  source.frames = 600;
  hook->before_vblank = [this](uint64_t sequence) {
    if (sequence == 100) control.pause(true);
    if (sequence == 187) control.pause(false);
    if (sequence == 300) (void)control.switch_output(false, milliseconds(0));
    if (sequence == 390) (void)control.switch_output(true, milliseconds(0));
  };
  film = [](uint64_t item, uint64_t place) {
    return click(item, place) + 0.01F;  // a hum
  };
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  EXPECT_EQ(panel->flashes.size(), 40U);
  EXPECT_LT(worst(), kMost);
  EXPECT_NEAR(heard_s(), 10.0, 0.1);
  EXPECT_EQ(silent_s(), 0.0);
  for (const double paused : {2.5, 6.0}) {
    const auto at = static_cast<size_t>((paused + panel->begin - heard_from) * kSoundRate);
    EXPECT_EQ(heard[at], 0.0F) << paused;
  }
}

TEST_F(Sound, GoesWithThePictureAtAJump) {
  add_sound(0, 1200);
  FlashSource source;
  source.frames = 1200;
  hook->before_vblank = [&](uint64_t sequence) {
    // Jumps no farther than the decoder is ahead; a farther jump opens the film again.
    if (sequence % 97 != 50 || jumps.size() == 10) return;
    source.jump_by(45);
    jumps.push_back(std::chrono::duration<double>(clock->now()).count());
  };
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  EXPECT_GT(panel->flashes.size(), 40U);
  EXPECT_LT(worst(), kMost);
}

TEST_F(Sound, ChangesWithTheItem) {
  film = [](uint64_t item, uint64_t place) {
    return click(item, place) * (item == 1 ? 1.0F : -0.6F);
  };
  add_sound(1, 120);
  add_sound(3, 120);
  FlashSource source;
  source.items = {1, 2, 3};
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  const std::vector<double> heard_at = clicks();
  ASSERT_EQ(heard_at.size(), 16U) << "item 2 has no sound";
  ASSERT_EQ(panel->flashes.size(), 24U);
  for (size_t k = 0; k < 8; ++k) {
    EXPECT_NEAR(heard_at[k], panel->flashes[k], kMost);
    EXPECT_NEAR(heard_at[8 + k], panel->flashes[16 + k], kMost);
  }
}

TEST_F(Sound, IsSilentAtAnotherSpeed) {
  add_sound(0, 120);
  film = [](uint64_t, uint64_t) { return 0.5F; };
  control.set_speed(2000);
  FlashSource source;
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  EXPECT_TRUE(std::ranges::all_of(heard, [](float x) { return x == 0.0F; }));
  EXPECT_EQ(heard_s() + silent_s(), 0.0) << "that is no fault";
}

TEST_F(Sound, ALateDecoderIsSilenceAndTheFilmGoesOn) {
  add_sound(0, 600);
  FlashSource source;
  source.frames = 600;
  decodes = [this] {
    return clock->now() < milliseconds(2000) || clock->now() > milliseconds(6000);
  };
  const PlayResult result = play_film(source);
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(result.report.pace.shown, 600U);
  EXPECT_EQ(result.report.pace.underruns + result.report.pace.missed, 0U);
  EXPECT_EQ(mixer.counts().underruns.get(), 1U);
  EXPECT_LT(worst(7.0), 0.001) << "in step again once the decoder goes on";
  EXPECT_NEAR(silent_s(), 3.0, 0.1) << "the ring has a second more";
  EXPECT_NEAR(heard_s() + silent_s(), 10.0, 0.1);
}

TEST_F(Sound, TheLengthOfARoundIsKnownThoughItsLastFrameIsDroppedOnce) {
  FlashSource source;
  source.frames = 60;
  source.rounds = 3;
  source.is_late = [this](uint64_t pulled) {
    return pulled == 119 && clock->now() < milliseconds(2200);
  };
  options.late = LatePolicy::Drop;
  const PlayResult result = play_film(source);
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_GT(result.report.pace.dropped, 0U);
  EXPECT_EQ(sound.anchor.read().round, 2U);
  EXPECT_EQ(sound.anchor.read().round_frames, 60U);
}

TEST_F(Sound, StopsWithAPictureThatDoesNotComeAndGoesOnWithIt) {
  add_sound(0, 600);
  film = [](uint64_t item, uint64_t place) { return click(item, place) + 0.01F; };
  FlashSource source;
  source.frames = 600;
  source.is_late = [this](uint64_t pulled) {
    return pulled >= 100 && clock->now() < milliseconds(4000);
  };
  options.stall_timeout.reset();
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  EXPECT_LT(worst(), kMost);
  EXPECT_EQ(heard[static_cast<size_t>((3.0 - heard_from) * kSoundRate)], 0.0F);
}

TEST_F(Sound, DoesNotClickWhereItIsInterrupted) {
  add_sound(0, 600);
  film = [](uint64_t, uint64_t place) {  // 100 Hz
    return 0.5F * std::sin(static_cast<float>(place % 480) / 480.0F * 6.2831853F);
  };
  FlashSource source;
  source.frames = 600;
  hook->before_vblank = [&](uint64_t sequence) {
    if (sequence == 100) control.pause(true);
    if (sequence == 130) control.pause(false);
    if (sequence == 200) source.jump_by(250);
  };
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  float step = 0.0F;
  for (size_t k = 1; k < heard.size(); ++k)
    step = std::max(step, std::abs(heard[k] - heard[k - 1]));
  EXPECT_LT(step, 0.012F) << "the tone's own steps are 0.0065";
}

TEST_F(Sound, VolumeIsInTheGainOfItemAndPlayer) {
  add_sound(0, 120);
  items[0].volume_db = -6.0206;
  mixer.volume_db = -6.0206;
  film = [](uint64_t, uint64_t) { return 0.8F; };
  FlashSource source;
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  EXPECT_NEAR(heard[40'000], 0.2F, 1e-5F);
}

TEST_F(Sound, ABedGoesOnOverAChangeOfItemsWithoutASampleLostOrChanged) {
  add_bed({1, 2, 3});
  FlashSource source;
  source.items = {1, 2, 3};
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  EXPECT_NEAR(heard[12'000], 0.5F * bed_sample(12'000), 0.001F) << "it fades in";
  size_t wrong = 0;
  for (size_t k = 24'256; k + 2000 < 3 * 120 * 800; ++k) wrong += heard[k] != bed_sample(k) ? 1 : 0;
  EXPECT_EQ(wrong, 0U);
  EXPECT_EQ(allocated, 0);
  EXPECT_EQ(heard_s() + silent_s(), 0.0) << "it is not the sound of an item";
}

TEST_F(Sound, ABedFadesOutUnderAnItemWithSoundAndGoesOnAfterIt) {
  add_sound(2, 120);
  add_bed({1, 2, 3});
  FlashSource source;
  source.items = {1, 2, 3};
  uint64_t ducked = 0;
  hook->before_vblank = [&](uint64_t sequence) {
    if (sequence == 200) ducked = mixer.counts().bed.get();
  };
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  EXPECT_EQ(ducked, kBedStands);
  EXPECT_GT(loudest(1.0, 2.0), 0.4F);
  EXPECT_EQ(mixer.counts().bed.get(), kBedHeard);
  // The clicks of item 2 are those of a list without bed, once the bed has faded out.
  for (size_t k = 2 * 48'000 + 26'000; k < 4 * 48'000 - 2000; ++k)
    ASSERT_EQ(heard[k], click(2, k - 2 * 48'000)) << k;
  // The bed goes on with the sample after the last one that was heard.
  const size_t last = 6 * 48'000 - 4000;
  size_t stood = 0;
  for (size_t shift = 70'000; shift < 74'000 && stood == 0; ++shift)
    if (heard[last] == bed_sample(last - shift) && heard[last + 1] == bed_sample(last + 1 - shift))
      stood = shift;
  EXPECT_NEAR(static_cast<double>(stood), 2 * 48'000 - 24'000, 1000.0);
}

TEST_F(Sound, ABedIsSilentInAPauseUnderAnotherListAndAfterTheLastPicture) {
  add_bed({1, 3});
  FlashSource source;
  source.items = {1, 2, 3};  // item 2 is an interruption
  hook->before_vblank = [this](uint64_t sequence) {
    if (sequence == 90) control.pause(true);
    if (sequence == 150) control.pause(false);  // the film goes on a second later
  };
  source.is_late = [this](uint64_t pulled) {
    return pulled >= 350 && clock->now() < milliseconds(18'000);
  };
  options.stall_timeout.reset();
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  EXPECT_GT(loudest(1.0, 1.4), 0.4F);
  EXPECT_EQ(loudest(1.6, 2.4), 0.0F) << "pause";
  EXPECT_GT(loudest(2.8, 2.9), 0.3F);
  EXPECT_EQ(loudest(3.6, 4.9), 0.0F) << "interruption";
  EXPECT_GT(loudest(8.0, 10.0), 0.4F) << "a picture that stays for some seconds";
  EXPECT_EQ(loudest(14.0, 17.0), 0.0F) << "no picture comes";
}

TEST_F(Sound, ABedThatIsLateIsSilenceAndTheFilmGoesOn) {
  add_bed({0});
  FlashSource source;
  source.frames = 600;
  decodes = [this] {
    return clock->now() < milliseconds(2000) || clock->now() > milliseconds(6000);
  };
  uint64_t late = 0;
  hook->before_vblank = [&](uint64_t sequence) {
    if (sequence == 300) late = mixer.counts().bed.get();
  };
  const PlayResult result = play_film(source);
  EXPECT_EQ(result.report.pace.shown, 600U);
  EXPECT_EQ(late, kBedLate);
  EXPECT_EQ(mixer.counts().underruns.get(), 1U);
  EXPECT_GT(loudest(8.0, 9.0), 0.4F);
}

TEST_F(Sound, TheVolumeOfABedIsAddedToThePlayers) {
  add_bed({0});
  items[kBed].volume_db = -6.0206;
  mixer.volume_db = -6.0206;
  FlashSource source;
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  EXPECT_NEAR(heard[40'000], 0.25F * bed_sample(40'000), 1e-5F);
}

TEST_F(Sound, SamplesOfADecoderThatLiesStaySamples) {
  add_sound(0, 120);
  mixer.volume_db = 12.0;
  film = [](uint64_t, uint64_t place) {
    return place % 3 == 0 ? NAN : place % 3 == 1 ? 1e30F : -INFINITY;
  };
  ppm = 150.0;
  FlashSource source;
  source.rounds = 5;
  EXPECT_EQ(play_film(source).outcome, PlayOutcome::Finished);
  EXPECT_TRUE(std::ranges::all_of(heard, [](float x) { return x >= -1.0F && x <= 1.0F; }));
}

}  // namespace
}  // namespace lenticule::player
