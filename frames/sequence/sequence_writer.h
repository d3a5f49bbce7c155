// SPDX-License-Identifier: Apache-2.0
// Writes a sequence container, frame by frame. Until it is finished the file is called FILE.part
// and holds every frame that was appended: what dies loses the frame in flight and can be resumed.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/unique_fd.h"
#include "frames/frame.h"
#include "frames/sequence/band_codec.h"
#include "frames/sequence/band_workers.h"
#include "frames/sequence/sequence_layout.h"

namespace lenticule::frames {

struct SequenceWriterOptions {
  /// Go on after the last whole frame of FILE.part, or of a FILE that is finished. The result has
  /// the same bytes as one that was written in one run.
  bool resume = false;
  int threads = 0;  ///< that compress; 0 means all cores
};

/// Used by one thread. Only one writer can have a file open; two are told apart by a lock on it.
class SequenceWriter {
 public:
  /// Throws Error(Usage) for frames that a container cannot hold, Error(Failed) for a place that
  /// cannot be written or a file that another process is writing, Error(Input) when what is to be
  /// resumed is no sequence or was begun for another rig, size, rate or first frame.
  SequenceWriter(std::filesystem::path file, const SequenceInfo& info,
                 const SequenceWriterOptions& options = {});

  /// Frames that the file has, those of an earlier run included.
  [[nodiscard]] uint64_t frame_count() const { return layout_.frames.size(); }
  [[nodiscard]] uint64_t bytes_written() const { return layout_.data_end; }

  /// Adds a frame at the end. Throws Error(Failed) for a full disk and the like: the file then ends
  /// with the frame before, and appending may be tried again.
  void append(const FrameView& frame);

  /// Writes the index and gives the file its name. Throws Error(Failed).
  void finish();

 private:
  struct Band {
    std::vector<uint8_t> payload;
    BandEntry entry;
    bool repeated = false;  ///< same pixels as in the frame before: its payload is pointed at
  };

  void begin(const SequenceInfo& info);
  void go_on(const std::filesystem::path& there, const SequenceInfo& info);
  void open_and_lock(const std::filesystem::path& there);
  void encode_band(const FrameView& frame, int band, int worker);
  void recall();
  void lay_out_record();
  void sync_now_and_then();
  [[noreturn]] void fail(const char* what, int error) const;

  std::filesystem::path file_;
  std::filesystem::path part_;
  UniqueFd fd_;
  SequenceLayout layout_;
  BandWorkers workers_;
  std::vector<BandEncoder> encoders_;
  TapTable taps_;
  std::vector<Band> bands_;
  std::vector<uint8_t> previous_;  ///< pixels of the last frame appended, empty at first
  std::vector<uint8_t> record_;
  bool in_step_ = false;  ///< taps_, bands_ and previous_ are those of the last frame in the file
  std::chrono::steady_clock::time_point last_sync_;
  bool finished_ = false;
};

}  // namespace lenticule::frames
