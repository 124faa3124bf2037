// The store as numbers: into a restart file, out of one on any number of ranks, and to the rank that owns a place now.
#include <mpi.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <type_traits>

#include "atom.h"
#include "comm.h"
#include "engine_vectors.h"
#include "fix_solid_cull.h"
#include "memory.h"
#include "modify.h"
#include "update.h"

namespace solidcull {
namespace {

constexpr double file_mark = 20261126;  // first number of the state: the format's version
constexpr int header_size = 13;
constexpr int no_record = -1;

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

/// Granules, their bodies and their contacts as they stand in this rank's bodies. `all`: everything that is locked here.
std::vector<double> FixSolidCull::serialise(const std::vector<std::int64_t>& stored, const std::vector<std::int64_t>& atoms,
                                            bool all) const {
  Writer w;
  w.number(comm->me);
  for (const Pose* p : {&observer_, &observed_then_}) {
    w.vector(p->origin());
    w.numbers(p->quaternion().coeffs().data(), 4);
  }
  w.number(records_.layouts());
  for (int l = 0; l < records_.layouts(); ++l) w.text(records_.layout_text(l));

  std::map<int, int> index;  // body -> its place in this list
  Writer bodies;
  const auto index_of = [&](int body) {
    const auto known = index.emplace(body, static_cast<int>(index.size()));
    if (known.second) {
      SolidBody b = bodies_.body(body);
      b.each_number([&](auto& x) { bodies.number(static_cast<double>(x)); });
    }
    return known.first->second;
  };
  FlatMap<char> named;
  Writer granules;
  std::vector<double> record;
  for (const std::int64_t tag : stored) {
    const StoredGranule g = store_->get(tag);
    store_->record(tag, record);
    for (const double x : {double(g.tag), g.mass, g.radius, double(g.held), double(index_of(g.body))}) granules.number(x);
    granules.vector(g.position);
    granules.number(static_cast<double>(record.size()));
    for (const double x : {double(g.type), double(g.layout), double(g.lock_step), g.normal_load, double(g.walls)})
      granules.number(x);
    granules.vector(g.load_change);
    granules.numbers(record.data(), record.size());
    named[tag] = 1;
  }
  for (const std::int64_t tag : atoms) {
    const int i = *index_of_.find(tag);
    const ShellEntry& e = shell_[i];
    for (const double x : {double(tag), atom->rmass[i], atom->radius[i], double(e.held), double(index_of(e.body))})
      granules.number(x);
    granules.vector(e.place);
    granules.number(no_record);
    named[tag] = 1;
  }
  Writer edges;
  double count = 0;
  const auto edge = [&](std::int64_t low, std::int64_t high, const double* history) {
    const int body = bodies_.body_of(low) ? bodies_.body_of(low) : bodies_.body_of(high);
    for (const double x : {double(low), double(high), double(index_of(body)), double(history != nullptr)}) edges.number(x);
    if (history) edges.numbers(history, contacts_.width());
    ++count;
  };
  contacts_.for_each_contact([&](std::int64_t low, std::int64_t high, const double* history) {
    if (all || named.contains(low) || named.contains(high)) edge(low, high, history);
  });
  std::vector<double> inner(contacts_.width());
  for (const std::int64_t tag : stored)
    contacts_.for_each_elsewhere(tag, [&](std::int64_t partner) {
      if (partner < tag && named.contains(partner)) return;
      const std::int64_t low = std::min(tag, partner);
      const bool known = inner_history(*store_->find(low), std::max(tag, partner), inner.data());
      edge(low, std::max(tag, partner), known ? inner.data() : nullptr);
    });
  const auto part = [&](double n, Writer& from) {
    w.number(n);
    const std::vector<double> x = from.take();
    w.numbers(x.data(), x.size());
  };
  part(static_cast<double>(index.size()), bodies);
  part(static_cast<double>(stored.size() + atoms.size()), granules);
  part(count, edges);
  return w.take();
}

struct FixSolidCull::Block {
  struct Granule {
    double mass, radius;
    bool held;
    int body;
    Vec3 place;
    StoredGranule stored;
    const double* record = nullptr;  // of an interior granule; none of an interface granule
    int length = 0;
  };
  struct Edge {
    std::int64_t low, high;
    int body;
    std::vector<double> history;  // as low sees it, frame of the body
  };
  int rank;
  Pose observer, observed_then;
  std::vector<SolidBody> bodies;
  std::map<std::int64_t, Granule> granules;  // by tag
  std::vector<Edge> edges;
};

std::vector<FixSolidCull::Block> FixSolidCull::parse_blocks(const std::vector<double>& numbers, std::size_t from,
                                                            std::size_t width) {
  std::vector<Block> blocks;
  Reader in(numbers, from);
  while (in.more()) {
    Block b;
    b.rank = static_cast<int>(in.whole());
    for (Pose* p : {&b.observer, &b.observed_then}) {
      const Vec3 origin = in.vector();
      const double* q = in.numbers(4);
      *p = Pose(origin, Eigen::Quaterniond(q[3], q[0], q[1], q[2]));
    }
    std::vector<int> layout;
    for (std::int64_t n = in.whole(); n > 0; --n) layout.push_back(records_.layout_from_text(in.text()));
    b.bodies.resize(static_cast<std::size_t>(in.number()));
    for (SolidBody& body : b.bodies) body.each_number([&](auto& x) { x = static_cast<std::decay_t<decltype(x)>>(in.number()); });
    for (std::int64_t n = in.whole(); n > 0; --n) {
      Block::Granule g;
      const std::int64_t tag = in.whole();
      g.mass = in.number();
      g.radius = in.number();
      g.held = in.whole() != 0;
      g.body = static_cast<int>(in.whole());
      g.place = in.vector();
      g.length = static_cast<int>(in.whole());
      if (g.length != no_record) {
        StoredGranule& s = g.stored;
        s.tag = tag;
        s.mass = g.mass;
        s.radius = g.radius;
        s.position = g.place;
        s.type = static_cast<int>(in.whole());
        s.layout = layout[static_cast<std::size_t>(in.whole())];
        s.lock_step = in.whole();
        s.normal_load = in.number();
        s.walls = static_cast<int>(in.whole());
        s.held = g.held;
        s.load_change = in.vector();
        if (compact()) s.lock_step = std::min(s.lock_step, locked_long_ago);
        g.record = in.numbers(static_cast<std::size_t>(g.length));
      }
      b.granules.emplace(tag, g);
    }
    for (std::int64_t n = in.whole(); n > 0; --n) {
      Block::Edge e{in.whole(), 0, 0, {}};
      e.high = in.whole();
      e.body = static_cast<int>(in.whole());
      if (in.whole()) {
        const double* h = in.numbers(width);
        e.history.assign(h, h + width);
      }
      b.edges.push_back(std::move(e));
    }
    blocks.push_back(std::move(b));
  }
  return blocks;
}

void FixSolidCull::know_radius(int type, double radius) {
  double& largest = largest_radius_by_type_[type];
  largest = std::max(largest, radius);
}

/// Everything as it was, to the last bit; false if this rank does not hold what it held.
bool FixSolidCull::is_mine(const Block& b) const {
  std::size_t locked = 0;
  for (int i = 0; i < atom->nlocal; ++i) locked += shell_[i].locked;
  for (const auto& [tag, g] : b.granules) {
    if (g.record ? !halo_.owns(b.bodies[g.body].pose.to_world(g.place)) : !index_of_.contains(tag)) return false;
    locked -= g.record == nullptr;
  }
  return locked == 0;
}

void FixSolidCull::take_up_as_it_was(const Block& b) {
  ++clear_version_;
  observer_ = b.observer;
  observed_then_ = b.observed_then;
  std::vector<int> number;
  for (const SolidBody& body : b.bodies) number.push_back(bodies_.found(body));
  for (const auto& [tag, g] : b.granules) {
    bodies_.take_in(tag, number[g.body]);
    if (g.record) {
      StoredGranule s = g.stored;
      s.body = number[g.body];
      s = store_->rounded(s);
      store_->add(s, g.record, g.length);
      ledger_.stored(s);
      know_radius(s.type, s.radius);
    } else {
      ShellEntry& e = shell_[*index_of_.find(tag)];
      const Pose& pose = bodies_.pose(number[g.body]);
      e.body = number[g.body];
      e.place = g.place;
      e.reference = pose.turned_to_frame(e.reference);
      e.load_change = pose.turned_to_frame(e.load_change);
    }
  }
  for (const Block::Edge& e : b.edges) contacts_.add(e.low, e.high, e.history.empty() ? nullptr : e.history.data());
  for (const auto& [tag, g] : b.granules)
    if (g.record) entered_store(tag);
  group_bodies();
}

/// Each rank takes the granules whose places it owns, with the motion that they have in their bodies, and ties them together
/// anew.
void FixSolidCull::take_up(const std::vector<Block>& blocks) {
  ++clear_version_;
  struct Taken {
    const Block* block;
    const Block::Granule* granule;
  };
  std::map<std::int64_t, Taken> taken;  // by tag, so that bodies are founded in the same order whoever sent what
  for (const Block& b : blocks)
    for (const auto& [tag, g] : b.granules) {
      if (g.record) know_radius(g.stored.type, g.radius);
      const int* i = index_of_.find(tag);
      const bool here = i && shell_[*i].locked && shell_[*i].body == 0;  // an interface granule of a restart file
      if (!bodies_.body_of(tag) && (here || halo_.owns(b.bodies[g.body].pose.to_world(g.place))))
        taken.emplace(tag, Taken{&b, &g});
    }
  const auto ours = [&](std::int64_t tag) { return taken.count(tag) || bodies_.body_of(tag); };
  for (const Block& b : blocks)
    for (const Block::Edge& e : b.edges) {
      if ((!ours(e.low) && !ours(e.high)) || contacts_.contains(e.low, e.high)) continue;
      if (e.history.empty()) {
        contacts_.add(e.low, e.high, nullptr);
        continue;
      }
      std::vector<double> history = e.history;
      contacts_.turn(history.data(), b.bodies[e.body].pose.turn());
      contacts_.add_unturned(e.low, e.high, history.data());
    }
  for (const auto& [tag, t] : taken) {
    const SolidBody& from = t.block->bodies[t.granule->body];
    const Vec3 x = from.pose.to_world(t.granule->place);
    const MovingGranule granule{t.granule->mass, t.granule->radius, x, from.twist.at(x), from.twist.spin, t.granule->held};
    const SolidBodies::Place at = bodies_.lock(tag, granule, contacts_, [&](std::int64_t other) { return mass_of(other); });
    SolidBody& to = bodies_.body(at.body);
    if (!to.felt_known && from.felt_known) {
      to.felt = to.pose.turned_to_frame(from.pose.turned_to_world(from.felt));
      to.felt_known = true;
      to.acceleration = from.acceleration;
    }
    const int* i = index_of_.find(tag);
    if (t.granule->record) {
      StoredGranule s = t.granule->stored;
      s.position = at.position;
      s.body = at.body;
      s.load_change = to.pose.turned_to_frame(from.pose.turned_to_world(s.load_change));
      s = store_->rounded(s);
      if (compact()) bodies_.shift(at.body, {s.mass, at.position, s.radius, s.held}, s.position);
      store_->add(s, t.granule->record, t.granule->length);
      ledger_.stored(s);
    } else if (i && shell_[*i].body == 0) {
      shell_[*i].body = at.body;
      shell_[*i].place = at.position;
      shell_[*i].reference = to.pose.turned_to_frame(shell_[*i].reference);
      shell_[*i].load_change = to.pose.turned_to_frame(shell_[*i].load_change);
    } else {
      arriving_[tag] = {at, t.granule->mass, t.granule->radius, t.granule->held};
    }
  }
  adopt_places();
  freeze_histories();
  for (const auto& [tag, t] : taken)
    if (t.granule->record) entered_store(tag);
  settle_bodies();
}

void FixSolidCull::take_up_restart_state() {
  const std::vector<double> state = std::move(restart_state_);
  restart_state_.clear();
  if (static_cast<std::size_t>(state[11]) != contacts_.width())
    refuse("the restart file holds contact histories of " + std::to_string(static_cast<int>(state[11])) +
           " numbers and this deck's contact model has " + std::to_string(contacts_.width()) +
           ": use the contact model that the file was written with");
  index_atoms();
  const std::vector<Block> blocks = parse_blocks(state, header_size, contacts_.width());
  const bool same_ranks = static_cast<int>(state[12]) == comm->nprocs && static_cast<int>(blocks.size()) == comm->nprocs;
  if (same_ranks && !any_rank(!is_mine(blocks[comm->me])))
    take_up_as_it_was(blocks[comm->me]);
  else
    take_up(blocks);
  publish_restored();
}

void FixSolidCull::publish_restored() {
  std::int64_t held = static_cast<std::int64_t>(store_->size());
  MPI_Allreduce(&held, &stored_everywhere_, 1, MPI_INT64_T, MPI_SUM, world);
  count_bodies();
  label_bodies();
}

/// Granules of bodies go to the rank that owns their place: those in the store now, interface granules with the engine's
/// exchange.
void FixSolidCull::hand_over() {
  arriving_.clear();
  if (comm->nprocs == 1) return;
  std::vector<std::int64_t> atoms, stored;
  for (int i = 0; i < atom->nlocal; ++i)
    if (shell_[i].locked && !halo_.owns(vec(atom->x[i]))) atoms.push_back(atom->tag[i]);
  // a stored one may lag behind by store_slack(): bodies that have not moved by it since they were last looked through are left
  store_->for_each_frame([&](int frame, const Vec3& lo, const Vec3& hi) {
    const Pose& pose = pose_of_frame(frame);
    const auto then = at_home_.find(frame);
    if (then != at_home_.end() && largest_way(then->second, pose, lo, hi) < 0.5 * store_slack()) return;
    at_home_[frame] = pose;
    store_->for_each_in_box(frame, lo, hi, [&](const Resident& g) {
      if (!halo_.owns(in_world(g))) stored.push_back(g.tag);
    });
  });
  if (!any_rank(!atoms.empty() || !stored.empty())) return;
  std::sort(atoms.begin(), atoms.end());
  std::sort(stored.begin(), stored.end());
  const std::vector<double> blocks = halo_.gather_all(serialise(stored, atoms, false));
  for (const std::int64_t tag : atoms) {
    ShellEntry& e = shell_[*index_of_.find(tag)];
    e = e.in_world(bodies_.pose(e.body));
  }
  // they leave this rank's part of their bodies; contacts with what stays are kept
  std::vector<std::int64_t> leaving = atoms;
  leaving.insert(leaving.end(), stored.begin(), stored.end());
  std::vector<GranuleMass> masses;
  for (const std::int64_t tag : leaving) masses.push_back(mass_of(tag));
  std::vector<double> record;
  for (const std::int64_t tag : stored) {
    leaves_store(tag);
    ledger_.returned(store_->take(tag, record));
  }
  for (std::size_t k = 0; k < leaving.size(); ++k) bodies_.unlock(leaving[k], masses[k], contacts_);
  for (const std::int64_t tag : atoms) shell_[*index_of_.find(tag)].body = -1;
  for (const std::int64_t tag : leaving) {
    struct Kept {
      std::int64_t tag, partner;
      std::vector<double> history;  // as tag sees it
    };
    std::vector<Kept> kept;
    contacts_.for_each(tag, [&](std::int64_t partner, const double* history) {
      if (bodies_.body_of(partner)) kept.push_back({partner, tag, history ? contacts_.turned(history) : std::vector<double>()});
    });
    contacts_.erase(tag);
    for (const Kept& c : kept) contacts_.add(c.tag, c.partner, c.history.empty() ? nullptr : c.history.data());
  }
  split_bodies();
  take_up(parse_blocks(blocks, 0, contacts_.width()));
  publish_restored();
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

void FixSolidCull::write_restart(FILE* file) {
  std::vector<std::int64_t> tags;
  if (store_) store_->for_each([&](const Resident& g) { tags.push_back(g.tag); });
  std::sort(tags.begin(), tags.end());
  std::vector<std::int64_t> atoms;
  index_atoms();
  for (int i = 0; i < atom->nlocal; ++i)
    if (shell_[i].locked) atoms.push_back(atom->tag[i]);
  const std::vector<double> mine = store_ ? serialise(tags, atoms, true) : std::vector<double>();

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
  const double header[header_size + 1] = {
      double(numbers),           file_mark,           diameter_,   weight_scale_, gravity_then_[0], gravity_then_[1],
      gravity_then_[2],          counters[0],         counters[1], counters[2],   counters[3],      0.0,
      double(contacts_.width()), double(comm->nprocs)};
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
  for (const Block& b : parse_blocks(restart_state_, header_size, static_cast<std::size_t>(s[11])))
    for (const auto& g : b.granules)
      if (g.second.record) know_radius(g.second.stored.type, g.second.radius);
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
