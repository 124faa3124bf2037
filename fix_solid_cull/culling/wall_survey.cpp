#include "wall_survey.h"

#include <utility>

namespace solidcull {

bool WallSurvey::take_gone() {
  std::vector<std::string> now = bed_.walls.names();
  const bool gone = !std::includes(now.begin(), now.end(), names_then_.begin(), names_then_.end());
  names_then_ = std::move(now);
  return gone;
}

void WallSurvey::update(const std::vector<WallContact>& contacts, bool new_run) {
  const Atoms& atoms = bed_.atoms;
  std::vector<AtWall> now(static_cast<std::size_t>(atoms.owned));
  std::vector<int> there(static_cast<std::size_t>(atoms.owned), 0);
  for (AtWall& w : now) w.near = w.moving_near = false;
  for (const WallContact& c : contacts) {
    const int i = c.granule;
    AtWall& w = now[i];
    w.near = true;
    w.moving_near |= c.moving;
    if (c.gap <= still_there * atoms.radius[i]) ++there[i];
    if (c.gap > 0) continue;
    ++w.touched;
    w.moves |= c.moving;
    w.stands |= !c.moving;
    w.slip = std::max(w.slip, (atoms.velocity(i) + atoms.spin(i).cross(c.to_wall)).norm());
  }
  for (int i = 0; i < atoms.owned; ++i) {
    const AtWall& then = rows_[i];
    // between runs a wall may have been taken away; within one, a wall that moves may have left
    const bool gone = new_run ? there[i] < then.touched : then.moves && there[i] == 0;
    if (bed_.shell[i].locked && gone) bed_.wake.ask(atoms.place(i), 0.5 * atoms.radius[i], Woke::wall);
    rows_[i] = now[i];
  }
}

}  // namespace solidcull
