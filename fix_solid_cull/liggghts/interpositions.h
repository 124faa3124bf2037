// Whether the engine's calls arrive at what this library puts in their place. Where they do not, culled granules would be missing
// from loads and lists without a word.
#pragma once

#include <string>

namespace solidcull::engine {

/// One line on what keeps this library from working with the engine that it found; empty where nothing does. Local, alike on all
/// ranks.
const std::string& why_not_live();

}  // namespace solidcull::engine
