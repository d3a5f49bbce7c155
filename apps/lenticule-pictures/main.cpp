// SPDX-License-Identifier: Apache-2.0
// lenticule-pictures decodes one picture file after the other for the process that started it,
// which passes descriptors over a socket and reads rows from shared memory. It is a program of its
// own because loading FFmpeg takes longer than decoding most pictures.
#include <malloc.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>
#include <iterator>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apps/lenticule-video/confinement.h"
#include "base/error.h"
#include "base/file.h"
#include "base/main_function.h"
#include "base/numbers.h"
#include "base/packet.h"
#include "base/unique_fd.h"
#include "frames/picture_codec.h"
#include "frames/pictures/picture_messages.h"

namespace lenticule::pictures {
namespace {

using namespace frames::confined;

/// Thrown if the process that started this one is gone.
class PlayerGone final : public std::exception {};
/// Thrown if that process does not need the rest of the picture.
class PictureUnwanted final : public std::exception {};

/// One descriptor more than the socket and the standard streams.
constexpr unsigned kDescriptors = 4;

struct Received {
  PictureRequestMessage message;
  UniqueFd file;
};

Received receive() {
  Received received;
  if (receive_packet(kPictureSocket, &received.message, sizeof received.message, &received.file) !=
      sizeof received.message)
    throw PlayerGone();
  return received;
}

void send(const PictureReplyMessage& message) {
  if (!send_packet(kPictureSocket, &message, sizeof message)) throw PlayerGone();
}

void await_continue() {
  const PictureRequest request = receive().message.request;
  if (request == PictureRequest::Continue) return;
  if (request == PictureRequest::Stop) throw PictureUnwanted();
  throw PlayerGone();
}

PictureReplyMessage header_of(const frames::PictureInfo& info) {
  return {.reply = PictureReply::Header,
          .width = info.geometry.width,
          .height = info.geometry.height,
          .orientation = static_cast<int32_t>(info.orientation),
          .pixel_bytes = static_cast<uint32_t>(info.pixel_bytes),
          .two_eyes = info.two_eyes ? 1U : 0U,
          .pixel_aspect = info.pixel_aspect};
}

/// RowsToPlayer sends rows as soon as they are decoded, and decodes into one half of the memory
/// while the other is read.
class RowsToPlayer final : public frames::PictureSink {
 public:
  explicit RowsToPlayer(std::span<uint8_t> memory) : memory_(memory) {}

  void accept(const frames::PictureInfo& info) override {
    row_bytes_ = static_cast<size_t>(info.geometry.width) * info.pixel_bytes;
    send(header_of(info));
    await_continue();
  }
  std::span<uint8_t> rows(int y, int rows) override {
    flush();
    if (unread_ == 2) take_answer();
    const int fit = static_cast<int>(kHalfBytes / row_bytes_);
    pending_ = PictureReplyMessage{
        .reply = PictureReply::Rows, .first_row = y, .rows = std::min(rows, fit), .half = half_};
    return memory_.subspan(half_ * kHalfBytes, row_bytes_ * static_cast<size_t>(pending_->rows));
  }
  void finish() {
    flush();
    while (unread_ > 0) take_answer();
  }

 private:
  void flush() {
    if (!pending_) return;
    send(*pending_);
    pending_.reset();
    half_ = 1 - half_;
    ++unread_;
  }
  void take_answer() {
    await_continue();
    --unread_;
  }

  std::span<uint8_t> memory_;
  size_t row_bytes_ = 0;
  uint32_t half_ = 0;
  int unread_ = 0;  ///< halves that were sent and not acknowledged
  std::optional<PictureReplyMessage> pending_;
};

std::vector<uint8_t> bytes_of(const Received& received) {
  if (!received.file || received.message.file_bytes > kPictureFileLimit)
    throw Error(ErrorKind::Input, "no file arrived");
  std::vector<uint8_t> bytes(received.message.file_bytes);
  const ssize_t n = read_from_start(received.file.get(), bytes);
  if (n < 0) throw Error(ErrorKind::Input, std::string("cannot read: ") + std::strerror(errno));
  if (n != std::ssize(bytes)) throw Error(ErrorKind::Input, "became shorter during reading");
  return bytes;
}

void serve(const Received& received, std::span<uint8_t> memory, bool reads_all) {
  const std::vector<uint8_t> bytes = bytes_of(received);
  // Only the extension is meaningful to decoders.
  const std::string name = "picture" + text_of(received.message.extension);
  const frames::PictureDecoder* const codec =
      reads_all ? &frames::picture_codec(bytes, name) : frames::built_in_codec(bytes, name);
  if (codec == nullptr) return send({.reply = PictureReply::Unusual});
  if (received.message.request == PictureRequest::Probe)
    return send(header_of(codec->probe(bytes, name)));
  RowsToPlayer sink(memory);
  codec->decode(bytes, name, received.message.values, sink);
  sink.finish();
  send({.reply = PictureReply::Done});
}

void send_failure(const std::string& cause, const std::string& remedy = {}) {
  PictureReplyMessage message{.reply = PictureReply::Failed};
  set_text(message.cause, cause);
  set_text(message.remedy, remedy);
  send(message);
}

std::span<uint8_t> map_memory() {
  void* const memory =
      ::mmap(nullptr, kMemoryBytes, PROT_READ | PROT_WRITE, MAP_SHARED, kPictureMemory, 0);
  if (memory == MAP_FAILED)
    throw Error(ErrorKind::Usage, "started without shared memory",
                "lenticule starts this program itself");
  ::close(kPictureMemory);
  return {static_cast<uint8_t*>(memory), kMemoryBytes};
}

/// Decodes a picture of one pixel, so that no library has to be loaded afterwards.
void warm_up() {
  constexpr std::string_view kPixel = "P6\n1 1\n255\nabc";
  const std::span bytes(reinterpret_cast<const uint8_t*>(kPixel.data()), kPixel.size());
  (void)frames::picture_codec(bytes, "pixel.ppm").probe(bytes, "pixel.ppm");
}

/// Arguments: the process that may start this one, the version of the program that starts it, and
/// the pictures to read, "usual" or "all".
int run(const std::vector<std::string>& arguments) {
  if (arguments.size() == 3 && arguments[1] != LENTICULE_VERSION)
    throw Error(ErrorKind::Usage, "started by another version", "restart the player");
  const auto parent = arguments.size() == 3 ? number_from<int>(arguments[0]) : std::nullopt;
  if (!parent)
    throw Error(ErrorKind::Usage, "started by hand", "lenticule starts this program itself");
  if (!video::die_with(*parent)) return kFailed;
  video::volunteer_for_oom();
  // Makes malloc return a large picture's memory to the system.
  (void)::mallopt(M_MMAP_THRESHOLD, 1 << 20);
  (void)::mallopt(M_ARENA_MAX, 1);
  const std::span<uint8_t> memory = map_memory();
  const bool reads_all = arguments[2] == "all";
  if (reads_all) warm_up();
  video::confine(kPictureMemoryLimit, *parent, kDescriptors);
  send({.reply = PictureReply::Idle});
  try {
    while (true) {
      const Received received = receive();
      try {
        serve(received, memory, reads_all);
      } catch (const PictureUnwanted&) {
        send({.reply = PictureReply::Idle});
      } catch (const PlayerGone&) {
        throw;
      } catch (const std::bad_alloc&) {
        send_failure("needs more than " + std::to_string(kPictureMemoryLimit >> 20) +
                     " MiB to be decoded, the limit of one picture");
      } catch (const Error& error) {
        send_failure(error.what(), error.hint());
      } catch (const std::exception& error) {
        send_failure(error.what());
      }
    }
  } catch (const PlayerGone&) {
    return kOk;
  }
}

}  // namespace
}  // namespace lenticule::pictures

int main(int argc, char** argv) {
  constexpr lenticule::ErrorStyle kStyle{.program = "lenticule-pictures"};
  if (const int code = lenticule::prepare_program(kStyle); code != lenticule::kOk) return code;
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  return lenticule::run_reporting_errors([&] { return lenticule::pictures::run(arguments); },
                                         kStyle);
}
