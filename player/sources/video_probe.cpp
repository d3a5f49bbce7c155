// SPDX-License-Identifier: Apache-2.0
#include "player/sources/video_probe.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/text.h"
#include "frames/ring/ring_layout.h"
#include "optics/json_fields.h"

namespace lenticule::player {
namespace {

using nlohmann::json;
using optics::JsonFields;

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

std::optional<frames::Rate> rate(const JsonFields& fields) {
  const json* const value = fields.find("rate");
  if (value == nullptr || !value->is_array() || value->size() != 2) return std::nullopt;
  constexpr uint64_t kMost = 0x7fffffff;
  const auto numerator = count(&(*value)[0], kMost);
  const auto denominator = count(&(*value)[1], kMost);
  if (!numerator || !denominator) return std::nullopt;
  try {
    return frames::make_rate(static_cast<int64_t>(*numerator), static_cast<int64_t>(*denominator));
  } catch (const Error&) {
    return std::nullopt;  // implausible rate: played at the panel's rate
  }
}

frames::FrameGeometry geometry(const JsonFields& fields) {
  constexpr uint64_t kMost = 0x7fffffff;
  const auto width = count(fields.find("width"), kMost);
  const auto height = count(fields.find("height"), kMost);
  if (!width || !height) fields.fail("width", "not a size");
  const frames::FrameGeometry size{.width = static_cast<int>(*width),
                                   .height = static_cast<int>(*height)};
  if (frames::geometry_problem(size, frames::kMinSlots) != nullptr)
    throw Error(ErrorKind::Input,
                fmt::format("{}: pictures of {}x{} pixels cannot be played", fields.source(),
                            *width, *height),
                "each side must have 1 to 32768 pixels");
  return size;
}

/// Returns the pixel aspect; 1 if the tag is not plausible.
double pixel_aspect(const JsonFields& fields) {
  constexpr uint64_t kMost = 0x7fffffff;
  constexpr double kMostAspect = 16.0;
  const json* const value = fields.find("sample_aspect");
  if (value == nullptr || !value->is_array() || value->size() != 2) return 1.0;
  const auto across = count(&(*value)[0], kMost);
  const auto down = count(&(*value)[1], kMost);
  if (!across || !down || *across == 0 || *down == 0) return 1.0;
  const double aspect = static_cast<double>(*across) / static_cast<double>(*down);
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
  return VideoStereo{.layout = name(tag, "layout"), .right_first = tag.flag("right_first")};
}

VideoStream parse_stream(const json& object, const std::string& source) {
  const JsonFields fields(object, source);
  const auto index = count(fields.find("index"), kMostStreams * kMostStreams);
  if (!index) fields.fail("index", "not a number");
  return {.index = static_cast<int>(*index),
          .geometry = geometry(fields),
          .rate = rate(fields),
          .pixel_aspect = pixel_aspect(fields),
          .orientation = orientation(fields),
          .stereo = stereo(fields),
          .codec = name(fields, "codec"),
          .pixel_format = name(fields, "pixel_format"),
          .sampling = name(fields, "sampling"),
          .exact = fields.flag("exact"),
          .full_chroma = fields.flag("full_chroma"),
          .refusal = name(fields, "refusal")};
}

}  // namespace

std::vector<VideoStream> parse_video_probe(std::string_view text, const std::string& source) {
  if (text.size() > kMostText) throw Error(ErrorKind::Input, source + ": description too long");
  const json report = optics::parse_json(text, source);
  const JsonFields fields(report, source);
  const json* const streams = fields.find("streams");
  if (streams == nullptr || !streams->is_array() || streams->size() > kMostStreams)
    throw Error(ErrorKind::Input, source + ": the list of streams is missing or too long");
  if (streams->empty())
    throw Error(ErrorKind::Input, source + ": no stream with pictures",
                "name a file that contains a video");
  std::vector<VideoStream> all;
  for (const json& stream : *streams) all.push_back(parse_stream(stream, source));
  return all;
}

std::optional<VideoEvent> parse_video_event(std::string_view line) {
  if (line.size() > kMostLine || line.empty() || line.front() != '{') return std::nullopt;
  const json object = json::parse(line, nullptr, false);
  if (!object.is_object() || !object.contains("event")) return std::nullopt;
  const auto find = [&object](const char* key) {
    const auto found = object.find(key);
    return found == object.end() ? nullptr : &*found;
  };
  VideoEvent event;
  if (*find("event") == "position") {
    const auto frame = count(find("frame"), kMostFrames);
    if (!frame) return std::nullopt;
    event.kind = VideoEvent::Kind::Position;
    event.frame = *frame;
    if (const json* time = find("time"); time != nullptr && time->is_number_integer())
      event.time = time->get<int64_t>();
  } else if (*find("event") == "broken") {
    event.kind = VideoEvent::Kind::Broken;
    event.broken = count(find("packets"), kMostFrames).value_or(0) +
                   count(find("wrong_size"), kMostFrames).value_or(0) +
                   count(find("faulty"), kMostFrames).value_or(0);
  } else if (*find("event") == "clip") {
    event.kind = VideoEvent::Kind::Clip;
    event.missing = count(find("missing"), kMostFrames).value_or(0);
  } else if (*find("event") == "decoder") {
    const JsonFields fields(object, "decoder");
    const json* const hardware = find("hardware");
    event.kind = VideoEvent::Kind::Decoder;
    event.decoder = name(fields, "decoder");
    event.hardware = hardware != nullptr && hardware->is_boolean() && hardware->get<bool>();
    event.reason = name(fields, "reason");
  }
  return event;
}

}  // namespace lenticule::player
