// SPDX-License-Identifier: Apache-2.0
#include "frames/sequence/predictor_choice.h"

#include <algorithm>
#include <vector>

#include "frames/sequence/predictor_kernel.h"

namespace lenticule::frames {
namespace {

constexpr size_t kSamples = 8192;
constexpr int kMaxRowsUp = 8;
constexpr int kMaxPixelsAside = 16;
constexpr int kMaxPixelsLeft = 32;    // distance within the row
constexpr uint8_t kNothingYet = 160;  // more than any block costs without prediction

/// Returns candidate distances of whole pixels, so that red is predicted from red.
std::vector<uint32_t> candidates(const FrameGeometry& geometry, int band_rows) {
  const auto pixel = static_cast<int64_t>(bytes_per_pixel(geometry.format));
  const auto row = static_cast<int64_t>(geometry.row_bytes());
  std::vector<uint32_t> distances;
  const auto add = [&](int64_t distance) {
    if (distance >= static_cast<int64_t>(kBlockBytes))
      distances.push_back(static_cast<uint32_t>(distance));
  };
  for (int left = 1; left <= std::min(kMaxPixelsLeft, geometry.width - 1); ++left)
    add(left * pixel);
  const int aside = std::min(kMaxPixelsAside, geometry.width - 1);
  for (int up = 1; up <= std::min(kMaxRowsUp, band_rows - 1); ++up) {
    for (int left = -aside; left <= aside; ++left) add(up * row + left * pixel);
  }
  std::sort(distances.begin(), distances.end());
  distances.erase(std::unique(distances.begin(), distances.end()), distances.end());
  return distances;
}

/// Returns starts of whole blocks, spread over the frame, at which every candidate is inside its
/// band.
std::vector<size_t> sample_blocks(const FrameGeometry& geometry, int band_rows) {
  const size_t row = geometry.row_bytes();
  const size_t band = row * static_cast<size_t>(band_rows);
  const size_t reach = std::min(row * kMaxRowsUp + row / 2, band / 2);
  const size_t blocks = geometry.frame_bytes() / kBlockBytes;
  const size_t step =
      std::max<size_t>(blocks / kSamples, 1) | 1;  // odd, so that all columns are sampled
  std::vector<size_t> starts;
  for (size_t block = 0; block < blocks; block += step) {
    const size_t start = block * kBlockBytes;
    if (start % band >= reach) starts.push_back(start);
  }
  return starts;
}

/// Returns costs[c * starts.size() + s]: the cost of sample s predicted from candidate c.
std::vector<uint8_t> measure(const FrameView& frame, const std::vector<uint32_t>& distances,
                             const std::vector<size_t>& starts) {
  const PredictorKernel& kernel = predictor_kernel(best_isa());
  std::vector<uint8_t> costs;
  costs.reserve(distances.size() * starts.size());
  for (const uint32_t distance : distances) {
    for (const size_t start : starts) {
      const uint8_t* block = frame.bytes.data() + start;
      costs.push_back(distance > start
                          ? kNothingYet
                          : static_cast<uint8_t>(kernel.predictor_cost(block, block - distance)));
    }
  }
  return costs;
}

/// Returns the saving of the samples by one more candidate.
uint64_t gain(const uint8_t* costs, const std::vector<uint8_t>& so_far) {
  uint64_t saved = 0;
  for (size_t s = 0; s < so_far.size(); ++s)
    saved += static_cast<uint64_t>(so_far[s] > costs[s] ? so_far[s] - costs[s] : 0);
  return saved;
}

}  // namespace

PredictorTable choose_predictors(const FrameView& frame, int band_rows) {
  const std::vector<uint32_t> distances = candidates(frame.geometry, band_rows);
  const std::vector<size_t> starts = sample_blocks(frame.geometry, band_rows);
  const std::vector<uint8_t> costs = measure(frame, distances, starts);
  std::vector<uint8_t> so_far(starts.size(), kNothingYet);
  PredictorTable predictors;
  while (predictors.count < kMaxPredictors) {
    size_t best = 0;
    uint64_t best_gain = 0;
    for (size_t c = 0; c < distances.size(); ++c) {
      const uint64_t saved = gain(&costs[c * starts.size()], so_far);
      if (saved > best_gain) {
        best_gain = saved;
        best = c;
      }
    }
    if (best_gain == 0) break;
    predictors.distance[++predictors.count] = distances[best];
    const uint8_t* chosen = &costs[best * starts.size()];
    for (size_t s = 0; s < starts.size(); ++s) so_far[s] = std::min(so_far[s], chosen[s]);
  }
  return predictors;
}

const PredictorKernel& predictor_kernel(Isa isa) {
#if defined(__x86_64__)
  if (!__builtin_cpu_supports("avx512vbmi2")) isa = std::min(isa, Isa::Avx2);
#endif
  return LENTICULE_SELECT_KERNEL(isa, kPredictorKernel);
}

}  // namespace lenticule::frames
