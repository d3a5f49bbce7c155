// SPDX-License-Identifier: Apache-2.0
// Tests that the fake implements every call of libdrm that display/kms makes; otherwise the tests
// would depend on the machine's own card. Other libraries may load libdrm, but this program itself
// must not link to it.
#include <gtest/gtest.h>
#include <link.h>

#include <string>

namespace lenticule::test {
namespace {

/// Returns the libraries that the program itself links to.
std::string needed_by(const dl_phdr_info& program) {
  std::string names;
  for (int i = 0; i < program.dlpi_phnum; ++i) {
    if (program.dlpi_phdr[i].p_type != PT_DYNAMIC) continue;
    const auto* const entries =
        reinterpret_cast<const ElfW(Dyn)*>(program.dlpi_addr + program.dlpi_phdr[i].p_vaddr);
    const char* strings = nullptr;
    for (const auto* entry = entries; entry->d_tag != DT_NULL; ++entry)
      if (entry->d_tag == DT_STRTAB) strings = reinterpret_cast<const char*>(entry->d_un.d_ptr);
    for (const auto* entry = entries; entry->d_tag != DT_NULL; ++entry)
      if (entry->d_tag == DT_NEEDED) names += std::string(strings + entry->d_un.d_val) + "\n";
  }
  return names;
}

int keep_first(dl_phdr_info* info, size_t, void* names) {
  *static_cast<std::string*>(names) = needed_by(*info);
  return 1;
}

}  // namespace

TEST(FakeDrm, ImplementsEveryLibdrmCall) {
  std::string needed;
  dl_iterate_phdr(keep_first, &needed);
  EXPECT_NE(needed.find("libc.so"), std::string::npos) << "the list is read wrongly";
  EXPECT_EQ(needed.find("libdrm"), std::string::npos) << needed;
}

}  // namespace lenticule::test
