// SPDX-License-Identifier: Apache-2.0
// Replaces lenticule-reader in tests of models whose reader breaks, hangs or lies. The name of the
// model selects the behaviour; well.obj is a scene without anything.
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <string>

#include "base/packet.h"
#include "render/loaders/scene_archive.h"
#include "render/loaders/scene_messages.h"

namespace {

using namespace lenticule;
using namespace lenticule::render::confined;

uint8_t* memory = nullptr;

void say(const Message& message, int descriptor = -1) {
  if (!send_packet(kSocket, &message, sizeof message, descriptor)) _exit(0);
}

Message hear(int socket = kSocket) {
  Message message;
  UniqueFd ignored;
  if (receive_packet(socket, &message, sizeof message, &ignored) != sizeof message) _exit(0);
  return message;
}

/// Sends an archive in one piece.
void pass_on(const render::SceneDescription& scene) {
  size_t bytes = 0;
  render::write_scene_archive(scene, [&](size_t written) {
    bytes += written;
    return std::span<uint8_t>(memory, kHalfBytes);
  });
  say({.word = Word::Piece, .number = 0, .bytes = bytes});
  (void)hear();
  say({.word = Word::Done});
}

render::SceneDescription scene_with_held_texture() {
  render::SceneDescription scene;
  scene.textures = {
      std::make_shared<const render::Texture>(render::Texture{.width = 1, .height = 1, .held = 7})};
  return scene;
}

/// Words that no reader sends in the place of a scene.
const std::map<std::string, Message> kLies = {
    {"another-word.obj", {.word = static_cast<Word>(99)}},
    {"ready-again.obj", {.word = Word::Ready}},
    {"done.obj", {.word = Word::Done}},
    {"third-half.obj", {.word = Word::Piece, .number = 2, .bytes = 8}},
    {"half-before.obj", {.word = Word::Piece, .number = -1, .bytes = 8}},
    {"empty-piece.obj", {.word = Word::Piece, .number = 0, .bytes = 0}},
    {"large-piece.obj", {.word = Word::Piece, .number = 1, .bytes = kHalfBytes + 1}},
};

void answer(const std::string& what) {
  if (what == "crash.obj") std::abort();
  if (what == "leave.obj") _exit(0);
  if (what == "stop.obj") std::raise(SIGSTOP);
  if (what == "spin.obj")
    for (std::atomic<int> n = 0;; ++n) continue;
  if (what == "short.obj") (void)!::write(kSocket, "abc", 3);
  // Asks for files for ever, and for each answer more.
  while (what == "ask.obj") {
    say({.word = Word::Find});
    (void)hear();
  }
  if (what == "no-socket.obj") return say({.word = Word::Texture});
  if (what == "noise.obj") {
    std::memset(memory, 0x5a, kHalfBytes);
    return say({.word = Word::Piece, .number = 0, .bytes = kHalfBytes});
  }
  if (what == "false-texels.obj") return pass_on(scene_with_held_texture());
  if (const auto lie = kLies.find(what); lie != kLies.end()) return say(lie->second);
  pass_on({});
}

}  // namespace

int main() {
  void* const shared =
      ::mmap(nullptr, kMemoryBytes, PROT_READ | PROT_WRITE, MAP_SHARED, kMemory, 0);
  if (shared == MAP_FAILED) return 1;
  memory = static_cast<uint8_t*>(shared);
  say({.word = Word::Ready});
  while (true) answer(std::filesystem::path(text_of(hear().path)).filename().string());
}
