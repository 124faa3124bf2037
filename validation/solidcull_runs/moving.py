"""Sums over all granules of a run: what thermo columns see, and what the fix says of those in its store."""
STORED = {"x": "f_cull[20]", "y": "f_cull[21]", "z": "f_cull[22]"}


def kinetic_energy(run):
    """Of all granules (J), of the columns c_ke and f_cull[19]."""
    return run.series("c_ke")[1] + (run.series("f_cull[19]")[1] if run.counts else 0)


def centre(run, axis):
    """A coordinate of the centre of mass of all granules (m), of the columns v_mass, v_AXIS, f_cull[5] and f_cull[20..22]."""
    at = run.series(f"v_{axis}")[1]
    if not run.counts:
        return at
    mass, stored = run.series("v_mass")[1], run.series("f_cull[5]")[1]
    return (mass * at + stored * run.series(STORED[axis])[1]) / (mass + stored)
