// SPDX-License-Identifier: Apache-2.0
// Plays sound files with the confined decoder, records what is heard, and compares it with the
// file.
#include <signal.h>
#include <sys/resource.h>

#include <atomic>
#include <cmath>
#include <thread>

#include "player/sound/sound_player.h"
#include "tests/support/comes_true.h"
#include "tests/support/fakes/fake_source.h"
#include "tests/unit/player/video_stage.h"

namespace lenticule::player {
namespace {

using std::chrono::milliseconds;

/// A film of 30 frames a second, 0 for an unknown number, of which no frame is pulled.
class Film final : public test::PlainSource {
 public:
  explicit Film(uint64_t frames) : frames_(frames) {}
  [[nodiscard]] frames::FrameGeometry geometry() const override { return {}; }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return frames::Rate{30, 1}; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override {
    return frames_ > 0 ? std::optional(frames_) : std::nullopt;
  }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame&) override {
    return frames::PullStatus::End;
  }

 private:
  uint64_t frames_;
};

/// Plays the sound of a film of 30 frames a second as the presenter would anchor it, in simulated
/// time.
class FilmSound : public test::VideoTest {
 protected:
  std::shared_ptr<SoundPlayer> player;
  std::vector<float> heard;  ///< left channel
  Nanoseconds now{milliseconds(1000)};
  SoundAnchor anchor{.numerator = 30, .denominator = 1, .held = 0};

  void start(SoundOptions options = {}) {
    options.device = "test";
    options.simulated = true;
    options.program = LENTICULE_VIDEO_PROGRAM;
    options.open = [this] {
      return std::make_unique<SoundRecorder>("test", [this](std::span<const float> block) {
        for (size_t k = 0; k < block.size(); k += kSoundChannels) heard.push_back(block[k]);
      });
    };
    player = std::make_shared<SoundPlayer>(options);
    player->start("");
  }
  /// Shows frames [from, to) of a round of an item.
  void show(uint64_t item, uint64_t round, uint64_t from, uint64_t to) {
    for (uint64_t frame = from; frame < to; ++frame) {
      if (anchor.item != item || anchor.due_ns == 0)
        anchor.begun_ns = static_cast<uint64_t>(now.count());
      anchor.item = item;
      anchor.number = frame;
      anchor.round = round;
      anchor.due_ns = static_cast<uint64_t>(now.count());
      player->clock().anchor.publish(anchor);
      player->clock().advance(now);
      now += Nanoseconds(1'000'000'000 / 30);
    }
  }
  [[nodiscard]] std::function<void(uint64_t, uint64_t)> open(const PlaylistItem& item,
                                                             uint64_t frames = 60,
                                                             uint64_t first_frame = 0) {
    return player->open(item, std::nullopt, first_frame, Film(frames));
  }
  [[nodiscard]] PlaylistItem film(const std::string& name) const {
    return {.source = parse_source(file(name).string())};
  }

  /// Writes a film of 2 s whose sound is a click of 10 ms at 1 s, and `silence` elsewhere.
  void write_film(const std::string& name, const std::string& sound_options,
                  const std::string& maps = "") const {
    ffmpeg(
        "-f lavfi -i color=black:s=32x16:r=30:d=2 -f lavfi -i \"aevalsrc="
        "'if(between(t\\,1\\,1.01)\\,0.5*sin(6283*t)\\,0)':s=44100:d=2\" " +
        maps + " -c:v ffv1 -pix_fmt bgr0 " + sound_options + " " + name);
  }
  [[nodiscard]] static pid_t decoder_of_this_test() {
    const std::string search =
        fmt::format("pgrep -P {} -f 'lenticule-video.* sound' || true", getpid());
    return std::atoi(test::run_process({"/bin/sh", "-c", search}).out.c_str());
  }
  /// Returns the times of clicks in seconds.
  [[nodiscard]] std::vector<double> clicks() const {
    std::vector<double> times;
    for (size_t k = 0; k < heard.size(); ++k) {
      const double time = static_cast<double>(k) / kSoundRate;
      if (std::abs(heard[k]) > 0.05F && (times.empty() || time > times.back() + 0.1))
        times.push_back(time);
    }
    return times;
  }
};

TEST_F(FilmSound, EveryCodecClicksInEveryRoundAtItsPlace) {
  struct Case {
    std::string name, options;
    double late = 0.003;  ///< seconds by which a container moves sound against pictures
  };
  for (const auto& [name, options, late] : std::vector<Case>{
           {"flac.mkv", "-c:a flac"},
           {"opus.mkv", "-c:a libopus -ar 48000", 0.008},  // written 7 ms early by FFmpeg 5.1
           {"vorbis.mkv", "-c:a libvorbis"},
           {"aac.mov", "-c:a aac"},
           {"mp3.mkv", "-c:a libmp3lame"},
           {"pcm.avi", "-c:a pcm_s16le"},
           {"reordered.avi", "-c:v mpeg4 -bf 2 -pix_fmt yuv420p -c:a pcm_s16le", 0.07},
           {"reordered.ts", "-c:v mpeg2video -bf 2 -pix_fmt yuv420p -c:a mp2", 0.07}}) {
    write_film(name, options);
    for (const uint64_t frames : {60, 0}) {  // of a known number, and found by the decoder
      heard.clear();
      anchor = {.numerator = 30, .denominator = 1, .held = 0};
      start();
      const auto sound = open(film(name), frames);
      ASSERT_NE(sound, nullptr) << name;
      sound(0, kForever);
      for (uint64_t round = 0; round < 5; ++round) show(0, round, 0, 60);
      const std::vector<double> times = clicks();
      ASSERT_EQ(times.size(), 5U) << name << frames;
      for (size_t round = 0; round < 5; ++round)
        EXPECT_NEAR(times[round], 1.0 + 2.0 * static_cast<double>(round), late) << name << frames;
      EXPECT_EQ(player->statistics()["underruns"], 0) << name << frames;
      EXPECT_EQ(player->statistics()["decoder_restarts"], 0) << name << frames;
      if (frames > 0)
        EXPECT_NEAR(times[4] - times[0], 8.0, 2.0 / kSoundRate) << name << ": rounds of 2 s";
    }
  }
}

TEST_F(FilmSound, MonoIsAsLoudAsInTheFile) {
  write_film("mono.mkv", "-c:a flac");
  start();
  const auto sound = open(film("mono.mkv"));
  ASSERT_NE(sound, nullptr);
  sound(0, 1);
  show(0, 0, 0, 60);
  EXPECT_NEAR(std::ranges::max(heard), 0.5F, 0.02F);
}

TEST_F(FilmSound, PlaysTheRoundsThatAreWantedNow) {
  write_film("film.mkv", "-c:a flac");
  start();
  const auto sound = open(film("film.mkv"));
  sound(0, 1);
  show(0, 0, 0, 60);
  show(0, 1, 0, 60);
  EXPECT_EQ(clicks().size(), 1U) << "the second round is not wanted";
  sound(0, 4);  // "ctl loop"
  show(0, 2, 0, 60);
  show(0, 3, 0, 60);
  show(0, 4, 0, 60);
  EXPECT_EQ(clicks().size(), 3U);
}

TEST_F(FilmSound, ItemsThatAreLeftWithoutBeingDisplayedDoNotSilenceTheNext) {
  write_film("film.mkv", "-c:a flac");
  start();
  for (uint64_t item = 1; item <= 20; ++item) {
    open(film("film.mkv"))(item, kForever);
    player->look();
  }
  const auto sound = open(film("film.mkv"));
  sound(21, kForever);
  show(21, 0, 0, 60);
  EXPECT_EQ(clicks().size(), 1U);
}

TEST_F(FilmSound, ADeviceThatIsLostAtOnceIsNotOpenedWithoutAPause) {
  struct Broken final : SoundDevice {
    [[nodiscard]] const std::string& name() const override { return name_; }
    [[nodiscard]] Status wait(Nanoseconds) noexcept override { return Status::Lost; }
    [[nodiscard]] Nanoseconds heard_at(Nanoseconds now) noexcept override { return now; }
    [[nodiscard]] Status write(std::span<const float>) noexcept override { return Status::Lost; }
    std::string name_ = "broken";
  };
  std::atomic<int> opened{0};
  SoundOptions options{.device = "auto"};
  options.open = [&] {
    ++opened;
    return std::make_unique<Broken>();
  };
  player = std::make_shared<SoundPlayer>(options);
  player->start("");
  EXPECT_TRUE(test::comes_true([&] { return player->statistics()["problem"] != ""; }));
  std::this_thread::sleep_for(milliseconds(300));
  EXPECT_LE(opened, 2);
  EXPECT_TRUE(player->statistics()["device"].is_null());
}

TEST_F(FilmSound, TimeWithoutADeviceIsCountedAsSilent) {
  write_film("film.mkv", "-c:a flac");
  SoundOptions options{.device = "auto"};
  options.program = LENTICULE_VIDEO_PROGRAM;
  options.open = []() -> std::unique_ptr<SoundDevice> {
    throw Error(ErrorKind::Device, "no device");
  };
  player = std::make_shared<SoundPlayer>(options);
  player->start("");
  const auto sound = open(film("film.mkv"));
  sound(3, kForever);
  anchor.item = 3;
  anchor.due_ns = static_cast<uint64_t>(
      Nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count());
  player->clock().anchor.publish(anchor);
  EXPECT_TRUE(test::comes_true([&] { return player->account_of(3)->silent_ms > 0; }));
  EXPECT_EQ(player->account_of(3)->heard_ms, 0U);
  EXPECT_EQ(player->account_of(3)->device, "");
}

TEST_F(FilmSound, AFileBesideAFilmIsItsSound) {
  write_film("both.mkv", "-c:a flac");
  ffmpeg("-i both.mkv -vn -c:a copy film.flac");
  std::ofstream(file("film.lts")) << "no film";
  start();
  const auto sound = open({.source = {.kind = SourceKind::Sequence, .text = file("film.lts")}});
  ASSERT_NE(sound, nullptr);
  sound(7, kForever);
  for (uint64_t round = 0; round < 3; ++round) show(7, round, 0, 45);  // of 60
  EXPECT_EQ(clicks().size(), 3U);
  const auto account = player->account_of(7);
  ASSERT_TRUE(account);
  EXPECT_NEAR(static_cast<double>(account->heard_ms), 4500.0, 150.0);
  EXPECT_LT(account->silent_ms, 100U) << "two jumps";
  EXPECT_EQ(account->device, player->statistics()["device"]);
  EXPECT_FALSE(player->account_of(6)) << "has no sound";
  EXPECT_EQ(player->statistics()["source"], file("film.flac").string());
}

TEST_F(FilmSound, AFileBesideNumberedPicturesIsTheirSound) {
  write_film("both.mkv", "-c:a flac");
  ffmpeg("-i both.mkv -vn film.wav");
  for (const std::string pictures : {"film_%05d.png", "film/%05d.png", "film-%d.jpg"}) {
    heard.clear();
    anchor.due_ns = 0;
    start();
    const auto sound = open(film(pictures));
    ASSERT_NE(sound, nullptr) << pictures;
    sound(7, kForever);
    show(7, 0, 0, 45);  // of 60
    EXPECT_EQ(clicks().size(), 1U) << pictures;
    EXPECT_EQ(player->statistics()["source"], file("film.wav").string());
  }
  EXPECT_EQ(open(film("other_%05d.png")), nullptr);
}

TEST_F(FilmSound, APartOfNumberedPicturesHasItsPartOfTheSound) {
  write_film("both.mkv", "-c:a flac");
  ffmpeg("-i both.mkv -vn film.wav");
  for (int number = 1001; number <= 1060; ++number)
    std::ofstream(file(fmt::format("film_{:05}.png", number)));
  start();
  PlaylistItem item = film("film_%05d.png");
  item.frames = FrameRange{1016, 1046};  // from the sixteenth picture on
  const auto sound = open(item, 30);
  ASSERT_NE(sound, nullptr);
  sound(0, 1);
  show(0, 0, 0, 30);
  ASSERT_EQ(clicks().size(), 1U);
  EXPECT_NEAR(clicks()[0], 0.5, 0.001);
}

TEST_F(FilmSound, BeginsInTheMiddleAfterASeek) {
  write_film("film.mkv", "-c:a flac");
  start();
  const auto sound = open(film("film.mkv"), 60, 24);
  sound(2, kForever);
  show(2, 0, 24, 50);
  ASSERT_EQ(clicks().size(), 1U);
  EXPECT_NEAR(clicks()[0], 0.2, 0.001);
}

TEST_F(FilmSound, PlaysTheTrackOfTheWantedLanguage) {
  write_film("film.mkv", "-c:a flac", "");
  ffmpeg(
      "-i film.mkv -f lavfi -i anullsrc=r=48000:cl=stereo:d=2 -map 0:v -map 1:a -map 0:a -c:v copy "
      "-c:a flac -t 2 -metadata:s:a:0 language=eng -metadata:s:a:1 language=ger two.mkv");
  for (const auto& [track, found] : std::vector<std::pair<std::string, size_t>>{
           {"", 0}, {"en", 0}, {"de", 1}, {"deu", 1}, {"2", 1}, {"fr", 0}}) {
    heard.clear();
    anchor.due_ns = 0;
    start({.track = track});
    const auto sound = open(film("two.mkv"));
    ASSERT_NE(sound, nullptr);
    sound(0, kForever);
    show(0, 0, 0, 45);
    EXPECT_EQ(clicks().size(), found) << track;
    const std::string problem = player->statistics()["problem"];
    EXPECT_EQ(problem.empty(), track != "fr") << problem;
  }
}

TEST_F(FilmSound, DamagedPacketsAreSilenceAndAreCounted) {
  write_film("film.mkv", "-c:a flac -af volume=1");
  ffmpeg("-f lavfi -i sine=frequency=440:sample_rate=48000:duration=2 -c:a flac tone.flac");
  std::vector<char> bytes(std::filesystem::file_size(file("tone.flac")));
  std::ifstream(file("tone.flac"), std::ios::binary)
      .read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  std::fill_n(bytes.begin() + static_cast<long>(bytes.size() / 2), 2000, char{0x55});
  std::ofstream(file("tone.flac"), std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  start();
  PlaylistItem request = film("film.mkv");
  request.sound = file("tone.flac");
  const auto sound = open(request);
  ASSERT_NE(sound, nullptr);
  sound(0, kForever);
  show(0, 0, 0, 60);
  size_t silent = 0;
  for (size_t k = 4800; k + 4800 < heard.size(); k += 480)
    silent +=
        std::all_of(heard.begin() + static_cast<long>(k),
                    heard.begin() + static_cast<long>(k) + 480, [](float x) { return x == 0.0F; })
            ? 1
            : 0;
  EXPECT_GT(silent, 2U);
  EXPECT_LT(silent, 60U) << "the sound after it is played";
}

TEST_F(FilmSound, ADecoderThatIsKilledIsReplacedAndTheClicksAreInPlace) {
  write_film("film.mkv", "-c:a flac");
  start();
  const auto sound = open(film("film.mkv"));
  sound(0, kForever);
  show(0, 0, 0, 10);
  const pid_t decoder = decoder_of_this_test();
  ASSERT_GT(decoder, 1);
  ASSERT_EQ(::kill(decoder, SIGKILL), 0);
  ASSERT_TRUE(test::comes_true([&] {
    player->look();
    return player->statistics()["decoder_restarts"] == 1;
  }));
  show(0, 0, 10, 60);
  show(0, 1, 0, 60);
  const std::vector<double> times = clicks();
  ASSERT_EQ(times.size(), 2U);
  EXPECT_NEAR(times[0], 1.0, 0.001);
  EXPECT_NEAR(times[1], 3.0, 0.001);
}

TEST_F(FilmSound, ADecoderThatCannotBeStartedIsTriedAgainAndTheCountsStay) {
  write_film("film.mkv", "-c:a flac");
  start();
  auto sound = open(film("film.mkv"));
  sound(0, kForever);
  show(0, 0, 0, 10);
  const pid_t decoder = decoder_of_this_test();
  ASSERT_GT(decoder, 1);
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlimit none{.rlim_cur = 0, .rlim_max = before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  ASSERT_EQ(::kill(decoder, SIGKILL), 0);
  EXPECT_TRUE(test::comes_true([&] {
    player->look();
    const std::string problem = player->statistics()["problem"];
    return problem.find("tries again") != problem.npos;
  }));
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
  show(0, 0, 10, 60);
  EXPECT_EQ(clicks().size(), 1U);
  sound = nullptr;
  show(1, 0, 0, 10);
  EXPECT_EQ(player->statistics()["decoder_restarts"], 1) << "after the item, too";
}

TEST_F(FilmSound, ADecoderThatHangsIsReplacedToo) {
  write_film("film.mkv", "-c:a flac");
  start();
  const auto sound = open(film("film.mkv"));
  sound(0, kForever);
  show(0, 0, 0, 10);
  const pid_t decoder = decoder_of_this_test();
  ASSERT_GT(decoder, 1);
  ASSERT_EQ(::kill(decoder, SIGSTOP), 0);
  show(0, 0, 10, 60);  // the ring is empty before its end
  uint64_t round = 1;
  while (player->statistics()["decoder_restarts"] == 0 && round < 200) show(0, round++, 0, 60);
  EXPECT_EQ(player->statistics()["decoder_restarts"], 1);
  EXPECT_TRUE(test::comes_true([&] {
    heard.clear();
    show(0, round++, 0, 60);
    return clicks().size() == 1;
  }));
}

TEST_F(FilmSound, ProblemsLeaveTheFilmSilent) {
  write_film("mute.mkv", "-an");
  start();
  EXPECT_EQ(open(film("mute.mkv")), nullptr);
  EXPECT_EQ(player->statistics()["problem"], "");
  PlaylistItem request = film("mute.mkv");
  request.sound = file("none.flac");
  EXPECT_EQ(open(request), nullptr);
  EXPECT_NE(player->statistics()["problem"], "");
  request.sound = file("mute.mkv");
  EXPECT_EQ(open(request), nullptr);
  const std::string problem = player->statistics()["problem"];
  EXPECT_NE(problem.find("no sound in it"), std::string::npos) << problem;
}

TEST_F(FilmSound, AStillPicturesSoundRepeatsByItself) {
  ffmpeg("-f lavfi -i \"aevalsrc='if(between(t\\,0.2\\,0.21)\\,0.5\\,0)':s=48000:d=0.5\" bed.wav");
  start();
  PlaylistItem request{.source = parse_source(file("card.png").string())};
  request.sound = file("bed.wav");
  const auto sound = open(request, 1);
  ASSERT_NE(sound, nullptr);
  sound(4, kForever);
  show(4, 0, 0, 45);
  ASSERT_EQ(clicks().size(), 3U);
  EXPECT_NEAR(clicks()[1] - clicks()[0], 0.5, 2.0 / kSoundRate);
}

TEST_F(FilmSound, TheBedOfAListGoesOnUnderItsItemsAndJoinsItself) {
  // A second whose samples rise, at the ring's rate: every join is seen.
  ffmpeg("-f lavfi -i \"aevalsrc='0.4*t':s=48000:d=1.01\" -c:a flac -sample_fmt s16 bed.flac");
  write_film("film.mkv", "-c:a flac");
  start();
  PlaylistItem item{.source = parse_source(file("card.png").string())};
  item.bed = {.file = file("bed.flac").string(), .volume_db = -6.0206};
  PlaylistItem loud = film("film.mkv");
  loud.bed = item.bed;
  const auto first = open(item, 1), second = open(item, 1), third = open(loud);
  ASSERT_NE(first, nullptr) << "it has no sound of its own, but the bed";
  first(1, 1);
  second(2, 1);
  third(3, 1);
  show(1, 0, 0, 60);
  EXPECT_EQ(player->statistics()["state"], "no sound");
  EXPECT_EQ(player->statistics()["bed"]["state"], "playing");
  EXPECT_EQ(player->statistics()["bed"]["source"], file("bed.flac").string());
  EXPECT_EQ(player->statistics()["bed"]["codec"], "flac");
  show(2, 0, 0, 60);
  EXPECT_FALSE(player->account_of(2)) << "proof of play has the sound of items";
  constexpr size_t kRound = 48'480;
  for (size_t k = 25'000; k < 4 * 48'000 - 2000; ++k)
    ASSERT_NEAR(heard[k], 0.2F * static_cast<float>(k % kRound) / kSoundRate, 1e-4F) << k;
  show(3, 0, 0, 45);
  EXPECT_EQ(player->statistics()["state"], "playing");
  EXPECT_EQ(player->statistics()["bed"]["state"], "ducked");
  show(4, 0, 0, 30);
  EXPECT_EQ(player->statistics()["bed"]["state"], "muted") << "an interruption";
  anchor.held = 1;
  show(1, 0, 0, 2);
  EXPECT_EQ(player->statistics()["bed"]["state"], "held");
}

TEST_F(FilmSound, ABedThatCannotBeReadIsReportedOnceAndTheFilmIsHeard) {
  write_film("film.mkv", "-c:a flac");
  std::ofstream(file("bed.flac")) << "no sound";
  start();
  PlaylistItem item = film("film.mkv");
  item.bed.file = file("bed.flac").string();
  testing::internal::CaptureStderr();
  for (uint64_t number = 1; number <= 3; ++number) {
    const auto sound = open(item);
    ASSERT_NE(sound, nullptr);
    sound(number, 1);
    show(number, 0, 0, 60);
  }
  EXPECT_EQ(clicks().size(), 3U);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_EQ(said.find("bed.flac"), said.rfind("bed.flac")) << said;
  EXPECT_THAT(said, testing::HasSubstr("played without the sound of the list"));
  EXPECT_EQ(player->statistics()["bed"], nullptr);
}

TEST_F(FilmSound, TheBedOfAnotherListReplacesTheOneBefore) {
  ffmpeg("-f lavfi -i \"aevalsrc=0.1:s=48000:d=3\" a.wav");
  ffmpeg("-f lavfi -i \"aevalsrc=-0.2:s=48000:d=3\" b.wav");
  start();
  PlaylistItem item{.source = parse_source(file("card.png").string())};
  item.bed.file = file("a.wav").string();
  const auto first = open(item, 1);
  item.bed.file = file("b.wav").string();
  const auto second = open(item, 1);
  first(1, 1);
  second(2, 1);
  show(1, 0, 0, 45);
  EXPECT_NEAR(heard.back(), 0.1F, 0.001F);
  show(2, 0, 0, 60);
  EXPECT_NEAR(heard.back(), -0.2F, 0.001F);
  EXPECT_LE(std::ranges::max(heard), 0.101F);
}

TEST_F(FilmSound, ADecoderOfABedThatIsKilledIsReplaced) {
  ffmpeg("-f lavfi -i \"aevalsrc=0.1:s=48000:d=3\" bed.wav");
  start();
  PlaylistItem item{.source = parse_source(file("card.png").string())};
  item.bed.file = file("bed.wav").string();
  const auto sound = open(item, 1);
  sound(1, kForever);
  show(1, 0, 0, 30);
  const pid_t decoder = decoder_of_this_test();
  ASSERT_GT(decoder, 1);
  ASSERT_EQ(::kill(decoder, SIGKILL), 0);
  ASSERT_TRUE(test::comes_true([&] {
    player->look();
    return player->statistics()["decoder_restarts"] == 1;
  }));
  show(1, 0, 30, 90);
  EXPECT_NEAR(heard.back(), 0.1F, 0.001F);
  EXPECT_EQ(player->statistics()["bed"]["state"], "playing");
}

TEST(Language, IsFoundByEachOfItsCodes) {
  EXPECT_TRUE(is_language("ger", "de"));
  EXPECT_TRUE(is_language("deu", "de"));
  EXPECT_TRUE(is_language("de-AT", "ger"));
  EXPECT_TRUE(is_language("xyz", "XYZ"));
  EXPECT_FALSE(is_language("eng", "de"));
  EXPECT_FALSE(is_language("", "de"));
}

}  // namespace
}  // namespace lenticule::player
