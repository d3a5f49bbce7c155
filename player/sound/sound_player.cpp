// SPDX-License-Identifier: Apache-2.0
#include "player/sound/sound_player.h"

#include <fmt/format.h>
#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <condition_variable>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error_kinds.h"
#include "base/exit_code.h"
#include "base/numbers.h"
#include "base/print.h"
#include "base/text.h"
#include "frames/image_io.h"
#include "frames/sequence/sequence_reader.h"
#include "player/sources/video_child.h"

namespace lenticule::player {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr int kStepsToTryAgain = 20;  ///< steps until a missing device is tried again
constexpr std::chrono::milliseconds kMissedStep{100};      ///< without a device
constexpr int kSoundPriority = 9;                          ///< below that of the presenter
constexpr auto kSourceTimeout = std::chrono::seconds(10);  ///< real time, in simulated time
constexpr int kMostRestarts = 3;                           ///< less than a minute apart
constexpr int kMostLateLooks = 5;                          ///< seconds without a sample
constexpr size_t kMostLeft = 4;  ///< items that were closed before they were displayed
constexpr std::array kBeside = {".opus", ".flac", ".wav", ".m4a", ".mp3", ".ogg"};

std::string file_beside(const SourceSpec& source) {
  if (!source.has_pictures() || source.kind == SourceKind::ViewFiles) return {};
  std::vector<std::string> stems{std::filesystem::path(source.text).replace_extension().string()};
  // film.wav belongs to film_%05d.png and film/%05d.png.
  std::string before = source.text.substr(0, source.text.rfind('%'));
  before.resize(before.find_last_not_of("_-./") + 1);
  if (before != source.text) stems.push_back(before);
  for (const std::string& stem : stems)
    for (const bool capitals : {false, true})
      for (std::string extension : kBeside) {
        if (capitals) std::ranges::transform(extension, extension.begin(), ::toupper);
        const std::string file = stem + extension;
        if (file != source.text && mark_of(file).there) return file;
      }
  return {};
}

/// Returns how many pictures of the film lie before the item's range. The range counts as the files
/// or the rendering do; the sound begins with the first picture.
uint64_t begin_of(const PlaylistItem& item) try {
  if (!item.frames) return 0;
  const SourceSpec& source = item.source;
  uint64_t first = 0;
  if (source.kind == SourceKind::Sequence)
    first = frames::SequenceReader(source.text).info().first_frame;
  if (source.kind == SourceKind::Pictures)
    first = frames::FilePattern(source.text).existing_or_throw().front();
  return item.frames->begin - std::min(first, item.frames->begin);
} catch (const Error&) {
  return item.frames->begin;  // the panels of a wall have files of their own
}

/// A decoder with the memory that it writes. The process ends before the memory is given back.
struct Decoder {
  ItemSamples samples;
  VideoChild child;
};

}  // namespace

// --- items and their decoders --------------------------------------------------------------------

/// Item keeps the sound of an opened item, or a bed, ready. The player's mutex guards it.
struct SoundPlayer::Item {
  Item(SoundPlayer& of, const PlaylistItem& wanted, FoundSound sound,
       std::optional<frames::Rate> rate, uint64_t first, const frames::FrameSource& source)
      : player(of),
        item(wanted),
        found(std::move(sound)),
        first_frame(first),
        begins_at(begin_of(wanted)) {
    const std::optional<uint64_t> count = source.frame_count();
    if (count != uint64_t{1}) {
      fps = source.rate() ? source.rate() : rate;
      frames = item.frames ? item.frames->count() : count.value_or(0);
      if (!fps) throw input_error("{}: the pictures have no rate; add --fps", found.file);
    }
    const std::lock_guard lock(player.mutex_);
    const auto free = std::ranges::find_if(player.mixer_.slots(), [&](const SoundSlot& one) {
      return std::ranges::none_of(player.items_, [&](Item* other) { return other->slot == &one; });
    });
    begin_in(free != player.mixer_.slots().end() ? &*free : nullptr);
  }
  /// Makes the bed of a list, which repeats like the sound of a still picture. The caller holds the
  /// player's mutex.
  Item(SoundPlayer& of, const Bed& bed, uint64_t nth)
      : player(of), item{.volume_db = bed.wanted.volume_db}, found(bed.found), bed_number(nth) {
    begin_in(&player.mixer_.bed_slot());
  }
  ~Item() {
    const std::lock_guard lock(player.mutex_);
    leave();
  }
  void begin_in(SoundSlot* place) {
    if (player.options_.device != "none") slot = place;
    if (slot != nullptr) start_decoder(0, first_frame);
    player.items_.push_back(this);
  }
  void leave() {
    std::erase(player.items_, this);
    if (slot == nullptr) return;
    slot->item.store(SoundSlot::kNoItem);
    retire_decoder();
    slot = nullptr;
  }

  void begin(uint64_t as_number, uint64_t rounds) {
    const bool begins = number.exchange(as_number) != as_number;
    if (slot == nullptr) return;
    if (SoundTime& time = player.mixer_.time_of(as_number); begins) {
      time.item.store(SoundSlot::kNoItem);  // until its times are 0
      time.heard.store(0);
      time.silent.store(0);
      time.item.store(as_number);
    }
    slot->rounds.store(rounds);
    slot->item.store(as_number);
  }
  [[nodiscard]] uint64_t damaged() const { return decoder ? decoder->samples.ring.damaged() : 0; }
  /// Takes the decoder's samples from the mixer, before the decoder ends.
  void retire_decoder() {
    player.mixer_.retire(*slot);
    player.damaged_ += damaged();
  }
  void start_decoder(uint64_t round, uint64_t frame);
  void look();

  SoundPlayer& player;
  const PlaylistItem item;
  const FoundSound found;
  const uint64_t first_frame = 0;
  const uint64_t begins_at = 0;     ///< picture of the film with which a range begins
  const uint64_t bed_number = 0;    ///< 0: the sound of an item
  std::optional<frames::Rate> fps;  ///< none: a still picture
  uint64_t frames = 0;              ///< pictures of a round; 0: not known yet
  std::atomic<uint64_t> number{SoundSlot::kNoItem};
  SoundSlot* slot = nullptr;  ///< null: no device, or too many items
  std::unique_ptr<Decoder> decoder;
  SteadyClock::time_point restarted;
  int restarts_in_a_row = 0;  ///< less than a minute apart
  int late_looks = 0;         ///< times that nothing had come
};

/// Starts a decoder at a frame of a round; its samples replace those of the one before.
void SoundPlayer::Item::start_decoder(uint64_t round, uint64_t frame) {
  constexpr int kRingThere = 3;
  auto made = std::make_unique<Decoder>();
  ItemSamples& samples = made->samples;
  samples.serial = ++player.serials_;
  samples.fps = fps;
  samples.frames = frames;
  samples.first_round = round;
  samples.bed = bed_number;
  if (fps) samples.first = std::floor(static_cast<double>(frame) * kSoundRate / fps->hertz());
  samples.volume_db = item.volume_db;
  const std::filesystem::path& program = player.options_.program;
  std::vector<std::string> arguments = {(program.empty() ? find_video_program() : program).string(),
                                        kForThisVersion,
                                        "sound",
                                        fmt::format("--parent={}", getpid()),
                                        fmt::format("--ring-fd={}", kRingThere),
                                        fmt::format("--stream={}", found.stream.index),
                                        fmt::format("--frames={}", frames),
                                        fmt::format("--begin={}", begins_at),
                                        fmt::format("--from={}", frame)};
  if (fps) arguments.push_back("--fps=" + frames::to_string(*fps));
  arguments.insert(arguments.end(), {"--", found.file});
  made->child.start(std::move(arguments), {.here = samples.ring.fd(), .there = kRingThere});
  retire_decoder();
  decoder = std::move(made);
  slot->needs_decoder.store(false);
  slot->samples.store(&decoder->samples);
  player.waits_ = true;
}

/// Replaces a decoder that has ended, or that cannot give what is due.
void SoundPlayer::Item::look() {
  if (!decoder) return;
  const SoundAnchor anchor = player.clock_.anchor.read();
  const bool shown = anchor.item == slot->item.load();
  const SoundCounts& counts = player.mixer_.counts();
  const bool late = bed_number != 0 ? counts.bed.get() == kBedLate
                                    : shown && counts.late.get() != 0 && counts.playing.get() != 0;
  late_looks = late ? late_looks + 1 : 0;
  if (late_looks > kMostLateLooks) decoder->child.kill();  // it hangs
  if (const std::optional<ChildEnd> end = decoder->child.take_end()) {
    const auto time = SteadyClock::now();
    if (time - std::exchange(restarted, time) > std::chrono::minutes(1)) restarts_in_a_row = 0;
    const bool gives_up = ++restarts_in_a_row > kMostRestarts || end->exit_code == kInput;
    player.complain(fmt::format("{}: its sound: the decoder ended: {}; {}", found.file, end->text(),
                                gives_up ? "silent" : "another one continues"));
    if (gives_up) {
      retire_decoder();
      return decoder.reset();
    }
    ++player.restarts_;
    slot->needs_decoder.store(true);
  }
  if (!slot->needs_decoder.load()) return;
  if (frames == 0 && shown) frames = anchor.round_frames;
  late_looks = 0;
  start_decoder(shown ? anchor.round : 0, shown ? anchor.number : first_frame);
}

std::function<void(uint64_t, uint64_t)> SoundPlayer::open(const PlaylistItem& item,
                                                          std::optional<frames::Rate> rate,
                                                          uint64_t first_frame,
                                                          const frames::FrameSource& source) {
  const std::shared_ptr<Item> own = open_own(item, rate, first_frame, source);
  const uint64_t bed = find_bed(item.bed);
  if (!own && bed == 0) return nullptr;
  return [self = shared_from_this(), own, bed](uint64_t number, uint64_t rounds) {
    self->mixer_.set_bed(number, bed);
    if (own) own->begin(number, rounds);
  };
}

/// Returns the number of a list's bed; 0 for none, and for one that cannot be played.
uint64_t SoundPlayer::find_bed(const SoundBed& wanted) try {
  if (wanted.file.empty()) return 0;
  std::unique_lock lock(mutex_);
  auto known = std::ranges::find(beds_, wanted, &Bed::wanted);
  if (known == beds_.end()) {
    lock.unlock();  // another process examines the file
    auto found = find_sound({.sound = wanted.file}, options_);
    lock.lock();
    known = beds_.insert(beds_.end(), {wanted, std::move(*found)});
  }
  const uint64_t number = static_cast<uint64_t>(known - beds_.begin()) + 1;
  if (!bed_)
    bed_ = std::make_unique<Item>(*this, *known, number);
  else if (bed_->bed_number == number && bed_->slot != nullptr && !bed_->decoder)
    bed_->start_decoder(0, 0);  // the one before gave up
  return number;
} catch (const std::exception& error) {
  complain(fmt::format("{}; played without the sound of the list", error.what()));
  return 0;
}

std::shared_ptr<SoundPlayer::Item> SoundPlayer::open_own(const PlaylistItem& item,
                                                         std::optional<frames::Rate> rate,
                                                         uint64_t first_frame,
                                                         const frames::FrameSource& source) try {
  const auto found = find_sound(item, options_);
  if (!found) return nullptr;
  if (const auto index = number_from<int>(options_.track);
      !options_.track.empty() && (index ? found->stream.index != *index
                                        : !is_language(found->stream.language, options_.track)))
    complain(fmt::format("{}: has no sound in '{}'; its first sound is played", found->file,
                         options_.track));
  // A source is closed when its last frame is copied; the sound stays until another is heard.
  return {new Item(*this, item, *found, rate ? rate : item.rate, first_frame, source),
          [self = shared_from_this()](Item* left) {
            const std::lock_guard lock(self->mutex_);
            self->left_.emplace_back(left);
          }};
} catch (const std::exception& error) {
  complain(fmt::format("{}; played without sound", error.what()));
  return nullptr;
}

void SoundPlayer::look() noexcept {
  std::vector<std::unique_ptr<Item>> over;  // ends without the lock
  const SoundAnchor anchor = clock_.anchor.read();
  const uint64_t shown = anchor.item;
  const std::lock_guard lock(mutex_);
  for (auto& item : left_) {
    const uint64_t number = item->number.load();
    const bool too_many = &left_.back() - &item >= static_cast<ptrdiff_t>(kMostLeft);
    if (number == SoundSlot::kNoItem || number < shown || (number > shown && too_many))
      over.push_back(std::move(item));
  }
  std::erase(left_, nullptr);
  const uint64_t bed = mixer_.bed_of(shown);
  const bool other_bed = bed != 0 && (!bed_ || bed_->bed_number != bed);
  if (other_bed && mixer_.counts().bed.get() != kBedHeard) try {
      if (bed_) bed_->leave();
      over.push_back(std::move(bed_));
      bed_ = std::make_unique<Item>(*this, beds_[bed - 1], bed);
    } catch (const std::exception& error) {
      complain(fmt::format("{}: sound of the list: {}; silent, and the player tries again",
                           beds_[bed - 1].wanted.file, error.what()));
    }
  for (Item* const item : items_) try {
      item->look();
      const auto played = static_cast<double>(anchor.numerator) /
                          static_cast<double>(std::max<uint64_t>(anchor.denominator, 1));
      if (played > 0.0 && item->number.load() == shown && item->fps &&
          !SoundMixer::follows(anchor, *item->fps))
        complain(
            fmt::format("{}: its sound is silent: the film has {:.4g} pictures a second and is "
                        "played with {:.4g}",
                        item->found.file, item->fps->hertz(), played));
    } catch (const std::exception& error) {
      complain(fmt::format("{}: its sound: {}; silent, and the player tries again",
                           item->found.file, error.what()));
    }
}

// --- device --------------------------------------------------------------------------------------

SoundPlayer::SoundPlayer(SoundOptions options) : options_(std::move(options)) {
  set_volume(options_.volume_db);
}

SoundPlayer::~SoundPlayer() = default;

void SoundPlayer::start(const std::string& connector) {
  connector_ = connector;
  if (options_.device == "none") return;
  if (options_.device != "auto") set_device(make_device());
  if (options_.simulated)
    clock_.advance = [this](Nanoseconds now) { advance(now); };
  else
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

std::unique_ptr<SoundDevice> SoundPlayer::make_device() const {
  constexpr std::string_view kFile = "file:";
  const std::string& name = options_.device;
  if (options_.open) return options_.open();
  if (name.starts_with(kFile)) return record_wav(name.substr(kFile.size()));
  return open_alsa(name == "auto" ? sound_of_panel(connector_).device : name);
}

void SoundPlayer::set_device(std::unique_ptr<SoundDevice> device) {
  const std::lock_guard lock(mutex_);
  device_ = std::move(device);
  device_name_ = device_ ? device_->name() : "";
}

/// States a problem, and prints it once; without the lock, because standard error may wait.
void SoundPlayer::complain(const std::string& problem) noexcept {
  {
    const std::lock_guard lock(complaints_mutex_);
    problem_ = problem;
    if (complaints_.size() >= 100 || !complaints_.insert(problem).second) return;
  }
  say("{}\n", problem);
}

/// Runs the sound thread, which opens a device only while nothing is heard anyway.
void SoundPlayer::run(const std::stop_token& stop) noexcept {
  sched_param priority{};
  priority.sched_priority = kSoundPriority;
  (void)pthread_setschedparam(pthread_self(), SCHED_FIFO | SCHED_RESET_ON_FORK, &priority);
  std::mutex unshared;
  std::unique_lock lock(unshared);
  while (!stop.stop_requested()) {
    if (device_ == nullptr) {
      try {
        set_device(make_device());
      } catch (const std::exception& error) {
        complain(std::string(error.what()) + "; silent, and the player tries again");
      }
    } else if (!play_block(Nanoseconds(SteadyClock::now().time_since_epoch()))) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    // A device that was lost is not opened at once: it may fail again and again.
    for (int k = 0; device_ == nullptr && k < kStepsToTryAgain && !stop.stop_requested(); ++k) {
      std::condition_variable_any().wait_for(lock, stop, kMissedStep, [] { return false; });
      mixer_.miss(Nanoseconds(SteadyClock::now().time_since_epoch()), kSoundRate / 10);
    }
  }
}

/// Plays a block if the device takes one; returns false otherwise.
bool SoundPlayer::play_block(Nanoseconds time) noexcept {
  if (const SoundAnchor anchor = clock_.anchor.read(); anchor.due_ns != 0)
    device_->begin(Nanoseconds(static_cast<int64_t>(anchor.begun_ns)));
  SoundDevice::Status status = device_->wait(time);
  if (status == SoundDevice::Status::Ready) {
    mixer_.render(block_, device_->heard_at(time) - options_.delay);
    status = device_->write(block_);
  }
  if (status == SoundDevice::Status::Underrun) device_underruns_.fetch_add(1);
  if (status == SoundDevice::Status::Lost) {
    set_device(nullptr);
    complain("sound: the device was lost; silent, and the player tries again");
  }
  return status == SoundDevice::Status::Ready;
}

/// Plays what is heard until a little after `time`. Waits for the decoder as the presenter waits
/// for frames, because real time goes on while simulated time stands.
void SoundPlayer::advance(Nanoseconds time) noexcept {
  const auto deadline = SteadyClock::now() + kSourceTimeout;
  while (device_ != nullptr) {
    const Nanoseconds heard = device_->heard_at(time) - options_.delay;
    look();  // which replaces decoders
    while (!mixer_.is_ready(heard) && waits_ && SteadyClock::now() < deadline)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    waits_ = mixer_.is_ready(heard);  // a decoder that has failed is waited for only once
    if (!play_block(time)) return;
  }
}

nlohmann::ordered_json SoundPlayer::statistics() const {
  const SoundCounts& counts = mixer_.counts();
  const SoundAnchor anchor = clock_.anchor.read();
  nlohmann::ordered_json json = {{"device", nullptr}, {"state", "no sound"}, {"source", nullptr}};
  const auto ms = [](const Counter& us) { return static_cast<double>(us.get()) / 1000.0; };
  const std::scoped_lock lock(mutex_, complaints_mutex_);
  uint64_t damaged = damaged_;
  if (!device_name_.empty()) json["device"] = device_name_;
  for (const Item* const item : items_) {
    damaged += item->damaged();
    if (item->number.load() != anchor.item) continue;
    json["source"] = item->found.file;
    json["codec"] = item->found.stream.codec;
    json["language"] = item->found.stream.language;
    json["state"] = device_name_.empty()                                    ? "no output"
                    : anchor.held != 0                                      ? "held"
                    : counts.playing.get() != 0                             ? "playing"
                    : item->fps && !SoundMixer::follows(anchor, *item->fps) ? "silent at this speed"
                                                                            : "silent";
  }
  json["bed"] = nullptr;
  if (bed_)
    json["bed"] = {{"source", bed_->found.file},
                   {"codec", bed_->found.stream.codec},
                   {"volume_db", bed_->item.volume_db},
                   {"state", device_name_.empty()                             ? "no output"
                             : anchor.held != 0                               ? "held"
                             : counts.bed.get() == kBedHeard                  ? "playing"
                             : !bed_->decoder || counts.bed.get() == kBedLate ? "silent"
                             : mixer_.bed_of(anchor.item) == bed_->bed_number ? "ducked"
                                                                              : "muted"}};
  json.update({{"volume_db", mixer_.volume_db.load()},
               {"offset_ms", ms(counts.offset_us)},
               {"worst_offset_ms", ms(counts.worst_us)},
               {"jumps", counts.jumps.get()},
               {"underruns", counts.underruns.get()},
               {"device_underruns", device_underruns_.load()},
               {"damaged", damaged},
               {"decoder_restarts", restarts_},
               {"problem", problem_}});
  return json;
}

std::optional<SoundAccount> SoundPlayer::account_of(uint64_t number) {
  constexpr uint64_t kPerMs = kSoundRate / 1000;
  const SoundTime& time = mixer_.time_of(number);
  if (time.item.load() != number) return std::nullopt;
  const std::lock_guard lock(mutex_);
  return SoundAccount{time.heard.load() / kPerMs, time.silent.load() / kPerMs, device_name_};
}

// --- files ---------------------------------------------------------------------------------------

bool is_language(std::string_view tag, std::string_view wanted) {
  constexpr std::string_view kSame =
      ", de ger deu , en eng , fr fre fra , es spa , it ita , nl dut nld , pt por , pl pol , ru "
      "rus "
      ", ja jpn , ko kor , cs cze ces , ar ara , tr tur , sv swe , da dan , no nor , fi fin "
      ", uk ukr , zh chi zho ";
  const auto short_name = [&](std::string_view text) {
    const std::string name = lower_case(std::string(text.substr(0, text.find('-'))));
    const size_t at = kSame.find(" " + name + " ");
    return at == kSame.npos ? name : std::string(kSame.substr(kSame.rfind(',', at) + 2, 2));
  };
  return short_name(tag) == short_name(wanted);
}

std::optional<FoundSound> find_sound(const PlaylistItem& item, const SoundOptions& options) {
  if (item.sound == "none") return std::nullopt;
  FoundSound found{.file = item.sound.empty() ? file_beside(item.source) : item.sound};
  const bool own = found.file.empty();
  if (own && item.source.kind != SourceKind::Video) return std::nullopt;
  if (own) found.file = item.source.text;
  const std::vector<SoundStream> streams = probe_sound(found.file, options.program);
  if (streams.empty() && own) return std::nullopt;
  if (streams.empty())
    throw input_error("{}: no sound in it", found.file).remedy("name a file with sound");
  const auto index = number_from<int>(options.track);
  const auto wanted = std::ranges::find_if(streams, [&](const SoundStream& one) {
    return index ? one.index == *index : is_language(one.language, options.track);
  });
  found.stream = options.track.empty() || wanted == streams.end() ? streams.front() : *wanted;
  if (!found.stream.refusal.empty())
    throw input_error("{}: its sound is not played: {}", found.file, found.stream.refusal)
        .remedy("convert it, for example to FLAC or Opus");
  return found;
}

}  // namespace lenticule::player
