// What a part of the culling keeps for each atom, in step with the engine's own arrays.
#pragma once

#include <cstddef>
#include <vector>

namespace solidcull {

/// The engine's side of it: called when its arrays grow, when an atom takes another index, is made, goes to another rank or into
/// a restart file. Each part packs its own.
class FollowsAtoms {
 public:
  virtual ~FollowsAtoms() = default;
  virtual void grow(int room) = 0;  ///< never smaller, but for fit()
  virtual void copy(int from, int to) = 0;
  virtual void reset(int i) = 0;        ///< a new atom
  virtual int packed_size() const = 0;  ///< doubles
  virtual void pack(int i, double* to) const = 0;
  virtual void unpack(int i, const double* from) = 0;
  virtual void fit(int room) = 0;  ///< to the engine's arrays, which were cut
};

/// Row: a struct with `packed_size`, pack(double*) and static unpack(const double*).
template <class Row>
class PerGranule : public FollowsAtoms {
 public:
  void grow(int room) override { rows_.resize(static_cast<std::size_t>(room)); }
  void copy(int from, int to) override { rows_[to] = rows_[from]; }
  void reset(int i) override { rows_[i] = Row(); }
  int packed_size() const override { return Row::packed_size; }
  void pack(int i, double* to) const override { rows_[i].pack(to); }
  void unpack(int i, const double* from) override { rows_[i] = Row::unpack(from); }
  void fit(int room) override {
    rows_.resize(static_cast<std::size_t>(room));
    rows_.shrink_to_fit();
  }

  Row& operator[](int i) { return rows_[static_cast<std::size_t>(i)]; }
  const Row& operator[](int i) const { return rows_[static_cast<std::size_t>(i)]; }
  std::size_t bytes() const { return rows_.capacity() * sizeof(Row); }

 private:
  std::vector<Row> rows_;
};

}  // namespace solidcull
