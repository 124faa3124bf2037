// The store as numbers: into a restart file, out of one on any number of ranks, and to the rank that owns a place now.
#include <mpi.h>

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "atom.h"
#include "comm.h"
#include "fix_solid_cull.h"
#include "memory.h"
#include "modify.h"
#include "update.h"

namespace solidcull {
namespace {

constexpr double file_mark = 20261121;  // first number of the state: the format's version
constexpr int header_size = 12;

class Writer {
 public:
  void number(double x) { out_.push_back(x); }
  void numbers(const double* x, std::size_t n) { out_.insert(out_.end(), x, x + n); }
  void vector(const Vec3& v) { numbers(v.data(), 3); }
  void text(const std::string& s) {
    number(static_cast<double>(s.size()));
    for (const char c : s) number(c);
  }
  std::vector<double> take() { return std::move(out_); }

 private:
  std::vector<double> out_;
};

class Reader {
 public:
  Reader(const std::vector<double>& in, std::size_t from) : in_(in), at_(from) {}
  bool more() const { return at_ < in_.size(); }
  double number() { return in_[at_++]; }
  std::int64_t whole() { return static_cast<std::int64_t>(number()); }
  Vec3 vector() {
    at_ += 3;
    return Vec3(in_[at_ - 3], in_[at_ - 2], in_[at_ - 1]);
  }
  const double* numbers(std::size_t n) {
    at_ += n;
    return in_.data() + at_ - n;
  }
  std::string text() {
    std::string s(static_cast<std::size_t>(number()), ' ');
    for (char& c : s) c = static_cast<char>(number());
    return s;
  }

 private:
  const std::vector<double>& in_;
  std::size_t at_;
};

}  // namespace

std::vector<double> FixSolidCull::serialise(const std::vector<std::int64_t>& tags) const {
  Writer w;
  w.number(records_.layouts());
  for (int l = 0; l < records_.layouts(); ++l) w.text(records_.layout_text(l));
  w.number(static_cast<double>(tags.size()));
  FlatMap<char> named;
  for (const std::int64_t tag : tags) {
    const StoredGranule& g = *store_->find(tag);
    int length = 0;
    const double* record = store_->record(tag, length);
    w.vector(g.position);
    for (const double x : {g.radius, g.mass, double(g.tag), double(g.type), double(g.layout), double(g.lock_step), g.normal_load})
      w.number(x);
    w.vector(g.load_change);
    w.number(length);
    w.numbers(record, static_cast<std::size_t>(length));
    named[tag] = 1;
  }
  // contacts of these granules; with all granules named, those between interface granules too
  const bool all = tags.size() == store_->size();
  Writer edges;
  double count = 0;
  contacts_.for_each_contact([&](std::int64_t low, std::int64_t high, const double* history) {
    if (!all && !named.contains(low) && !named.contains(high)) return;
    edges.number(static_cast<double>(low));
    edges.number(static_cast<double>(high));
    edges.number(history != nullptr);
    if (history) edges.numbers(history, contacts_.width());
    ++count;
  });
  w.number(count);
  const std::vector<double> e = edges.take();
  w.numbers(e.data(), e.size());
  return w.take();
}

void FixSolidCull::take_up(const std::vector<double>& blocks) {
  index_of_.clear();
  for (int i = 0; i < atom->nlocal; ++i) index_of_[atom->tag[i]] = i;
  Reader in(blocks, 0);
  struct Edge {
    std::int64_t low, high;
    std::vector<double> history;
  };
  std::vector<Edge> edges;
  while (in.more()) {
    std::vector<int> layout;
    for (std::int64_t n = in.whole(); n > 0; --n) layout.push_back(records_.layout_from_text(in.text()));
    for (std::int64_t n = in.whole(); n > 0; --n) {
      StoredGranule g;
      g.position = in.vector();
      g.radius = in.number();
      g.mass = in.number();
      g.tag = in.whole();
      g.type = static_cast<int>(in.whole());
      g.layout = layout[static_cast<std::size_t>(in.whole())];
      g.lock_step = in.whole();
      g.normal_load = in.number();
      g.load_change = in.vector();
      const int length = static_cast<int>(in.whole());
      const double* record = in.numbers(static_cast<std::size_t>(length));
      double& largest = largest_radius_by_type_[g.type];
      largest = std::max(largest, g.radius);
      if (!halo_.owns(g.position) || store_->find(g.tag)) continue;
      store_->add(g, record, length);
      ledger_.stored(g);
    }
    for (std::int64_t n = in.whole(); n > 0; --n) {
      Edge e{in.whole(), 0, {}};
      e.high = in.whole();
      if (in.whole()) {
        const double* h = in.numbers(contacts_.width());
        e.history.assign(h, h + contacts_.width());
      }
      edges.push_back(std::move(e));
    }
  }
  const auto here = [&](std::int64_t tag) {
    const int* i = index_of_.find(tag);
    return (i && shell_[*i].locked) || store_->find(tag);
  };
  for (const Edge& e : edges)
    if ((here(e.low) || here(e.high)) && !contacts_.contains(e.low, e.high))
      contacts_.add(e.low, e.high, e.history.empty() ? nullptr : e.history.data());
  std::int64_t stored = static_cast<std::int64_t>(store_->size());
  MPI_Allreduce(&stored, &stored_everywhere_, 1, MPI_INT64_T, MPI_SUM, world);
  found_bodies_anew();
}

void FixSolidCull::found_bodies_anew() {
  bodies_ = SolidBodies();
  meshes_.clear();
  meshes_wanted_ = false;  // made again from the members when next asked for
  std::vector<std::int64_t> tags;
  for (int i = 0; i < atom->nlocal; ++i)
    if (shell_[i].locked) tags.push_back(atom->tag[i]);
  store_->for_each([&](const StoredGranule& g) { tags.push_back(g.tag); });
  std::sort(tags.begin(), tags.end());
  for (const std::int64_t tag : tags) bodies_.lock(tag, mass_of(tag), contacts_);
  bodies_.take_merges();
  label_bodies();
}

void FixSolidCull::take_up_restart_state() {
  const std::vector<double> state = std::move(restart_state_);
  restart_state_.clear();
  if (static_cast<std::size_t>(state[11]) != contacts_.width())
    refuse("the restart file holds contact histories of " + std::to_string(static_cast<int>(state[11])) +
           " numbers and this deck's contact model has " + std::to_string(contacts_.width()) +
           ": use the contact model that the file was written with");
  take_up(std::vector<double>(state.begin() + header_size, state.end()));
}

void FixSolidCull::move_home() {
  std::vector<std::int64_t> leaving;
  store_->for_each([&](const StoredGranule& g) {
    if (!halo_.owns(g.position)) leaving.push_back(g.tag);
  });
  if (!any_rank(!leaving.empty())) return;
  std::sort(leaving.begin(), leaving.end());
  const std::vector<double> blocks = halo_.gather_all(serialise(leaving));
  std::vector<double> record;
  for (const std::int64_t tag : leaving) ledger_.returned(store_->take(tag, record));
  take_up(blocks);
}

void FixSolidCull::write_restart(FILE* file) {
  std::vector<std::int64_t> tags;
  if (store_) store_->for_each([&](const StoredGranule& g) { tags.push_back(g.tag); });
  std::sort(tags.begin(), tags.end());
  const std::vector<double> mine = store_ ? serialise(tags) : std::vector<double>{0, 0, 0};

  std::array<double, 4> counters = ledger_.counters();
  const double carves = counters[2];
  MPI_Allreduce(MPI_IN_PLACE, counters.data(), 4, MPI_DOUBLE, MPI_SUM, world);
  counters[2] = carves;  // every rank counts every carve
  std::int64_t numbers = static_cast<std::int64_t>(mine.size());
  MPI_Allreduce(MPI_IN_PLACE, &numbers, 1, MPI_INT64_T, MPI_SUM, world);
  numbers += header_size + 1;
  if (numbers * 8 > INT32_MAX)
    refuse("the store needs " + std::to_string(numbers / 134217728 + 1) +
           " GiB and LIGGGHTS's restart format holds 2 GiB for a fix: unfix " + id + " before write_restart");

  const std::vector<double> all = halo_.gather_root(mine);
  if (comm->me != 0) return;
  const int bytes = static_cast<int>(numbers * 8);
  const double header[header_size + 1] = {double(numbers), file_mark, diameter_, weight_scale_, gravity_at_locking_[0],
                                          gravity_at_locking_[1], gravity_at_locking_[2], counters[0], counters[1], counters[2],
                                          counters[3], 0.0, double(contacts_.width())};
  std::fwrite(&bytes, sizeof(int), 1, file);
  std::fwrite(header, sizeof(double), header_size + 1, file);
  std::fwrite(all.data(), sizeof(double), all.size(), file);
}

void FixSolidCull::restart(char* buffer) {
  double numbers = 0;
  std::memcpy(&numbers, buffer, sizeof numbers);
  restart_state_.resize(static_cast<std::size_t>(numbers) - 1);
  std::memcpy(restart_state_.data(), buffer + sizeof numbers, restart_state_.size() * sizeof(double));
  const std::vector<double>& s = restart_state_;
  if (s[0] != file_mark) refuse("the restart file was written by another version of solidcull: write it again with this one");
  diameter_ = s[1];
  weight_scale_ = s[2];
  gravity_at_locking_ = Vec3(s[3], s[4], s[5]);
  if (comm->me == 0)
    ledger_.set_counters({s[6], s[7], s[8], s[9]});
  else
    ledger_.set_counters({0, 0, s[8], 0});

  // the neighbour cut-off is set before the store is taken up: it must know the largest stored radius
  Reader in(restart_state_, header_size);
  while (in.more()) {
    for (std::int64_t n = in.whole(); n > 0; --n) in.text();
    for (std::int64_t n = in.whole(); n > 0; --n) {
      in.vector();
      const double radius = in.number();
      in.numbers(2);
      double& largest = largest_radius_by_type_[static_cast<int>(in.number())];
      largest = std::max(largest, radius);
      in.numbers(6);
      in.numbers(static_cast<std::size_t>(in.number()));
    }
    for (std::int64_t n = in.whole(); n > 0; --n) {
      in.numbers(2);
      if (in.number()) in.numbers(static_cast<std::size_t>(s[11]));
    }
  }
}

int FixSolidCull::pack_restart(int i, double* buffer) {
  buffer[0] = ShellEntry::packed_size + 1;
  shell_[i].pack(buffer + 1);
  return ShellEntry::packed_size + 1;
}

void FixSolidCull::unpack_restart(int i, int nth) {
  double* extra = atom->extra[i];
  int at = 0;
  for (int k = 0; k < nth; ++k) at += static_cast<int>(extra[at]);
  shell_[i] = ShellEntry::unpack(extra + at + 1);
  shell_[i].registered = false;  // the implicit surface is drawn anew
}

int FixSolidCull::size_restart(int) { return ShellEntry::packed_size + 1; }
int FixSolidCull::maxsize_restart() { return ShellEntry::packed_size + 1; }

}  // namespace solidcull
