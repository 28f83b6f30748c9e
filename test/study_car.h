// The width study's car as a simulator body, for the tests of the simulator: four FS90R wheels, length 200 mm,
// wheelbase 140 mm, wheel radius 60 mm. Masses are round numbers of the right size.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "body_spec.h"
#include "hal.h"
#include "scene_spec.h"
#include "trial.h"

namespace foldcar {

inline BodySpec study_car(double width_m) {
  constexpr double kLength_m = 0.2, kHeight_m = 0.05;
  BodySpec body;
  body.id = "study";
  const double mass_kg = 0.165 + 0.175 * width_m;
  SegmentSpec chassis;
  chassis.length_m = kLength_m;
  chassis.width_m = width_m;
  chassis.height_m = kHeight_m;
  chassis.mass_kg = mass_kg;
  chassis.com_z_m = 0.004;
  chassis.roll_inertia_kg_m2 = mass_kg * (width_m * width_m + kHeight_m * kHeight_m) / 12;
  chassis.pitch_inertia_kg_m2 = mass_kg * (kLength_m * kLength_m + kHeight_m * kHeight_m) / 12;
  chassis.yaw_inertia_kg_m2 = mass_kg * (kLength_m * kLength_m + width_m * width_m) / 12;
  chassis.grip = 0.35 / 0.6;
  body.segments.push_back(chassis);
  body.track_m = width_m + 0.016;
  body.supply_v = 5.2;
  for (int i = 0; i < 4; ++i) {
    const bool left = i % 2 == 0;
    WheelSpec wheel;
    wheel.channel = i;
    wheel.side = left ? CarSide::kLeft : CarSide::kRight;
    wheel.x_m = i < 2 ? 0.07 : -0.07;
    wheel.radius_m = 0.06;
    wheel.width_m = 0.012;
    wheel.mass_kg = 0.012;
    wheel.servo = {0.134, 11.5, 5.2, 0.7, 0.11, 2e-4, 1500, 45, 200, left ? 1 : -1};
    body.wheels.push_back(wheel);
  }
  return body;
}

// The study car cut in two at its middle and joined there by a hinge at axle height. Flat, it has the same mass,
// centre of mass and inertias as the whole one.
inline BodySpec hinged_study_car(double width_m, double stiffness_n_m_rad, double limit_rad = 1) {
  BodySpec body = study_car(width_m);
  const SegmentSpec whole = body.segments.front();
  SegmentSpec half = whole;
  half.length_m = 0.5 * whole.length_m;
  half.mass_kg = 0.5 * whole.mass_kg;
  half.roll_inertia_kg_m2 = 0.5 * whole.roll_inertia_kg_m2;
  const double arm_m = 0.5 * half.length_m;
  half.pitch_inertia_kg_m2 = 0.5 * whole.pitch_inertia_kg_m2 - half.mass_kg * arm_m * arm_m;
  half.yaw_inertia_kg_m2 = 0.5 * whole.yaw_inertia_kg_m2 - half.mass_kg * arm_m * arm_m;
  body.segments.clear();
  for (const double sign : {1.0, -1.0}) {
    half.x_m = half.com_x_m = sign * arm_m;
    body.segments.push_back(half);
  }
  for (WheelSpec& wheel : body.wheels) wheel.segment = wheel.x_m > 0 ? 0 : 1;
  body.hinges = {{0, 0, stiffness_n_m_rad, 0, -limit_rad, limit_rad}};
  return body;
}

// Three segments of 140 mm, an axle in the middle of each, hinges between.
inline BodySpec three_segment_car(double width_m, double stiffness_n_m_rad, double damping_n_m_s_rad = 1e-4) {
  BodySpec body = study_car(width_m);
  SegmentSpec segment = body.segments.front();
  const WheelSpec front_wheels[2] = {body.wheels[0], body.wheels[1]};
  const double height_m = segment.height_m, length_m = 0.14;
  segment.length_m = length_m;
  segment.mass_kg /= 2;
  segment.roll_inertia_kg_m2 /= 2;
  segment.pitch_inertia_kg_m2 = segment.mass_kg * (length_m * length_m + height_m * height_m) / 12;
  segment.yaw_inertia_kg_m2 = segment.mass_kg * (length_m * length_m + width_m * width_m) / 12;
  body.segments.clear();
  body.wheels.clear();
  for (int j = 0; j < 3; ++j) {
    segment.x_m = segment.com_x_m = length_m * (1 - j);
    body.segments.push_back(segment);
    for (WheelSpec wheel : front_wheels) {
      wheel.channel += 2 * j;
      wheel.segment = j;
      wheel.x_m = segment.x_m;
      body.wheels.push_back(wheel);
    }
    if (j > 0) body.hinges.push_back({segment.x_m + 0.5 * length_m, 0, stiffness_n_m_rad, damping_n_m_s_rad, -1, 1});
  }
  return body;
}

// Pulses that ask every wheel for that fraction of full speed.
inline PulsesUs pulses_for(const BodySpec& body, double fraction) {
  PulsesUs pulses_us{};
  for (const WheelSpec& wheel : body.wheels) {
    const ServoSpec& servo = wheel.servo;
    const double sign = fraction > 0 ? 1 : fraction < 0 ? -1 : 0;
    const double offset_us = sign * servo.deadband_us + fraction * (servo.saturation_us - servo.deadband_us);
    pulses_us[static_cast<std::size_t>(wheel.channel)] =
        static_cast<float>(servo.neutral_us + servo.direction * offset_us);
  }
  return pulses_us;
}

// A terrain of nothing but these.
inline TerrainSpec blocks(std::vector<BlockSpec> list) {
  TerrainSpec terrain;
  terrain.blocks = std::move(list);
  return terrain;
}

// Two step pyramids left and right of a straight way, as in the width study, without noise.
inline SceneSpec pyramids() {
  SceneSpec scene;
  scene.id = "pyramids";
  scene.friction = 0.6;
  for (int pyramid = 0; pyramid < 2; ++pyramid) {
    for (int step = 0; step < 3; ++step) {
      const double side_m = 0.07 + 0.08 * (2 - step);
      scene.terrain.blocks.push_back(
          {0.45 + 0.45 * pyramid, pyramid == 0 ? 0.05 : -0.05, side_m, side_m, 0.0215 * (step + 1), 0});
    }
  }
  scene.goal = GoalSpec{GoalSpec::Kind::kLine, 1.315, 0, 0, 0};
  scene.course = {-0.5, 2, -1, 1};
  return scene;
}

// Settings of a trial at full speed, with a path.
inline TrialSpec full_speed(const BodySpec& body, double time_limit_s = 60) {
  TrialSpec trial;
  trial.speed_m_s = 0.69;
  trial.time_limit_s = time_limit_s;
  trial.path_interval_s = 0.05;
  trial.parameters.set("TRACK_M", static_cast<float>(body.track_m));
  return trial;
}

// Rotors turn against the frames that carry them: their energy is not the plane's, and they slow a fold.
inline BodySpec without_rotors(BodySpec body) {
  for (WheelSpec& wheel : body.wheels) wheel.servo.rotor_inertia_kg_m2 = 0;
  return body;
}

// Terrain on a course of 40 m.
inline SceneSpec scene_of(const TerrainSpec& terrain, double friction, const PoseSpec& start = {}) {
  SceneSpec scene;
  scene.id = "test";
  scene.friction = friction;
  scene.terrain = terrain;
  scene.start = start;
  scene.course = {-20, 20, -20, 20};
  return scene;
}

}  // namespace foldcar
