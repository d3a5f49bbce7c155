// SPDX-License-Identifier: Apache-2.0
// lenticule convert: woven frames from picture files into a sequence container, out of one, or from
// one into another. No pixel changes on the way.
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frames/image_io.h"
#include "frames/image_sequence.h"
#include "frames/sequence/sequence_reader.h"
#include "optics/rig_file.h"
#include "optics/trim.h"
#include "player/command.h"
#include "player/frame_output.h"
#include "player/interrupt.h"
#include "player/progress.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

struct ConvertFlags {
  std::string input;
  std::string output;
  std::string rig;
  std::string rate;
  std::string frames;
  bool resume = false;
  bool replace_damaged = false;
  bool json = false;
};

/// Where frames come from. `number` counts from 0.
class FrameInput {
 public:
  virtual ~FrameInput() = default;
  [[nodiscard]] virtual uint64_t count() const = 0;
  [[nodiscard]] virtual frames::FrameGeometry geometry() const = 0;
  /// What is known besides the pixels.
  [[nodiscard]] virtual frames::SequenceInfo info() const = 0;
  /// False if the frame is damaged. Throws Error(Input) for a picture that cannot be read.
  [[nodiscard]] virtual bool read(uint64_t number, frames::WovenFrame& frame) = 0;
};

class PictureInput final : public FrameInput {
 public:
  explicit PictureInput(const std::string& source)
      : files_(frames::list_frame_files(source)), geometry_(frames::probe_image(files_.front())) {}

  uint64_t count() const override { return files_.size(); }
  frames::FrameGeometry geometry() const override { return geometry_; }
  frames::SequenceInfo info() const override {
    frames::SequenceInfo info;
    info.geometry = geometry_;
    return info;
  }
  bool read(uint64_t number, frames::WovenFrame& frame) override {
    frames::read_woven_into(files_[number], frame);
    return true;
  }

 private:
  std::vector<fs::path> files_;
  frames::FrameGeometry geometry_;
};

class ContainerInput final : public FrameInput {
 public:
  explicit ContainerInput(const std::string& file)
      : reader_(file), decoder_(reader_.make_decoder()) {
    if (reader_.frame_count() == 0)
      throw Error(ErrorKind::Input, fmt::format("{}: has no frames", file));
  }

  uint64_t count() const override { return reader_.frame_count(); }
  frames::FrameGeometry geometry() const override { return reader_.geometry(); }
  frames::SequenceInfo info() const override { return reader_.info(); }
  bool read(uint64_t number, frames::WovenFrame& frame) override {
    return decoder_.decode(number, frame.bytes());
  }

 private:
  frames::SequenceReader reader_;
  frames::FrameDecoder decoder_;
};

std::unique_ptr<FrameInput> open_input(const std::string& text) {
  if (frames::is_sequence_name(text)) return std::make_unique<ContainerInput>(text);
  return std::make_unique<PictureInput>(text);
}

class ConvertRun {
 public:
  explicit ConvertRun(const ConvertFlags& flags)
      : flags_(flags), input_(open_input(flags.input)), info_(input_->info()) {
    range_ = {.begin = 0, .end = input_->count()};
    if (!flags.frames.empty()) choose_frames(parse_frame_range(flags.frames));
    if (!flags.rate.empty()) info_.rate = frames::parse_rate(flags.rate);
    if (!flags.rig.empty()) state_rig(optics::load_trimmed_rig(flags.rig));
    output_ = open_output(
        {.target = flags.output,
         .range = {.begin = info_.first_frame, .end = info_.first_frame + range_.count()},
         .geometry = input_->geometry(),
         .rig_fingerprint = info_.rig_fingerprint,
         .rate = info_.rate,
         .resume = flags.resume,
         .sequence = info_});
  }

  ExitCode run() {
    const auto start = std::chrono::steady_clock::now();
    frames::WovenFrame frame(input_->geometry());
    Progress progress("converting", "frames", range_.count());
    for (uint64_t n = 0; n < range_.count() && !interrupted(); ++n) {
      const uint64_t named = info_.first_frame + n;
      if (flags_.resume && output_->has(named)) {
        ++skipped_;
      } else {
        read(range_.begin + n, frame);
        if (output_->deliver(named, frame.view()) == Delivery::Interrupted) break;
        ++converted_;
      }
      progress.update(n + 1);
    }
    if (!interrupted()) output_->finish();
    progress.finish();
    seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    report();
    return interrupt_exit_code();
  }

 private:
  /// Loop points belong to the whole sequence.
  void choose_frames(FrameRange wanted) {
    if (wanted.begin >= wanted.end || wanted.end > range_.end)
      throw Error(ErrorKind::Input, fmt::format("{}: has frames 0:{}", flags_.input, range_.end),
                  "name a range of frames that exist");
    range_ = wanted;
    info_.first_frame += wanted.begin;
    info_.loop_begin = 0;
    info_.loop_end.reset();
  }

  void state_rig(const optics::Rig& rig) {
    const frames::FrameGeometry panel{.width = rig.panel.width_px, .height = rig.panel.height_px};
    const std::string fingerprint = optics::fingerprint(rig);
    if (input_->geometry() != panel)
      throw Error(ErrorKind::Input,
                  fmt::format("{}: {}x{} pixels, but the rig's panel has {}x{}", flags_.input,
                              input_->geometry().width, input_->geometry().height, panel.width,
                              panel.height),
                  "woven frames fit one panel, pixel for pixel: name the rig they were made for");
    if (!info_.rig_fingerprint.empty() && info_.rig_fingerprint != fingerprint)
      throw Error(ErrorKind::Input,
                  fmt::format("{}: was made for another rig than {}", flags_.input, flags_.rig),
                  "converting does not weave anew: leave out --rig");
    info_.rig_fingerprint = fingerprint;
    info_.rig_toml = optics::rig_to_toml(rig);
  }

  void read(uint64_t number, frames::WovenFrame& frame) {
    if (input_->read(number, frame)) {
      last_good_ = number;
      return;
    }
    if (!flags_.replace_damaged || !last_good_ || !input_->read(*last_good_, frame))
      throw Error(ErrorKind::Input, fmt::format("{}: frame {} is damaged", flags_.input, number),
                  "--replace-damaged repeats the frame before");
    ++replaced_;
  }

  void report() const {
    if (replaced_ > 0)
      fmt::print(stderr, "{}: {} damaged frames were replaced\n", flags_.input, replaced_);
    if (!flags_.json) return;
    print_json({{"input", flags_.input},
                {"output", flags_.output},
                {"width", input_->geometry().width},
                {"height", input_->geometry().height},
                {"frames_converted", converted_},
                {"frames_skipped", skipped_},
                {"frames_replaced", replaced_},
                {"rate", frames::to_string(info_.rate)},
                {"interrupted", interrupted()},
                {"seconds", seconds_}});
  }

  const ConvertFlags& flags_;
  std::unique_ptr<FrameInput> input_;
  frames::SequenceInfo info_;
  FrameRange range_;
  std::unique_ptr<FrameOutput> output_;
  std::optional<uint64_t> last_good_;
  uint64_t converted_ = 0;
  uint64_t skipped_ = 0;
  uint64_t replaced_ = 0;
  double seconds_ = 0.0;
};

}  // namespace

Run declare_convert(CLI::App& app) {
  auto flags = std::make_shared<ConvertFlags>();
  app.add_option("IN", flags->input, "pattern ('out/%05d.png'), picture or FILE.lts")->required();
  app.add_option("-o,--output", flags->output, "FILE.lts, pattern or picture")->required();
  app.add_option("--rig", flags->rig,
                 "rig file that the frames were made for, to be kept with them");
  app.add_option("--rate", flags->rate, "frames per second, for example 24 or 24000/1001 (60)");
  app.add_option("--frames", flags->frames, "A:B converts frames A to B - 1, counted from 0");
  app.add_flag("--resume", flags->resume, "go on where an earlier run was stopped");
  app.add_flag("--replace-damaged", flags->replace_damaged,
               "repeat the frame before a damaged one instead of ending");
  app.add_flag("--json", flags->json, "print what was done as JSON");
  return [flags]() -> ExitCode { return ConvertRun(*flags).run(); };
}

}  // namespace lenticule::player
