/* For programs that embed LIGGGHTS. With libsolidcull.so linked before libliggghts.so, or preloaded, nothing needs to be called.
   A program that loads it later (dlopen) calls solidcull_register once per LIGGGHTS instance, before its deck is read. */
#ifndef SOLIDCULL_H
#define SOLIDCULL_H

#ifdef __cplusplus
extern "C" {
#endif

/* Makes `fix … solid/cull` known to this instance. lammps: what lammps_open gave, or a LAMMPS*. Local. */
void solidcull_register(void* lammps);

/* `region ID interface/mesh FIX-ID …` where the engine's own region command cannot be reached: the words after `region`. Local.
 */
void solidcull_region(void* lammps, int words, char** word);

/* The version, as "major.minor.patch". */
const char* solidcull_version(void);

#ifdef __cplusplus
}
#endif
#endif
