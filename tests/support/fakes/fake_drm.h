// SPDX-License-Identifier: Apache-2.0
// Simulates a graphics card behind libdrm's own functions: objects, properties, atomic commits,
// vblanks in simulated time, and faults on request.
#pragma once

#include <drm_fourcc.h>
#include <xf86drmMode.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "display/clock.h"
#include "display/kms/device/platform.h"

namespace lenticule::test {

using display::Nanoseconds;

/// Makes an EDID base block with a correct checksum.
struct EdidMaker {
  std::string manufacturer = "LGD";
  uint16_t product = 0x1234;
  uint32_t serial_number = 0;
  std::string serial_text{};
  std::string name = "Panel";
  bool ycbcr = false;
  int bits = 8;              ///< bits per colour of the base block
  bool deep_colour = false;  ///< adds the HDMI data block with its flag for 30 bits per pixel
  /// Size of the first detailed timing; no timing if 0.
  int width = 0;
  int height = 0;
  bool interlaced = false;
  [[nodiscard]] std::vector<uint8_t> bytes() const;
};

[[nodiscard]] drmModeModeInfo make_mode(int width, int height, int hertz, bool preferred = true);

struct FakeProperty {
  uint32_t id = 0;
  std::string name{};
  uint32_t flags = 0;
  uint64_t value = 0;
  uint64_t minimum = 0;
  uint64_t maximum = 0;
  std::vector<std::pair<std::string, uint64_t>> enums{};
  /// a value that the driver refuses with -EINVAL
  std::optional<uint64_t> refuses{};
  /// the driver accepts writes and keeps its own value
  bool ignores_writes = false;
  /// a change needs a modeset
  bool needs_modeset = false;
};

struct FakeObject {
  uint32_t id = 0;
  uint32_t type = 0;  ///< DRM_MODE_OBJECT_*
  std::vector<FakeProperty> properties{};

  [[nodiscard]] FakeProperty* find(const std::string& name);
  [[nodiscard]] uint64_t value(const std::string& name);
};

struct FakeConnector {
  uint32_t id = 0;
  uint32_t type = DRM_MODE_CONNECTOR_HDMIA;
  uint32_t type_id = 1;
  bool connected = true;
  std::vector<drmModeModeInfo> modes{};
  uint32_t possible_crtcs = 1;
};

struct FakeBuffer {
  uint32_t width = 0;
  uint32_t height = 0;
  uint32_t pitch = 0;
  std::vector<uint8_t> bytes{};
};

struct FakeFramebuffer {
  uint32_t handle = 0;
  uint32_t width = 0;
  uint32_t height = 0;
  uint32_t format = DRM_FORMAT_XRGB8888;
};

struct FakeRamp {
  std::vector<uint16_t> red, green, blue;
};

/// A fault of the k-th call from now (0 = the next one).
struct CallFault {
  int skip = 0;
  int count = 1;                       ///< number of calls that fail from there
  int error = 0;                       ///< positive errno
  std::optional<Nanoseconds> until{};  ///< calls fail until this time, instead of `count` times
};

/// The terminal from which the player was started.
class FakeTerminal final : public display::TerminalCalls {
 public:
  int open_error = ENXIO;  ///< no terminal at all, as for a service
  int get_error = 0;       ///< ENOTTY: not a virtual terminal
  int set_error = 0;
  bool foreground = true;
  int mode = 0;  ///< KD_TEXT
  int opened = 0;
  std::function<void(int)> on_set{};
  [[nodiscard]] std::vector<int> modes_set() const {
    return {set_.begin(), set_.begin() + static_cast<ptrdiff_t>(sets_)};
  }

  [[nodiscard]] int open_controlling_terminal() noexcept override;
  void close(int fd) noexcept override;
  [[nodiscard]] bool is_foreground(int fd) noexcept override;
  [[nodiscard]] int get_mode(int fd, int& mode) noexcept override;
  [[nodiscard]] int set_mode(int fd, int mode) noexcept override;

 private:
  // An array, not a vector, because signal handlers write to it.
  std::array<int, 8> set_{};
  size_t sets_ = 0;
};

enum class EventFault { None, Lose, Duplicate, Late, Stale };

class FakeCard {
 public:
  FakeCard(std::string path, std::string driver);
  ~FakeCard();
  FakeCard(const FakeCard&) = delete;
  FakeCard& operator=(const FakeCard&) = delete;

  /// Adds a connector with a panel of one mode and the usual writable properties.
  FakeConnector& add_connector(uint32_t type, uint32_t type_id, drmModeModeInfo mode,
                               const std::vector<uint8_t>& edid);
  uint32_t add_crtc();  ///< adds a CRTC with its primary plane; returns the CRTC's id
  uint32_t add_overlay_plane(uint32_t crtc);
  /// Gives the CRTC a legacy gamma ramp instead of look-up table properties.
  FakeRamp& use_legacy_gamma(uint32_t crtc, size_t entries);
  FakeProperty& add_property(uint32_t object, FakeProperty property);
  uint32_t add_blob(std::vector<uint8_t> bytes);

  [[nodiscard]] FakeObject& object(uint32_t id) { return objects.at(id); }
  [[nodiscard]] uint64_t value(uint32_t object, const std::string& property) {
    return objects.at(object).value(property);
  }
  void set_edid(uint32_t connector, const std::vector<uint8_t>& bytes);
  [[nodiscard]] uint32_t primary_of(uint32_t crtc) { return primary_planes.at(crtc); }
  /// Returns the pixels of the part of the buffer that this CRTC scans out; empty if the CRTC is
  /// off or shows nothing.
  [[nodiscard]] std::vector<uint32_t> displayed(uint32_t crtc);
  /// Makes the CRTC show another program's picture in the connector's first mode.
  void show_console(uint32_t connector, uint32_t crtc);

  void unplug();  ///< removes the card: POLLHUP, ENODEV

  std::string path;
  std::string driver;
  bool atomic = true;
  bool shows_color_pipelines = false;  ///< a client asked for the property of Linux 6.19
  bool counts_vblanks = true;
  uint64_t sequence_base = 0;  ///< value of the driver's counter at time 0
  Nanoseconds period{16'666'667};
  uint32_t max_buffers = 16;
  bool joint_flips = true;                                ///< one commit may flip several CRTCs
  std::vector<uint32_t> formats = {DRM_FORMAT_XRGB8888};  ///< formats of all planes
  std::map<uint32_t, Nanoseconds> crtc_shift;             ///< delay of each CRTC's vblanks
  Nanoseconds timestamp_shift{0};  ///< added to timestamps in events, not to their arrival
  std::function<void(uint64_t sequence, const FakeBuffer&)>
      on_flip{};                               ///< called at each flip's vblank
  std::function<Nanoseconds()> event_delay{};  ///< delay of an event's arrival after its vblank

  std::map<uint32_t, FakeObject> objects;
  std::vector<uint32_t> crtcs, planes;
  std::vector<std::unique_ptr<FakeConnector>> connectors;
  std::map<uint32_t, uint32_t> primary_planes;  ///< keyed by CRTC id
  std::map<uint32_t, uint32_t> possible_crtcs;  ///< bit masks by plane
  std::map<uint32_t, std::vector<uint8_t>> blobs;
  std::map<uint32_t, FakeBuffer> buffers;
  std::map<uint32_t, FakeFramebuffer> framebuffers;
  std::map<uint32_t, FakeRamp> ramps;  ///< keyed by CRTC id

  // --- faults
  std::vector<CallFault> flip_faults, commit_faults, test_faults, create_faults, map_faults,
      get_connector_faults, set_master_faults, get_gamma_faults, set_gamma_faults;
  std::deque<EventFault> event_faults;  ///< one per flip event, in order
  bool foreign_master = false;          ///< another program is master
  bool gone = false;
  bool forbidden = false;  ///< opening the card is not permitted

  // --- counters
  int flips = 0, blocking_commits = 0, modesets = 0, tests = 0, full_probes = 0, rmfb_on_screen = 0;
  uint64_t last_flip_id = 0;

  // --- used by fake_drm_calls.cpp
  struct Pending {
    Nanoseconds at{0};
    std::vector<uint8_t> bytes{};
  };
  [[nodiscard]] int fail_with(std::vector<CallFault>& faults);
  int commit(const std::vector<std::array<uint64_t, 3>>& settings, uint32_t flags,
             uint64_t user_data);
  [[nodiscard]] std::set<uint32_t> crtcs_flipped_by(
      const std::vector<std::array<uint64_t, 3>>& settings);
  void schedule_flip_event(uint32_t crtc, uint64_t id);
  void send_sequence(uint64_t sequence, uint64_t id);
  [[nodiscard]] Nanoseconds delay() const { return event_delay ? event_delay() : Nanoseconds{0}; }
  [[nodiscard]] uint64_t sequence_at(Nanoseconds time) const;
  [[nodiscard]] Nanoseconds next_vblank() const;
  void deliver_until(Nanoseconds time);
  [[nodiscard]] std::optional<Nanoseconds> next_event() const;
  int open_end();
  [[nodiscard]] bool owns(int fd) const;
  void closed(int fd);
  void forget_contents();

  uint32_t next_id = 100;
  int master_fd = -1;
  std::map<int, int> ends;  ///< the player's end of the event pipe -> ours
  std::vector<Pending> pending;
  std::map<uint32_t, Nanoseconds> busy_until{};  ///< end of each CRTC's last flip
};

/// The machine: cards, clock, hotplug events. Only one instance may exist at a time.
class FakeDrm {
 public:
  FakeDrm();
  ~FakeDrm();
  FakeDrm(const FakeDrm&) = delete;
  FakeDrm& operator=(const FakeDrm&) = delete;

  FakeCard& add_card(const std::string& path = "/dev/dri/card0",
                     const std::string& driver = "fake");
  [[nodiscard]] std::shared_ptr<display::Clock> clock();
  [[nodiscard]] std::shared_ptr<display::Session> session();
  [[nodiscard]] std::shared_ptr<display::KmsPlatform> platform();

  [[nodiscard]] Nanoseconds now() const { return now_; }
  /// Advances time; events on the way become readable.
  void advance_to(Nanoseconds time);
  /// Calls `what` once when time reaches this moment.
  void at(Nanoseconds time, std::function<void()> what);
  void announce_hotplug();
  void sleep(Nanoseconds duration) { asleep_ += duration; }
  /// Makes mmap fail this many times, after `skip` successes.
  void fail_maps(int skip, int count) {
    map_skip_ = skip;
    map_failures_ = count;
  }

  [[nodiscard]] static FakeDrm& instance();
  [[nodiscard]] FakeCard* card_of(int fd);
  [[nodiscard]] FakeCard* card_at(const std::string& path);
  [[nodiscard]] std::optional<Nanoseconds> next_happening() const;

  std::vector<std::unique_ptr<FakeCard>> cards;
  std::shared_ptr<FakeTerminal> terminal = std::make_shared<FakeTerminal>();
  /// Files of sysfs and debugfs, by path.
  std::map<std::string, std::string> kernel_files;
  std::mutex kernel_files_mutex;  ///< needed because the player's other threads read the files
  int mappings_alive = 0;
  bool no_hotplug_monitor = false;  ///< opening the hotplug monitor throws

 private:
  friend class FakePlatform;
  friend class FakeMonitor;

  Nanoseconds now_ = std::chrono::seconds(100);
  Nanoseconds asleep_{0};
  std::multimap<Nanoseconds, std::function<void()>> plans_;
  int hotplug_fd_ = -1;
  int map_skip_ = 0;
  int map_failures_ = 0;
};

}  // namespace lenticule::test
