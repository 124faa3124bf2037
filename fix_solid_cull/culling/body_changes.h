// After bodies came apart or merged: who stands in them follows.
#pragma once

#include <vector>

#include "atom_index.h"
#include "body_groups.h"
#include "granule_masses.h"
#include "ports.h"
#include "shell.h"
#include "solid.h"

namespace solidcull {

/// Bodies whose granules were unlocked become several where they came apart; interface granules follow. Local.
void split_bodies(const Atoms& atoms, Solid& solid, Shell& shell, const AtomIndex& index, const GranuleMasses& masses);

/// Granules of swallowed bodies move to the frames of the bodies that they are part of now: interface granules, those that are to
/// arrive, interior ones. Local.
void adopt_places(const Atoms& atoms, Solid& solid, Shell& shell, Arrivals& arrivals);

/// Each atom is labelled with its body's number over all ranks. Local.
void label_bodies(const Atoms& atoms, Shell& shell, const BodyGroups& groups);

}  // namespace solidcull
