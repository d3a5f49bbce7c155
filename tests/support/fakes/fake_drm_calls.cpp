// SPDX-License-Identifier: Apache-2.0
// Implements libdrm's functions that change state: mastership, commits, buffers, vblanks. This file
// and fake_drm_objects.cpp implement every function that display/kms calls.
#include <drm_fourcc.h>
#include <xf86drm.h>
#include <xf86drmMode.h>

#include <array>
#include <type_traits>

#include "fake_drm_internal.h"

using namespace lenticule::test;

namespace {

/// Returns 0 if the driver counts vblanks and this CRTC runs; errno otherwise.
int check_counting(FakeCard* card, uint32_t crtc) {
  if (card == nullptr) return ENODEV;
  return card->counts_vblanks && card->value(crtc, "ACTIVE") == 1 ? 0 : EOPNOTSUPP;
}

}  // namespace

/// The values of a ramp, which newer versions of libdrm take as constants.
template <class Value>
Value& value_of(int (*)(int, uint32_t, uint32_t, Value*, Value*, Value*));
using RampValue = std::remove_reference_t<decltype(value_of(drmModeCrtcSetGamma))>;

extern "C" {

struct _drmModeAtomicReq {
  std::vector<std::array<uint64_t, 3>> settings;
};

int drmIsMaster(int fd) {
  FakeCard* card = card_of(fd);
  return card != nullptr && card->master_fd == fd ? 1 : 0;
}
int drmSetMaster(int fd) {
  FakeCard* card = card_of(fd);
  if (card == nullptr || card->foreign_master) {
    errno = EBUSY;
    return -1;
  }
  card->master_fd = fd;
  return 0;
}
int drmDropMaster(int fd) {
  if (FakeCard* card = card_of(fd); card != nullptr && card->master_fd == fd) card->master_fd = -1;
  return 0;
}

int drmModeCreatePropertyBlob(int fd, const void* data, size_t size, uint32_t* id) {
  FakeCard* card = card_of(fd);
  if (card == nullptr) return -ENODEV;
  const auto* bytes = static_cast<const uint8_t*>(data);
  *id = card->add_blob({bytes, bytes + size});
  return 0;
}
int drmModeDestroyPropertyBlob(int fd, uint32_t id) {
  (void)fd;  // the state keeps its own reference
  (void)id;
  return 0;
}

int drmModeCrtcSetGamma(int fd, uint32_t crtc, uint32_t size, RampValue* red, RampValue* green,
                        RampValue* blue) {
  FakeCard* card = card_of(fd);
  if (const int error = begin_call(card, &FakeCard::set_gamma_faults); error != 0) return error;
  if (card->master_fd != fd || card->foreign_master) return -EACCES;
  const auto ramp = card->ramps.find(crtc);
  if (ramp == card->ramps.end()) return -ENOSYS;
  if (ramp->second.red.size() != size) return -EINVAL;
  ramp->second = {{red, red + size}, {green, green + size}, {blue, blue + size}};
  return 0;
}

drmModeAtomicReqPtr drmModeAtomicAlloc(void) { return new _drmModeAtomicReq; }
void drmModeAtomicFree(drmModeAtomicReqPtr request) { delete request; }
void drmModeAtomicSetCursor(drmModeAtomicReqPtr request, int cursor) {
  request->settings.resize(static_cast<size_t>(cursor));
}
int drmModeAtomicAddProperty(drmModeAtomicReqPtr request, uint32_t object, uint32_t property,
                             uint64_t value) {
  request->settings.push_back({object, property, value});
  return static_cast<int>(request->settings.size());
}
int drmModeAtomicCommit(int fd, const drmModeAtomicReqPtr request, uint32_t flags,
                        void* user_data) {
  FakeCard* card = card_of(fd);
  if (card == nullptr) return -ENODEV;
  if (card->master_fd != fd) return -EACCES;
  return card->commit(request->settings, flags, reinterpret_cast<uintptr_t>(user_data));
}

int drmModeCreateDumbBuffer(int fd, uint32_t width, uint32_t height, uint32_t bpp, uint32_t flags,
                            uint32_t* handle, uint32_t* pitch, uint64_t* size) {
  (void)bpp;
  (void)flags;
  FakeCard* card = card_of(fd);
  if (const int error = begin_call(card, &FakeCard::create_faults); error != 0) return error;
  if (card->buffers.size() >= card->max_buffers) return -ENOMEM;
  *handle = card->next_id++;
  *pitch = (width * 4 + 63) / 64 * 64;
  *size = uint64_t{*pitch} * height;
  card->buffers[*handle] = {.width = width, .height = height, .pitch = *pitch};
  card->buffers[*handle].bytes.assign(*size, 0xcd);  // an old picture of another program
  return 0;
}
int drmModeDestroyDumbBuffer(int fd, uint32_t handle) {
  FakeCard* card = card_of(fd);
  return card != nullptr && card->buffers.erase(handle) == 1 ? 0 : -ENOENT;
}
int drmModeMapDumbBuffer(int fd, uint32_t handle, uint64_t* offset) {
  FakeCard* card = card_of(fd);
  if (const int error = begin_call(card, &FakeCard::map_faults); error != 0) return error;
  if (card->buffers.count(handle) == 0) return -ENOENT;
  *offset = uint64_t{handle} << 32;
  return 0;
}
int drmModeAddFB2(int fd, uint32_t width, uint32_t height, uint32_t format,
                  const uint32_t handles[4], const uint32_t pitches[4], const uint32_t offsets[4],
                  uint32_t* id, uint32_t flags) {
  (void)pitches;
  (void)offsets;
  (void)flags;
  FakeCard* card = card_of(fd);
  if (card == nullptr) return -ENODEV;
  const bool known =
      std::find(card->formats.begin(), card->formats.end(), format) != card->formats.end();
  if (!known || card->buffers.count(handles[0]) == 0) return -EINVAL;
  *id = card->next_id++;
  card->framebuffers[*id] = {handles[0], width, height, format};
  return 0;
}
int drmModeRmFB(int fd, uint32_t id) {
  FakeCard* card = card_of(fd);
  if (card == nullptr) return -ENODEV;
  for (const auto& [crtc, plane] : card->primary_planes)
    if (card->value(plane, "FB_ID") == id && card->value(crtc, "ACTIVE") == 1)
      ++card->rmfb_on_screen;
  return card->framebuffers.erase(id) == 1 ? 0 : -ENOENT;
}

int drmCrtcGetSequence(int fd, uint32_t crtc, uint64_t* sequence, uint64_t* ns) {
  FakeCard* card = card_of(fd);
  if (errno = check_counting(card, crtc); errno != 0) return -1;
  const auto now = FakeDrm::instance().now();
  *sequence = card->sequence_at(now);
  *ns = static_cast<uint64_t>(now.count() / card->period.count() * card->period.count());
  return 0;
}
int drmCrtcQueueSequence(int fd, uint32_t crtc, uint32_t flags, uint64_t sequence, uint64_t* queued,
                         uint64_t user_data) {
  (void)flags;
  FakeCard* card = card_of(fd);
  if (errno = check_counting(card, crtc); errno != 0) return -1;
  *queued = std::max(sequence, card->sequence_at(FakeDrm::instance().now()) + 1);
  card->send_sequence(*queued, user_data);
  return 0;
}

}  // extern "C"
