// A file that all ranks write to at once, by MPI-IO.
#pragma once

#include <mpi.h>

#include <string>

#include "ports.h"

namespace solidcull {

class MpiFile : public SharedFile {
 public:
  /// Collective, as is its end.
  MpiFile(MPI_Comm ranks, const std::string& file);
  ~MpiFile() override;
  MpiFile(const MpiFile&) = delete;

  std::uint64_t size() const override { return size_; }
  void write(std::uint64_t at, const void* from, std::size_t n) override;
  int close() override;

 private:
  void note(int result);

  MPI_File file_ = MPI_FILE_NULL;
  std::uint64_t size_ = 0;
  int error_ = 0;  // an errno
};

}  // namespace solidcull
