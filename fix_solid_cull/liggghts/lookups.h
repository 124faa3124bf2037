// Programs look functions up in a loaded library (dlsym): which they find. ELF; knows no engine.
#pragma once

namespace solidcull {

/// From now on whoever looks `name` up in the library that defines `function` finds `instead`. False, and nothing has happened,
/// where the library does not say so, or the system does not let its table of symbols be written. Local.
bool lookups_lead_to(const void* function, const char* name, const void* instead);

}  // namespace solidcull
