// SPDX-License-Identifier: Apache-2.0
#include "player/sources/confined_pictures.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <ctime>
#include <deque>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/subprocess.h"
#include "base/text.h"
#include "base/unique_fd.h"
#include "frames/image_format.h"
#include "frames/pictures/picture_messages.h"
#include "player/process/interrupt.h"
#include "player/sources/video_probe.h"

namespace lenticule::player {
namespace {

using namespace std::chrono_literals;
using std::chrono::milliseconds;
using SteadyTime = std::chrono::steady_clock;
namespace wire = frames::confined;

constexpr size_t kMostIdle = 8;
constexpr milliseconds kLook{200};
/// Timeout for the start: loading some hundred libraries on a busy machine may take long.
constexpr milliseconds kStartTimeout{180'000};
constexpr milliseconds kInterruptedTimeout{2000};
constexpr double kMostPixelAspect = 100.0;
constexpr int64_t kMegapixel = 1'000'000;

Error no_decoder(int error) {
  return {ErrorKind::Failed,
          fmt::format("lenticule-video: cannot be started: {}", std::strerror(error))};
}

UniqueFd checked_fd(int fd) {
  if (fd < 0) throw no_decoder(errno);
  return UniqueFd(fd);
}

/// SharedMemory is a sealed memfd: the other process can change its contents and cannot shrink it,
/// so that reads never fault.
class SharedMemory {
 public:
  SharedMemory() : fd_(checked_fd(memfd_create("lenticule-picture", kFlags))) {
    if (ftruncate(fd_.get(), wire::kMemoryBytes) != 0 ||
        fcntl(fd_.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0)
      throw no_decoder(errno);
    memory_ = mmap(nullptr, wire::kMemoryBytes, PROT_READ, MAP_SHARED, fd_.get(), 0);
    if (memory_ == MAP_FAILED) throw no_decoder(errno);
  }
  ~SharedMemory() { munmap(memory_, wire::kMemoryBytes); }
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;

  [[nodiscard]] int fd() const { return fd_.get(); }
  [[nodiscard]] const uint8_t* half(uint32_t which) const {
    return static_cast<const uint8_t*>(memory_) + which * wire::kHalfBytes;
  }

 private:
  static constexpr unsigned kFlags = MFD_CLOEXEC | MFD_ALLOW_SEALING;
  UniqueFd fd_;
  void* memory_ = nullptr;
};

/// Formats that a decoder reads. A decoder of PNG alone starts in a hundredth of the time.
enum class Formats { Png, All };

Formats formats_for(const std::filesystem::path& file) {
  constexpr size_t kSignature = 8;
  std::array<uint8_t, kSignature> begin{};
  try {
    const OpenedFile opened = open_regular_file(file, wire::kPictureFileLimit);
    if (pread(opened.descriptor.get(), begin.data(), begin.size(), 0) != ssize_t{kSignature})
      return Formats::All;
  } catch (const Error&) {
    return Formats::Png;  // a decoder is not to read it: begin() reports the error
  }
  const bool is_png = frames::detect_format(begin, {}) == frames::ImageFormat::Png;
  return is_png ? Formats::Png : Formats::All;
}

/// Decoder is one decoder process. Thread safety: one thread at a time.
class Decoder {
 public:
  /// Call it on a thread that outlives the process, because the kernel kills the process when that
  /// thread ends.
  Decoder(const std::filesystem::path& program, const PictureLimits& limits, Formats formats)
      : limits_(limits) {
    std::array<int, 2> ends{};
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0)
      throw no_decoder(errno);
    socket_ = UniqueFd(ends[0]);
    const UniqueFd theirs(ends[1]);
    std::vector<std::string> command = {program.string(), kForThisVersion, "pictures", "--parent",
                                        std::to_string(getpid())};
    if (formats == Formats::Png) command.emplace_back("--png");
    process_ = Subprocess(
        command, {{theirs.get(), wire::kPictureSocket}, {memory_.fd(), wire::kPictureMemory}});
  }

  [[nodiscard]] pid_t pid() const { return process_.pid(); }
  /// Returns true if the decoder can take another picture.
  [[nodiscard]] bool is_idle() const { return idle_; }
  /// Returns false if the process has ended, for example because the kernel needed its memory.
  [[nodiscard]] bool is_alive() const {
    pollfd stream{.fd = socket_.get(), .events = 0, .revents = 0};
    return poll(&stream, 1, 0) == 0;
  }

  [[nodiscard]] frames::PictureInfo probe(const std::filesystem::path& file) {
    begin(file, wire::PictureRequest::Probe);
    const frames::PictureInfo info = take_header(file);
    idle_ = true;
    return info;
  }

  void read(const std::filesystem::path& file, frames::PictureSink& sink) {
    begin(file, wire::PictureRequest::Decode);
    const frames::PictureInfo info = take_header(file);
    const auto pixels = int64_t{info.geometry.width} * int64_t{info.geometry.height};
    processor_limit_ += limits_.processor_time_per_megapixel * (pixels / kMegapixel);
    accept(file, sink, info);
    take_rows(file, sink, info);
    idle_ = true;
  }

 private:
  void begin(const std::filesystem::path& file, wire::PictureRequest request) {
    const OpenedFile opened = open_regular_file(file, wire::kPictureFileLimit);
    if (!ready_) {
      // Starting is not part of the picture: on a slow machine, loading some hundred libraries
      // takes more processor time than most pictures.
      silent_since_ = SteadyTime::now();
      if (receive(file).reply != wire::PictureReply::Idle) fail_protocol(file);
      ready_ = true;
    }
    idle_ = false;
    limit_from_here();
    wire::PictureRequestMessage message{.request = request, .file_bytes = opened.bytes};
    const std::string extension = file.extension().string();
    if (extension.size() < message.extension.size())
      std::copy(extension.begin(), extension.end(), message.extension.begin());
    if (!send(message, opened.descriptor.get())) fail_dead(file);
  }

  [[nodiscard]] bool send(const wire::PictureRequestMessage& message, int file = -1) const {
    iovec part{.iov_base = const_cast<wire::PictureRequestMessage*>(&message),
               .iov_len = sizeof message};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
    msghdr header{};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    if (file >= 0) {
      header.msg_control = control.data();
      header.msg_controllen = control.size();
      cmsghdr* const passed = CMSG_FIRSTHDR(&header);
      passed->cmsg_level = SOL_SOCKET;
      passed->cmsg_type = SCM_RIGHTS;
      passed->cmsg_len = CMSG_LEN(sizeof file);
      std::memcpy(CMSG_DATA(passed), &file, sizeof file);
    }
    ssize_t n = 0;
    do {
      n = sendmsg(socket_.get(), &header, MSG_NOSIGNAL | MSG_DONTWAIT);
    } while (n < 0 && errno == EINTR);
    return n == sizeof message;
  }

  void limit_from_here() {
    processor_begin_ = processor_time();
    processor_limit_ = limits_.processor_time;
    silent_since_ = SteadyTime::now();
  }

  [[nodiscard]] milliseconds processor_time() const {
    clockid_t clock{};
    timespec used{};
    if (clock_getcpuclockid(process_.pid(), &clock) != 0 || clock_gettime(clock, &used) != 0)
      return 0ms;
    return std::chrono::duration_cast<milliseconds>(std::chrono::seconds(used.tv_sec) +
                                                    std::chrono::nanoseconds(used.tv_nsec));
  }

  wire::PictureReplyMessage receive(const std::filesystem::path& file) {
    while (true) {
      pollfd stream{.fd = socket_.get(), .events = POLLIN, .revents = 0};
      (void)poll(&stream, 1, static_cast<int>(kLook.count()));
      if (stream.revents != 0) {
        wire::PictureReplyMessage message;
        const ssize_t n = recv(socket_.get(), &message, sizeof message, MSG_DONTWAIT);
        if (n == 0 || (n < 0 && errno != EINTR && errno != EAGAIN)) fail_dead(file);
        if (n > 0 && n != sizeof message) fail_protocol(file);
        if (n > 0) {
          silent_since_ = SteadyTime::now();
          return message;
        }
      }
      check_time(file);
    }
  }

  void check_time(const std::filesystem::path& file) const {
    using std::chrono::seconds;
    if (ready_ && processor_time() > processor_begin_ + processor_limit_)
      throw Error(
          ErrorKind::Input,
          fmt::format("{}: not decoded after {:.3g} s of processor time, the limit of this "
                      "picture",
                      file.string(), std::chrono::duration<double>(processor_limit_).count()),
          "convert it to PNG or uncompressed TIFF");
    const auto silence = SteadyTime::now() - silent_since_;
    const milliseconds longest = ready_ ? limits_.silence : kStartTimeout;
    if (silence > longest)
      throw Error(ErrorKind::Input,
                  fmt::format("{}: its decoder did not respond for {} s", file.string(),
                              std::chrono::duration_cast<seconds>(longest).count()));
    if (interrupted() && silence > kInterruptedTimeout)
      throw Error(ErrorKind::Failed, fmt::format("{}: interrupted", file.string()));
  }

  frames::PictureInfo take_header(const std::filesystem::path& file) {
    const wire::PictureReplyMessage reply = receive(file);
    if (reply.reply == wire::PictureReply::Failed) {
      idle_ = true;
      fail_with(file, reply);
    }
    if (reply.reply != wire::PictureReply::Header) fail_protocol(file);
    const bool sensible =
        reply.width >= 1 && reply.width <= frames::kMaxImageSide && reply.height >= 1 &&
        reply.height <= frames::kMaxImageSide &&
        uint64_t(reply.width) * uint64_t(reply.height) <= frames::kMaxImagePixels &&
        reply.orientation >= 1 && reply.orientation <= 8 &&
        reply.pixel_aspect > 1.0 / kMostPixelAspect && reply.pixel_aspect < kMostPixelAspect;
    if (!sensible) fail_protocol(file);
    return {.geometry = {.width = reply.width, .height = reply.height},
            .orientation = static_cast<frames::Orientation>(reply.orientation),
            .pixel_aspect = reply.pixel_aspect};
  }

  /// Passes the picture's info to the sink. If the sink refuses it, the decoder stays usable.
  void accept(const std::filesystem::path& file, frames::PictureSink& sink,
              const frames::PictureInfo& info) {
    try {
      sink.accept(info);
    } catch (...) {
      idle_ = send({.request = wire::PictureRequest::Stop}) &&
              receive(file).reply == wire::PictureReply::Idle;
      throw;
    }
    if (!send({.request = wire::PictureRequest::Continue})) fail_dead(file);
  }

  void take_rows(const std::filesystem::path& file, frames::PictureSink& sink,
                 const frames::PictureInfo& info) {
    const size_t row_bytes = info.geometry.row_bytes();
    for (int next = 0;;) {
      const wire::PictureReplyMessage reply = receive(file);
      if (reply.reply == wire::PictureReply::Failed) fail_with(file, reply);
      if (reply.reply == wire::PictureReply::Done && next == info.geometry.height) return;
      const bool in_order = reply.reply == wire::PictureReply::Rows && reply.first_row == next &&
                            reply.rows >= 1 && reply.rows <= info.geometry.height - next &&
                            size_t(reply.rows) * row_bytes <= wire::kHalfBytes && reply.half < 2;
      if (!in_order) fail_protocol(file);
      const uint8_t* from = memory_.half(reply.half);
      for (const int end = next + reply.rows; next < end;) {
        const std::span<uint8_t> to = sink.rows(next, end - next);
        std::copy_n(from, to.size(), to.begin());
        from += to.size();
        next += static_cast<int>(to.size() / row_bytes);
      }
      if (!send({.request = wire::PictureRequest::Continue})) fail_dead(file);
    }
  }

  /// Throws the decoder's error "picture.exr: cause" with the name of the file, which the decoder
  /// does not know.
  [[noreturn]] void fail_with(const std::filesystem::path& file,
                              const wire::PictureReplyMessage& reply) const {
    const auto end = std::find(reply.cause.begin(), reply.cause.end(), '\0');
    std::string cause = escaped(std::string(reply.cause.begin(), end));
    const std::string prefix = "picture" + file.extension().string() + ": ";
    const std::string nameless = "picture: ";
    if (cause.starts_with(prefix)) cause.erase(0, prefix.size());
    if (cause.starts_with(nameless)) cause.erase(0, nameless.size());
    throw Error(ErrorKind::Input, fmt::format("{}: {}", file.string(), cause),
                frames::kPictureRemedy);
  }

  [[noreturn]] static void fail_protocol(const std::filesystem::path& file) {
    throw Error(ErrorKind::Input,
                fmt::format("{}: its decoder answered out of order", file.string()));
  }

  [[noreturn]] void fail_dead(const std::filesystem::path& file) {
    // A decoder that closed its socket and still runs is not usable.
    const ProcessEnd end = process_.end();
    const std::string how = end.signal != 0 ? fmt::format("was ended by signal {}", end.signal)
                                            : fmt::format("ended with exit code {}", end.exit_code);
    throw Error(ready_ ? ErrorKind::Input : ErrorKind::Failed,
                ready_ ? fmt::format("{}: its decoder {}", file.string(), how)
                       : fmt::format("lenticule-video: {} before its first picture", how),
                ready_
                    ? "the file is broken; convert it again"
                    : "restart the player if it was upgraded; else reinstall lenticule-media, or "
                      "use a kernel with seccomp filters");
  }

  const PictureLimits limits_;
  SharedMemory memory_;
  UniqueFd socket_;
  Subprocess process_;
  bool ready_ = false;  ///< reported that its sandbox is active
  bool idle_ = true;
  milliseconds processor_begin_{0};
  milliseconds processor_limit_{0};
  SteadyTime::time_point silent_since_;
};

}  // namespace

/// Pool keeps idle decoders of one kind. It starts them on its own thread, which lives as long as
/// they do.
class ConfinedPictures::Pool {
 public:
  Pool(std::filesystem::path program, const PictureLimits& limits, Formats formats)
      : program_(std::move(program)), limits_(limits), formats_(formats) {}
  ~Pool() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    changed_.notify_all();
    if (starter_.joinable()) starter_.join();
    idle_.clear();
  }
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;

  /// Returns an idle decoder, or a new one.
  std::unique_ptr<Decoder> take() {
    std::unique_lock lock(mutex_);
    // A picture is not to blame for a decoder that ended before it.
    std::erase_if(idle_, [](const auto& decoder) { return !decoder->is_alive(); });
    ++waiting_;
    while (idle_.empty() && failures_.empty()) {
      // Another thread may have taken the decoder that this thread ordered.
      if (coming_ < waiting_) order();
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
    return decoder;
  }

  void give_back(std::unique_ptr<Decoder> decoder) {
    if (!decoder->is_idle()) return;
    const std::lock_guard lock(mutex_);
    if (idle_.size() < kMostIdle) idle_.push_back(std::move(decoder));
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
    if (!starter_.joinable()) starter_ = std::thread([this] { start_ordered(); });
    ++ordered_;
    ++coming_;
    changed_.notify_all();
  }

  void start_ordered() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [this] { return stopping_ || ordered_ > 0; });
      if (stopping_) return;
      --ordered_;
      lock.unlock();
      std::unique_ptr<Decoder> decoder;
      std::optional<Error> failure;
      try {
        if (program_.empty()) program_ = find_video_program();
        decoder = std::make_unique<Decoder>(program_, limits_, formats_);
      } catch (const Error& error) {
        failure = error;
      } catch (const std::exception& error) {
        failure.emplace(ErrorKind::Failed, std::string("lenticule-video: ") + error.what());
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
  std::condition_variable changed_;
  std::vector<std::unique_ptr<Decoder>> idle_;
  std::deque<Error> failures_;
  int ordered_ = 0;
  int coming_ = 0;   ///< ordered or being started
  int waiting_ = 0;  ///< waiting threads
  uint64_t started_ = 0;
  bool stopping_ = false;
  std::thread starter_;
};

ConfinedPictures::ConfinedPictures(const std::filesystem::path& program,
                                   const PictureLimits& limits)
    : png_(std::make_unique<Pool>(program, limits, Formats::Png)),
      all_(std::make_unique<Pool>(program, limits, Formats::All)) {}

ConfinedPictures::~ConfinedPictures() = default;

template <class Use>
auto ConfinedPictures::with_decoder(const std::filesystem::path& file, Use&& use) const {
  Pool& pool = formats_for(file) == Formats::Png ? *png_ : *all_;
  struct Loan {
    Pool& pool;
    std::unique_ptr<Decoder> decoder = pool.take();
    ~Loan() { pool.give_back(std::move(decoder)); }
  } loan{pool};
  return use(*loan.decoder);
}

frames::PictureInfo ConfinedPictures::probe(const std::filesystem::path& file) const {
  return with_decoder(file, [&](Decoder& decoder) { return decoder.probe(file); });
}

void ConfinedPictures::read(const std::filesystem::path& file, frames::PictureSink& sink) const {
  with_decoder(file, [&](Decoder& decoder) { decoder.read(file, sink); });
}

std::vector<pid_t> ConfinedPictures::idle() const {
  std::vector<pid_t> pids = png_->idle();
  const std::vector<pid_t> others = all_->idle();
  pids.insert(pids.end(), others.begin(), others.end());
  return pids;
}

uint64_t ConfinedPictures::started() const {
  return png_->started() + all_->started();
}

}  // namespace lenticule::player
