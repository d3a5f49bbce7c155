// SPDX-License-Identifier: Apache-2.0
// Audit of method adaptive: a fixed random selection of subpixels is traced in addition, to measure
// the error of a frame and to find the bands that must be retraced.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "render/integrator/packet_tracer.h"
#include "render/rays/primary_packets.h"
#include "render/rays/primary_rays.h"

namespace lenticule::render {

// BandOrder decides, step by step, which bands of a frame method adaptive tries and which it leaves
// to method full, from what the bands tried before have gained. BandCostModel estimates the gains.

/// BandOrder serves one frame. The first step tries a few bands spread over the frame, the next
/// steps the bands halfway between those. A band is left to method full in two cases: the nearest
/// tried bands above and below it have each cost more than method full, or their gains and twice
/// the mean gain of all tried bands add up to a loss. Decisions depend on the noted gains only.
class BandOrder {
 public:
  explicit BandOrder(int bands);

  /// Returns the bands of the next step, in ascending order. The gains of all bands returned before
  /// must be noted. Returns none after the last step.
  [[nodiscard]] std::vector<int> next();
  /// Notes the processor time that a tried band has saved against method full, negative if it took
  /// more. A later gain replaces an earlier one. All gains of a frame have the same unit.
  void note(int band, int64_t gain);
  /// Returns true if the bands tried so far have cost more than with method full. A single band is
  /// not enough evidence, nor are few bands of which some have gained.
  [[nodiscard]] bool loses() const;

 private:
  /// The gains of all tried bands together.
  struct Sum {
    int64_t total = 0, tried = 0, gained = 0;
  };
  [[nodiscard]] Sum sum() const;
  [[nodiscard]] int64_t expected_gain(int band, const Sum& all) const;

  std::vector<std::optional<int64_t>> gains_;  ///< gain of each band; empty until the band is tried
  std::vector<uint8_t> decided_;
  bool is_first_ = true;
  int stride_;
};

/// BandCounts holds what the costs of a band depend on.
struct BandCounts {
  uint32_t seen = 0;     ///< subpixels that see a surface
  uint32_t shaded = 0;   ///< subpixels that were shaded individually, or copied instead
  uint32_t cuts = 0;     ///< primitives cut by the rows' planes
  uint32_t audited = 0;  ///< subpixels traced for the audit
  uint64_t rays = 0;     ///< shadow and secondary rays of these
};

/// BandCosts holds estimates in nanoseconds of processor time. Only their ratios matter.
struct BandCosts {
  int64_t full = 0;     ///< cost with method full
  int64_t lookups = 0;  ///< sweep, lookups, samples and audit of method adaptive
  int64_t shading = 0;  ///< subpixels that method adaptive shades individually

  [[nodiscard]] int64_t spent() const { return lookups + shading; }
};

/// BandCostModel estimates the costs of the bands of one scene.
struct BandCostModel {
  size_t subpixels = 0;  ///< number of subpixels of a band
  bool has_pbr = false;  ///< the scene has metallic-roughness materials
  bool is_soft = false;  ///< light is sampled: each subpixel has many rays

  [[nodiscard]] BandCosts costs(const BandCounts& band) const;
};

/// Returns the estimated time of method full for subpixels that all see a surface and from each of
/// which `rays` sixteenths of a ray start.
[[nodiscard]] int64_t time_of_full(int64_t subpixels, int64_t rays);
/// Returns the estimated time that finding surfaces and rows of primitives takes in a frame.
[[nodiscard]] int64_t time_of_set_up(int64_t primitives);

/// Two disjoint selections: one decides which bands are retraced, the other evaluates the result.
enum class Draw : uint8_t { None, Retracing, Evaluation };

/// Each of the two selections has one subpixel per kSampledOneIn subpixels of a row (stratified,
/// fixed positions), or more if AuditSelection is told so. Stratification covers a frame more
/// evenly than a binomial sample, so the binomial bounds below are conservative.
inline constexpr uint32_t kSampledOneIn = 512;
struct SampledPair {
  uint32_t retracing, evaluation;  ///< subpixels of the row, or beyond its end
};

/// AuditSelection selects subpixels by a hash of their place. A denser evaluation proves more.
class AuditSelection {
 public:
  /// The evaluation takes one in `one_in` subpixels, 2 to kSampledOneIn. The other selection takes
  /// about one in `retracing_one_in`, `one_in` to kSampledOneIn.
  explicit AuditSelection(uint32_t one_in = kSampledOneIn,
                          uint32_t retracing_one_in = kSampledOneIn)
      : one_in_(one_in), retracing_every_(retracing_one_in / one_in) {}

  [[nodiscard]] uint32_t one_in() const { return one_in_; }
  /// Returns the selected subpixels among the one_in() subpixels that start at one_in() *
  /// `stretch`.
  [[nodiscard]] SampledPair pair(uint32_t row, uint32_t stretch) const {
    uint32_t hash = (row * 0x9e3779b9U) ^ (stretch * 0x85ebca6bU);
    hash ^= hash >> 15;
    hash *= 0x2c1b3c6dU;
    hash ^= hash >> 12;
    hash *= 0x297a2d39U;
    hash ^= hash >> 15;
    const uint32_t first = stretch * one_in_;
    const uint32_t retracing = hash % one_in_;
    const uint32_t apart = 1 + (hash >> 16) % (one_in_ - 1);
    return {stretch % retracing_every_ == 0 ? first + retracing : kNone,
            first + (retracing + apart) % one_in_};
  }

 private:
  static constexpr uint32_t kNone = UINT32_MAX;

  uint32_t one_in_, retracing_every_;
};

struct AuditCounts {
  uint64_t sampled = 0;
  uint64_t beyond = 0;  ///< part of `sampled` whose error exceeds the tolerated error
  AuditCounts& operator+=(const AuditCounts& other) {
    sampled += other.sampled;
    beyond += other.beyond;
    return *this;
  }
};

/// Returns an upper bound, with 99.99 % confidence, of the share of all subpixels whose error
/// exceeds the tolerated error (Clopper and Pearson's exact bound for a binomial share); 1 if no
/// subpixel was sampled. The confidence is that high because the bounds of all frames of a sequence
/// should hold, and because the selection is the same in each.
[[nodiscard]] double bound_of_share(const AuditCounts& counts);

/// Returns true if the samples of a band indicate that more than the share `most` of its subpixels
/// exceeds the tolerated error.
[[nodiscard]] bool needs_retracing(const AuditCounts& band, double most);

/// Errors of sampled subpixels: how many are off by 0, 1, ..., 255 code values.
class AuditErrors {
 public:
  void add(uint8_t code, uint8_t exact);
  /// Adds samples without error.
  void add_exact(uint64_t samples) { subpixels_[0] += static_cast<uint32_t>(samples); }
  AuditErrors& operator+=(const AuditErrors& other);

  [[nodiscard]] uint64_t sampled() const;
  /// Returns the number of errors of `error` code values, 0 to 255.
  [[nodiscard]] uint64_t exactly(int error) const { return subpixels_[static_cast<size_t>(error)]; }
  /// Returns the number of errors of at least `error` code values, 0 to 256.
  [[nodiscard]] uint64_t at_least(int error) const;
  /// Returns the number of errors that exceed the tolerated error.
  [[nodiscard]] AuditCounts counts(double tolerated_error) const;
  /// Returns the mean of the squared errors; 0 if there are none.
  [[nodiscard]] double mean_square() const;
  /// Returns the standard error of mean_square(); 0 for fewer than two samples.
  [[nodiscard]] double standard_error() const;

 private:
  std::array<uint32_t, 256> subpixels_{};
};

/// Number of sets of bands whose mean square may be judged by one evaluation.
inline constexpr int kMeanSquareLooks = 6;
/// Returns an upper bound of the mean squared error of all subpixels: that of the samples, and what
/// errors of 255 code values may add that no sample shows. With 99 % confidence, none of
/// kMeanSquareLooks bounds of one frame is too low.
[[nodiscard]] double bound_of_mean_square(const AuditErrors& errors);

/// Returns one in how many subpixels the evaluation must select so that the bound of a frame
/// without errors is about a third of `mean_square`: 2 to kSampledOneIn.
[[nodiscard]] uint32_t sampled_one_in_for(double mean_square, uint64_t subpixels);

/// SampledSubpixels holds the subpixels of a band that the audit samples, and traces them as method
/// full does. It belongs to one thread and keeps its memory from band to band. A ray that
/// differs in its last bit can give a different picture after several reflections. So rays are the
/// same as in method full, and the light of a ray does not depend on the other rays of its packet.
class SampledSubpixels {
 public:
  struct Subpixel {
    int32_t at = 0;    ///< 3 i + channel
    uint16_t row = 0;  ///< index in the band
    Draw draw = Draw::None;
    bool is_shaded = false;  ///< not looked up
    float light = 0.0F;      ///< result of tracing
  };

  /// Lifetime: all arguments must outlive the object. `centre` is the centre of the subpixels.
  SampledSubpixels(const PrimaryPackets& packets, const TilePlan& plan, const Footprint& centre);

  void clear() { subpixels_.clear(); }
  void add(const Subpixel& subpixel) { subpixels_.push_back(subpixel); }
  /// Traces all subpixels of the band that begins at `first_row`. Afterwards the subpixels have a
  /// different order. The calling thread must flush denormals.
  void trace(const Scene& scene, int first_row, PacketTracer& tracer);
  [[nodiscard]] const std::vector<Subpixel>& subpixels() const { return subpixels_; }

 private:
  [[nodiscard]] int column(const Subpixel& s) const { return s.at + plan_.shift(s.row); }
  void trace_packet(const Scene& scene, int first_row, size_t first, size_t end,
                    PacketTracer& tracer);

  const TilePlan& plan_;
  const Footprint& centre_;
  PrimaryPackets::Maker maker_;
  std::vector<Subpixel> subpixels_;
  std::vector<RayPacket> packet_;  ///< a single packet
  alignas(64) std::array<int32_t, kPacket> channel_{};
  std::array<uint32_t, kPacket> seeds_{};
  alignas(64) std::array<float, kPacket> light_{};
};

}  // namespace lenticule::render
