// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as the output of lenticule-video: the result is an Error, or streams for which a
// ring can be made.
#include <string_view>

#include "base/error.h"
#include "base/text.h"
#include "frames/ring/ring_layout.h"
#include "player/sources/video_probe.h"

namespace {

using namespace lenticule;

void check(const player::VideoStream& stream) {
  LENTICULE_CHECK(frames::geometry_problem(stream.geometry, frames::kMinSlots) == nullptr);
  if (stream.rate) LENTICULE_CHECK(stream.rate->numerator > 0 && stream.rate->denominator > 0);
  for (const std::string* text : {&stream.codec, &stream.pixel_format, &stream.refusal})
    LENTICULE_CHECK(*text == escaped(*text));  // printable, on one line
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try {
    const player::VideoProbe probe = player::parse_video_probe(text, "fuzz.mkv");
    for (const player::VideoStream& stream : probe.pictures) check(stream);
    for (const player::SoundStream& stream : probe.sound) {
      LENTICULE_CHECK(stream.index >= 0);
      LENTICULE_CHECK(stream.language == escaped(stream.language));
    }
  } catch (const Error& error) {
    LENTICULE_CHECK(std::string_view(error.what()).substr(0, 8) == "fuzz.mkv");
  }
  if (const auto event = player::parse_video_event(text)) {
    LENTICULE_CHECK(event->frame <= uint64_t{1} << 40);
    LENTICULE_CHECK(event->missing <= uint64_t{1} << 40);
    LENTICULE_CHECK(event->decoder == escaped(event->decoder));
    LENTICULE_CHECK(event->reason == escaped(event->reason));
  }
  return 0;
}
