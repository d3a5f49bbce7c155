// SPDX-License-Identifier: Apache-2.0
// FastWeaver weaves at memory speed: the same result as frames/weave.h, from a plan and in
// integers. Mixed subpixels are within one code value of the reference's; where all contributing
// pixels are equal, or a single pixel contributes, the bytes equal the reference's.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "base/cpu.h"
#include "base/error_kinds.h"
#include "base/worker_threads.h"
#include "frames/frame.h"
#include "frames/quilt.h"
#include "frames/weave.h"
#include "frames/weaving/crosstalk.h"
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
/// Transposing costs time for every pixel of the views, mixing for every subpixel: if views have
/// far more pixels than the panel, reading single pixels is faster.
inline constexpr size_t kMaxTransposed = 64;

inline bool worth_turning(const WeavePlan& plan) {
  const ViewShape& shape = plan.shape();
  const auto pixels = [](int width, int height) {
    return static_cast<size_t>(width) * static_cast<size_t>(height);
  };
  return pixels(shape.width, shape.height) * static_cast<size_t>(shape.count) <=
         kMaxTransposed * pixels(plan.geometry().width, plan.geometry().height);
}

inline bool can_permute() {
#if defined(__x86_64__)
  return isa_supported(Isa::Avx512) && __builtin_cpu_supports("avx512vbmi") != 0 &&
         __builtin_cpu_supports("avx512vnni") != 0;
#else
  return false;
#endif
}

[[nodiscard]] inline const char* to_string(WeaveKernel kernel) {
  constexpr const char* kNames[] = {"plain", "turned", "neon", "avx2", "permute"};
  return kNames[static_cast<size_t>(kernel)];
}
/// Returns true if this machine and plan can use the kernel.
[[nodiscard]] inline bool kernel_suits(WeaveKernel kernel, const WeavePlan& plan) {
  const bool gauss = plan.options().filter == ViewFilter::Gauss;
  if (kernel == WeaveKernel::Neon) return isa_supported(Isa::Neon);
  if (kernel == WeaveKernel::Avx2) return isa_supported(Isa::Avx2);
  if (kernel == WeaveKernel::Permute)
    return can_permute() && !gauss && plan.in_stripes() &&
           plan.shape().count <= weave_kernel::kViewLanes;
  return true;
}
/// Returns the fastest kernel for this plan on this machine. `isa` (and LENTICULE_ISA) can select a
/// smaller instruction set.
[[nodiscard]] inline WeaveKernel best_kernel(const WeavePlan& plan, Isa isa = best_isa()) {
  if (!worth_turning(plan)) return WeaveKernel::Plain;
  if (isa == Isa::Avx512 && kernel_suits(WeaveKernel::Permute, plan)) return WeaveKernel::Permute;
  if (isa >= Isa::Avx2 && kernel_suits(WeaveKernel::Avx2, plan)) return WeaveKernel::Avx2;
  if (isa != Isa::Baseline && kernel_suits(WeaveKernel::Neon, plan)) return WeaveKernel::Neon;
  return WeaveKernel::Transposed;
}

/// BlockWeaver weaves blocks of four rows by one plan and keeps its working memory.
///
/// Thread safety: one thread.
class BlockWeaver {
 public:
  /// Throws Error(Usage) for a kernel that this machine or plan cannot use.
  BlockWeaver(std::shared_ptr<const WeavePlan> plan, WeaveKernel kernel)
      : plan_(std::move(plan)),
        kernel_(kernel),
        run_kernel_(&run_kernel(kernel)),
        transposed_(nullptr, std::free) {
    if (!kernel_suits(kernel, *plan_))
      throw usage_error("weaving kernel {}: not supported by this machine or this plan",
                        to_string(kernel));
    const ViewShape& shape = plan_->shape();
    const bool mixes = plan_->options().filter != ViewFilter::Nearest;
    terms_ = {.view_step = plan_->view_step(),
              .view_most = plan_->view_most(),
              .weight_mask = mixes ? (1 << weave_kernel::kWeightBits) - 1 : 0,
              .blue_first = plan_->blue_first(),
              .light = light_of_codes15().data(),
              .codes = codes_of_light15().data(),
              .light_curve = light_curve().start_low.data(),
              .curve = encoding_curve().low_start.data(),
              .spot = plan_->spot()};
    lanes_ = static_cast<size_t>(shape.count + static_cast<int>(weave_kernel::kLaneStep) - 1) /
             weave_kernel::kLaneStep * weave_kernel::kLaneStep;
    first_pixels_.resize(lanes_);
    // Runs are written eight at a time.
    stride_ = static_cast<size_t>(plan_->geometry().width) * 3 + 64;
    if (kernel_ == WeaveKernel::Permute)
      codes_.resize(stride_ * weave_kernel::kRows);
    else
      light_.resize(stride_ * weave_kernel::kRows);
    if (kernel_ != WeaveKernel::Plain) prepare_turning();
  }

  /// Fills the rows of blocks [begin, end). The views must have the plan's shape, the frame its
  /// geometry. Does not allocate.
  void weave(const ViewSet& views, int begin, int end, WovenFrame& frame) noexcept {
    LENTICULE_CHECK(shape_of(views) == plan_->shape() && frame.geometry() == plan_->geometry());
    LENTICULE_CHECK(0 <= begin && begin <= end && end <= plan_->block_count());
    look_at(views);
    for (int index = begin; index < end; ++index) weave_block(index, frame);
#if defined(__x86_64__)
    if (kernel_ == WeaveKernel::Permute) weave_kernel::end_streaming();
#endif
  }

 private:
  static constexpr size_t kAlignment = 64;

  static const weave_kernel::RunKernel& run_kernel(WeaveKernel kernel) {
    const Isa isa = kernel == WeaveKernel::Avx2   ? Isa::Avx2
                    : kernel == WeaveKernel::Neon ? Isa::Neon
                                                  : Isa::Baseline;
    return LENTICULE_SELECT_KERNEL(isa, kRunKernel);
  }

  static void swap_red_and_blue(uint8_t* codes, int pixels) {
    for (int i = 0; i < pixels; ++i) std::swap(codes[3 * i], codes[3 * i + 2]);
  }
  using Transposed = std::unique_ptr<uint8_t[], void (*)(void*)>;

  /// Sets lane and view k to the k-th camera from the left, in either order of the set.
  void look_at(const ViewSet& views) noexcept {
    const int count = views.count();
    const bool reversed = plan_->options().order == ViewOrder::RightToLeft;
    for (int view = 0; view < count; ++view)
      first_pixels_[static_cast<size_t>(view)] =
          views.pixel(reversed ? count - 1 - view : view, 0, 0);
    std::fill(first_pixels_.begin() + count, first_pixels_.end(),
              first_pixels_[static_cast<size_t>(count - 1)]);
    pictures_ = {.first = first_pixels_.data(),
                 .stride = views.stride_bytes(),
                 .views = count,
                 .width = views.width(),
                 .height = views.height()};
    std::fill(slots_.begin(), slots_.end(), -1);
  }
  void weave_block(int index, WovenFrame& frame) noexcept {
    const WeavePlan::Block block = plan_->block(index);
    mix(block);
    blacken(block);
    for (int r = 0; r < weave_kernel::kRows && index * weave_kernel::kRows + r < frame.height();
         ++r)
      write_row(r, frame.row(index * weave_kernel::kRows + r));
  }
  void mix(const WeavePlan::Block& block) noexcept {
    const weave_kernel::Target target{
        .light = light_.data(), .codes = codes_.data(), .stride = stride_};
    for (const weave_kernel::Set& set : block.sets) mix_set(set, block.quads, target);
  }
  void mix_set(const weave_kernel::Set& set, const weave_kernel::Quad* quads,
               const weave_kernel::Target& target) noexcept {
    if (kernel_ == WeaveKernel::Plain)
      return weave_kernel::mix_set_plainly(terms_, pictures_, set, quads, target);
    const weave_kernel::TransposedRows rows = transposed_rows(set);
#if defined(__x86_64__)
    if (kernel_ == WeaveKernel::Permute)
      return weave_kernel::mix_set_by_permuting(terms_, rows, set, quads, target);
#endif
    run_kernel_->mix_set(terms_, rows, set, quads, target);
  }
  void blacken(const WeavePlan::Block& block) noexcept {
    const auto fill = [&](auto* values) {
      for (const WeavePlan::Bar& bar : block.bars)
        for (uint32_t n = 0; n < bar.count; ++n)
          values[static_cast<size_t>(bar.row) * stride_ + bar.first + size_t{n} * bar.stride] = 0;
    };
    kernel_ == WeaveKernel::Permute ? fill(codes_.data()) : fill(light_.data());
  }
  /// Writes row r of the block as code values.
  void write_row(int r, uint8_t* row) const noexcept {
    const size_t count = plan_->geometry().row_bytes(), at = static_cast<size_t>(r) * stride_;
#if defined(__x86_64__)
    if (kernel_ == WeaveKernel::Permute && !plan_->blue_first())
      return weave_kernel::stream_row(codes_.data() + at, count, row);
#endif
    if (kernel_ == WeaveKernel::Permute)
      std::memcpy(row, codes_.data() + at, count);
    else
      weave_kernel::encode_plainly(terms_, light_.data() + at, count, row);
    if (plan_->blue_first()) swap_red_and_blue(row, plan_->geometry().width);
  }
  void prepare_turning() {
    const auto columns = static_cast<size_t>(plan_->shape().width);
    slots_.resize(static_cast<size_t>(plan_->rows_of_block()));
    // Up to seven neighbours after the last view are read, but have no weight.
    const size_t bytes = kernel_ == WeaveKernel::Permute ? (columns + 1) * lanes_ * 4
                                                         : (columns * 3 * lanes_ + 8) * 4;
    transposed_bytes_ = (bytes + kAlignment - 1) / kAlignment * kAlignment;
    transposed_.reset(
        static_cast<uint8_t*>(std::aligned_alloc(kAlignment, transposed_bytes_ * slots_.size())));
    if (!transposed_) throw Error(ErrorKind::Failed, "weaving: out of memory");
    std::memset(transposed_.get(), 0, transposed_bytes_ * slots_.size());
  }
  void transpose(int row, uint8_t* transposed) const noexcept {
    auto* const light = reinterpret_cast<uint16_t*>(transposed);
#if defined(__x86_64__)
    if (kernel_ == WeaveKernel::Permute)
      return weave_kernel::transpose_row(terms_, pictures_, row, lanes_, transposed);
#endif
    run_kernel_->turn_light(terms_, pictures_, row, lanes_, light);
  }
  [[nodiscard]] const uint8_t* transposed_row(int row) noexcept {
    const size_t slot = static_cast<size_t>(row) % slots_.size();
    uint8_t* const transposed = transposed_.get() + slot * transposed_bytes_;
    if (std::exchange(slots_[slot], row) != row) transpose(row, transposed);
    return transposed;
  }
  [[nodiscard]] weave_kernel::TransposedRows transposed_rows(
      const weave_kernel::Set& set) noexcept {
    weave_kernel::TransposedRows rows{.upper = {}, .lower = {}, .lanes = lanes_};
    for (int r = 0; r < weave_kernel::kRows; ++r) {
      rows.upper[r] = transposed_row(set.row[r]);
      rows.lower[r] = transposed_row(std::min(set.row[r] + 1, pictures_.height - 1));
    }
    return rows;
  }

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
};

/// FastWeaver weaves frame after frame by one plan with several threads.
class FastWeaver {
 public:
  /// Starts the threads; `threads` = 1 weaves in the caller's thread only. Throws the errors of
  /// BlockWeaver.
  explicit FastWeaver(std::shared_ptr<const WeavePlan> plan, int threads = 1)
      : FastWeaver(plan, threads, best_kernel(*plan)) {}
  FastWeaver(std::shared_ptr<const WeavePlan> plan, int threads, WeaveKernel kernel)
      : plan_(std::move(plan)), kernel_(kernel), threads_(std::min(threads, plan_->block_count())) {
    LENTICULE_CHECK(threads > 0);
    for (int worker = 0; worker < threads_.count(); ++worker) weavers_.emplace_back(plan_, kernel_);
  }

  /// Returns when the frame is complete. Does not allocate.
  ///
  /// Thread safety: one caller at a time.
  void weave(const ViewSet& views, WovenFrame& frame) noexcept {
    // Neighbouring blocks use the same picture rows, so each worker gets one contiguous part of the
    // panel.
    const int blocks = plan_->block_count(), parts = threads_.count();
    const auto weave_part = [this, blocks, parts, &views, &frame](int part, int worker) {
      weavers_[static_cast<size_t>(worker)].weave(views, blocks * part / parts,
                                                  blocks * (part + 1) / parts, frame);
    };
    threads_.run(parts, std::cref(weave_part));  // a reference, which fits without memory
  }

  [[nodiscard]] const WeavePlan& plan() const { return *plan_; }
  [[nodiscard]] WeaveKernel kernel() const { return kernel_; }

 private:
  std::shared_ptr<const WeavePlan> plan_;
  WeaveKernel kernel_;
  std::vector<BlockWeaver> weavers_;
  WorkerThreads threads_;
};

/// Weaves the whole frame at once. Throws Error(Usage) for more than kMostPlannedViews views.
[[nodiscard]] inline WovenFrame weave_fast(const ViewSet& views, const optics::OpticalModel& model,
                                           const WeaveOptions& options = {}, int threads = 1) {
  const auto plan = std::make_shared<const WeavePlan>(model, shape_of(views), options, threads);
  WovenFrame frame(plan->geometry());
  FastWeaver(plan, threads).weave(views, frame);
  return frame;
}

}  // namespace lenticule::frames
