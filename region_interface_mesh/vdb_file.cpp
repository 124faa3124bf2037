#include "vdb_file.h"

#include <cerrno>
#include <cstring>
#include <exception>
#include <fstream>
#include <string>

#include "whole_file.h"

namespace solidcull {
namespace {

/// OpenVDB's own does not look whether the last bytes arrived: where the disc is full, a short file passes for a whole one.
class Archive : public openvdb::io::Archive {
 public:
  void write_to(std::ostream& stream, const openvdb::GridCPtrVec& grids) const { write(stream, grids, /*seekable=*/true); }
};

}  // namespace

void write_grids(const std::string& file, const openvdb::GridCPtrVec& grids) {
  WholeFile out(file);
  out.close();  // that it can be opened is known now, or the reason why not
  std::ofstream stream(out.part(), std::ios::binary);
  std::string reason;
  errno = 0;
  try {
    Archive().write_to(stream, grids);
  } catch (const std::exception& e) {
    reason = e.what();
  }
  stream.close();
  if (!stream) reason = std::strerror(errno ? errno : EIO);
  if (!reason.empty()) out.fail(reason);
  out.commit();
}

}  // namespace solidcull
