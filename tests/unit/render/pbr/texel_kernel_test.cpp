// SPDX-License-Identifier: Apache-2.0
// Compares the look-ups of every instruction set with a plain one in double precision, and with
// each other.
#include "render/textures/texel_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "frames/srgb.h"

namespace lenticule::render {
namespace {

using namespace texel_kernel;
using Mean = std::array<float, 4>;

std::vector<const Kernel*> runnable_kernels() {
  std::vector<const Kernel*> kernels = {&isa_baseline::kTexelKernel};
#if defined(__x86_64__)
  if (isa_supported(Isa::Avx2)) kernels.push_back(&isa_avx2::kTexelKernel);
  if (isa_supported(Isa::Avx512)) kernels.push_back(&isa_avx512::kTexelKernel);
#elif defined(__aarch64__)
  kernels.push_back(&isa_neon::kTexelKernel);
#endif
  return kernels;
}

const std::vector<float>& light_of_code() {
  static const std::vector<float> light(frames::linear_of_codes().begin(),
                                        frames::linear_of_codes().end());
  return light;
}

/// Returns the place in the picture, 0 to 1, of a coordinate.
double place_of(double c, bool repeat, bool mirror) {
  if (!(std::abs(c) < 1e15)) c = 0.0;
  if (!repeat) return std::clamp(c, 0.0, 1.0);
  if (!mirror) return c - std::floor(c);
  const double in_pair = c - 2.0 * std::floor(0.5 * c);
  return in_pair > 1.0 ? 2.0 - in_pair : in_pair;
}

/// A texture of two levels with random texels.
class TexelKernel : public ::testing::Test {
 protected:
  static constexpr int32_t kFine[] = {7, 5}, kCoarse[] = {3, 2};

  TexelKernel() {
    for (auto* codes : {&fine_, &coarse_}) {
      codes->resize(4 * 7 * 5);
      for (uint8_t& code : *codes) code = static_cast<uint8_t>(random_());
    }
    for (size_t n = 0; n < fine_.size(); ++n) values_.push_back(fine_[n] / 255.0F);
  }

  [[nodiscard]] Path random_path() {
    std::uniform_real_distribution<double> anywhere(-3.0, 3.0), longer(-0.5, 0.5);
    Path path{.middle = {anywhere(random_), anywhere(random_)},
              .length = {longer(random_), longer(random_)},
              .repeat = {int32_t(random_() % 2), int32_t(random_() % 2)},
              .mirror = {int32_t(random_() % 2), int32_t(random_() % 2)},
              .fine_size = {kFine[0], kFine[1]},
              .coarse_size = {kCoarse[0], kCoarse[1]}};
    constexpr double kOdd[] = {0.0, -0.0, 1.0, -1.0, 0.5, 1e14, -1e300, INFINITY, NAN};
    if (random_() % 8 == 0) path.middle[random_() % 2] = kOdd[random_() % std::size(kOdd)];
    return path;
  }
  [[nodiscard]] Lookup random_lookup() {
    Lookup lookup{};
    lookup.places = 1 + static_cast<int32_t>(random_() % kPlaces);
    lookup.of_coarse = random_() % 2 == 0 ? 0.0F : static_cast<float>(random_() % 1000) / 1000.0F;
    return lookup;
  }
  static Mean mean(const Kernel& kernel, Content content, const Level& fine, const Level& coarse,
                   const Lookup& lookup) {
    Mean out{};
    kernel.mean(content, light_of_code().data(), fine, coarse, lookup, out.data());
    return out;
  }
  [[nodiscard]] Level fine() const { return {fine_.data(), nullptr, 1}; }
  [[nodiscard]] Level coarse() const { return {coarse_.data(), nullptr, 0}; }
  [[nodiscard]] Level values() const { return {nullptr, values_.data(), 1}; }

  std::mt19937 random_{3};
  std::vector<uint8_t> fine_, coarse_;
  std::vector<float> values_;
};

TEST_F(TexelKernel, FindsTheTexelsAroundEachPlace) {
  for (int round = 0; round < 3000; ++round) {
    const Path path = random_path();
    Lookup lookup = random_lookup();
    isa_baseline::kTexelKernel.find(path, lookup);
    for (int n = 0; n < lookup.places; ++n) {
      int32_t first[2], second[2];
      for (int k = 0; k < 2; ++k) {
        const double at = path.middle[k] + path.length[k] * ((n + 0.5) / lookup.places - 0.5);
        const bool repeats = path.repeat[k] != 0, mirrors = path.mirror[k] != 0;
        const int32_t size = kFine[k];
        const double texel = place_of(at, repeats, mirrors) * size - 0.5;
        const auto left = static_cast<int32_t>(std::floor(texel));
        const float part = k == 0 ? lookup.fine[n].right : lookup.fine[n].below;
        ASSERT_NEAR(part, texel - left, 1e-6);
        const auto inside = [&](int32_t number) {
          return repeats && !mirrors ? (number + size) % size : std::clamp(number, 0, size - 1);
        };
        first[k] = inside(left);
        second[k] = inside(left + 1);
      }
      const int32_t(&texel)[4] = lookup.fine[n].texel;
      ASSERT_EQ(texel[0], first[1] * kFine[0] + first[0]);
      ASSERT_EQ(texel[1], first[1] * kFine[0] + second[0]);
      ASSERT_EQ(texel[2], second[1] * kFine[0] + first[0]);
      ASSERT_EQ(texel[3], second[1] * kFine[0] + second[0]);
    }
  }
}

TEST_F(TexelKernel, IsTheMeanOfBilinearValues) {
  for (int round = 0; round < 1000; ++round) {
    Lookup lookup = random_lookup();
    isa_baseline::kTexelKernel.find(random_path(), lookup);
    for (const Content content : {Content::Colour, Content::Data}) {
      const auto level_value = [&](const std::vector<uint8_t>& codes, const Corners& at, size_t c) {
        const auto of = [&](int corner) {
          const uint8_t code = codes[4 * static_cast<size_t>(at.texel[corner]) + c];
          return content == Content::Colour && c < 3 ? frames::linear_of_codes()[code]
                                                     : code / 255.0;
        };
        const double right = double{at.right}, below = double{at.below};
        return (1.0 - below) * ((1.0 - right) * of(0) + right * of(1)) +
               below * ((1.0 - right) * of(2) + right * of(3));
      };
      const Mean got = mean(isa_baseline::kTexelKernel, content, fine(), coarse(), lookup);
      for (size_t c = 0; c < 4; ++c) {
        double expected = 0.0;
        for (int n = 0; n < lookup.places; ++n) {
          const double sharp = level_value(fine_, lookup.fine[n], c);
          expected += sharp;
          if (lookup.of_coarse > 0.0F)
            expected +=
                double{lookup.of_coarse} * (level_value(coarse_, lookup.coarse[n], c) - sharp);
        }
        ASSERT_NEAR(got[c], expected / lookup.places, 1e-6);
      }
    }
  }
}

TEST_F(TexelKernel, MakesUnitVectorsOfNormals) {
  Lookup lookup{};
  lookup.places = 1;
  for (int32_t texel = 0; texel < kFine[0] * kFine[1]; ++texel) {
    for (int32_t& each : lookup.fine[0].texel) each = texel;
    const Mean v = mean(isa_baseline::kTexelKernel, Content::Normals, fine(), coarse(), lookup);
    ASSERT_NEAR(std::hypot(v[0], v[1], v[2]), 1.0, 1e-6);
    const uint8_t* code = fine_.data() + 4 * texel;
    const double size =
        std::hypot(code[0] / 127.5 - 1.0, code[1] / 127.5 - 1.0, code[2] / 127.5 - 1.0);
    ASSERT_NEAR(v[0], (code[0] / 127.5 - 1.0) / size, 1e-6);
  }
}

/// The same bits on every instruction set, for codes and for values.
TEST_F(TexelKernel, GivesTheSameBitsOnEveryInstructionSet) {
  const std::vector<const Kernel*> kernels = runnable_kernels();
  for (int round = 0; round < 3000; ++round) {
    const Path path = random_path();
    const Lookup wanted = random_lookup();
    Lookup first = wanted;
    kernels[0]->find(path, first);
    for (const Kernel* kernel : kernels) {
      Lookup other = wanted;
      kernel->find(path, other);
      ASSERT_EQ(std::memcmp(&first, &other, sizeof first), 0);
      for (const Content content : {Content::Colour, Content::Data, Content::Normals})
        for (const Level& sharp : {fine(), values()}) {
          const Mean a = mean(*kernels[0], content, sharp, coarse(), first);
          const Mean b = mean(*kernel, content, sharp, coarse(), first);
          ASSERT_EQ(std::memcmp(&a, &b, sizeof a), 0) << "round " << round;
        }
    }
  }
}

}  // namespace
}  // namespace lenticule::render
