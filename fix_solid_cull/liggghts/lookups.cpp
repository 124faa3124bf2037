#include "lookups.h"

#include <dlfcn.h>
#include <link.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstring>

namespace solidcull {
namespace {

std::uintptr_t number(const void* place) { return reinterpret_cast<std::uintptr_t>(place); }

/// What may be done with the memory of a loaded library at this place.
struct Protection {
  std::uintptr_t place;
  int flags = -1;  // of mmap; -1: no library is there
};

int look_at(dl_phdr_info* object, std::size_t, void* data) {
  auto& found = *static_cast<Protection*>(data);
  for (int p = 0; p < object->dlpi_phnum; ++p) {
    const auto& part = object->dlpi_phdr[p];
    const std::uintptr_t from = object->dlpi_addr + part.p_vaddr;
    if (part.p_type != PT_LOAD || found.place < from || found.place >= from + part.p_memsz) continue;
    found.flags =
        (part.p_flags & PF_R ? PROT_READ : 0) | (part.p_flags & PF_W ? PROT_WRITE : 0) | (part.p_flags & PF_X ? PROT_EXEC : 0);
    return 1;
  }
  return 0;
}

}  // namespace

bool lookups_lead_to(const void* function, const char* name, const void* instead) {
  Dl_info info;
  void* found = nullptr;
  if (!dladdr1(function, &info, &found, RTLD_DL_SYMENT) || !found || info.dli_saddr != function || !info.dli_sname ||
      std::strcmp(info.dli_sname, name) != 0)
    return false;
  auto* const entry = static_cast<ElfW(Sym)*>(found);
  const std::uintptr_t base = number(function) - entry->st_value;
  Protection protection{number(entry)};
  dl_iterate_phdr(look_at, &protection);
  if (protection.flags < 0) return false;
  const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  char* const first = reinterpret_cast<char*>(number(entry) / page * page);  // NOLINT(performance-no-int-to-ptr)
  const std::size_t bytes = number(entry + 1) - number(first);
  if (mprotect(first, bytes, protection.flags | PROT_WRITE) != 0) return false;
  entry->st_value = number(instead) - base;
  mprotect(first, bytes, protection.flags);
  return true;
}

}  // namespace solidcull
