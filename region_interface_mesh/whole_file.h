// A file that appears whole or not at all.
#pragma once

#include <cstddef>
#include <cstdio>
#include <string>
#include <string_view>

namespace solidcull {

/// Writes FILE.part and renames it to FILE in commit(); without a commit nothing is left behind.
/// Every member throws std::runtime_error "cannot write FILE: reason" when the system refuses. Local.
class WholeFile {
 public:
  explicit WholeFile(const std::string& file);
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;

  void write(const void* data, std::size_t bytes);
  void write(std::string_view text) { write(text.data(), text.size()); }
  /// Closes FILE.part, so that a library that opens files by name can fill it before commit().
  void close();
  void commit();

  const std::string& part() const { return part_; }
  static std::string part_of(const std::string& file) { return file + ".part"; }
  [[noreturn]] void fail(const std::string& reason) const;

 private:
  std::string file_, part_;
  std::FILE* stream_ = nullptr;
  bool committed_ = false;
};

}  // namespace solidcull
