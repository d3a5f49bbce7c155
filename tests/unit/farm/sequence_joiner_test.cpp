// SPDX-License-Identifier: Apache-2.0
// Tests that parts of a film are joined to the bytes that one writer writes.
#include "farm/sequence_joiner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "base/error.h"
#include "frames/sequence/band_codec.h"
#include "frames/sequence/sequence_reader.h"
#include "frames/sequence/sequence_writer.h"
#include "tests/support/scratch_folder.h"
#include "tests/unit/sequence/small_sequences.h"

namespace lenticule::farm {
namespace {

using test::Content;
using test::info_of;
using test::make_frame;
using test::ScratchFolder;

constexpr frames::FrameGeometry kGeometry{60, 40};
constexpr uint64_t kFirst = 7;  ///< number of the film's first frame
constexpr uint64_t kFrames = 100;

/// Returns frame n of a film that tries every way to store a band: many frames repeat all or some
/// bands of the frame before, also from one part to the next, and the predictors change.
frames::WovenFrame film_frame(uint64_t n) {
  const Content content = n / 20 % 2 == 0 ? Content::Lenses : Content::Ramp;
  frames::WovenFrame frame = make_frame(kGeometry, content, static_cast<int>(n / 4));
  if (n % 3 == 0) frame.row(kGeometry.height - 1)[5] = static_cast<uint8_t>(n);
  return frame;
}

frames::SequenceInfo film_info(uint64_t first = kFirst) {
  frames::SequenceInfo info = info_of(kGeometry);
  info.first_frame = first;
  return info;
}

void write_whole(const std::filesystem::path& file) {
  frames::SequenceWriter writer(file, film_info(), {.threads = 2});
  for (uint64_t n = 0; n < kFrames; ++n) writer.append(film_frame(n).view());
  writer.finish();
}

frames::SequencePart part_at(uint64_t begin) {
  const frames::WovenFrame key = film_frame(begin - begin % frames::kPredictorInterval);
  return {.first = begin, .predictors = choose_predictors(key.view(), choose_band_rows(kGeometry))};
}

/// Writes frames [begin, end) of the film, in two runs if `resumed`.
FilmPart write_part(const ScratchFolder& folder, uint64_t begin, uint64_t end,
                    bool resumed = false) {
  const auto file = folder / ("part" + std::to_string(begin) + ".lts");
  const uint64_t stop = resumed ? (begin + end) / 2 : end;
  for (const uint64_t until : {stop, end}) {
    frames::SequenceWriter writer(file, film_info(kFirst + begin),
                                  {.resume = true, .threads = 1, .part_of_film = part_at(begin)});
    for (uint64_t n = begin + writer.frame_count(); n < until; ++n)
      writer.append(film_frame(n).view());
    if (until == end) writer.finish();
  }
  return {.file = file,
          .digest = digest_of_file(file),
          .first_bands = band_digests(film_frame(begin).view()),
          .last_bands = band_digests(film_frame(end - 1).view())};
}

void join(const std::filesystem::path& film, const std::vector<FilmPart>& parts) {
  SequenceJoiner joiner(film, film_info());
  for (const FilmPart& part : parts) joiner.append(part);
  joiner.finish();
}

TEST(SequenceJoiner, PartsOfEqualLengthGiveTheBytesOfOneRun) {
  const ScratchFolder folder;
  write_whole(folder / "whole.lts");
  for (const uint64_t length : {1U, 31U, 32U, 33U, 64U}) {
    std::vector<FilmPart> parts;
    for (uint64_t begin = 0; begin < kFrames; begin += length)
      parts.push_back(write_part(folder, begin, std::min(kFrames, begin + length)));
    join(folder / "film.lts", parts);
    ASSERT_EQ(test::read_bytes(folder / "film.lts"), test::read_bytes(folder / "whole.lts"))
        << length;
    for (const FilmPart& part : parts) std::filesystem::remove(part.file);
  }
}

TEST(SequenceJoiner, PartsOfAnyLengthGiveTheBytesOfOneRun) {
  const ScratchFolder folder;
  write_whole(folder / "whole.lts");
  std::mt19937 random(5);
  for (int trial = 0; trial < 10; ++trial) {
    std::vector<FilmPart> parts;
    for (uint64_t begin = 0; begin < kFrames;) {
      const uint64_t end = std::min<uint64_t>(kFrames, begin + 1 + random() % 40);
      parts.push_back(write_part(folder, begin, end, random() % 2 == 0));
      begin = end;
    }
    join(folder / "film.lts", parts);
    ASSERT_EQ(test::read_bytes(folder / "film.lts"), test::read_bytes(folder / "whole.lts"))
        << trial;
    for (const FilmPart& part : parts) std::filesystem::remove(part.file);
  }
}

TEST(SequenceJoiner, APartIsAFilmThatCanBeRead) {
  const ScratchFolder folder;
  const FilmPart part = write_part(folder, 10, 20);
  const frames::SequenceReader reader(part.file);
  ASSERT_EQ(reader.frame_count(), 10U);
  frames::FrameDecoder decoder = reader.make_decoder();
  frames::WovenFrame frame(kGeometry);
  for (uint64_t n = 0; n < 10; ++n) {
    ASSERT_TRUE(decoder.decode(n, frame.bytes()));
    EXPECT_EQ(frame, film_frame(10 + n));
  }
}

TEST(SequenceJoiner, RefusesADamagedPartAndKeepsTheOldFilm) {
  const ScratchFolder folder;
  const FilmPart first = write_part(folder, 0, 5);
  const std::vector<uint8_t> bytes = test::read_bytes(first.file);
  test::write_bytes(folder / "film.lts", {1, 2, 3});
  std::mt19937 random(9);
  for (int trial = 0; trial < 100; ++trial) {
    std::vector<uint8_t> damaged = bytes;
    if (trial % 2 == 0) {
      damaged.resize(random() % bytes.size());
    } else {
      damaged[random() % bytes.size()] ^= static_cast<uint8_t>(1 + random() % 255);
    }
    test::write_bytes(first.file, damaged);
    try {
      join(folder / "film.lts", {first});
      FAIL() << "trial " << trial;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Input) << error.what();
      EXPECT_EQ(std::string(error.what()).rfind(first.file.string(), 0), 0U) << error.what();
    }
  }
  EXPECT_EQ(test::read_bytes(folder / "film.lts"), (std::vector<uint8_t>{1, 2, 3}));
  EXPECT_EQ(folder.entries(), 2U);
}

TEST(SequenceJoiner, RefusesPartsThatAreNotTheNext) {
  const ScratchFolder folder;
  const FilmPart first = write_part(folder, 0, 5);
  const FilmPart third = write_part(folder, 10, 15);
  EXPECT_THROW(join(folder / "film.lts", {first, third}), Error);
  EXPECT_THROW(join(folder / "film.lts", {third}), Error);
  frames::SequenceInfo other = film_info();
  other.rig_fingerprint = "fedcba9876543210";
  SequenceJoiner joiner(folder / "film.lts", other);
  EXPECT_THROW(joiner.append(first), Error);
}

/// Two parts without equal bands, of which one claims that all of them are equal.
TEST(SequenceJoiner, FindsRepeatedBandsByTheirDigestsOnly) {
  const ScratchFolder folder;
  FilmPart first = write_part(folder, 0, 5);
  const FilmPart second = write_part(folder, 5, 9);
  first.last_bands = second.first_bands;
  join(folder / "film.lts", {first, second});
  const frames::SequenceReader reader(folder / "film.lts");
  frames::FrameDecoder decoder = reader.make_decoder();
  frames::WovenFrame frame(kGeometry);
  ASSERT_TRUE(decoder.decode(5, frame.bytes()));
  EXPECT_EQ(frame, film_frame(4));
}

}  // namespace
}  // namespace lenticule::farm
