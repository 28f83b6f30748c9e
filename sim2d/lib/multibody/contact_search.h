// Finds where tyres and bellies touch the ground: blocks and level ground as cylinders and boxes in three dimensions,
// smooth ground on its outlines along the heading.
//
// On outlines Box2D's collision functions tell in the plane along the heading which edge or vertex a wheel's circle or a
// belly's box meets. The contact's point, normal and gap then follow in three dimensions from the car's present pose, for
// the outermost lines across the tyre or belly that carry there.
#pragma once

#include <cstddef>
#include <vector>

#include "body_spec.h"
#include "car_dynamics.h"
#include "car_constants.h"
#include "contact_solver.h"
#include "terrain.h"
#include "track_terrain.h"

namespace foldcar {

// No car needs more contacts to stand on.
constexpr std::size_t kMaxContacts = 200;

// Of more contacts than kMaxContacts, keeps the deepest, of equally deep ones those found first, in the order of finding.
void keep_deepest(std::vector<Contact>& contacts);

class ContactSearch {
 public:
  ContactSearch(const BodySpec& body, const CarConstants& constants, const Terrain& terrain);

  // Fills contacts with all closer than margin_m, without friction and impulses. ground holds the outlines of smooth
  // ground; null if there is none. Throws std::runtime_error if blocks have too many faces.
  void find(const CarDynamics& car, const TrackTerrain* ground, double margin_m, std::vector<Contact>& contacts);

  // Looks for the blocks within reach of a car there; find does so by itself.
  void find_near(const Vec3& at_m);
  // Top of the highest of them, at least 0.
  double highest_m() const;

 private:
  void find_tyre(std::size_t wheel, const CarDynamics& car, const TrackTerrain* ground, double margin_m,
                 std::vector<Contact>& contacts);
  void find_belly(std::size_t segment, const CarDynamics& car, const TrackTerrain* ground, double margin_m,
                  std::vector<Contact>& contacts);

  // Appends the contacts of a tyre or belly with the blocks within its reach.
  template <typename Part>
  void add_nearby_solid_contacts(const Part& part, const Vec3& middle, double margin_m, const Contact& contact,
                                 std::vector<Contact>& contacts);

  const BodySpec& body_;
  const Terrain& terrain_;
  const double reach_m_;
  std::vector<const Solid*> near_;  // within reach of the car, which was at near_at_m_
  Vec3 near_at_m_;
  bool near_once_ = false;
  std::size_t faces_ = 0;  // of blocks that this search has looked at
};

}  // namespace foldcar
