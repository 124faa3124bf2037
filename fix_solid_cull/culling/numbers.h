// Motions and forces that are no numbers any more: a time step too large, or granules created one in another. Comparisons with
// such a value are false, so a search would look for it in no cell, and a law would take it for calm.
#pragma once

#include <cstdint>
#include <string>

#include "ports.h"

namespace solidcull {

/// RunFailure: this granule's `what` is no number.
[[noreturn]] void refuse_no_number(std::int64_t tag, const char* what, const Vec3& value);
/// Places and motions of the owned granules are numbers; else RunFailure. Local.
void check_numbers(const Atoms& atoms);

}  // namespace solidcull
