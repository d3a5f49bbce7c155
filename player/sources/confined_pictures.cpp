// SPDX-License-Identifier: Apache-2.0
#include "player/sources/confined_pictures.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/installation.h"
#include "base/packet.h"
#include "base/text.h"
#include "frames/image_format.h"
#include "frames/pictures/picture_messages.h"
#include "player/process/confined_process.h"

namespace lenticule::player {
namespace {

namespace wire = frames::confined;

constexpr size_t kMostDecoders = 8;
constexpr double kMostPixelAspect = 100.0;
constexpr int64_t kMegapixel = 1'000'000;

constexpr ConfinedProgram kProgram{
    .name = "lenticule-pictures",
    .role = "decoder",
    .package = "lenticule-media",
    .remedy = "the file is broken, or its decoder is: save it again as PNG"};

/// Formats that a decoder reads. A decoder that reads PNG and usual JPEGs only starts in a
/// hundredth of the time.
enum class Formats { Usual, All };

/// Thrown if a decoder that reads PNG and usual JPEGs only got another picture.
class UnusualPicture final : public std::exception {};

/// OpenPicture is a picture whose bytes can be passed to a decoder.
struct OpenPicture {
  std::string name;       ///< for messages
  std::string extension;  ///< extension of the file's name, or empty
  OpenedFile file;
};

OpenPicture open_picture(const frames::EncodedPicture& picture) {
  if (!picture.file.empty())
    return {picture.name, picture.file.extension().string(),
            open_regular_file(picture.file, wire::kPictureFileLimit)};
  if (picture.bytes.size() > wire::kPictureFileLimit)
    throw input_error("{}: larger than {} MiB", picture.name, wire::kPictureFileLimit >> 20);
  return {picture.name, {}, {file_in_memory(picture.bytes), picture.bytes.size()}};
}

Formats formats_for(const OpenPicture& picture) {
  constexpr size_t kSignature = 8;
  std::array<uint8_t, kSignature> begin{};
  if (pread(picture.file.descriptor.get(), begin.data(), begin.size(), 0) != ssize_t{kSignature})
    return Formats::All;
  const frames::ImageFormat format = frames::detect_format(begin, {});
  const bool usual = format == frames::ImageFormat::Png || format == frames::ImageFormat::Jpeg;
  return usual ? Formats::Usual : Formats::All;
}

std::vector<std::string> command_of(const std::filesystem::path& program, Formats formats) {
  return {program.string(), std::to_string(getpid()), LENTICULE_VERSION,
          formats == Formats::Usual ? "usual" : "all"};
}

/// Decoder is one decoder process. Thread safety: one thread at a time.
class Decoder {
 public:
  Decoder(const std::filesystem::path& program, const PictureLimits& limits, Formats formats)
      : limits_(limits),
        process_(kProgram, command_of(program, formats), wire::kMemoryBytes, limits.silence) {}

  [[nodiscard]] pid_t pid() const { return process_.pid(); }
  [[nodiscard]] bool is_alive() const { return process_.is_alive(); }
  /// Returns true if the decoder can take another picture.
  [[nodiscard]] bool is_idle() const { return idle_; }

  [[nodiscard]] frames::PictureInfo probe(const OpenPicture& picture) {
    begin(picture, wire::PictureRequest::Probe, frames::PictureValues::Codes);
    const frames::PictureInfo info = take_header(picture, frames::PictureValues::Codes);
    idle_ = true;
    return info;
  }

  void read(const OpenPicture& picture, frames::PictureSink& sink, frames::PictureValues values) {
    begin(picture, wire::PictureRequest::Decode, values);
    const frames::PictureInfo info = take_header(picture, values);
    const auto pixels = int64_t{info.geometry.width} * int64_t{info.geometry.height};
    process_.allow_more(limits_.processor_time_per_megapixel * (pixels / kMegapixel));
    accept(sink, info);
    take_rows(picture, sink, info);
    idle_ = true;
  }

 private:
  void begin(const OpenPicture& picture, wire::PictureRequest request,
             frames::PictureValues values) {
    idle_ = false;
    process_.begin<wire::PictureReplyMessage>(picture.name, limits_.processor_time);
    wire::PictureRequestMessage message{
        .request = request, .values = values, .file_bytes = picture.file.bytes};
    if (picture.extension.size() < message.extension.size())
      std::ranges::copy(picture.extension, message.extension.begin());
    process_.send(message, picture.file.descriptor.get());
  }

  wire::PictureReplyMessage receive() { return process_.receive<wire::PictureReplyMessage>(); }
  void send(wire::PictureRequest request) {
    process_.send(wire::PictureRequestMessage{.request = request});
  }

  frames::PictureInfo take_header(const OpenPicture& picture, frames::PictureValues values) {
    const wire::PictureReplyMessage reply = receive();
    const bool unusual = reply.reply == wire::PictureReply::Unusual;
    idle_ = unusual || reply.reply == wire::PictureReply::Failed;
    if (unusual) throw UnusualPicture();
    if (idle_) fail_with(picture, reply);
    if (reply.reply != wire::PictureReply::Header) process_.fail_protocol();
    const bool codes = values == frames::PictureValues::Codes;
    const bool sensible =
        reply.width >= 1 && reply.width <= frames::kMaxImageSide && reply.height >= 1 &&
        reply.height <= frames::kMaxImageSide &&
        uint64_t(reply.width) * uint64_t(reply.height) <= frames::kMaxImagePixels &&
        (codes ? reply.pixel_bytes == 3
               : reply.pixel_bytes == 4 || reply.pixel_bytes == wire::kLargestPixel) &&
        reply.orientation >= 1 && reply.orientation <= 8 &&
        reply.pixel_aspect > 1.0 / kMostPixelAspect && reply.pixel_aspect < kMostPixelAspect;
    if (!sensible) process_.fail_protocol();
    return {.geometry = {.width = reply.width, .height = reply.height},
            .orientation = static_cast<frames::Orientation>(reply.orientation),
            .pixel_aspect = reply.pixel_aspect,
            .pixel_bytes = reply.pixel_bytes,
            .two_eyes = reply.two_eyes != 0};
  }

  /// Passes the picture's info to the sink. If the sink refuses it, the decoder stays usable.
  void accept(frames::PictureSink& sink, const frames::PictureInfo& info) {
    try {
      sink.accept(info);
    } catch (...) {
      send(wire::PictureRequest::Stop);
      idle_ = receive().reply == wire::PictureReply::Idle;
      throw;
    }
    send(wire::PictureRequest::Continue);
  }

  void take_rows(const OpenPicture& picture, frames::PictureSink& sink,
                 const frames::PictureInfo& info) {
    const size_t row_bytes = static_cast<size_t>(info.geometry.width) * info.pixel_bytes;
    for (int next = 0;;) {
      const wire::PictureReplyMessage reply = receive();
      if (reply.reply == wire::PictureReply::Failed) fail_with(picture, reply);
      if (reply.reply == wire::PictureReply::Done && next == info.geometry.height) return;
      const bool in_order = reply.reply == wire::PictureReply::Rows && reply.first_row == next &&
                            reply.rows >= 1 && reply.rows <= info.geometry.height - next &&
                            size_t(reply.rows) * row_bytes <= wire::kHalfBytes && reply.half < 2;
      if (!in_order) process_.fail_protocol();
      const uint8_t* from = process_.memory() + reply.half * wire::kHalfBytes;
      for (const int end = next + reply.rows; next < end;) {
        const std::span<uint8_t> to = sink.rows(next, end - next);
        std::copy_n(from, to.size(), to.begin());
        from += to.size();
        next += static_cast<int>(to.size() / row_bytes);
      }
      send(wire::PictureRequest::Continue);
    }
  }

  /// Throws the decoder's error "picture.exr: cause" with the name of the file, which the decoder
  /// does not know.
  [[noreturn]] void fail_with(const OpenPicture& picture,
                              const wire::PictureReplyMessage& reply) const {
    std::string cause = escaped(text_of(reply.cause));
    const std::string remedy = escaped(text_of(reply.remedy));
    const std::string prefix = "picture" + picture.extension + ": ";
    const std::string nameless = "picture: ";
    if (cause.starts_with(prefix)) cause.erase(0, prefix.size());
    if (cause.starts_with(nameless)) cause.erase(0, nameless.size());
    throw input_error("{}: {}", picture.name, cause)
        .remedy(remedy.empty() ? frames::kPictureRemedy : remedy);
  }

  const PictureLimits limits_;
  ConfinedProcess process_;
  bool idle_ = true;
};

}  // namespace

/// Pool keeps idle decoders of one kind. It starts them on its own thread, which lives as long as
/// they do.
class ConfinedPictures::Pool {
 public:
  Pool(std::filesystem::path program, const PictureLimits& limits, Formats formats)
      : program_(std::move(program)), limits_(limits), formats_(formats) {}

  /// Returns an idle decoder, or a new one.
  std::unique_ptr<Decoder> take() {
    std::unique_lock lock(mutex_);
    // A picture is not to blame for a decoder that ended before it.
    std::erase_if(idle_, [](const auto& decoder) { return !decoder->is_alive(); });
    ++waiting_;
    while (idle_.empty() && failures_.empty()) {
      // Another thread may have taken the decoder that this thread ordered.
      if (coming_ < waiting_ && coming_ + lent_ < kMostDecoders) order();
      changed_.wait(lock);
    }
    --waiting_;
    if (idle_.empty()) {
      const Error failure = std::move(failures_.front());
      failures_.pop_front();
      throw Error(failure);
    }
    std::unique_ptr<Decoder> decoder = std::move(idle_.back());
    idle_.pop_back();
    ++lent_;
    return decoder;
  }

  void give_back(std::unique_ptr<Decoder> decoder) {
    if (!decoder->is_idle()) decoder.reset();
    const std::lock_guard lock(mutex_);
    --lent_;
    if (decoder) idle_.push_back(std::move(decoder));
    changed_.notify_all();
  }

  std::vector<pid_t> idle() const {
    const std::lock_guard lock(mutex_);
    std::vector<pid_t> pids;
    for (const auto& decoder : idle_) pids.push_back(decoder->pid());
    return pids;
  }

  uint64_t started() const {
    const std::lock_guard lock(mutex_);
    return started_;
  }

 private:
  /// Call with the lock held.
  void order() {
    if (!starter_.joinable())
      starter_ = std::jthread([this](const std::stop_token& stop) { start_ordered(stop); });
    ++ordered_;
    ++coming_;
    changed_.notify_all();
  }

  void start_ordered(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (changed_.wait(lock, stop, [this] { return ordered_ > 0; }) && !stop.stop_requested()) {
      --ordered_;
      lock.unlock();
      std::unique_ptr<Decoder> decoder;
      std::optional<Error> failure;
      try {
        if (program_.empty())
          program_ = require_program("pictures", kProgram.name, kProgram.package);
        decoder = std::make_unique<Decoder>(program_, limits_, formats_);
      } catch (const Error& error) {
        failure = error;
      } catch (const std::exception& error) {
        failure.emplace(ErrorKind::Failed, std::string(kProgram.name) + ": " + error.what());
      }
      lock.lock();
      --coming_;
      if (decoder) {
        ++started_;
        idle_.push_back(std::move(decoder));
      }
      if (failure) failures_.push_back(*failure);
      changed_.notify_all();
    }
  }

  std::filesystem::path program_;  ///< used by the starter thread
  const PictureLimits limits_;
  const Formats formats_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::vector<std::unique_ptr<Decoder>> idle_;
  std::deque<Error> failures_;
  int ordered_ = 0;
  size_t coming_ = 0;   ///< ordered or being started
  size_t waiting_ = 0;  ///< waiting threads
  size_t lent_ = 0;     ///< decoders that decode
  uint64_t started_ = 0;
  std::jthread starter_;  // last member: the thread uses everything above
};

ConfinedPictures::ConfinedPictures(const std::filesystem::path& program,
                                   const PictureLimits& limits)
    : usual_(std::make_unique<Pool>(program, limits, Formats::Usual)),
      all_(std::make_unique<Pool>(program, limits, Formats::All)) {}

ConfinedPictures::~ConfinedPictures() = default;

template <class Use>
auto ConfinedPictures::with_decoder(const frames::EncodedPicture& picture, Use&& use) const {
  const OpenPicture open = open_picture(picture);
  const auto use_one_of = [&](Pool& pool) {
    struct Loan {
      Pool& pool;
      std::unique_ptr<Decoder> decoder = pool.take();
      ~Loan() { pool.give_back(std::move(decoder)); }
    } loan{pool};
    return use(*loan.decoder, open);
  };
  if (formats_for(open) == Formats::Usual) try {
      return use_one_of(*usual_);
    } catch (const UnusualPicture&) {
    }
  return use_one_of(*all_);
}

frames::PictureInfo ConfinedPictures::probe(const std::filesystem::path& file) const {
  return with_decoder(
      file, [](Decoder& decoder, const OpenPicture& open) { return decoder.probe(open); });
}

void ConfinedPictures::read(const frames::EncodedPicture& picture, frames::PictureSink& sink,
                            frames::PictureValues values) const {
  with_decoder(picture, [&](Decoder& decoder, const OpenPicture& open) {
    decoder.read(open, sink, values);
  });
}

std::vector<pid_t> ConfinedPictures::idle() const {
  std::vector<pid_t> pids = usual_->idle();
  const std::vector<pid_t> others = all_->idle();
  pids.insert(pids.end(), others.begin(), others.end());
  return pids;
}

uint64_t ConfinedPictures::started() const { return usual_->started() + all_->started(); }

}  // namespace lenticule::player
