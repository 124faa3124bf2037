// Outputs: interface meshes and the whole bed.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "bed.h"
#include "body_meshes.h"
#include "mesh_files.h"
#include "report.h"
#include "seams.h"
#include "surface_parts.h"
#include "survey.h"

namespace solidcull {

/// Files are written whole or not at all; one that cannot be written is an InputError on all ranks.
class OutputFiles {
 public:
  OutputFiles(Bed& bed, BodyMeshes& meshes, const Survey& survey, Report& report)
      : bed_(bed), meshes_(meshes), seams_(bed, meshes), survey_(survey), report_(report) {}

  /// A run begins: files can be written where they are to be. Collective.
  void begin_run();
  /// What is due at this step, once. Collective.
  void write_due();
  /// The meshes where their bodies are now; see BodyMeshes. Local.
  const std::map<int, InterfaceMesh>& ask_meshes();

 private:
  void expect(const char* keyword, const std::string& pattern);
  /// Writes one file by `write(name, time)` and notes it in the list of those of its pattern.
  template <class Write>
  void write_one(const char* keyword, const std::string& pattern, Write write);
  void write_meshes(const MeshOutput& output, const std::string& file, double time);
  void write_bed(const BedOutput& output, const std::string& file, double time);
  struct Row;
  std::vector<Row> rows_of_bed(const BedOutput& output) const;
  static BedTable table(const BedOutput& output, std::vector<Row> rows);
  InterfaceMesh skin_of_atoms() const;
  SurfaceParts surfaces(const MeshOutput& output, bool for_each_rank);
  template <class Write>
  void on_root(const char* keyword, Write write);
  template <class Write>
  void on_each(const char* keyword, Write write);
  void write_stl_parts(const std::string& file, const TriangleMesh& mesh);
  void write_pieces(const char* keyword, const std::string& file, double time, const std::function<PolyDataPiece()>& make);
  struct Stretch {
    std::int64_t at;  ///< where it begins in the file
    std::string_view text;
  };
  void write_together(const char* keyword, const std::string& file, const std::vector<Stretch>& stretches);

  Bed& bed_;
  BodyMeshes& meshes_;
  Seams seams_;
  const Survey& survey_;
  Report& report_;
  std::int64_t written_at_ = -1;  // a step of the deck
  std::set<std::string> said_;    // of files that are written over
};

}  // namespace solidcull
