#include "implicit_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace solidcull {

namespace {

constexpr int block_edge = 8;  // voxels
constexpr int block_shift = 3;

/// Squared distance of x from the interval of voxel centres lo .. lo + 7 (voxel units).
double squared_gap(double x, std::int32_t block) {
  const double lo = static_cast<double>(block) * block_edge, hi = lo + (block_edge - 1);
  const double gap = x < lo ? lo - x : x > hi ? x - hi : 0.0;
  return gap * gap;
}

/// Blocks whose interval of voxel centres meets [lo, hi].
std::int32_t first_block(double lo) { return static_cast<std::int32_t>(std::ceil((lo - (block_edge - 1)) / block_edge)); }
std::int32_t last_block(double hi) { return static_cast<std::int32_t>(std::floor(hi / block_edge)); }

// Rounding may not drop a sphere or a block; the exact tests come after this margin (voxels).
constexpr double rounding_margin = 1e-6;

}  // namespace

struct ImplicitSurface::Impl {
  /// One bit per voxel of a block, set = void: word i, bit 8 j + k. This is also the layout of an OpenVDB leaf mask.
  using Mask = std::array<std::uint64_t, block_edge>;

  struct BlockKey {
    std::int32_t i, j, k;
    bool operator==(const BlockKey& o) const { return i == o.i && j == o.j && k == o.k; }
  };

  /// A block of the table. `state` is the index of its mask, or one of the marks; most blocks are all solid or all void.
  struct Block {
    enum Mark : std::int32_t { solid = -1, all_void = -2, stale = -3, unused = -4 };
    BlockKey key;
    std::int32_t state = unused;
    std::uint32_t touched = 0;  // the epoch in which it was touched last
  };

  double voxel, closing;
  Gather gather;

  // Open addressing with linear probing: one lookup is one or two cache lines.
  std::vector<Block> table;
  std::size_t used = 0, held = 0, evaluated = 0;
  std::vector<Mask> masks;
  std::vector<std::int32_t> free_masks;

  std::uint32_t epoch = 1;
  std::vector<BlockKey> touched;  // in this epoch
  bool all_touched = false;

  struct Pending {
    double gap2;
    BlockKey key;
  };
  std::vector<Pending> pending;  // scratch of void_within

  Impl(double voxel_, double closing_, Gather gather_)
      : voxel(voxel_), closing(closing_), gather(std::move(gather_)), table(1024) {}

  // --- the table of blocks ---

  std::size_t slot_of(const BlockKey& key) const {
    const std::uint64_t mixed = (static_cast<std::uint64_t>(static_cast<std::uint32_t>(key.i)) * 0x9E3779B97F4A7C15u) ^
                                (static_cast<std::uint64_t>(static_cast<std::uint32_t>(key.j)) * 0xC2B2AE3D27D4EB4Fu) ^
                                (static_cast<std::uint64_t>(static_cast<std::uint32_t>(key.k)) * 0x165667B19E3779F9u);
    const std::size_t last = table.size() - 1;
    std::size_t slot = (mixed ^ mixed >> 32) & last;
    while (table[slot].state != Block::unused && !(table[slot].key == key)) slot = (slot + 1) & last;
    return slot;
  }

  std::int32_t state_of(const BlockKey& key) const {
    const std::int32_t state = table[slot_of(key)].state;
    return state == Block::unused ? std::int32_t(Block::stale) : state;
  }

  /// The block, entered as stale if it is new. The reference lasts until the next call.
  Block& entry(const BlockKey& key) {
    std::size_t slot = slot_of(key);
    if (table[slot].state != Block::unused) return table[slot];
    if (2 * (used + 1) > table.size()) {
      rehash();
      slot = slot_of(key);
    }
    ++used;
    table[slot].key = key;
    table[slot].state = Block::stale;
    return table[slot];
  }

  /// Makes room. Blocks that went stale and were never asked for again (a mass that fell past) are forgotten here.
  void rehash() {
    std::vector<Block> kept;
    for (const Block& b : table)
      if (b.state != Block::unused && (b.state != Block::stale || b.touched == epoch)) kept.push_back(b);
    std::size_t size = 1024;
    while (size < 4 * (kept.size() + 1)) size *= 2;
    table.assign(size, Block());
    used = kept.size();
    for (const Block& b : kept) table[slot_of(b.key)] = b;
  }

  void forget(Block& b) {
    if (b.state == Block::stale) return;
    if (b.state >= 0) free_masks.push_back(b.state);
    b.state = Block::stale;
    --held;
  }

  // --- evaluation ---

  /// The state of a block that was stale: voxel centres within r + closing of a sphere are cleared, row by row.
  std::int32_t evaluate(const BlockKey& key) {
    const Vec3 origin = Vec3(key.i, key.j, key.k) * block_edge;  // voxel units
    const double reach = closing + rounding_margin * voxel;
    const Vec3 lo = (origin * voxel).array() - reach;
    const Vec3 hi = ((origin.array() + (block_edge - 1)) * voxel) + reach;

    Mask mask;
    mask.fill(~std::uint64_t(0));
    std::uint64_t left = ~std::uint64_t(0);
    gather(lo, hi, [&](const Sphere& s) {
      const Vec3 c = s.centre / voxel - origin;
      const double radius = (s.radius + closing) / voxel;
      const Vec3 gap = c - c.cwiseMax(0.0).cwiseMin(block_edge - 1.0);
      if (left != 0 && gap.squaredNorm() < radius * radius) left = clear(mask, c, radius);
    });

    ++evaluated;
    ++held;
    std::int32_t state = Block::solid;
    if (left != 0) {
      const bool full = std::all_of(mask.begin(), mask.end(), [](std::uint64_t w) { return w == ~std::uint64_t(0); });
      state = full ? std::int32_t(Block::all_void) : keep(mask);
    }
    entry(key).state = state;
    return state;
  }

  /// Clears the voxels strictly within `radius` of `c` (voxel units, from the block's first centre); gives the bits left, or-ed.
  static std::uint64_t clear(Mask& mask, const Vec3& c, double radius) {
    const double radius2 = radius * radius;
    std::uint64_t left = 0;
    for (int i = 0; i < block_edge; ++i) {
      const double rest_i = radius2 - (i - c.x()) * (i - c.x());
      if (rest_i > 0 && mask[i] != 0) {
        for (int j = 0; j < block_edge; ++j) {
          const double rest = rest_i - (j - c.y()) * (j - c.y());
          if (rest <= 0) continue;
          // Integers strictly between c.z - half and c.z + half, clamped to 0 .. 7; the casts stand for floor and ceil.
          const double half = std::sqrt(rest);
          const double below = std::min(std::max(c.z() - half, -1.0), double(block_edge));
          const double above = std::min(std::max(c.z() + half, -1.0), double(block_edge));
          const int first = static_cast<int>(below + 1.0);
          const int last = block_edge - 1 - static_cast<int>(block_edge - above);
          if (first > last) continue;
          const std::uint64_t row = (0xFFu >> (block_edge - 1 - last)) & (0xFFu << first);
          mask[i] &= ~(row << (block_edge * j));
        }
      }
      left |= mask[i];
    }
    return left;
  }

  std::int32_t keep(const Mask& mask) {
    if (free_masks.empty()) {
      masks.push_back(mask);
      return static_cast<std::int32_t>(masks.size() - 1);
    }
    const std::int32_t n = free_masks.back();
    free_masks.pop_back();
    masks[n] = mask;
    return n;
  }

  bool is_void(const Voxel& v) {
    const BlockKey key{v.i >> block_shift, v.j >> block_shift, v.k >> block_shift};
    std::int32_t state = state_of(key);
    if (state == Block::stale) state = evaluate(key);
    if (state < 0) return state == Block::all_void;
    const int bit = (v.j & (block_edge - 1)) * block_edge + (v.k & (block_edge - 1));
    return masks[state][v.i & (block_edge - 1)] >> bit & 1;
  }

  // --- search ---

  /// The best void voxel so far. Among equally near ones the smallest (i, j, k) wins, so the order of the search does not matter.
  struct Nearest {
    double d2;
    Voxel voxel = Voxel::nothing();

    void offer(double other_d2, const Voxel& v) {
      if (other_d2 > d2) return;
      if (other_d2 == d2 && !voxel.none() && !before(v, voxel)) return;
      d2 = other_d2;
      voxel = v;
    }
    static bool before(const Voxel& a, const Voxel& b) { return a.i != b.i ? a.i < b.i : a.j != b.j ? a.j < b.j : a.k < b.k; }
  };

  void scan(const BlockKey& key, std::int32_t state, const Vec3& p, Nearest& nearest) const {
    static constexpr Mask everything = {~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull};
    const Mask& mask = state == Block::all_void ? everything : masks[state];
    for (int i = 0; i < block_edge; ++i) {
      const std::int32_t vi = key.i * block_edge + i;
      const double di2 = (vi - p.x()) * (vi - p.x());
      if (mask[i] == 0 || di2 > nearest.d2) continue;
      for (int j = 0; j < block_edge; ++j) {
        unsigned row = mask[i] >> (block_edge * j) & 0xFF;
        if (row == 0) continue;
        const std::int32_t vj = key.j * block_edge + j;
        const double dij2 = di2 + (vj - p.y()) * (vj - p.y());
        if (dij2 > nearest.d2) continue;
        for (; row != 0; row &= row - 1) {
          const std::int32_t vk = key.k * block_edge + __builtin_ctz(row);
          nearest.offer(dij2 + (vk - p.z()) * (vk - p.z()), {vi, vj, vk});
        }
      }
    }
  }

  /// p and reach in voxel units.
  Voxel nearest_void(const Vec3& p, double reach) {
    if (!(reach >= 0)) return Voxel::nothing();
    Nearest nearest{reach * reach};
    const BlockKey home{last_block(p.x() + 0.5), last_block(p.y() + 0.5), last_block(p.z() + 0.5)};

    // What is known already comes first: it often makes the evaluation of the other blocks needless.
    pending.clear();
    const auto look = [&](const BlockKey& key, double gap2) {
      const std::int32_t state = state_of(key);
      if (state == Block::solid) return;
      if (state == Block::stale)
        pending.push_back({gap2, key});
      else
        scan(key, state, p, nearest);
    };
    look(home, 0.0);
    const double r = reach + rounding_margin;
    const BlockKey lo{first_block(p.x() - r), first_block(p.y() - r), first_block(p.z() - r)};
    const BlockKey hi{last_block(p.x() + r), last_block(p.y() + r), last_block(p.z() + r)};
    for (std::int32_t i = lo.i; i <= hi.i; ++i) {
      const double gap_i = squared_gap(p.x(), i);
      for (std::int32_t j = lo.j; j <= hi.j; ++j) {
        const double gap_ij = gap_i + squared_gap(p.y(), j);
        if (gap_ij > nearest.d2) continue;
        for (std::int32_t k = lo.k; k <= hi.k; ++k) {
          const double gap2 = gap_ij + squared_gap(p.z(), k);
          const BlockKey key{i, j, k};
          if (gap2 <= nearest.d2 && !(key == home)) look(key, gap2);
        }
      }
    }

    if (pending.size() > 1)
      std::sort(pending.begin(), pending.end(), [](const Pending& a, const Pending& b) { return a.gap2 < b.gap2; });
    for (const Pending& block : pending) {
      if (block.gap2 > nearest.d2) break;
      const std::int32_t state = evaluate(block.key);
      if (state != Block::solid) scan(block.key, state, p, nearest);
    }
    return nearest.voxel;
  }
};

ImplicitSurface::ImplicitSurface(double voxel, double closing, Gather gather) {
  if (!(voxel > 0) || !std::isfinite(voxel))
    throw std::invalid_argument("ImplicitSurface: voxel " + std::to_string(voxel) + " must be positive and finite");
  if (!(closing >= 0) || !std::isfinite(closing))
    throw std::invalid_argument("ImplicitSurface: closing " + std::to_string(closing) + " must be zero or more");
  if (!gather) throw std::invalid_argument("ImplicitSurface: there is nothing to gather spheres with");
  impl_ = std::make_unique<Impl>(voxel, closing, std::move(gather));
}

ImplicitSurface::~ImplicitSurface() = default;

void ImplicitSurface::touch(const Sphere& s) {
  Impl& m = *impl_;
  const Vec3 c = s.centre / m.voxel;
  const double r = (s.radius + m.closing) / m.voxel + rounding_margin, r2 = r * r;
  const Impl::BlockKey lo{first_block(c.x() - r), first_block(c.y() - r), first_block(c.z() - r)};
  const Impl::BlockKey hi{last_block(c.x() + r), last_block(c.y() + r), last_block(c.z() + r)};
  for (std::int32_t i = lo.i; i <= hi.i; ++i)
    for (std::int32_t j = lo.j; j <= hi.j; ++j)
      for (std::int32_t k = lo.k; k <= hi.k; ++k) {
        if (squared_gap(c.x(), i) + squared_gap(c.y(), j) + squared_gap(c.z(), k) > r2) continue;
        Impl::Block& b = m.entry({i, j, k});
        m.forget(b);
        if (b.touched == m.epoch) continue;
        b.touched = m.epoch;
        m.touched.push_back(b.key);
      }
}

void ImplicitSurface::touch_all() {
  Impl& m = *impl_;
  m.table.assign(1024, Impl::Block());
  m.used = m.held = 0;
  m.masks.clear();
  m.free_masks.clear();
  m.touched.clear();
  m.all_touched = true;
}

Voxel ImplicitSurface::void_within(const Vec3& p, double depth, const Voxel& hint) {
  Impl& m = *impl_;
  const double reach = (depth + m.closing) / m.voxel;
  const Vec3 q = p / m.voxel;
  if (!hint.none() && reach >= 0 && (Vec3(hint.i, hint.j, hint.k) - q).squaredNorm() <= reach * reach && m.is_void(hint))
    return hint;
  return m.nearest_void(q, reach);
}

bool ImplicitSurface::is_void(const Voxel& v) { return !v.none() && impl_->is_void(v); }

Vec3 ImplicitSurface::centre(const Voxel& v) const { return Vec3(v.i, v.j, v.k) * impl_->voxel; }

double ImplicitSurface::depth(const Vec3& p, double max_depth) {
  const Voxel v = void_within(p, max_depth);
  return v.none() ? max_depth : (centre(v) - p).norm() - impl_->closing;
}

std::size_t ImplicitSurface::blocks_evaluated() const { return impl_->evaluated; }
std::size_t ImplicitSurface::blocks_held() const { return impl_->held; }

bool ImplicitSurface::touched_near(const Vec3& p, double reach) const {
  const Impl& m = *impl_;
  if (m.all_touched) return true;
  if (m.touched.empty()) return false;
  const Vec3 c = p / m.voxel;
  const double r = reach / m.voxel + rounding_margin, r2 = r * r;
  const auto near = [&](const Impl::BlockKey& b) {
    return squared_gap(c.x(), b.i) + squared_gap(c.y(), b.j) + squared_gap(c.z(), b.k) <= r2;
  };
  const Impl::BlockKey lo{first_block(c.x() - r), first_block(c.y() - r), first_block(c.z() - r)};
  const Impl::BlockKey hi{last_block(c.x() + r), last_block(c.y() + r), last_block(c.z() + r)};
  const double box = (hi.i - lo.i + 1.0) * (hi.j - lo.j + 1.0) * (hi.k - lo.k + 1.0);
  if (box > static_cast<double>(m.touched.size())) return std::any_of(m.touched.begin(), m.touched.end(), near);
  for (std::int32_t i = lo.i; i <= hi.i; ++i)
    for (std::int32_t j = lo.j; j <= hi.j; ++j)
      for (std::int32_t k = lo.k; k <= hi.k; ++k) {
        const Impl::Block& b = m.table[m.slot_of({i, j, k})];
        if (b.state != Impl::Block::unused && b.touched == m.epoch && near(b.key)) return true;
      }
  return false;
}

void ImplicitSurface::clear_touched() {
  ++impl_->epoch;
  impl_->touched.clear();
  impl_->all_touched = false;
}

}  // namespace solidcull
