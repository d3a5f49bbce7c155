// SPDX-License-Identifier: Apache-2.0
// Tests that bands are decoded exactly, with every codec, every set of predictors and every
// instruction set, and that invalid payloads are refused.
#include "frames/sequence/band_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <random>

#include "band_oracle.h"
#include "small_sequences.h"
#include "tests/support/instruction_sets.h"

namespace lenticule::frames {
namespace {

using test::Content;
using test::make_frame;
using test::oracle_decode_predicted;

constexpr Content kContents[] = {Content::Noise, Content::Flat, Content::Ramp, Content::Grain,
                                 Content::Lenses};
constexpr FrameGeometry kSizes[] = {{1, 1},  {2, 1},  {10, 1},  {11, 3},
                                    {32, 8}, {33, 9}, {97, 31}, {320, 16}};

std::vector<PredictorTable> predictor_sets(const WovenFrame& frame) {
  PredictorTable up;
  up.count = 1;
  up.distance[1] = std::max<uint32_t>(static_cast<uint32_t>(frame.geometry().row_bytes()), 32);
  return {PredictorTable{}, up, choose_predictors(frame.view(), frame.height())};
}

/// Encodes with each instruction set and expects equal bytes.
bool encode_everywhere(BandCodec codec, std::span<const uint8_t> band,
                       const PredictorTable& predictors, std::vector<uint8_t>& payload) {
  bool encoded = false;
  bool first = true;
  for (const Isa isa : test::every_instruction_set()) {
    std::vector<uint8_t> bytes;
    encoded = BandEncoder(band.size(), isa).encode_as(codec, band, predictors, bytes);
    if (!first) {
      EXPECT_EQ(bytes, payload) << isa_name(isa);
    }
    payload = bytes;
    first = false;
  }
  return encoded;
}

TEST(BandCodec, RoundTripsWithEveryCodecPredictorSetAndInstructionSet) {
  int predicted = 0;
  for (const auto& geometry : kSizes) {
    for (const Content content : kContents) {
      const WovenFrame frame = make_frame(geometry, content, 3);
      for (const PredictorTable& predictors : predictor_sets(frame)) {
        for (const BandCodec codec : {BandCodec::Raw, BandCodec::Zstd, BandCodec::Predicted}) {
          std::vector<uint8_t> payload;
          if (!encode_everywhere(codec, frame.bytes(), predictors, payload)) continue;
          if (codec == BandCodec::Predicted) {
            ++predicted;
            ASSERT_EQ(oracle_decode_predicted(payload, frame.bytes().size()),
                      std::vector<uint8_t>(frame.bytes().begin(), frame.bytes().end()));
          }
          for (const Isa isa : test::every_instruction_set()) {
            std::vector<uint8_t> band(frame.bytes().size(), 0xee);
            ASSERT_TRUE(BandDecoder(band.size(), isa).decode(codec, payload, band));
            ASSERT_TRUE(std::equal(band.begin(), band.end(), frame.bytes().begin()));
          }
        }
      }
    }
  }
  EXPECT_GE(predicted, 30);
}

/// Returns the largest difference of two bands.
int largest_difference(std::span<const uint8_t> a, std::span<const uint8_t> b) {
  int largest = 0;
  for (size_t at = 0; at < a.size(); ++at) largest = std::max(largest, std::abs(a[at] - b[at]));
  return largest;
}

TEST(BandCodec, KeepsTheLargestErrorWithEveryInstructionSet) {
  for (const auto& geometry : kSizes) {
    for (const Content content : kContents) {
      const WovenFrame frame = make_frame(geometry, content, 3);
      const size_t bytes = frame.bytes().size();
      for (const PredictorTable& predictors : predictor_sets(frame)) {
        for (const int error : {1, 2, 3, 4, kMostMaxError}) {
          std::vector<uint8_t> first;
          for (const Isa isa : test::every_instruction_set()) {
            BandEncoder encoder(bytes, isa, error);
            std::vector<uint8_t> payload, band(bytes);
            const BandCodec codec = encoder.encode(frame.bytes(), predictors, payload);
            ASSERT_LE(payload.size(), bytes);
            ASSERT_TRUE(BandDecoder(bytes, isa).decode(codec, payload, band));
            ASSERT_LE(largest_difference(band, frame.bytes()), error) << isa_name(isa);
            if (first.empty()) first = payload;
            ASSERT_EQ(payload, first) << isa_name(isa);
          }
        }
      }
    }
  }
}

TEST(BandCodec, AnErrorOfTwoHalvesGrain) {
  const WovenFrame frame = make_frame({960, 60}, Content::Grain, 0);
  const PredictorTable predictors = choose_predictors(frame.view(), 60);
  const auto size_with = [&](int error) {
    std::vector<uint8_t> payload;
    BandEncoder(frame.bytes().size(), best_isa(), error).encode(frame.bytes(), predictors, payload);
    return payload.size();
  };
  EXPECT_LT(size_with(1), size_with(0) * 3 / 4);
  EXPECT_LT(size_with(2), size_with(0) * 11 / 20);
  EXPECT_LT(size_with(4), size_with(2));
}

TEST(BandCodec, EncodedBandsAreNeverLargerThanTheBand) {
  for (const auto& geometry : kSizes) {
    for (const Content content : kContents) {
      const WovenFrame frame = make_frame(geometry, content, 1);
      BandEncoder encoder(frame.bytes().size());
      std::vector<uint8_t> payload;
      const BandCodec codec =
          encoder.encode(frame.bytes(), choose_predictors(frame.view(), geometry.height), payload);
      EXPECT_LE(payload.size(), frame.bytes().size());
      std::vector<uint8_t> band(frame.bytes().size());
      ASSERT_TRUE(BandDecoder(band.size()).decode(codec, payload, band));
      EXPECT_TRUE(std::equal(band.begin(), band.end(), frame.bytes().begin()));
    }
  }
}

TEST(BandCodec, FindsThePeriodOfALensSheet) {
  const WovenFrame frame = make_frame({960, 60}, Content::Lenses, 0);
  const PredictorTable predictors = choose_predictors(frame.view(), 60);
  EXPECT_GE(predictors.count, 2);
  BandEncoder encoder(frame.bytes().size());
  std::vector<uint8_t> payload;
  ASSERT_TRUE(encoder.encode_as(BandCodec::Predicted, frame.bytes(), predictors, payload));
  std::vector<uint8_t> above;
  PredictorTable up;
  up.count = 1;
  up.distance[1] = 960 * 3;
  ASSERT_TRUE(encoder.encode_as(BandCodec::Predicted, frame.bytes(), up, above));
  EXPECT_LT(payload.size(), above.size() * 9 / 10);
}

/// Decodes bands that are large enough to be written past the caches, which needs aligned memory.
TEST(BandDecoder, LargeBandsAreTheSameInAlignedAndInOtherMemory) {
  for (const FrameGeometry geometry : {FrameGeometry{2048, 60}, FrameGeometry{1501, 61}}) {
    for (const Content content : {Content::Flat, Content::Ramp, Content::Lenses}) {
      const WovenFrame frame = make_frame(geometry, content, 2);
      const size_t bytes = frame.bytes().size();
      std::vector<uint8_t> payload;
      ASSERT_TRUE(BandEncoder(bytes).encode_as(BandCodec::Predicted, frame.bytes(),
                                               choose_predictors(frame.view(), geometry.height),
                                               payload));
      for (const Isa isa : test::every_instruction_set()) {
        BandDecoder decoder(bytes, isa);
        for (const size_t offset : {size_t{0}, size_t{32}, size_t{1}}) {
          AlignedBytes memory(bytes + 64, uint8_t{0xee});
          const auto band = std::span<uint8_t>(memory).subspan(offset, bytes);
          ASSERT_TRUE(decoder.decode(BandCodec::Predicted, payload, band));
          EXPECT_TRUE(std::ranges::equal(band, frame.bytes())) << isa_name(isa) << " " << offset;
          EXPECT_EQ(memory[offset + bytes], 0xee) << "beyond the band";
        }
      }
    }
  }
}

TEST(BandDecoder, RefusesEveryShortenedPayload) {
  const WovenFrame frame = make_frame({97, 31}, Content::Lenses, 0);
  BandEncoder encoder(frame.bytes().size());
  BandDecoder decoder(frame.bytes().size());
  std::vector<uint8_t> band(frame.bytes().size());
  for (const BandCodec codec : {BandCodec::Zstd, BandCodec::Predicted}) {
    std::vector<uint8_t> payload;
    ASSERT_TRUE(
        encoder.encode_as(codec, frame.bytes(), choose_predictors(frame.view(), 31), payload));
    for (size_t bytes = 0; bytes < payload.size(); ++bytes)
      ASSERT_FALSE(decoder.decode(codec, std::span(payload).first(bytes), band)) << bytes;
    payload.push_back(0);
    EXPECT_FALSE(decoder.decode(codec, payload, band));
  }
}

/// Returns a payload of one stored block, for tests that damage it.
std::vector<uint8_t> one_block(uint32_t predictors, uint32_t distance, uint8_t mode, uint32_t mask,
                               size_t values) {
  std::vector<uint8_t> payload;
  const auto number = [&](uint32_t n) {
    for (int i = 0; i < 4; ++i) payload.push_back(static_cast<uint8_t>(n >> 8 * i));
  };
  number(predictors);
  for (uint32_t t = 0; t < predictors; ++t) number(distance);
  number(1);
  payload.push_back(mode);
  number(mode >= 16 ? 4 : 0);
  if (mode >= 16) number(mask);
  number(static_cast<uint32_t>(values));
  payload.insert(payload.end(), values, uint8_t{7});
  return payload;
}

TEST(BandDecoder, RefusesInvalidPayloads) {
  BandDecoder decoder(32);
  std::vector<uint8_t> band(32);
  const auto decodes = [&](const std::vector<uint8_t>& payload, size_t bytes = 32) {
    return decoder.decode(BandCodec::Predicted, payload, std::span(band).first(bytes));
  };
  EXPECT_TRUE(decodes(one_block(0, 0, 16, 3, 2)));
  EXPECT_EQ(band[1], 7);
  EXPECT_EQ(band[2], 0);
  EXPECT_FALSE(decodes(one_block(0, 0, 16, 3, 3))) << "a value too many";
  EXPECT_FALSE(decodes(one_block(0, 0, 16, 3, 1))) << "a value too few";
  EXPECT_FALSE(decodes(one_block(0, 0, 16, 6, 2), 2)) << "beyond the end of the band";
  EXPECT_FALSE(decodes(one_block(0, 0, 32, 0, 0))) << "unknown flag";
  EXPECT_FALSE(decodes(one_block(0, 0, 1, 0, 0))) << "a tap that is not in the table";
  EXPECT_FALSE(decodes(one_block(1, 32, 1, 0, 0))) << "before the band";
  EXPECT_FALSE(decodes(one_block(1, 31, 0, 0, 0))) << "closer than a block";
  EXPECT_FALSE(decodes(one_block(16, 32, 0, 0, 0))) << "too many taps";
  EXPECT_FALSE(decodes(one_block(0, 0, 0, 0, 0), 0)) << "a block too many";
  EXPECT_FALSE(decoder.decode(BandCodec::Raw, std::vector<uint8_t>(31), band));
  EXPECT_FALSE(decoder.decode(static_cast<BandCodec>(3), std::vector<uint8_t>(32), band));
  std::vector<uint8_t> larger(64);
  EXPECT_FALSE(decoder.decode(BandCodec::Raw, larger, larger)) << "more than it was made for";
}

TEST(BandDecoder, SurvivesAnyBytes) {
  const WovenFrame frame = make_frame({97, 31}, Content::Ramp, 0);
  BandEncoder encoder(frame.bytes().size());
  std::vector<uint8_t> payload;
  ASSERT_TRUE(encoder.encode_as(BandCodec::Predicted, frame.bytes(),
                                choose_predictors(frame.view(), 31), payload));
  std::mt19937 random(7);
  std::vector<uint8_t> band(frame.bytes().size());
  int refused = 0;
  for (const Isa isa : test::every_instruction_set()) {
    BandDecoder decoder(frame.bytes().size(), isa);
    for (int i = 0; i < 3000; ++i) {
      std::vector<uint8_t> spoilt = payload;
      for (int n = 0; n <= i % 3; ++n)
        spoilt[random() % spoilt.size()] = static_cast<uint8_t>(random());
      refused += decoder.decode(BandCodec::Predicted, spoilt, band) ? 0 : 1;
    }
  }
  EXPECT_GT(refused, 1000);
}

}  // namespace
}  // namespace lenticule::frames
