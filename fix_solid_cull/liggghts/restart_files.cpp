#include "restart_files.h"

#include <fcntl.h>
#include <mpi.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>

#include "comm.h"
#include "deck_commands.h"
#include "error.h"
#include "fix.h"
#include "fix_solid_cull.h"
#include "lammps.h"
#include "modify.h"

namespace solidcull {
namespace {

namespace fs = std::filesystem;

constexpr const char* unfinished = ".part.";

std::map<const LAMMPS_NS::LAMMPS*, std::string> files_read;

/// With another word in place of a character; as it is, where it has none.
std::string replaced(const std::string& name, char character, const std::string& by) {
  const std::size_t at = name.find(character);
  return at == std::string::npos ? name : name.substr(0, at) + by + name.substr(at + 1);
}

/// The name of a file that is not whole yet, beside it: no pattern that means the file means this one.
std::string unfinished_name(const std::string& name) {
  const std::size_t file = name.find_last_of('/') + 1;  // 0 where there is no folder
  return name.substr(0, file) + unfinished + name.substr(file);
}

/// A file, or the names in a folder, are on the disk, whatever becomes of the machine. An errno, or 0.
int to_disk(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY);
  if (file < 0) return errno;
  const int error = ::fsync(file) == 0 || errno == EINVAL || errno == EROFS ? 0 : errno;  // some file systems know no fsync
  ::close(file);
  return error;
}

/// Of all files that the name with its * may mean, the one with the highest number, as the engine chooses it.
std::string highest(const std::string& name) {
  const fs::path pattern(name);
  const std::string file = pattern.filename().string();
  const std::size_t star = file.find('*');
  if (star == std::string::npos) return name;
  const std::string before = file.substr(0, star), after = file.substr(star + 1);
  std::error_code none;
  long long best = -1;
  for (const fs::directory_entry& entry : fs::directory_iterator(pattern.has_parent_path() ? pattern.parent_path() : ".", none)) {
    const std::string there = entry.path().filename().string();
    if (there.compare(0, before.size(), before) != 0) continue;
    const std::size_t end = after.empty() ? there.size() : there.find(after, before.size());
    if (end == std::string::npos) continue;
    best = std::max(best, std::atoll(there.substr(before.size(), end - before.size()).c_str()));
  }
  return best < 0 ? std::string() : replaced(name, '*', std::to_string(best));
}

/// Some fixes write files of their own beside the restart file, named after it.
bool has_companions(const LAMMPS_NS::Modify& modify) {
  return std::any_of(modify.fix, modify.fix + modify.nfix, [](const LAMMPS_NS::Fix* f) { return f->restart_file != 0; });
}

}  // namespace

RestartFile::RestartFile(LAMMPS_NS::LAMMPS* lmp, const char* name)
    : lmp_(lmp), fix_(fix_of(lmp)), name_(name), part_(fix_ && !has_companions(*lmp->modify) ? unfinished_name(name_) : name_) {}

void RestartFile::finish() {
  if (!fix_) return;
  fix_->append_restart(replaced(part_, '%', "base"));
  if (part_ == name_) return;
  const int me = lmp_->comm->me;
  int failed = 0, anywhere = 0;
  const auto takes_its_name = [&](const std::string& which) {
    const std::string part = replaced(part_, '%', which), name = replaced(name_, '%', which);
    failed = to_disk(part);
    if (!failed && std::rename(part.c_str(), name.c_str()) != 0) failed = errno;
  };
  if (name_.find('%') != std::string::npos) takes_its_name(std::to_string(me));
  MPI_Barrier(lmp_->world);  // the head last: without it nothing reads the others
  if (me == 0) takes_its_name("base");
  const fs::path folder = fs::path(name_).parent_path();
  if (me == 0) to_disk(folder.empty() ? "." : folder.string());  // the name; the file is there by any of its two names
  MPI_Allreduce(&failed, &anywhere, 1, MPI_INT, MPI_MAX, lmp_->world);
  if (!anywhere) return;
  const std::string line = "the restart file " + name_ + " could not take its name (" + std::strerror(anywhere) +
                           "): it is there as " + part_ + "; rename it";
  lmp_->error->all(FLERR, line.c_str());
}

void remember_read(LAMMPS_NS::LAMMPS* lmp, const std::string& name) {
  if (lmp->comm->me != 0) return;
  const std::string file = replaced(highest(replaced(name, '%', "base")), '%', "base");
  std::error_code none;
  files_read[lmp] = file.empty() ? file : fs::absolute(file, none).string();
}

std::string file_that_was_read(const LAMMPS_NS::LAMMPS* lmp) {
  const auto found = files_read.find(lmp);
  return found == files_read.end() ? "" : found->second;
}

}  // namespace solidcull
