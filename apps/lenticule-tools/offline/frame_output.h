// SPDX-License-Identifier: Apache-2.0
// FrameOutput is the destination of rendered frames: picture files, a sequence container, or the
// ring of a player. Existing files of another rig or scene are replaced only with --overwrite.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "frames/frame.h"
#include "frames/sequence/sequence_format.h"

namespace lenticule::tools {

class FrameOutput {
 public:
  virtual ~FrameOutput() = default;
  /// Returns true if this frame exists already and need not be rendered again.
  [[nodiscard]] virtual bool has(uint64_t /*frame*/) const { return false; }
  /// Delivers a frame; returns false if a signal arrived while it waited for a free slot. Throws
  /// Error(Failed) for errors such as a full disk, Error(Device) if the player is gone permanently.
  [[nodiscard]] virtual bool deliver(uint64_t frame, const frames::FrameView& pixels) = 0;
  /// Completes the output after every frame of the range was delivered.
  virtual void finish() {}
};

struct OutputRequest {
  std::string target;  ///< pattern, file, FILE.lts or ring:SOCKET
  player::FrameRange range;
  frames::SequenceInfo film{};  ///< the frames, as a container states them
  double ring_timeout_seconds = 10.0;
  bool resume = false;     ///< continue an existing output; has() will be called
  bool overwrite = false;  ///< existing files may be replaced
  int max_error = 0;       ///< see frames::SequenceWriterOptions
};

/// Checks, before rendering, that the target can be written, and opens it. A container takes frames
/// in order, without those for which has() returns true; its unfinished file is TARGET.part. Throws
/// Error(Usage) for an invalid target, Error(Failed) for a folder that is not writable,
/// Error(Device) or Error(Input) for a player that does not answer or refuses, and for a container
/// to resume that was started with other input.
[[nodiscard]] std::unique_ptr<FrameOutput> open_output(const OutputRequest& request);

/// Says, after an interruption, how a sequence at `target` is continued.
void say_how_to_resume(const std::string& target);

// Checks existing files at -o: frames of another rig or scene are replaced only with --overwrite.

inline constexpr const char* kOverwriteHelp =
    "replace existing output, even if it is of another rig or scene";

/// Returns the value of frames::SequenceInfo::made_from: the names of the file and of its folder,
/// which are the same on every machine that has the project, and those of the camera's file if
/// there is one.
[[nodiscard]] std::string made_from(const std::string& input, const std::string& camera = {});

// The functions throw Error(Input) if an existing file is not a result of the same command. With
// --overwrite or --resume they accept any file; when resuming, the output itself checks the file.

/// Refuses FILE.lts or FILE.lts.part that is not a container, or has other frames, another rig or
/// another scene. Another trim of the same rig is accepted, because rendering again is how a new
/// trim takes effect.
void require_replaceable_film(const OutputRequest& request);
/// Refuses a file of the range that is not a picture or has another size; pictures contain no other
/// metadata.
void require_replaceable_pictures(const OutputRequest& request,
                                  const frames::FrameGeometry& geometry,
                                  const std::function<std::filesystem::path(uint64_t)>& file);
/// Refuses any existing video, because it does not state how it was made.
void require_replaceable_video(const OutputRequest& request);

/// Returns the name that films and plans have of this program.
[[nodiscard]] std::string program_version();

}  // namespace lenticule::tools
