#include "audit_tally.h"

#include <algorithm>
#include <cstdio>
#include <random>

namespace solidcull {
namespace {

constexpr int resamples = 1000;
constexpr double tail = 0.05;  // on each side
/// The truth over what patches see, least and most. A patch has locked granules around it, and what sleeps far from it is not
/// seen: theory.md#audit says on which scenes this was found.
struct Unseen {
  double least, most;
};
Unseen unseen_of(AuditTally::Figure figure) { return figure == AuditTally::moved ? Unseen{1, 6} : Unseen{1.0 / 3, 3}; }

struct Ratio {
  double sum, granules;
};

Ratio ratio_of(const AuditedPatch& p, AuditTally::Figure figure) {
  switch (figure) {
    case AuditTally::moved:
      return {p.moved, p.granules};
    case AuditTally::load_shift:
      return {p.load_shift, p.deep};
    case AuditTally::energy:
      return {p.energy, p.granules};
    case AuditTally::figures:
      break;
  }
  return {0, 0};
}

}  // namespace

void AuditedPatch::add(const AuditedPatch& other) {
  granules += other.granules;
  ended += other.ended;
  moved += other.moved;
  energy += other.energy;
  deep += other.deep;
  load += other.load;
  load_shift += other.load_shift;
}

void AuditTally::add(const std::vector<AuditedPatch>& patches) {
  for (const AuditedPatch& p : patches) {
    if (p.granules == 0) continue;
    patches_.push_back(p);
    all_.add(p);
  }
  for (int f = 0; f < figures; ++f) intervals_[static_cast<std::size_t>(f)] = interval_of(static_cast<Figure>(f));
}

/// Patches are drawn with replacement: the means that come of it (Efron 1979).
Interval AuditTally::interval_of(Figure figure) const {
  if (patches_.size() < fewest) return {};
  std::mt19937_64 chance(20261127);
  std::vector<double> means;
  for (int n = 0; n < resamples; ++n) {
    Ratio drawn{0, 0};
    for (std::size_t k = 0; k < patches_.size(); ++k) {
      const Ratio one = ratio_of(patches_[chance() % patches_.size()], figure);
      drawn.sum += one.sum;
      drawn.granules += one.granules;
    }
    if (drawn.granules > 0) means.push_back(drawn.sum / drawn.granules);
  }
  if (means.empty()) return {};
  std::sort(means.begin(), means.end());
  const auto at = [&](double share) { return means[static_cast<std::size_t>(share * static_cast<double>(means.size() - 1))]; };
  const Unseen unseen = unseen_of(figure);
  return {at(tail) * unseen.least, at(1 - tail) * unseen.most};
}

std::string text_of(const AuditTally& tally, int steps, double diameter) {
  if (tally.patches() == 0) return "";
  const auto text = [](const char* form, auto... numbers) {
    char line[200];
    std::snprintf(line, sizeof line, form, numbers...);
    return std::string(line);
  };
  const AuditedPatch& all = tally.all();
  const Interval way = tally.interval(AuditTally::moved), load = tally.interval(AuditTally::load_shift),
                 energy = tally.interval(AuditTally::energy);
  const std::string seen =
      text("%zu patches, %.0f granules, %.0f of which woke anyway", tally.patches(), all.granules, all.ended);
  if (tally.patches() < AuditTally::fewest) return seen + ": too few to tell";
  std::string said = seen + text("; awake, one would go %.2g to %.2g m in %d steps (%.2g to %.2g d)", way.low, way.high, steps,
                                 way.low / diameter, way.high / diameter);
  if (all.load > 0)
    said += text(", shift its loads by %.2g to %.2g N (%.2g to %.2g %%)", load.low, load.high,
                 100 * load.low * all.deep / all.load, 100 * load.high * all.deep / all.load);
  return said + text(", and have %.2g to %.2g J", energy.low, energy.high);
}

}  // namespace solidcull
