#include "mesh_files.h"

#include <unistd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "whole_file.h"

namespace solidcull {

const char* const poly_data_begins =
    "<?xml version=\"1.0\"?>\n"
    "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
    "  <PolyData>\n";
const char* const poly_data_ends = "  </PolyData>\n</VTKFile>\n";

static_assert(sizeof(float) == 4 && sizeof(int) == 4, "the files hold 32-bit numbers");

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

namespace {

// --- base64, as VTK reads it ----------------------------------------------------------------------------------------

/// What is written to, where it is no file.
struct Text {
  std::string all;
  void write(std::string_view more) { all += more; }
};

/// Encodes a stream of bytes piece by piece; VTK wants the length and the data of an array in one such stream.
template <class To>
class Base64 {
 public:
  explicit Base64(To& file) : file_(file) { text_.reserve(flush_at + 4); }

  void put(const void* data, std::size_t bytes) {
    const auto* byte = static_cast<const unsigned char*>(data);
    for (std::size_t n = 0; n < bytes; ++n) {
      group_[filled_++] = byte[n];
      if (filled_ == 3) put_group();
    }
  }

  void end() {
    if (filled_ > 0) {
      const int missing = 3 - filled_;
      std::fill(group_ + filled_, group_ + 3, 0);
      put_group();
      std::fill(text_.end() - missing, text_.end(), '=');
    }
    flush();
  }

 private:
  static constexpr std::size_t flush_at = 1 << 16;

  void put_group() {
    static constexpr char digit[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const std::uint32_t bits = group_[0] << 16 | group_[1] << 8 | group_[2];
    for (const int shift : {18, 12, 6, 0}) text_ += digit[bits >> shift & 63];
    filled_ = 0;
    // end() pads the last group, so that group must still be here.
    if (text_.size() >= flush_at) pending_flush();
  }
  void pending_flush() {
    file_.write(std::string_view(text_).substr(0, text_.size() - 4));
    text_.erase(0, text_.size() - 4);
  }
  void flush() {
    file_.write(text_);
    text_.clear();
  }

  To& file_;
  std::string text_;
  unsigned char group_[3] = {};
  int filled_ = 0;
};

template <class T>
constexpr const char* vtk_type();
template <>
constexpr const char* vtk_type<float>() {
  return "Float32";
}
template <>
constexpr const char* vtk_type<int>() {
  return "Int32";
}
template <>
constexpr const char* vtk_type<std::int64_t>() {
  return "Int64";
}

template <class To, class T>
void write_array(To& file, const std::string& name, const std::vector<T>& values, int components = 1) {
  file.write(std::string("        <DataArray type=\"") + vtk_type<T>() + "\" Name=\"" + name + "\" NumberOfComponents=\"" +
             std::to_string(components) + "\" format=\"binary\">");
  Base64<To> encoded(file);
  const std::uint64_t bytes = values.size() * sizeof(T);
  encoded.put(&bytes, sizeof bytes);
  encoded.put(values.data(), bytes);
  encoded.end();
  file.write("</DataArray>\n");
}

/// On many ranks bodies have numbers that an Int32 does not hold.
template <class To>
void write_numbers_of_bodies(To& file, const std::vector<std::int64_t>& body) {
  const bool narrow = std::all_of(body.begin(), body.end(), [](std::int64_t b) { return b == static_cast<int>(b); });
  if (narrow)
    write_array(file, "body", std::vector<int>(body.begin(), body.end()));
  else
    write_array(file, "body", body);
}

template <class To>
void begin_piece(To& file, std::size_t points, std::size_t verts, std::size_t polys) {
  file.write("    <Piece NumberOfPoints=\"" + std::to_string(points) + "\" NumberOfVerts=\"" + std::to_string(verts) +
             "\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"" + std::to_string(polys) + "\">\n");
}

template <class To>
void end_piece(To& file) {
  file.write("    </Piece>\n");
}

template <class To>
void write_points(To& file, const std::vector<float>& position) {
  file.write("      <Points>\n");
  write_array(file, "Points", position, 3);
  file.write("      </Points>\n");
}

/// Cells of equal size: their point indices one after another, and where each cell ends.
template <class To>
void write_cells(To& file, const std::string& kind, const std::vector<std::int64_t>& connectivity, int size) {
  std::vector<std::int64_t> ends(connectivity.size() / size);
  for (std::size_t n = 0; n < ends.size(); ++n) ends[n] = static_cast<std::int64_t>(n + 1) * size;
  file.write("      <" + kind + ">\n");
  write_array(file, "connectivity", connectivity);
  write_array(file, "offsets", ends);
  file.write("      </" + kind + ">\n");
}

}  // namespace

// --- the files --------------------------------------------------------------------------------------------------

void write_stl(const std::string& file, const TriangleMesh& mesh) {
  WholeFile out(file);
  if (mesh.triangles.size() > std::numeric_limits<std::uint32_t>::max())
    out.fail(std::to_string(mesh.triangles.size()) + " triangles are more than an STL file can hold");
  char header[80] = "solidcull interface mesh, lengths in m";
  out.write(header, sizeof header);
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  out.write(&count, sizeof count);
  for (const auto& t : mesh.triangles) {
    const Vec3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    const Vec3 area = (b - a).cross(c - a);
    const double size = area.norm();
    const Vec3 normal = size > 0 ? Vec3(area / size) : Vec3(Vec3::Zero());
    char record[50] = {};  // normal, three corners, and two bytes that no one uses
    float number[12];
    for (int d = 0; d < 3; ++d) {
      number[d] = static_cast<float>(normal[d]);
      number[3 + d] = static_cast<float>(a[d]);
      number[6 + d] = static_cast<float>(b[d]);
      number[9 + d] = static_cast<float>(c[d]);
    }
    std::memcpy(record, number, sizeof number);
    out.write(record, sizeof record);
  }
  out.commit();
}

void write_vtp(const std::string& file, const TriangleMesh& mesh, const std::vector<std::int64_t>& body_of_triangle) {
  if (!body_of_triangle.empty() && body_of_triangle.size() != mesh.triangles.size())
    throw std::invalid_argument("write_vtp: " + std::to_string(body_of_triangle.size()) + " body numbers for " +
                                std::to_string(mesh.triangles.size()) + " triangles");
  std::vector<float> position;
  position.reserve(3 * mesh.vertices.size());
  for (const Vec3& v : mesh.vertices)
    for (int d = 0; d < 3; ++d) position.push_back(static_cast<float>(v[d]));
  std::vector<std::int64_t> connectivity;
  connectivity.reserve(3 * mesh.triangles.size());
  for (const auto& t : mesh.triangles) connectivity.insert(connectivity.end(), t.begin(), t.end());

  WholeFile out(file);
  out.write(poly_data_begins);
  begin_piece(out, mesh.vertices.size(), 0, mesh.triangles.size());
  if (!body_of_triangle.empty()) {
    out.write("      <CellData Scalars=\"body\">\n");
    write_numbers_of_bodies(out, body_of_triangle);
    out.write("      </CellData>\n");
  }
  write_points(out, position);
  write_cells(out, "Polys", connectivity, 3);
  end_piece(out);
  out.write(poly_data_ends);
  out.commit();
}

namespace {

/// wide: bodies are numbered alike in all parts of a file.
template <class To>
void write_bed_piece(To& out, const BedTable& bed, bool wide) {
  const std::size_t n = bed.radius.size();
  const bool whole = bed.position.size() == 3 * n && bed.velocity.size() == 3 * n && bed.tag.size() == n &&
                     bed.type.size() == n && bed.state.size() == n && bed.body.size() == n;
  if (!whole) throw std::invalid_argument("a bed file: the columns of the bed differ in length");
  std::vector<std::int64_t> connectivity(n);
  std::iota(connectivity.begin(), connectivity.end(), 0);

  begin_piece(out, n, n, 0);
  out.write("      <PointData Scalars=\"state\" Vectors=\"velocity\">\n");
  write_array(out, "radius", bed.radius);
  write_array(out, "velocity", bed.velocity, 3);
  write_array(out, "tag", bed.tag);
  write_array(out, "type", bed.type);
  write_array(out, "state", bed.state);
  if (wide)
    write_array(out, "body", bed.body);
  else
    write_numbers_of_bodies(out, bed.body);
  out.write("      </PointData>\n");
  write_points(out, bed.position);
  write_cells(out, "Verts", connectivity, 1);
  end_piece(out);
}

}  // namespace

std::string bed_piece(const BedTable& bed) {
  Text text;
  write_bed_piece(text, bed, true);
  return std::move(text.all);
}

void write_bed_vtp(const std::string& file, const BedTable& bed) {
  WholeFile out(file);
  out.write(poly_data_begins);
  write_bed_piece(out, bed, false);
  out.write(poly_data_ends);
  out.commit();
}

}  // namespace solidcull
