// SPDX-License-Identifier: Apache-2.0
// FastWeaver weaves at memory speed: the same result as frames/weave.h, from a plan and in
// integers. Mixed subpixels are within one code value of the reference's; where all contributing
// pixels are equal, or a single pixel contributes, the bytes equal the reference's.
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

/// WeaveKernel selects the inner loop; all kernels write the same bytes.
enum class WeaveKernel {
  Plain,       ///< any processor and plan, pixel by pixel
  Transposed,  ///< any processor and plan: picture rows are first transposed, views side by side in
               ///< linear light
  Neon,        ///< the same with NEON
  Avx2,        ///< the same with AVX2
  Permute,     ///< AVX-512 with byte permutes (VBMI): stripes, up to 64 views, not for Gauss
};
inline constexpr WeaveKernel kWeaveKernels[] = {WeaveKernel::Plain, WeaveKernel::Transposed,
                                                WeaveKernel::Neon, WeaveKernel::Avx2,
                                                WeaveKernel::Permute};
[[nodiscard]] const char* to_string(WeaveKernel kernel);
/// Returns true if this machine and plan can use the kernel.
[[nodiscard]] bool kernel_suits(WeaveKernel kernel, const WeavePlan& plan);
/// Returns the fastest kernel for this plan on this machine. `isa` (and LENTICULE_ISA) can select a
/// smaller instruction set.
[[nodiscard]] WeaveKernel best_kernel(const WeavePlan& plan, Isa isa = best_isa());

/// BlockWeaver weaves blocks of four rows by one plan and keeps its working memory.
///
/// Thread safety: one thread.
class BlockWeaver {
 public:
  /// Throws Error(Usage) for a kernel that this machine or plan cannot use.
  BlockWeaver(std::shared_ptr<const WeavePlan> plan, WeaveKernel kernel);

  /// Fills the rows of blocks [begin, end). The views must have the plan's shape, the frame its
  /// geometry. Does not allocate.
  void weave(const ViewSet& views, int begin, int end, WovenFrame& frame) noexcept;

 private:
  using Transposed = std::unique_ptr<uint8_t[], void (*)(void*)>;

  void prepare_spot();
  void look_at(const ViewSet& views) noexcept;
  void weave_block(int index, WovenFrame& frame) noexcept;
  void mix(const WeavePlan::Block& block) noexcept;
  void mix_set(const weave_kernel::Set& set, const weave_kernel::Quad* quads,
               const weave_kernel::Target& target) noexcept;
  void blacken(const WeavePlan::Block& block) noexcept;
  void write_row(int r, uint8_t* row) const noexcept;
  void prepare_turning();
  void transpose(int row, uint8_t* transposed) const noexcept;
  [[nodiscard]] const uint8_t* transposed_row(int row) noexcept;
  [[nodiscard]] weave_kernel::TransposedRows transposed_rows(const weave_kernel::Set& set) noexcept;

  std::shared_ptr<const WeavePlan> plan_;
  WeaveKernel kernel_;
  const weave_kernel::RunKernel* run_kernel_;  ///< used by the kernels of transposed light
  weave_kernel::Terms terms_{};
  std::vector<const uint8_t*> first_pixels_;
  weave_kernel::Pictures pictures_{};
  /// Rows of the block that is woven: code values of the permuting kernels, light of the others.
  std::vector<uint8_t> codes_;
  std::vector<uint16_t> light_;
  size_t stride_ = 0;
  /// Transposed picture rows, with the views side by side: row r in slot r mod slots.
  Transposed transposed_;
  size_t transposed_bytes_ = 0;
  size_t lanes_ = 0;
  std::vector<int> slots_;
  std::vector<uint16_t> spot_;  ///< weights, for Gauss
};

/// FastWeaver weaves frame after frame by one plan with several threads.
class FastWeaver {
 public:
  /// Starts the threads; `threads` = 1 weaves in the caller's thread only. Throws the errors of
  /// BlockWeaver.
  explicit FastWeaver(std::shared_ptr<const WeavePlan> plan, int threads = 1);
  FastWeaver(std::shared_ptr<const WeavePlan> plan, int threads, WeaveKernel kernel);
  ~FastWeaver();
  FastWeaver(const FastWeaver&) = delete;
  FastWeaver& operator=(const FastWeaver&) = delete;

  /// Returns when the frame is complete. Does not allocate.
  ///
  /// Thread safety: one caller at a time.
  void weave(const ViewSet& views, WovenFrame& frame) noexcept;

  [[nodiscard]] const WeavePlan& plan() const { return *plan_; }
  [[nodiscard]] WeaveKernel kernel() const { return kernel_; }

 private:
  void help(size_t worker) noexcept;
  void weave_share(size_t worker) noexcept;

  std::shared_ptr<const WeavePlan> plan_;
  WeaveKernel kernel_;
  std::vector<std::unique_ptr<BlockWeaver>> workers_;
  std::mutex mutex_;  ///< guards the six members below
  std::condition_variable start_, done_;
  const ViewSet* views_ = nullptr;
  WovenFrame* frame_ = nullptr;
  uint64_t round_ = 0;
  size_t busy_ = 0;
  bool ending_ = false;
  std::vector<std::thread> helpers_;
};

/// Weaves the whole frame at once: with the fast weaver, or with the reference if there are more
/// views than a plan supports.
[[nodiscard]] WovenFrame weave_fast(const ViewSet& views, const optics::OpticalModel& model,
                                    const WeaveOptions& options = {}, int threads = 1);

}  // namespace lenticule::frames
