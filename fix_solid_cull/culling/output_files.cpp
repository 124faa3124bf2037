#include "output_files.h"

#include <algorithm>
#include <cstring>
#include <exception>
#include <memory>
#include <utility>
#include <vector>

#include "input_error.h"
#include "mesh_files.h"
#include "whole_file.h"

namespace solidcull {

std::string OutputFiles::file_of_step(const std::string& pattern) const {
  const std::size_t star = pattern.find('*');
  if (star == std::string::npos) return pattern;
  return pattern.substr(0, star) + std::to_string(bed_.run.deck_step()) + pattern.substr(star + 1);
}

void OutputFiles::begin_run() {
  for (const auto* outputs : {&bed_.scales.settings().meshes, &bed_.scales.settings().beds}) {
    const char* const keyword = outputs == &bed_.scales.settings().beds ? "bed" : "mesh";
    for (const Output& o : *outputs) {
      on_root(keyword, [&] { check_folder_of(o.file); });
      if (o.file.find('*') == std::string::npos && said_.insert(o.file).second)
        bed_.run.say("keyword '" + std::string(keyword) + "': " + o.file +
                     " has no '*' for the step in its name, and holds the last state only");
    }
  }
}

void OutputFiles::write_due() {
  const std::int64_t step = bed_.run.deck_step();
  if (step == written_at_) return;
  const auto due = [&](int every) { return every > 0 && step % every == 0; };
  for (const Output& o : bed_.scales.settings().meshes)
    if (due(o.every)) write_meshes(file_of_step(o.file));
  for (const Output& o : bed_.scales.settings().beds)
    if (due(o.every)) write_bed(file_of_step(o.file));
  written_at_ = step;
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

/// Each body's mesh on rank 0, by key, where the meshes of this rank are `here`: each rank sends its parts, and those of one body
/// are united in `parts`. Nothing elsewhere.
std::map<BodyGroups::Key, const InterfaceMesh*> OutputFiles::whole_meshes(const std::map<int, InterfaceMesh>& here,
                                                                          std::map<BodyGroups::Key, InterfaceMesh>& parts) {
  const auto timed = report_.time(Part::mesh);
  struct Head {
    BodyGroups::Key key;
    std::size_t bytes;
  };
  std::vector<Head> heads;
  std::vector<char> bytes;
  for (const auto& [body, mesh] : here) {
    if (bed_.ranks.me == 0) break;
    const std::string part = mesh.to_bytes();
    heads.push_back({bed_.groups.key_of(body), part.size()});
    bytes.insert(bytes.end(), part.begin(), part.end());
  }
  if (bed_.ranks.count > 1) {
    heads = bed_.ranks.gather_on_root(heads);
    bytes = bed_.ranks.gather_on_root(bytes);
  }
  std::map<BodyGroups::Key, const InterfaceMesh*> whole;
  if (bed_.ranks.me != 0) return whole;
  std::map<BodyGroups::Key, int> parts_of;
  for (const Head& h : heads) ++parts_of[h.key];
  for (const auto& body : here) ++parts_of[bed_.groups.key_of(body.first)];
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
    if (parts_of[key] == 1)
      whole[key] = &mesh;
    else
      add(key, mesh.to_bytes());
  }
  const char* at = bytes.data();
  for (const Head& h : heads) {
    add(h.key, std::string(at, h.bytes));
    at += h.bytes;
  }
  for (const auto& [key, part] : parts) whole[key] = &part;
  return whole;
}

void OutputFiles::write_meshes(const std::string& file) {
  std::map<BodyGroups::Key, InterfaceMesh> parts;
  const std::map<BodyGroups::Key, const InterfaceMesh*> whole = whole_meshes(ask_meshes(), parts);
  const auto timed = report_.time(Part::files);
  on_root("mesh", [&] {
    const std::string ending = file.substr(file.size() - 4);
    if (ending == ".vdb") {
      std::vector<const InterfaceMesh*> grids;
      std::vector<std::string> names;
      for (const auto& w : whole) {
        grids.push_back(w.second);
        names.push_back("body_" + std::to_string(w.first));
      }
      write_vdb(file, grids, names);
      return;
    }
    TriangleMesh all;
    std::vector<std::int64_t> body;
    for (const auto& w : whole) {
      const TriangleMesh part = w.second->triangles();
      const auto first = static_cast<std::uint32_t>(all.vertices.size());
      all.vertices.insert(all.vertices.end(), part.vertices.begin(), part.vertices.end());
      for (const auto& t : part.triangles) all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
      body.resize(all.triangles.size(), w.first);
    }
    ending == ".stl" ? write_stl(file, all) : write_vtp(file, all, body);
  });
}

// ------------------------------------------------------------------------------------------------------------ the bed

void OutputFiles::write_bed(const std::string& file) {
  const auto timed = report_.time(Part::files);
  struct Row {
    Triple x, v;
    double radius;
    std::int64_t tag;
    BodyGroups::Key body;
    int type, state;
  };
  std::vector<Row> rows;
  const Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i) {
    const Locked& e = bed_.shell[i];
    const GranuleState state = !e.locked      ? GranuleState::exterior
                               : e.excess > 1 ? GranuleState::waking
                                              : GranuleState::interface_;
    rows.push_back({triple(atoms.place(i)), triple(atoms.velocity(i)), atoms.radius[i], atoms.tag[i],
                    static_cast<BodyGroups::Key>(bed_.shell.labels()[i]), atoms.type[i], static_cast<int>(state)});
  }
  bed_.solid.store().for_each([&](const Resident& g) {
    const Vec3 x = bed_.solid.in_world(g);
    rows.push_back({triple(bed_.run.wrapped(x)), triple(bed_.solid.bodies().body(g.body).twist.at(x)), g.radius, g.tag,
                    bed_.groups.key_of(g.body), bed_.solid.store().get(g.tag).type, static_cast<int>(GranuleState::interior)});
  });
  std::sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.tag < b.tag; });
  BedTable bed;
  for (const Row& r : rows) {
    for (int d = 0; d < 3; ++d) {
      bed.position.push_back(static_cast<float>(r.x[d]));
      bed.velocity.push_back(static_cast<float>(r.v[d]));
    }
    bed.radius.push_back(static_cast<float>(r.radius));
    bed.tag.push_back(static_cast<int>(r.tag));
    bed.type.push_back(r.type);
    bed.state.push_back(r.state);
    bed.body.push_back(r.body);
  }
  if (bed_.ranks.count == 1)
    on_root("bed", [&] { write_bed_vtp(file, bed); });
  else
    write_in_parts("bed", file, bed_piece(bed), poly_data_begins, poly_data_ends);
}

/// Each rank its own, one behind the other: none holds more than that.
void OutputFiles::write_in_parts(const char* keyword, const std::string& file, std::string text, const std::string& begins,
                                 const std::string& ends) {
  const Ranks& ranks = bed_.ranks;
  std::unique_ptr<WholeFile> whole;
  on_root(keyword, [&] {
    whole = std::make_unique<WholeFile>(file);
    whole->close();
  });
  if (ranks.me == 0) text = begins + text;
  if (ranks.me == ranks.count - 1) text += ends;
  const std::int64_t before = ranks.sum_before(static_cast<std::int64_t>(text.size()));
  const std::unique_ptr<SharedFile> shared = ranks.open_to_write(WholeFile::part_of(file));
  shared->write(static_cast<std::uint64_t>(before), text.data(), text.size());
  std::int64_t error = shared->close();
  ranks.largest(&error, 1);
  on_root(keyword, [&] {
    if (error) whole->fail(std::strerror(static_cast<int>(error)));
    whole->commit();
  });
}

}  // namespace solidcull
