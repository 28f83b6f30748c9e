PRAGMA application_id = 1180918130;
PRAGMA user_version = 1;
BEGIN TRANSACTION;
CREATE TABLE body (id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, json TEXT NOT NULL);
INSERT INTO "body" VALUES(1,'733a517382866c2c4a287894164e350078cba788ad125d9f4bcdd3ddf726883c','{"chassis":{"center_z_m":0.0,"com_x_m":0.0,"com_z_m":0.00718696838,"grip":0.583333333,"height_m":0.05,"length_m":0.2,"mass_kg":0.20265125,"pitch_inertia_kg_m2":0.000336551995,"roll_inertia_kg_m2":0.000151780931,"width_m":0.095,"yaw_inertia_kg_m2":0.00040378015},"supply_v":5.2,"track_m":0.111,"wheels":[{"channel":0,"grip":1.0,"mass_kg":0.011897384,"radius_m":0.06,"servo":{"deadband_us":45.0,"direction":1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"left","width_m":0.012,"x_m":0.07},{"channel":1,"grip":1.0,"mass_kg":0.011897384,"radius_m":0.06,"servo":{"deadband_us":45.0,"direction":-1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"right","width_m":0.012,"x_m":0.07},{"channel":2,"grip":1.0,"mass_kg":0.011897384,"radius_m":0.06,"servo":{"deadband_us":45.0,"direction":1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"left","width_m":0.012,"x_m":-0.07},{"channel":3,"grip":1.0,"mass_kg":0.011897384,"radius_m":0.06,"servo":{"deadband_us":45.0,"direction":-1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"right","width_m":0.012,"x_m":-0.07}]}');
INSERT INTO "body" VALUES(2,'11283f44dc89a768bc30953396864e4e7383c9cf511a206565818ce08acad958','{"chassis":{"center_z_m":0.0,"com_x_m":0.0,"com_z_m":0.00703615124,"grip":0.583333333,"height_m":0.05,"length_m":0.2,"mass_kg":0.206995,"pitch_inertia_kg_m2":0.000359352003,"roll_inertia_kg_m2":0.000214505075,"width_m":0.12,"yaw_inertia_kg_m2":0.000484202551},"supply_v":5.2,"track_m":0.136,"wheels":[{"channel":0,"grip":1.0,"mass_kg":0.011897384,"radius_m":0.06,"servo":{"deadband_us":45.0,"direction":1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"left","width_m":0.012,"x_m":0.07},{"channel":1,"grip":1.0,"mass_kg":0.011897384,"radius_m":0.06,"servo":{"deadband_us":45.0,"direction":-1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"right","width_m":0.012,"x_m":0.07},{"channel":2,"grip":1.0,"mass_kg":0.011897384,"radius_m":0.06,"servo":{"deadband_us":45.0,"direction":1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"left","width_m":0.012,"x_m":-0.07},{"channel":3,"grip":1.0,"mass_kg":0.011897384,"radius_m":0.06,"servo":{"deadband_us":45.0,"direction":-1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"right","width_m":0.012,"x_m":-0.07}]}');
CREATE TABLE build (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
INSERT INTO "build" VALUES(1,'d723ee40501ac491');
CREATE TABLE design (
        experiment TEXT NOT NULL REFERENCES experiment, position INTEGER NOT NULL, parameters TEXT NOT NULL,
        body_id INTEGER NOT NULL REFERENCES body, settings_id INTEGER NOT NULL REFERENCES settings,
        PRIMARY KEY (experiment, position)) WITHOUT ROWID;
INSERT INTO "design" VALUES('1',0,'{"width_mm": 95.0, "height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}',1,1);
INSERT INTO "design" VALUES('1',1,'{"width_mm": 120.0, "height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}',2,2);
INSERT INTO "design" VALUES('flat',0,'{"width_mm": 95.0, "height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}',1,3);
INSERT INTO "design" VALUES('flat',1,'{"width_mm": 120.0, "height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}',2,4);
CREATE TABLE environment (id INTEGER PRIMARY KEY, fingerprint TEXT NOT NULL UNIQUE);
INSERT INTO "environment" VALUES(1,'8c6f66bd6b12befe86b5fac07998e0014253660c166d822a987c86046ed250bc');
INSERT INTO "environment" VALUES(2,'46e9802e0974842a2326755a78c0c9bc0ed57a8d54fb551424bf5be936a7704e');
CREATE TABLE experiment (
        id TEXT PRIMARY KEY, position INTEGER NOT NULL, build_id INTEGER NOT NULL REFERENCES build,
        environment_id INTEGER NOT NULL REFERENCES environment, environments INTEGER NOT NULL,
        vehicle TEXT NOT NULL, environment TEXT NOT NULL, facts TEXT NOT NULL);
INSERT INTO "experiment" VALUES('1',0,1,1,2,'1','1','{"vehicle_type": "W_B_W", "varied": {"width_mm": [95.0, 120.0]}, "fixed": {"height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}, "timeout_s": 1.0, "speed_m_s": null, "yaw_rate_rad_s": 0.0, "scenic_program": "ramp.scenic", "scenic_params": {}, "seed": 1}');
INSERT INTO "experiment" VALUES('flat',1,1,2,3,'1','2','{"vehicle_type": "W_B_W", "varied": {"width_mm": [95.0, 120.0]}, "fixed": {"height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}, "timeout_s": 0.5, "speed_m_s": null, "yaw_rate_rad_s": 0.0, "scenic_program": "free.scenic", "scenic_params": {}, "seed": 1}');
CREATE TABLE run (
        build_id INTEGER NOT NULL REFERENCES build, body_id INTEGER NOT NULL REFERENCES body,
        scene_id INTEGER NOT NULL REFERENCES scene, settings_id INTEGER NOT NULL REFERENCES settings,
        outcome TEXT NOT NULL, elapsed_time_s REAL NOT NULL, distance_to_target_m REAL NOT NULL,
        consumed_energy_j REAL NOT NULL, max_roll_rad REAL NOT NULL, max_pitch_rad REAL NOT NULL,
        PRIMARY KEY (build_id, body_id, scene_id, settings_id)) WITHOUT ROWID;
INSERT INTO "run" VALUES(1,1,1,1,'timeout',1.01666666666666660745e+00,8.9767075621986880396e-02,3.71874283085994861153e+00,8.23740004512571732941e-02,4.34451550245285034179e-01);
INSERT INTO "run" VALUES(1,1,2,1,'timeout',1.01666666666666660745e+00,3.88753260479911891267e-02,3.30123322809208685768e+00,6.37320096007898684309e-02,3.86768549680709838867e-01);
INSERT INTO "run" VALUES(1,1,3,3,'passed',4.5833333333333337034e-01,1.99772022335440368676e-03,1.33252098341609515053e+00,6.00039834374143168926e-03,1.18045136332511901855e-02);
INSERT INTO "run" VALUES(1,1,4,3,'passed',4.5833333333333337034e-01,1.99769639335491567405e-03,1.33252102675877415194e+00,6.00039834374143168926e-03,1.18045136332511901855e-02);
INSERT INTO "run" VALUES(1,1,5,3,'passed',4.5833333333333337034e-01,1.99769639335491567405e-03,1.33252102675877415194e+00,6.00039834374143168926e-03,1.18045136332511901855e-02);
INSERT INTO "run" VALUES(1,2,1,2,'timeout',1.01666666666666660745e+00,6.5408898261256565032e-02,3.60526527338288049762e+00,5.48606774096669913554e-02,4.36348110437393188476e-01);
INSERT INTO "run" VALUES(1,2,2,2,'timeout',1.01666666666666660745e+00,3.65812833112812568758e-02,3.29366577870210130996e+00,1.80966524057459242358e-02,4.62061792612075805664e-01);
INSERT INTO "run" VALUES(1,2,3,4,'passed',4.49999999999999955591e-01,1.38499482980732730418e-03,1.24267308544310850493e+00,2.294955694185777436e-03,5.52218686789274215698e-03);
INSERT INTO "run" VALUES(1,2,4,4,'passed',4.49999999999999955591e-01,1.38497124187629029601e-03,1.24267309707163287058e+00,2.294955694185777436e-03,5.52218686789274215698e-03);
INSERT INTO "run" VALUES(1,2,5,4,'passed',4.49999999999999955591e-01,1.38497124187629029601e-03,1.24267309707163287058e+00,2.294955694185777436e-03,5.52218686789274215698e-03);
CREATE TABLE sample (
        environment_id INTEGER NOT NULL REFERENCES environment, sample INTEGER NOT NULL,
        scene_id INTEGER NOT NULL REFERENCES scene, PRIMARY KEY (environment_id, sample)) WITHOUT ROWID;
INSERT INTO "sample" VALUES(1,0,1);
INSERT INTO "sample" VALUES(1,1,2);
INSERT INTO "sample" VALUES(2,0,3);
INSERT INTO "sample" VALUES(2,1,4);
INSERT INTO "sample" VALUES(2,2,5);
CREATE TABLE scene (id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, json TEXT NOT NULL);
INSERT INTO "scene" VALUES(1,'ed512b1f9c2b49cabb044b82237c2d28d629f5b38e784e7d48a1e4378f67e4d8','{"course":{"x_max_m":2.0,"x_min_m":-0.5,"y_max_m":1.0,"y_min_m":-1.0},"friction":0.6,"goal":{"heading_rad":0.0,"kind":"line","x_m":0.5,"y_m":0.0},"start":{"heading_rad":0.0,"x_m":0.0,"y_m":0.0},"terrain":[{"heading_rad":0.0,"height_m":0.05,"kind":"box","length_m":0.06,"width_m":1.2,"x_m":0.343766263,"y_m":0.0}]}');
INSERT INTO "scene" VALUES(2,'b971c673f8d5c8bbbad44da383121da996e14921b2c8203ce7f126841b43d033','{"course":{"x_max_m":2.0,"x_min_m":-0.5,"y_max_m":1.0,"y_min_m":-1.0},"friction":0.6,"goal":{"heading_rad":0.0,"kind":"line","x_m":0.5,"y_m":0.0},"start":{"heading_rad":0.0,"x_m":0.0,"y_m":0.0},"terrain":[{"heading_rad":0.0,"height_m":0.05,"kind":"box","length_m":0.06,"width_m":1.2,"x_m":0.477573192,"y_m":0.0}]}');
INSERT INTO "scene" VALUES(3,'ce04ccc26d5a244737c728774a0434780fce447ae34b17f9227dfe9e0fa6cb93','{"course":{"x_max_m":2.0,"x_min_m":-0.5,"y_max_m":1.0,"y_min_m":-1.0},"friction":0.6,"goal":{"heading_rad":0.0,"kind":"line","x_m":0.2,"y_m":0.0},"start":{"heading_rad":0.0,"x_m":0.0,"y_m":0.0},"terrain":[{"heading_rad":0.0,"height_m":0.01,"kind":"box","length_m":0.06,"width_m":1.2,"x_m":0.343766263,"y_m":0.3}]}');
INSERT INTO "scene" VALUES(4,'d777960033a43af2c0e729b6a298c6eba57d516f520960a522a6d01c8103a0cc','{"course":{"x_max_m":2.0,"x_min_m":-0.5,"y_max_m":1.0,"y_min_m":-1.0},"friction":0.6,"goal":{"heading_rad":0.0,"kind":"line","x_m":0.2,"y_m":0.0},"start":{"heading_rad":0.0,"x_m":0.0,"y_m":0.0},"terrain":[{"heading_rad":0.0,"height_m":0.01,"kind":"box","length_m":0.06,"width_m":1.2,"x_m":0.477573192,"y_m":0.3}]}');
INSERT INTO "scene" VALUES(5,'412a0f57970c1fdf59fc8fe51c9e8b116f2adf7504d5a1a6a9146384c0980a15','{"course":{"x_max_m":2.0,"x_min_m":-0.5,"y_max_m":1.0,"y_min_m":-1.0},"friction":0.6,"goal":{"heading_rad":0.0,"kind":"line","x_m":0.2,"y_m":0.0},"start":{"heading_rad":0.0,"x_m":0.0,"y_m":0.0},"terrain":[{"heading_rad":0.0,"height_m":0.01,"kind":"box","length_m":0.06,"width_m":1.2,"x_m":0.467478687,"y_m":0.3}]}');
CREATE TABLE settings (id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, json TEXT NOT NULL);
INSERT INTO "settings" VALUES(1,'d49ca8c55136bb14d9a9b912994bde5757e8a5a2a370ec341c440cd854511102','{"parameters":{"CH1_DEADBAND_US":45.0,"CH1_DIRECTION":1,"CH1_GAIN_US":13.455827,"CH1_NEUTRAL_US":1500.0,"CH1_SIDE":1,"CH2_DEADBAND_US":45.0,"CH2_DIRECTION":-1,"CH2_GAIN_US":13.455827,"CH2_NEUTRAL_US":1500.0,"CH2_SIDE":2,"CH3_DEADBAND_US":45.0,"CH3_DIRECTION":1,"CH3_GAIN_US":13.455827,"CH3_NEUTRAL_US":1500.0,"CH3_SIDE":1,"CH4_DEADBAND_US":45.0,"CH4_DIRECTION":-1,"CH4_GAIN_US":13.455827,"CH4_NEUTRAL_US":1500.0,"CH4_SIDE":2,"CH5_SIDE":0,"CH6_SIDE":0,"CH7_SIDE":0,"CH8_SIDE":0,"TRACK_M":0.111,"WHEEL_MAX_RAD_S":11.5191731,"WHEEL_RADIUS_M":0.06},"speed_m_s":0.691150384,"time_limit_s":1.0,"yaw_rate_rad_s":0.0}');
INSERT INTO "settings" VALUES(2,'89fe6c6278278b64db9895fef9861703734dacd61fbac25db2b19f00168dbae6','{"parameters":{"CH1_DEADBAND_US":45.0,"CH1_DIRECTION":1,"CH1_GAIN_US":13.455827,"CH1_NEUTRAL_US":1500.0,"CH1_SIDE":1,"CH2_DEADBAND_US":45.0,"CH2_DIRECTION":-1,"CH2_GAIN_US":13.455827,"CH2_NEUTRAL_US":1500.0,"CH2_SIDE":2,"CH3_DEADBAND_US":45.0,"CH3_DIRECTION":1,"CH3_GAIN_US":13.455827,"CH3_NEUTRAL_US":1500.0,"CH3_SIDE":1,"CH4_DEADBAND_US":45.0,"CH4_DIRECTION":-1,"CH4_GAIN_US":13.455827,"CH4_NEUTRAL_US":1500.0,"CH4_SIDE":2,"CH5_SIDE":0,"CH6_SIDE":0,"CH7_SIDE":0,"CH8_SIDE":0,"TRACK_M":0.136,"WHEEL_MAX_RAD_S":11.5191731,"WHEEL_RADIUS_M":0.06},"speed_m_s":0.691150384,"time_limit_s":1.0,"yaw_rate_rad_s":0.0}');
INSERT INTO "settings" VALUES(3,'8bdc5c89c955f8aa7ff77b85a90a718d34abd75d7e0dee2f27250bd6be869d1a','{"parameters":{"CH1_DEADBAND_US":45.0,"CH1_DIRECTION":1,"CH1_GAIN_US":13.455827,"CH1_NEUTRAL_US":1500.0,"CH1_SIDE":1,"CH2_DEADBAND_US":45.0,"CH2_DIRECTION":-1,"CH2_GAIN_US":13.455827,"CH2_NEUTRAL_US":1500.0,"CH2_SIDE":2,"CH3_DEADBAND_US":45.0,"CH3_DIRECTION":1,"CH3_GAIN_US":13.455827,"CH3_NEUTRAL_US":1500.0,"CH3_SIDE":1,"CH4_DEADBAND_US":45.0,"CH4_DIRECTION":-1,"CH4_GAIN_US":13.455827,"CH4_NEUTRAL_US":1500.0,"CH4_SIDE":2,"CH5_SIDE":0,"CH6_SIDE":0,"CH7_SIDE":0,"CH8_SIDE":0,"TRACK_M":0.111,"WHEEL_MAX_RAD_S":11.5191731,"WHEEL_RADIUS_M":0.06},"speed_m_s":0.691150384,"time_limit_s":0.5,"yaw_rate_rad_s":0.0}');
INSERT INTO "settings" VALUES(4,'d6be40a8cc5af99eb6739a1cb0305e54856a79083ffaf3e54053fab2ff4c4095','{"parameters":{"CH1_DEADBAND_US":45.0,"CH1_DIRECTION":1,"CH1_GAIN_US":13.455827,"CH1_NEUTRAL_US":1500.0,"CH1_SIDE":1,"CH2_DEADBAND_US":45.0,"CH2_DIRECTION":-1,"CH2_GAIN_US":13.455827,"CH2_NEUTRAL_US":1500.0,"CH2_SIDE":2,"CH3_DEADBAND_US":45.0,"CH3_DIRECTION":1,"CH3_GAIN_US":13.455827,"CH3_NEUTRAL_US":1500.0,"CH3_SIDE":1,"CH4_DEADBAND_US":45.0,"CH4_DIRECTION":-1,"CH4_GAIN_US":13.455827,"CH4_NEUTRAL_US":1500.0,"CH4_SIDE":2,"CH5_SIDE":0,"CH6_SIDE":0,"CH7_SIDE":0,"CH8_SIDE":0,"TRACK_M":0.136,"WHEEL_MAX_RAD_S":11.5191731,"WHEEL_RADIUS_M":0.06},"speed_m_s":0.691150384,"time_limit_s":0.5,"yaw_rate_rad_s":0.0}');
CREATE TABLE study (key TEXT PRIMARY KEY, value TEXT NOT NULL);
INSERT INTO "study" VALUES('foldcar_version','0.1.0');
INSERT INTO "study" VALUES('scenic_version','3.1.1');
INSERT INTO "study" VALUES('carsim_build','d723ee40501ac491');
INSERT INTO "study" VALUES('listing_name','l.json');
INSERT INTO "study" VALUES('listing_text','{
  "experiments": {
    "1": {"veh_id": 1, "env_id": 1, "params": {"timeout": 1, "environments": 2}},
    "flat": {"veh_id": 1, "env_id": 2, "params": {"timeout": 0.5, "environments": 3}}
  },
  "vehicles": {"1": {"type": "W_B_W", "params": [{"common": {"width": [95, 120]}}]}},
  "environments": {"1": {"scenic_filename": "ramp.scenic", "seed": 1}, "2": {"scenic_filename": "free.scenic", "seed": 1}}
}
');
INSERT INTO "study" VALUES('command','foldcar sweep l.json --store s.db --jobs 1');
INSERT INTO "study" VALUES('created_utc','2026-11-22T07:31:16+00:00');
CREATE VIEW result AS
        SELECT e.position AS experiment_position, e.id AS experiment, e.vehicle, e.environment,
            d.position AS design_position, d.parameters, s.sample, r.outcome, r.elapsed_time_s,
            r.distance_to_target_m, r.consumed_energy_j, r.max_roll_rad, r.max_pitch_rad
        FROM experiment e CROSS JOIN design d CROSS JOIN sample s CROSS JOIN run r
        WHERE d.experiment = e.id AND s.environment_id = e.environment_id AND s.sample < e.environments
            AND r.build_id = e.build_id AND r.body_id = d.body_id AND r.scene_id = s.scene_id
            AND r.settings_id = d.settings_id;
COMMIT;
