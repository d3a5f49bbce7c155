// SPDX-License-Identifier: Apache-2.0
// Replaces lenticule-video in tests that need a fast or faulty decoder. The name of the "file"
// selects the behaviour: FRAMES-WHAT.mkv, for example 3-well.mkv. Frames are 4x2 pixels whose first
// byte is the frame's number.
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_renderer.h"

namespace {

using namespace lenticule;
using namespace std::chrono_literals;

struct Arguments {
  std::string file;
  std::string ring;
  uint64_t from = 0;
  uint64_t position = 0;
  bool again = false;
};

Arguments parse(const std::vector<std::string>& words) {
  Arguments parsed;
  parsed.file = words.back();
  for (size_t i = 0; i + 1 < words.size(); ++i) {
    if (words[i] == "--ring") parsed.ring = words[i + 1];
    if (words[i] == "--from") parsed.from = std::stoull(words[i + 1]);
    if (words[i] == "--position") parsed.position = std::stoull(words[i + 1]);
    if (words[i] == "--loop") parsed.again = true;
  }
  return parsed;
}

int probe(const std::string& file) {
  if (file.find("slow") != std::string::npos) raise(SIGALRM);
  std::puts(R"({"streams":[{"index":0,"width":4,"height":2,"rate":[60,1],"full_chroma":true}]})");
  return 0;
}

bool show(frames::RingRenderer& ring, uint64_t position, uint64_t frame) {
  const uint64_t number = frames::ring_number(position, frame == 0);
  std::span<uint8_t> pixels;
  frames::RingStatus status = frames::RingStatus::TimedOut;
  while (status == frames::RingStatus::TimedOut) status = ring.acquire(number, 1s, pixels);
  if (status == frames::RingStatus::Gone) return false;
  std::memset(pixels.data(), static_cast<int>(frame & 0xff), pixels.size());
  return ring.publish() == frames::RingStatus::Ok;
}

int decode(const Arguments& arguments) {
  const std::string name = std::filesystem::path(arguments.file).stem().string();
  const uint64_t frames = std::stoull(name);
  const std::string what = name.substr(name.find('-') + 1);
  if (what == "noise") {
    for (int i = 0; i < 10000; ++i) std::fputs("\x01{\"event\":[[[[ \xff\xfe noise\n", stderr);
  }
  if (what == "refuses") {
    std::fputs("lenticule-video: it is no clip\n", stderr);
    return 4;
  }
  const auto ring = frames::RingRenderer::connect(
      arguments.ring,
      {.name = "fake", .rig_fingerprint = {}, .rate = std::nullopt, .frame_count = std::nullopt},
      10s);
  uint64_t position = arguments.position;
  for (uint64_t skip = arguments.from;;) {
    for (uint64_t frame = skip; frame < frames; ++frame, ++position) {
      if (what == "leaps" && frame == 2) position += 1'000'000;
      if (what == "waits" && frame == 2) position += 3;
      if (!show(*ring, position, frame)) return 1;
      if (what == "dies" && frame == 1) _exit(9);
    }
    if (!arguments.again) break;
    skip = skip > frames ? skip - frames : 0;
  }
  ring->finish();
  return what == "stumbles" ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  return words.at(1) == "probe" ? probe(words.back()) : decode(parse(words));
}
