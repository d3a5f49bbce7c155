// SPDX-License-Identifier: Apache-2.0
// Tests which frames count as missing: those that a film's container promises to present. The films
// are written here byte by byte, since an encoder makes no such containers.

#include <gmock/gmock.h>

#include <bit>
#include <csignal>

#include "base/error.h"
#include "tests/support/error_matchers.h"
#include "tests/unit/player/video_stage.h"

namespace lenticule::player {
namespace {

using frames::PullStatus;

constexpr uint64_t kFrames = 12;
constexpr int kMilliseconds = 40;  ///< duration of a frame

std::string big(uint64_t value, int bytes) {
  std::string out;
  for (int i = bytes - 1; i >= 0; --i) out += static_cast<char>(value >> (8 * i));
  return out;
}

std::string little(uint64_t value, int bytes) {
  const std::string turned = big(value, bytes);
  return {turned.rbegin(), turned.rend()};
}

std::string zeros(size_t count) {
  std::string out(count, '\0');
  return out;
}

/// Returns a box of QuickTime and MP4 (ISO/IEC 14496-12).
std::string box(const std::string& type, const std::string& content) {
  return big(content.size() + 8, 4) + type + content;
}

/// Returns an element of Matroska (RFC 9559).
std::string element(uint64_t id, const std::string& content) {
  const int bytes = static_cast<int>(std::bit_width(id) + 7) / 8;
  return big(id, bytes) + '\x01' + big(content.size(), 7) + content;
}

/// Returns a chunk of AVI.
std::string chunk(const std::string& type, const std::string& content) {
  return type + little(content.size(), 4) + content;
}

class VideoLength : public test::VideoTest {
 protected:
  struct Shown {
    uint64_t frames = 0;             ///< without repetitions
    std::vector<uint64_t> pictures;  ///< frame of the file in each period
    frames::FrameDamage damage;
  };

  /// Plays a film to its end; its frames must be those of the clip from `first` on, if given.
  [[nodiscard]] Shown shown(const std::string& name, const std::string& bytes,
                            std::optional<uint64_t> first = std::nullopt) const {
    std::ofstream(file(name), std::ios::binary) << bytes;
    const auto source = open_video(request(file(name)));
    Shown shown;
    frames::AcquiredFrame acquired;
    while (pull(*source, acquired) == PullStatus::Ready) {
      EXPECT_EQ(acquired.number, shown.pictures.size());
      shown.frames += acquired.repeats ? 0 : 1;
      shown.pictures.push_back(shown.frames - 1);
      if (first)
        EXPECT_TRUE(std::ranges::equal(acquired.frame.bytes,
                                       clip_frame(*first + shown.pictures.back()).bytes()))
            << shown.pictures.size();
      source->release(acquired.token);
    }
    EXPECT_EQ(source->failure(), "");
    shown.damage = source->damage();
    return shown;
  }

  [[nodiscard]] static std::string picture(uint64_t k) {
    const frames::WovenFrame frame = clip_frame(k);
    return {frame.bytes().begin(), frame.bytes().end()};
  }

  /// Returns a QuickTime film of kFrames frames, the first of which is the only key frame. Its edit
  /// list presents `count` of them from `first` on.
  [[nodiscard]] static std::string quicktime(uint64_t first, uint64_t count) {
    std::string pictures;
    for (uint64_t k = 0; k < kFrames; ++k) pictures += picture(k);
    const std::string head = box("ftyp", "qt  " + zeros(4) + "qt  ");
    const size_t samples = head.size() + movie(first, count, 0).size() + 8;
    return head + movie(first, count, samples) + box("mdat", pictures);
  }

  /// Returns a Matroska film of constant rate with a frame at each of `times`; it ends a frame
  /// after the last of them.
  [[nodiscard]] static std::string matroska(const std::vector<uint64_t>& times) {
    const auto duration =
        std::bit_cast<uint64_t>(static_cast<double>(times.back()) + kMilliseconds);
    const std::string video = element(0xb0, big(kSmall.width, 2)) +
                              element(0xba, big(kSmall.height, 2)) + element(0x2eb524, "RGB\x18");
    const std::string track = element(0xd7, "\x01") + element(0x73c5, "\x01") +
                              element(0x83, "\x01") + element(0x86, "V_UNCOMPRESSED") +
                              element(0x23e383, big(kMilliseconds * 1'000'000, 4)) +
                              element(0xe0, video);
    std::string segment = element(0x1549a966, element(0x4489, big(duration, 8))) +
                          element(0x1654ae6b, element(0xae, track));
    for (size_t k = 0; k < times.size(); ++k)
      segment += element(0x1f43b675, element(0xe7, big(times[k], 4)) +
                                         element(0xa3, '\x81' + big(0x80, 3) + picture(k)));
    return element(0x1a45dfa3, element(0x4282, "matroska")) + element(0x18538067, segment);
  }

  /// Returns an AVI film of kFrames frames; empty ones precede every frame and
  /// follow the last.
  [[nodiscard]] static std::string avi_with_empty_frames() {
    const size_t bytes = 22 * 104;  // rows are padded to four bytes
    const std::string header = "vids" + zeros(16) + little(1, 4) + little(50, 4) + zeros(4) +
                               little(2 * kFrames + 1, 4) + zeros(20);
    const std::string format = little(40, 4) + little(kSmall.width, 4) + little(kSmall.height, 4) +
                               little(1, 2) + little(24, 2) + zeros(24);
    const std::string stream = "strl" + chunk("strh", header) + chunk("strf", format);
    std::string movie = "movi", index;
    for (uint64_t k = 0; k < 2 * kFrames; ++k) {
      const size_t size = k % 2 == 0 ? 0 : bytes;
      index += "00db" + little(0x10, 4) + little(movie.size(), 4) + little(size, 4);
      movie += chunk("00db", zeros(size));
    }
    return chunk("RIFF", "AVI " +
                             chunk("LIST", "hdrl" + chunk("avih", little(20000, 4) + zeros(52)) +
                                               chunk("LIST", stream)) +
                             chunk("LIST", movie) + chunk("idx1", index));
  }

 private:
  [[nodiscard]] static std::string movie(uint64_t first, uint64_t count, size_t samples) {
    const std::string matrix =
        big(0x10000, 4) + zeros(12) + big(0x10000, 4) + zeros(12) + big(0x40000000, 4);
    const std::string clock = big(1000, 4) + big(kFrames * kMilliseconds, 4);
    const std::string size = big(kSmall.width, 2) + big(kSmall.height, 2);
    const std::string format = zeros(6) + big(1, 2) + zeros(16) + size + zeros(12) + big(1, 2) +
                               zeros(32) + big(24, 2) + big(0xffff, 2);
    const std::string table =
        box("stsd", zeros(4) + big(1, 4) + box("raw ", format)) +
        box("stts", zeros(4) + big(1, 4) + big(kFrames, 4) + big(kMilliseconds, 4)) +
        box("stss", zeros(4) + big(1, 4) + big(1, 4)) +
        box("stsc", zeros(4) + big(1, 4) + big(1, 4) + big(kFrames, 4) + big(1, 4)) +
        box("stsz", zeros(4) + big(kSmall.frame_bytes(), 4) + big(kFrames, 4)) +
        box("stco", zeros(4) + big(1, 4) + big(samples, 4));
    const std::string media = box("mdhd", zeros(12) + clock + zeros(4)) +
                              box("hdlr", zeros(4) + "mhlrvide" + zeros(13)) +
                              box("minf", box("vmhd", zeros(12)) + box("stbl", table));
    const std::string edit = zeros(4) + big(1, 4) + big(count * kMilliseconds, 4) +
                             big(first * kMilliseconds, 4) + big(0x10000, 4);
    const std::string header = big(7, 4) + zeros(8) + big(1, 4) + zeros(24) + matrix +
                               big(kSmall.width << 16, 4) + big(kSmall.height << 16, 4);
    return box("moov", box("mvhd", zeros(12) + clock + big(0x10000, 4) + zeros(12) + matrix +
                                       zeros(24) + big(2, 4)) +
                           box("trak", box("tkhd", header) + box("edts", box("elst", edit)) +
                                           box("mdia", media)));
  }
};

std::vector<uint64_t> times_from(uint64_t first) {
  std::vector<uint64_t> times;
  for (uint64_t k = 0; k < kFrames; ++k) times.push_back(first + k * kMilliseconds);
  return times;
}

TEST_F(VideoLength, CountsTheFramesThatAnEditListPresents) {
  const std::string film = quicktime(3, 6);
  const Shown whole = shown("cut.mov", film, 3);
  EXPECT_EQ(whole.frames, 6u);
  EXPECT_FALSE(whole.damage.any()) << whole.damage.missing;
  const Shown half = shown("half.mov", film.substr(0, film.size() - 5 * kSmall.frame_bytes()), 3);
  EXPECT_EQ(half.frames, 4u);
  EXPECT_EQ(half.damage.missing, 2u);
}

TEST_F(VideoLength, CountsFromTheFirstFrameWhereverTimeBegins) {
  for (const uint64_t start : {0, 40, 7300}) {
    const std::string film = matroska(times_from(start));
    const Shown whole = shown("late.mkv", film, 0);
    EXPECT_EQ(whole.frames, kFrames);
    EXPECT_FALSE(whole.damage.any()) << start << ": " << whole.damage.missing;
    const Shown half = shown("half.mkv", film.substr(0, film.size() / 2), 0);
    EXPECT_GE(half.frames, kFrames / 2 - 1);
    EXPECT_EQ(half.frames + half.damage.damaged + half.damage.missing, kFrames) << start;
  }
}

TEST_F(VideoLength, GapsBetweenFramesOfAVariableRateAreNotMissingFrames) {
  std::vector<uint64_t> times = times_from(0);
  for (size_t k = 0; k < kFrames; ++k) times[k] += k / 2 * kMilliseconds;
  const std::string film = matroska(times);
  const Shown whole = shown("variable.mkv", film, 0);
  EXPECT_EQ(whole.frames, kFrames);
  EXPECT_FALSE(whole.damage.any()) << whole.damage.missing;
  EXPECT_GE(shown("half.mkv", film.substr(0, film.size() / 2), 0).damage.missing, kFrames / 2 - 1);
}

TEST_F(VideoLength, AGapInAConstantRateIsMissingFrames) {
  std::vector<uint64_t> times = times_from(0);
  for (size_t k = 5; k < kFrames; ++k) times[k] += 3 * kMilliseconds;
  EXPECT_EQ(shown("gap.mkv", matroska(times), 0).damage.missing, 3u);
}

const std::vector<uint64_t> kTimes = {0, 40, 80, 280, 320, 800};
const std::vector<uint64_t> kPeriods = {0, 1, 2, 2, 2, 2, 2, 3, 4, 4, 4,
                                        4, 4, 4, 4, 4, 4, 4, 4, 4, 5};

TEST_F(VideoLength, EachFrameStaysUntilTheTimeStampOfTheNext) {
  for (const uint64_t start : {0, 7300}) {
    std::vector<uint64_t> times = kTimes;
    for (uint64_t& time : times) time += start;
    const Shown whole = shown("variable.mkv", matroska(times), 0);
    EXPECT_EQ(whole.pictures, kPeriods) << start;
    EXPECT_FALSE(whole.damage.any()) << whole.damage.missing;
  }
}

TEST_F(VideoLength, TimeStampsThatAreRoundedCauseNoRepetition) {
  std::vector<uint64_t> times = times_from(0);
  for (size_t k = 0; k < kFrames; ++k) times[k] += k % 3 == 1 ? 7 : 0;
  EXPECT_EQ(shown("rounded.mkv", matroska(times), 0).pictures.size(), kFrames);
}

TEST_F(VideoLength, TimeStampsThatGoBackOrLeapAreNotFollowed) {
  const std::vector<uint64_t> expected = {0, 1, 2, 2, 2, 3, 4};
  for (const uint64_t leap : {9'000'000, 200}) {
    std::vector<uint64_t> times = {1000, 1040, 1080, 1200, 1240};
    for (size_t k = 2; k < times.size(); ++k) times[k] += leap - 200;
    if (leap == 200) times = {1000, 1040, 500, 620, 660};
    EXPECT_EQ(shown("leaps.mkv", matroska(times), 0).pictures, expected) << leap;
  }
}

TEST_F(VideoLength, ARangeCountsPeriodsOfTheRate) {
  std::ofstream(file("variable.mkv"), std::ios::binary) << matroska(kTimes);
  VideoRequest wanted = request(file("variable.mkv"));
  wanted.frames = FrameRange{2, 16};
  wanted.plays_again = true;
  const auto source = open_video(wanted);
  for (int loop = 0; loop < 3; ++loop) {
    for (size_t k = 2; k < 16; ++k) {
      frames::AcquiredFrame acquired;
      ASSERT_EQ(pull(*source, acquired), PullStatus::Ready) << source->failure();
      EXPECT_TRUE(std::ranges::equal(acquired.frame.bytes, clip_frame(kPeriods[k]).bytes())) << k;
      source->release(acquired.token);
    }
    expect_status(*source, PullStatus::End);
    EXPECT_EQ(source->frame_count(), 14u);
    ASSERT_TRUE(source->rewind());
  }
}

TEST_F(VideoLength, AVariableRateIsFollowedInEveryLoopAndByAnotherDecoder) {
  std::ofstream(file("variable.mkv"), std::ios::binary) << matroska(kTimes);
  for (const bool plays_again : {false, true}) {
    VideoRequest wanted = request(file("variable.mkv"));
    wanted.plays_again = plays_again;
    const auto source = open_video(wanted);
    for (size_t strike = 0; strike < kPeriods.size(); strike += 10) {
      for (size_t k = 0; k < kPeriods.size(); ++k) {
        if (k == strike && source->statistics().decoder > 0)
          ::kill(static_cast<pid_t>(source->statistics().decoder), SIGKILL);
        frames::AcquiredFrame acquired;
        ASSERT_EQ(pull(*source, acquired), PullStatus::Ready) << source->failure();
        EXPECT_EQ(acquired.number, k);
        EXPECT_TRUE(std::ranges::equal(acquired.frame.bytes, clip_frame(kPeriods[k]).bytes()))
            << "loop " << strike / 10 << ", period " << k;
        source->release(acquired.token);
      }
      expect_status(*source, PullStatus::End);
      EXPECT_EQ(source->frame_count(), kPeriods.size());
      ASSERT_TRUE(source->rewind());
    }
  }
}

TEST_F(VideoLength, AnUnsupportedCodecIsNamed) {
  const auto refusal = [this](const std::string& name, const std::string& film) {
    std::ofstream(file(name), std::ios::binary) << film;
    return std::string(test::error_of([&] { (void)open_video(request(file(name))); }).what());
  };
  for (const auto& [tag, codec] : {std::pair("Hap1", "hap"), std::pair("CFHD", "cfhd")}) {
    std::string film = quicktime(0, kFrames);
    film.replace(film.find("raw "), 4, tag);
    EXPECT_THAT(refusal("film.mov", film),
                testing::HasSubstr(fmt::format("film.mov: its codec {} is not supported", codec)));
  }
  for (const auto& [tag, codec] : {std::pair("WMV2", "wmv2"), std::pair("VP31", "vp3")}) {
    std::string film = avi_with_empty_frames();
    // The tag of the codec follows the size of the format, its sides and its depth.
    film.replace(film.find("strf") + 8 + 16, 4, tag);
    EXPECT_THAT(refusal("film.avi", film),
                testing::HasSubstr(fmt::format("film.avi: its codec {} is not supported", codec)));
  }
}

TEST_F(VideoLength, EmptyFramesOfAviAreNotMissing) {
  const std::string film = avi_with_empty_frames();
  const Shown whole = shown("empty.avi", film);
  EXPECT_EQ(whole.frames, kFrames);
  EXPECT_GE(whole.pictures.size(), 2 * kFrames - 1) << "empty frames prolong those before";
  EXPECT_FALSE(whole.damage.any()) << whole.damage.missing;
  EXPECT_GE(shown("half.avi", film.substr(0, film.size() / 2)).damage.missing, kFrames / 2 - 1);
}

}  // namespace
}  // namespace lenticule::player
