#include "parcels.h"

#include <algorithm>
#include <string>
#include <type_traits>

#include "flat_map.h"
#include "store_exchange.h"

namespace solidcull {
namespace {

class Writer {
 public:
  void number(double x) { out_.push_back(x); }
  void numbers(std::initializer_list<double> x) { out_.insert(out_.end(), x); }
  void numbers(const double* x, std::size_t n) { out_.insert(out_.end(), x, x + n); }
  void vector(const Vec3& v) { numbers(v.data(), 3); }
  void text(const std::string& s) {
    number(static_cast<double>(s.size()));
    for (const char c : s) number(c);
  }
  /// How many things, and their numbers.
  void part(std::size_t things, const Writer& w) {
    number(static_cast<double>(things));
    numbers(w.out_.data(), w.out_.size());
  }
  std::vector<double> take() { return std::move(out_); }

 private:
  std::vector<double> out_;
};

class Reader {
 public:
  Reader(const double* in, std::size_t n) : at_(in), end_(in + n) {}
  bool more() const { return at_ < end_; }
  double number() { return *numbers(1); }
  std::int64_t whole() { return static_cast<std::int64_t>(number()); }
  /// A number of things of which each has at least one number, or of numbers.
  std::size_t count() { return below(static_cast<std::size_t>(end_ - at_) + 1); }
  /// An index of something of which there are n.
  std::size_t below(std::size_t n) {
    const double x = number();
    if (!(x >= 0 && x < static_cast<double>(n))) throw InternalError("granules as numbers hold a wrong one");
    return static_cast<std::size_t>(x);
  }
  Vec3 vector() { return vec(numbers(3)); }
  const double* numbers(std::size_t n) {
    if (n > static_cast<std::size_t>(end_ - at_)) throw InternalError("granules as numbers end too early");
    at_ += n;
    return at_ - n;
  }
  std::string text() {
    std::string s(count(), ' ');
    for (char& c : s) c = static_cast<char>(number());
    return s;
  }

 private:
  const double *at_, *end_;
};

void write(Writer& w, const Pose& p) {
  w.vector(p.origin());
  w.numbers(p.quaternion().coeffs().data(), 4);
}

Pose read_pose(Reader& in) {
  const Vec3 origin = in.vector();
  const double* q = in.numbers(4);
  return Pose(origin, Eigen::Quaterniond(q[3], q[0], q[1], q[2]));
}

}  // namespace

// ------------------------------------------------------------------------------------------------------------ to numbers

std::vector<double> Parcels::pack(const std::vector<std::int64_t>& stored,
                                  const std::vector<std::int64_t>& interface_tags) const {
  const FrozenContacts& contacts = bed_.solid.contacts();
  const SolidBodies& living = bed_.solid.bodies();
  Writer w;
  w.number(bed_.ranks.me);
  write(w, cover_.observer());
  write(w, cover_.observed_then());
  w.number(bed_.atoms.layouts());
  for (int l = 0; l < bed_.atoms.layouts(); ++l) w.text(bed_.atoms.layout_text(l));

  std::map<int, int> index;  // body -> its place in this list
  Writer bodies;
  const auto index_of = [&](int body) {
    const auto known = index.emplace(body, static_cast<int>(index.size()));
    if (known.second) {
      SolidBody b = living.body(body);
      b.each_number([&](auto& x) { bodies.number(static_cast<double>(x)); });
    }
    return known.first->second;
  };
  FlatMap<char> named;
  Writer granules;
  const auto granule = [&](StoredGranule g, double length) {
    granules.numbers({double(g.tag), double(index_of(g.body)), length});
    g.each_number([&](auto& x) { granules.number(static_cast<double>(x)); });
    named[g.tag] = 1;
  };
  std::vector<double> record;
  for (const std::int64_t tag : stored) {
    bed_.solid.store().record(tag, record);
    granule(bed_.solid.store().get(tag), static_cast<double>(record.size()));
    granules.numbers(record.data(), record.size());
    std::vector<WallLoad> loads;
    bed_.solid.wall_loads().for_each_of(tag, [&](const WallLoad& load) { loads.push_back(load); });
    granules.number(static_cast<double>(loads.size()));
    for (const WallLoad& load : loads) {
      granules.numbers({double(load.mesh), double(load.element)});
      granules.vector(load.force);
      granules.vector(load.torque);
    }
  }
  for (const std::int64_t tag : interface_tags) granule(bed_.interface_granule(bed_.index.at(tag)), Parcel::no_record);
  Writer edges;
  std::size_t count = 0;
  const auto edge = [&](std::int64_t low, std::int64_t high, const double* history) {
    const int body = living.body_of(low) ? living.body_of(low) : living.body_of(high);
    if (!body)
      throw InternalError("a frozen contact of granules " + std::to_string(low) + " and " + std::to_string(high) +
                          " is of no body of this rank");
    edges.numbers({double(low), double(high), double(index_of(body)), double(history != nullptr)});
    if (history) edges.numbers(history, contacts.width());
    ++count;
  };
  contacts.for_each_contact([&](std::int64_t low, std::int64_t high, const double* history) {
    if (named.contains(low) || named.contains(high)) edge(low, high, history);
  });
  std::vector<double> inner(contacts.width());
  for (const std::int64_t tag : stored)
    contacts.for_each_elsewhere(tag, [&](std::int64_t partner) {
      if (partner < tag && named.contains(partner)) return;
      const std::int64_t low = std::min(tag, partner);
      const bool known = bed_.solid.inner_history(*bed_.solid.store().find(low), std::max(tag, partner), inner.data());
      edge(low, std::max(tag, partner), known ? inner.data() : nullptr);
    });
  w.part(index.size(), bodies);
  w.part(stored.size() + interface_tags.size(), granules);
  w.part(count, edges);
  return w.take();
}

// ------------------------------------------------------------------------------------------------------------ from numbers

std::vector<Parcel> Parcels::unpack(const double* numbers, std::size_t n, std::size_t width) {
  std::vector<Parcel> parcels;
  Reader in(numbers, n);
  while (in.more()) {
    auto sender = std::make_shared<Sender>();
    sender->rank = static_cast<int>(in.whole());
    sender->observer = read_pose(in);
    sender->observed_then = read_pose(in);
    std::vector<int> layout;
    for (std::size_t k = in.count(); k > 0; --k) layout.push_back(bed_.atoms.layout_from_text(in.text()));
    sender->bodies.resize(in.count());
    for (SolidBody& body : sender->bodies)
      body.each_number([&](auto& x) { x = static_cast<std::decay_t<decltype(x)>>(in.number()); });
    Parcel p;
    for (std::size_t k = in.count(); k > 0; --k) {
      Parcel::Granule g;
      g.tag = in.whole();
      g.body = static_cast<int>(in.below(sender->bodies.size()));
      g.length = static_cast<int>(in.whole());
      g.each_number([&](auto& x) { x = static_cast<std::decay_t<decltype(x)>>(in.number()); });
      if (g.length != Parcel::no_record) {
        g.layout = layout.at(static_cast<std::size_t>(g.layout));
        g.record = in.numbers(static_cast<std::size_t>(g.length));
        for (std::size_t w = in.count(); w > 0; --w) {
          WallLoad load;
          load.mesh = static_cast<int>(in.whole());
          load.element = static_cast<int>(in.whole());
          load.force = in.vector();
          load.torque = in.vector();
          g.wall_loads.push_back(load);
        }
      }
      p.granules.push_back(g);
    }
    for (std::size_t k = in.count(); k > 0; --k) {
      Parcel::Edge e{in.whole(), 0, 0, nullptr};
      e.high = in.whole();
      e.body = static_cast<int>(in.below(sender->bodies.size()));
      if (in.whole()) e.history = in.numbers(width);
      p.edges.push_back(e);
    }
    p.sender = sender;
    parcels.push_back(std::move(p));
  }
  return parcels;
}

// ------------------------------------------------------------------------------------------------------------ as it was

/// A compact store, or one of no places, knows no more of the step.
StoredGranule Parcels::locked_before(StoredGranule g) const {
  if (bed_.scales.image_by_place()) g.lock_step = std::min(g.lock_step, StoreExchange::locked_long_ago);
  return g;
}

void Parcels::begin_as_it_was(const Sender& sender) {
  bed_.solid.stands_otherwise();
  cover_.set_observer(sender.observer, sender.observed_then);
  number_.clear();
  for (const SolidBody& body : sender.bodies) number_.push_back(bed_.solid.found(body));
}

void Parcels::take_as_it_was(const Parcel& p) {
  // each contact goes in with the later of its two granules
  const std::size_t n = p.granules.size();
  FlatMap<int> order;
  order.reserve(n);
  for (std::size_t k = 0; k < n; ++k)
    if (p.granules[k].record) order[p.granules[k].tag] = static_cast<int>(k);
  struct Turn {
    int granule, partner;  // in the parcel, -1 for one that is not in it, or not stored
    const Parcel::Edge* edge;
  };
  std::vector<Turn> turns;
  turns.reserve(p.edges.size());
  std::vector<const Parcel::Edge*> of_others;
  for (const Parcel::Edge& e : p.edges) {
    const int *low = order.find(e.low), *high = order.find(e.high);
    const int a = low ? *low : -1, b = high ? *high : -1;
    if (a < 0 && b < 0)
      of_others.push_back(&e);
    else
      turns.push_back({std::max(a, b), std::min(a, b), &e});
  }
  std::stable_sort(turns.begin(), turns.end(), [](const Turn& a, const Turn& b) { return a.granule < b.granule; });

  std::vector<Resident> stored(n);
  ContactList contacts(bed_.solid.contacts().width());
  std::vector<double> turned;
  auto turn = turns.begin();
  for (std::size_t k = 0; k < n; ++k) {
    const Parcel::Granule& g = p.granules[k];
    const int body = number_.at(static_cast<std::size_t>(g.body));
    if (!g.record) {
      bed_.solid.take_in(g.tag, body, {g.position, g.radius});
      bed_.arrives(bed_.index.at(g.tag), {body, g.position});
      continue;
    }
    StoredGranule s = locked_before(g);
    s.body = body;
    s = bed_.solid.store().rounded(s);
    stored[k] = {s.position, s.radius, s.tag, s.body};
    contacts.clear();
    for (; turn != turns.end() && turn->granule == static_cast<int>(k); ++turn) {
      const Parcel::Edge& e = *turn->edge;
      const double* history = e.history;
      if (history && e.low != g.tag) {
        turned.assign(history, history + bed_.solid.contacts().width());
        bed_.solid.contacts().change_side(turned.data());
        history = turned.data();
      }
      const Resident* const partner = turn->partner < 0 ? nullptr : &stored[static_cast<std::size_t>(turn->partner)];
      contacts.add(e.low == g.tag ? e.high : e.low, history, partner);
    }
    bed_.solid.add_stored(s, g.record, g.length, contacts);
    bed_.solid.add_wall_loads(g.tag, body, g.wall_loads);
  }
  for (const Parcel::Edge* e : of_others) bed_.solid.freeze_in_frame(e->low, e->high, e->history);
}

void Parcels::end_as_it_was() {
  number_ = {};
  bed_.groups.group();
}

// ------------------------------------------------------------------------------------------------------------ taken up anew

void Parcels::take_contacts(const Parcel& p, const std::map<std::int64_t, Taken>& taken) {
  const auto ours = [&](std::int64_t tag) { return taken.count(tag) || bed_.solid.bodies().body_of(tag); };
  for (const Parcel::Edge& e : p.edges) {
    if ((!ours(e.low) && !ours(e.high)) || bed_.solid.contacts().contains(e.low, e.high)) continue;
    if (!e.history) {
      bed_.solid.freeze_in_frame(e.low, e.high, nullptr);
      continue;
    }
    std::vector<double> history(e.history, e.history + bed_.solid.contacts().width());
    bed_.solid.contacts().turn(history.data(), p.sender->bodies.at(e.body).pose.turn());
    bed_.solid.freeze(e.low, e.high, history.data());
  }
}

void Parcels::take_granule(std::int64_t tag, const Taken& t) {
  const Parcel::Granule& g = *t.granule;
  const SolidBody& from = t.parcel->sender->bodies.at(g.body);
  const Vec3 x = from.pose.to_world(g.position);
  MovingGranule moving{g.mass, g.radius, x, from.twist.at(x), from.twist.spin, g.held, g.clump_mass()};
  if (moving.clump) {
    moving.clump = moving.clump->in_world(from.pose);
    moving.velocity = from.twist.at(moving.clump->centre);
  }
  const SolidBodies::Place at = bed_.solid.lock(tag, moving, bed_.masses.by_tag());
  SolidBody& to = bed_.solid.body(at.body);
  to.feel_as(from);
  bed_.solid.stand_as(at.body, from, g.mass);
  if (moving.clump) {
    moving.clump->move(to.pose.to_world(at.position) - x);  // it may stand in another periodic image now
    moving.clump = moving.clump->in_frame(to.pose);
  }
  const int* i = bed_.index.find(tag);
  if (g.record) {
    StoredGranule s = locked_before(g);
    if (moving.clump) s.of_clump = *moving.clump;
    s.position = at.position;
    s.body = at.body;
    s.load_change = to.pose.turned_to_frame(from.pose.turned_to_world(s.load_change));
    bed_.solid.add_stored(bed_.solid.as_stored(s), g.record, g.length);
    bed_.solid.add_wall_loads(tag, at.body, g.wall_loads);
  } else if (i && bed_.shell[*i].body == 0) {
    bed_.arrives(*i, at);
  } else {
    bed_.arrivals.announce(tag, {at.body, {g.mass, at.position, g.radius, g.held, moving.clump}, g.clump});
  }
}

void Parcels::take(const Parcel* parcels, std::size_t n) {
  std::map<std::int64_t, Taken> taken;  // by tag, so that bodies are founded in the same order whoever sent what
  for (std::size_t k = 0; k < n; ++k) {
    const Parcel& p = parcels[k];
    for (const Parcel::Granule& g : p.granules) {
      if (g.record) bed_.solid.know_radius(g.type, g.radius);
      const int* i = bed_.index.find(g.tag);
      const bool here = i && bed_.shell[*i].locked && bed_.shell[*i].body == 0;  // an interface granule of a restart file
      if (!bed_.solid.bodies().body_of(g.tag) &&
          (here || p.for_this_rank || bed_.ranks.owns(p.sender->bodies.at(g.body).pose.to_world(g.home()))))
        taken.emplace(g.tag, Taken{&p, &g});
    }
  }
  for (std::size_t k = 0; k < n; ++k) take_contacts(parcels[k], taken);
  for (const auto& [tag, t] : taken) {
    take_granule(tag, t);
    if (t.granule->record) taken_in_.push_back(tag);
  }
}

void Parcels::take_contact(std::int64_t low, std::int64_t high, const double* history) {
  if (bed_.solid.contacts().contains(low, high)) return;
  if (history)
    bed_.solid.freeze(low, high, history);
  else
    bed_.solid.freeze_in_frame(low, high, nullptr);
  const SolidBodies& bodies = bed_.solid.bodies();
  if (bodies.body_of(low) && bodies.body_of(high)) bed_.solid.tie(low, high, bed_.masses.by_tag());
}

void Parcels::end_taking() {
  bed_.adopt_places();
  bed_.solid.turn_frozen();
  for (const std::int64_t tag : taken_in_) bed_.solid.enter_store(tag);
  taken_in_ = {};
  bed_.groups.settle();
}

}  // namespace solidcull
