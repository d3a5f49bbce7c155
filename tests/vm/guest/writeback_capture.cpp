// SPDX-License-Identifier: Apache-2.0
// Runs in the guest as root: captures the picture that a vkms card composes for a running program.
//   vm_writeback_capture PID PPM
// Only the card's master may commit. The program copies the master's own open file from the process
// PID (pidfd_getfd), switches the CRTC's output from the panel to the writeback connector for one
// frame, and back: this driver does not allow both at once. Each switch is a mode set, so the
// program under test sees its flips delayed or refused with EBUSY: capture a still picture.
#include <fcntl.h>
#include <poll.h>
#include <sys/syscall.h>

#include <cstdio>
#include <filesystem>
#include <thread>

#include "drm_card.h"
#include "ppm.h"

namespace lenticule::vm {
namespace {

// Called by number, since the first glibc with these functions declares them for C only.
Descriptor open_process(int pid) {
  const long fd = syscall(SYS_pidfd_open, pid, 0);
  return Descriptor(checked(static_cast<int>(fd), "process " + std::to_string(pid)));
}

Descriptor copy_of_file(const Descriptor& process, int number) {
  return Descriptor(static_cast<int>(syscall(SYS_pidfd_getfd, process.get(), number, 0)));
}

bool is_vkms_master(int fd) {
  const std::unique_ptr<drmVersion, Freed<drmFreeVersion>> version(drmGetVersion(fd));
  return version && std::string(version->name) == "vkms" && drmIsMaster(fd);
}

// Returns the process's file of a vkms card of which the process is master.
Descriptor card_of(int pid) {
  const Descriptor process = open_process(pid);
  const std::string folder = "/proc/" + std::to_string(pid) + "/fd";
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    std::error_code gone;
    const std::string target = std::filesystem::read_symlink(entry.path(), gone).string();
    if (gone || !target.starts_with("/dev/dri/card")) continue;
    Descriptor card = copy_of_file(process, std::stoi(entry.path().filename().string()));
    if (card.get() >= 0 && is_vkms_master(card.get())) return card;
  }
  throw std::runtime_error("process " + std::to_string(pid) + " is not master of a vkms card");
}

struct Pipe {
  uint32_t writeback = 0, panel = 0, crtc = 0, width = 0, height = 0;
};

// Sorts the connectors into the writeback connector and the panel that the CRTC feeds now.
void find_connectors(int fd, const drmModeRes& resources, Pipe& pipe) {
  for (int i = 0; i < resources.count_connectors; ++i) {
    const Connector one(drmModeGetConnectorCurrent(fd, resources.connectors[i]));
    if (!one) continue;
    const uint32_t id = one->connector_id;
    if (one->connector_type == DRM_MODE_CONNECTOR_WRITEBACK)
      pipe.writeback = id;
    else if (property(fd, id, DRM_MODE_OBJECT_CONNECTOR, "CRTC_ID").value == pipe.crtc)
      pipe.panel = id;
  }
}

// Writeback connectors are hidden unless a client asks for them. The request is reset at once,
// because it belongs to the file that the program under test uses too.
Pipe find_pipe(int fd) {
  checked(drmSetClientCap(fd, DRM_CLIENT_CAP_WRITEBACK_CONNECTORS, 1), "writeback connectors");
  const Resources resources(drmModeGetResources(fd));
  if (!resources || resources->count_crtcs == 0) throw std::runtime_error("no CRTC");
  const Crtc crtc(drmModeGetCrtc(fd, resources->crtcs[0]));
  if (!crtc || !crtc->mode_valid) throw std::runtime_error("the CRTC is off");
  Pipe pipe{.crtc = crtc->crtc_id, .width = crtc->mode.hdisplay, .height = crtc->mode.vdisplay};
  find_connectors(fd, *resources, pipe);
  drmSetClientCap(fd, DRM_CLIENT_CAP_WRITEBACK_CONNECTORS, 0);
  if (pipe.writeback == 0 || pipe.panel == 0)
    throw std::runtime_error("the card has no writeback connector, or shows nothing on its panel");
  return pipe;
}

// Commits, and retries while a commit of the program is pending (EBUSY).
void commit(int fd, drmModeAtomicReq* request, const char* what) {
  for (int attempt = 0; attempt < 200; ++attempt) {
    if (drmModeAtomicCommit(fd, request, DRM_MODE_ATOMIC_ALLOW_MODESET, nullptr) == 0) return;
    if (errno != EBUSY) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  throw std::runtime_error(std::string(what) + ": " + std::strerror(errno));
}

// Switches the CRTC to the writeback connector; returns the fence of the written frame.
Descriptor divert(int fd, const Pipe& pipe, const DumbBuffer& buffer) {
  int32_t fence = -1;  // written by the kernel during the commit
  const AtomicRequest request(drmModeAtomicAlloc());
  const auto add = [&](uint32_t connector, const char* name, uint64_t value) {
    assign(fd, request.get(), connector, DRM_MODE_OBJECT_CONNECTOR, name, value);
  };
  add(pipe.panel, "CRTC_ID", 0);
  add(pipe.writeback, "CRTC_ID", pipe.crtc);
  add(pipe.writeback, "WRITEBACK_FB_ID", buffer.framebuffer());
  add(pipe.writeback, "WRITEBACK_OUT_FENCE_PTR", reinterpret_cast<uintptr_t>(&fence));
  commit(fd, request.get(), "cannot attach the writeback connector");
  return Descriptor(fence);
}

void restore(int fd, const Pipe& pipe) {
  const AtomicRequest request(drmModeAtomicAlloc());
  assign(fd, request.get(), pipe.writeback, DRM_MODE_OBJECT_CONNECTOR, "CRTC_ID", 0);
  assign(fd, request.get(), pipe.panel, DRM_MODE_OBJECT_CONNECTOR, "CRTC_ID", pipe.crtc);
  commit(fd, request.get(), "cannot attach the panel again");
}

void capture_into(int fd, const Pipe& pipe, const DumbBuffer& buffer) {
  const Descriptor fence = divert(fd, pipe, buffer);
  pollfd waiting{fence.get(), POLLIN, 0};
  const bool written = poll(&waiting, 1, 20000) == 1;
  restore(fd, pipe);
  if (!written) throw std::runtime_error("no frame was written back within 20 s");
}

Ppm picture_of(DumbBuffer& buffer) {
  Ppm picture{buffer.width(), buffer.height(), {}};
  picture.rgb.reserve(static_cast<size_t>(picture.width) * picture.height * 3);
  for (uint32_t y = 0; y < buffer.height(); ++y) {
    const std::span<uint8_t> row = buffer.row(y);
    for (size_t x = 0; x < row.size(); x += 4)
      for (size_t channel : {2, 1, 0}) picture.rgb.push_back(static_cast<char>(row[x + channel]));
  }
  return picture;
}

void capture(int pid, const std::string& path) {
  const Descriptor card = card_of(pid);
  const Pipe pipe = find_pipe(card.get());
  DumbBuffer buffer(card.get(), pipe.width, pipe.height);
  capture_into(card.get(), pipe, buffer);
  write_ppm(path, picture_of(buffer));
}

}  // namespace
}  // namespace lenticule::vm

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "vm_writeback_capture PID PPM\n");
    return 2;
  }
  try {
    lenticule::vm::capture(std::stoi(argv[1]), argv[2]);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "vm_writeback_capture: %s\n", error.what());
    return 1;
  }
}
