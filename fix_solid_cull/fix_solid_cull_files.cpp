// Outputs: interface meshes and the whole bed.
#include <mpi.h>

#include <algorithm>
#include <stdexcept>

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "engine_vectors.h"
#include "fix_solid_cull.h"
#include "mesh_files.h"
#include "update.h"

namespace solidcull {
const std::map<int, InterfaceMesh>& FixSolidCull::interface_meshes() {
  const auto timed = watch_.time(Part::mesh);
  if (!meshes_wanted_ && store_) {
    meshes_wanted_ = true;
    meshes_.clear();
    merges_.clear();
    locked_now_.clear();
    index_atoms();
    update_meshes();
  }
  for (auto& mesh : meshes_) mesh.second.set_pose(bodies_.pose(mesh.first));
  return meshes_;
}

const Pose& FixSolidCull::pose_of_mesh(int body) const {
  for (const Merge& m : merges_)
    if (m.swallowed == body) return m.pose;
  return bodies_.pose(body);
}

void FixSolidCull::update_meshes() {
  const auto timed = watch_.time(Part::mesh);
  for (const Merge& merge : merges_) {
    const auto swallowed = meshes_.find(merge.swallowed);
    if (swallowed == meshes_.end()) continue;
    const auto kept = meshes_.find(merge.kept);
    if (kept != meshes_.end()) {
      // in a chain of merges the kept one may be swallowed by now
      kept->second.set_pose(pose_of_mesh(merge.kept));
      swallowed->second.set_pose(merge.pose);
      kept->second.merge(std::move(swallowed->second));
    }
    meshes_.erase(swallowed);
  }
  merges_.clear();
  for (auto mesh = meshes_.begin(); mesh != meshes_.end();)
    mesh = bodies_.bodies().count(mesh->first) ? std::next(mesh) : meshes_.erase(mesh);

  // granules of each body that its mesh does not have: all of a body without a mesh, else those locked just now
  std::map<int, std::vector<Sphere>> added;
  const auto place = [&](std::int64_t tag) {
    const GranuleMass g = mass_of(tag);
    return Sphere{g.position, g.radius};
  };
  bool whole = false;
  for (const auto& body : bodies_.bodies()) whole = whole || !meshes_.count(body.first);
  if (whole) {
    std::vector<std::pair<std::int64_t, int>> members;
    bodies_.for_each_member([&](std::int64_t tag, int body) {
      if (!meshes_.count(body)) members.emplace_back(tag, body);
    });
    store_->for_each([&](const Resident& g) {
      const int body = bodies_.root(g.body);
      if (!meshes_.count(body)) members.emplace_back(g.tag, body);
    });
    std::sort(members.begin(), members.end());
    for (const auto& m : members) added[m.second].push_back(place(m.first));
  }
  for (const std::int64_t tag : locked_now_) {
    const int body = bodies_.body_of(tag);
    if (meshes_.count(body)) added[body].push_back(place(tag));
  }
  for (const auto& a : added) {
    const auto mesh = meshes_.try_emplace(a.first, settings_.voxel * diameter_, closing()).first;
    mesh->second.set_pose(bodies_.pose(a.first));
    mesh->second.add(a.second);
  }
}

std::string FixSolidCull::file_of_step(const std::string& pattern) const {
  const std::size_t star = pattern.find('*');
  if (star == std::string::npos) return pattern;
  return pattern.substr(0, star) + std::to_string(update->ntimestep) + pattern.substr(star + 1);
}

void FixSolidCull::write_mesh_file(const std::string& pattern) {
  const std::map<int, InterfaceMesh>& mine = interface_meshes();
  const auto timed = watch_.time(Part::files);
  // each rank sends its part of each body; rank 0 unites the parts
  std::map<int, InterfaceMesh> whole;
  for (int rank = 0; rank < comm->nprocs; ++rank) {
    int count = static_cast<int>(mine.size());
    MPI_Bcast(&count, 1, MPI_INT, rank, world);
    auto mesh = mine.begin();
    for (int k = 0; k < count; ++k) {
      std::string bytes;
      std::int64_t head[2] = {0, 0};
      if (rank == comm->me) {
        bytes = mesh->second.to_bytes();
        head[0] = comm->nprocs == 1 ? mesh->first : key_of(mesh->first);
        head[1] = static_cast<std::int64_t>(bytes.size());
        ++mesh;
      }
      if (rank != 0) {
        if (comm->me == rank) {
          MPI_Send(head, 2, MPI_INT64_T, 0, 0, world);
          MPI_Send(bytes.data(), static_cast<int>(bytes.size()), MPI_CHAR, 0, 1, world);
        } else if (comm->me == 0) {
          MPI_Recv(head, 2, MPI_INT64_T, rank, 0, world, MPI_STATUS_IGNORE);
          bytes.resize(static_cast<std::size_t>(head[1]));
          MPI_Recv(&bytes[0], static_cast<int>(bytes.size()), MPI_CHAR, rank, 1, world, MPI_STATUS_IGNORE);
        }
      }
      if (comm->me != 0) continue;
      InterfaceMesh part = InterfaceMesh::from_bytes(bytes, settings_.voxel * diameter_, closing());
      const auto there = whole.find(static_cast<int>(head[0]));
      if (there == whole.end())
        whole.emplace(static_cast<int>(head[0]), std::move(part));
      else
        there->second.merge(std::move(part));
    }
  }
  std::string failure;
  if (comm->me == 0) try {
      const std::string file = file_of_step(pattern);
      const std::string ending = file.substr(file.size() - 4);
      if (ending == ".vdb") {
        std::vector<const InterfaceMesh*> grids;
        std::vector<std::string> names;
        for (const auto& w : whole) {
          grids.push_back(&w.second);
          names.push_back("body_" + std::to_string(w.first));
        }
        write_vdb(file, grids, names);
      } else {
        TriangleMesh all;
        std::vector<int> body;
        for (const auto& w : whole) {
          const TriangleMesh part = w.second.triangles();
          const auto first = static_cast<std::uint32_t>(all.vertices.size());
          all.vertices.insert(all.vertices.end(), part.vertices.begin(), part.vertices.end());
          for (const auto& t : part.triangles) all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
          body.resize(all.triangles.size(), w.first);
        }
        ending == ".stl" ? write_stl(file, all) : write_vtp(file, all, body);
      }
    } catch (const std::exception& e) {
      failure = e.what();
    }
  if (any_rank(!failure.empty())) refuse("keyword 'mesh': " + failure + "; nothing of the run is lost but it stops here");
}

void FixSolidCull::write_bed_file(const std::string& pattern) {
  const auto timed = watch_.time(Part::files);
  constexpr int columns = 11;
  std::vector<double> rows;
  const auto row = [&](const Vec3& x, const Vec3& v, double radius, double tag, double type, GranuleState state, double body) {
    rows.insert(rows.end(), {x[0], x[1], x[2], v[0], v[1], v[2], radius, tag, type, double(static_cast<int>(state)), body});
  };
  for (int i = 0; i < atom->nlocal; ++i) {
    const ShellEntry& e = shell_[i];
    const GranuleState state = !e.locked      ? GranuleState::exterior
                               : e.excess > 1 ? GranuleState::waking
                                              : GranuleState::interface_;
    row(vec(atom->x[i]), vec(atom->v[i]), atom->radius[i], atom->tag[i], atom->type[i], state, vector_atom[i]);
  }
  store_->for_each([&](const Resident& g) {
    const Twist& twist = bodies_.body(g.body).twist;
    double x[3];
    set(x, in_world(g));
    domain->remap(x);
    row(vec(x), twist.at(in_world(g)), g.radius, static_cast<double>(g.tag), store_->get(g.tag).type, GranuleState::interior,
        comm->nprocs == 1 ? g.body : key_of(g.body));
  });
  rows = halo_.gather_root(rows);
  std::string failure;
  if (comm->me == 0) try {
      std::vector<std::size_t> order(rows.size() / columns);
      for (std::size_t k = 0; k < order.size(); ++k) order[k] = k * columns;
      std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return rows[a + 7] < rows[b + 7]; });
      BedTable bed;
      for (const std::size_t at : order) {
        const double* r = &rows[at];
        for (int d = 0; d < 3; ++d) {
          bed.position.push_back(static_cast<float>(r[d]));
          bed.velocity.push_back(static_cast<float>(r[3 + d]));
        }
        bed.radius.push_back(static_cast<float>(r[6]));
        bed.tag.push_back(static_cast<int>(r[7]));
        bed.type.push_back(static_cast<int>(r[8]));
        bed.state.push_back(static_cast<int>(r[9]));
        bed.body.push_back(static_cast<int>(r[10]));
      }
      write_bed_vtp(file_of_step(pattern), bed);
    } catch (const std::exception& e) {
      failure = e.what();
    }
  if (any_rank(!failure.empty())) refuse("keyword 'bed': " + failure + "; nothing of the run is lost but it stops here");
}

}  // namespace solidcull
