// SPDX-License-Identifier: Apache-2.0
// SequenceWriter writes a sequence container frame by frame. Until finish() the file is named
// FILE.part and contains every appended frame: if the process dies, only the frame in progress is
// lost, and writing can be resumed.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/unique_fd.h"
#include "frames/frame.h"
#include "frames/sequence/band_codec.h"
#include "frames/sequence/sequence_format.h"

namespace lenticule::frames {

/// SequencePart is the place of a file in a longer film. With it, the file's frames have the bytes
/// that they have in the film, apart from offsets; SequenceJoiner joins such files.
struct SequencePart {
  uint64_t first = 0;  ///< index in the film of the file's first frame
  /// The choice of the film's frame `first - first % kPredictorInterval`; not used if that is the
  /// file's first frame.
  PredictorTable predictors{};
};

struct SequenceWriterOptions {
  /// Continue after the last whole frame of FILE.part, or of a finished FILE. The result has the
  /// same bytes as a file written in one run.
  bool resume = false;
  int threads = 0;  ///< compression threads; 0 means one per core
  SequencePart part_of_film{};
};

/// SequenceWriter locks its file, so only one writer can have the file open.
///
/// Thread safety: one thread.
class SequenceWriter {
 public:
  /// Throws Error(Usage) for frames that a container cannot hold; Error(Failed) if the file cannot
  /// be written or another process is writing it; Error(Input) when the file to resume is not a
  /// sequence or was begun for another rig, size, rate or first frame.
  SequenceWriter(std::filesystem::path file, const SequenceInfo& info,
                 const SequenceWriterOptions& options = {});

  /// Returns the number of frames in the file, including frames of an earlier run.
  [[nodiscard]] uint64_t frame_count() const { return layout_.frames.size(); }
  [[nodiscard]] uint64_t bytes_written() const { return layout_.data_end; }

  /// Appends a frame. Throws Error(Failed), for example for a full disk: the file then ends with
  /// the previous frame, and appending may be retried.
  void append(const FrameView& frame);

  /// Writes the index and renames the file to its final name. Throws Error(Failed).
  void finish();

 private:
  struct Band {
    std::vector<uint8_t> payload;
    BandEntry entry;
    bool repeated = false;  ///< same pixels as in the previous frame, whose payload is referenced
  };

  void begin(const SequenceInfo& info);
  void continue_file(const std::filesystem::path& there, const SequenceInfo& info);
  void open_and_lock(const std::filesystem::path& there);
  void encode_band(const FrameView& frame, int band, int worker);
  void recall();
  void lay_out_record();
  void sync_now_and_then();
  [[noreturn]] void fail(const char* what, int error) const;

  std::filesystem::path file_;
  std::filesystem::path part_;
  SequencePart part_of_film_;
  UniqueFd fd_;
  SequenceLayout layout_;
  BandWorkers workers_;
  std::vector<BandEncoder> encoders_;
  PredictorTable predictors_;
  std::vector<Band> bands_;
  std::vector<uint8_t> previous_;  ///< pixels of the last appended frame, empty at first
  std::vector<uint8_t> record_;
  bool in_step_ =
      false;  ///< predictors_, bands_ and previous_ belong to the last frame in the file
  std::chrono::steady_clock::time_point last_sync_;
  bool finished_ = false;
};

}  // namespace lenticule::frames
