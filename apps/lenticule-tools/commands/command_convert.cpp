// SPDX-License-Identifier: Apache-2.0
// lenticule convert converts frames and views between file formats. ConvertInput opens what is
// read, as frames of one size; the outputs add videos, quilts and one picture per view to the
// targets of rendered frames; ConvertRun passes frames from one to the other. If they need neither
// weaving nor separating into views, no pixel changes.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "apps/lenticule-tools/offline/frame_output.h"
#include "apps/lenticule-tools/offline/video_writer.h"
#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/content_flags.h"
#include "apps/lenticule/cli/option.h"
#include "base/error_kinds.h"
#include "base/file.h"
#include "base/print.h"
#include "frames/frame.h"
#include "frames/image_io.h"
#include "frames/picture_codec.h"
#include "frames/quilt.h"
#include "frames/sequence/sequence_format.h"
#include "frames/sequence/sequence_reader.h"
#include "frames/views_input/content_name.h"
#include "frames/views_input/view_input.h"
#include "frames/weaving/reweave.h"
#include "optics/rig_file.h"
#include "optics/trim.h"
#include "player/playback/play_statistics.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "player/process/rig_choice.h"
#include "player/sources/pictures.h"
#include "player/sources/source_spec.h"
#include "player/sources/weaving_source.h"

namespace lenticule::tools {
namespace {

enum class ReadResult { Ok, Damaged, End };

/// ConvertInput reads the frames. Thread safety: one thread.
class ConvertInput {
 public:
  virtual ~ConvertInput() = default;
  /// Returns the number of frames if known.
  [[nodiscard]] virtual std::optional<uint64_t> count() const = 0;
  /// Returns the metadata; the geometry is that of the frames.
  [[nodiscard]] virtual frames::SequenceInfo info() const = 0;
  /// Reads frame `number`, counted from 0; numbers must increase, except that the last one may be
  /// repeated. Throws Error(Input) for input that cannot be read, Error(Failed) if no more frames
  /// arrive.
  [[nodiscard]] virtual ReadResult read(uint64_t number, frames::WovenFrame& frame) = 0;
  /// Returns the damage, so far, that the sources left out or replaced.
  [[nodiscard]] virtual frames::FrameDamage damage() const { return {}; }
};

frames::FrameGeometry panel_of(const optics::Rig& rig) {
  return {.width = rig.panel.width_px, .height = rig.panel.height_px};
}

/// ContainerInput reads the woven frames of a container, in any order.
class ContainerInput final : public ConvertInput {
 public:
  explicit ContainerInput(const std::string& file)
      : reader_(file), decoder_(reader_.make_decoder()) {
    if (reader_.frame_count() == 0)
      throw input_error("{}: has no frames", file).remedy(frames::kNoFramesRemedy);
  }

  std::optional<uint64_t> count() const override { return reader_.frame_count(); }
  frames::SequenceInfo info() const override { return reader_.info(); }
  ReadResult read(uint64_t number, frames::WovenFrame& frame) override {
    if (number >= reader_.frame_count()) return ReadResult::End;
    return decoder_.decode(number, frame.bytes()) ? ReadResult::Ok : ReadResult::Damaged;
  }
  frames::FrameDamage damage() const override { return {.missing = reader_.missing_frames()}; }

 private:
  frames::SequenceReader reader_;
  frames::FrameDecoder decoder_;
};

/// ViewFrames converts views to frames.
class ViewFrames final : public ConvertInput {
 public:
  using Draw = std::function<void(const frames::ViewSet& views, frames::WovenFrame& frame)>;
  ViewFrames(std::unique_ptr<frames::ViewInput> views, const frames::FrameGeometry& geometry,
             Draw draw, std::string name)
      : views_(std::move(views)),
        geometry_(geometry),
        draw_(std::move(draw)),
        name_(std::move(name)) {}

  std::optional<uint64_t> count() const override { return views_->frame_count(); }
  frames::SequenceInfo info() const override {
    frames::SequenceInfo info;
    info.geometry = geometry_;
    if (const auto rate = views_->rate()) info.rate = *rate;
    return info;
  }
  ReadResult read(uint64_t number, frames::WovenFrame& frame) override {
    if (!advance_to(number)) return ReadResult::End;
    draw_(views_->views(), frame);
    views_->release();
    return ReadResult::Ok;
  }

  frames::FrameDamage damage() const override { return views_->damage(); }

 private:
  /// Skips frames up to the requested one; returns false at the end.
  bool advance_to(uint64_t number) {
    for (; player::await_next(*views_, name_); views_->release())
      if (views_->number() >= number) return true;
    return false;
  }

  std::unique_ptr<frames::ViewInput> views_;
  frames::FrameGeometry geometry_;
  Draw draw_;
  std::string name_;
};

namespace fs = std::filesystem;

class VideoOutput final : public FrameOutput {
 public:
  explicit VideoOutput(const OutputRequest& request)
      : writer_({.file = request.target,
                 .geometry = request.film.geometry,
                 .rate = request.film.rate}) {}

  bool deliver(uint64_t, const frames::FrameView& pixels) override {
    writer_.write(pixels);
    return true;
  }
  void finish() override { writer_.finish(); }

 private:
  VideoWriter writer_;
};

std::unique_ptr<FrameOutput> open_video_output(const OutputRequest& request) {
  if (request.resume)
    throw Error(ErrorKind::Usage, "--resume: not supported for video files",
                "convert to FILE.lts with --resume, then FILE.lts to a video");
  if (fs::path(request.target).extension() != ".mkv")
    throw usage_error("-o {}: videos are written as Matroska", request.target)
        .remedy("use a name such as FILE.mkv");
  require_replaceable_video(request);
  return std::make_unique<VideoOutput>(request);
}

/// ViewFilesOutput writes one picture per view, for one frame or in one folder per view.
class ViewFilesOutput final : public FrameOutput {
 public:
  ViewFilesOutput(const OutputRequest& request, const frames::QuiltLayout& layout)
      : layout_(layout) {
    const fs::path text(player::parse_source(request.target).without_prefix());
    const std::string folder = text.parent_path().string();
    const std::string name = text.filename().string();
    if (frames::FilePattern::looks_like_pattern(folder)) {
      views_.emplace(folder);
      frames_.emplace(name);
      make_folders();
    } else {
      views_.emplace(text.string());
      if (request.range.count() > 1)
        throw usage_error("-o {}: one name for {} frames", request.target, request.range.count())
            .remedy("use a folder per view, for example -o 'views:view%02d/%05d.png'");
    }
    frames::check_writable_format(file(0, request.range.begin));
    require_replaceable_pictures(request,
                                 {.width = request.film.geometry.width / layout.columns,
                                  .height = request.film.geometry.height / layout.rows},
                                 [this](uint64_t frame) { return file(0, frame); });
  }

  /// Returns true if the last view's picture exists, because that is written last.
  bool has(uint64_t frame) const override {
    try {
      (void)frames::probe_image(file(last_view(), frame));
      return true;
    } catch (const Error&) {
      return false;
    }
  }
  bool deliver(uint64_t frame, const frames::FrameView& pixels) override {
    const frames::ViewSet views = frames::ViewSet::borrow(pixels, layout_);
    frames::WovenFrame picture({.width = views.width(), .height = views.height()});
    for (int view = 0; view < views.count(); ++view) {
      for (int row = 0; row < views.height(); ++row)
        std::copy_n(views.pixel(view, 0, row), picture.geometry().row_bytes(), picture.row(row));
      frames::write_woven(picture.view(), file(static_cast<uint64_t>(view), frame));
    }
    return true;
  }

 private:
  [[nodiscard]] uint64_t last_view() const {
    return static_cast<uint64_t>(layout_.view_count()) - 1;
  }
  [[nodiscard]] fs::path file(uint64_t view, uint64_t frame) const {
    if (!frames_) return views_->path(view);
    return views_->path(view) / frames_->path(frame);
  }
  void make_folders() const {
    for (uint64_t view = 0; view <= last_view(); ++view) {
      std::error_code error;
      fs::create_directory(views_->path(view), error);
      if (error) throw failed_error("{}: {}", views_->path(view).string(), error.message());
    }
  }

  frames::QuiltLayout layout_;
  std::optional<frames::FilePattern> views_;  ///< pattern of folders or of pictures
  std::optional<frames::FilePattern> frames_;
};

/// Writes a sidecar with the number of used tiles, which the name does not contain.
void write_sidecar(const std::string& target, uint64_t first, const frames::QuiltLayout& layout) {
  const fs::path picture = frames::FilePattern::looks_like_pattern(target)
                               ? frames::FilePattern(target).path(first)
                               : fs::path(target);
  nlohmann::json sidecar = {
      {"columns", layout.columns}, {"rows", layout.rows}, {"viewCount", layout.view_count()}};
  if (layout.aspect) sidecar["aspect"] = *layout.aspect;
  write_text_file(frames::sidecar_of(picture), sidecar.dump(2) + "\n");
}

/// Returns true for "views:v%02d.png" and "views:view%02d/%05d.png".
bool is_view_files(const std::string& target) {
  return player::parse_source(target).kind == player::SourceKind::ViewFiles;
}

/// Returns the name of the target with a quilt's layout added. Throws Error(Usage) if the name
/// states another layout.
std::string target_name(const std::string& name, const frames::QuiltLayout& quilt) {
  const bool named = !is_view_files(name) && !name.ends_with(".lts");
  return named ? frames::quilt_name(name, quilt).string() : name;
}

/// Opens the output for woven frames or for quilts (null: woven). Throws the errors of
/// open_output(), and Error(Usage) for options that a video or pictures per view do not support. An
/// unfinished video is removed.
std::unique_ptr<FrameOutput> open_convert_output(const OutputRequest& request,
                                                 const frames::QuiltLayout* quilt) {
  if (quilt != nullptr && is_view_files(request.target))
    return std::make_unique<ViewFilesOutput>(request, *quilt);
  std::unique_ptr<FrameOutput> output =
      player::kind_of_file(request.target) == player::SourceKind::Video ? open_video_output(request)
                                                                        : open_output(request);
  const bool tiles_left = quilt != nullptr && quilt->view_count() < quilt->columns * quilt->rows;
  if (tiles_left && !request.target.ends_with(".lts"))
    write_sidecar(request.target, request.range.begin, *quilt);
  return output;
}

using Kind = player::Content::Kind;

/// Returns true for the name of a single picture.
bool is_picture(const std::string& output) {
  return player::kind_of_file(output) == player::SourceKind::Pictures && !is_view_files(output) &&
         !frames::FilePattern::looks_like_pattern(output);
}

/// Length of an input that does not state it.
constexpr uint64_t kManyFrames = uint64_t{1} << 24;

struct ConvertFlags {
  std::string input;
  std::string output;
  std::string as;
  std::string rig;
  std::string rate;
  std::string frames;
  player::ContentFlags content;
  player::WeavingFlags weaving;
  int max_error = 0;
  bool resume = false;
  bool overwrite = false;
  bool keep_damaged = false;
  bool json = false;
};

class ConvertRun {
 public:
  explicit ConvertRun(const ConvertFlags& flags) : flags_(flags) {
    decide();
    if (!flags.frames.empty()) wanted_ = player::parse_frame_range(flags.frames);
    input_ = open_input();
    info_ = input_->info();
    if (player::kind_of_file(flags_.input) == player::SourceKind::Sequence && quilts_) {
      const frames::SequenceInfo there = frames::SequenceReader(flags_.input).info();
      // Views that are copied keep their subpixels; those that are taken out of woven frames do
      // not.
      if (there.kind == frames::SequenceKind::Views) info_.max_error = there.max_error;
    }
    range_ = {.begin = 0, .end = input_->count().value_or(kManyFrames)};
    if (wanted_) choose_frames(*wanted_);
    makes_one_picture_ = !input_->count() && !wanted_ && is_picture(flags_.output);
    if (makes_one_picture_) range_.end = 1;
    if (!flags.rate.empty()) info_.rate = frames::parse_rate(flags.rate);
    if (quilts_)
      state_views();
    else if (rig_)
      state_rig(*rig_);
    open_output();
  }

  ExitCode run() {
    const auto start = std::chrono::steady_clock::now();
    frames::WovenFrame frame(info_.geometry);
    player::Progress progress("converting", "frames", input_->count() ? range_.count() : 0);
    for (uint64_t n = 0; n < range_.count() && !player::interrupted(); ++n) {
      if (!convert_frame(n, frame)) break;
      progress.update(n + 1, {}, skipped_);
    }
    if (!player::interrupted()) finish();
    progress.finish();
    seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    report();
    say_how_to_resume(flags_.output);
    return player::interrupt_exit_code();
  }

 private:
  /// Decides, before the input is opened, what is written.
  void decide() {
    if (!flags_.rig.empty()) rig_ = optics::load_rig_and_identity(flags_.rig);
    const bool views_wanted = flags_.as == "quilt" || is_view_files(flags_.output);
    content_ = identify_input(views_wanted);
    const bool has_views = content_.kind != Kind::Woven;
    if (flags_.as == "woven" && has_views && !rig_)
      rig_ = optics::load_rig_and_identity(player::choose_rig({}).file);
    quilts_ = views_wanted || (has_views && flags_.as.empty() && !rig_);
    refuse_what_makes_no_sense(has_views);
  }
  [[nodiscard]] player::Content identify_input(bool views_wanted) const {
    player::SourceSpec source = parse_source(flags_.input, flags_.content);
    // Woven frames of any rig are separated if views are wanted.
    if (views_wanted) source.content.reweave = true;
    if (rig_ && !views_wanted)
      return identify_by_pixels(source, rig_->identity.fingerprint, panel_of(rig_->rig));
    return identify_by_pixels(source, "", std::nullopt, views_wanted || flags_.as == "woven");
  }

  void refuse_what_makes_no_sense(bool has_views) const {
    if (quilts_ && !has_views)
      throw usage_error("{}: woven frames, not views", flags_.input)
          .remedy("use --from-rig RIG, the rig that they were woven for, to split them into views");
    if (quilts_ && rig_)
      throw Error(ErrorKind::Usage, "--rig: has no effect on quilts and views",
                  "leave it out; use --from-rig for the rig that frames were woven for");
    if (flags_.max_error > 0 && !flags_.output.ends_with(".lts"))
      throw usage_error("--max-error: not for {}", flags_.output).remedy("use it with -o FILE.lts");
    if (flags_.output.ends_with(".toml") || flags_.output.ends_with(".json"))
      throw usage_error("-o {}: unknown kind of output", flags_.output)
          .remedy("use FILE.lts, FILE.mkv, a pattern, a picture, or 'views:view%02d/%05d.png'");
  }
  [[nodiscard]] player::PictureOptions picture_options() const {
    return {.frames = std::nullopt,
            .first_frame = wanted_ ? wanted_->begin : 0,
            .pool_frames = 2 * player::all_threads(),
            .decoder_threads = player::all_threads(),
            .drawing_threads = player::all_threads(),
            .rig = rig_ ? &rig_->rig : nullptr,
            .plays_again = false,
            .before_weaving = content_.kind != Kind::Woven};
  }

  [[nodiscard]] std::unique_ptr<ConvertInput> open_input() {
    const bool container = player::kind_of_file(flags_.input) == player::SourceKind::Sequence;
    const bool woven = content_.kind == Kind::Woven;
    if (woven && container) return std::make_unique<ContainerInput>(flags_.input);
    if (container) refuse_damaged();
    // Woven pictures, which are not changed, are read as quilts of one tile.
    player::Content content = content_;
    if (woven) content.kind = Kind::Quilt;
    std::unique_ptr<frames::ViewInput> views = open_views(content, picture_options());
    const frames::ViewShape shape = views->shape();
    if (!woven) shape_ = shape;
    if (!woven && !quilts_) {
      const optics::Rig& rig = rig_.value().rig;
      const auto pipeline = std::make_shared<player::WeavingPipeline>(rig, shape, flags_.weaving,
                                                                      player::all_threads());
      const auto weave = [pipeline](const auto& set, auto& frame) { pipeline->weave(set, frame); };
      return std::make_unique<ViewFrames>(std::move(views), panel_of(rig), weave, flags_.input);
    }
    if (!woven) layout_ = layout_of_quilt();
    return std::make_unique<ViewFrames>(
        std::move(views), frames::quilt_geometry(shape, layout_),
        [this](const auto& set, auto& frame) { frames::draw_quilt(set, layout_, frame); },
        flags_.input);
  }

  /// Returns the quilt's layout: that in the target's name, or that of the input quilt.
  [[nodiscard]] frames::QuiltLayout layout_of_quilt() const {
    frames::QuiltLayout layout = frames::quilt_layout_for(shape_);
    const auto take_grid = [&](const frames::QuiltLayout& grid) {
      if (grid.columns * grid.rows < shape_.count) return;
      layout.columns = grid.columns;
      layout.rows = grid.rows;
    };
    if (content_.kind == Kind::Quilt) take_grid(content_.layout);
    if (const auto named = frames::quilt_layout_of_name(flags_.output)) take_grid(*named);
    return layout;
  }

  /// Refuses damaged frames: woven from views, a frame of another time would not be noticed.
  void refuse_damaged() {
    const std::vector<uint64_t> damaged = find_damaged();
    if (damaged.empty()) return;
    if (!flags_.keep_damaged) fail_damaged_container(damaged);
    replaced_ = damaged.size();
  }

  [[nodiscard]] std::vector<uint64_t> find_damaged() const {
    return frames::SequenceReader(flags_.input).find_damaged([](uint64_t) {
      return !player::interrupted();
    });
  }

  [[noreturn]] void fail_damaged_container(const std::vector<uint64_t>& damaged) const {
    LENTICULE_CHECK(!damaged.empty());
    throw failed_error(
        "{}: {} damaged, the first of them frame {}", flags_.input,
        damaged.size() == 1 ? "1 frame is" : fmt::format("{} frames are", damaged.size()),
        damaged.front())
        .remedy("use --keep-damaged to repeat the frame before each of them");
  }

  /// Counts all damaged frames first, because the remedy depends on how many there are.
  [[noreturn]] void fail_damaged(uint64_t number) const {
    std::vector<uint64_t> damaged = find_damaged();
    std::erase_if(damaged, [&](uint64_t n) { return n < range_.begin || n >= range_.end; });
    if (damaged.empty()) damaged.push_back(number);
    fail_damaged_container(damaged);
  }

  /// Refuses frames that a decoder left out or repaired.
  void refuse_damage_of_sources() const {
    frames::FrameDamage damage = input_->damage();
    if (wanted_) damage.missing = 0;  // behind the range
    if (!damage.any() || flags_.keep_damaged) return;
    throw failed_error("{}: {} of {} frames are damaged, {} are missing", flags_.input,
                       damage.damaged, converted_ + damage.damaged + damage.missing, damage.missing)
        .remedy("use --keep-damaged to convert the readable frames");
  }

  /// Selects the frames. Loop points apply to the whole sequence only.
  void choose_frames(player::FrameRange wanted) {
    if (wanted.begin >= wanted.end || wanted.end > range_.end)
      throw input_error("{}: has frames 0:{}", flags_.input, range_.end)
          .remedy("use a range of existing frames");
    range_ = wanted;
    info_.first_frame += wanted.begin;
    info_.loop_begin = 0;
    info_.loop_end.reset();
  }

  void state_views() {
    info_.kind = frames::SequenceKind::Views;
    info_.views = frames::SequenceViews{.count = shape_.count,
                                        .columns = layout_.columns,
                                        .rows = layout_.rows,
                                        .aspect = shape_.aspect};
    if (flags_.output.ends_with(".lts") && shape_.count > frames::kMaxSequenceViews)
      throw usage_error("-o {}: {} views, but only {} fit", flags_.output, shape_.count,
                        frames::kMaxSequenceViews);
  }

  void state_rig(const optics::TrimmedRig& loaded) {
    const optics::Rig& rig = loaded.rig;
    const frames::FrameGeometry panel = panel_of(rig);
    const optics::RigMatch matched = optics::match(frames::rig_of(info_), loaded.identity);
    // Woven before the rig was trimmed: the file keeps the trim for which it was woven.
    if (matched == optics::RigMatch::Trimmed) return;
    if (matched == optics::RigMatch::Other)
      throw input_error("{}: was made for another rig, not for {}", flags_.input, flags_.rig)
          .remedy("use --reweave to weave them again for this rig, or leave out --rig");
    if (info_.geometry != panel)
      throw input_error("{}: {}x{} pixels, but the rig's panel has {}x{}", flags_.input,
                        info_.geometry.width, info_.geometry.height, panel.width, panel.height)
          .remedy(
              "woven frames fit one panel, pixel for pixel: use the rig that they were made for");
    frames::state_rig(info_, loaded.identity);
    info_.rig_toml = optics::rig_to_toml(rig);
  }

  void open_output() {
    if (info_.made_from.empty()) info_.made_from = made_from(flags_.input);
    info_.software = program_version();
    info_.max_error = std::min(info_.max_error + flags_.max_error, 255);
    written_ = quilts_ ? target_name(flags_.output, layout_) : flags_.output;
    output_ = open_convert_output(
        {.target = written_,
         .range = {.begin = info_.first_frame, .end = info_.first_frame + range_.count()},
         .film = info_,
         .resume = flags_.resume,
         .overwrite = flags_.overwrite,
         .max_error = flags_.max_error},
        quilts_ ? &layout_ : nullptr);
  }

  /// Converts one frame; returns false at the end of the input.
  bool convert_frame(uint64_t n, frames::WovenFrame& frame) {
    const uint64_t named = info_.first_frame + n;
    if (flags_.resume && output_->has(named)) {
      ++skipped_;
      return true;
    }
    if (!read(range_.begin + n, frame)) return false;
    if (makes_one_picture_) require_end();
    if (!output_->deliver(named, frame.view())) return false;
    ++converted_;
    return true;
  }

  /// Refuses a film of several frames for one picture. An APNG, say, may have just one.
  void require_end() {
    frames::WovenFrame other(info_.geometry);
    if (input_->read(1, other) != ReadResult::End)
      throw usage_error("-o {}: one name for several frames", flags_.output)
          .remedy("use a number in the name, for example -o 'out/%05d.png', or --frames 0:1");
  }

  bool read(uint64_t number, frames::WovenFrame& frame) {
    const ReadResult result = input_->read(number, frame);
    if (result == ReadResult::Ok) last_good_ = number;
    if (result != ReadResult::Damaged) return result == ReadResult::Ok;
    if (!flags_.keep_damaged || !last_good_ || input_->read(*last_good_, frame) != ReadResult::Ok)
      fail_damaged(number);
    ++replaced_;
    return true;
  }

  void finish() {
    refuse_damage_of_sources();
    const uint64_t done = converted_ + skipped_;
    const bool short_of_range = wanted_ && done < range_.count();
    if (done == 0 || short_of_range)
      throw input_error("{}: ends after frame {}", flags_.input, range_.begin + done)
          .remedy("use a range of existing frames");
    output_->finish();
  }

  void report() const {
    if (replaced_ > 0) say("{}: {} damaged frames were replaced\n", flags_.input, replaced_);
    const frames::FrameDamage damage = input_->damage();
    if (damage.any()) say("{}: {}\n", flags_.input, player::damage_text(damage));
    if (written_ != flags_.output) say("{}\n", written_);
    if (!flags_.json) return;
    print_json({{"input", flags_.input},
                {"output", written_},
                {"kind", quilts_ ? "views" : "woven"},
                {"views", shape_.count},
                {"width", info_.geometry.width},
                {"height", info_.geometry.height},
                {"frames_converted", converted_},
                {"frames_skipped", skipped_},
                {"frames_replaced", replaced_},
                {"frames_damaged", damage.damaged},
                {"frames_missing", damage.missing},
                {"rate", frames::to_string(info_.rate)},
                {"max_error", info_.max_error},
                {"interrupted", player::interrupted()},
                {"seconds", seconds_}});
  }

  const ConvertFlags& flags_;
  std::optional<optics::TrimmedRig> rig_;
  player::Content content_;
  bool quilts_ = false;  ///< the written frames are quilts, else woven
  std::optional<player::FrameRange> wanted_;
  frames::ViewShape shape_;     ///< shape of the views, if there are any
  frames::QuiltLayout layout_;  ///< layout of the written quilts
  uint64_t replaced_ = 0;
  std::unique_ptr<ConvertInput> input_;
  frames::SequenceInfo info_;
  player::FrameRange range_;
  std::string written_;
  std::unique_ptr<FrameOutput> output_;
  bool makes_one_picture_ = false;  ///< from a film that does not state its length
  std::optional<uint64_t> last_good_;
  uint64_t converted_ = 0;
  uint64_t skipped_ = 0;
  double seconds_ = 0.0;
};

}  // namespace

cli::Run declare_convert(CLI::App& app) {
  auto flags = std::make_shared<ConvertFlags>();
  app.add_option("IN", flags->input,
                 "pattern ('out/%05d.png'), picture, video or FILE.lts of woven frames or views\n"
                 "Views as play takes them: quilts, stereo, depth, 'views:view%02d/%05d.png'.")
      ->required();
  cli::add_option(
      app, "-o,--output OUTPUT", flags->output,
      "FILE.lts, FILE.mkv, pattern or picture\n"
      "'views:view%02d/%05d.png' makes a picture per view. A quilt's layout is added to "
      "its name.")
      ->required();
  app.add_option("--as", flags->as, "woven: frames for the rig; quilt: views in tiles")
      ->default_str("woven with --rig, else the kind of the input")
      ->check(CLI::IsMember({"woven", "quilt"}));
  cli::add_option(
      app, "--rig RIG.toml", flags->rig,
      "rig that views are woven for\n"
      "For woven frames the rig that they were made for, which is stored with them. With "
      "--as woven as for other commands: that of the connected panel, else a sample.");
  cli::add_option(app, "--rate RATE", flags->rate, "frames per second: 24 or 24000/1001")
      ->default_str("the input's, or 60");
  cli::add_option(app, "--frames A:B", flags->frames, "convert frames A to B - 1, counted from 0");
  cli::declare_content_flags(app, flags->content);
  cli::declare_weaving_flags(app, flags->weaving);
  app.add_option("--max-error", flags->max_error,
                 "for FILE.lts: no subpixel is off by more than 1, 2 ... 16 code values\n"
                 "2 halves the size of films of photographs; the file states it.")
      ->default_str("0, lossless")
      ->check(CLI::Range(0, frames::kMostMaxError));
  CLI::Option* const resume =
      app.add_flag("--resume", flags->resume, "continue where an earlier run was stopped");
  app.add_flag("--overwrite", flags->overwrite, kOverwriteHelp)->excludes(resume);
  app.add_flag(
      "--keep-damaged,--replace-damaged", flags->keep_damaged,
      "also convert a damaged input\n"
      "The frame before a damaged one is repeated; a damaged frame of a video is left out.");
  app.add_flag("--json", flags->json, "print what was done as JSON");
  return [flags]() -> ExitCode { return ConvertRun(*flags).run(); };
}
}  // namespace lenticule::tools
