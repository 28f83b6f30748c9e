// A block on z = 0: an upright box, a ramp or a half-round, turned about the vertical.
#pragma once

#include <vector>

#include "ground_field.h"
#include "scene_spec.h"
#include "terrain.h"

namespace foldcar {

struct BlockCorners;
struct AlongBlock;
struct Interval;

// One block, prepared for slicing.
class Block {
 public:
  explicit Block(const BlockSpec& spec);
  // Whether the block stands at a point of the world.
  bool covers(double x_m, double y_m) const;
  // Height of the surface at a point of the world that it covers.
  double height_m(double x_m, double y_m) const;
  // As Terrain::slice, with the cosine and sine of the frame's heading. Pieces are exact for boxes and ramps; those of
  // arcs are chords at most 0.1 mm below the arc.
  void slice(const SliceFrame& frame, double cosine, double sine, const Span& span, const std::vector<Strip>& strips,
             std::vector<std::vector<Piece>>& pieces) const;

 private:
  // Coordinate along the block, from its middle, of a point of the world; height of the surface at that coordinate.
  double along_m(double x_m, double y_m) const;
  double surface_m(double u_m) const;
  void add_curve(const BlockCorners& corners, const AlongBlock& along, const Interval& within, const Strip& strip,
                 std::vector<Piece>& pieces) const;
  // Adds the surface from s_m[0] to s_m[1], where the highest point across the strip moves along the block from
  // crest_m[0] to crest_m[1].
  void add_run(const double* s_m, const double* crest_m, double y_m, std::vector<Piece>& pieces) const;

  BlockSpec spec_;
  double cosine_, sine_;
  Disc reach_;
  double corner_x_m_[4];
  double corner_y_m_[4];
  double arc_radius_m_ = 0;
  std::vector<double> arc_node_m_;  // the ends of an arc's chords, along it
};

}  // namespace foldcar
