#include "mesh_files.h"

#include <unistd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "poly_data.h"
#include "whole_file.h"

namespace solidcull {

void check_folder_of(const std::string& file) {
  const std::size_t slash = file.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : file.substr(0, slash + 1);
  if (::access(folder.c_str(), W_OK) != 0) throw std::runtime_error("cannot write " + file + ": " + std::strerror(errno));
}

// --- WholeFile --------------------------------------------------------------------------------------------------

WholeFile::WholeFile(const std::string& file) : file_(file), part_(part_of(file)) {
  stream_ = std::fopen(part_.c_str(), "wb");
  if (!stream_) fail(std::strerror(errno));
}

WholeFile::~WholeFile() {
  if (stream_) std::fclose(stream_);
  if (!committed_) std::remove(part_.c_str());
}

void WholeFile::fail(const std::string& reason) const { throw std::runtime_error("cannot write " + file_ + ": " + reason); }

void WholeFile::write(const void* data, std::size_t bytes) {
  if (bytes > 0 && std::fwrite(data, 1, bytes, stream_) != bytes) fail(std::strerror(errno));
}

void WholeFile::close() {
  std::FILE* stream = stream_;
  stream_ = nullptr;
  // A full disc often shows only here, when the buffer is flushed.
  if (stream && std::fclose(stream) != 0) fail(std::strerror(errno));
}

void WholeFile::commit() {
  close();
  if (std::rename(part_.c_str(), file_.c_str()) != 0) fail(std::strerror(errno));
  committed_ = true;
}

// --- the files --------------------------------------------------------------------------------------------------

std::string stl_head(const std::string& file, std::uint64_t triangles) {
  if (triangles > std::numeric_limits<std::uint32_t>::max())
    throw std::runtime_error("cannot write " + file + ": " + std::to_string(triangles) +
                             " triangles are more than an STL file can hold");
  std::string head("solidcull interface mesh, lengths in m");
  head.resize(80, '\0');
  const auto count = static_cast<std::uint32_t>(triangles);
  return head.append(reinterpret_cast<const char*>(&count), sizeof count);
}

std::string stl_records(const TriangleMesh& mesh) {
  constexpr std::size_t record = 50;  // normal, three corners, and two bytes that no one uses
  std::string all(record * mesh.triangles.size(), '\0');
  char* at = all.data();
  for (const auto& t : mesh.triangles) {
    const Vec3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    const Vec3 area = (b - a).cross(c - a);
    const double size = area.norm();
    const Vec3 normal = size > 0 ? Vec3(area / size) : Vec3(Vec3::Zero());
    float number[12];
    for (int d = 0; d < 3; ++d) {
      number[d] = static_cast<float>(normal[d]);
      number[3 + d] = static_cast<float>(a[d]);
      number[6 + d] = static_cast<float>(b[d]);
      number[9 + d] = static_cast<float>(c[d]);
    }
    std::memcpy(at, number, sizeof number);
    at += record;
  }
  return all;
}

namespace {

/// On many ranks bodies have numbers that an Int32 does not hold.
void add_numbers_of_bodies(PolyDataPiece& piece, const std::vector<std::int64_t>& body, bool wide) {
  wide = wide || std::any_of(body.begin(), body.end(), [](std::int64_t b) { return b != static_cast<int>(b); });
  if (wide)
    piece.add("body", body);
  else
    piece.add("body", std::vector<int>(body.begin(), body.end()));
}

void write_poly_data(const std::string& file, const PolyDataPiece& piece, double time) {
  WholeFile out(file);
  out.write(poly_data_begins(time));
  out.write(piece.head(0));
  out.write(poly_data_middle);
  out.write(piece.data());
  out.write(poly_data_ends);
  out.commit();
}

}  // namespace

void write_stl(const std::string& file, const TriangleMesh& mesh) {
  WholeFile out(file);
  out.write(stl_head(file, mesh.triangles.size()));
  out.write(stl_records(mesh));
  out.commit();
}

PolyDataPiece mesh_piece(const std::string& file, const TriangleMesh& mesh, const std::vector<std::int64_t>* bodies, bool wide) {
  if (bodies && bodies->size() != mesh.triangles.size())
    throw std::invalid_argument("a file of triangles: " + std::to_string(bodies->size()) + " body numbers for " +
                                std::to_string(mesh.triangles.size()) + " triangles");
  if (mesh.triangles.size() > std::numeric_limits<int>::max() / 3)
    throw std::runtime_error("cannot write " + file + ": " + std::to_string(mesh.triangles.size()) +
                             " triangles are more than its 32-bit numbers can count");
  std::vector<float> position;
  position.reserve(3 * mesh.vertices.size());
  for (const Vec3& v : mesh.vertices)
    for (int d = 0; d < 3; ++d) position.push_back(static_cast<float>(v[d]));
  std::vector<int> connectivity;
  connectivity.reserve(3 * mesh.triangles.size());
  for (const auto& t : mesh.triangles)
    for (const std::uint32_t corner : t) connectivity.push_back(static_cast<int>(corner));

  PolyDataPiece piece(mesh.vertices.size(), 0, mesh.triangles.size());
  if (bodies) {
    piece.begin("CellData Scalars=\"body\"");
    add_numbers_of_bodies(piece, *bodies, wide);
  }
  piece.begin("Points");
  piece.add("Points", position, 3);
  piece.add_cells("Polys", connectivity, 3);
  return piece;
}

void write_vtp(const std::string& file, const TriangleMesh& mesh, const std::vector<std::int64_t>& body_of_triangle,
               double time) {
  write_poly_data(file, mesh_piece(file, mesh, body_of_triangle.empty() ? nullptr : &body_of_triangle, false), time);
}

void check_columns(const BedTable& bed) {
  const std::size_t n = bed.radius.size();
  const bool whole = bed.position.size() == 3 * n && bed.velocity.size() == 3 * n && bed.id.size() == n && bed.type.size() == n &&
                     bed.state.size() == n && bed.awake.size() == n && bed.woke.size() == n && bed.body.size() == n &&
                     (bed.spin.empty() || bed.spin.size() == 3 * n);
  if (!whole) throw std::invalid_argument("a bed file: the columns of the bed differ in length");
}

PolyDataPiece bed_piece(const BedTable& bed, bool wide) {
  check_columns(bed);
  const std::size_t n = bed.radius.size();
  std::vector<int> connectivity(n);
  std::iota(connectivity.begin(), connectivity.end(), 0);

  PolyDataPiece piece(n, n, 0);
  piece.begin("PointData Scalars=\"state\" Vectors=\"v\"");
  piece.add("id", bed.id);
  piece.add("radius", bed.radius);
  piece.again("pscale");
  piece.add("v", bed.velocity, 3);
  if (!bed.spin.empty()) piece.add("w", bed.spin, 3);
  piece.add("type", bed.type);
  piece.add("state", bed.state);
  piece.add("awake", bed.awake);
  piece.add("woke", bed.woke);
  add_numbers_of_bodies(piece, bed.body, wide);
  piece.begin("Points");
  piece.add("Points", bed.position, 3);
  piece.add_cells("Verts", connectivity, 1);
  return piece;
}

void write_bed_vtp(const std::string& file, const BedTable& bed, double time) {
  write_poly_data(file, bed_piece(bed, false), time);
}

}  // namespace solidcull
