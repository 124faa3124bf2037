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

bool ends_with(const std::string& name, const std::string& ending) {
  return name.size() >= ending.size() && name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
}

constexpr char rank_sign = '%';  // as in LIGGGHTS's dumps

bool is_for_each_rank(const std::string& pattern) { return pattern.find(rank_sign) != std::string::npos; }

std::string named_for(int rank, std::string pattern) {
  const std::size_t at = pattern.find(rank_sign);
  return at == std::string::npos ? pattern : pattern.replace(at, 1, std::to_string(rank));
}

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
  const FileSeries series(named_for(bed_.ranks.me, pattern));
  const std::int64_t step = bed_.run.deck_step();
  double time = bed_.ranks.me == 0 ? series.time_of(step, bed_.run.dt) : 0;
  bed_.ranks.largest(&time, 1);
  write(series.file(step), time);
  const auto note = [&] { series.note(step, time); };
  is_for_each_rank(pattern) ? on_each(keyword, note) : on_root(keyword, note);
}

/// Rank 0 writes; if it cannot, all ranks stop.
template <class Write>
void OutputFiles::on_root(const char* keyword, Write write) {
  on_each(keyword, [&] {
    if (bed_.ranks.me == 0) write();
  });
}

/// Each rank writes; if one cannot, all stop, and say what the first of them says.
template <class Write>
void OutputFiles::on_each(const char* keyword, Write write) {
  std::string failure;
  try {
    write();
  } catch (const std::exception& e) {
    failure = std::string(e.what()) + '\n';
  }
  if (!bed_.ranks.any(!failure.empty())) return;
  const std::vector<char> all = bed_.ranks.gather(std::vector<char>(failure.begin(), failure.end()));
  throw InputError("keyword '" + std::string(keyword) +
                   "': " + std::string(all.begin(), std::find(all.begin(), all.end(), '\n')) +
                   "; write it elsewhere, or leave the keyword out");
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

SurfaceParts OutputFiles::surfaces(const MeshOutput& output, bool for_each_rank) {
  const std::map<int, InterfaceMesh>& here = ask_meshes();
  const auto timed = report_.time(Part::mesh);
  SurfaceParts parts(bed_.run, bed_.ranks, bed_.scales.voxel(), bed_.scales.closing());
  for (const auto& [body, mesh] : here) {
    const BodyGroups::Key number = bed_.groups.key_of(body);
    const std::int64_t granules = bed_.solid.bodies().body(body).mass.count;
    if (bed_.groups.spans(body))
      parts.add_part(number, mesh.copy(), granules);
    else
      parts.add_whole(number, mesh, granules);
  }
  if (bed_.ranks.count > 1)
    for (auto& [number, seam] : seams_.ask()) parts.add_part(number, std::move(seam), 0);
  if (output.least > 1) parts.leave_out_below(output.least);
  if (output.skin) parts.add_part(no_body, skin_of_atoms(), 0);
  if (output.surface || output.skin) parts.make_one();
  if (!for_each_rank) ends_with(output.file, ".vdb") ? parts.join_on_root() : parts.join_here();
  return parts;
}

void OutputFiles::write_meshes(const MeshOutput& output, const std::string& file, double time) {
  const bool for_each_rank = is_for_each_rank(output.file);
  const SurfaceParts parts = surfaces(output, for_each_rank);
  const auto timed = report_.time(Part::files);
  if (ends_with(file, ".vdb")) {
    const auto write = [&] {
      std::vector<const InterfaceMesh*> grids;
      std::vector<std::string> names;
      for (const auto& [number, surface] : parts.surfaces()) {
        grids.push_back(surface.mesh);
        names.push_back(number == no_body ? "surface" : "body_" + std::to_string(number));
      }
      write_vdb(file, grids, names);
    };
    for_each_rank ? on_each("mesh", write) : on_root("mesh", write);
    return;
  }
  TriangleMesh all;
  std::vector<std::int64_t> bodies;
  for (const auto& [number, surface] : parts.surfaces()) {
    const TriangleMesh part = parts.triangles(*surface.mesh);
    const auto first = static_cast<std::uint32_t>(all.vertices.size());
    all.vertices.insert(all.vertices.end(), part.vertices.begin(), part.vertices.end());
    for (const auto& t : part.triangles) all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    bodies.resize(all.triangles.size(), number);
  }
  const bool stl = ends_with(file, ".stl"), numbered = !output.surface && !output.skin;
  if (!numbered) bodies.clear();
  if (bed_.ranks.count == 1)
    on_root("mesh", [&] { stl ? write_stl(file, all) : write_vtp(file, all, bodies, time); });
  else if (stl)
    write_stl_parts(file, all);
  else
    write_pieces("mesh", file, time, [&] { return mesh_piece(file, all, numbered ? &bodies : nullptr, true); });
}

/// Each rank its own triangles, one behind the other.
void OutputFiles::write_stl_parts(const std::string& file, const TriangleMesh& mesh) {
  auto triangles = static_cast<std::int64_t>(mesh.triangles.size());
  const std::string records = stl_records(mesh);
  const std::int64_t at = bed_.ranks.sum_before(static_cast<std::int64_t>(records.size()));
  bed_.ranks.sum(&triangles, 1);
  std::string head;
  on_root("mesh", [&] { head = stl_head(file, static_cast<std::uint64_t>(triangles)); });
  write_together("mesh", file, {{0, head}, {stl_head_bytes + at, records}});
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
  if (ends_with(file, ".vdb")) {
    const bool for_each_rank = is_for_each_rank(output.file);
    if (bed_.ranks.count > 1 && !for_each_rank) rows = bed_.ranks.gather_on_root(rows);
    const auto write = [&] { write_bed_vdb(file, table(output, std::move(rows)), time); };
    for_each_rank ? on_each("bed", write) : on_root("bed", write);
    return;
  }
  const BedTable bed = table(output, std::move(rows));
  if (bed_.ranks.count == 1)
    on_root("bed", [&] { write_bed_vtp(file, bed, time); });
  else
    write_pieces("bed", file, time, [&] { return bed_piece(bed, true); });
}

/// Each rank makes its own piece; they stand one behind the other.
void OutputFiles::write_pieces(const char* keyword, const std::string& file, double time,
                               const std::function<PolyDataPiece()>& make) {
  const Ranks& ranks = bed_.ranks;
  std::optional<PolyDataPiece> piece;
  on_each(keyword, [&] { piece = make(); });
  const std::string begins = poly_data_begins(time), middle = poly_data_middle, ends = poly_data_ends;
  std::int64_t sizes[2] = {0, static_cast<std::int64_t>(piece->data().size())};
  const std::int64_t data_before = ranks.sum_before(sizes[1]);
  const std::string head = piece->head(static_cast<std::uint64_t>(data_before));
  sizes[0] = static_cast<std::int64_t>(head.size());
  const std::int64_t head_before = ranks.sum_before(sizes[0]);
  ranks.sum(sizes, 2);

  const auto heads_begin = static_cast<std::int64_t>(begins.size()), heads_end = heads_begin + sizes[0];
  const std::int64_t data_begin = heads_end + static_cast<std::int64_t>(middle.size());
  std::vector<Stretch> stretches = {{heads_begin + head_before, head}, {data_begin + data_before, piece->data()}};
  if (ranks.me == 0) {
    stretches.push_back({0, begins});
    stretches.push_back({heads_end, middle});
  }
  if (ranks.me == ranks.count - 1) stretches.push_back({data_begin + sizes[1], ends});
  write_together(keyword, file, stretches);
}

/// All ranks write one file, each its own stretches of it: none holds more than that.
void OutputFiles::write_together(const char* keyword, const std::string& file, const std::vector<Stretch>& stretches) {
  std::unique_ptr<WholeFile> whole;
  on_root(keyword, [&] {
    whole = std::make_unique<WholeFile>(file);
    whole->close();
  });
  const std::unique_ptr<SharedFile> shared = bed_.ranks.open_to_write(WholeFile::part_of(file));
  for (const auto& [at, text] : stretches) shared->write(static_cast<std::uint64_t>(at), text.data(), text.size());
  std::int64_t error = shared->close();
  bed_.ranks.largest(&error, 1);
  on_root(keyword, [&] {
    if (error) whole->fail(std::strerror(static_cast<int>(error)));
    whole->commit();
  });
}

}  // namespace solidcull
