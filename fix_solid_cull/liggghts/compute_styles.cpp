#include "compute_styles.h"

#include "style_table.h"

namespace solidcull {
namespace {

constexpr Measure exact = Measure::exact, atoms_only = Measure::atoms_only, contacts = Measure::contacts, whole = Measure::whole,
                  refused = Measure::refused;

constexpr const char* no_single_pairs = "LIGGGHTS's granular contacts do not support it";
constexpr const char* of_molecules = "adds up whole molecules, and culled granules would be left out";

constexpr ComputeStyle compute_styles[] = {
    {"pe", exact, ""},       // granular contacts have no potential energy in LIGGGHTS: 0
    {"pe/atom", exact, ""},  // likewise
    {"slice", exact, ""},

    {"displace/atom", atoms_only, ""},
    {"erotate", atoms_only, ""},
    {"erotate/multisphere", atoms_only, ""},
    {"erotate/sphere", atoms_only, ""},
    {"erotate/sphere/atom", atoms_only, ""},
    {"ke", atoms_only, ""},
    {"ke/atom", atoms_only, ""},
    {"ke/multisphere", atoms_only, ""},
    {"multisphere", atoms_only, ""},
    {"property/atom", atoms_only, ""},
    {"reduce", atoms_only, ""},
    {"reduce/region", atoms_only, ""},

    {"centro/atom", contacts, ""},
    {"cna/atom", contacts, ""},
    {"contact/atom", contacts, ""},
    {"contact/atom/gran", contacts, ""},
    {"coord/atom", contacts, ""},
    {"pair/gran/local", contacts, ""},
    {"stress/atom", contacts, ""},
    {"wall/gran/local", contacts, ""},

    {"atom/molecule", whole, of_molecules},
    {"cluster/atom", whole, "follows contacts from granule to granule, and culled ones would cut clusters apart"},
    {"com", whole, "divides by the mass of the group at the start of the run; f_ID[24] to f_ID[26] are that of all granules"},
    {"com/molecule", whole, of_molecules},
    {"gyration", whole, "divides by the mass of the group at the start of the run"},
    {"gyration/molecule", whole, of_molecules},
    {"inertia/molecule", whole, of_molecules},
    {"msd", whole, "divides by the number of granules at the start of the run"},
    {"msd/molecule", whole, of_molecules},
    {"nparticles/tracer/region", whole, "counts and marks granules in a region, and culled ones would be left out"},
    {"pressure", whole, "divides by the volume of the box, and contacts of culled granules would be left out"},
    {"property/molecule", whole, of_molecules},
    {"rdf", whole, "divides by the number of granules at the start of the run"},
    {"temp", whole, "divides by the number of granules at the start of the run"},

    {"bond/local", refused, "bonds would miss the culled granules"},
    {"erotate/asphere", refused, "only spheres are supported"},
    {"group/group", refused, no_single_pairs},
    {"multisphere/single", refused, "is of one clump, which may be culled"},
    {"property/local", refused, no_single_pairs},
    {"reduce/sph", refused, "SPH would miss the culled granules"},
    {"rigid", refused, "rigid clumps of granules are not supported yet"},
};
constexpr ComputeStyle unknown_compute = {"", atoms_only, ""};

}  // namespace

const ComputeStyle& measure_of(const std::string& style) { return row_of(style, compute_styles, unknown_compute); }

}  // namespace solidcull
