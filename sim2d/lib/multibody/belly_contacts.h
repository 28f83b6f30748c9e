// Where a belly, a box, touches a block or level ground.
#pragma once

#include <vector>

#include "contact_solver.h"
#include "elementary_functions.h"
#include "solid.h"
#include "vec3.h"

namespace foldcar {

struct Belly {
  Vec3 middle;
  Vec3 axes[3];  // forward, left, up
  double half_m[3];
  double reach_m() const { return hypotenuse(hypotenuse(half_m[0], half_m[1]), half_m[2]); }
};

// Appends the contacts closer than margin_m, each a copy of contact with its point, normal, gap and lateral coordinate.
void add_level_ground_contacts(const Belly& belly, double margin_m, Contact contact, std::vector<Contact>& contacts);
void add_solid_contacts(const Belly& belly, const Solid& solid, double margin_m, Contact contact,
                        std::vector<Contact>& contacts);

}  // namespace foldcar
