// SPDX-License-Identifier: Apache-2.0
#include "player/step/step_message.h"

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <algorithm>

#include "base/error.h"
#include "frames/sequence/sequence_format.h"

namespace lenticule::player {
namespace {

using std::chrono::nanoseconds;

constexpr std::array<uint8_t, 5> kMagicAndVersion = {'L', 'N', 'S', 'P', 1};
constexpr size_t kKindAt = 5;
constexpr size_t kFlagsAt = 6;
constexpr uint8_t kHasTimeline = 1;
constexpr uint8_t kInStep = 2;
/// A timeline is stated for a frame of about now.
constexpr nanoseconds kFarthestDue = std::chrono::hours(24);
constexpr size_t kFieldsAt = 8;
constexpr size_t kFields = 9;
constexpr size_t kNameAt = kFieldsAt + kFields * sizeof(uint64_t);
constexpr size_t kTagAt = kNameAt + kStepNameBytes;
constexpr size_t kTagBytes = 32;
static_assert(kTagAt + kTagBytes == kStepMessageBytes);

using Tag = std::array<uint8_t, kTagBytes>;

std::vector<uint8_t> head_of(const StepMessage& message) {
  const uint8_t flags =
      static_cast<uint8_t>((message.timeline ? kHasTimeline : 0) | (message.in_step ? kInStep : 0));
  std::vector<uint8_t> bytes(kMagicAndVersion.begin(), kMagicAndVersion.end());
  bytes.insert(bytes.end(), {static_cast<uint8_t>(message.kind), flags, 0});
  return bytes;
}

std::array<uint8_t, kStepNameBytes> padded(std::string_view group) {
  LENTICULE_CHECK(group.size() <= kStepNameBytes);
  std::array<uint8_t, kStepNameBytes> name{};
  std::copy(group.begin(), group.end(), name.begin());
  return name;
}

Tag tag_of(std::span<const uint8_t> bytes, std::span<const uint8_t> key) {
  static constexpr uint8_t kNoKey = 0;  // HMAC() takes a null key for "the previous key"
  Tag tag{};
  unsigned length = 0;
  const auto* const made =
      HMAC(EVP_sha256(), key.empty() ? &kNoKey : key.data(), static_cast<int>(key.size()),
           bytes.data(), bytes.size(), tag.data(), &length);
  LENTICULE_CHECK(made != nullptr && length == tag.size());
  return tag;
}

}  // namespace

std::optional<StepMessage> read_step_fields(std::span<const uint8_t> bytes) {
  const auto field = [&](size_t k) {
    return frames::load_u64(&bytes[kFieldsAt + k * sizeof(uint64_t)]);
  };
  const auto number = [&](size_t k) { return static_cast<int64_t>(field(k)); };
  const uint8_t kind = bytes[kKindAt];
  const uint8_t flags = bytes[kFlagsAt];
  if (kind != static_cast<uint8_t>(StepKind::Announcement) &&
      kind != static_cast<uint8_t>(StepKind::Report))
    return std::nullopt;
  if ((flags & ~(kHasTimeline | kInStep)) != 0 || bytes[kFlagsAt + 1] != 0) return std::nullopt;
  const StepTimeline timeline{.frame = field(3),
                              .due = nanoseconds(number(4)),
                              .rate = {.numerator = number(5), .denominator = number(6)},
                              .loop_frames = field(7)};
  StepMessage message{.kind = static_cast<StepKind>(kind),
                      .session = field(0),
                      .sent = nanoseconds(number(1)),
                      .stepped = nanoseconds(number(2)),
                      .in_step = (flags & kInStep) != 0,
                      .difference = number(8)};
  if ((flags & kHasTimeline) != 0) {
    if (!timeline.valid()) return std::nullopt;
    message.timeline = timeline;
  }
  // Sums and differences of such times do not overflow. The first limit is the year 2116.
  constexpr nanoseconds kLastTime{int64_t{1} << 62};
  constexpr nanoseconds kLargestStep{int64_t{1} << 61};
  const bool sane = message.sent >= nanoseconds{0} && message.sent < kLastTime &&
                    message.stepped > -kLargestStep && message.stepped < kLargestStep;
  if (!sane) return std::nullopt;
  const bool far = message.timeline && std::chrono::abs(timeline.due - message.sent) > kFarthestDue;
  if (far) return std::nullopt;
  return message;
}

StepBytes StepKey::seal(const StepMessage& message, std::string_view group) const {
  const StepTimeline timeline = message.timeline.value_or(StepTimeline{});
  std::vector<uint8_t> bytes = head_of(message);
  for (const uint64_t value :
       {message.session, static_cast<uint64_t>(message.sent.count()),
        static_cast<uint64_t>(message.stepped.count()), timeline.frame,
        static_cast<uint64_t>(timeline.due.count()), static_cast<uint64_t>(timeline.rate.numerator),
        static_cast<uint64_t>(timeline.rate.denominator), timeline.loop_frames,
        static_cast<uint64_t>(message.difference)})
    frames::append_u64(bytes, value);
  const auto name = padded(group);
  bytes.insert(bytes.end(), name.begin(), name.end());
  const Tag tag = tag_of(bytes, key_);
  bytes.insert(bytes.end(), tag.begin(), tag.end());
  StepBytes sealed{};
  LENTICULE_CHECK(bytes.size() == sealed.size());
  std::copy(bytes.begin(), bytes.end(), sealed.begin());
  return sealed;
}

StepKey::Opened StepKey::open(std::span<const uint8_t> bytes, std::string_view group) const {
  const bool ours = bytes.size() == kStepMessageBytes &&
                    std::equal(kMagicAndVersion.begin(), kMagicAndVersion.end(), bytes.begin());
  if (!ours) return {.refusal = Refusal::Format};
  const Tag tag = tag_of(bytes.first(kTagAt), key_);
  if (CRYPTO_memcmp(tag.data(), &bytes[kTagAt], kTagBytes) != 0) return {.refusal = Refusal::Key};
  const auto name = padded(group);
  if (!std::equal(name.begin(), name.end(), bytes.begin() + kNameAt))
    return {.refusal = Refusal::Group};
  return {.message = read_step_fields(bytes), .refusal = Refusal::Format};
}

}  // namespace lenticule::player
