// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/sequence_output.h"

#include <fmt/format.h>

#include "base/error.h"
#include "frames/sequence/sequence_writer.h"

namespace lenticule::tools {
namespace {

class SequenceOutput final : public FrameOutput {
 public:
  explicit SequenceOutput(const OutputRequest& request)
      : first_(request.range.begin),
        writer_(request.target, sequence_info_of(request), {.resume = request.resume}) {}

  bool has(uint64_t frame) const override { return frame - first_ < writer_.frame_count(); }

  Delivery deliver(uint64_t frame, const frames::FrameView& pixels) override {
    LENTICULE_CHECK(frame - first_ == writer_.frame_count());
    writer_.append(pixels);
    return Delivery::Done;
  }

  void finish() override { writer_.finish(); }

 private:
  uint64_t first_;
  frames::SequenceWriter writer_;
};

}  // namespace

frames::SequenceInfo sequence_info_of(const OutputRequest& request) {
  frames::SequenceInfo info = request.sequence.value_or(frames::SequenceInfo{});
  info.software = fmt::format("lenticule {}", LENTICULE_VERSION);
  if (request.sequence) return info;
  info.geometry = request.geometry;
  info.rate = request.rate;
  info.first_frame = request.range.begin;
  frames::state_rig(info, request.rig);
  info.made_from = request.made_from;
  info.rig_toml = request.rig_toml;
  return info;
}

std::unique_ptr<FrameOutput> open_sequence_output(const OutputRequest& request) {
  return std::make_unique<SequenceOutput>(request);
}

}  // namespace lenticule::tools
