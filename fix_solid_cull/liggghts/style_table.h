// Tables of the engine's styles: a name that ends with a star stands for all that begin with what is before it.
#pragma once

#include <algorithm>
#include <cstring>
#include <iterator>
#include <string>

namespace solidcull {

inline bool names(const char* name, const std::string& style) {
  const std::size_t n = std::strlen(name);
  return n > 0 && name[n - 1] == '*' ? style.compare(0, n - 1, name, n - 1) == 0 : style == name;
}

/// The row of a style; `unknown` for one that is not in the table.
template <class Row, std::size_t rows>
const Row& row_of(const std::string& style, const Row (&table)[rows], const Row& unknown) {
  const auto* const found = std::find_if(std::begin(table), std::end(table), [&](const Row& r) { return names(r.name, style); });
  return found == std::end(table) ? unknown : *found;
}

}  // namespace solidcull
