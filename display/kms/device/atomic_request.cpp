// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/atomic_request.h"

#include <cerrno>

#include "base/error.h"

namespace lenticule::display {

AtomicRequest::AtomicRequest() : request_(drmModeAtomicAlloc()) {
  if (!request_) throw Error(ErrorKind::Failed, "kms: no memory for an atomic request");
}

void AtomicRequest::clear() noexcept {
  drmModeAtomicSetCursor(request_.get(), 0);
  complete_ = true;
}

void AtomicRequest::set(const PropertySetting& setting) noexcept {
  if (drmModeAtomicAddProperty(request_.get(), setting.object, setting.property, setting.value) < 0)
    complete_ = false;
}

void AtomicRequest::set(const std::vector<PropertySetting>& settings) noexcept {
  for (const PropertySetting& setting : settings) set(setting);
}

int AtomicRequest::commit(int fd, uint32_t flags, uint64_t user_data) noexcept {
  if (!complete_) return -ENOMEM;
  // libdrm carries the number in a pointer, which is never dereferenced.
  auto* const carried = reinterpret_cast<void*>(static_cast<uintptr_t>(user_data));
  return drmModeAtomicCommit(fd, request_.get(), flags, carried);
}

}  // namespace lenticule::display
