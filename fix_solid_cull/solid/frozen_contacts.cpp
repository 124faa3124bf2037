#include "frozen_contacts.h"

#include <algorithm>
#include <stdexcept>

namespace solidcull {

void FrozenContacts::set_layout(std::vector<bool> flips) {
  if (flips == flips_) return;
  if (count_ != 0) throw std::logic_error("the contact history's layout changed while contacts are frozen");
  flips_ = std::move(flips);
  edges_.clear();
  histories_ = ChunkedArray<double>(width());
  first_free_ = none;
}

std::uint32_t FrozenContacts::find(std::int64_t tag, std::int64_t partner) const {
  for (std::uint32_t e = first(tag); e != none; e = next(e, tag))
    if (other(e, tag) == partner) return e;
  return none;
}

bool FrozenContacts::contains(std::int64_t tag, std::int64_t partner) const { return find(tag, partner) != none; }

const double* FrozenContacts::read(std::uint32_t e, std::int64_t tag, double* out) const {
  if (!edges_[e].has_history) return nullptr;
  if (width() == 0) return out;
  const double* from = histories_.row(e);
  const bool turned = edges_[e].low != tag;
  for (std::size_t d = 0; d < width(); ++d) out[d] = turned && flips_[d] ? -from[d] : from[d];
  return out;
}

void FrozenContacts::write(std::uint32_t e, std::int64_t tag, const double* history) {
  edges_[e].has_history = history != nullptr;
  if (!history || width() == 0) return;
  double* to = histories_.row(e);
  const bool turned = edges_[e].low != tag;
  for (std::size_t d = 0; d < width(); ++d) to[d] = turned && flips_[d] ? -history[d] : history[d];
}

std::uint32_t FrozenContacts::link(std::int64_t tag, std::int64_t partner) {
  const std::int32_t low = narrow_tag(std::min(tag, partner)), high = narrow_tag(std::max(tag, partner));
  std::uint32_t e = first_free_;
  if (e == none) {
    if (edges_.size() >= none)
      throw std::length_error("a rank holds 2^31 - 1 contacts of culled granules, the most that it can: use more ranks");
    e = static_cast<std::uint32_t>(edges_.append());
    if (width()) histories_.append();
  } else {
    first_free_ = edges_[e].next_low;
  }
  edges_[e].low = low;
  edges_[e].high = high;
  edges_[e].has_history = false;
  for (const std::int32_t end : {low, high}) {
    std::uint32_t& head = heads_[end];
    set_next(e, end, head == 0 ? none : head - 1);
    head = e + 1;
  }
  ++count_;
  if (reviewed_) to_review_.push_back(e);
  return e;
}

void FrozenContacts::add(std::int64_t tag, std::int64_t partner, const double* history) {
  if (tag == partner) return;  // a granule that touches its own periodic image: no partner to freeze it with
  const std::uint32_t known = find(tag, partner), e = known == none ? link(tag, partner) : known;
  write(e, tag, history);
}

void FrozenContacts::add_unturned(std::int64_t tag, std::int64_t partner, const double* history) {
  if (tag == partner) return;
  const std::uint32_t e = link(tag, partner);
  if (width() == 0) return;
  write(e, tag, history);
  edges_[e].has_history = false;
  unturned_.push_back(e);
}

void FrozenContacts::unlink(std::uint32_t e, std::int64_t tag) {
  const auto key = static_cast<std::int32_t>(tag);
  std::uint32_t* head = heads_.find(key);
  const std::uint32_t after = next(e, tag);
  if (*head == e + 1) {
    if (after == none)
      heads_.erase(key);
    else
      *head = after + 1;
    return;
  }
  std::uint32_t before = *head - 1;
  while (next(before, tag) != e) before = next(before, tag);
  set_next(before, tag, after);
}

void FrozenContacts::remove(std::uint32_t e) {
  Edge& edge = edges_[e];
  unlink(e, edge.low);
  unlink(e, edge.high);
  edge.high = edge.low;
  edge.next_low = first_free_;
  first_free_ = e;
  --count_;
}

void FrozenContacts::erase(std::int64_t tag) {
  for (std::uint32_t e = first(tag); e != none; e = first(tag)) remove(e);
}

void FrozenContacts::fit() {
  constexpr std::size_t chunk = 4096;  // edges
  if (edges_.size() <= 2 * count_ + chunk) return;
  FrozenContacts fitting;
  fitting.flips_ = flips_;
  fitting.vectors_ = vectors_;
  fitting.elsewhere_ = elsewhere_;
  fitting.reviewed_ = reviewed_;
  fitting.histories_ = ChunkedArray<double>(width());
  for_each_contact([&](std::int64_t low, std::int64_t high, const double* history) { fitting.add(low, high, history); });
  *this = std::move(fitting);
}

std::size_t FrozenContacts::memory_bytes() const {
  return edges_.memory_bytes() + histories_.memory_bytes() + heads_.memory_bytes() +
         to_review_.capacity() * sizeof(std::uint32_t);
}

}  // namespace solidcull
