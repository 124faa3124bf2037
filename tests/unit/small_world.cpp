#include "small_world.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <exception>
#include <thread>

#include "word_sum.h"

namespace solidcull {
namespace {

constexpr double pi = 3.14159265358979323846;
enum Word {
  at_word,
  velocity_word = 3,
  spin_word = 6,
  radius_word = 9,
  mass_word,
  tag_word,
  type_word,
  groups_word,
  colour_word,
  clump_word,  // where there are clumps
  arm_word,
  words = arm_word + 3
};

int words_in(const SmallDeck& deck) { return deck.clumps ? words : clump_word; }

double inertia(double mass, double radius) { return 0.4 * mass * radius * radius; }

Vec3 along(const Vec3& v, const Vec3& n) { return v.dot(n) * n; }

/// The place of the triangle that is nearest to x.
Vec3 nearest_of_triangle(const Vec3* c, const Vec3& x) {
  const Vec3 n = (c[1] - c[0]).cross(c[2] - c[0]).normalized();
  const Vec3 in_plane = x - along(x - c[0], n);
  bool inside = true;
  for (int k = 0; k < 3; ++k) inside = inside && (c[(k + 1) % 3] - c[k]).cross(in_plane - c[k]).dot(n) >= 0;
  if (inside) return in_plane;
  Vec3 best = c[0];
  for (int k = 0; k < 3; ++k) {
    const Vec3 a = c[k], edge = c[(k + 1) % 3] - a;
    const Vec3 p = a + std::clamp((x - a).dot(edge) / edge.squaredNorm(), 0.0, 1.0) * edge;
    if ((p - x).squaredNorm() < (best - x).squaredNorm()) best = p;
  }
  return best;
}

WallTriangle triangle_of(const SmallDeck::Mesh& mesh, int number, int index) {
  const auto& c = mesh.triangles[static_cast<std::size_t>(index)];
  WallTriangle t{number, index, {c[0], c[1], c[2]}, {c[0], c[0]}, mesh.moving};
  for (const Vec3& corner : c) {
    t.box.lo = t.box.lo.cwiseMin(corner);
    t.box.hi = t.box.hi.cwiseMax(corner);
  }
  return t;
}

}  // namespace

// ------------------------------------------------------------------------------------------------------------ ranks that meet

void Meeting::wait(int rank, std::unique_lock<std::mutex>& lock) {
  const std::uint64_t round = round_;
  if (++came_ == slots_.size()) {
    came_ = 0;
    ++round_;
    all_came_.notify_all();
    return;
  }
  const bool in_time =
      all_came_.wait_for(lock, std::chrono::duration<double>(seconds_), [&] { return round_ != round || !broken_.empty(); });
  if (!in_time && broken_.empty())
    broken_ = "rank " + std::to_string(rank) + " waited in " + slots_[static_cast<std::size_t>(rank)].what + " and nobody came";
  if (round_ != round) return;
  all_came_.notify_all();
  throw Broken(broken_);
}

std::vector<std::vector<char>> Meeting::gather(int rank, const std::string& what, const void* bytes, std::size_t n) {
  std::unique_lock<std::mutex> lock(mutex_);
  if (broken_.empty() && !gone_.empty()) broken_ = gone_ + " ended and rank " + std::to_string(rank) + " calls " + what;
  if (!broken_.empty()) throw Broken(broken_);
  Slot& mine = slots_[static_cast<std::size_t>(rank)];
  mine.what = what;
  mine.bytes.resize(n);
  if (n) std::memcpy(mine.bytes.data(), bytes, n);
  wait(rank, lock);
  for (const Slot& s : slots_)
    if (s.what != what && broken_.empty()) broken_ = "one rank called " + what + " while another called " + s.what;
  std::vector<std::vector<char>> all;
  for (const Slot& s : slots_) all.push_back(s.bytes);
  wait(rank, lock);  // before anyone writes anew
  if (!broken_.empty()) throw Broken(broken_);
  return all;
}

void Meeting::post(int from, int to, const void* bytes, std::size_t n) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const char* const first = static_cast<const char*>(bytes);
  posted_[{from, to}].emplace_back(first, first + n);
  all_came_.notify_all();
}

std::vector<char> Meeting::take(int from, int to) {
  std::unique_lock<std::mutex> lock(mutex_);
  std::deque<std::vector<char>>& box = posted_[{from, to}];
  const bool in_time = all_came_.wait_for(lock, std::chrono::duration<double>(seconds_),
                                          [&] { return !box.empty() || !broken_.empty() || left_.count(from); });
  if (box.empty()) {
    if (broken_.empty())
      broken_ = "rank " + std::to_string(to) + " waited for a message of rank " + std::to_string(from) +
                (in_time ? ", which ended" : ", and none came");
    all_came_.notify_all();
    throw Broken(broken_);
  }
  std::vector<char> bytes = std::move(box.front());
  box.pop_front();
  return bytes;
}

void Meeting::leave(int rank) {
  const std::lock_guard<std::mutex> lock(mutex_);
  gone_ = "rank " + std::to_string(rank);
  left_.insert(rank);
  if (came_ > 0 && broken_.empty()) broken_ = gone_ + " ended while others waited for it";
  all_came_.notify_all();
}

void run_on_ranks(const SmallDeck& deck, const std::function<void(SmallWorld&)>& work, double seconds) {
  const int ranks = deck.split[0] * deck.split[1] * deck.split[2];
  Meeting meeting(ranks, seconds);
  std::mutex mutex;
  std::exception_ptr first, follows;
  std::vector<std::thread> threads;
  for (int rank = 0; rank < ranks; ++rank)
    threads.emplace_back([&, rank] {
      std::exception_ptr failed;
      bool is_first = true;
      try {
        SmallWorld world(deck, &meeting, rank, ranks);
        work(world);
      } catch (const Meeting::Broken&) {
        failed = std::current_exception();
        is_first = false;
      } catch (...) {
        failed = std::current_exception();
      }
      if (failed) {
        const std::lock_guard<std::mutex> lock(mutex);
        std::exception_ptr& to = is_first ? first : follows;
        if (!to) to = failed;
      }
      meeting.leave(rank);
    });
  for (std::thread& t : threads) t.join();
  if (first) std::rethrow_exception(first);
  if (follows) std::rethrow_exception(follows);
}

SmallRanks::SmallRanks(SmallWorld& world, Meeting* meeting, int rank, int ranks) : world_(world), meeting_(meeting) {
  me = rank;
  count = ranks;
  const Box& box = world.deck.box;
  for (int d = 0; d < 3; ++d) {
    const int n = world.deck.split[static_cast<std::size_t>(d)];
    for (int c = 0; c < n; ++c) cuts_[static_cast<std::size_t>(d)].push_back(box.lo[d] + c * (box.hi[d] - box.lo[d]) / n);
    cuts_[static_cast<std::size_t>(d)].push_back(box.hi[d]);
  }
}

Box SmallRanks::subdomain(int rank) const {
  Box own;
  for (int d = 0; d < 3; ++d) {
    const std::vector<double>& cuts = cuts_[static_cast<std::size_t>(d)];
    const int n = static_cast<int>(cuts.size()) - 1;
    const std::size_t at = static_cast<std::size_t>(rank % n);
    rank /= n;
    own.lo[d] = cuts[at];
    own.hi[d] = cuts[at + 1];
  }
  return own;
}

double SmallRanks::thinnest() const { return 2 * world_.run.skin; }

std::vector<std::vector<char>> SmallRanks::all(const std::string& what, const void* bytes, std::size_t n) const {
  ++collectives;
  if (count > 1) return meeting_->gather(me, what, bytes, n);
  std::vector<char> mine(n);
  if (n) std::memcpy(mine.data(), bytes, n);
  return {std::move(mine)};
}

template <class Number, class Unite>
void SmallRanks::unite(const char* what, Number* numbers, int n, Unite unite) const {
  const std::size_t bytes = static_cast<std::size_t>(n) * sizeof(Number);
  const auto rows = all(what + std::string(" of ") + std::to_string(bytes), numbers, bytes);
  std::vector<Number> one(static_cast<std::size_t>(n));
  for (std::size_t r = 0; r < rows.size(); ++r) {
    if (bytes) std::memcpy(one.data(), rows[r].data(), bytes);
    for (int k = 0; k < n; ++k)
      numbers[k] = r == 0 ? one[static_cast<std::size_t>(k)] : unite(numbers[k], one[static_cast<std::size_t>(k)]);
  }
}

bool SmallRanks::any(bool here) const {
  int number = here;
  unite("any", &number, 1, [](int a, int b) { return a | b; });
  return number != 0;
}
void SmallRanks::sum(double* numbers, int n) const {
  unite("sum", numbers, n, [](double a, double b) { return a + b; });
}
void SmallRanks::sum(std::int64_t* numbers, int n) const {
  unite("sum of integers", numbers, n, [](std::int64_t a, std::int64_t b) { return a + b; });
}
void SmallRanks::largest(double* numbers, int n) const {
  unite("largest", numbers, n, [](double a, double b) { return std::max(a, b); });
}
void SmallRanks::largest(std::int64_t* numbers, int n) const {
  unite("largest integer", numbers, n, [](std::int64_t a, std::int64_t b) { return std::max(a, b); });
}

unsigned SmallRanks::end_any() const {
  unite("bits", &asked_, 1, [](unsigned a, unsigned b) { return a | b; });
  return asked_;
}

void SmallRanks::send(int rank, const void* bytes, std::size_t n) const {
  ++messages;
  meeting_->post(me, rank, bytes, n);
}

std::vector<char> SmallRanks::receive(int rank) const { return meeting_->take(rank, me); }

std::int64_t SmallRanks::sum_before(std::int64_t number) const {
  std::int64_t before = 0, one = 0;
  const auto rows = all("sum before", &number, sizeof number);
  for (int r = 0; r < me; ++r) {
    std::memcpy(&one, rows[static_cast<std::size_t>(r)].data(), sizeof one);
    before += one;
  }
  return before;
}

bool SmallRanks::has_neighbours() const { return count > 1 || shifts_.size() > 1; }

void SmallRanks::update() {
  known_.clear();
  for (int r = 0; r < count; ++r) known_.push_back(subdomain(r));
  const Vec3 edges = world_.run.edges();
  const auto& periodic = world_.run.periodic;
  shifts_.assign(1, Vec3::Zero());
  for (int n = 0; n < 27; ++n) {
    const int step[3] = {n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
    bool there = step[0] || step[1] || step[2];
    for (int d = 0; d < 3; ++d) there = there && (!step[d] || periodic[d]);
    if (there) shifts_.emplace_back(step[0] * edges[0], step[1] * edges[1], step[2] * edges[2]);
  }
}

bool SmallRanks::subdomains_changed() const {
  for (int r = 0; r < count; ++r) {
    const Box now = subdomain(r), &then = known_[static_cast<std::size_t>(r)];
    if (now.lo != then.lo || now.hi != then.hi) return true;
  }
  return false;
}

int SmallRanks::owner(const Vec3& place) const {
  const Vec3 x = world_.run.wrapped(place);
  const Box& box = world_.run.box;
  for (int r = 0; r < count; ++r) {
    const Box own = subdomain(r);
    bool holds = true;
    for (int d = 0; d < 3; ++d)
      holds = holds && (x[d] >= own.lo[d] || own.lo[d] <= box.lo[d]) && (x[d] < own.hi[d] || own.hi[d] >= box.hi[d]);
    if (holds) return r;
  }
  throw std::logic_error("no rank owns a place");
}

int SmallRanks::hops() const { return world_.deck.split[0] + world_.deck.split[1] + world_.deck.split[2] - 3; }

std::vector<int> SmallRanks::neighbours(double) const {
  std::vector<int> others;
  for (int r = 0; r < count; ++r)
    if (r != me) others.push_back(r);
  return others;
}

void SmallRanks::exchange_bytes(const void* rows, std::size_t n, std::size_t bytes, double width, const Room& room) const {
  const auto of = all("exchange of rows of " + std::to_string(bytes) + " within " + std::to_string(width), rows, n * bytes);
  const Box own = subdomain(me);
  std::vector<char> in;
  for (int rank = 0; rank < count; ++rank)
    for (const Vec3& shift : shifts_) {
      if (rank == me && shift.isZero(0)) continue;
      for (const char *row = of[static_cast<std::size_t>(rank)].data(), *end = row + of[static_cast<std::size_t>(rank)].size();
           row < end; row += bytes) {
        Triple at;
        std::memcpy(at.data(), row, sizeof at);
        const Vec3 x = vec(at) + shift;
        if (((own.lo - x).array() > width).any() || ((x - own.hi).array() > width).any()) continue;
        at = triple(x);
        const std::size_t place = in.size();
        in.insert(in.end(), row, row + bytes);
        std::memcpy(&in[place], at.data(), sizeof at);
      }
    }
  void* const to = room(in.size() / bytes);
  if (!in.empty()) std::memcpy(to, in.data(), in.size());
}

void SmallRanks::deliver_bytes(const std::vector<Letter>& letters, std::size_t bytes, const RoomFrom& room) const {
  std::vector<char> out;
  for (const Letter& l : letters) {
    const std::size_t head[2] = {static_cast<std::size_t>(l.to), l.n};
    out.insert(out.end(), reinterpret_cast<const char*>(head), reinterpret_cast<const char*>(head + 2));
    out.insert(out.end(), static_cast<const char*>(l.rows), static_cast<const char*>(l.rows) + l.n * bytes);
  }
  const auto of = all("deliver rows of " + std::to_string(bytes), out.data(), out.size());
  for (int rank = 0; rank < count; ++rank) {
    const auto& one = of[static_cast<std::size_t>(rank)];
    for (std::size_t at = 0; at < one.size();) {
      std::size_t head[2];
      std::memcpy(head, &one[at], sizeof head);
      at += sizeof head;
      if (head[0] == static_cast<std::size_t>(me)) {
        std::memcpy(room(rank, head[1]), &one[at], head[1] * bytes);
        if (rank != me) delivered += head[1] * bytes;
      }
      at += head[1] * bytes;
    }
  }
}

namespace {

class SmallFile : public SharedFile {
 public:
  SmallFile(const SmallRanks& ranks, const std::string& name)
      : file_(::open(name.c_str(), O_WRONLY | (ranks.me == 0 ? O_CREAT : 0), 0666)) {
    if (file_ < 0) error_ = errno;
    struct stat there {};
    if (ranks.me == 0 && file_ >= 0) ::fstat(file_, &there);
    std::int64_t size = there.st_size;
    ranks.sum(&size, 1);
    size_ = static_cast<std::uint64_t>(size);
    if (ranks.me != 0 && file_ < 0) {  // made meanwhile
      file_ = ::open(name.c_str(), O_WRONLY);
      error_ = file_ < 0 ? errno : 0;
    }
  }
  ~SmallFile() override {
    if (file_ >= 0) ::close(file_);
  }
  SmallFile(const SmallFile&) = delete;
  std::uint64_t size() const override { return size_; }
  void write(std::uint64_t at, const void* from, std::size_t n) override {
    if (error_ == 0 && ::pwrite(file_, from, n, static_cast<off_t>(at)) != static_cast<ssize_t>(n)) error_ = errno ? errno : EIO;
  }
  int close() override { return error_; }

 private:
  int file_, error_ = 0;
  std::uint64_t size_ = 0;
};

}  // namespace

std::unique_ptr<SharedFile> SmallRanks::open_to_write(const std::string& file) const {
  return std::make_unique<SmallFile>(*this, file);
}

void SmallRanks::gather_bytes(const void* rows, std::size_t n, std::size_t bytes, bool everywhere, const Room& room) const {
  const auto of =
      all((everywhere ? "gather of rows of " : "gather on root of rows of ") + std::to_string(bytes), rows, n * bytes);
  std::vector<char> in;
  if (everywhere || me == 0)
    for (const auto& one : of) in.insert(in.end(), one.begin(), one.end());
  void* const to = room(in.size() / bytes);
  if (!in.empty()) std::memcpy(to, in.data(), in.size());
}

// ------------------------------------------------------------------------------------------------------------ atoms

SmallAtoms::SmallAtoms(SmallWorld& world) : world_(world), texts_{"sphere and colour"} {
  interface_bit = interface_group;
  own_bit = movable_bits = all_bit;
  held_bits = held_group;
  gravity_bits = all_bit;
  grow(4);
}

void SmallAtoms::grow(int new_room) {
  const std::size_t n = static_cast<std::size_t>(new_room);
  for (std::vector<double>* three : {&x_, &v_, &omega_, &f_, &torque_, &arm_}) three->resize(3 * n);
  for (std::vector<double>* one : {&radius_, &mass_, &colour}) one->resize(n);
  for (std::vector<int>* one : {&tag_, &type_, &groups_, &clump_}) one->resize(n);
  histories_.resize(n);
  room = new_room;
  for (FollowsAtoms* follower : followers) follower->grow(new_room);
  renew();
}

void SmallAtoms::fit(int new_room) {
  const std::size_t n = static_cast<std::size_t>(new_room);
  for (std::vector<double>* three : {&x_, &v_, &omega_, &f_, &torque_, &arm_})
    *three = std::vector<double>(three->begin(), three->begin() + 3 * static_cast<std::ptrdiff_t>(n));
  room = new_room;
  for (std::vector<double>* one : {&radius_, &mass_, &colour}) one->resize(n);
  for (std::vector<int>* one : {&tag_, &type_, &groups_, &clump_}) one->resize(n);
  histories_.resize(n);
  renew();
}

void SmallAtoms::renew() {
  x = x_.data();
  v = v_.data();
  omega = omega_.data();
  f = f_.data();
  torque = torque_.data();
  radius = radius_.data();
  mass = mass_.data();
  tag = tag_.data();
  type = type_.data();
  groups = groups_.data();
  clump = clump_.data();
}

void SmallAtoms::copy(int from, int to) {
  const std::size_t a = static_cast<std::size_t>(from), b = static_cast<std::size_t>(to);
  for (std::vector<double>* three : {&x_, &v_, &omega_, &f_, &torque_, &arm_}) std::copy_n(&(*three)[3 * a], 3, &(*three)[3 * b]);
  for (std::vector<double>* one : {&radius_, &mass_, &colour}) (*one)[b] = (*one)[a];
  for (std::vector<int>* one : {&tag_, &type_, &groups_, &clump_}) (*one)[b] = (*one)[a];
  histories_[b] = Histories(histories_[a]);
  for (FollowsAtoms* follower : followers) follower->copy(from, to);
}

void SmallAtoms::swap(int i, int j) {
  ghosts = 0;
  if (owned == room) grow(2 * room);
  copy(i, owned);
  copy(j, i);
  copy(owned, j);
}

int SmallAtoms::append() {
  ghosts = 0;
  world_.contacts.rows_are_invalid();
  if (owned == room) grow(2 * room);
  const std::size_t i = static_cast<std::size_t>(owned++);
  for (std::vector<double>* three : {&x_, &v_, &omega_, &f_, &torque_, &arm_}) std::fill_n(&(*three)[3 * i], 3, 0.0);
  histories_[i].clear();
  type_[i] = 1;
  groups_[i] = all_bit;
  clump_[i] = 0;
  colour[i] = 0;
  for (FollowsAtoms* follower : followers) follower->reset(static_cast<int>(i));
  return static_cast<int>(i);
}

int SmallAtoms::append_ghost() {
  if (owned + ghosts == room) grow(2 * room);
  const int i = owned + ghosts++;
  histories_[static_cast<std::size_t>(i)].clear();
  return i;
}

int SmallAtoms::find(int wanted) const {
  const auto found = std::find(tag_.begin(), tag_.begin() + owned, wanted);
  return found == tag_.begin() + owned ? -1 : static_cast<int>(found - tag_.begin());
}

void SmallAtoms::pack(int i, std::vector<double>& record, int& layout) {
  const std::size_t k = static_cast<std::size_t>(i);
  layout = 0;
  record.resize(static_cast<std::size_t>(words_in(world_.deck)));
  std::copy_n(x + 3 * k, 3, &record[at_word]);
  std::copy_n(v + 3 * k, 3, &record[velocity_word]);
  std::copy_n(omega + 3 * k, 3, &record[spin_word]);
  record[radius_word] = radius[i];
  record[mass_word] = mass[i];
  record[tag_word] = tag[i];
  record[type_word] = type[i];
  record[groups_word] = groups[i];
  record[colour_word] = colour[k];
  if (!world_.deck.clumps) return;
  record[clump_word] = clump[i];
  std::copy_n(&arm_[3 * k], 3, &record[arm_word]);
}

std::vector<int> SmallAtoms::motion_words(int, bool positions, bool spins) {
  std::vector<int> numbers;
  for (int w = positions ? at_word : velocity_word; w < (spins ? radius_word : spin_word); ++w) numbers.push_back(w);
  return numbers;
}

int SmallAtoms::groups_of(const std::vector<double>& record, int) { return static_cast<int>(record[groups_word]); }

void SmallAtoms::take_out(int i) {
  ghosts = 0;
  world_.contacts.rows_are_invalid();
  copy(owned - 1, i);
  --owned;
}

int SmallAtoms::put_back(const std::vector<double>& record, int layout) {
  if (layout != 0 || record.size() < static_cast<std::size_t>(words_in(world_.deck)))
    throw std::logic_error("a record of another layout");
  const int i = append();
  const std::size_t k = static_cast<std::size_t>(i);
  std::copy_n(&record[at_word], 3, x + 3 * k);
  std::copy_n(&record[velocity_word], 3, v + 3 * k);
  std::copy_n(&record[spin_word], 3, omega + 3 * k);
  radius_[k] = record[radius_word];
  mass_[k] = record[mass_word];
  tag_[k] = static_cast<int>(record[tag_word]);
  type_[k] = static_cast<int>(record[type_word]);
  groups_[k] = static_cast<int>(record[groups_word]);
  colour[k] = record[colour_word];
  if (!world_.deck.clumps) return i;
  clump_[k] = static_cast<int>(record[clump_word]);
  std::copy_n(&record[arm_word], 3, &arm_[3 * k]);
  return i;
}

void SmallAtoms::wrap(int i) { set_place(i, world_.run.wrapped(place(i))); }

void SmallAtoms::set_size(int i, double radius, double mass) {
  radius_[static_cast<std::size_t>(i)] = radius;
  mass_[static_cast<std::size_t>(i)] = mass;
}

void SmallAtoms::set_clump(int i, int number, const Vec3& arm) {
  clump[i] = number;
  set(&arm_[3 * static_cast<std::size_t>(i)], arm);
}

int SmallAtoms::layout_from_text(const std::string& text) {
  const auto known = std::find(texts_.begin(), texts_.end(), text);
  if (known != texts_.end()) return static_cast<int>(known - texts_.begin());
  texts_.push_back(text);
  return layouts() - 1;
}

void SmallAtoms::publish_counts(std::int64_t returned, std::int64_t atoms, bool) {
  published = atoms;
  returned_last = returned;
}

void SmallAtoms::count_more(std::int64_t returned) {
  published += returned;
  returned_last = returned;
}

// ------------------------------------------------------------------------------------------------------------ contacts

void SmallContacts::build() {
  const Atoms& atoms = world_.atoms;
  const std::size_t owned = static_cast<std::size_t>(atoms.owned);
  partners_.assign(owned, {});
  row_.resize(owned);
  count_.resize(owned);
  first_.resize(owned);
  for (int i = 0; i < atoms.owned; ++i)
    for (int j = i + 1; j < atoms.owned + atoms.ghosts; ++j) {
      if (world_.clumps.of(i) && world_.clumps.of(i) == world_.clumps.of(j)) continue;
      const double reach = atoms.radius[i] + atoms.radius[j] + world_.run.skin;
      if ((atoms.place(i) - atoms.place(j)).squaredNorm() < reach * reach)
        partners_[static_cast<std::size_t>(i)].push_back(j % 2 ? j | mark_ : j);
    }
  for (std::size_t i = 0; i < owned; ++i) {
    row_[i] = static_cast<int>(i);
    count_[i] = static_cast<int>(partners_[i].size());
    first_[i] = partners_[i].data();
  }
  valid_ = true;
  for (int i = 0; i < atoms.owned; ++i) {
    SmallAtoms::Histories& all = world_.atoms.histories(i);
    for (auto h = all.begin(); h != all.end();) h = listed(atoms.tag[i], h->first) ? std::next(h) : all.erase(h);
  }
}

bool SmallContacts::listed(int tag, int other) const {
  bool found = false;
  const Atoms& atoms = world_.atoms;
  neighbours().for_each_pair(atoms.owned, [&](int i, int j, int) {
    found = found || (atoms.tag[i] == tag && atoms.tag[j] == other) || (atoms.tag[i] == other && atoms.tag[j] == tag);
  });
  return found;
}

NeighbourRows SmallContacts::neighbours() const {
  if (!valid_) throw std::logic_error("neighbour lists were asked for while atoms come and go");
  return {static_cast<int>(row_.size()), row_.data(), count_.data(), first_.data(), mask_};
}

HistoryRows SmallContacts::histories() const {
  if (!width) return {};
  const std::size_t owned = static_cast<std::size_t>(world_.atoms.owned);
  history_count_.assign(owned, 0);
  history_partner_.assign(owned, {});
  history_numbers_.assign(owned, {});
  partner_rows_.resize(owned);
  number_rows_.resize(owned);
  for (std::size_t i = 0; i < owned; ++i) {
    for (const auto& [tag, numbers] : world_.atoms.histories(static_cast<int>(i))) {
      ++history_count_[i];
      history_partner_[i].push_back(tag);
      history_numbers_[i].insert(history_numbers_[i].end(), numbers.begin(), numbers.end());
    }
    partner_rows_[i] = history_partner_[i].data();
    number_rows_[i] = history_numbers_[i].data();
  }
  return {history_count_.data(), partner_rows_.data(), number_rows_.data(), width};
}

void SmallContacts::give_histories(int i, const History* contacts, std::size_t n) {
  for (std::size_t k = 0; k < n; ++k) {
    std::array<double, 3> numbers;
    std::copy_n(contacts[k].numbers, 3, numbers.begin());
    world_.atoms.histories(i).emplace(static_cast<int>(contacts[k].partner), numbers);
  }
}

void SmallContacts::clear_histories(int i) { world_.atoms.histories(i).clear(); }

/// On i by j, with this length of the spring along the surface; `sheared` receives what it is after dt.
Vec3 SmallContacts::force(int i, int j, const Vec3& spring, Vec3* sheared, double dt) const {
  const Atoms& atoms = world_.atoms;
  const SmallDeck& deck = world_.deck;
  const Vec3 to_j = atoms.place(j) - atoms.place(i);
  const double distance = to_j.norm(), overlap = atoms.radius[i] + atoms.radius[j] - distance;
  if (overlap <= 0) return Vec3::Zero();
  const Vec3 n = to_j / distance;
  // of i's surface against j's
  const Vec3 v = (atoms.velocity(i) + atoms.spin(i).cross(atoms.radius[i] * n)) -
                 (atoms.velocity(j) - atoms.spin(j).cross(atoms.radius[j] * n));
  const Vec3 slip = v - along(v, n);
  const double press = std::max(0.0, deck.stiffness * overlap + deck.damping * v.dot(n));
  Vec3 length = spring - along(spring, n) + slip * dt;
  Vec3 shear = -deck.shear_stiffness * length;
  const double most = deck.friction * press;
  if (shear.norm() > most) {
    length *= most / shear.norm();
    shear *= most / shear.norm();
  }
  if (sheared) *sheared = length;
  return -press * n + shear;
}

Vec3 SmallContacts::force_on_first(int i, int k) {
  const int j = partners_.at(static_cast<std::size_t>(i)).at(static_cast<std::size_t>(k)) & mask_;
  const SmallAtoms::Histories& all = world_.atoms.histories(i);
  const auto h = all.find(world_.atoms.tag[j]);
  return force(i, j, h == all.end() ? Vec3(Vec3::Zero()) : vec(h->second.data()), nullptr, 0);
}

Vec3 SmallContacts::force_on_first(int i, int j, const double* history) {
  return force(i, j, history && width ? vec(history) : Vec3(Vec3::Zero()), nullptr, 0);
}

void SmallContacts::leave_out_pairs_within(const std::vector<std::int64_t>& body) {
  SmallAtoms& atoms = world_.atoms;
  for (int i = 0; i < atoms.owned; ++i) {
    if (!body.at(static_cast<std::size_t>(i))) continue;
    std::vector<int>& row = partners_[static_cast<std::size_t>(i)];
    row.erase(std::remove_if(row.begin(), row.end(),
                             [&](int partner) {
                               const int j = partner & mask_;
                               if (body.at(static_cast<std::size_t>(j)) != body[static_cast<std::size_t>(i)]) return false;
                               atoms.histories(i).erase(atoms.tag[j]);
                               if (j < atoms.owned) atoms.histories(j).erase(atoms.tag[i]);
                               return true;
                             }),
              row.end());
    count_[static_cast<std::size_t>(i)] = static_cast<int>(row.size());
  }
}

void SmallContacts::add_forces() {
  SmallAtoms& atoms = world_.atoms;
  neighbours().for_each_pair(atoms.owned, [&](int i, int j, int) {
    SmallAtoms::Histories& all = atoms.histories(i);
    const Vec3 to_j = atoms.place(j) - atoms.place(i);
    const double distance = to_j.norm();
    if (distance >= atoms.radius[i] + atoms.radius[j]) {
      all.erase(atoms.tag[j]);
      if (j < atoms.owned) atoms.histories(j).erase(atoms.tag[i]);
      return;
    }
    const auto known = all.find(atoms.tag[j]);
    Vec3 length;
    const Vec3 f =
        force(i, j, width && known != all.end() ? vec(known->second.data()) : Vec3(Vec3::Zero()), &length, world_.run.dt);
    const Vec3 n = to_j / distance;
    const auto load = [&](int k, const Vec3& by, double radius, const Vec3& outward) {
      set(atoms.f + 3 * std::size_t(k), atoms.force(k) + by);
      const double arm = world_.deck.arms_meet ? radius - 0.5 * (atoms.radius[i] + atoms.radius[j] - distance) : radius;
      set(atoms.torque + 3 * std::size_t(k), vec(atoms.torque + 3 * std::size_t(k)) + (arm * outward).cross(by));
    };
    load(i, f, atoms.radius[i], n);
    if (width) all[atoms.tag[j]] = {length[0], length[1], length[2]};
    if (j >= atoms.owned) return;
    load(j, -f, atoms.radius[j], -n);
    if (width) atoms.histories(j)[atoms.tag[i]] = {-length[0], -length[1], -length[2]};
  });
}

// ------------------------------------------------------------------------------------------------------------ walls

SmallDeck::Mesh SmallDeck::floor(double z, double size, const std::string& name) {
  const double h = 0.5 * size;
  const Vec3 a(-h, -h, z), b(h, -h, z), c(h, h, z), d(-h, h, z);
  Mesh mesh;
  mesh.name = name;
  mesh.triangles = {{a, b, c}, {a, c, d}};
  return mesh;
}

std::vector<SmallWalls::Touch> SmallWalls::find(double gap) const {
  std::vector<Touch> found;
  const Atoms& atoms = world_.atoms;
  const SmallDeck& deck = world_.deck;
  for (int i = 0; i < atoms.owned; ++i) {
    const Vec3 x = atoms.place(i);
    for (std::size_t p = 0; p < deck.planes.size(); ++p) {
      const SmallDeck::Plane& plane = deck.planes[p];
      const Vec3 to_wall = -along(x - plane.point, plane.normal);
      const double apart = (x - plane.point).dot(plane.normal) - atoms.radius[i];
      if (apart < gap) found.push_back({i, to_wall, apart, static_cast<int>(p), -1, -1, plane.moving});
    }
    for (std::size_t m = 0; m < deck.meshes.size(); ++m) {
      std::vector<Touch> touches;
      for (std::size_t t = 0; t < deck.meshes[m].triangles.size(); ++t) {
        const Vec3 to_wall = nearest_of_triangle(deck.meshes[m].triangles[t].data(), x) - x;
        const double apart = to_wall.norm() - atoms.radius[i];
        if (apart < gap)
          touches.push_back({i, to_wall, apart, -1, static_cast<int>(m), static_cast<int>(t), deck.meshes[m].moving});
      }
      // what lies in one plane is one wall: its edges are none
      std::stable_sort(touches.begin(), touches.end(), [](const Touch& a, const Touch& b) { return a.gap < b.gap; });
      std::vector<Vec3> seen;
      for (const Touch& t : touches) {
        if (std::any_of(seen.begin(), seen.end(),
                        [&](const Vec3& s) { return std::abs((t.to_wall - s).dot(s.normalized())) < 1e-9 * atoms.radius[i]; }))
          continue;
        seen.push_back(t.to_wall);
        found.push_back(t);
      }
    }
  }
  return found;
}

std::vector<WallContact> SmallWalls::contacts() const {
  std::vector<WallContact> all;
  for (const Touch& t : find(world_.run.skin)) {
    const bool half = t.mesh >= 0 && !t.moving;
    if (!half || t.gap < 0.5 * world_.run.skin) all.push_back({t.granule, t.to_wall, t.gap, t.moving});
  }
  return all;
}

std::vector<WallTriangle> SmallWalls::triangles() const {
  std::vector<WallTriangle> all;
  for (std::size_t m = 0; m < world_.deck.meshes.size(); ++m)
    for (std::size_t t = 0; t < world_.deck.meshes[m].triangles.size(); ++t)
      all.push_back(triangle_of(world_.deck.meshes[m], static_cast<int>(m), static_cast<int>(t)));
  return all;
}

bool SmallWalls::near(const WallTriangle& t, const Sphere& s, double gap) const {
  return (nearest_of_triangle(t.corner, s.centre) - s.centre).norm() - s.radius < gap;
}

bool SmallWalls::primitive_near(const Sphere& s, double gap) const {
  return std::any_of(world_.deck.planes.begin(), world_.deck.planes.end(),
                     [&](const SmallDeck::Plane& p) { return (s.centre - p.point).dot(p.normal) - s.radius < gap; });
}

std::vector<double> SmallWalls::fingerprint() const {
  std::vector<double> f;
  for (const SmallDeck::Plane& p : world_.deck.planes)
    if (!p.moving)
      for (const Vec3& v : {p.point, p.normal}) f.insert(f.end(), v.data(), v.data() + 3);
  for (const SmallDeck::Mesh& m : world_.deck.meshes)
    for (const auto& corners : m.triangles)
      for (const Vec3& v : corners)
        if (!m.moving) f.insert(f.end(), v.data(), v.data() + 3);
  for (const std::string& name : names()) f.insert(f.end(), name.begin(), name.end());
  return f;
}

std::uint64_t SmallWalls::part_of_sum() const {
  WordSum sum;
  for (const double x : fingerprint()) sum.add(x);
  return world_.ranks.me == 0 ? sum.value() : 0;
}

const std::vector<std::string>& SmallWalls::mesh_names() const {
  mesh_names_.clear();
  for (const SmallDeck::Mesh& m : world_.deck.meshes) mesh_names_.push_back(m.name);
  return mesh_names_;
}

std::vector<std::string> SmallWalls::names() const {
  std::vector<std::string> all;
  for (const SmallDeck::Plane& p : world_.deck.planes) all.push_back(p.name);
  for (const SmallDeck::Mesh& m : world_.deck.meshes) all.push_back(m.name);
  std::sort(all.begin(), all.end());
  return all;
}

std::vector<WallLoad> SmallWalls::loads_on(std::int64_t tag) {
  std::vector<WallLoad> loads;
  for (const auto& s : seen_)
    if (s.first == tag) loads.push_back(s.second);
  return loads;
}

void SmallWalls::press(int mesh, int element, const Vec3& force, const Vec3& torque) {
  if (mesh < 0 || static_cast<std::size_t>(mesh) >= world_.deck.meshes.size()) return;
  Borne& b = borne[{mesh, element}];
  b.force += force;
  b.torque += torque;
  b.pressed += force;
}

Vec3 SmallWalls::borne_by_meshes() const {
  Vec3 sum = Vec3::Zero();
  for (const auto& b : borne) sum += b.second.force;
  return sum;
}

void SmallWalls::begin_step() {
  borne.clear();
  seen_.clear();
}

void SmallWalls::move() {
  for (SmallDeck::Plane& p : world_.deck.planes)
    if (p.moving) p.point += world_.run.dt * p.velocity;
}

void SmallWalls::add_forces() {
  SmallAtoms& atoms = world_.atoms;
  const SmallDeck& deck = world_.deck;
  for (const Touch& t : find(0)) {
    const int i = t.granule;
    const Vec3 n = t.to_wall.normalized();
    const Vec3 wall = t.plane >= 0 ? deck.planes[static_cast<std::size_t>(t.plane)].velocity : Vec3(Vec3::Zero());
    const Vec3 v = atoms.velocity(i) + atoms.spin(i).cross(t.to_wall) - wall;
    const Vec3 slip = v - along(v, n);
    const double press = std::max(0.0, -deck.stiffness * t.gap + deck.damping * v.dot(n));
    const double drag = std::min(deck.damping * slip.norm(), deck.friction * press);
    const Vec3 force = -press * n - (slip.norm() > 0 ? Vec3(drag * slip.normalized()) : Vec3(Vec3::Zero()));
    set(atoms.f + 3 * std::size_t(i), atoms.force(i) + force);
    set(atoms.torque + 3 * std::size_t(i), vec(atoms.torque + 3 * std::size_t(i)) + t.to_wall.cross(force));
    if (t.mesh < 0) continue;
    const SmallDeck::Mesh& mesh = deck.meshes[static_cast<std::size_t>(t.mesh)];
    WallLoad load;
    load.mesh = t.mesh;
    load.element = t.element;
    load.force = force;
    load.torque = (atoms.place(i) + t.to_wall - mesh.reference).cross(force);
    Borne& b = borne[{t.mesh, t.element}];
    b.force -= load.force;
    b.torque -= load.torque;
    if (mesh.reports_load && !mesh.moving) seen_.emplace_back(atoms.tag[i], load);
  }
}

// ------------------------------------------------------------------------------------------------------------ the rest

bool SmallInsertions::any_due(std::int64_t step) const {
  return std::any_of(world_.deck.sources.begin(), world_.deck.sources.end(), [&](const auto& s) { return s.next == step; });
}

std::vector<Box> SmallInsertions::due_boxes(double largest) const {
  std::vector<Box> all;
  for (const SmallDeck::Source& s : world_.deck.sources) {
    const std::int64_t steps = s.next - world_.run.step;
    if (steps == 0 || steps == 1) all.push_back(s.box.grown_by(s.radius + largest));
  }
  return all;
}

Vec3 SmallRun::gravity() const { return world_.deck.gravity; }

Vec3 SmallRun::wrapped(const Vec3& place) const {
  Vec3 x = place;
  const Vec3 edge = edges();
  for (int d = 0; d < 3; ++d) {
    if (!periodic[static_cast<std::size_t>(d)]) continue;
    while (x[d] < box.lo[d]) x[d] += edge[d];
    while (x[d] >= box.hi[d]) x[d] -= edge[d];
  }
  return x;
}

bool SmallRun::ask_for_reneighbouring(std::int64_t at) {
  const bool is_new = asked != at;
  asked = at;
  return is_new;
}

void SmallRun::say(const std::string& line) const {
  if (world_.ranks.me == 0) said.push_back(line);
}

void SmallMemory::fit() {
  ++fits;
  large = false;
  world_.atoms.fit(world_.atoms.owned + world_.atoms.ghosts + 1);
}

// ------------------------------------------------------------------------------------------------------------ the world

SmallWorld::SmallWorld(const SmallDeck& its_deck, Meeting* meeting, int rank, int rank_count)
    : deck(its_deck),
      atoms(*this),
      clumps(*this),
      contacts(*this),
      walls(*this),
      insertions(*this),
      ranks(*this, meeting, rank, rank_count),
      run(*this),
      memory(*this) {
  run.dt = deck.dt;
  run.skin = deck.skin;
  run.box = deck.box;
  run.periodic = deck.periodic;
  run.kept = deck.box;
  for (int d = 0; d < 3; ++d)
    if (deck.periodic[static_cast<std::size_t>(d)]) {
      run.kept.lo[d] = -HUGE_VAL;
      run.kept.hi[d] = HUGE_VAL;
    }
  run.name = "cull";
  if (deck.gravity.isZero(0)) atoms.gravity_bits = 0;
  ranks.update();
}

double SmallWorld::mass_of(double radius) const { return deck.density * 4.0 / 3.0 * pi * radius * radius * radius; }

Vec3 SmallWorld::image_shift(const Vec3& by) const {
  Vec3 shift = Vec3::Zero();
  for (int d = 0; d < 3; ++d)
    if (run.periodic[static_cast<std::size_t>(d)]) shift[d] = run.edges()[d] * std::round(by[d] / run.edges()[d]);
  return shift;
}

int SmallWorld::add(int tag, const Vec3& place, double radius, const Vec3& velocity, const Vec3& spin) {
  if (!ranks.owns(place)) return -1;
  std::vector<double> record(static_cast<std::size_t>(words_in(deck)), 0.0);
  set(&record[at_word], place);
  set(&record[velocity_word], velocity);
  set(&record[spin_word], spin);
  record[radius_word] = radius;
  record[mass_word] = mass_of(radius);
  record[tag_word] = tag;
  record[type_word] = 1;
  record[groups_word] = SmallAtoms::all_bit;
  record[colour_word] = 0.1 * tag;
  return atoms.put_back(record, 0);
}

/// An atom as other ranks see it.
struct SmallWorld::Row {
  Triple x, v, omega;
  double radius, mass;
  int tag, type, groups, clump;
};

std::vector<SmallWorld::Row> SmallWorld::owned_rows() const {
  std::vector<Row> rows;
  for (int i = 0; i < atoms.owned; ++i)
    rows.push_back({triple(atoms.place(i)), triple(atoms.velocity(i)), triple(atoms.spin(i)), atoms.radius[i], atoms.mass[i],
                    atoms.tag[i], atoms.type[i], atoms.groups[i], atoms.clump[i]});
  return rows;
}

void SmallWorld::take_row(int i, const Row& row, const Vec3& shift) {
  atoms.set_place(i, vec(row.x) + shift);
  atoms.set_velocity(i, vec(row.v));
  atoms.set_spin(i, vec(row.omega));
  const_cast<double*>(atoms.radius)[i] = row.radius;
  const_cast<double*>(atoms.mass)[i] = row.mass;
  const_cast<int*>(atoms.tag)[i] = row.tag;
  const_cast<int*>(atoms.type)[i] = row.type;
  atoms.groups[i] = row.groups;
  atoms.clump[i] = row.clump;
}

void SmallWorld::exchange() {
  exchange_atoms();
  clumps.exchange();
}

/// Atoms go to the rank that owns their place; those outside of a box that is not periodic are lost.
void SmallWorld::exchange_atoms() {
  atoms.drop_ghosts();
  contacts.rows_are_invalid();
  std::vector<double> out;
  for (int i = atoms.owned - 1; i >= 0; --i) {
    atoms.wrap(i);
    const Vec3 x = atoms.place(i);
    bool inside = true;
    for (int d = 0; d < 3; ++d)
      inside = inside && (run.periodic[static_cast<std::size_t>(d)] || (x[d] >= run.box.lo[d] && x[d] < run.box.hi[d]));
    if (inside && ranks.owns(x)) continue;
    if (inside) {
      std::vector<double> record;
      int layout = 0;
      atoms.pack(i, record, layout);
      record.push_back(static_cast<double>(atoms.histories(i).size()));
      for (const auto& [partner, numbers] : atoms.histories(i)) {
        record.push_back(partner);
        record.insert(record.end(), numbers.begin(), numbers.end());
      }
      for (FollowsAtoms* follower : atoms.followers) {
        const std::size_t at = record.size();
        record.resize(at + static_cast<std::size_t>(follower->packed_size()));
        follower->pack(i, record.data() + at);
      }
      out.push_back(static_cast<double>(record.size()));
      out.insert(out.end(), record.begin(), record.end());
    }
    atoms.take_out(i);
  }
  if (ranks.count == 1) return;
  const auto all = ranks.all("the engine's exchange", out.data(), out.size() * sizeof(double));
  for (const auto& bytes : all) {
    std::vector<double> in(bytes.size() / sizeof(double));
    if (!in.empty()) std::memcpy(in.data(), bytes.data(), bytes.size());
    for (std::size_t at = 0; at < in.size();) {
      const std::size_t length = static_cast<std::size_t>(in[at++]);
      const double* one = &in[at];
      at += length;
      if (!ranks.owns(vec(one))) continue;
      const int i = atoms.put_back(std::vector<double>(one, one + words_in(deck)), 0);
      one += words_in(deck);
      for (int k = static_cast<int>(*one++); k > 0; --k, one += 4)
        atoms.histories(i)[static_cast<int>(one[0])] = {one[1], one[2], one[3]};
      for (FollowsAtoms* follower : atoms.followers) {
        follower->unpack(i, one);
        one += follower->packed_size();
      }
      if (on_arrival) on_arrival(i);
    }
  }
}

void SmallWorld::borders() {
  ++builds;
  if (atoms.sort_asked)  // any order will do
    for (int i = 0, j = atoms.owned - 1; i < j; ++i, --j) atoms.swap(i, j);
  atoms.sort_asked = false;
  atoms.drop_ghosts();
  ghosts_.clear();
  built_at_.clear();
  for (int i = 0; i < atoms.owned; ++i) built_at_.push_back(atoms.place(i));
  double largest = 0;
  for (int i = 0; i < atoms.owned; ++i) largest = std::max(largest, atoms.radius[i]);
  ranks.largest(&largest, 1);
  const double reach = 2 * largest + run.skin;
  ranks.update();
  const std::vector<Row> mine = owned_rows();
  const auto all = ranks.all("the engine's borders", mine.data(), mine.size() * sizeof(Row));
  for (int rank = 0; rank < ranks.count; ++rank) {
    const auto& bytes = all[static_cast<std::size_t>(rank)];
    std::vector<Row> rows(bytes.size() / sizeof(Row));
    if (!rows.empty()) std::memcpy(rows.data(), bytes.data(), bytes.size());
    for (const Vec3& shift : ranks.image_shifts()) {
      if (rank == ranks.me && shift.isZero(0)) continue;
      for (std::size_t k = 0; k < rows.size(); ++k) {
        const Vec3 x = vec(rows[k].x) + shift;
        if (((ranks.own().lo - x).array() > reach).any() || ((x - ranks.own().hi).array() > reach).any()) continue;
        ghosts_.push_back({rank, static_cast<int>(k), shift});
        take_row(atoms.append_ghost(), rows[k], shift);
      }
    }
  }
}

void SmallWorld::refresh_ghosts() {
  if (!ranks.has_neighbours()) return;
  const std::vector<Row> mine = owned_rows();
  const auto all = ranks.all("the engine's ghosts", mine.data(), mine.size() * sizeof(Row));
  for (std::size_t g = 0; g < ghosts_.size(); ++g) {
    Row row;
    std::memcpy(&row, &all[static_cast<std::size_t>(ghosts_[g].rank)][static_cast<std::size_t>(ghosts_[g].index) * sizeof(Row)],
                sizeof row);
    take_row(atoms.owned + static_cast<int>(g), row, ghosts_[g].shift);
  }
}

bool SmallWorld::moved_too_far() {
  bool far = false;
  for (int i = 0; i < atoms.owned; ++i)
    far = far || (atoms.place(i) - built_at_[static_cast<std::size_t>(i)]).norm() > 0.5 * run.skin;
  return ranks.any(far);
}

void SmallWorld::compute_forces() {
  for (int i = 0; i < atoms.owned; ++i) atoms.clear_load(i);
  walls.begin_step();
  contacts.add_forces();
  walls.add_forces();
  for (int i = 0; i < atoms.owned; ++i)
    if ((atoms.groups[i] & atoms.gravity_bits) && !clumps.of(i))
      set(atoms.f + 3 * std::size_t(i), atoms.force(i) + atoms.mass[i] * deck.gravity);
  clumps.take_loads();
}

void SmallWorld::kick(int i) {
  atoms.set_velocity(i, atoms.velocity(i) + 0.5 * run.dt / atoms.mass[i] * atoms.force(i));
  const double half = 0.5 * run.dt / inertia(atoms.mass[i], atoms.radius[i]);
  atoms.set_spin(i, atoms.spin(i) + half * vec(atoms.torque + 3 * std::size_t(i)));
}

void SmallWorld::integrate_first_half() {
  for (int i = 0; i < atoms.owned; ++i) {
    if (!(atoms.groups[i] & atoms.movable_bits) || clumps.of(i)) continue;
    kick(i);
    atoms.set_place(i, atoms.place(i) + run.dt * atoms.velocity(i));
  }
  clumps.kick();
  clumps.drift();
  walls.move();
}

void SmallWorld::integrate_second_half() {
  for (int i = 0; i < atoms.owned; ++i)
    if ((atoms.groups[i] & atoms.movable_bits) && !clumps.of(i)) kick(i);
  clumps.kick();
  clumps.give_velocities();
}

Vec3 SmallWorld::momentum() const {
  Vec3 p = Vec3::Zero();
  for (int i = 0; i < atoms.owned; ++i)
    if (!clumps.of(i)) p += atoms.mass[i] * atoms.velocity(i);
  for (int k = 0; k < clumps.count(); ++k) p += clumps.clump(k).mass * clumps.clump(k).velocity;
  return p;
}

double SmallWorld::kinetic_energy() const {
  double e = 0;
  for (int k = 0; k < clumps.count(); ++k) e += clumps.clump(k).kinetic_energy();
  for (int i = 0; i < atoms.owned; ++i)
    if (!clumps.of(i))
      e += 0.5 * atoms.mass[i] * atoms.velocity(i).squaredNorm() +
           0.5 * inertia(atoms.mass[i], atoms.radius[i]) * atoms.spin(i).squaredNorm();
  return e;
}

void SmallWorld::follow(Culling& culling) {
  atoms.followers = culling.followers();
  for (FollowsAtoms* follower : atoms.followers) follower->grow(atoms.room);
  for (int i = 0; i < atoms.owned; ++i)
    for (FollowsAtoms* follower : atoms.followers) follower->reset(i);
  on_arrival = [&culling](int i) { culling.arrived_from_another_rank(i); };
}

void SmallWorld::begin_run(Culling* culling) {
  if (culling) culling->begin_run();
  if (culling) culling->set_up_atoms();
  exchange();
  borders();
  if (culling) culling->take_neighbours();
  contacts.build();
  if (culling) culling->note_new_lists();
  if (culling) culling->leave_out_inner_pairs();
  compute_forces();
  if (culling) culling->end_setup();
}

void SmallWorld::step(Culling* culling) {
  ++run.step;
  if (culling) culling->initial_step();
  integrate_first_half();
  if (culling) culling->integrate();
  if (moved_too_far() || run.asked == run.step) {
    if (culling) culling->change();
    exchange();
    borders();
    if (culling) culling->take_neighbours();
    contacts.build();
  } else {
    refresh_ghosts();
  }
  if (culling) culling->leave_out_inner_pairs();
  compute_forces();
  if (culling) culling->take_forces();
  integrate_second_half();
  if (culling) culling->finish_step();
  if (culling) culling->write_outputs();
}

}  // namespace solidcull
