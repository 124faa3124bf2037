// Files for ParaView and other viewers. Every file is written whole or not at all: to FILE.part first, then renamed.
#pragma once

#include <string>
#include <vector>

#include "interface_mesh.h"
#include "poly_data.h"

namespace solidcull {

/// Throws std::runtime_error, as the writers would, where the folder of the file is missing or may not be written to. Local.
void check_folder_of(const std::string& file);

/// Binary STL; throws std::runtime_error naming the file and the reason if it cannot be written. Local.
void write_stl(const std::string& file, const TriangleMesh& mesh);

/// VTK XML PolyData of triangles with one cell array "body" (empty, or one value per triangle), Int32 where that holds all
/// values, else Int64. time: s. Local.
void write_vtp(const std::string& file, const TriangleMesh& mesh, const std::vector<std::int64_t>& body_of_triangle, double time);

/// The same as one piece of several. bodies: null where there is no such array. wide: they are Int64, in all pieces alike. Throws
/// std::runtime_error, naming the file, for more triangles than its 32-bit numbers can count. Local.
PolyDataPiece mesh_piece(const std::string& file, const TriangleMesh& mesh, const std::vector<std::int64_t>* bodies, bool wide);
/// An STL file is a head and so many records, of the whole mesh or of parts. Throws std::runtime_error, naming the file, for more
/// than it can hold. Local.
std::string stl_head(const std::string& file, std::uint64_t triangles);
constexpr std::int64_t stl_head_bytes = 84;
std::string stl_records(const TriangleMesh& mesh);

/// OpenVDB file with one level-set grid per mesh, named by `names`. Local.
void write_vdb(const std::string& file, const std::vector<const InterfaceMesh*>& meshes, const std::vector<std::string>& names);

/// State of a granule in a bed file; the numbers stand in the file.
enum class GranuleState : int { exterior = 0, interface_ = 1, interior = 2, waking = 3 };

/// Granules of a bed, stored ones too, as columns of equal length (SI units, world frame).
struct BedTable {
  std::vector<float> position;  // 3 per granule
  std::vector<float> velocity;  // 3 per granule
  std::vector<float> spin;      // 3 per granule, or none at all
  std::vector<float> radius;
  std::vector<int> id, type, state;
  std::vector<int> awake, woke;  ///< what keeps a granule awake and what woke it: numbers of fix_solid_cull.md, 0 where it sleeps
  std::vector<std::int64_t> body;  // written as Int32 where that holds all values
};

/// Throws std::invalid_argument where the columns differ in length; the writers do this too.
void check_columns(const BedTable& bed);

/// VTK XML PolyData of points (one vertex cell each) with point arrays id, radius, pscale (the same), v, w (the spin, if there is
/// one), type, state, awake, woke, body. time: s. Local.
void write_bed_vtp(const std::string& file, const BedTable& bed, double time);
/// OpenVDB file with one grid of points, "points", that has the same arrays but radius, and the metadata "time" (s). Local.
void write_bed_vdb(const std::string& file, const BedTable& bed, double time);
/// The same as one piece of several; wide: bodies are numbered alike in all of them. Local.
PolyDataPiece bed_piece(const BedTable& bed, bool wide);

}  // namespace solidcull
