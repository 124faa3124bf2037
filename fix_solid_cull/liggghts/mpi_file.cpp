#include "mpi_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

namespace solidcull {
namespace {

constexpr std::size_t at_once = std::size_t{1} << 30;  // MPI counts bytes in ints

/// What the system would call it.
int errno_of(int result) {
  int kind = MPI_ERR_OTHER;
  MPI_Error_class(result, &kind);
  switch (kind) {
    case MPI_SUCCESS:
      return 0;
    case MPI_ERR_NO_SPACE:
      return ENOSPC;
    case MPI_ERR_QUOTA:
      return EDQUOT;
    case MPI_ERR_NO_SUCH_FILE:
      return ENOENT;
    case MPI_ERR_ACCESS:
      return EACCES;
    case MPI_ERR_READ_ONLY:
      return EROFS;
    case MPI_ERR_BAD_FILE:
      return ENOENT;
    default:
      return EIO;
  }
}

}  // namespace

MpiFile::MpiFile(MPI_Comm ranks, const std::string& file) {
  note(MPI_File_open(ranks, file.c_str(), MPI_MODE_WRONLY, MPI_INFO_NULL, &file_));
  int me = 0;
  MPI_Comm_rank(ranks, &me);
  MPI_Offset size = 0;
  if (me == 0 && file_ != MPI_FILE_NULL) note(MPI_File_get_size(file_, &size));
  // what others see of what the first has written may lag behind
  MPI_Bcast(&size, 1, MPI_OFFSET, 0, ranks);
  size_ = static_cast<std::uint64_t>(size);
  // all have it, or none
  MPI_Allreduce(MPI_IN_PLACE, &error_, 1, MPI_INT, MPI_MAX, ranks);
  if (error_) file_ = MPI_FILE_NULL;
}

MpiFile::~MpiFile() {
  if (file_ != MPI_FILE_NULL) MPI_File_close(&file_);
}

void MpiFile::note(int result) {
  if (result != MPI_SUCCESS && error_ == 0) error_ = errno_of(result);
}

void MpiFile::write(std::uint64_t at, const void* from, std::size_t n) {
  for (const char* bytes = static_cast<const char*>(from); n > 0 && error_ == 0;) {
    const std::size_t some = std::min(n, at_once);
    MPI_Status status;
    note(MPI_File_write_at(file_, static_cast<MPI_Offset>(at), bytes, static_cast<int>(some), MPI_BYTE, &status));
    int written = 0;
    if (error_ == 0) MPI_Get_count(&status, MPI_BYTE, &written);
    if (error_ == 0 && written != static_cast<int>(some)) error_ = ENOSPC;  // a disk that is full takes a part
    at += some;
    bytes += some;
    n -= some;
  }
}

int MpiFile::close() {
  if (file_ == MPI_FILE_NULL) return error_;
  note(MPI_File_sync(file_));
  note(MPI_File_close(&file_));
  file_ = MPI_FILE_NULL;
  return error_;
}

OneRanksFile::OneRanksFile(const std::string& file) : file_(::open(file.c_str(), O_WRONLY)) {
  struct stat there {};
  if (file_ < 0 || ::fstat(file_, &there) != 0) error_ = errno;
  size_ = static_cast<std::uint64_t>(there.st_size);
}

OneRanksFile::~OneRanksFile() {
  if (file_ >= 0) ::close(file_);
}

void OneRanksFile::write(std::uint64_t at, const void* from, std::size_t n) {
  for (const char* bytes = static_cast<const char*>(from); n > 0 && error_ == 0;) {
    const ssize_t written = ::pwrite(file_, bytes, n, static_cast<off_t>(at));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      error_ = written < 0 ? errno : ENOSPC;
      return;
    }
    at += static_cast<std::uint64_t>(written);
    bytes += written;
    n -= static_cast<std::size_t>(written);
  }
}

int OneRanksFile::close() {
  if (error_ == 0 && ::fsync(file_) != 0 && errno != EINVAL && errno != EROFS) error_ = errno;  // some know no fsync
  if (file_ >= 0 && ::close(file_) != 0 && error_ == 0) error_ = errno;
  file_ = -1;
  return error_;
}

}  // namespace solidcull
