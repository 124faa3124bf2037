#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "mesh_files.h"
#include "mesh_of.h"

namespace solidcull {
namespace {

namespace fs = std::filesystem;

class MeshFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = fs::temp_directory_path() / "solidcull-mesh-files-XXXXXX";
    ASSERT_TRUE(::mkdtemp(name.data()));
    folder = name;
  }
  void TearDown() override { fs::remove_all(folder); }

  std::string path(const std::string& name) const { return (folder / name).string(); }
  static std::string content(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    std::ostringstream all;
    all << in.rdbuf();
    return all.str();
  }
  bool nothing_left_over() const {
    for (const auto& entry : fs::directory_iterator(folder))
      if (entry.path().extension() == ".part") return false;
    return true;
  }

  fs::path folder;
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

/// A plain reading of base64, written apart from the writer.
std::string decoded(const std::string& text) {
  static const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned bits = 0;
  int have = 0;
  for (const char c : text) {
    if (c == '=') break;
    bits = bits << 6 | static_cast<unsigned>(digits.find(c));
    have += 6;
    if (have >= 8) {
      have -= 8;
      bytes += static_cast<char>(bits >> have & 0xFF);
    }
  }
  return bytes;
}

/// The named array of a VTP file, after a check of its length header.
template <class T>
std::vector<T> array_of(const std::string& xml, const std::string& name, const std::string& type) {
  const std::size_t tag = xml.find("<DataArray type=\"" + type + "\" Name=\"" + name + '"');
  if (tag == std::string::npos) throw std::runtime_error("no array " + name);
  const std::size_t begin = xml.find('>', tag) + 1;
  const std::string bytes = decoded(xml.substr(begin, xml.find('<', begin) - begin));
  const auto length = number_at<std::uint64_t>(bytes, 0);
  if (bytes.size() != 8 + length) throw std::runtime_error("array " + name + " has a wrong length");
  std::vector<T> values(length / sizeof(T));
  if (!values.empty()) std::memcpy(values.data(), bytes.data() + 8, length);
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
    bed.tag.push_back(100 + i);
    bed.type.push_back(1 + i % 3);
    bed.state.push_back(i % 4);
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
  write_vtp(path("t.vtp"), mesh, {3, 3, 4, 5});
  const std::string xml = content(path("t.vtp"));
  EXPECT_EQ(attribute(xml, "NumberOfPoints"), "4");
  EXPECT_EQ(attribute(xml, "NumberOfPolys"), "4");
  EXPECT_EQ(attribute(xml, "header_type"), "UInt64");
  EXPECT_EQ(array_of<int>(xml, "body", "Int32"), (std::vector<int>{3, 3, 4, 5}));
  EXPECT_EQ(array_of<float>(xml, "Points", "Float32"), (std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0.5f}));
  EXPECT_EQ(array_of<std::int64_t>(xml, "connectivity", "Int64"),
            (std::vector<std::int64_t>{0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3}));
  EXPECT_EQ(array_of<std::int64_t>(xml, "offsets", "Int64"), (std::vector<std::int64_t>{3, 6, 9, 12}));

  write_vtp(path("u.vtp"), mesh, {});
  EXPECT_EQ(content(path("u.vtp")).find("body"), std::string::npos);
  EXPECT_THROW(write_vtp(path("v.vtp"), mesh, {1}), std::invalid_argument);
  EXPECT_FALSE(fs::exists(path("v.vtp")));
}

TEST_F(MeshFiles, bed_vtp_holds_every_column) {
  // Lengths of every remainder by three, and one that is longer than the encoder's buffer.
  for (const int n : {0, 1, 2, 3, 20001}) {
    const BedTable bed = bed_of(n);
    write_bed_vtp(path("bed.vtp"), bed);
    const std::string xml = content(path("bed.vtp"));
    EXPECT_EQ(attribute(xml, "NumberOfPoints"), std::to_string(n));
    EXPECT_EQ(attribute(xml, "NumberOfVerts"), std::to_string(n));
    EXPECT_EQ(array_of<float>(xml, "Points", "Float32"), bed.position);
    EXPECT_EQ(array_of<float>(xml, "velocity", "Float32"), bed.velocity);
    EXPECT_EQ(array_of<float>(xml, "radius", "Float32"), bed.radius);
    EXPECT_EQ(array_of<int>(xml, "tag", "Int32"), bed.tag);
    EXPECT_EQ(array_of<int>(xml, "type", "Int32"), bed.type);
    EXPECT_EQ(array_of<int>(xml, "state", "Int32"), bed.state);
    EXPECT_EQ(array_of<int>(xml, "body", "Int32"), std::vector<int>(bed.body.begin(), bed.body.end()));
    EXPECT_EQ(array_of<std::int64_t>(xml, "offsets", "Int64").size(), static_cast<std::size_t>(n));
  }
  BedTable uneven = bed_of(3);
  uneven.tag.pop_back();
  EXPECT_THROW(write_bed_vtp(path("uneven.vtp"), uneven), std::invalid_argument);
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
                                   {"vtp", [](const std::string& f) { write_vtp(f, tetrahedron(), {}); }},
                                   {"bed", [](const std::string& f) { write_bed_vtp(f, bed_of(5)); }},
                                   {"vdb", [&](const std::string& f) { write_vdb(f, {&mesh}, {"body"}); }}};
  fs::create_directory(path("taken"));
  std::ofstream(path("taken") + "/keeps it from being replaced") << "x";
  for (const Case& c : cases) {
    const std::string absent = path("absent/file"), taken = path("taken"), full = path("full-" + c.name);
    EXPECT_EQ(error_of([&] { c.write(absent); }), "cannot write " + absent + ": No such file or directory") << c.name;
    EXPECT_EQ(error_of([&] { c.write(taken); }), "cannot write " + taken + ": Is a directory") << c.name;
    EXPECT_TRUE(nothing_left_over()) << c.name;
    if (c.name == "vdb") continue;  // OpenVDB words this one itself
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
