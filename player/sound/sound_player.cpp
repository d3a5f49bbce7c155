// SPDX-License-Identifier: Apache-2.0
// Threads: the presenter writes the SoundClock; the sound thread computes and writes blocks without
// a lock; the player's main thread looks after decoders; items are opened and closed on any thread.
// In simulated time the presenter computes the blocks as well.
#include "player/sound/sound_player.h"

#include <fmt/format.h>
#include <poll.h>
#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/exit_code.h"
#include "base/numbers.h"
#include "base/print.h"
#include "base/text.h"
#include "player/playback/playback_options.h"
#include "player/sound/sound_mixer.h"
#include "player/sources/video_child.h"

namespace lenticule::player {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr int kTryAgainMs = 2000;  ///< time until a missing device is tried again
constexpr int kSoundPriority = 9;  ///< below that of the presenter
constexpr auto kSourceTimeout = std::chrono::seconds(10);  ///< real time, in simulated time
constexpr uint64_t kMostRestarts = 3;                      ///< less than a minute apart
constexpr int kMostLateLooks = 5;                          ///< seconds without a sample
constexpr std::array kBeside = {".opus", ".flac", ".wav", ".m4a", ".mp3", ".ogg"};

float gain_of(double db) {
  return db <= kLeastVolumeDb ? 0.0F : static_cast<float>(std::pow(10.0, db / 20.0));
}

std::string file_beside(const SourceSpec& source) {
  if (!source.has_pictures() || source.kind == SourceKind::ViewFiles) return {};
  for (const char* extension : kBeside) {
    std::filesystem::path file = source.text;
    file.replace_extension(extension);
    if (file != source.text && mark_of(file).there) return file.string();
  }
  return {};
}

Nanoseconds now() {
  return Nanoseconds(SteadyClock::now().time_since_epoch());
}

class Player final : public SoundPlayer, public std::enable_shared_from_this<Player> {
 public:
  explicit Player(SoundOptions options) : options_(std::move(options)) {
    Player::set_volume(options_.volume_db);
  }
  ~Player() override {
    stopping_.store(true);
    wake_.signal();
    if (thread_.joinable()) thread_.join();
    left_.clear();
  }
  Player(const Player&) = delete;
  Player& operator=(const Player&) = delete;

  void start(const std::string& connector) override {
    connector_ = connector;
    if (is_silent()) return;
    if (options_.device != "auto") set_device(make_device());
    if (options_.simulated)
      clock_.advance = [this](Nanoseconds now) { advance(now); };
    else
      thread_ = std::thread([this] { run(); });
  }
  std::function<void(uint64_t)> open(const PlaylistItem& item, std::optional<frames::Rate> rate,
                                     uint64_t first_frame,
                                     const frames::FrameSource& source) override {
    try {
      const auto found = find_sound(item, options_);
      if (!found) return nullptr;
      if (!options_.track.empty() && !number_from<int>(options_.track) &&
          !is_language(found->stream.language, options_.track))
        complain(fmt::format("{}: has no sound in '{}'; its first sound is played", found->file,
                             options_.track));
      // A source is closed when its last frame is copied; the sound stays until another is heard.
      const std::shared_ptr<Item> opened(
          new Item(*this, item, *found, rate ? rate : item.rate, first_frame, source),
          [self = shared_from_this()](Item* left) { self->keep(std::unique_ptr<Item>(left)); });
      return [opened](uint64_t number) {
        opened->number.store(number);
        if (opened->slot != nullptr) opened->slot->item.store(number);
      };
    } catch (const Error& error) {
      complain(fmt::format("{}; played without sound", error.what()));
    }
    return nullptr;
  }
  const SoundOptions& options() const override { return options_; }
  SoundClock& clock() override { return clock_; }
  void set_volume(double db) override {
    volume_db_.store(std::clamp(db, kLeastVolumeDb, kMostVolumeDb));
    mixer_.set_volume(gain_of(volume_db_.load()));
  }
  void look() override {
    keep(nullptr);
    const std::lock_guard lock(mutex_);
    for (Item* const item : items_) item->look();
  }
  nlohmann::ordered_json statistics() const override;

 private:
  /// A decoder with the memory that it writes. The process ends before the memory is given back.
  struct Decoder {
    ItemSamples samples;
    VideoChild child;
  };
  /// Item keeps the sound of an opened item ready. The player's mutex guards it.
  struct Item {
    Item(Player& of, const PlaylistItem& wanted, const FoundSound& sound,
         std::optional<frames::Rate> rate, uint64_t first, const frames::FrameSource& source);
    ~Item() {
      const std::lock_guard lock(player.mutex_);
      std::erase(player.items_, this);
      if (slot == nullptr) return;
      slot->item.store(SoundSlot::kNoItem);
      player.mixer_.retire(*slot);
    }
    Item(const Item&) = delete;
    Item& operator=(const Item&) = delete;
    void start_decoder(uint64_t round, uint64_t frame);
    void look();
    [[nodiscard]] uint64_t damaged() const {
      return damaged_before + (decoder ? decoder->child.broken() : 0);
    }

    Player& player;
    const PlaylistItem item;
    const FoundSound found;
    const uint64_t first_frame;
    std::optional<frames::Rate> fps;  ///< none: a still picture
    uint64_t frames = 0;              ///< of a round; 0: not known yet
    std::atomic<uint64_t> number{SoundSlot::kNoItem};
    SoundSlot* slot = nullptr;  ///< null: no device, or too many items
    std::unique_ptr<Decoder> decoder;
    SteadyClock::time_point restarted;
    uint64_t restarts = 0, restarts_in_a_row = 0;  ///< less than a minute apart
    uint64_t damaged_before = 0;                   ///< by the decoders before the present one
    int late_looks = 0;                            ///< times that nothing had come
  };

  [[nodiscard]] bool is_silent() const { return options_.device == "none" && !options_.open; }
  [[nodiscard]] std::unique_ptr<SoundDevice> make_device() const {
    constexpr std::string_view kFile = "file:";
    const std::string& name = options_.device;
    if (options_.open) return options_.open();
    if (name.starts_with(kFile) && name.ends_with(".wav"))
      return record_wav(name.substr(kFile.size()));
    return open_alsa(name == "auto" ? alsa_device_of(connector_) : name);
  }
  void set_device(std::unique_ptr<SoundDevice> device) {
    const std::lock_guard lock(mutex_);
    device_ = std::move(device);
    device_name_ = device_ ? device_->name() : "";
  }
  /// Keeps the sound of an item that was closed until a later item is displayed; ends earlier ones.
  void keep(std::unique_ptr<Item> left) {
    std::vector<std::unique_ptr<Item>> over;  // ends without the lock
    const uint64_t shown = clock_.anchor.read().item;
    const std::lock_guard lock(left_mutex_);
    if (left) left_.push_back(std::move(left));
    for (auto& item : left_)
      if (item->number.load() == SoundSlot::kNoItem || item->number.load() < shown)
        over.push_back(std::move(item));
    std::erase(left_, nullptr);
  }
  void complain(const std::string& problem) {
    const std::lock_guard lock(complaints_mutex_);
    problem_ = problem;
    if (complaints_.size() < 100 && complaints_.insert(problem).second) say("{}\n", problem);
  }

  // The sound thread, which opens a device only while nothing is heard anyway.
  void run() noexcept {
    sched_param priority{};
    priority.sched_priority = kSoundPriority;
    (void)pthread_setschedparam(pthread_self(), SCHED_FIFO | SCHED_RESET_ON_FORK, &priority);
    while (!stopping_.load()) {
      if (device_ == nullptr) {
        try {
          set_device(make_device());
          say("sound: plays on {}\n", device_->name());
        } catch (const std::exception& error) {
          complain(std::string(error.what()) + "; silent, and the player tries again");
          pollfd entry{.fd = wake_.fd(), .events = POLLIN, .revents = 0};
          (void)poll(&entry, 1, kTryAgainMs);
        }
      } else if (!play_block(now())) {
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
      }
    }
  }
  /// Plays a block if the device takes one; returns false otherwise.
  bool play_block(Nanoseconds time) noexcept {
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
  void advance(Nanoseconds time) noexcept {
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

  const SoundOptions options_;
  SoundClock clock_;
  SoundMixer mixer_{clock_};
  std::string connector_;
  std::unique_ptr<SoundDevice> device_;  ///< used by the sound thread
  std::array<float, kSoundBlock * kSoundChannels> block_{};
  std::atomic<uint64_t> device_underruns_{0};
  std::atomic<double> volume_db_{0.0};
  std::atomic<bool> waits_{true};  ///< the presenter waits for decoders, in simulated time

  mutable std::mutex mutex_;  ///< guards the members below and the items
  std::vector<Item*> items_;
  std::string device_name_;  ///< empty while there is none
  uint64_t serials_ = 0;
  std::mutex left_mutex_;  ///< guards left_; locked before mutex_
  std::vector<std::unique_ptr<Item>> left_;
  mutable std::mutex complaints_mutex_;  ///< guards the members below
  std::set<std::string> complaints_;     ///< each is printed once
  std::string problem_;

  std::atomic<bool> stopping_{false};
  WakeFd wake_{"sound"};
  std::thread thread_;
};

Player::Item::Item(Player& of, const PlaylistItem& wanted, const FoundSound& sound,
                   std::optional<frames::Rate> rate, uint64_t first,
                   const frames::FrameSource& source)
    : player(of), item(wanted), found(sound), first_frame(first) {
  const std::optional<uint64_t> count = source.frame_count();
  if (count != uint64_t{1}) {
    fps = source.rate() ? source.rate() : rate;
    frames = item.frames ? item.frames->count() : count.value_or(0);
  }
  const std::lock_guard lock(player.mutex_);
  const auto free = std::ranges::find_if(player.mixer_.slots(), [&](const SoundSlot& one) {
    return std::ranges::none_of(player.items_, [&](Item* other) { return other->slot == &one; });
  });
  if (!fps && count != uint64_t{1})
    player.complain(found.file + ": played without sound: the pictures have no rate; add --fps");
  else if (!player.is_silent() && free != player.mixer_.slots().end())
    slot = &*free;
  if (slot != nullptr) start_decoder(0, first_frame);
  player.items_.push_back(this);
}

/// Starts a decoder at a frame of a round; its samples replace those of the one before.
void Player::Item::start_decoder(uint64_t round, uint64_t frame) {
  constexpr int kRingThere = 3;
  auto made = std::make_unique<Decoder>();
  ItemSamples& samples = made->samples;
  samples.serial = ++player.serials_;
  samples.fps = fps;
  samples.frames = frames;
  samples.knows_length = found.own && !item.frames;
  samples.rounds = item.duration_s ? kForever : item.loops;
  samples.first_round = round;
  if (fps) samples.first = std::floor(static_cast<double>(frame) * kSoundRate / fps->hertz());
  samples.gain = gain_of(item.volume_db);
  const std::filesystem::path& program = player.options_.program;
  std::vector<std::string> arguments = {(program.empty() ? find_video_program() : program).string(),
                                        kForThisVersion, "sound"};
  const uint64_t begin = item.frames ? item.frames->begin : 0;
  for (const auto& [name, value] :
       std::initializer_list<std::pair<const char*, uint64_t>>{{"parent", getpid()},
                                                               {"ring-fd", kRingThere},
                                                               {"stream", found.stream.index},
                                                               {"rate", kSoundRate},
                                                               {"channels", kSoundChannels},
                                                               {"frames", frames},
                                                               {"begin", begin},
                                                               {"from", frame}})
    arguments.push_back(fmt::format("--{}={}", name, value));
  if (fps) arguments.push_back("--fps=" + frames::to_string(*fps));
  if (!fps || samples.rounds != 1) arguments.emplace_back("--loop");
  arguments.insert(arguments.end(), {"--", found.file});
  made->child.start(std::move(arguments), {.here = samples.ring.fd(), .there = kRingThere});
  player.mixer_.retire(*slot);
  slot->needs_decoder.store(false);
  slot->samples.store(&samples);
  damaged_before = damaged();
  decoder = std::move(made);
}

/// Replaces a decoder that has ended, or that cannot give what is due.
void Player::Item::look() {
  const std::optional<ChildEnd> end = decoder ? decoder->child.take_end() : std::nullopt;
  const SoundAnchor anchor = player.clock_.anchor.read();
  const bool shown = slot != nullptr && anchor.item == slot->item.load();
  const SoundCounts& counts = player.mixer_.counts();
  late_looks = shown && counts.late.get() != 0 && counts.playing.get() != 0 ? late_looks + 1 : 0;
  if (decoder && late_looks > kMostLateLooks) decoder->child.kill();  // it hangs
  if (!decoder || (!end && !slot->needs_decoder.load())) return;
  if (frames == 0 && shown) frames = anchor.round_frames;
  if (end) {
    const auto time = SteadyClock::now();
    if (time - std::exchange(restarted, time) > std::chrono::minutes(1)) restarts_in_a_row = 0;
    const bool gives_up = ++restarts_in_a_row > kMostRestarts || end->exit_code == kInput;
    player.complain(fmt::format("{}: its sound: the decoder ended: {}; {}", found.file, end->text(),
                                gives_up ? "silent" : "another one continues"));
    if (gives_up) {
      player.mixer_.retire(*slot);
      damaged_before = damaged();
      return decoder.reset();
    }
    ++restarts;
  }
  late_looks = 0;
  player.waits_ = true;
  start_decoder(shown ? anchor.round : 0, shown ? anchor.number : first_frame);
}

nlohmann::ordered_json Player::statistics() const {
  const SoundCounts& counts = mixer_.counts();
  const SoundAnchor anchor = clock_.anchor.read();
  nlohmann::ordered_json json = {{"device", nullptr}, {"state", "no sound"}, {"source", nullptr}};
  const auto ms = [](const Counter& us) { return static_cast<double>(us.get()) / 1000.0; };
  uint64_t damaged = 0, restarts = 0;
  const std::scoped_lock lock(mutex_, complaints_mutex_);
  if (!device_name_.empty()) json["device"] = device_name_;
  for (const Item* const item : items_) {
    restarts += item->restarts;
    damaged += item->damaged();
    if (item->number.load() != anchor.item) continue;
    json["source"] = item->found.file;
    json["codec"] = item->found.stream.codec;
    json["language"] = item->found.stream.language;
    json["state"] = device_name_.empty()        ? "no output"
                    : anchor.held != 0          ? "held"
                    : anchor.permille != 1000   ? "silent at this speed"
                    : counts.playing.get() == 0 ? "silent"
                                                : "playing";
  }
  json.update({{"volume_db", volume_db_.load()},
               {"offset_ms", ms(counts.offset_us)},
               {"worst_offset_ms", ms(counts.worst_us)},
               {"jumps", counts.jumps.get()},
               {"underruns", counts.underruns.get()},
               {"device_underruns", device_underruns_.load()},
               {"damaged", damaged},
               {"decoder_restarts", restarts},
               {"problem", problem_}});
  return json;
}

}  // namespace

bool is_language(std::string_view tag, std::string_view wanted) {
  static constexpr std::array<std::string_view, 20> kSame = {
      "de ger deu", "en eng", "fr fre fra", "es spa", "it ita",     "nl dut nld", "pt por",
      "pl pol",     "ru rus", "ja jpn",     "ko kor", "cs cze ces", "ar ara",     "tr tur",
      "sv swe",     "da dan", "no nor",     "fi fin", "uk ukr",     "zh chi zho"};
  const auto short_name = [](std::string_view text) {
    const std::string name = lower_case(std::string(text.substr(0, text.find('-'))));
    for (std::string_view rest : kSame)
      for (const std::string_view first = rest.substr(0, 2); !rest.empty();)
        if (take_until(rest, ' ') == name) return std::string(first);
    return name;
  };
  return short_name(tag) == short_name(wanted);
}

std::optional<FoundSound> find_sound(const PlaylistItem& item, const SoundOptions& options) {
  if (item.sound == "none") return std::nullopt;
  FoundSound found{.file = item.sound.empty() ? file_beside(item.source) : item.sound};
  if (found.file.empty()) {
    if (item.source.kind != SourceKind::Video) return std::nullopt;
    found.file = item.source.text;
    found.own = true;
  }
  const std::vector<SoundStream> streams = probe_sound(found.file, options.program);
  if (streams.empty() && found.own) return std::nullopt;
  if (streams.empty())
    throw Error(ErrorKind::Input, found.file + ": no sound in it", "name a file with sound");
  const auto index = number_from<int>(options.track);
  const auto wanted = std::ranges::find_if(streams, [&](const SoundStream& one) {
    return index ? one.index == *index : is_language(one.language, options.track);
  });
  found.stream = options.track.empty() || wanted == streams.end() ? streams.front() : *wanted;
  if (!found.stream.refusal.empty())
    throw Error(ErrorKind::Input,
                fmt::format("{}: its sound is not played: {}", found.file, found.stream.refusal),
                "convert it, for example to FLAC or Opus");
  return found;
}

std::shared_ptr<SoundPlayer> make_sound_player(SoundOptions options) {
  return std::make_shared<Player>(std::move(options));
}

}  // namespace lenticule::player
