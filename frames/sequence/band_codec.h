// SPDX-License-Identifier: Apache-2.0
// Compresses one band of a frame independently of all other bands, without loss or within a largest
// error of every byte. The payload's
// layout is in docs/content/formats.md.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include "base/cpu.h"
#include "frames/frame.h"
#include "frames/sequence/predictor_kernel.h"

namespace lenticule::frames {

enum class BandCodec : uint8_t {
  Raw = 0,        ///< uncompressed bytes
  Zstd = 1,       ///< one zstd frame
  Predicted = 2,  ///< blocks predicted from earlier bytes of the band, three zstd streams
};
inline constexpr uint8_t kBandCodecs = 3;

/// BandEncoder compresses bands. A payload is never larger than the band: Raw is the fallback.
class BandEncoder {
 public:
  /// Allocates for bands of at most `max_band_bytes`. Decoded bytes will be at most `max_error`
  /// off, 0 (without loss) to kMostMaxError. Throws std::bad_alloc.
  explicit BandEncoder(size_t max_band_bytes, Isa isa = best_isa(), int max_error = 0);
  ~BandEncoder();
  BandEncoder(BandEncoder&&) noexcept;
  BandEncoder& operator=(BandEncoder&&) noexcept;

  /// Encodes with the codec that gives the smallest payload, and returns it. Replaces `payload`.
  BandCodec encode(std::span<const uint8_t> band, const PredictorTable& predictors,
                   std::vector<uint8_t>& payload);
  /// Encodes with the given codec. Returns false if the payload would be larger than the band.
  [[nodiscard]] bool encode_as(BandCodec codec, std::span<const uint8_t> band,
                               const PredictorTable& predictors, std::vector<uint8_t>& payload);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

class BandDecoder {
 public:
  /// Allocates all memory, for bands of at most `max_band_bytes`.
  explicit BandDecoder(size_t max_band_bytes, Isa isa = best_isa());
  ~BandDecoder();
  BandDecoder(BandDecoder&&) noexcept;
  BandDecoder& operator=(BandDecoder&&) noexcept;

  /// Returns false for a payload that does not decode to exactly band.size() bytes; `band` is
  /// undefined then. Safe for any payload; neither allocates nor throws.
  [[nodiscard]] bool decode(BandCodec codec, std::span<const uint8_t> payload,
                            std::span<uint8_t> band) noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Chooses the distances from which a frame is predicted best. They are measured on the frame
// itself, so that the lens sheet need not be known, and views or quilts compress as well.

/// Every kPredictorInterval-th frame of a film chooses the predictors of the frames up to the next
/// choice: content changes slowly, and choosing takes about as long as compressing a frame.
inline constexpr uint64_t kPredictorInterval = 32;

/// Returns at most kMaxPredictors distances (predictors), the most useful first. Examines a fixed
/// sample of the blocks: the same frame gives the same predictors on every machine. `band_rows` is
/// the container's value.
[[nodiscard]] PredictorTable choose_predictors(const FrameView& frame, int band_rows);

class BandWorkers {
 public:
  /// Starts the threads; 0 means one thread per core.
  explicit BandWorkers(int threads);
  ~BandWorkers();
  BandWorkers(const BandWorkers&) = delete;
  BandWorkers& operator=(const BandWorkers&) = delete;

  [[nodiscard]] int count() const { return count_; }

  /// Calls job(band, worker) once for every band of 0..bands-1; `worker` is 0..count()-1, and no
  /// two calls with the same worker run at once. The calling thread works too. Returns when all
  /// calls are done; rethrows the first exception of a job.
  void run(int bands, const std::function<void(int band, int worker)>& job);

 private:
  void serve(int worker);
  void work(int worker, std::unique_lock<std::mutex>& lock);

  int count_;
  std::mutex mutex_;
  std::condition_variable started_;
  std::condition_variable ended_;
  const std::function<void(int, int)>* job_ = nullptr;
  int bands_ = 0;
  int next_ = 0;
  int running_ = 0;
  bool stopping_ = false;
  std::exception_ptr failure_;
  std::vector<std::jthread> threads_;  // last member: the threads use everything above
};

}  // namespace lenticule::frames
