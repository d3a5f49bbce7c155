// SPDX-License-Identifier: Apache-2.0
#include "player/proof/content_hash.h"

#include <fmt/format.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <limits>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include "base/error_kinds.h"
#include "base/file.h"
#include "frames/image_io.h"
#include "frames/sequence/sequence_format.h"

namespace lenticule::player {
namespace {

/// A thread that still hashes when the program ends would use what OpenSSL has released by then. So
/// OpenSSL, which registers that at its first use, is told before main() not to.
[[maybe_unused]] const int kNoCleanup = OPENSSL_init_crypto(OPENSSL_INIT_NO_ATEXIT, nullptr);

constexpr uint64_t kAnySize = std::numeric_limits<uint64_t>::max();
constexpr size_t kPiece = size_t{1} << 18;
constexpr uint64_t kBackgroundBytesPerSecond = uint64_t{16} << 20;
constexpr size_t kMostWaiting = 1000;
constexpr size_t kMostRemembered = 1000;

/// Digest computes a SHA-256 and limits the speed at which its bytes are read.
class Digest {
 public:
  explicit Digest(uint64_t most_bytes_per_second)
      : most_bytes_per_second_(most_bytes_per_second),
        context_(EVP_MD_CTX_new(), &EVP_MD_CTX_free),
        begun_(std::chrono::steady_clock::now()) {
    if (!context_ || EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) != 1)
      throw Error(ErrorKind::Failed, "SHA-256: not provided by libcrypto");
  }
  void add(std::span<const uint8_t> bytes) {
    (void)EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size());
    bytes_ += bytes.size();
    if (most_bytes_per_second_ > 0)
      std::this_thread::sleep_until(
          begun_ + std::chrono::milliseconds(bytes_ * 1000 / most_bytes_per_second_));
  }
  void add_number(uint64_t number) {
    std::array<uint8_t, 8> bytes{};
    for (size_t k = 0; k < bytes.size(); ++k) bytes[k] = static_cast<uint8_t>(number >> (8 * k));
    add(bytes);
  }
  [[nodiscard]] std::string hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned length = 0;
    (void)EVP_DigestFinal_ex(context_.get(), digest.data(), &length);
    std::string text;
    for (unsigned k = 0; k < length; ++k) text += fmt::format("{:02x}", digest[k]);
    return text;
  }

 private:
  const uint64_t most_bytes_per_second_;
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
  const std::chrono::steady_clock::time_point begun_;
  uint64_t bytes_ = 0;
};

/// Adds bytes of a file; returns false if that was ended. Throws Error(Input) if the file is
/// shorter.
bool add_bytes(Digest& digest, const std::string& file, int fd, uint64_t from, uint64_t count,
               const std::atomic<bool>& ending) {
  std::vector<uint8_t> piece(std::min<uint64_t>(kPiece, count));
  while (count > 0 && !ending.load()) {
    const ssize_t got = ::pread(fd, piece.data(), std::min<uint64_t>(piece.size(), count),
                                static_cast<off_t>(from));
    if (got <= 0) throw input_error("{}: cannot read the whole file", file);
    digest.add(std::span(piece).first(static_cast<size_t>(got)));
    from += static_cast<uint64_t>(got);
    count -= static_cast<uint64_t>(got);
  }
  return count == 0;
}

std::string hash_of_file(const std::string& file, const std::atomic<bool>& ending, uint64_t speed) {
  const OpenedFile opened = open_regular_file(file, kAnySize);
  Digest digest(speed);
  if (!add_bytes(digest, file, opened.descriptor.get(), 0, opened.bytes, ending)) return {};
  return "sha256:" + digest.hex();
}

std::string hash_of_sequence(const std::string& file, const std::atomic<bool>& ending,
                             uint64_t speed) {
  const OpenedFile opened = open_regular_file(file, kAnySize);
  const int fd = opened.descriptor.get();
  const frames::SequenceLayout layout = frames::read_sequence_layout(fd, file);
  Digest digest(speed);
  if (!add_bytes(digest, file, fd, 0, layout.header.data_begin(), ending)) return {};
  const uint64_t head_bytes = frames::kFrameHeaderBytes + layout.header.table_bytes();
  for (const uint64_t offset : layout.frames) {
    digest.add_number(offset);  // 0 for a damaged frame, which has no table
    if (offset != 0 && !add_bytes(digest, file, fd, offset, head_bytes, ending)) return {};
  }
  return "lts-sha256:" + digest.hex();
}

std::string hash_of_marks(const SourceSpec& source) {
  Digest digest(0);
  for (const FileMark& mark : marks_of_source(source)) {
    digest.add_number(mark.there ? 1 : 0);
    digest.add_number(static_cast<uint64_t>(mark.size));
    digest.add_number(static_cast<uint64_t>(mark.written_s));
    digest.add_number(static_cast<uint64_t>(mark.written_ns));
  }
  return "files-sha256:" + digest.hex();
}

}  // namespace

std::string content_hash(const SourceSpec& source, const std::atomic<bool>& ending,
                         uint64_t most_bytes_per_second) {
  const std::vector<std::string> files = source.files();
  if (files.empty() || source.kind == SourceKind::List) return {};
  if (files.size() > 1 || frames::FilePattern::looks_like_pattern(files.front()))
    return hash_of_marks(source);
  return source.kind == SourceKind::Sequence
             ? hash_of_sequence(files.front(), ending, most_bytes_per_second)
             : hash_of_file(files.front(), ending, most_bytes_per_second);
}

// --- ContentHashes --------------------------------------------------------------------------

struct ContentHashes::Shared {
  struct Known {
    std::vector<FileMark> files;
    std::string hash;
  };
  void look(const SourceSpec& source, const std::atomic<bool>& ending) {
    Known now{.files = marks_of_source(source), .hash = {}};
    if (now.files.empty()) return;
    {
      const std::lock_guard lock(mutex);
      if (known.size() >= kMostRemembered) known.clear();
      Known& one = known[source.text];
      if (one.files == now.files) return;
      one = now;
    }
    try {
      now.hash = content_hash(source, ending, kBackgroundBytesPerSecond);
    } catch (const std::exception&) {
      now.hash.clear();  // the player reports files that cannot be read when it plays them
    }
    // Files that changed meanwhile are read again with the next request.
    if (marks_of_source(source) != now.files) now = {};
    const std::lock_guard lock(mutex);
    known[source.text] = std::move(now);
  }

  std::mutex mutex;  ///< guards the members below
  std::map<std::string, Known> known;
};

ContentHashes::ContentHashes() : shared_(std::make_shared<Shared>()), worker_(kMostWaiting, true) {}

void ContentHashes::request(const SourceSpec& source) {
  // A request that is refused leaves the hash unknown until the item's next turn.
  (void)worker_.post([shared = shared_, source](const std::atomic<bool>& ending) {
    shared->look(source, ending);
  });
}

std::string ContentHashes::of(const SourceSpec& source) const {
  const std::lock_guard lock(shared_->mutex);
  const auto found = shared_->known.find(source.text);
  return found == shared_->known.end() ? std::string() : found->second.hash;
}

}  // namespace lenticule::player
