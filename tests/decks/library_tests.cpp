// LIGGGHTS's library.h as a C program sees it (invariant I9): every function tells of the whole bed, while granules are culled.
// The same calls, looked up as Python does, are in test_library.py.
#include <gtest/gtest.h>
#include <mpi.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "atom.h"
#include "engine.h"
#include "fix.h"
#include "input.h"
#include "lammps.h"
#include "library.h"
#include "modify.h"

namespace decks {
namespace {

constexpr double diameter = 0.0026;
constexpr double contact_force = 3e-3;  // N, of what lies at the bottom
constexpr int granules = 1300;

Bed bed() {
  Bed b;
  b.name = "library";
  b.contact = "model hertz tangential history";
  b.mesh_walls = true;
  return b;
}

const char* fix_line = "fix cull all solid/cull exterior sleep every 50 calm 2 speed 0.05 tolerance 12 0\n";
const char* numbers =
    "compute top all reduce max z\ncompute each all ke/atom\ncompute st all stress/atom virial\n"
    "compute sum all reduce sum c_st[3]\ncompute pairs all pair/gran/local id delta\ncompute touched all contact/atom\n"
    "compute how_many all reduce sum c_pairs[4]\nfix mark all property/atom mark scalar yes no no 2.5\n"
    "variable n equal count(all)\nvariable high atom z>0.01\nvariable down equal fcm(all,z)\n"
    "thermo_style custom step atoms c_top c_sum c_how_many\nthermo_modify norm no\n";

/// A program.
class Library {
 public:
  explicit Library(bool culls) : Library(read_bed(bed()) + (culls ? fix_line : "") + numbers + "run 100\nrun 0\n") {}
  explicit Library(const std::string& deck) {
    std::vector<std::string> words = {"program", "-log", "none", "-screen", "library_tests.screen"};
    std::vector<char*> args;
    for (std::string& w : words) args.push_back(&w[0]);
    lammps_open(static_cast<int>(args.size()), args.data(), MPI_COMM_WORLD, &handle_);
    MPI_Comm_rank(MPI_COMM_WORLD, &me_);
    command(deck);
  }
  ~Library() { lammps_close(handle_); }

  void command(const std::string& lines) {
    std::istringstream all(lines);
    for (std::string line; std::getline(all, line);) lammps_command(handle_, line.c_str());
  }
  void* handle() { return handle_; }
  int me() const { return me_; }

  double culled() {
    auto* const number = static_cast<double*>(lammps_extract_fix(handle_, "cull", 0, 1, 2, 0));
    const double n = *number;
    std::free(number);
    return n;
  }
  /// Of all ranks, by tag: `count` numbers.
  std::map<int, std::vector<double>> of_atoms(const char* name, int count) {
    const int n = owned();
    void* const found = lammps_extract_atom(handle_, name);
    const int* const tag = static_cast<int*>(lammps_extract_atom(handle_, "id"));
    return by_tag(n, tag, count,
                  [&](int i, int k) { return count == 1 ? static_cast<double*>(found)[i] : static_cast<double**>(found)[i][k]; });
  }
  std::map<int, std::vector<double>> whole_of_atoms(const char* name) {
    const int n = owned();
    const int* const found = static_cast<int*>(lammps_extract_atom(handle_, name));
    const int* const tag = static_cast<int*>(lammps_extract_atom(handle_, "id"));
    return by_tag(n, tag, 1, [&](int i, int) { return static_cast<double>(found[i]); });
  }
  std::map<int, std::vector<double>> of_each(const double* numbers) {
    const int n = owned();
    const int* const tag = static_cast<int*>(lammps_extract_atom(handle_, "id"));
    return by_tag(n, tag, 1, [&](int i, int) { return numbers[i]; });
  }
  std::vector<double> gathered(const char* name, int count) {
    std::vector<double> all(static_cast<std::size_t>(count) * lammps_get_natoms(handle_));
    std::string word = name;
    lammps_gather_atoms(handle_, word.c_str(), 1, count, all.data());
    return all;
  }
  double variable(const char* name) {
    std::string word = name;
    auto* const number = static_cast<double*>(lammps_extract_variable(handle_, &word[0], nullptr));
    const double value = *number;
    std::free(number);
    return value;
  }
  int owned() { return *static_cast<int*>(lammps_extract_global(handle_, "nlocal")); }
  double global(const char* name) { return *static_cast<double*>(lammps_extract_global(handle_, name)); }

  static long sum(long here) {
    long all = 0;
    MPI_Allreduce(&here, &all, 1, MPI_LONG, MPI_SUM, MPI_COMM_WORLD);
    return all;
  }
  static double sum(double here) {
    double all = 0;
    MPI_Allreduce(&here, &all, 1, MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
    return all;
  }

 private:
  template <class Number>
  static std::map<int, std::vector<double>> by_tag(int n, const int* tag, int count, Number number) {
    std::vector<double> all(static_cast<std::size_t>(granules) * count), there(granules), everywhere(granules);
    for (int i = 0; i < n; ++i) {
      if (tag[i] > granules) continue;  // made by a test
      there[static_cast<std::size_t>(tag[i]) - 1] = 1;
      for (int k = 0; k < count; ++k) all[(static_cast<std::size_t>(tag[i]) - 1) * count + k] = number(i, k);
    }
    std::vector<double> sums(all.size());
    MPI_Allreduce(all.data(), sums.data(), static_cast<int>(all.size()), MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
    MPI_Allreduce(there.data(), everywhere.data(), granules, MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
    std::map<int, std::vector<double>> found;
    for (int g = 0; g < granules; ++g)
      if (everywhere[g] > 0)
        found[g + 1] = std::vector<double>(sums.begin() + static_cast<long>(g) * count, sums.begin() + (g + 1L) * count);
    return found;
  }

  void* handle_ = nullptr;
  int me_ = 0;
};

double largest_difference(const std::map<int, std::vector<double>>& a, const std::map<int, std::vector<double>>& b) {
  if (a.size() != b.size()) return HUGE_VAL;
  double most = 0;
  for (const auto& [tag, numbers] : a) {
    const auto there = b.find(tag);
    if (there == b.end()) return HUGE_VAL;
    for (std::size_t k = 0; k < numbers.size(); ++k) {
      const double apart = std::abs(numbers[k] - there->second[k]);
      if (!(apart <= most)) most = apart;
    }
  }
  return most;
}

/// A bed that is asleep, and the same in LIGGGHTS alone. Each test asks for one thing first.
class LibraryTest : public testing::Test {
 protected:
  LibraryTest() : stock_(false), asleep_(true) { stored_ = asleep_.culled(); }
  void SetUp() override { ASSERT_GT(stored_, 300); }
  /// What was only looked at is culled again at once.
  void TearDown() override {
    asleep_.command("run 0\n");
    EXPECT_GT(asleep_.culled(), 300);
    stock_.command("run 0\nrun 20\n");
    asleep_.command("run 20\n");
    EXPECT_LE(largest_difference(stock_.of_atoms("x", 3), asleep_.of_atoms("x", 3)), 2e-3 * diameter);
    EXPECT_EQ(lammps_get_natoms(asleep_.handle()), granules);
  }

  Library stock_, asleep_;
  double stored_;
};

TEST_F(LibraryTest, get_natoms_on_one_rank_alone) {
  if (asleep_.me() == 0) {
    EXPECT_EQ(lammps_get_natoms(asleep_.handle()), granules);
  }
  EXPECT_EQ(asleep_.culled(), stored_) << "nothing had to be shown";
}

TEST_F(LibraryTest, extract_global) {
  for (const char* name : {"dt", "atime", "boxxlo", "boxxhi", "boxylo", "boxyhi", "boxzlo", "boxzhi", "subxlo", "subzhi"})
    EXPECT_EQ(*static_cast<double*>(lammps_extract_global(asleep_.handle(), name)),
              *static_cast<double*>(lammps_extract_global(stock_.handle(), name)))
        << name;
  EXPECT_EQ(*static_cast<long*>(lammps_extract_global(asleep_.handle(), "natoms")), granules);
  EXPECT_EQ(lammps_extract_global(asleep_.handle(), "no_such_name"), nullptr);
  EXPECT_EQ(Library::sum(static_cast<long>(asleep_.owned())), granules);
}

TEST_F(LibraryTest, a_pointer_taken_by_one_rank_alone) {
  const int* const nlocal = asleep_.me() == 0 ? static_cast<int*>(lammps_extract_global(asleep_.handle(), "nlocal")) : nullptr;
  const long there = Library::sum(nlocal ? *nlocal : 0L), all = Library::sum(nlocal ? stock_.owned() : 0L);
  EXPECT_EQ(there, all);
  EXPECT_EQ(asleep_.gathered("radius", 1), stock_.gathered("radius", 1));
}

TEST_F(LibraryTest, extract_atom) {
  for (const char* name : {"x", "v", "omega"})
    EXPECT_EQ(largest_difference(asleep_.of_atoms(name, 3), stock_.of_atoms(name, 3)), 0) << name;
  for (const char* name : {"radius", "rmass", "density"})
    EXPECT_EQ(largest_difference(asleep_.of_atoms(name, 1), stock_.of_atoms(name, 1)), 0) << name;
  EXPECT_EQ(largest_difference(asleep_.whole_of_atoms("type"), stock_.whole_of_atoms("type")), 0);
  EXPECT_LE(largest_difference(asleep_.of_atoms("f", 3), stock_.of_atoms("f", 3)), 1e-12 * contact_force);
  EXPECT_LE(largest_difference(asleep_.of_atoms("torque", 3), stock_.of_atoms("torque", 3)), 1e-12 * contact_force * diameter);
}

TEST_F(LibraryTest, gather_atoms) {
  for (const char* name : {"x", "v", "omega"}) EXPECT_EQ(asleep_.gathered(name, 3), stock_.gathered(name, 3)) << name;
  EXPECT_EQ(asleep_.gathered("radius", 1), stock_.gathered("radius", 1));
  const std::vector<double> here = asleep_.gathered("f", 3), there = stock_.gathered("f", 3);
  for (std::size_t k = 0; k < there.size(); ++k) EXPECT_NEAR(here[k], there[k], 1e-12 * contact_force) << k;
  std::vector<int> types(granules), wanted(granules);
  lammps_gather_atoms(asleep_.handle(), "type", 0, 1, types.data());
  lammps_gather_atoms(stock_.handle(), "type", 0, 1, wanted.data());
  EXPECT_EQ(types, wanted);
}

TEST_F(LibraryTest, extract_compute) {
  const auto scalar = [](Library& l, const char* id) {
    return *static_cast<double*>(lammps_extract_compute(l.handle(), id, 0, 0));
  };
  for (const char* id : {"top", "sum", "how_many"}) {
    EXPECT_NE(scalar(stock_, id), 0) << id;
    EXPECT_NEAR(scalar(asleep_, id), scalar(stock_, id), 1e-12 * std::abs(scalar(stock_, id))) << id;
  }
  for (const char* id : {"each", "touched"}) {  // of which the run has computed none
    const auto numbers = [&](Library& l) { return static_cast<double*>(lammps_extract_compute(l.handle(), id, 1, 1)); };
    EXPECT_EQ(largest_difference(asleep_.of_each(numbers(asleep_)), stock_.of_each(numbers(stock_))), 0) << id;
  }
  EXPECT_EQ(lammps_extract_compute(asleep_.handle(), "no_such_compute", 0, 0), nullptr);
}

TEST_F(LibraryTest, extract_fix) {
  auto* const load = static_cast<double*>(lammps_extract_fix(asleep_.handle(), "floor", 0, 1, 2, 0));
  auto* const wanted = static_cast<double*>(lammps_extract_fix(stock_.handle(), "floor", 0, 1, 2, 0));
  // after a setup each rank adds its own walls' part to what was summed before
  EXPECT_NEAR(Library::sum(*load), Library::sum(*wanted), 1e-5 * std::abs(Library::sum(*wanted)));
  std::free(load);
  std::free(wanted);
  EXPECT_EQ(asleep_.culled(), stored_) << "a mesh knows its load without granules";
  const auto marks = [](Library& l) { return static_cast<double*>(lammps_extract_fix(l.handle(), "mark", 1, 1, 0, 0)); };
  EXPECT_EQ(largest_difference(asleep_.of_each(marks(asleep_)), stock_.of_each(marks(stock_))), 0);
  EXPECT_EQ(lammps_extract_fix(asleep_.handle(), "no_such_fix", 0, 0, 0, 0), nullptr);
}

TEST_F(LibraryTest, extract_variable) {
  EXPECT_EQ(asleep_.variable("n"), granules);
  EXPECT_NEAR(asleep_.variable("down"), stock_.variable("down"), 1e-12 * contact_force * granules);
}

TEST_F(LibraryTest, extract_variable_of_each) {
  std::string name = "high", group = "all";
  const auto numbers = [&](Library& l) { return static_cast<double*>(lammps_extract_variable(l.handle(), &name[0], &group[0])); };
  double *const here = numbers(asleep_), *const there = numbers(stock_);
  EXPECT_EQ(largest_difference(asleep_.of_each(here), stock_.of_each(there)), 0);
  std::free(here);
  std::free(there);
}

TEST_F(LibraryTest, pointers_that_are_kept) {
  const int* const nlocal = static_cast<int*>(lammps_extract_global(asleep_.handle(), "nlocal"));
  for (int k = 0; k < 3; ++k) {
    asleep_.command("run 10\n");
    stock_.command("run 10\n");
    EXPECT_EQ(Library::sum(static_cast<long>(*nlocal)), granules) << "after run " << k;
    EXPECT_GT(asleep_.culled(), 300);
  }
}

TEST_F(LibraryTest, what_a_look_chose_is_culled_where_the_program_has_changed_nothing) {
  Library other(true);
  lammps_extract_atom(other.handle(), "x");
  for (int k = 0; k < 4; ++k) other.command("run 50\n");  // a look at the end of each
  EXPECT_GT(other.culled(), 300);
}

TEST_F(LibraryTest, a_file) {
  if (asleep_.me() == 0) std::ofstream("library_tests.in") << "run 5\nvariable m equal mass(all)\nrun 5\n";
  MPI_Barrier(MPI_COMM_WORLD);
  for (Library* l : {&stock_, &asleep_}) lammps_file(l->handle(), "library_tests.in");
  EXPECT_NEAR(asleep_.variable("m"), stock_.variable("m"), 1e-12 * stock_.variable("m"));
}

TEST(LibraryOfALargeBed, leaves_arrays_where_they_are_once_a_program_has_pointers) {
  Bed lattice;
  lattice.side = 0.06;
  Library program(head(lattice) + "region box block 0 0.06 0 0.06 0 0.06 units box\ncreate_box 2 box\nneighbor 0.0003 bin\n" +
                  body(lattice) +
                  "unfix grav\nlattice sc 0.002 origin 0.5 0.5 0.5\nregion cube block 0 0.06 0 0.06 0 0.055 units box\n"
                  "create_atoms 1 region cube\nset group all diameter 0.002 density 2500\nfix move all nve/sphere\nrun 0\n");
  const int all = lammps_get_natoms(program.handle());
  ASSERT_GT(all, 20000);
  double** const x = static_cast<double**>(lammps_extract_atom(program.handle(), "x"));
  const int* const nlocal = static_cast<int*>(lammps_extract_global(program.handle(), "nlocal"));
  program.command("fix cull all solid/cull exterior sleep\nrun 2\n");
  EXPECT_GT(program.culled(), 0.9 * all / 2);
  EXPECT_EQ(lammps_extract_atom(program.handle(), "x"), x);
  EXPECT_EQ(Library::sum(static_cast<long>(*nlocal)), all);
}

TEST(LibraryOfGranulesOutOfReach, have_no_contacts_before_the_next_run) {
  // radius 0.5 m until the deck says otherwise: on several ranks everyone's neighbour, and beyond all bins
  const char* const makes = "create_atoms 1 single 0.013 0.013 0.012 units box\n";
  const std::string begins = read_bed(bed()), goes_on = "run 100\nrun 0\n";  // nothing asks for forces before
  Library stock(begins + goes_on), made(begins + fix_line + goes_on), moved(begins + fix_line + goes_on);
  ASSERT_GT(made.culled(), 300);
  for (Library* l : {&stock, &made}) l->command(makes);
  EXPECT_LE(largest_difference(made.of_atoms("f", 3), stock.of_atoms("f", 3)), 1e-12 * contact_force) << "as after the last run";
  std::vector<double> x = moved.gathered("x", 3);
  for (std::size_t g = 0; g < granules; g += 7) x[3 * g + 2] += 0.03;
  lammps_scatter_atoms(moved.handle(), "x", 1, 3, x.data());
  for (const auto& of_one : moved.of_atoms("f", 3))
    for (const double f : of_one.second) EXPECT_TRUE(std::isfinite(f)) << "granule " << of_one.first;
  EXPECT_EQ(moved.gathered("x", 3), x);
  for (Library* l : {&stock, &made, &moved}) EXPECT_EQ(Library::sum(static_cast<long>(l->owned())), granules + (l != &moved));
}

TEST(LibraryByClasses, finds_the_whole_bed_after_each_command) {
  const auto made = [](bool culls) {
    std::vector<std::string> words = {"program", "-log", "none", "-screen", "library_tests.screen"};
    std::vector<char*> args;
    for (std::string& w : words) args.push_back(&w[0]);
    auto lmp = std::make_unique<LAMMPS_NS::LAMMPS>(static_cast<int>(args.size()), args.data(), MPI_COMM_WORLD);
    std::istringstream all(read_bed(bed()) + (culls ? fix_line : "") + "run 100\nrun 0\n");
    for (std::string line; std::getline(all, line);)
      if (!line.empty()) lmp->input->one(line.c_str());
    return lmp;
  };
  const auto stock = made(false), asleep = made(true);
  LAMMPS_NS::Fix* const fix = asleep->modify->fix[asleep->modify->find_fix("cull")];
  ASSERT_GT(fix->compute_vector(2), 300);
  const auto sums = [](const LAMMPS_NS::LAMMPS& lmp) {
    std::array<double, 3> here{double(lmp.atom->nlocal), 0, 0}, sum{};
    for (int i = 0; i < lmp.atom->nlocal; ++i) {
      here[1] += lmp.atom->x[i][2];
      here[2] += std::abs(lmp.atom->f[i][2]);
    }
    MPI_Allreduce(here.data(), sum.data(), 3, MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
    return sum;
  };
  const auto wanted = sums(*stock), found = sums(*asleep);
  EXPECT_EQ(asleep->atom->natoms, granules);
  EXPECT_EQ(found[0], granules);
  EXPECT_NEAR(found[1], wanted[1], 1e-12 * wanted[1]);
  EXPECT_NEAR(found[2], wanted[2], 1e-12 * contact_force * granules);
  for (int i = 0; i < asleep->atom->nlocal; ++i)
    if (asleep->atom->tag[i] == 600) asleep->atom->v[i][2] = 0.2;
  asleep->input->one("run 20");
  EXPECT_GT(fix->compute_vector(2), 300) << "what was not changed is culled again";
  EXPECT_EQ(sums(*asleep)[0], granules);
}

/// What a program has changed is so, and wakes.
class LibraryChanges : public testing::Test {
 protected:
  LibraryChanges() : stock_(false), asleep_(true) {}
  void TearDown() override {
    for (Library* l : {&stock_, &asleep_}) l->command("run 50\n");
    EXPECT_LE(largest_difference(stock_.of_atoms("x", 3), asleep_.of_atoms("x", 3)), apart_ * diameter);
    EXPECT_EQ(lammps_get_natoms(asleep_.handle()), granules);
  }
  Library stock_, asleep_;
  double apart_ = 2e-3;  // diameters: what sleeps feels no loads below the tolerance
};

TEST_F(LibraryChanges, by_scatter_atoms) {
  // no farther than to the next rank: LIGGGHTS alone loses what goes beyond
  const double up = std::min(0.02, 0.9 * (stock_.global("subzhi") - stock_.global("subzlo")));
  for (Library* l : {&stock_, &asleep_}) {
    std::vector<double> x = l->gathered("x", 3), v = l->gathered("v", 3);
    for (int g = 0; g < granules; ++g) x[3 * static_cast<std::size_t>(g) + 2] += up;
    for (int g = 0; g < granules; ++g) v[3 * static_cast<std::size_t>(g)] += 0.01;
    lammps_scatter_atoms(l->handle(), "x", 1, 3, x.data());
    lammps_scatter_atoms(l->handle(), "v", 1, 3, v.data());
    l->command("run 0\n");
  }
  EXPECT_EQ(asleep_.culled(), 0);
  apart_ = 1e-9;
}

TEST_F(LibraryChanges, of_few_by_a_pointer) {
  for (Library* l : {&stock_, &asleep_}) {
    auto** const v = static_cast<double**>(lammps_extract_atom(l->handle(), "v"));
    const int* const tag = static_cast<int*>(lammps_extract_atom(l->handle(), "id"));
    for (int i = 0; i < l->owned(); ++i)
      if (tag[i] == 600) v[i][2] = 0.2;
    l->command("run 0\n");
  }
  EXPECT_GT(asleep_.culled(), 300) << "the others stay asleep";
}

TEST_F(LibraryChanges, of_few_by_a_command) {
  for (Library* l : {&stock_, &asleep_}) l->command("set atom 600 vz 0.2\nrun 0\n");
  EXPECT_GT(asleep_.culled(), 300) << "the others stay asleep";
}

}  // namespace
}  // namespace decks
