// Finds where tyres and bellies touch the outlines of the ground, with Box2D's collision functions.
//
// Box2D tells in the plane along the heading which edge or vertex of an outline a wheel's circle or a belly's box meets.
// The contact's point, normal and gap then follow in three dimensions from the car's present pose, for the outermost
// lines across the tyre or belly that carry there.
#pragma once

#include <vector>

#include "body_spec.h"
#include "car_dynamics.h"
#include "contact_solver.h"
#include "track_terrain.h"

namespace foldcar {

class ContactSearch {
 public:
  explicit ContactSearch(const BodySpec& body) : body_(body) {}

  // Fills contacts with all closer than margin_m, without friction and impulses.
  void find(const CarDynamics& car, const TrackTerrain& ground, double margin_m, std::vector<Contact>& contacts) const;

 private:
  void find_tyre(std::size_t wheel, const CarDynamics& car, const TrackTerrain& ground, double margin_m,
                 std::vector<Contact>& contacts) const;
  void find_belly(std::size_t segment, const CarDynamics& car, const TrackTerrain& ground, double margin_m,
                  std::vector<Contact>& contacts) const;

  const BodySpec& body_;
};

}  // namespace foldcar
