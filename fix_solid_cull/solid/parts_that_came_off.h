// Which granules hang together no longer after some contacts of a body were cut. Searches start at all cut places at once and
// take turns, so that it costs the smaller parts, and go on as one where they meet. Those that do not meet at once lie on two
// sides of what was carved, connected around it or not at all: they make for each other, nearest first, for what lies around a
// hole has the size of its rim, and in the width of a search that of its volume. Local to the rank.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "frozen_contacts.h"
#include "sphere.h"

namespace solidcull {

/// The parts that are closed, smallest first or nearly so; what is left, the last and largest part, is not among them. `cut`:
/// members that lost a contact, each once. is_member(tag): of a body. place(tag): its centre in the body's frame (m).
std::vector<std::vector<std::int64_t>> parts_that_came_off(const std::vector<std::int64_t>& cut, const FrozenContacts& contacts,
                                                           const std::function<bool(std::int64_t)>& is_member,
                                                           const std::function<Vec3(std::int64_t)>& place);

}  // namespace solidcull
