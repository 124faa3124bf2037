# Chooses the engine and makes the target `liggghts`: finds library and headers, or takes those that the user names; refuses, in
# one line each, what this plug-in cannot work with; finds out from the library how it was built. Nothing is run.
find_package(MPI REQUIRED COMPONENTS CXX)
set(LIGGGHTS_DEFINITIONS "" CACHE STRING "-D flags of your own LIGGGHTS that change its structures, beyond those found in it")
set(LIGGGHTS_LINK_LIBRARIES "" CACHE STRING "what a static LIGGGHTS needs besides MPI, as VTK")
set(SOLIDCULL_TRIED_ENGINE "LIGGGHTS-PUBLIC 3.8.0")

# an indented message is one line on the screen
function(refuse_engine)
  string(CONCAT text ${ARGN})
  message(FATAL_ERROR " solidcull: ${text}")
endfunction()

# --- library and headers -------------------------------------------------------------------------
# Headers that were found for one library are none for another, and a library of the user's has its own. What the command line has
# just named has no type yet.
get_property(type CACHE LIGGGHTS_INCLUDE_DIR PROPERTY TYPE)
if(SOLIDCULL_HEADERS_FOUND AND NOT LIGGGHTS_LIBRARY STREQUAL SOLIDCULL_HEADERS_FOUND_FOR
   AND LIGGGHTS_INCLUDE_DIR STREQUAL SOLIDCULL_HEADERS_FOUND AND NOT type STREQUAL UNINITIALIZED)
  unset(LIGGGHTS_INCLUDE_DIR CACHE)
endif()
set(only_near)
if(LIGGGHTS_LIBRARY)
  set(only_near NO_DEFAULT_PATH)
endif()
find_library(LIGGGHTS_LIBRARY NAMES liggghts lmp DOC "libliggghts.so, or your own liblmp_NAME.so or liblmp_NAME.a")
if(NOT LIGGGHTS_LIBRARY)
  refuse_engine("LIGGGHTS_LIBRARY was not found: install libliggghts-dev, or name your own with -DLIGGGHTS_LIBRARY=…")
endif()
if(NOT EXISTS "${LIGGGHTS_LIBRARY}" OR IS_DIRECTORY "${LIGGGHTS_LIBRARY}")
  refuse_engine("LIGGGHTS_LIBRARY is '${LIGGGHTS_LIBRARY}', and there is no such file: "
                "name libliggghts.so, liblmp_NAME.so or liblmp_NAME.a")
endif()
get_filename_component(beside "${LIGGGHTS_LIBRARY}" DIRECTORY)
set(headers_named "${LIGGGHTS_INCLUDE_DIR}")
find_path(LIGGGHTS_INCLUDE_DIR lammps.h HINTS ${beside} ${beside}/../include ${beside}/../../include PATH_SUFFIXES liggghts
          DOC "folder that holds LIGGGHTS's lammps.h" ${only_near})
if(NOT headers_named)
  set(SOLIDCULL_HEADERS_FOUND "${LIGGGHTS_INCLUDE_DIR}" CACHE INTERNAL "")
  set(SOLIDCULL_HEADERS_FOUND_FOR "${LIGGGHTS_LIBRARY}" CACHE INTERNAL "")
endif()
if(NOT LIGGGHTS_INCLUDE_DIR)
  refuse_engine("LIGGGHTS_INCLUDE_DIR was not found for ${LIGGGHTS_LIBRARY}: "
                "name the folder of its lammps.h, as -DLIGGGHTS_INCLUDE_DIR=…/src")
endif()

# --- headers -------------------------------------------------------------------------------------
foreach(header lammps.h fix.h fix_contact_history.h fix_mesh_surface.h)
  if(NOT EXISTS "${LIGGGHTS_INCLUDE_DIR}/${header}")
    refuse_engine("LIGGGHTS_INCLUDE_DIR is '${LIGGGHTS_INCLUDE_DIR}', which has no ${header}: "
                  "name the folder of LIGGGHTS's headers, its src")
  endif()
endforeach()
foreach(hook pre_initial_integrate pre_final_integrate)
  file(STRINGS "${LIGGGHTS_INCLUDE_DIR}/fix.h" found REGEX "virtual.*[^a-z_]${hook} *\\(")
  if(NOT found)
    refuse_engine("the LIGGGHTS of '${LIGGGHTS_INCLUDE_DIR}' has no Fix::${hook}, as LIGGGHTS-PFM has not: "
                  "use ${SOLIDCULL_TRIED_ENGINE}")
  endif()
endforeach()

# --- library -------------------------------------------------------------------------------------
# A static library becomes a shared one. `ld --wrap` would not do: calls within one object file do not come to what it wraps, as
# those of Input::execute_command and, by the table of virtual functions, of Modify::init.
set(engine_library "${LIGGGHTS_LIBRARY}")
if(LIGGGHTS_LIBRARY MATCHES "\\.a$")
  set(engine_library "${CMAKE_BINARY_DIR}/libsolidcull-liggghts.so")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${LIGGGHTS_LIBRARY}")
  separate_arguments(mpi_flags UNIX_COMMAND "${MPI_CXX_LINK_FLAGS}")
  set(needs)
  foreach(library ${LIGGGHTS_LINK_LIBRARIES})
    if(IS_ABSOLUTE "${library}")
      get_filename_component(folder "${library}" DIRECTORY)
      list(APPEND needs "${library}" "-Wl,-rpath,${folder}")
    else()
      string(REGEX REPLACE "^-l" "" library "${library}")
      list(APPEND needs "-l${library}")
    endif()
  endforeach()
  set(link ${CMAKE_CXX_COMPILER} -shared -o ${engine_library} -Wl,-soname,libsolidcull-liggghts.so -Wl,-z,defs
           -Wl,--whole-archive ${LIGGGHTS_LIBRARY} -Wl,--no-whole-archive
           ${needs} ${mpi_flags} ${MPI_CXX_LIBRARIES})
  set(failed OFF)
  if("${LIGGGHTS_LIBRARY}" IS_NEWER_THAN "${engine_library}" OR NOT link STREQUAL SOLIDCULL_ENGINE_LINKED_BY)
    execute_process(COMMAND ${CMAKE_COMMAND} -E env LC_ALL=C ${link}
                    RESULT_VARIABLE failed OUTPUT_VARIABLE told ERROR_VARIABLE told)
  endif()
  if(NOT failed)
    set(SOLIDCULL_ENGINE_LINKED_BY "${link}" CACHE INTERNAL "")
  else()
    if(told MATCHES "recompile with -fPIC")
      refuse_engine("${LIGGGHTS_LIBRARY} was compiled without -fPIC: "
                    "compile LIGGGHTS with it (USE_FPIC = \"ON\" in MAKE/Makefile.user)")
    elseif(told MATCHES "undefined reference to `([^']*)'")
      refuse_engine("${LIGGGHTS_LIBRARY} needs more libraries, one of them for '${CMAKE_MATCH_1}': "
                    "name them with -DLIGGGHTS_LINK_LIBRARIES=…")
    endif()
    string(REGEX REPLACE "\n.*" "" told "${told}")
    refuse_engine("${LIGGGHTS_LIBRARY} cannot be linked (${told}): name a static or shared library of LIGGGHTS")
  endif()
endif()

set(looked_at ${CMAKE_BINARY_DIR}/CMakeFiles/engine)
execute_process(COMMAND ${CMAKE_NM} -D -S --defined-only ${engine_library}
                OUTPUT_FILE ${looked_at}.symbols ERROR_VARIABLE told RESULT_VARIABLE failed)
if(failed)
  refuse_engine("LIGGGHTS_LIBRARY is '${LIGGGHTS_LIBRARY}', which is no library: "
                "name libliggghts.so, liblmp_NAME.so or liblmp_NAME.a")
endif()
execute_process(COMMAND ${CMAKE_READELF} -rW ${engine_library} OUTPUT_FILE ${looked_at}.relocations ERROR_QUIET)

# does the library have the symbol? sets `variable` to its lines of nm
function(in_library symbol variable)
  file(STRINGS ${looked_at}.symbols found REGEX " ${symbol}$")
  set(${variable} "${found}" PARENT_SCOPE)
endfunction()

file(STRINGS ${CMAKE_CURRENT_LIST_DIR}/interposed.h interposed REGEX "\"_Z")
foreach(line ${interposed})
  string(REGEX REPLACE ".*\"(_Z[A-Za-z0-9_]+)\".*" "\\1" symbol "${line}")
  string(REGEX REPLACE "_ZN9LAMMPS_NS[0-9]+([A-Za-z]+)[0-9]+([a-z_]+)E.*" "\\1::\\2" name "${symbol}")
  in_library(${symbol} found)
  if(NOT found)
    refuse_engine("${LIGGGHTS_LIBRARY} shows no ${name}: "
                  "name a library of ${SOLIDCULL_TRIED_ENGINE}, not its program")
  endif()
  file(STRINGS ${looked_at}.relocations found REGEX " ${symbol}([ @]|$)")
  if(NOT found)
    refuse_engine("${LIGGGHTS_LIBRARY} cannot be made to call another ${name} than its own: "
                  "build LIGGGHTS without -Bsymbolic-functions, -Ofast and -fno-semantic-interposition")
  endif()
endforeach()

# --- how it was built: the size of its numbers and what its structures hold ------------------------------
string(REGEX REPLACE "(^|[; ]+)-D *" "\\1" named "${LIGGGHTS_DEFINITIONS}")
string(REGEX REPLACE " +" ";" named "${named}")
set(built_with)
set(default)
in_library(_ZTVN9LAMMPS_NS19AtomVecSuperquadricE superquadrics)
in_library(_ZTVN9LAMMPS_NS17AtomVecConvexHullE convex)
if(superquadrics)
  list(APPEND built_with SUPERQUADRIC_ACTIVE_FLAG)
endif()
if(convex)
  list(APPEND built_with CONVEX_ACTIVE_FLAG)
endif()
if(superquadrics OR convex)
  list(APPEND built_with NONSPHERICAL_ACTIVE_FLAG)
endif()
in_library("_ZN9LAMMPS_NS6Memory7smallocEiPKc" small_counts)
in_library("_ZN9LAMMPS_NS6Domain5unmapEPd[lx]" big_images)
if(small_counts)
  list(APPEND built_with LAMMPS_SMALLSMALL)
elseif(big_images)
  list(APPEND built_with LAMMPS_BIGBIG)
else()
  set(default LAMMPS_SMALLBIG)
endif()
foreach(flag SUPERQUADRIC_ACTIVE_FLAG NONSPHERICAL_ACTIVE_FLAG CONVEX_ACTIVE_FLAG LAMMPS_SMALLSMALL LAMMPS_BIGBIG LAMMPS_SMALLBIG)
  if(flag IN_LIST named AND NOT flag IN_LIST built_with AND NOT flag STREQUAL default)
    refuse_engine("LIGGGHTS_DEFINITIONS says ${flag}, and ${LIGGGHTS_LIBRARY} was built without it: "
                  "leave it out, it is found by itself")
  endif()
endforeach()
set(engine_definitions ${named} ${built_with})
list(REMOVE_DUPLICATES engine_definitions)
set(told "LIGGGHTS: ${LIGGGHTS_LIBRARY}")
if(engine_definitions)
  list(JOIN engine_definitions " " flags)
  string(APPEND told ", built with ${flags}")
endif()
message(STATUS "${told}")

# --- library and headers belong together -------------------------------------------------------------
set(probe ${CMAKE_CURRENT_LIST_DIR}/engine_probe.cpp)
separate_arguments(flags UNIX_COMMAND "${CMAKE_CXX_FLAGS}")
set(with ${LIGGGHTS_INCLUDE_DIR} ${MPI_CXX_INCLUDE_DIRS})
list(TRANSFORM with PREPEND -I)
set(defined ${engine_definitions})
list(TRANSFORM defined PREPEND -D)
execute_process(
  COMMAND ${CMAKE_COMMAND} -E env LC_ALL=C ${CMAKE_CXX_COMPILER} ${flags} -w -std=c++17 ${defined} ${with}
          ${MPI_CXX_COMPILE_OPTIONS} -c ${probe} -o ${looked_at}.o
  RESULT_VARIABLE failed OUTPUT_VARIABLE told ERROR_VARIABLE told)
if(failed)
  string(REGEX REPLACE "(^|.*\n)([^\n]*error[^\n]*)\n.*" "\\2" told "${told}")
  refuse_engine("the headers of '${LIGGGHTS_INCLUDE_DIR}' do not compile (${told}): use ${SOLIDCULL_TRIED_ENGINE}")
endif()
set(apart "'${LIGGGHTS_INCLUDE_DIR}' and ${LIGGGHTS_LIBRARY} do not belong together")
set(name_them "name the headers that the library was built from with -DLIGGGHTS_INCLUDE_DIR=…")
execute_process(COMMAND ${CMAKE_NM} -S ${looked_at}.o OUTPUT_FILE ${looked_at}.wanted)
file(STRINGS ${looked_at}.wanted wanted REGEX " U _ZN9LAMMPS_NS")
foreach(line ${wanted})
  string(REGEX REPLACE ".* U " "" symbol "${line}")
  in_library(${symbol} found)
  if(NOT found AND symbol MATCHES "6LAMMPSC")
    refuse_engine("${LIGGGHTS_LIBRARY} was built with another MPI than ${MPI_CXX_LIBRARIES}: "
                  "name its compiler with -DMPI_CXX_COMPILER=…")
  elseif(NOT found)
    refuse_engine("${apart}, the library has no '${symbol}': ${name_them}")
  endif()
endforeach()
file(STRINGS ${looked_at}.wanted tables REGEX "_ZTVN15solidcull_probe")
foreach(line ${tables})
  string(REGEX REPLACE "^[0-9a-f]+ ([0-9a-f]+) . _ZTVN15solidcull_probe[0-9]+([A-Za-z]+)E$" "\\1;\\2" ours "${line}")
  list(GET ours 0 size)
  list(GET ours 1 class)
  string(LENGTH ${class} letters)
  in_library(_ZTVN9LAMMPS_NS${letters}${class}E found)
  if(NOT found MATCHES "^[0-9a-f]+ ${size} ")
    refuse_engine("${apart}, class ${class} has other virtual functions in the one than in the other: ${name_them}")
  endif()
endforeach()

# --- the target ------------------------------------------------------------------------------------
add_library(liggghts INTERFACE)
target_include_directories(liggghts SYSTEM INTERFACE ${LIGGGHTS_INCLUDE_DIR})
target_compile_definitions(liggghts INTERFACE ${engine_definitions})
target_link_libraries(liggghts INTERFACE ${engine_library} MPI::MPI_CXX)
set(SOLIDCULL_ENGINE_LIBRARY ${engine_library})
set(SOLIDCULL_ENGINE_DEFINITIONS ${engine_definitions})
if(NOT engine_library STREQUAL LIGGGHTS_LIBRARY)
  install(FILES ${engine_library} DESTINATION ${CMAKE_INSTALL_LIBDIR})
endif()
