// Outputs: interface meshes and the whole bed.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "bed.h"
#include "body_meshes.h"
#include "report.h"

namespace solidcull {

/// Files are written whole or not at all; one that cannot be written is an InputError on all ranks.
class OutputFiles {
 public:
  OutputFiles(Bed& bed, BodyMeshes& meshes, Report& report) : bed_(bed), meshes_(meshes), report_(report) {}

  /// A run begins: files can be written where they are to be. Collective.
  void begin_run();
  /// What is due at this step, once. Collective.
  void write_due();
  /// The meshes where their bodies are now; see BodyMeshes. Local.
  const std::map<int, InterfaceMesh>& ask_meshes();

 private:
  void write_meshes(const std::string& file);
  void write_bed(const std::string& file);
  std::map<BodyGroups::Key, const InterfaceMesh*> whole_meshes(const std::map<int, InterfaceMesh>& here,
                                                               std::map<BodyGroups::Key, InterfaceMesh>& parts);
  std::string file_of_step(const std::string& pattern) const;
  template <class Write>
  void on_root(const char* keyword, Write write);
  void write_in_parts(const char* keyword, const std::string& file, std::string text, const std::string& begins,
                      const std::string& ends);

  Bed& bed_;
  BodyMeshes& meshes_;
  Report& report_;
  std::int64_t written_at_ = -1;  // a step of the deck
  std::set<std::string> said_;    // of files that are written over
};

}  // namespace solidcull
