// Files for ParaView and other viewers. Every file is written whole or not at all: to FILE.part first, then renamed.
#pragma once

#include <string>
#include <vector>

#include "interface_mesh.h"

namespace solidcull {

/// Throws std::runtime_error, as the writers would, where the folder of the file is missing or may not be written to. Local.
void check_folder_of(const std::string& file);

/// Binary STL; throws std::runtime_error naming the file and the reason if it cannot be written. Local.
void write_stl(const std::string& file, const TriangleMesh& mesh);

/// VTK XML PolyData of triangles with one cell array "body" (empty, or one value per triangle), Int32 where that holds all
/// values, else Int64. Local.
void write_vtp(const std::string& file, const TriangleMesh& mesh, const std::vector<std::int64_t>& body_of_triangle);

/// OpenVDB file with one level-set grid per mesh, named by `names`. Local.
void write_vdb(const std::string& file, const std::vector<const InterfaceMesh*>& meshes, const std::vector<std::string>& names);

/// State of a granule in a bed file; the numbers stand in the file.
enum class GranuleState : int { exterior = 0, interface_ = 1, interior = 2, waking = 3 };

/// All granules of a bed, stored ones too, as columns of equal length (SI units, world frame).
struct BedTable {
  std::vector<float> position;  // 3 per granule
  std::vector<float> velocity;  // 3 per granule
  std::vector<float> radius;
  std::vector<int> tag, type, state;
  std::vector<std::int64_t> body;  // written as Int32 where that holds all values
};

/// VTK XML PolyData of points (one vertex cell each) with point arrays radius, velocity, tag, type, state, body.
/// Arrays are inline base64 ("binary"), header_type UInt64, uncompressed, little endian.
void write_bed_vtp(const std::string& file, const BedTable& bed);
/// The same in parts, one behind the other: what stands before the first one and behind the last, and a part. Local.
extern const char *const poly_data_begins, *const poly_data_ends;
std::string bed_piece(const BedTable& bed);

}  // namespace solidcull
