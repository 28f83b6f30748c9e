// Where a tyre, a cylinder, touches a block or level ground.
#pragma once

#include <vector>

#include "contact_solver.h"
#include "solid.h"
#include "tyre_section.h"

namespace foldcar {

// Appends the contacts closer than margin_m, each a copy of contact with its point, normal, gap and lateral coordinate.
void add_level_ground_contacts(const Tyre& tyre, double margin_m, Contact contact, std::vector<Contact>& contacts);
void add_solid_contacts(const Tyre& tyre, const Solid& solid, double margin_m, Contact contact,
                        std::vector<Contact>& contacts);

}  // namespace foldcar
