#include "fix_styles.h"

#include "style_table.h"

namespace solidcull {
namespace {

constexpr Treatment exact = Treatment::exact, integrates = Treatment::integrates, atoms_only = Treatment::atoms_only,
                    holds = Treatment::holds, drives = Treatment::drives, refused = Treatment::refused;

constexpr const char* adds_forces = "adds forces that culled granules would miss";
constexpr const char* no_spins = "does not turn granules, and solid bodies turn";
constexpr const char* marks_granules = "marks or times granules one by one, and culled ones would be left out";
constexpr const char* no_such_clumps = "clumps that break, or that another program moves, would miss those that are culled";
constexpr const char* spheres_only = "only spheres are supported";
constexpr const char* no_fluid = "a coupled solver would miss the culled granules";
constexpr const char* no_sph = "SPH would miss the culled granules";
constexpr const char* no_heat = "heat conduction would miss the culled granules";
constexpr const char* box_changes = "it changes the size of the box, and a culled bed cannot follow";

constexpr FixStyle fix_styles[] = {
    // LIGGGHTS's own helpers
    {"MINIMIZE", exact, ""},
    {"READ_RESTART", exact, ""},
    {"RESPA", exact, ""},
    {"STORE", exact, ""},
    {"contacthistory*", exact, ""},
    {"neighlist/mesh", exact, ""},
    // material, walls, insertion
    {"custom_property/global", exact, ""},
    {"gravity", exact, ""},
    {"insert/*", exact, ""},
    {"mesh/surface*", exact, ""},
    {"move/mesh*", exact, ""},
    {"particledistribution/*", exact, ""},
    {"diam/max", exact, ""},
    {"particletemplate/multiplespheres", exact, ""},
    {"particletemplate/multisphere", exact, ""},
    {"particletemplate/sphere", exact, ""},
    {"print", exact, ""},
    {"property/atom", exact, ""},
    {"property/atomtype*", exact, ""},
    {"property/global", exact, ""},
    {"region/variable", exact, ""},
    {"store/state", exact, ""},
    {"wall/gran*", exact, ""},
    // they hand on what others measure
    {"ave/correlate", exact, ""},
    {"ave/time", exact, ""},
    // stored granules near its mesh are made atoms
    {"massflow/mesh", exact, ""},

    {"nve/sphere", integrates, ""},
    {"multisphere", integrates, ""},

    {"ave/euler*", atoms_only, ""},
    {"ave/histo", atoms_only, ""},
    {"ave/spatial", atoms_only, ""},
    {"check/timestep/gran", atoms_only, ""},
    {"contactproperty/atom*", atoms_only, ""},
    {"continuum/weighted", atoms_only, ""},
    {"store/force", atoms_only, ""},

    {"aveforce", holds, ""},
    {"enforce2d", holds, ""},
    {"freeze", holds, ""},
    {"lineforce", holds, ""},
    {"move", holds, ""},
    {"nve/noforce", holds, ""},
    {"planeforce", holds, ""},
    {"setforce", holds, ""},

    {"addforce", drives, adds_forces},
    {"ave/atom", drives, "sums up over steps for each granule, and culled ones would be left out"},
    {"buoyancy", drives, adds_forces},
    {"drag", drives, adds_forces},
    {"efield", drives, adds_forces},
    {"external", drives, adds_forces},
    {"fiber/spring/simple", drives, adds_forces},
    {"massflow/mesh/sieve", drives, adds_forces},
    {"momentum", drives, "changes velocities of its group as a whole, and would miss culled granules"},
    {"nve", drives, no_spins},
    {"nve/limit", drives, "limits the speed of each granule and does not turn it, and solid bodies turn"},
    {"property/atom/regiontracer/time", drives, marks_granules},
    {"property/atom/tracer*", drives, marks_granules},
    {"spring", drives, adds_forces},
    {"spring/self", drives, adds_forces},
    {"viscous", drives, adds_forces},
    {"wall/region", drives, adds_forces},

    {"adapt", refused, "radii that change (fix adapt) would leave the culled granules behind"},
    {"bond*", refused, "bonds would miss the culled granules"},
    {"box/relax", refused, box_changes},
    {"check/timestep/sph", refused, no_sph},
    {"concave", refused, spheres_only},
    {"couple/*", refused, no_fluid},
    {"deform*", refused, box_changes},
    {"dt/reset", refused, "the time step would change within a run, and the scales of culling follow from it"},
    {"heat/*", refused, no_heat},
    {"multicontact/*", refused, "contacts that act on each other would miss those of culled granules"},
    {"multisphere/*", refused, no_such_clumps},
    {"nve/asphere*", refused, spheres_only},
    {"nve/line", refused, spheres_only},
    {"nve/sph", refused, no_sph},
    {"nve/sph/*", refused, no_sph},
    {"nve/superquadric", refused, spheres_only},
    {"particletemplate/superquadric", refused, spheres_only},
    {"property/atom/timetracer", refused, "LIGGGHTS has no such style any more: it is property/atom/regiontracer/time now"},
    {"rigid*", refused, "rigid clumps of granules are not supported yet"},
    {"sph/*", refused, no_sph},
    {"spring/rg", refused, "LIGGGHTS needs a mass for each type there, and granules have their own"},
    {"transportequation/*", refused, "what it transports would be lost with the culled granules"},
    {"wall/region/sph", refused, no_sph},
    {"wall/sph", refused, no_sph},
};
constexpr FixStyle unknown_fix = {"", drives, "is no fix of LIGGGHTS's own that solid/cull knows"};

}  // namespace

const FixStyle& treatment_of(const std::string& style) { return row_of(style, fix_styles, unknown_fix); }

}  // namespace solidcull
