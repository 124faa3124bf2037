// The store as numbers: into a restart file, out of one on any number of ranks, and to the rank that owns a place now.
#include <mpi.h>

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "atom.h"
#include "comm.h"
#include "engine_vectors.h"
#include "fix_solid_cull.h"
#include "memory.h"
#include "modify.h"
#include "update.h"

namespace solidcull {
namespace {

constexpr double file_mark = 20261122;  // first number of the state: the format's version
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

/// Granules, their contacts and what their bodies felt, all in the world's frame.
std::vector<double> FixSolidCull::serialise(const std::vector<std::int64_t>& stored, const std::vector<std::int64_t>& atoms) const {
  Writer w;
  w.number(records_.layouts());
  for (int l = 0; l < records_.layouts(); ++l) w.text(records_.layout_text(l));
  w.number(static_cast<double>(stored.size()));
  FlatMap<char> named;
  std::map<int, std::int64_t> member;  // one of each body
  const auto motion = [&](std::int64_t tag, int body, const Vec3& x) {
    const Twist& twist = bodies_.body(body).twist;
    w.vector(x);
    w.vector(twist.at(x));
    w.vector(twist.spin);
    named[tag] = 1;
    member.emplace(body, tag);
  };
  for (const std::int64_t tag : stored) {
    const StoredGranule& g = *store_->find(tag);
    int length = 0;
    const double* record = store_->record(tag, length);
    for (const double x : {g.radius, g.mass, double(g.tag), double(g.type), double(g.layout), double(g.lock_step), g.normal_load, double(g.wakes)})
      w.number(x);
    w.number(length);
    w.numbers(record, static_cast<std::size_t>(length));
    w.vector(bodies_.pose(g.body).turned_to_world(g.load_change));
    motion(tag, g.body, in_world(g));
  }
  w.number(static_cast<double>(atoms.size()));
  for (const std::int64_t tag : atoms) {
    const int i = *index_of_.find(tag);
    for (const double x : {double(tag), atom->rmass[i], atom->radius[i]}) w.number(x);
    motion(tag, shell_[i].body, bodies_.pose(shell_[i].body).to_world(shell_[i].place));
  }
  // contacts of these granules; with all granules named, those between interface granules too
  const bool all = atoms.empty() && stored.size() == store_->size();
  Writer edges;
  double count = 0;
  std::vector<double> turned(contacts_.width());
  contacts_.for_each_contact([&](std::int64_t low, std::int64_t high, const double* history) {
    if (!all && !named.contains(low) && !named.contains(high)) return;
    edges.number(static_cast<double>(low));
    edges.number(static_cast<double>(high));
    edges.number(history != nullptr);
    if (history) {
      std::copy_n(history, contacts_.width(), turned.begin());
      const int body = bodies_.body_of(low) ? bodies_.body_of(low) : bodies_.body_of(high);
      contacts_.turn(turned.data(), bodies_.pose(body).turn());
      edges.numbers(turned.data(), contacts_.width());
    }
    ++count;
  });
  w.number(count);
  const std::vector<double> e = edges.take();
  w.numbers(e.data(), e.size());
  if (all)
    for (int i = 0; i < atom->nlocal; ++i)
      if (shell_[i].locked) member.emplace(shell_[i].body, atom->tag[i]);
  w.number(static_cast<double>(member.size()));
  for (const auto& [body, tag] : member) {
    const SolidBody& b = bodies_.body(body);
    w.number(static_cast<double>(tag));
    w.number(b.felt_known);
    w.vector(b.pose.turned_to_world(b.felt));
    w.vector(b.acceleration);
  }
  return w.take();
}

void FixSolidCull::take_up(const std::vector<double>& blocks) {
  Reader in(blocks, 0);
  struct Taken {
    MovingGranule granule;
    StoredGranule stored;
    const double* record = nullptr;  // of a stored one
    int length = 0;
  };
  struct Edge {
    std::int64_t low, high;
    std::vector<double> history;
  };
  struct Felt {
    std::int64_t member;
    bool known;
    Vec3 felt, acceleration;
  };
  std::map<std::int64_t, Taken> taken;  // by tag, so that bodies are founded in the same order whoever sent what
  std::vector<Edge> edges;
  std::vector<Felt> felts;
  while (in.more()) {
    std::vector<int> layout;
    for (std::int64_t n = in.whole(); n > 0; --n) layout.push_back(records_.layout_from_text(in.text()));
    for (std::int64_t n = in.whole(); n > 0; --n) {
      Taken t;
      StoredGranule& g = t.stored;
      g.radius = in.number();
      g.mass = in.number();
      g.tag = in.whole();
      g.type = static_cast<int>(in.whole());
      g.layout = layout[static_cast<std::size_t>(in.whole())];
      g.lock_step = in.whole();
      g.normal_load = in.number();
      g.wakes = static_cast<int>(in.whole());
      t.length = static_cast<int>(in.whole());
      t.record = in.numbers(static_cast<std::size_t>(t.length));
      g.load_change = in.vector();
      const Vec3 x = in.vector(), v = in.vector();
      t.granule = {g.mass, g.radius, x, v, in.vector()};
      double& largest = largest_radius_by_type_[g.type];
      largest = std::max(largest, g.radius);
      if (halo_.owns(x) && !store_->find(g.tag)) taken.emplace(g.tag, t);
    }
    for (std::int64_t n = in.whole(); n > 0; --n) {
      Taken t;
      const std::int64_t tag = in.whole();
      const double mass = in.number(), radius = in.number();
      const Vec3 x = in.vector(), v = in.vector();
      t.granule = {mass, radius, x, v, in.vector()};
      if (halo_.owns(x)) taken.emplace(tag, t);
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
    for (std::int64_t n = in.whole(); n > 0; --n) {
      Felt f{in.whole(), in.number() != 0, {}, {}};
      f.felt = in.vector();
      f.acceleration = in.vector();
      felts.push_back(f);
    }
  }
  // after a restart: interface granules that have no body yet
  for (int i = 0; i < atom->nlocal; ++i)
    if (shell_[i].locked && shell_[i].body == 0) {
      Taken t;
      t.granule = moving(i);
      taken.emplace(atom->tag[i], t);
    }
  const auto here = [&](std::int64_t tag) { return taken.count(tag) || bodies_.body_of(tag); };
  fresh_contacts_.clear();
  for (Edge& e : edges) {
    if ((!here(e.low) && !here(e.high)) || contacts_.contains(e.low, e.high)) continue;
    contacts_.add(e.low, e.high, nullptr);
    if (!e.history.empty()) fresh_contacts_.push_back({e.low, e.high, std::move(e.history)});
  }
  for (auto& [tag, t] : taken) {
    if (!rigid()) t.granule.velocity = t.granule.spin = Vec3::Zero();
    const SolidBodies::Place at = bodies_.lock(tag, t.granule, contacts_, [&](std::int64_t other) { return mass_of(other); });
    const Pose& pose = bodies_.pose(at.body);
    if (t.record) {
      t.stored.position = at.position;
      t.stored.body = at.body;
      t.stored.load_change = pose.turned_to_frame(t.stored.load_change);
      store_->add(t.stored, t.record, t.length);
      ledger_.stored(t.stored);
    } else if (const int* i = index_of_.find(tag)) {
      shell_[*i].body = at.body;
      shell_[*i].place = at.position;
      shell_[*i].reference = pose.turned_to_frame(shell_[*i].reference);
      shell_[*i].load_change = pose.turned_to_frame(shell_[*i].load_change);
    } else {
      arriving_[tag] = {at, t.granule.mass, t.granule.radius};
    }
  }
  adopt_places();
  freeze_histories();
  for (const Felt& f : felts) {
    const int body = bodies_.body_of(f.member);
    if (!body || bodies_.body(body).felt_known || !f.known) continue;
    SolidBody& b = bodies_.body(body);
    b.felt = b.pose.turned_to_frame(f.felt);
    b.acceleration = f.acceleration;
    b.felt_known = true;
  }
  settle_bodies();
  std::int64_t held = static_cast<std::int64_t>(store_->size());
  MPI_Allreduce(&held, &stored_everywhere_, 1, MPI_INT64_T, MPI_SUM, world);
  count_bodies();
}

/// Granules of bodies go to the rank that owns their place: those in the store now, interface granules with the engine's exchange.
void FixSolidCull::hand_over() {
  arriving_.clear();
  if (comm->nprocs == 1) return;
  std::vector<std::int64_t> atoms, stored;
  for (int i = 0; i < atom->nlocal; ++i)
    if (shell_[i].locked && !halo_.owns(vec(atom->x[i]))) atoms.push_back(atom->tag[i]);
  // a stored one may lag behind by store_slack(): bodies that have not moved by it since they were last looked through are left
  store_->for_each_body([&](int body, const Vec3& lo, const Vec3& hi) {
    const Pose& pose = bodies_.pose(body);
    const auto then = at_home_.find(body);
    if (then != at_home_.end() && largest_way(then->second, pose, lo, hi) < 0.5 * store_slack()) return;
    at_home_[body] = pose;
    store_->for_each_in_box(body, lo, hi, [&](const StoredGranule& g) {
      if (!halo_.owns(in_world(g))) stored.push_back(g.tag);
    });
  });
  if (!any_rank(!atoms.empty() || !stored.empty())) return;
  std::sort(atoms.begin(), atoms.end());
  std::sort(stored.begin(), stored.end());
  const std::vector<double> blocks = halo_.gather_all(serialise(stored, atoms));
  for (const std::int64_t tag : atoms) {
    ShellEntry& e = shell_[*index_of_.find(tag)];
    e = e.in_world(bodies_.pose(e.body));
  }
  // they leave this rank's part of their bodies; contacts with what stays are kept
  std::vector<std::int64_t> leaving = atoms;
  leaving.insert(leaving.end(), stored.begin(), stored.end());
  const auto mass = [&](std::int64_t tag) { return mass_of(tag); };
  for (const std::int64_t tag : leaving) bodies_.unlock(tag, mass_of(tag), contacts_);
  for (const std::int64_t tag : atoms) shell_[*index_of_.find(tag)].body = -1;
  for (const std::int64_t tag : leaving) {
    std::vector<FreshContact> kept;
    contacts_.for_each(tag, [&](std::int64_t partner, const double* history) {
      if (bodies_.body_of(partner))
        kept.push_back({partner, tag, history ? contacts_.turned(history) : std::vector<double>()});
    });
    contacts_.erase(tag);
    for (const FreshContact& c : kept) contacts_.add(c.tag, c.partner, c.history.empty() ? nullptr : c.history.data());
  }
  bodies_.split(contacts_, mass, [&](std::int64_t tag, int body) {
    if (const StoredGranule* g = store_->find(tag))
      store_->move(tag, body, g->position);
    else
      shell_[*index_of_.find(tag)].body = body;
  });
  std::vector<double> record;
  for (const std::int64_t tag : stored) ledger_.returned(store_->take(tag, record));
  take_up(blocks);
  label_bodies();
}

void FixSolidCull::take_over_atoms() {
  for (int i = 0; i < atom->nlocal; ++i) {
    ShellEntry& e = shell_[i];
    if (!e.locked || e.body >= 0) continue;
    const Arrival* a = arriving_.find(atom->tag[i]);
    if (!a) broken("interface granule " + std::to_string(atom->tag[i]) + " came from another rank without its body");
    const Pose& pose = bodies_.pose(a->at.body);
    e.body = a->at.body;
    e.place = a->at.position;
    e.reference = pose.turned_to_frame(e.reference);
    e.load_change = pose.turned_to_frame(e.load_change);
    vector_atom[i] = key_of(e.body);
    arriving_.erase(atom->tag[i]);
  }
  arriving_.for_each([&](std::int64_t tag, const Arrival&) {
    broken("interface granule " + std::to_string(tag) + " was announced by another rank and did not come");
  });
  arriving_.clear();
}

double FixSolidCull::store_slack() const { return comm->nprocs > 1 && rigid() ? diameter_ : 0.0; }

void FixSolidCull::take_up_restart_state() {
  const std::vector<double> state = std::move(restart_state_);
  restart_state_.clear();
  if (static_cast<std::size_t>(state[11]) != contacts_.width())
    refuse("the restart file holds contact histories of " + std::to_string(static_cast<int>(state[11])) +
           " numbers and this deck's contact model has " + std::to_string(contacts_.width()) +
           ": use the contact model that the file was written with");
  index_of_.clear();
  for (int i = 0; i < atom->nlocal; ++i) index_of_[atom->tag[i]] = i;
  take_up(std::vector<double>(state.begin() + header_size, state.end()));
  label_bodies();
}

void FixSolidCull::write_restart(FILE* file) {
  std::vector<std::int64_t> tags;
  if (store_) store_->for_each([&](const StoredGranule& g) { tags.push_back(g.tag); });
  std::sort(tags.begin(), tags.end());
  const std::vector<double> mine = store_ ? serialise(tags, {}) : std::vector<double>{0, 0, 0, 0, 0};

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
  const double header[header_size + 1] = {double(numbers), file_mark, diameter_, weight_scale_, gravity_then_[0],
                                          gravity_then_[1], gravity_then_[2], counters[0], counters[1], counters[2],
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
  gravity_then_ = Vec3(s[3], s[4], s[5]);
  if (comm->me == 0)
    ledger_.set_counters({s[6], s[7], s[8], s[9]});
  else
    ledger_.set_counters({0, 0, s[8], 0});

  // the neighbour cut-off is set before the store is taken up: it must know the largest stored radius
  Reader in(restart_state_, header_size);
  while (in.more()) {
    for (std::int64_t n = in.whole(); n > 0; --n) in.text();
    for (std::int64_t n = in.whole(); n > 0; --n) {
      const double radius = in.number();
      in.numbers(2);
      double& largest = largest_radius_by_type_[static_cast<int>(in.number())];
      largest = std::max(largest, radius);
      in.numbers(4);
      in.numbers(static_cast<std::size_t>(in.number()));
      in.numbers(12);
    }
    for (std::int64_t n = in.whole(); n > 0; --n) in.numbers(12);
    for (std::int64_t n = in.whole(); n > 0; --n) {
      in.numbers(2);
      if (in.number()) in.numbers(static_cast<std::size_t>(s[11]));
    }
    for (std::int64_t n = in.whole(); n > 0; --n) in.numbers(8);
  }
}

int FixSolidCull::pack_restart(int i, double* buffer) {
  buffer[0] = ShellEntry::packed_size + 1;
  (shell_[i].locked ? shell_[i].in_world(bodies_.pose(shell_[i].body)) : shell_[i]).pack(buffer + 1);
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
