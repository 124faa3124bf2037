// A file that all ranks write to at once, by MPI-IO; one rank writes it by the system alone: on a rank without mpirun, Open MPI's
// own way complains of a folder that it does not have.
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

class OneRanksFile : public SharedFile {
 public:
  explicit OneRanksFile(const std::string& file);
  ~OneRanksFile() override;
  OneRanksFile(const OneRanksFile&) = delete;

  std::uint64_t size() const override { return size_; }
  void write(std::uint64_t at, const void* from, std::size_t n) override;
  int close() override;

 private:
  int file_, error_ = 0;
  std::uint64_t size_ = 0;
};

}  // namespace solidcull
