// SPDX-License-Identifier: Apache-2.0
// Weaving at the speed of memory: what frames/weave.h does, from a plan and in integers. Mixed
// subpixels are within one code value of the reference's; where all pixels that count are equal, or
// only one counts, they are the reference's own bytes.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "base/cpu.h"
#include "frames/frame.h"
#include "frames/quilt.h"
#include "frames/weave.h"
#include "frames/weaving/weave_plan.h"

namespace lenticule::frames {

/// Which inner loop runs; all of them write the same bytes.
enum class WeaveKernel {
  Plain,    ///< any processor and plan, pixel by pixel
  Turned,   ///< any processor and plan: picture rows are put side by side in light first
  Avx2,     ///< the same with AVX2
  Permute,  ///< AVX-512 with byte permutes (VBMI): stripes, up to 64 views, not for Gauss
};
inline constexpr WeaveKernel kWeaveKernels[] = {WeaveKernel::Plain, WeaveKernel::Turned,
                                                WeaveKernel::Avx2, WeaveKernel::Permute};
[[nodiscard]] const char* to_string(WeaveKernel kernel);
/// Whether this machine and plan can use it.
[[nodiscard]] bool kernel_suits(WeaveKernel kernel, const WeavePlan& plan);
/// The best for this plan on this machine. `isa` (and LENTICULE_ISA) can ask for less.
[[nodiscard]] WeaveKernel best_kernel(const WeavePlan& plan, Isa isa = best_isa());

/// Weaves blocks of four rows by one plan. One thread; keeps its working memory.
class BlockWeaver {
 public:
  /// Throws Error(Usage) for a kernel that this machine or plan cannot use.
  BlockWeaver(std::shared_ptr<const WeavePlan> plan, WeaveKernel kernel);

  /// Fills the rows of blocks [begin, end). The views must have the plan's shape, the frame its
  /// geometry. Does not allocate.
  void weave(const ViewSet& views, int begin, int end, WovenFrame& frame) noexcept;

 private:
  using Turned = std::unique_ptr<uint8_t[], void (*)(void*)>;

  void prepare_spot();
  void look_at(const ViewSet& views) noexcept;
  void weave_block(int index, WovenFrame& frame) noexcept;
  void mix(const WeavePlan::Block& block) noexcept;
  void mix_set(const weave_kernel::Set& set, const weave_kernel::Quad* quads,
               const weave_kernel::Target& target) noexcept;
  void blacken(const WeavePlan::Block& block) noexcept;
  void encode_row(const uint16_t* light, uint8_t* codes) const noexcept;
  void prepare_turning();
  void turn(int row, uint8_t* turned) const noexcept;
  [[nodiscard]] const uint8_t* turned_row(int row) noexcept;
  [[nodiscard]] weave_kernel::TurnedRows turned_rows(const weave_kernel::Set& set) noexcept;

  std::shared_ptr<const WeavePlan> plan_;
  WeaveKernel kernel_;
  weave_kernel::Terms terms_{};
  std::vector<const uint8_t*> first_pixels_;
  weave_kernel::Pictures pictures_{};
  std::vector<uint16_t> light_;
  size_t light_stride_ = 0;
  /// Picture rows with the views side by side: row r in slot r mod slots.
  Turned turned_;
  size_t turned_bytes_ = 0;
  size_t lanes_ = 0;
  std::vector<int> slots_;
  std::vector<uint16_t> spot_;  ///< weights, for Gauss
};

/// Several threads that weave frame after frame by one plan.
class FastWeaver {
 public:
  /// `threads` of 1 weaves in the caller's thread alone. Errors as BlockWeaver.
  explicit FastWeaver(std::shared_ptr<const WeavePlan> plan, int threads = 1);
  FastWeaver(std::shared_ptr<const WeavePlan> plan, int threads, WeaveKernel kernel);
  ~FastWeaver();
  FastWeaver(const FastWeaver&) = delete;
  FastWeaver& operator=(const FastWeaver&) = delete;

  /// Returns when the frame is whole. One caller at a time. Does not allocate.
  void weave(const ViewSet& views, WovenFrame& frame) noexcept;

  [[nodiscard]] const WeavePlan& plan() const { return *plan_; }
  [[nodiscard]] WeaveKernel kernel() const { return kernel_; }

 private:
  void help(size_t worker) noexcept;
  void weave_share(size_t worker) noexcept;

  std::shared_ptr<const WeavePlan> plan_;
  WeaveKernel kernel_;
  std::vector<std::unique_ptr<BlockWeaver>> workers_;
  std::mutex mutex_;  ///< guards the six below
  std::condition_variable start_, done_;
  const ViewSet* views_ = nullptr;
  WovenFrame* frame_ = nullptr;
  uint64_t round_ = 0;
  size_t busy_ = 0;
  bool ending_ = false;
  std::vector<std::thread> helpers_;
};

/// The whole frame at once, by the fast weaver, or the reference where there are more views than a
/// plan takes.
[[nodiscard]] WovenFrame weave_fast(const ViewSet& views, const optics::OpticalModel& model,
                                    const WeaveOptions& options = {}, int threads = 1);

}  // namespace lenticule::frames
