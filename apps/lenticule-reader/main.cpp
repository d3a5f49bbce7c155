// SPDX-License-Identifier: Apache-2.0
// lenticule-reader reads models for the command that started it. It gives up every right before the
// first one: the command opens the files that a model names, has its pictures decoded by processes
// without rights, too, and takes the scene from shared memory.
#include <malloc.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <exception>
#include <filesystem>
#include <iterator>
#include <mutex>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apps/lenticule-video/confinement.h"
#include "base/error.h"
#include "base/file.h"
#include "base/large_memory.h"
#include "base/main_function.h"
#include "base/numbers.h"
#include "base/packet.h"
#include "base/unique_fd.h"
#include "frames/picture_codec.h"
#include "frames/pictures/picture_messages.h"
#include "render/loaders/load_scene.h"
#include "render/loaders/scene_archive.h"
#include "render/loaders/scene_files.h"
#include "render/loaders/scene_messages.h"

namespace lenticule::reader {
namespace {

using namespace render::confined;

/// Thrown if the command is gone.
class CommandGone final : public std::exception {};

/// Files and sockets of the textures that all threads ask for at once.
constexpr unsigned kDescriptors = 256;

void send(int socket, const Message& message, int descriptor = -1) {
  if (!send_packet(socket, &message, sizeof message, descriptor)) throw CommandGone();
}

struct Received {
  Message message;
  UniqueFd descriptor;
};

Received receive(int socket) {
  Received received;
  if (receive_packet(socket, &received.message, sizeof received.message, &received.descriptor) !=
      sizeof received.message)
    throw CommandGone();
  if (received.message.word == Word::Failed)
    throw Error(ErrorKind::Input, text_of(received.message.name), text_of(received.message.hint));
  return received;
}

void fill(std::span<uint8_t> bytes, int file) {
  if (read_from_start(file, bytes) != std::ssize(bytes))
    throw Error(ErrorKind::Input, "a file became shorter during reading");
}

/// Asks the command for files.
class FilesOfTheCommand final : public render::SceneFiles {
 public:
  std::filesystem::path find(const std::filesystem::path& folder,
                             const std::string& name) const override {
    Message question{.word = Word::Find};
    set_text(question.path, folder.string());
    set_text(question.name, name);
    return text_of(ask(question).message.path);
  }
  std::vector<uint8_t> read(const std::filesystem::path& file) const override {
    Message question{.word = Word::Open};
    set_text(question.path, file.string());
    const Received opened = ask(question);
    std::vector<uint8_t> bytes(opened.message.bytes);
    fill(bytes, opened.descriptor.get());
    return bytes;
  }

 private:
  Received ask(const Message& question) const {
    const std::lock_guard lock(mutex_);
    send(kSocket, question);
    return receive(kSocket);
  }

  mutable std::mutex mutex_;
};

/// Asks the command for textures, from several threads at once.
class PicturesOfTheCommand final : public frames::PictureFileReader {
 public:
  frames::PictureInfo probe(const std::filesystem::path&) const override { return {}; }
  void read(const frames::EncodedPicture&, frames::PictureSink&,
            frames::PictureValues) const override {}

  frames::TextureImage texture(const frames::EncodedPicture& picture, frames::PictureValues values,
                               frames::TexelPlace place) const override {
    Message question{
        .word = Word::Texture, .values = values, .place = place, .bytes = picture.bytes.size()};
    set_text(question.path, picture.file.string());
    set_text(question.name, picture.name);
    std::array<int, 2> ends{};
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0)
      throw Error(ErrorKind::Input, picture.name + ": too many textures at once");
    const UniqueFd ours(ends[0]), theirs(ends[1]);
    const UniqueFd file = picture.file.empty() ? file_in_memory(picture.bytes) : UniqueFd();
    send(ours.get(), question, file.get());
    send(kSocket, {.word = Word::Texture}, theirs.get());
    const Received answer = receive(ours.get());
    frames::TextureImage image{answer.message.width,  answer.message.height, {}, {},
                               answer.message.number, answer.message.reduced};
    if (!answer.descriptor) return image;
    const size_t values_of_all = size_t{4} * static_cast<size_t>(image.width * image.height);
    if (answer.message.pixel_bytes == 4) {
      image.codes.resize(values_of_all);
      fill(image.codes, answer.descriptor.get());
    } else {
      image.rgba.resize(values_of_all);
      fill({reinterpret_cast<uint8_t*>(image.rgba.data()), values_of_all * sizeof(float)},
           answer.descriptor.get());
    }
    return image;
  }
};

/// Sends the archive, and writes into one half of the memory while the other is read.
class Pieces {
 public:
  explicit Pieces(std::span<uint8_t> memory) : memory_(memory) {}

  void pass_on(const render::SceneDescription& scene) {
    render::write_scene_archive(scene, [this](size_t written) { return next(written); });
    while (unread_ > 0) take_answer();
  }

 private:
  std::span<uint8_t> next(size_t written) {
    if (written > 0) {
      send(kSocket, {.word = Word::Piece, .number = half_, .bytes = written});
      half_ = 1 - half_;
      ++unread_;
    }
    if (unread_ == 2) take_answer();
    return memory_.subspan(static_cast<size_t>(half_) * kHalfBytes, kHalfBytes);
  }
  void take_answer() {
    (void)receive(kSocket);
    --unread_;
  }

  std::span<uint8_t> memory_;
  int32_t half_ = 0;
  int unread_ = 0;
};

void fail(const std::string& cause, const std::string& hint = {}) {
  Message message{.word = Word::Failed};
  set_text(message.name, cause);
  set_text(message.hint, hint);
  send(kSocket, message);
}

void serve(const Message& request, std::span<uint8_t> memory, uint64_t memory_limit) {
  const std::string file = text_of(request.path);
  try {
    render::LoadOptions options;
    if (request.up >= 0) options.up = static_cast<render::UpAxis>(request.up);
    options.choices = {
        text_of(request.scene), text_of(request.animation), text_of(request.variant), {}};
    Pieces(memory).pass_on(render::load_scene_here(file, options));
    return_free_memory();  // the command may render for hours
    send(kSocket, {.word = Word::Done});
  } catch (const CommandGone&) {
    throw;
  } catch (const Error& error) {
    fail(error.what(), error.hint());
  } catch (const std::bad_alloc&) {
    fail(file + ": needs more than " + std::to_string(memory_limit >> 20) +
             " MiB to be read, the limit of a model of its size",
         "save it again, best as glTF (.glb)");
  } catch (const std::exception& error) {
    fail(file + ": " + error.what());
  }
}

/// Arguments: the process that may start this one, the memory that it may use, in bytes, and the
/// version of the program that starts it.
int run(const std::vector<std::string>& arguments) {
  if (arguments.size() == 3 && arguments[2] != LENTICULE_VERSION)
    throw Error(ErrorKind::Usage, "started by another version", "start the command again");
  const auto parent = arguments.size() == 3 ? number_from<int>(arguments[0]) : std::nullopt;
  const auto memory_limit =
      arguments.size() == 3 ? number_from<uint64_t>(arguments[1]) : std::nullopt;
  void* const memory =
      ::mmap(nullptr, kMemoryBytes, PROT_READ | PROT_WRITE, MAP_SHARED, kMemory, 0);
  if (!parent || !memory_limit || memory == MAP_FAILED)
    throw Error(ErrorKind::Usage, "started without shared memory",
                "lenticule starts this program itself");
  if (!video::die_with(*parent)) return kFailed;
  video::volunteer_for_oom();
  ::close(kMemory);
  (void)::mallopt(M_ARENA_MAX, 2);
  render::prepare_loaders();
  video::confine(*memory_limit, *parent, kDescriptors, frames::confined::kPictureFileLimit);
  const FilesOfTheCommand files;
  const PicturesOfTheCommand pictures;
  render::use_scene_files(&files);
  frames::use_picture_reader(&pictures);
  try {
    send(kSocket, {.word = Word::Ready});
    while (true)
      serve(receive(kSocket).message, {static_cast<uint8_t*>(memory), kMemoryBytes}, *memory_limit);
  } catch (const CommandGone&) {
    return kOk;
  }
}

}  // namespace
}  // namespace lenticule::reader

int main(int argc, char** argv) {
  constexpr lenticule::ErrorStyle kStyle{.program = "lenticule-reader"};
  if (const int code = lenticule::prepare_program(kStyle); code != lenticule::kOk) return code;
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  return lenticule::run_reporting_errors([&] { return lenticule::reader::run(arguments); }, kStyle);
}
