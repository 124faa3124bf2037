#include "work_meter.h"

namespace solidcull {

void WorkMeter::begin_run(double in_fix) {
  runs_ = true;
  work_ = {};
  seen_to_ = 0;
  began_ = Clock::now();
  in_fix_then_ = in_fix;
  restored_then_ = static_cast<double>(bed_.solid.ledger().granules_restored());
  in_vain_then_ = in_vain();
  woken_then_ = bed_.solid.ledger().granules_woken();
}

double WorkMeter::in_vain() const {
  return static_cast<double>(bed_.solid.ledger().granules_locked_again() - bed_.solid.ledger().granules_that_moved());
}

void WorkMeter::count_pairs() {
  const Atoms& atoms = bed_.atoms;
  double pairs = 0, ends = 0;
  bed_.contacts.neighbours().for_each_pair(atoms.owned, [&](int i, int j, int) {
    pairs += 1;
    ends += !atoms.is_interface(i) + (j < atoms.owned && !atoms.is_interface(j));
  });
  pairs_ = pairs;
  exterior_ends_ = ends;
}

void WorkMeter::count_step(double in_fix) {
  if (!runs_) begin_run(in_fix);
  if (lists_are_new_) count_pairs();
  lists_are_new_ = false;
  const double interior = static_cast<double>(bed_.solid.store().size());
  const double interface = static_cast<double>(bed_.solid.locked()) - interior;
  work_.steps += 1;
  work_.interior += interior;
  work_.interface += interface;
  work_.exterior += bed_.atoms.owned - interface;
  work_.pairs += pairs_;
  work_.exterior_ends += exterior_ends_;
}

void WorkMeter::see_awake(const AwakeSteps& now) {
  work_.awake.add(now, work_.steps - seen_to_);
  seen_to_ = work_.steps;
}

RunWork WorkMeter::now(double in_fix) const {
  if (!runs_) return {};
  RunWork now = work_;
  now.seconds = std::chrono::duration<double>(Clock::now() - began_).count();
  now.in_fix = in_fix - in_fix_then_;
  now.restored = static_cast<double>(bed_.solid.ledger().granules_restored()) - restored_then_;
  now.in_vain = in_vain() - in_vain_then_;
  now.woken = bed_.solid.ledger().granules_woken();
  now.woken.add(woken_then_, -1);
  now.in_pairs = bed_.run.seconds_of_pair_forces();
  return now;
}

RunWork WorkMeter::end_run(double in_fix) {
  const RunWork ended = now(in_fix);
  before_ = so_far();
  work_ = {};
  runs_ = false;
  return ended;
}

RunWork WorkMeter::so_far() const {
  RunWork all = before_;
  all.steps += work_.steps;
  all.exterior += work_.exterior;
  all.interface += work_.interface;
  all.interior += work_.interior;
  return all;
}

}  // namespace solidcull
