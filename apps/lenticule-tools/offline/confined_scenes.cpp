// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/confined_scenes.h"

#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <iterator>
#include <map>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/installation.h"
#include "base/packet.h"
#include "base/text.h"
#include "frames/image_io.h"
#include "frames/pictures/picture_messages.h"
#include "player/process/confined_process.h"
#include "render/loaders/formats.h"
#include "render/loaders/scene_archive.h"
#include "render/loaders/scene_files.h"
#include "render/loaders/scene_messages.h"
#include "render/scene/texture.h"

namespace lenticule::tools {
namespace {

using namespace render::confined;
namespace fs = std::filesystem;

constexpr player::ConfinedProgram kProgram{
    .name = "lenticule-reader",
    .role = "reader",
    .package = "lenticule",
    .remedy = "the file is broken, or its reader is: save it again, best as glTF (.glb)"};

constexpr size_t kMostTexturesAtOnce = 8;  // as many as there are decoders of a kind

Message failure_of(const std::exception& error) {
  Message message{.word = Word::Failed};
  set_text(message.name, error.what());
  if (const auto* const ours = dynamic_cast<const Error*>(&error))
    set_text(message.hint, ours->hint());
  return message;
}

/// Textures reads the textures that the reader asks for, each on a thread of its own, and keeps
/// those that the reader need not see.
class KeptTextures {
 public:
  ~KeptTextures() { wait(); }

  /// Answers the question that waits on the socket.
  void answer(UniqueFd socket) {
    if (threads_.size() >= kMostTexturesAtOnce) wait();
    ++reading_;
    threads_.emplace_back([this, to = std::move(socket)] {
      Message question;
      UniqueFd file;
      // A reader that has not sent its question gets no answer.
      if (receive_packet(to.get(), &question, sizeof question, &file, MSG_DONTWAIT) ==
          sizeof question)
        answer(question, std::move(file), to.get());
      --reading_;
    });
  }
  [[nodiscard]] bool is_reading() const { return reading_ > 0; }

  /// Puts the kept texels into the scene. Throws Error(Input) for a number that was not given.
  void fill(render::SceneDescription& scene, const std::string& name) {
    wait();
    for (std::shared_ptr<const render::Texture>& texture : scene.textures) {
      if (texture->held < 0) continue;
      auto kept = kept_.extract(texture->held);
      if (!kept || kept.mapped().image.width != texture->width ||
          kept.mapped().image.height != texture->height)
        throw input_error("{}: its reader names a texture that was not read", name)
            .remedy(kProgram.remedy);
      auto filled = std::make_shared<render::Texture>(*texture);
      filled->held = -1;
      filled->codes = std::move(kept.mapped().image.codes);
      filled->rgba = std::move(kept.mapped().image.rgba);
      render::keep_codes(*filled, kept.mapped().values == frames::PictureValues::Colours);
      texture = std::move(filled);
    }
  }

 private:
  struct Kept {
    frames::TextureImage image;
    frames::PictureValues values;
  };

  void wait() {
    for (std::thread& thread : threads_) thread.join();
    threads_.clear();
  }

  void answer(const Message& question, UniqueFd file, int to) {
    Message answer{.word = Word::Answer};
    UniqueFd texels;
    try {
      frames::TextureImage image = read(question, file.get());
      answer.width = image.width;
      answer.height = image.height;
      answer.reduced = image.reduced;
      if (question.place == frames::TexelPlace::Here)
        texels = pass_on(image, answer);
      else
        answer.number = keep(std::move(image), question.values);
    } catch (const std::exception& error) {
      answer = failure_of(error);
    }
    (void)send_packet(to, &answer, sizeof answer, texels.get(), MSG_DONTWAIT);
  }

  static frames::TextureImage read(const Message& question, int file) {
    const auto content = question.values == frames::PictureValues::Data
                             ? frames::TextureContent::Data
                             : frames::TextureContent::Colour;
    const std::string path = text_of(question.path);
    if (!path.empty()) return frames::read_texture(path, content);
    const std::string name = escaped(text_of(question.name));
    struct stat status {};
    if (question.bytes > frames::confined::kPictureFileLimit || ::fstat(file, &status) != 0 ||
        static_cast<uint64_t>(status.st_size) < question.bytes)
      throw input_error("{}: too large", name);
    std::vector<uint8_t> bytes(question.bytes);
    if (read_from_start(file, bytes) != std::ssize(bytes))
      throw input_error("{}: cannot be read", name);
    return frames::read_texture(bytes, name, content);
  }

  static UniqueFd pass_on(const frames::TextureImage& image, Message& answer) {
    answer.pixel_bytes = image.codes.empty() ? 4 * sizeof(float) : 4;
    if (!image.codes.empty()) return file_in_memory(image.codes);
    return file_in_memory(
        {reinterpret_cast<const uint8_t*>(image.rgba.data()), image.rgba.size() * sizeof(float)});
  }

  int keep(frames::TextureImage image, frames::PictureValues values) {
    const std::lock_guard lock(mutex_);
    bytes_ += image.codes.size() + image.rgba.size() * sizeof(float);
    if (bytes_ > render::kMaxTextureBytes)
      throw input_error("textures of more than {} MiB in memory", render::kMaxTextureBytes >> 20);
    const int number = static_cast<int>(kept_.size());
    kept_.emplace(number, Kept{std::move(image), values});
    return number;
  }

  std::vector<std::thread> threads_;
  std::atomic<size_t> reading_{0};
  std::mutex mutex_;
  std::map<int, Kept> kept_;
  size_t bytes_ = 0;
};

}  // namespace

class ConfinedScenes::Reader {
 public:
  Reader(const fs::path& program, uint64_t memory, std::chrono::milliseconds silence)
      : memory_(memory),
        process_(
            kProgram,
            {program.string(), std::to_string(getpid()), std::to_string(memory), LENTICULE_VERSION},
            kMemoryBytes, silence) {}

  /// Returns true if the reader can read a model that needs this much memory.
  [[nodiscard]] bool is_good_for(uint64_t memory) const {
    return idle_ && memory <= memory_ && process_.is_alive();
  }

  render::SceneDescription load(const fs::path& file, const render::LoadOptions& options,
                                std::chrono::milliseconds processor_time) {
    idle_ = false;
    KeptTextures textures;
    process_.begin<Message>(file.string(), processor_time,
                            [&textures] { return textures.is_reading(); });
    Message request{.word = Word::Load, .up = options.up ? static_cast<int32_t>(*options.up) : -1};
    set_text(request.path, file.string());
    set_text(request.scene, options.choices.scene);
    set_text(request.animation, options.choices.animation);
    set_text(request.variant, options.choices.variant);
    process_.send(request);
    Message piece = serve_questions(textures);
    bool is_first = true;
    render::SceneDescription scene = archived(file, [&]() -> std::span<const uint8_t> {
      if (!std::exchange(is_first, false)) {
        process_.send(Message{.word = Word::Answer});
        piece = process_.receive<Message>();
      }
      if (piece.word != Word::Piece || piece.number < 0 || piece.number > 1 || piece.bytes == 0 ||
          piece.bytes > kHalfBytes)
        process_.fail_protocol();
      return {process_.memory() + static_cast<size_t>(piece.number) * kHalfBytes, piece.bytes};
    });
    process_.send(Message{.word = Word::Answer});
    if (process_.receive<Message>().word != Word::Done) process_.fail_protocol();
    textures.fill(scene, file.string());
    idle_ = true;
    return scene;
  }

 private:
  static render::SceneDescription archived(const fs::path& file, auto&& next) {
    try {
      return render::read_scene_archive(next);
    } catch (const Error& error) {
      if (std::string(error.what()).starts_with(file.string())) throw;
      throw input_error("{}: its reader made a scene that {}", file.string(), error.what())
          .remedy(kProgram.remedy);
    }
  }

  /// Answers the reader's questions until it has a piece of the scene, which is returned.
  Message serve_questions(KeptTextures& textures) {
    while (true) {
      UniqueFd passed;
      const Message message = process_.receive<Message>(&passed);
      switch (message.word) {
        case Word::Find:
          find(message);
          break;
        case Word::Open:
          open(message);
          break;
        case Word::Texture:
          textures.answer(std::move(passed));
          break;
        case Word::Failed:
          idle_ = true;
          throw Error(ErrorKind::Input, escaped(text_of(message.name)),
                      escaped(text_of(message.hint)));
        case Word::Piece:
          return message;
        default:
          process_.fail_protocol();
      }
    }
  }

  void find(const Message& question) {
    Message answer{.word = Word::Answer};
    set_text(answer.path,
             render::named_file(text_of(question.path), text_of(question.name)).string());
    process_.send(answer);
  }

  void open(const Message& question) {
    OpenedFile file;
    Message answer{.word = Word::Answer};
    try {
      file = open_regular_file(text_of(question.path), render::kMaxSceneFileBytes);
      answer.bytes = file.bytes;
    } catch (const Error& error) {
      answer = failure_of(error);
    }
    process_.send(answer, file.descriptor.get());
  }

  uint64_t memory_;
  player::ConfinedProcess process_;
  bool idle_ = true;
};

ConfinedScenes::ConfinedScenes(fs::path program, const SceneLimits& limits)
    : limits_(limits), program_(std::move(program)) {}

ConfinedScenes::~ConfinedScenes() = default;

render::SceneDescription ConfinedScenes::load(const fs::path& file,
                                              const render::LoadOptions& options) const {
  const uint64_t bytes = open_regular_file(file, render::kMaxSceneFileBytes).bytes;
  const bool has_other_files = lower_case(file.extension().string()) == ".gltf";
  const uint64_t memory =
      (has_other_files ? limits_.memory_of_gltf : limits_.memory) + limits_.memory_per_byte * bytes;
  const std::lock_guard lock(mutex_);
  if (!reader_ || !reader_->is_good_for(memory)) {
    if (program_.empty()) program_ = require_program("scenes", kProgram.name, kProgram.package);
    reader_ = std::make_unique<Reader>(program_, memory, limits_.silence);
  }
  return reader_->load(file, options,
                       limits_.processor_time +
                           limits_.processor_time_per_mebibyte * static_cast<int64_t>(bytes >> 20));
}

}  // namespace lenticule::tools
