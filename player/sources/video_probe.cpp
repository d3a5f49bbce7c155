// SPDX-License-Identifier: Apache-2.0
#include "player/sources/video_probe.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <nlohmann/json.hpp>

#include "base/error_kinds.h"
#include "base/exit_code.h"
#include "base/file.h"
#include "base/installation.h"
#include "base/print.h"
#include "base/text.h"
#include "frames/ring/ring_layout.h"
#include "optics/json_fields.h"
#include "player/process/child_process.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using optics::JsonFields;

constexpr const char* kProgram = "lenticule-video";
/// Starting the program on a busy machine may take most of it.
constexpr std::chrono::seconds kProbeLimit{60};
constexpr size_t kMostText = 256 * 1024;
constexpr size_t kMostLine = 4096;
constexpr size_t kMostStreams = 256;
constexpr size_t kMostName = 200;
constexpr uint64_t kMostFrames = uint64_t{1} << 40;

/// Returns a whole number from 0 to `most`.
std::optional<uint64_t> count(const json* value, uint64_t most) {
  if (value == nullptr || !value->is_number_unsigned()) return std::nullopt;
  const auto number = value->get<uint64_t>();
  return number <= most ? std::optional(number) : std::nullopt;
}

std::string name(const JsonFields& fields, const std::string& key) {
  const json* const value = fields.find(key);
  if (value == nullptr || !value->is_string()) return {};
  return escaped(value->get<std::string>().substr(0, kMostName));
}

constexpr uint64_t kMostOfStream = 0x7fffffff;

/// Returns numerator and denominator of a fraction.
std::optional<std::array<int64_t, 2>> fraction(const JsonFields& fields, const std::string& key) {
  const json* const value = fields.find(key);
  if (value == nullptr || !value->is_array() || value->size() != 2) return std::nullopt;
  const auto over = count(&(*value)[0], kMostOfStream), under = count(&(*value)[1], kMostOfStream);
  if (!over || !under) return std::nullopt;
  return std::array{static_cast<int64_t>(*over), static_cast<int64_t>(*under)};
}

std::optional<frames::Rate> rate(const JsonFields& fields) try {
  const auto parts = fraction(fields, "rate");
  return parts ? std::optional(frames::make_rate((*parts)[0], (*parts)[1])) : std::nullopt;
} catch (const Error&) {
  return std::nullopt;  // implausible rate: played at the panel's rate
}

frames::FrameGeometry geometry(const JsonFields& fields) {
  const auto width = count(fields.find("width"), kMostOfStream);
  const auto height = count(fields.find("height"), kMostOfStream);
  if (!width || !height) fields.fail("width", "not a size");
  const frames::FrameGeometry size{.width = static_cast<int>(*width),
                                   .height = static_cast<int>(*height)};
  if (frames::geometry_problem(size, frames::kMinSlots) != nullptr)
    throw input_error("{}: pictures of {}x{} pixels cannot be played", fields.source(), *width,
                      *height)
        .remedy("each side must have 1 to 32768 pixels");
  return size;
}

/// Returns the pixel aspect; 1 if the tag is not plausible.
double pixel_aspect(const JsonFields& fields) {
  constexpr double kMostAspect = 16.0;
  const auto [across, down] =
      fraction(fields, "sample_aspect").value_or(std::array<int64_t, 2>{1, 1});
  const double aspect = static_cast<double>(across) / static_cast<double>(down);
  return aspect > 1.0 / kMostAspect && aspect < kMostAspect ? aspect : 1.0;
}

std::optional<frames::Orientation> orientation(const JsonFields& fields) {
  const json* const value = fields.find("orientation");
  if (value == nullptr) return frames::Orientation::Upright;
  const auto number = count(value, 8);
  if (!number || *number < 1) return std::nullopt;
  return static_cast<frames::Orientation>(*number);
}

std::optional<VideoStereo> stereo(const JsonFields& fields) {
  const json* const value = fields.find("stereo");
  if (value == nullptr || !value->is_object()) return std::nullopt;
  const JsonFields tag(*value, fields.source());
  return VideoStereo{.layout = name(tag, "layout"),
                     .right_first = tag.flag("right_first"),
                     .half = tag.flag("half")};
}

VideoStream parse_stream(const json& object, const std::string& source) {
  const JsonFields fields(object, source);
  const auto index = count(fields.find("index"), kMostStreams * kMostStreams);
  if (!index) fields.fail("index", "not a number");
  return {.index = static_cast<int>(*index),
          .geometry = geometry(fields),
          .views = count(fields.find("views"), 2) == 2 ? 2 : 1,
          .rate = rate(fields),
          .pixel_aspect = pixel_aspect(fields),
          .orientation = orientation(fields),
          .stereo = stereo(fields),
          .codec = name(fields, "codec"),
          .pixel_format = name(fields, "pixel_format"),
          .sampling = name(fields, "sampling"),
          .exact = fields.flag("exact"),
          .full_chroma = fields.flag("full_chroma"),
          .warning = name(fields, "warning"),
          .refusal = name(fields, "refusal")};
}

SoundStream parse_sound(const json& object, const std::string& source) {
  const JsonFields fields(object, source);
  const auto index = count(fields.find("index"), kMostStreams * kMostStreams);
  if (!index) fields.fail("index", "not a number");
  const json* const duration = fields.find("duration_s");
  const bool lasts = duration != nullptr && duration->is_number() && *duration > 0.0;
  return {.index = static_cast<int>(*index),
          .codec = name(fields, "codec"),
          .language = name(fields, "language"),
          .duration_s = lasts ? std::optional(duration->get<double>()) : std::nullopt,
          .refusal = name(fields, "refusal")};
}

// --- the program ----------------------------------------------------------------------------

/// Returns the error that the program printed: "lenticule-video: FILE: cause", and a line with the
/// remedy.
Error reported_error(ErrorKind kind, std::string_view output) {
  const auto take_line = [&output](std::string_view prefix) {
    std::string_view line = output.substr(0, output.find('\n'));
    output.remove_prefix(std::min(output.size(), line.size() + 1));
    if (line.starts_with(prefix)) line.remove_prefix(prefix.size());
    return escaped(line.substr(0, 500));
  };
  const std::string what = take_line("lenticule-video: ");
  return {kind, what, take_line("  ")};
}

/// Parses each stream of a list of the report, which may lack it.
template <class Stream>
std::vector<Stream> parse_streams(const JsonFields& report, const char* key,
                                  Stream (*parse)(const json&, const std::string&)) {
  std::vector<Stream> all;
  const json* const streams = report.find(key);
  if (streams == nullptr) return all;
  if (!streams->is_array() || streams->size() > kMostStreams)
    report.fail(key, "not a list of streams, or too long");
  for (const json& stream : *streams) all.push_back(parse(stream, report.source()));
  return all;
}

/// Cached probes. A video's streams are needed several times before it plays: to detect its format,
/// and to open it with its sound.
KnownFiles<std::pair<FileMark, std::string>, VideoProbe> known_probes;

VideoProbe probe(const fs::path& file, const fs::path& program) {
  const std::string path = (program.empty() ? find_video_program() : program).string();
  const FileMark mark = mark_of(file);
  if (const auto known = known_probes.find({mark, path})) return *known;
  const ProgramRun result =
      run_child({path, kForThisVersion, "probe", "--", file.string()}, kProbeLimit);
  if (result.exit_code == kOk) {
    const VideoProbe probe = parse_video_probe(result.output, file.string());
    for (const VideoStream& stream : probe.pictures)
      if (!stream.warning.empty()) say("{}: {}\n", file.string(), stream.warning);
    // A file that changed during the probe is probed again the next time.
    if (mark.there && mark_of(file) == mark) known_probes.add({mark, path}, probe);
    return probe;
  }
  if (result.exit_code == kInput) throw reported_error(ErrorKind::Input, result.output);
  // Also the message of the dynamic linker, if libraries are missing in the middle of an upgrade.
  if (result.exit_code > 0) throw reported_error(ErrorKind::Failed, result.output);
  throw input_error("{}: the program that examines it {}", file.string(),
                    result.timed_out ? "does not end" : "crashed or took longer than 20 s")
      .remedy("the file is broken, or its disk too slow; convert it again");
}

}  // namespace

VideoProbe parse_video_probe(std::string_view text, const std::string& source) {
  if (text.size() > kMostText) throw input_error("{}: description too long", source);
  const json report = optics::parse_json(text, source);
  const JsonFields fields(report, source);
  return {.pictures = parse_streams(fields, "streams", parse_stream),
          .sound = parse_streams(fields, "sound", parse_sound)};
}

std::optional<VideoEvent> parse_video_event(std::string_view line) {
  if (line.size() > kMostLine || line.empty() || line.front() != '{') return std::nullopt;
  const json object = json::parse(line, nullptr, false);
  if (!object.is_object() || !object.contains("event")) return std::nullopt;
  VideoEvent event;
  const JsonFields fields(object, "event");
  const std::string kind = name(fields, "event");
  if (kind == "position") {
    const auto frame = count(fields.find("frame"), kMostFrames);
    if (!frame) return std::nullopt;
    event.kind = VideoEvent::Kind::Position;
    event.frame = *frame;
    if (const json* time = fields.find("time"); time != nullptr && time->is_number_integer())
      event.time = time->get<int64_t>();
  } else if (kind == "broken") {
    event.kind = VideoEvent::Kind::Broken;
    event.broken = count(fields.find("count"), kMostFrames).value_or(0);
  } else if (kind == "clip") {
    event.kind = VideoEvent::Kind::Clip;
    event.missing = count(fields.find("missing"), kMostFrames).value_or(0);
    event.length = count(fields.find("frames"), kMostFrames).value_or(0);
  } else if (kind == "decoder") {
    event.kind = VideoEvent::Kind::Decoder;
    event.decoder = name(fields, "decoder");
    const json* const hardware = fields.find("hardware");
    event.hardware = hardware != nullptr && hardware->is_boolean() && hardware->get<bool>();
    event.reason = name(fields, "reason");
  }
  return event;
}

fs::path find_video_program() { return require_program("videos", kProgram, "lenticule-media"); }

std::vector<VideoStream> probe_video(const fs::path& file, const fs::path& program) {
  std::vector<VideoStream> all = probe(file, program).pictures;
  if (all.empty())
    throw input_error("{}: no stream with pictures", file.string())
        .remedy("name a file that contains a video");
  return all;
}

std::vector<SoundStream> probe_sound(const fs::path& file, const fs::path& program) {
  return probe(file, program).sound;
}

}  // namespace lenticule::player
