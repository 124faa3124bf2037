#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "mesh_files.h"
#include "mesh_of.h"
#include "temporary_folder.h"

namespace solidcull {
namespace {

namespace fs = std::filesystem;

class MeshFiles : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder / name; }
  static std::string content(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    std::ostringstream all;
    all << in.rdbuf();
    return all.str();
  }
  bool nothing_left_over() const {
    for (const auto& entry : fs::directory_iterator(folder.path()))
      if (entry.path().extension() == ".part") return false;
    return true;
  }

  TemporaryFolder folder;
};

TriangleMesh tetrahedron() {
  TriangleMesh mesh;
  mesh.vertices = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 0.5)};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return mesh;
}

template <class T>
T number_at(const std::string& bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

std::string attribute(const std::string& xml, const std::string& name) {
  const std::size_t at = xml.find(' ' + name + "=\"");
  if (at == std::string::npos) return "";
  const std::size_t begin = at + name.size() + 3;
  return xml.substr(begin, xml.find('"', begin) - begin);
}

/// The named array of a VTP file: an independent reader of what VTK's zlib compressor writes, blocks behind their sizes.
template <class T>
std::vector<T> array_of(const std::string& file, const std::string& name, const std::string& type) {
  const std::size_t tag = file.find("<DataArray type=\"" + type + "\" Name=\"" + name + '"');
  if (tag == std::string::npos) throw std::runtime_error("no array " + name);
  const std::size_t data = file.find('_', file.find("<AppendedData encoding=\"raw\">")) + 1;
  const std::size_t at = data + std::stoul(attribute(file.substr(tag), "offset"));
  const auto blocks = number_at<std::uint64_t>(file, at), size = number_at<std::uint64_t>(file, at + 8),
             last = number_at<std::uint64_t>(file, at + 16);
  std::string bytes;
  std::size_t from = at + 24 + 8 * blocks;
  for (std::uint64_t b = 0; b < blocks; ++b) {
    const auto packed = number_at<std::uint64_t>(file, at + 24 + 8 * b);
    std::string block(b + 1 == blocks && last ? last : size, '\0');
    uLongf length = block.size();
    EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(block.data()), &length, reinterpret_cast<const Bytef*>(&file[from]), packed),
              Z_OK);
    EXPECT_EQ(length, block.size());
    bytes += block;
    from += packed;
  }
  std::vector<T> values(bytes.size() / sizeof(T));
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

BedTable bed_of(int n) {
  BedTable bed;
  for (int i = 0; i < n; ++i) {
    for (int d = 0; d < 3; ++d) {
      bed.position.push_back(0.1f * i + d);
      bed.velocity.push_back(-0.5f * i);
    }
    bed.radius.push_back(0.001f * (i + 1));
    bed.id.push_back(100 + i);
    bed.type.push_back(1 + i % 3);
    bed.state.push_back(i % 4);
    bed.awake.push_back(i % 9);
    bed.woke.push_back(i % 5);
    bed.body.push_back(i / 7);
  }
  return bed;
}

TEST_F(MeshFiles, stl_holds_the_triangles) {
  const TriangleMesh mesh = tetrahedron();
  write_stl(path("t.stl"), mesh);
  const std::string bytes = content(path("t.stl"));
  ASSERT_EQ(bytes.size(), 84u + 50u * mesh.triangles.size());
  EXPECT_NE(bytes.substr(0, 5), "solid ") << "readers would take it for an ASCII file";
  EXPECT_EQ(number_at<std::uint32_t>(bytes, 80), 4u);
  EXPECT_EQ(number_at<float>(bytes, 84 + 8), -1.0f);                // first normal points down
  EXPECT_EQ(number_at<float>(bytes, 84 + 50 + 12 + 12), 1.0f);      // second triangle, second corner, x
  EXPECT_EQ(number_at<float>(bytes, 84 + 3 * 50 + 12 + 32), 0.5f);  // last triangle, last corner, z
  EXPECT_TRUE(nothing_left_over());
}

TEST_F(MeshFiles, vtp_holds_the_triangles_and_their_bodies) {
  const TriangleMesh mesh = tetrahedron();
  write_vtp(path("t.vtp"), mesh, {3, 3, 4, 5}, 0.1);
  const std::string xml = content(path("t.vtp"));
  EXPECT_EQ(attribute(xml, "NumberOfPoints"), "4");
  EXPECT_EQ(attribute(xml, "NumberOfPolys"), "4");
  EXPECT_EQ(attribute(xml, "header_type"), "UInt64");
  EXPECT_EQ(attribute(xml, "compressor"), "vtkZLibDataCompressor");
  EXPECT_NE(xml.find("Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">0.10000000000000001<"), std::string::npos);
  EXPECT_EQ(array_of<int>(xml, "body", "Int32"), (std::vector<int>{3, 3, 4, 5}));
  EXPECT_EQ(array_of<float>(xml, "Points", "Float32"), (std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0.5f}));
  EXPECT_EQ(array_of<int>(xml, "connectivity", "Int32"), (std::vector<int>{0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3}));
  EXPECT_EQ(array_of<int>(xml, "offsets", "Int32"), (std::vector<int>{3, 6, 9, 12}));

  write_vtp(path("u.vtp"), mesh, {}, 0.1);
  EXPECT_EQ(content(path("u.vtp")).find("body"), std::string::npos);
  EXPECT_THROW(write_vtp(path("v.vtp"), mesh, {1}, 0.1), std::invalid_argument);
  EXPECT_FALSE(fs::exists(path("v.vtp")));
}

TEST_F(MeshFiles, bed_vtp_holds_every_column) {
  // none, some, whole blocks, and more than one of them
  for (const int n : {0, 1, 65536, 70001}) {
    const BedTable bed = bed_of(n);
    write_bed_vtp(path("bed.vtp"), bed, 0.25);
    const std::string xml = content(path("bed.vtp"));
    EXPECT_EQ(attribute(xml, "NumberOfPoints"), std::to_string(n));
    EXPECT_EQ(attribute(xml, "NumberOfVerts"), std::to_string(n));
    EXPECT_EQ(array_of<float>(xml, "Points", "Float32"), bed.position);
    EXPECT_EQ(array_of<float>(xml, "v", "Float32"), bed.velocity);
    EXPECT_EQ(array_of<float>(xml, "radius", "Float32"), bed.radius);
    EXPECT_EQ(array_of<float>(xml, "pscale", "Float32"), bed.radius);
    EXPECT_EQ(array_of<int>(xml, "id", "Int32"), bed.id);
    EXPECT_EQ(array_of<int>(xml, "type", "Int32"), bed.type);
    EXPECT_EQ(array_of<int>(xml, "state", "Int32"), bed.state);
    EXPECT_EQ(array_of<int>(xml, "awake", "Int32"), bed.awake);
    EXPECT_EQ(array_of<int>(xml, "woke", "Int32"), bed.woke);
    EXPECT_EQ(array_of<int>(xml, "body", "Int32"), std::vector<int>(bed.body.begin(), bed.body.end()));
    EXPECT_EQ(array_of<int>(xml, "offsets", "Int32").size(), static_cast<std::size_t>(n));
    EXPECT_THROW(array_of<float>(xml, "w", "Float32"), std::runtime_error) << "nobody asked for spins";
  }
  BedTable spinning = bed_of(40);
  spinning.spin = spinning.position;
  write_bed_vtp(path("spin.vtp"), spinning, 0);
  EXPECT_EQ(array_of<float>(content(path("spin.vtp")), "w", "Float32"), spinning.spin);
  BedTable uneven = bed_of(3);
  uneven.id.pop_back();
  EXPECT_THROW(write_bed_vtp(path("uneven.vtp"), uneven, 0), std::invalid_argument);
}

TEST_F(MeshFiles, a_bed_file_of_what_sleeps_takes_a_third_of_its_bytes) {
  BedTable bed = bed_of(100000);
  std::fill(bed.velocity.begin(), bed.velocity.end(), 0.0f);
  write_bed_vtp(path("bed.vtp"), bed, 0);
  EXPECT_LT(fs::file_size(path("bed.vtp")), 20u * 100000u) << "places alone are 12 bytes a granule, all is 48";
}

TEST_F(MeshFiles, a_bed_as_vdb_has_its_arrays_also_where_it_is_empty) {
  for (const int n : {0, 300}) {
    write_bed_vdb(path("bed.vdb"), bed_of(n), 0.25);
    const std::string bytes = content(path("bed.vdb"));
    EXPECT_EQ(bytes.substr(0, 4), " BDV");
    for (const char* name : {"points", "time"}) EXPECT_NE(bytes.find(name), std::string::npos) << name;
    for (const char* name : {"pscale", "awake", "body"}) EXPECT_EQ(bytes.find(name) != std::string::npos, n > 0) << name;
  }
  BedTable uneven = bed_of(3);
  uneven.woke.pop_back();
  EXPECT_THROW(write_bed_vdb(path("uneven.vdb"), uneven, 0), std::invalid_argument);
  EXPECT_FALSE(fs::exists(path("uneven.vdb")));
}

TEST_F(MeshFiles, pieces_stand_one_behind_the_other) {
  const BedTable first = bed_of(70001), second = bed_of(3);
  const PolyDataPiece a = bed_piece(first, true), b = bed_piece(second, true);
  const std::string xml =
      poly_data_begins(0) + a.head(0) + b.head(a.data().size()) + poly_data_middle + a.data() + b.data() + poly_data_ends;
  const std::size_t other = xml.rfind("<Piece");
  EXPECT_EQ(array_of<float>(xml, "radius", "Float32"), first.radius);
  EXPECT_EQ(array_of<float>(xml.substr(other), "radius", "Float32"), second.radius);
  EXPECT_EQ(array_of<std::int64_t>(xml.substr(other), "body", "Int64"), second.body);
}

TEST_F(MeshFiles, vdb_is_written_whole) {
  const InterfaceMesh mesh = mesh_of({{Vec3::Zero(), 5e-3}}, 1e-3, 0.0), other(1e-3, 0.0);
  write_vdb(path("m.vdb"), {&mesh, &other}, {"body 1", "body 2"});
  const std::string bytes = content(path("m.vdb"));
  EXPECT_EQ(bytes.substr(0, 4), " BDV");
  EXPECT_NE(bytes.find("body 1"), std::string::npos);
  EXPECT_NE(bytes.find("body 2"), std::string::npos);
  EXPECT_TRUE(nothing_left_over());
  EXPECT_THROW(write_vdb(path("m.vdb"), {&mesh}, {}), std::invalid_argument);
}

template <class Write>
std::string error_of(const Write& write) {
  try {
    write();
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "no error";
}

TEST_F(MeshFiles, say_why_they_cannot_be_written_and_leave_nothing) {
  const InterfaceMesh mesh(1e-3, 0.0);
  struct Case {
    std::string name;
    std::function<void(const std::string&)> write;
  };
  const std::vector<Case> cases = {{"stl", [](const std::string& f) { write_stl(f, tetrahedron()); }},
                                   {"vtp", [](const std::string& f) { write_vtp(f, tetrahedron(), {}, 0); }},
                                   {"bed", [](const std::string& f) { write_bed_vtp(f, bed_of(5), 0); }},
                                   {"bed as vdb", [](const std::string& f) { write_bed_vdb(f, bed_of(5), 0); }},
                                   {"large bed as vdb", [](const std::string& f) { write_bed_vdb(f, bed_of(70001), 0); }},
                                   {"vdb", [&](const std::string& f) { write_vdb(f, {&mesh}, {"body"}); }}};
  fs::create_directory(path("taken"));
  std::ofstream(path("taken") + "/keeps it from being replaced") << "x";
  for (const Case& c : cases) {
    const std::string absent = path("absent/file"), taken = path("taken"), full = path("full-" + c.name);
    EXPECT_EQ(error_of([&] { c.write(absent); }), "cannot write " + absent + ": No such file or directory") << c.name;
    EXPECT_EQ(error_of([&] { c.write(taken); }), "cannot write " + taken + ": Is a directory") << c.name;
    EXPECT_TRUE(nothing_left_over()) << c.name;
    fs::create_symlink("/dev/full", full + ".part");
    EXPECT_EQ(error_of([&] { c.write(full); }), "cannot write " + full + ": No space left on device") << c.name;
    EXPECT_FALSE(fs::exists(full)) << c.name;
    EXPECT_TRUE(nothing_left_over()) << c.name;
  }
}

TEST_F(MeshFiles, a_folder_that_is_not_there_is_known_before_the_first_write) {
  EXPECT_NO_THROW(check_folder_of(path("file")));
  EXPECT_EQ(error_of([&] { check_folder_of(path("absent/file")); }),
            "cannot write " + path("absent/file") + ": No such file or directory");
  EXPECT_NO_THROW(check_folder_of("file.*.vtp"));
}

TEST_F(MeshFiles, a_failed_write_keeps_the_file_that_was_there) {
  const std::string file = path("t.stl");
  write_stl(file, tetrahedron());
  const std::string before = content(file);
  fs::create_symlink("/dev/full", file + ".part");
  EXPECT_THROW(write_stl(file, TriangleMesh()), std::runtime_error);
  EXPECT_EQ(content(file), before);
}

}  // namespace
}  // namespace solidcull
