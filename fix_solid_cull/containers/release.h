// Gives the memory of scratch back.
#pragma once

namespace solidcull {

/// Each becomes what its default constructor makes of it. (`v = {}` assigns an empty list to a std::vector and keeps its memory.)
template <class... Container>
void release(Container&... scratch) {
  ((scratch = Container()), ...);
}

}  // namespace solidcull
