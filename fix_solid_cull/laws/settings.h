// The keywords of `fix solid/cull` (theory.md#scales says what they are in SI units).
#pragma once

#include <string>
#include <vector>

namespace solidcull {

enum class Exterior { live, sleep };
enum class Store { exact, compact, none };
enum class Restore { exact, refill };
enum class ReportLength { brief, full };

/// Files of the bed, one every so many steps; a '*' in its name becomes the step.
struct BedOutput {
  int every;
  std::string file;
  bool seen = false;  ///< of the stored granules only those that can be seen
  bool spin = false;  ///< with their spins
};
/// Files of interface meshes, likewise.
struct MeshOutput {
  int every;
  std::string file;
  int least = 1;         ///< granules of a body that is drawn
  bool surface = false;  ///< all bodies in one, under one name
  bool skin = false;     ///< the same, around exterior granules too
};

struct Settings {
  int every = 0;       ///< steps between looks; 0: from the deck's own scales, see look_interval()
  double depth = 0.0;  ///< cover, in mean granule diameters: below the outer surface (live), around what moves (sleep)
  Exterior exterior = Exterior::sleep;
  double speed = 0.01;            ///< solid-state tolerance, fraction of sqrt(g d)
  int calm = 4;                   ///< looks in a row
  double tolerance_absolute = 3;  ///< A of the wake-up law, in granule weights
  double tolerance_relative = 0;  ///< R of the wake-up law, in normal loads at locking
  double carve_radius = 2.0;      ///< r0, in mean diameters
  double carve_cap = 4.0;         ///< largest growth of r0
  Store store = Store::exact;
  Restore restore = Restore::exact;
  double voxel = 0.5;            ///< in mean diameters
  int balance_every = 0;         ///< steps between two looks at the work of ranks; 0: cuts between them stay
  double balance_threshold = 0;  ///< largest work of a rank over the mean from which cuts move
  int audit_every = 0;           ///< steps between the beginnings of two audits; 0: none
  int audit_patches = 0;         ///< patches that each wakes
  ReportLength report = ReportLength::brief;
  bool reasons = false;            ///< per atom, what keeps it awake and what woke it too
  std::vector<MeshOutput> meshes;  ///< the keyword may stand more than once
  std::vector<BedOutput> beds;     ///< likewise
};

/// Parses `keyword value ...`. Throws InputError that names keyword and value as typed, and what to do.
Settings parse_settings(const std::vector<std::string>& words);

/// The keywords that parse_settings knows, for the test that holds the command page and the code together.
std::vector<std::string> setting_keywords();

/// Steps between looks when the deck names none: a twentieth of sqrt(d/g), in which a granule that starts to fall reaches the
/// default speed tolerance two and a half times over; at least 10, at most 1000 (theory.md#scales). d in m, g in m/s^2, dt in s.
int look_interval(double mean_diameter, double gravity, double dt);

}  // namespace solidcull
