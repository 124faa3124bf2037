#include "frozen_contacts.h"

#include <algorithm>
#include <stdexcept>

namespace solidcull {

void FrozenContacts::set_layout(std::vector<bool> flips) {
  if (count_ != 0 && flips != flips_) throw std::logic_error("the contact history's layout changed while contacts are frozen");
  if (flips != flips_) {
    edges_.clear();
    histories_.clear();
    free_.clear();
  }
  flips_ = std::move(flips);
}

int FrozenContacts::find(std::int64_t tag, std::int64_t partner) const {
  const int* head = heads_.find(tag);
  for (int e = head ? *head : none; e != none; e = next(e, tag))
    if ((edges_[e].low == tag ? edges_[e].high : edges_[e].low) == partner) return e;
  return none;
}

bool FrozenContacts::contains(std::int64_t tag, std::int64_t partner) const { return find(tag, partner) != none; }

const double* FrozenContacts::read(int e, std::int64_t tag, double* out) const {
  if (!edges_[e].has_history) return nullptr;
  const double* from = histories_.data() + static_cast<std::size_t>(e) * width();
  const bool turned = edges_[e].low != tag;
  for (std::size_t d = 0; d < width(); ++d) out[d] = turned && flips_[d] ? -from[d] : from[d];
  return out;
}

void FrozenContacts::write(int e, std::int64_t tag, const double* history) {
  edges_[e].has_history = history != nullptr;
  if (!history) return;
  double* to = histories_.data() + static_cast<std::size_t>(e) * width();
  const bool turned = edges_[e].low != tag;
  for (std::size_t d = 0; d < width(); ++d) to[d] = turned && flips_[d] ? -history[d] : history[d];
}

void FrozenContacts::add(std::int64_t tag, std::int64_t partner, const double* history) {
  if (tag == partner) return;  // a granule that touches its own periodic image: no partner to freeze it with
  int e = find(tag, partner);
  if (e == none) {
    if (free_.empty()) {
      e = static_cast<int>(edges_.size());
      edges_.emplace_back();
      histories_.resize(histories_.size() + width());
    } else {
      e = free_.back();
      free_.pop_back();
    }
    Edge& edge = edges_[e];
    edge.low = std::min(tag, partner);
    edge.high = std::max(tag, partner);
    for (const std::int64_t end : {edge.low, edge.high}) {
      int* head = heads_.find(end);
      next(e, end) = head ? *head : none;
      heads_[end] = e;
    }
    ++count_;
  }
  write(e, tag, history);
}

void FrozenContacts::unlink(int e, std::int64_t tag) {
  int* head = heads_.find(tag);
  const int after = next(e, tag);
  if (*head == e) {
    if (after == none)
      heads_.erase(tag);
    else
      *head = after;
    return;
  }
  int before = *head;
  while (next(before, tag) != e) before = next(before, tag);
  next(before, tag) = after;
}

void FrozenContacts::erase(std::int64_t tag) {
  while (const int* head = heads_.find(tag)) {
    const int e = *head;
    unlink(e, edges_[e].low);
    unlink(e, edges_[e].high);
    edges_[e].low = free_mark;
    free_.push_back(e);
    --count_;
  }
}

std::size_t FrozenContacts::memory_bytes() const {
  return edges_.capacity() * sizeof(Edge) + histories_.capacity() * sizeof(double) + free_.capacity() * sizeof(int) +
         heads_.memory_bytes();
}

}  // namespace solidcull
