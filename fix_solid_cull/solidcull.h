/* For programs that embed LIGGGHTS: libsolidcull.so is linked before libliggghts.so, or preloaded. Loaded later (dlopen) it
   misses LIGGGHTS's calls, and the fix says so and stops.

   Whenever the program has control it finds the whole bed, through every function of LIGGGHTS's library.h and through LIGGGHTS's
   classes: see "Programs" in fix_solid_cull.md. */
#ifndef SOLIDCULL_H
#define SOLIDCULL_H

#ifdef __cplusplus
extern "C" {
#endif

/** Makes `fix … solid/cull` known to this instance before its first fix is made. A program that has loaded this library too late
   reads why then, instead of "Invalid fix style". lammps: what lammps_open gave, or a LAMMPS*. Local. */
void solidcull_register(void* lammps);

/** The version, as "major.minor.patch". */
const char* solidcull_version(void);

#ifdef __cplusplus
}
#endif
#endif
