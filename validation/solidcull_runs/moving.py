"""Thermo columns of a run as cases use them, and sums over all granules: what LIGGGHTS sees, and what the fix says of those in its store."""
STORED = {"x": "f_cull[20]", "y": "f_cull[21]", "z": "f_cull[22]"}


def series(run, *names):
    """Columns without their first row: where a run was before, LIGGGHTS counts the loads on meshes twice there."""
    found = [run.series(name)[1][1:] for name in names]
    return found[0] if len(found) == 1 else found


def time(run):
    """Time since the fix line (s), without the first row too."""
    t = run.series("time")[1]
    return t[1:] - t[0]


def kinetic_energy(run):
    """Of all granules (J), of the columns c_ke and f_cull[19]."""
    return series(run, "c_ke") + (series(run, "f_cull[19]") if run.counts else 0)


def centre(run, axis):
    """A coordinate of the centre of mass of all granules (m), of the columns v_mass, v_AXIS, f_cull[5] and f_cull[20..22]."""
    at = series(run, f"v_{axis}")
    if not run.counts:
        return at
    mass, stored = series(run, "v_mass", "f_cull[5]")
    return (mass * at + stored * series(run, STORED[axis])) / (mass + stored)
