// How a loaded library reaches a function that others may put theirs in place of: read from its relocations. ELF; knows no
// engine.
#pragma once

#include <vector>

namespace solidcull {

/// Where the calls of `symbol` lead that are made by the loaded object with `inside` in it (any address of its code or data); for
/// calls that were never made yet, an address in the object's own table of calls. Empty: its linker has bound them, and none can
/// be redirected. Local.
std::vector<const void*> call_targets(const void* inside, const char* symbol);

}  // namespace solidcull
