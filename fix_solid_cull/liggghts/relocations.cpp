#include "relocations.h"

#include <link.h>

#include <cstdint>
#include <cstring>

namespace solidcull {
namespace {

/// One table of relocations. Entries with and without addend (Rela, Rel) begin alike.
struct Table {
  const char* first = nullptr;
  std::size_t bytes = 0, entry = 0;
};

struct Dynamic {
  const ElfW(Sym) * symbols = nullptr;
  const char* names = nullptr;
  Table calls, others;
};

/// The loader speaks of places in numbers.
template <class T>
const T* at_place(std::uintptr_t address) {
  return reinterpret_cast<const T*>(address);  // NOLINT(performance-no-int-to-ptr)
}

bool holds(const dl_phdr_info& object, std::uintptr_t address) {
  for (int p = 0; p < object.dlpi_phnum; ++p) {
    const auto& part = object.dlpi_phdr[p];
    const std::uintptr_t from = object.dlpi_addr + part.p_vaddr;
    if (part.p_type == PT_LOAD && address >= from && address < from + part.p_memsz) return true;
  }
  return false;
}

Dynamic dynamic_of(const dl_phdr_info& object) {
  const ElfW(Dyn)* entry = nullptr;
  for (int p = 0; p < object.dlpi_phnum; ++p)
    if (object.dlpi_phdr[p].p_type == PT_DYNAMIC) entry = at_place<ElfW(Dyn)>(object.dlpi_addr + object.dlpi_phdr[p].p_vaddr);
  Dynamic found;
  if (!entry) return found;
  // some loaders leave addresses as they are in the file
  const auto place = [&](const ElfW(Dyn) & e) {
    const std::uintptr_t at = e.d_un.d_ptr;
    return at_place<char>(at < object.dlpi_addr ? at + object.dlpi_addr : at);
  };
  for (; entry->d_tag != DT_NULL; ++entry) switch (entry->d_tag) {
      case DT_SYMTAB:
        found.symbols = reinterpret_cast<const ElfW(Sym)*>(place(*entry));
        break;
      case DT_STRTAB:
        found.names = place(*entry);
        break;
      case DT_JMPREL:
        found.calls.first = place(*entry);
        break;
      case DT_PLTRELSZ:
        found.calls.bytes = entry->d_un.d_val;
        break;
      case DT_PLTREL:
        found.calls.entry = entry->d_un.d_val == DT_RELA ? sizeof(ElfW(Rela)) : sizeof(ElfW(Rel));
        break;
      case DT_RELA:
      case DT_REL:
        found.others.first = place(*entry);
        break;
      case DT_RELASZ:
      case DT_RELSZ:
        found.others.bytes = entry->d_un.d_val;
        break;
      case DT_RELAENT:
      case DT_RELENT:
        found.others.entry = entry->d_un.d_val;
        break;
      default:
        break;
    }
  return found;
}

struct Search {
  std::uintptr_t inside;
  const char* symbol;
  std::vector<const void*> targets;
};

std::size_t symbol_number(const ElfW(Rel) & relocation) {
  return sizeof(relocation.r_info) == 8 ? static_cast<std::uint64_t>(relocation.r_info) >> 32 : relocation.r_info >> 8;
}

int look_at(dl_phdr_info* object, std::size_t, void* data) {
  auto& search = *static_cast<Search*>(data);
  if (!holds(*object, search.inside)) return 0;
  const Dynamic dynamic = dynamic_of(*object);
  for (const Table& table : {dynamic.calls, dynamic.others}) {
    if (!table.first || !table.entry) continue;
    for (std::size_t at = 0; at + table.entry <= table.bytes; at += table.entry) {
      const auto& relocation = *reinterpret_cast<const ElfW(Rel)*>(table.first + at);
      const std::size_t number = symbol_number(relocation);
      if (number == 0 || std::strcmp(dynamic.names + dynamic.symbols[number].st_name, search.symbol) != 0) continue;
      search.targets.push_back(*at_place<const void*>(object->dlpi_addr + relocation.r_offset));
    }
  }
  return 1;  // no other object is looked at
}

}  // namespace

std::vector<const void*> call_targets(const void* inside, const char* symbol) {
  Search search{reinterpret_cast<std::uintptr_t>(inside), symbol, {}};
  dl_iterate_phdr(look_at, &search);
  return search.targets;
}

}  // namespace solidcull
