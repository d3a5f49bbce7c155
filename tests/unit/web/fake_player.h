// SPDX-License-Identifier: Apache-2.0
// FakePlayer is a player for tests of the server, on a control socket.
#pragma once

#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <list>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "base/text.h"
#include "base/unique_fd.h"
#include "frames/ring/listen_socket.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {

/// Answers as a player does whose state changes every second, with an event a minute and a fault
/// every hundred seconds.
class FakePlayer {
 public:
  explicit FakePlayer(const std::filesystem::path& socket)
      : listening_(socket, {.type = SOCK_STREAM}) {
    rig_ = read_text(LENTICULE_SOURCE_DIR "/scenes/rigs/tiny.toml");
    memory_ = UniqueFd(::memfd_create("frame", MFD_CLOEXEC));
    std::string bytes(kPixelsAt + kPixelBytes, '\x7f');
    std::memset(bytes.data(), 0, kPixelsAt);
    bytes[0] = 1;
    bytes += rig_;
    if (::write(memory_.get(), bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size()))
      std::abort();
    thread_ = std::thread([this] { serve(); });
  }
  ~FakePlayer() {
    stopping_ = true;
    thread_.join();
  }
  [[nodiscard]] uint64_t statuses() const { return statuses_; }

 private:
  static constexpr size_t kPixelsAt = 64, kPixelBytes = size_t{48} * 32 * 3;
  struct Peer {
    UniqueFd fd;
    std::string in{};
    bool subscribed = false;
  };

  void serve() {
    while (!stopping_) {
      std::vector<pollfd> entries = {{.fd = listening_.fd(), .events = POLLIN, .revents = 0}};
      for (const Peer& peer : peers_) entries.push_back({peer.fd.get(), POLLIN, 0});
      if (::poll(entries.data(), entries.size(), 50) <= 0) continue;
      size_t k = 1;
      for (auto peer = peers_.begin(); peer != peers_.end() && k < entries.size(); ++k)
        peer = entries[k].revents == 0 || read(*peer) ? std::next(peer) : peers_.erase(peer);
      while (UniqueFd fd = listening_.accept()) peers_.push_back({.fd = std::move(fd)});
    }
  }
  bool read(Peer& peer) {
    std::array<char, 4096> bytes{};
    const ssize_t got = ::recv(peer.fd.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (got <= 0) return got < 0 && errno == EAGAIN;
    peer.in.append(bytes.data(), static_cast<size_t>(got));
    for (size_t end = 0; (end = peer.in.find('\n')) != std::string::npos; peer.in.erase(0, end + 1))
      answer(peer, nlohmann::ordered_json::parse(peer.in.substr(0, end)));
    return true;
  }
  void answer(Peer& peer, const nlohmann::ordered_json& request) {
    nlohmann::ordered_json reply = {{"id", request["id"]}, {"ok", true}};
    const auto verb = request["do"].get<std::string>();
    if (verb == "status") add_status(reply);
    if (verb == "stats")
      reply["statistics"] = {{"vblanks", statuses_ * 60},
                             {"missed_vblanks", statuses_ / 500},
                             {"repeated_underrun", statuses_ / 900}};
    if (verb == "list") {
      reply["file"] = nullptr;
      reply["items"] = {{{"source", "/media/film.lts"}}};
    }
    if (verb == "subscribe") peer.subscribed = true;
    if (verb == "frame")
      reply.update({{"serial", 1},
                    {"width", 48},
                    {"height", 32},
                    {"row_bytes", 48 * 3},
                    {"pixels_at", kPixelsAt},
                    {"rig_at", kPixelsAt + kPixelBytes},
                    {"rig_bytes", rig_.size()},
                    {"frame", statuses_.load()}});
    send(peer, reply, verb == "frame" ? memory_.get() : -1);
    if (verb != "status") return;
    if (statuses_ % 60 == 0)
      tell({{"event", "item_started"}, {"item", item()}, {"source", "/media/film.lts"}});
    if (statuses_ % 100 == 0)
      tell({{"event", "frame_missed"}, {"missed_vblanks", 1}, {"late_frames", 0}});
  }
  [[nodiscard]] uint64_t item() const { return statuses_ / 60 % 3; }
  void add_status(nlohmann::ordered_json& reply) {
    const uint64_t now = ++statuses_;
    reply["state"] = "playing";
    reply["frames_shown"] = now * 60;
    reply["displayed"] = {{"source", "/media/film.lts"}, {"item", item()}, {"frame", now}};
    reply["reading"] = {{"items", 3}};
  }
  void tell(const nlohmann::ordered_json& event) {
    for (Peer& peer : peers_)
      if (peer.subscribed) send(peer, event, -1);
  }
  static void send(const Peer& peer, const nlohmann::ordered_json& object, int descriptor) {
    const std::string line = json_text(object) + "\n";
    iovec part{.iov_base = const_cast<char*>(line.data()), .iov_len = line.size()};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    if (descriptor >= 0) {
      message.msg_control = control.data();
      message.msg_controllen = control.size();
      cmsghdr* const header = CMSG_FIRSTHDR(&message);
      header->cmsg_level = SOL_SOCKET;
      header->cmsg_type = SCM_RIGHTS;
      header->cmsg_len = CMSG_LEN(sizeof descriptor);
      std::memcpy(CMSG_DATA(header), &descriptor, sizeof descriptor);
    }
    (void)::sendmsg(peer.fd.get(), &message, MSG_NOSIGNAL);
  }

  frames::ListenSocket listening_;
  std::string rig_;
  UniqueFd memory_;
  std::list<Peer> peers_;
  std::atomic<uint64_t> statuses_{0};
  std::atomic<bool> stopping_{false};
  std::thread thread_;  // last member: the thread uses everything above
};

}  // namespace lenticule::test
