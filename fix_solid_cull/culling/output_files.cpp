#include "output_files.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "file_series.h"
#include "input_error.h"
#include "seen_granules.h"
#include "whole_file.h"

namespace solidcull {
namespace {

constexpr BodyGroups::Key no_body = 0;

}  // namespace

void OutputFiles::begin_run() {
  const Settings& settings = bed_.scales.settings();
  for (const BedOutput& o : settings.beds) expect("bed", o.file);
  for (const MeshOutput& o : settings.meshes) expect("mesh", o.file);
}

void OutputFiles::expect(const char* keyword, const std::string& pattern) {
  on_root(keyword, [&] { check_folder_of(pattern); });
  if (!FileSeries(pattern).numbered() && said_.insert(pattern).second)
    bed_.run.say("keyword '" + std::string(keyword) + "': " + pattern +
                 " has no '*' for the step in its name, and holds the last state only");
}

void OutputFiles::write_due() {
  const std::int64_t step = bed_.run.deck_step();
  if (step == written_at_) return;
  for (const MeshOutput& o : bed_.scales.settings().meshes)
    if (step % o.every == 0)
      write_one("mesh", o.file, [&](const std::string& file, double time) { write_meshes(o, file, time); });
  for (const BedOutput& o : bed_.scales.settings().beds)
    if (step % o.every == 0) write_one("bed", o.file, [&](const std::string& file, double time) { write_bed(o, file, time); });
  written_at_ = step;
}

template <class Write>
void OutputFiles::write_one(const char* keyword, const std::string& pattern, Write write) {
  const FileSeries series(pattern);
  const std::int64_t step = bed_.run.deck_step();
  double time = bed_.ranks.me == 0 ? series.time_of(step, bed_.run.dt) : 0;
  bed_.ranks.largest(&time, 1);
  write(series.file(step), time);
  on_root(keyword, [&] { series.note(step, time); });
}

/// Rank 0 writes; if it cannot, all ranks stop.
template <class Write>
void OutputFiles::on_root(const char* keyword, Write write) {
  std::string failure;
  if (bed_.ranks.me == 0) try {
      write();
    } catch (const std::exception& e) {
      failure = e.what();
    }
  if (bed_.ranks.any(!failure.empty()))
    throw InputError("keyword '" + std::string(keyword) + "': " + failure + "; write it elsewhere, or leave the keyword out");
}

// ------------------------------------------------------------------------------------------------------------ meshes

const std::map<int, InterfaceMesh>& OutputFiles::ask_meshes() {
  const auto timed = report_.time(Part::mesh);
  return meshes_.ask();
}

/// What lies around all bodies: exterior and interface granules, those of other ranks and images too.
InterfaceMesh OutputFiles::skin_of_atoms() const {
  std::vector<Sphere> all;
  for (int i = 0; i < bed_.atoms.owned + bed_.atoms.ghosts; ++i) all.push_back(bed_.atoms.sphere(i));
  return InterfaceMesh::around(std::move(all), bed_.scales.voxel(), bed_.scales.closing());
}

/// Each body's mesh on rank 0, by key: each rank sends its parts, and those of one body are united in `parts`. Nothing elsewhere.
/// skin: that of the atoms stands beside them, as of no body.
OutputFiles::WholeMeshes OutputFiles::whole_meshes(Parts& parts, bool skin) {
  const std::map<int, InterfaceMesh>& here = ask_meshes();
  const auto timed = report_.time(Part::mesh);
  struct Head {
    BodyGroups::Key key;
    std::int64_t granules;
    std::size_t bytes;
  };
  std::vector<Head> heads;
  std::vector<char> bytes;
  const auto send = [&](BodyGroups::Key key, std::int64_t granules, const InterfaceMesh& mesh) {
    const std::string part = mesh.to_bytes();
    heads.push_back({key, granules, part.size()});
    bytes.insert(bytes.end(), part.begin(), part.end());
  };
  const auto granules_of = [&](int body) { return bed_.solid.bodies().body(body).mass.count; };
  if (bed_.ranks.me != 0)
    for (const auto& [body, mesh] : here) send(bed_.groups.key_of(body), granules_of(body), mesh);
  if (skin && bed_.ranks.me != 0) send(no_body, 0, skin_of_atoms());
  if (bed_.ranks.count > 1) {
    heads = bed_.ranks.gather_on_root(heads);
    bytes = bed_.ranks.gather_on_root(bytes);
  }
  WholeMeshes whole;
  if (bed_.ranks.me != 0) return whole;
  std::map<BodyGroups::Key, int> parts_of;
  for (const Head& h : heads) ++parts_of[h.key];
  for (const auto& body : here) ++parts_of[bed_.groups.key_of(body.first)];
  if (skin) parts.emplace(no_body, skin_of_atoms());
  const auto add = [&](BodyGroups::Key key, const std::string& part) {
    InterfaceMesh mesh = InterfaceMesh::from_bytes(part, bed_.scales.voxel(), bed_.scales.closing());
    const auto there = parts.find(key);
    if (there == parts.end())
      parts.emplace(key, std::move(mesh));
    else
      there->second.merge(std::move(mesh));
  };
  for (const auto& [body, mesh] : here) {
    const BodyGroups::Key key = bed_.groups.key_of(body);
    whole[key].granules += granules_of(body);
    if (parts_of[key] == 1)
      whole[key].mesh = &mesh;
    else
      add(key, mesh.to_bytes());
  }
  const char* at = bytes.data();
  for (const Head& h : heads) {
    whole[h.key].granules += h.granules;
    add(h.key, std::string(at, h.bytes));
    at += h.bytes;
  }
  for (const auto& [key, part] : parts) whole[key].mesh = &part;
  return whole;
}

void OutputFiles::write_meshes(const MeshOutput& output, const std::string& file, double time) {
  Parts parts;
  WholeMeshes whole = whole_meshes(parts, output.skin);
  const auto timed = report_.time(Part::files);
  on_root("mesh", [&] {
    for (auto w = whole.begin(); w != whole.end();)
      w = w->first != no_body && w->second.granules < output.least ? whole.erase(w) : std::next(w);
    InterfaceMesh one(bed_.scales.voxel(), bed_.scales.closing());
    if (output.surface || output.skin) {
      for (const auto& w : whole) one.merge(w.second.mesh->copy());
      whole = {{no_body, {&one, 0}}};
    }
    const std::string ending = file.substr(file.size() - 4);
    if (ending == ".vdb") {
      std::vector<const InterfaceMesh*> grids;
      std::vector<std::string> names;
      for (const auto& w : whole) {
        grids.push_back(w.second.mesh);
        names.push_back(w.first == no_body ? "surface" : "body_" + std::to_string(w.first));
      }
      write_vdb(file, grids, names);
      return;
    }
    TriangleMesh all;
    std::vector<std::int64_t> body;
    for (const auto& w : whole) {
      const TriangleMesh part = w.second.mesh->triangles();
      const auto first = static_cast<std::uint32_t>(all.vertices.size());
      all.vertices.insert(all.vertices.end(), part.vertices.begin(), part.vertices.end());
      for (const auto& t : part.triangles) all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
      if (w.first != no_body) body.resize(all.triangles.size(), w.first);
    }
    ending == ".stl" ? write_stl(file, all) : write_vtp(file, all, body, time);
  });
}

// ------------------------------------------------------------------------------------------------------------ the bed

struct OutputFiles::Row {
  std::array<float, 3> x, v, w;
  float radius;
  int id, type, state, awake, woke;
  BodyGroups::Key body;
};

/// Of this rank, in any order. Collective.
std::vector<OutputFiles::Row> OutputFiles::rows_of_bed(const BedOutput& output) const {
  const auto narrow = [](const Vec3& a) {
    return std::array<float, 3>{static_cast<float>(a[0]), static_cast<float>(a[1]), static_cast<float>(a[2])};
  };
  std::vector<Row> rows;
  const Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i) {
    const Locked& e = bed_.shell[i];
    const GranuleState state = !e.locked      ? GranuleState::exterior
                               : e.excess > 1 ? GranuleState::waking
                                              : GranuleState::interface_;
    const Survey::Reasons why = survey_.reasons(i);
    rows.push_back({narrow(atoms.place(i)), narrow(atoms.velocity(i)), narrow(atoms.spin(i)), static_cast<float>(atoms.radius[i]),
                    atoms.tag[i], atoms.type[i], static_cast<int>(state), why.awake, why.woke,
                    static_cast<BodyGroups::Key>(bed_.shell.labels()[i])});
  }
  std::optional<SeenGranules> seen;
  if (output.seen) seen.emplace(bed_);
  bed_.solid.store().for_each([&](const Resident& g) {
    const Vec3 x = bed_.run.wrapped(bed_.solid.in_world(g));
    if (seen && !seen->sees(x)) return;
    const Twist& motion = bed_.solid.bodies().body(g.body).twist;
    rows.push_back({narrow(x), narrow(motion.at(bed_.solid.in_world(g))), narrow(motion.spin), static_cast<float>(g.radius),
                    static_cast<int>(g.tag), bed_.solid.store().get(g.tag).type, static_cast<int>(GranuleState::interior), 0, 0,
                    bed_.groups.key_of(g.body)});
  });
  return rows;
}

/// By id. Local.
BedTable OutputFiles::table(const BedOutput& output, std::vector<Row> rows) {
  std::sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.id < b.id; });
  BedTable bed;
  const auto column = [&](auto& values, auto of) {
    values.reserve(rows.size());
    for (const Row& r : rows) values.push_back(of(r));
  };
  const auto vectors = [&](std::vector<float>& values, auto of) {
    values.reserve(3 * rows.size());
    for (const Row& r : rows) values.insert(values.end(), of(r).begin(), of(r).end());
  };
  vectors(
      bed.position, [](const Row& r) -> const auto& { return r.x; });
  vectors(
      bed.velocity, [](const Row& r) -> const auto& { return r.v; });
  if (output.spin)
    vectors(
        bed.spin, [](const Row& r) -> const auto& { return r.w; });
  column(bed.radius, [](const Row& r) { return r.radius; });
  column(bed.id, [](const Row& r) { return r.id; });
  column(bed.type, [](const Row& r) { return r.type; });
  column(bed.state, [](const Row& r) { return r.state; });
  column(bed.awake, [](const Row& r) { return r.awake; });
  column(bed.woke, [](const Row& r) { return r.woke; });
  column(bed.body, [](const Row& r) { return r.body; });
  return bed;
}

void OutputFiles::write_bed(const BedOutput& output, const std::string& file, double time) {
  const auto timed = report_.time(Part::files);
  std::vector<Row> rows = rows_of_bed(output);
  if (file.substr(file.size() - 4) == ".vdb") {
    if (bed_.ranks.count > 1) rows = bed_.ranks.gather_on_root(rows);
    on_root("bed", [&] { write_bed_vdb(file, table(output, std::move(rows)), time); });
    return;
  }
  const BedTable bed = table(output, std::move(rows));
  if (bed_.ranks.count == 1)
    on_root("bed", [&] { write_bed_vtp(file, bed, time); });
  else
    write_in_parts("bed", file, bed_piece(bed, true), time);
}

/// Each rank its own, one behind the other: none holds more than that.
void OutputFiles::write_in_parts(const char* keyword, const std::string& file, const PolyDataPiece& piece, double time) {
  const Ranks& ranks = bed_.ranks;
  std::unique_ptr<WholeFile> whole;
  on_root(keyword, [&] {
    whole = std::make_unique<WholeFile>(file);
    whole->close();
  });
  const std::string begins = poly_data_begins(time), middle = poly_data_middle, ends = poly_data_ends;
  std::int64_t sizes[2] = {0, static_cast<std::int64_t>(piece.data().size())};
  const std::int64_t data_before = ranks.sum_before(sizes[1]);
  const std::string head = piece.head(static_cast<std::uint64_t>(data_before));
  sizes[0] = static_cast<std::int64_t>(head.size());
  const std::int64_t head_before = ranks.sum_before(sizes[0]);
  ranks.sum(sizes, 2);

  const std::unique_ptr<SharedFile> shared = ranks.open_to_write(WholeFile::part_of(file));
  const auto write = [&](std::int64_t at, const std::string& text) {
    shared->write(static_cast<std::uint64_t>(at), text.data(), text.size());
  };
  const auto heads_begin = static_cast<std::int64_t>(begins.size()), heads_end = heads_begin + sizes[0];
  const std::int64_t data_begin = heads_end + static_cast<std::int64_t>(middle.size());
  if (ranks.me == 0) write(0, begins);
  write(heads_begin + head_before, head);
  if (ranks.me == 0) write(heads_end, middle);
  write(data_begin + data_before, piece.data());
  if (ranks.me == ranks.count - 1) write(data_begin + sizes[1], ends);
  std::int64_t error = shared->close();
  ranks.largest(&error, 1);
  on_root(keyword, [&] {
    if (error) whole->fail(std::strerror(static_cast<int>(error)));
    whole->commit();
  });
}

}  // namespace solidcull
