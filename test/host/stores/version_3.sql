PRAGMA application_id = 1180918130;
PRAGMA user_version = 3;
BEGIN TRANSACTION;
CREATE TABLE body (id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, json TEXT NOT NULL);
INSERT INTO "body" VALUES(1,'9245a8fcd9f2559077fd8ab3dbd36c6070f7d8e7a2f1c7fde9415360233ac3ab','{"hinges":[],"segments":[{"center_z_m":0.0,"com_x_m":0.0,"com_y_m":-0.000142780336,"com_z_m":0.00705742593,"grip":0.583333333,"height_m":0.05,"length_m":0.2,"mass_kg":0.206265274,"pitch_inertia_kg_m2":0.000351973272,"roll_inertia_kg_m2":0.000175494528,"width_m":0.095,"x_m":0.0,"yaw_inertia_kg_m2":0.00044115719}],"supply_v":5.2,"track_m":0.1232,"wheels":[{"channel":0,"eccentricity_m":0.0,"eccentricity_phase_rad":0.0,"grip":1.0,"mass_kg":0.0130219839,"radius_m":0.06,"segment":0,"servo":{"deadband_us":45.0,"direction":1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"left","width_m":0.012,"x_m":0.07},{"channel":1,"eccentricity_m":0.0,"eccentricity_phase_rad":0.0,"grip":1.0,"mass_kg":0.0130219839,"radius_m":0.06,"segment":0,"servo":{"deadband_us":45.0,"direction":-1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"right","width_m":0.012,"x_m":0.07},{"channel":2,"eccentricity_m":0.0,"eccentricity_phase_rad":0.0,"grip":1.0,"mass_kg":0.0130219839,"radius_m":0.06,"segment":0,"servo":{"deadband_us":45.0,"direction":1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"left","width_m":0.012,"x_m":-0.07},{"channel":3,"eccentricity_m":0.0,"eccentricity_phase_rad":0.0,"grip":1.0,"mass_kg":0.0130219839,"radius_m":0.06,"segment":0,"servo":{"deadband_us":45.0,"direction":-1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"right","width_m":0.012,"x_m":-0.07}]}');
INSERT INTO "body" VALUES(2,'54ce01ce9a4f5fee70eff46f37d57505e6280e46db3b058c669b61f68bcd88f2','{"hinges":[],"segments":[{"center_z_m":0.0,"com_x_m":0.0,"com_y_m":-0.000180394412,"com_z_m":0.00683982755,"grip":0.583333333,"height_m":0.05,"length_m":0.2,"mass_kg":0.211415224,"pitch_inertia_kg_m2":0.000377982037,"roll_inertia_kg_m2":0.000248373863,"width_m":0.12,"x_m":0.0,"yaw_inertia_kg_m2":0.000533927587}],"supply_v":5.2,"track_m":0.1482,"wheels":[{"channel":0,"eccentricity_m":0.0,"eccentricity_phase_rad":0.0,"grip":1.0,"mass_kg":0.0130219839,"radius_m":0.06,"segment":0,"servo":{"deadband_us":45.0,"direction":1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"left","width_m":0.012,"x_m":0.07},{"channel":1,"eccentricity_m":0.0,"eccentricity_phase_rad":0.0,"grip":1.0,"mass_kg":0.0130219839,"radius_m":0.06,"segment":0,"servo":{"deadband_us":45.0,"direction":-1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"right","width_m":0.012,"x_m":0.07},{"channel":2,"eccentricity_m":0.0,"eccentricity_phase_rad":0.0,"grip":1.0,"mass_kg":0.0130219839,"radius_m":0.06,"segment":0,"servo":{"deadband_us":45.0,"direction":1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"left","width_m":0.012,"x_m":-0.07},{"channel":3,"eccentricity_m":0.0,"eccentricity_phase_rad":0.0,"grip":1.0,"mass_kg":0.0130219839,"radius_m":0.06,"segment":0,"servo":{"deadband_us":45.0,"direction":-1,"neutral_us":1500.0,"no_load_current_a":0.104,"no_load_speed_rad_s":11.5191731,"rated_v":5.2,"rotor_inertia_kg_m2":0.0002,"saturation_us":200.0,"stall_current_a":0.693333333,"stall_torque_n_m":0.134024217},"side":"right","width_m":0.012,"x_m":-0.07}]}');
CREATE TABLE build (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
INSERT INTO "build" VALUES(1,'510d3451de04332e');
CREATE TABLE correction (
        id INTEGER PRIMARY KEY, trial_id INTEGER NOT NULL REFERENCES trial, corrected_utc TEXT NOT NULL,
        field TEXT NOT NULL, before, after, reason TEXT NOT NULL, operator TEXT NOT NULL);
INSERT INTO "correction" VALUES(1,1,'2026-11-22T07:33:09+00:00','outcome','passed','tipped','seen on the film','Bo');
INSERT INTO "correction" VALUES(2,1,'2026-11-22T07:33:09+00:00','elapsed_time_s',4.20834004878997802734e-01,0.4,'seen on the film','Bo');
INSERT INTO "correction" VALUES(3,1,'2026-11-22T07:33:13+00:00','note','first','','no note','');
CREATE TABLE design (
        experiment TEXT NOT NULL REFERENCES experiment, position INTEGER NOT NULL, parameters TEXT NOT NULL,
        body_id INTEGER NOT NULL REFERENCES body, settings_id INTEGER NOT NULL REFERENCES settings,
        PRIMARY KEY (experiment, position)) WITHOUT ROWID;
INSERT INTO "design" VALUES('1',0,'{"width_mm": 95.0, "height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}',1,1);
INSERT INTO "design" VALUES('1',1,'{"width_mm": 120.0, "height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}',2,2);
INSERT INTO "design" VALUES('recorded',0,'{"width_mm": 95.0, "height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}',1,1);
INSERT INTO "design" VALUES('recorded',1,'{"width_mm": 120.0, "height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}',2,2);
CREATE TABLE draw (
        spread_id INTEGER NOT NULL REFERENCES spread, sample INTEGER NOT NULL,
        variation_id INTEGER NOT NULL REFERENCES variation, PRIMARY KEY (spread_id, sample)) WITHOUT ROWID;
INSERT INTO "draw" VALUES(1,0,1);
INSERT INTO "draw" VALUES(1,1,1);
INSERT INTO "draw" VALUES(2,0,2);
INSERT INTO "draw" VALUES(2,1,3);
CREATE TABLE environment (id INTEGER PRIMARY KEY, fingerprint TEXT NOT NULL UNIQUE, dynamic INTEGER);
INSERT INTO "environment" VALUES(1,'98fd4481489d00638f04939928241d34a7d8166bb26c07a48ea196119ad2d788',1);
INSERT INTO "environment" VALUES(2,'efd7fd4a073ba235beefcdb3b4cdcc16d373bb9aa47e1e93769b2d4365e6aa1d',0);
CREATE TABLE experiment (
        id TEXT PRIMARY KEY, position INTEGER NOT NULL, build_id INTEGER NOT NULL REFERENCES build,
        environment_id INTEGER NOT NULL REFERENCES environment, spread_id INTEGER NOT NULL REFERENCES spread,
        environments INTEGER NOT NULL, vehicle TEXT NOT NULL, environment TEXT NOT NULL,
        facts TEXT NOT NULL);
INSERT INTO "experiment" VALUES('recorded',0,1,1,1,2,'1','1','{"vehicle_type": "W_B_W", "varied": {"width_mm": [95.0, 120.0]}, "fixed": {"height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}, "timeout_s": 0.5, "speed_m_s": null, "yaw_rate_rad_s": 0.0, "scenic_program": "car.scenic", "scenic_params": {}, "seed": 1, "condition": null, "variation": {}, "variation_seed": 1}');
INSERT INTO "experiment" VALUES('1',1,1,2,2,2,'1','2','{"vehicle_type": "W_B_W", "varied": {"width_mm": [95.0, 120.0]}, "fixed": {"height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}, "timeout_s": 0.5, "speed_m_s": null, "yaw_rate_rad_s": 0.0, "scenic_program": "free.scenic", "scenic_params": {}, "seed": 1, "condition": null, "variation": {"servo_speed": 0.05, "servo_torque": 0.05, "neutral_us": 15.0, "deadband_us": 10.0, "eccentricity_m": 0.0005, "tyre_grip": 0.08, "wheel_radius": 0.01, "supply_v": 0.2, "mass": 0.03, "com_x_m": 0.004, "com_y_m": 0.003, "com_z_m": 0.002, "belly_grip": 0.2}, "variation_seed": 1}');
CREATE TABLE recorded (
        build_id INTEGER NOT NULL, body_id INTEGER NOT NULL, scene_id INTEGER NOT NULL,
        settings_id INTEGER NOT NULL, variation_id INTEGER NOT NULL,
        name TEXT NOT NULL, kind TEXT NOT NULL, value TEXT NOT NULL,
        PRIMARY KEY (build_id, body_id, scene_id, settings_id, variation_id, name)) WITHOUT ROWID;
INSERT INTO "recorded" VALUES(1,1,1,1,1,'begin','initial','0.00437758036681835');
INSERT INTO "recorded" VALUES(1,1,1,1,1,'end','final','[0.20022692346645, 0.0003339835274771619, -2.110007882916154e-06]');
INSERT INTO "recorded" VALUES(1,1,1,1,1,'risky','final','1.0');
INSERT INTO "recorded" VALUES(1,1,1,1,1,'speed','series','[[0.0, -1.3545009380777628e-07], [0.25, 0.641091525554657], [0.44166666666666665, 0.6855900287628174]]');
INSERT INTO "recorded" VALUES(1,2,1,2,1,'begin','initial','0.004377542559188017');
INSERT INTO "recorded" VALUES(1,2,1,2,1,'end','final','[0.20007070523885362, 0.000331250315871129, -4.059079482678085e-06]');
INSERT INTO "recorded" VALUES(1,2,1,2,1,'risky','final','1.0');
INSERT INTO "recorded" VALUES(1,2,1,2,1,'speed','series','[[0.0, -1.4096140432684479e-07], [0.25, 0.6401392221450806], [0.44166666666666665, 0.6855522990226746]]');
CREATE TABLE run (
        build_id INTEGER NOT NULL REFERENCES build, body_id INTEGER NOT NULL REFERENCES body,
        scene_id INTEGER NOT NULL REFERENCES scene, settings_id INTEGER NOT NULL REFERENCES settings,
        variation_id INTEGER NOT NULL REFERENCES variation,
        outcome TEXT NOT NULL, elapsed_time_s REAL, distance_to_target_m REAL, consumed_energy_j REAL,
        max_roll_rad REAL, max_pitch_rad REAL, message TEXT,
        PRIMARY KEY (build_id, body_id, scene_id, settings_id, variation_id)) WITHOUT ROWID;
INSERT INTO "run" VALUES(1,1,1,1,1,'passed',4.41666666666666651863e-01,4.03781198487204457791e-04,1.20950408319515867461e+00,8.68526404884140156622e-05,4.2137529817409813404e-04,NULL);
INSERT INTO "run" VALUES(1,1,2,1,1,'failed',NULL,NULL,NULL,NULL,NULL,'car.scenic: sample 1: line 8: ZeroDivisionError: division by zero');
INSERT INTO "run" VALUES(1,1,3,1,2,'passed',4.20833333333333281522e-01,0.00911258574502714,1.35694456023924514553e+00,8.69790348977209602787e-03,4.35729091987013816833e-03,NULL);
INSERT INTO "run" VALUES(1,1,4,1,3,'passed',4.5833333333333337034e-01,2.35230297437411797409e-03,1.37611170948948502434e+00,7.64451264031585329961e-03,1.30537897348403930664e-02,NULL);
INSERT INTO "run" VALUES(1,2,1,2,1,'passed',4.41666666666666651863e-01,3.38712271059181521323e-04,1.21430499167387551118e+00,5.92780052449330726194e-05,4.18946117861196398735e-04,NULL);
INSERT INTO "run" VALUES(1,2,2,2,1,'failed',NULL,NULL,NULL,NULL,NULL,'car.scenic: sample 1: line 8: ZeroDivisionError: division by zero');
INSERT INTO "run" VALUES(1,2,3,2,2,'passed',4.20833333333333281522e-01,9.36001334935831520722e-03,1.36230537066175338978e+00,6.79182500296197227962e-03,4.76464303210377693176e-03,NULL);
INSERT INTO "run" VALUES(1,2,4,2,3,'passed',4.5833333333333337034e-01,2.72129703596905121384e-03,1.37993948918891651267e+00,5.35927018747347442412e-03,1.23757617548108100891e-02,NULL);
CREATE TABLE sample (
        environment_id INTEGER NOT NULL REFERENCES environment, sample INTEGER NOT NULL,
        scene_id INTEGER NOT NULL REFERENCES scene, PRIMARY KEY (environment_id, sample)) WITHOUT ROWID;
INSERT INTO "sample" VALUES(1,0,1);
INSERT INTO "sample" VALUES(1,1,2);
INSERT INTO "sample" VALUES(2,0,3);
INSERT INTO "sample" VALUES(2,1,4);
CREATE TABLE scene (id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, json TEXT NOT NULL);
INSERT INTO "scene" VALUES(1,'c098ef109b4af68c40bda5c63f38d15df66a12d258a01c2ec91d28e6a7393fed','{"course":{"x_max_m":2.0,"x_min_m":-0.5,"y_max_m":1.0,"y_min_m":-1.0},"friction":0.6,"goal":{"heading_rad":0.0,"kind":"line","x_m":0.2,"y_m":0.0},"start":{"heading_rad":0.0,"x_m":0.004376626,"y_m":0.0},"terrain":[{"heading_rad":0.0,"height_m":0.01,"kind":"box","length_m":0.06,"width_m":1.2,"x_m":0.360199008,"y_m":0.3}]}');
INSERT INTO "scene" VALUES(2,'e4842d9ac5d882bb99c99958dc518f36cae03ddd87a27beb0fa7758a6a6047cd','{"course":{"x_max_m":2.0,"x_min_m":-0.5,"y_max_m":1.0,"y_min_m":-1.0},"friction":0.6,"goal":{"heading_rad":0.0,"kind":"line","x_m":0.2,"y_m":0.0},"start":{"heading_rad":0.0,"x_m":0.017757319,"y_m":0.0},"terrain":[{"heading_rad":0.0,"height_m":0.01,"kind":"box","length_m":0.06,"width_m":1.2,"x_m":0.475854184,"y_m":0.3}]}');
INSERT INTO "scene" VALUES(3,'ce04ccc26d5a244737c728774a0434780fce447ae34b17f9227dfe9e0fa6cb93','{"course":{"x_max_m":2.0,"x_min_m":-0.5,"y_max_m":1.0,"y_min_m":-1.0},"friction":0.6,"goal":{"heading_rad":0.0,"kind":"line","x_m":0.2,"y_m":0.0},"start":{"heading_rad":0.0,"x_m":0.0,"y_m":0.0},"terrain":[{"heading_rad":0.0,"height_m":0.01,"kind":"box","length_m":0.06,"width_m":1.2,"x_m":0.343766263,"y_m":0.3}]}');
INSERT INTO "scene" VALUES(4,'d777960033a43af2c0e729b6a298c6eba57d516f520960a522a6d01c8103a0cc','{"course":{"x_max_m":2.0,"x_min_m":-0.5,"y_max_m":1.0,"y_min_m":-1.0},"friction":0.6,"goal":{"heading_rad":0.0,"kind":"line","x_m":0.2,"y_m":0.0},"start":{"heading_rad":0.0,"x_m":0.0,"y_m":0.0},"terrain":[{"heading_rad":0.0,"height_m":0.01,"kind":"box","length_m":0.06,"width_m":1.2,"x_m":0.477573192,"y_m":0.3}]}');
INSERT INTO "scene" VALUES(5,'3571fbd7706a9cc2253c0dcabf770b8a024eaee89b5bf0fe3d9cce8824baba1e','{"course":{"x_max_m":2.0,"x_min_m":-0.5,"y_max_m":1.0,"y_min_m":-1.0},"friction":0.6,"goal":{"heading_rad":0.0,"kind":"line","x_m":0.2,"y_m":0.0},"start":{"heading_rad":0.0,"x_m":0.0,"y_m":0.0},"terrain":[{"heading_rad":0.026179938779914945,"height_m":0.01,"kind":"box","length_m":0.06,"width_m":1.2,"x_m":0.348766263,"y_m":0.297}]}');
CREATE TABLE settings (id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, json TEXT NOT NULL);
INSERT INTO "settings" VALUES(1,'36a4282490ff3ed69445bb7e8efede1ebcfdf6304013a29d907aec18c877a254','{"parameters":{"CH1_DEADBAND_US":45.0,"CH1_DIRECTION":1,"CH1_GAIN_US":13.455827,"CH1_NEUTRAL_US":1500.0,"CH1_SIDE":1,"CH2_DEADBAND_US":45.0,"CH2_DIRECTION":-1,"CH2_GAIN_US":13.455827,"CH2_NEUTRAL_US":1500.0,"CH2_SIDE":2,"CH3_DEADBAND_US":45.0,"CH3_DIRECTION":1,"CH3_GAIN_US":13.455827,"CH3_NEUTRAL_US":1500.0,"CH3_SIDE":1,"CH4_DEADBAND_US":45.0,"CH4_DIRECTION":-1,"CH4_GAIN_US":13.455827,"CH4_NEUTRAL_US":1500.0,"CH4_SIDE":2,"CH5_SIDE":0,"CH6_SIDE":0,"CH7_SIDE":0,"CH8_SIDE":0,"TRACK_M":0.1232,"WHEEL_MAX_RAD_S":11.5191731,"WHEEL_RADIUS_M":0.06},"speed_m_s":0.691150384,"time_limit_s":0.5,"yaw_rate_rad_s":0.0}');
INSERT INTO "settings" VALUES(2,'9886e86458ee5bc9f541b0cc59c09785bd3dbc97c155005d9444b9c6f08e1194','{"parameters":{"CH1_DEADBAND_US":45.0,"CH1_DIRECTION":1,"CH1_GAIN_US":13.455827,"CH1_NEUTRAL_US":1500.0,"CH1_SIDE":1,"CH2_DEADBAND_US":45.0,"CH2_DIRECTION":-1,"CH2_GAIN_US":13.455827,"CH2_NEUTRAL_US":1500.0,"CH2_SIDE":2,"CH3_DEADBAND_US":45.0,"CH3_DIRECTION":1,"CH3_GAIN_US":13.455827,"CH3_NEUTRAL_US":1500.0,"CH3_SIDE":1,"CH4_DEADBAND_US":45.0,"CH4_DIRECTION":-1,"CH4_GAIN_US":13.455827,"CH4_NEUTRAL_US":1500.0,"CH4_SIDE":2,"CH5_SIDE":0,"CH6_SIDE":0,"CH7_SIDE":0,"CH8_SIDE":0,"TRACK_M":0.1482,"WHEEL_MAX_RAD_S":11.5191731,"WHEEL_RADIUS_M":0.06},"speed_m_s":0.691150384,"time_limit_s":0.5,"yaw_rate_rad_s":0.0}');
CREATE TABLE spread (id INTEGER PRIMARY KEY, fingerprint TEXT NOT NULL UNIQUE);
INSERT INTO "spread" VALUES(1,'nominal');
INSERT INTO "spread" VALUES(2,'73cf47b097f20e5dd720c1a629cd1f4283f3f10efe8dbe2f711b4400f1e41fb4');
CREATE TABLE study (key TEXT PRIMARY KEY, value TEXT NOT NULL);
INSERT INTO "study" VALUES('foldcar_version','0.1.0');
INSERT INTO "study" VALUES('scenic_version','3.1.1');
INSERT INTO "study" VALUES('carsim_build','510d3451de04332e');
INSERT INTO "study" VALUES('listing_name','l.json');
INSERT INTO "study" VALUES('listing_text','{
  "experiments": {
    "recorded": {"veh_id": 1, "env_id": 1, "params": {"timeout": 0.5, "environments": 2}},
    "1": {"veh_id": 1, "env_id": 2, "params": {"timeout": 0.5, "environments": 2, "variation": "workshop"}}
  },
  "vehicles": {"1": {"type": "W_B_W", "params": [{"common": {"width": [95, 120]}}]}},
  "environments": {"1": {"scenic_filename": "car.scenic", "seed": 1}, "2": {"scenic_filename": "free.scenic", "seed": 1}}
}
');
INSERT INTO "study" VALUES('command','foldcar sweep l.json --store s.db --jobs 1');
INSERT INTO "study" VALUES('created_utc','2026-11-22T07:31:18+00:00');
CREATE TABLE trial (
        id INTEGER PRIMARY KEY, experiment TEXT NOT NULL, vehicle_type TEXT NOT NULL, design TEXT NOT NULL,
        body_id INTEGER REFERENCES body, settings_id INTEGER REFERENCES settings,
        environment_id INTEGER REFERENCES environment, sample INTEGER, scene_id INTEGER REFERENCES scene,
        deviations TEXT NOT NULL, outcome TEXT NOT NULL, ending TEXT NOT NULL, elapsed_time_s REAL,
        note TEXT NOT NULL, operator TEXT NOT NULL, started_utc TEXT, ended_utc TEXT,
        firmware_build TEXT, design_hash TEXT, port TEXT, log TEXT, log_sha256 TEXT, source TEXT);
INSERT INTO "trial" VALUES(1,'1','W_B_W','{"width_mm": 95.0, "height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}',1,1,2,0,5,'{"A":[0.005,-0.003,0.026179938779914945]}','tipped','goal',0.4,'','Ada','2026-11-22T07:32:17+00:00','2026-11-22T07:32:18+00:00','916e27491ae1ab42','4010afb037e72fbc','/dev/pts/0','s-logs/trial-0001-20261122T073217Z.tlog','d7bacdbc9dcf6f6d87bae9efdba4843a60850bd0ce3ae0ab959b2f4e5242827e',NULL);
INSERT INTO "trial" VALUES(2,'1','W_B_W','{"width_mm": 95.0, "height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}',1,1,2,1,4,'{}','aborted','goal',4.62500005960464477539e-01,'','','2026-11-22T07:33:01+00:00','2026-11-22T07:33:02+00:00','916e27491ae1ab42','4010afb037e72fbc','/dev/pts/0','s-logs/trial-0002-20261122T073301Z.tlog','d00804aab65e256c3529a0d97e121adeff42bc213972a9fe2505227b2e94b4b3',NULL);
INSERT INTO "trial" VALUES(3,'1','W_B_W','{"width_mm": 95.0, "height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}',NULL,NULL,NULL,NULL,NULL,'{}','passed','imported',NULL,'','',NULL,NULL,NULL,NULL,NULL,NULL,NULL,'a paper');
INSERT INTO "trial" VALUES(4,'1','W_B_W','{"width_mm": 95.0, "height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}',NULL,NULL,NULL,NULL,NULL,'{}','passed','imported',NULL,'','',NULL,NULL,NULL,NULL,NULL,NULL,NULL,'a paper');
INSERT INTO "trial" VALUES(5,'1','W_B_W','{"width_mm": 120.0, "height_mm": 50.0, "radius_mm": 60.0, "W_length_mm": 60.0, "W_tire_thickness_mm": 12.0, "B_length_mm": 80.0}',NULL,NULL,NULL,NULL,NULL,'{}','not_passed','imported',NULL,'','',NULL,NULL,NULL,NULL,NULL,NULL,NULL,'a paper');
CREATE TABLE variation (id INTEGER PRIMARY KEY, hash TEXT NOT NULL UNIQUE, json TEXT NOT NULL);
INSERT INTO "variation" VALUES(1,'44136fa355b3678a1146ad16f7e8649e94fb4fc21fe77e8310c060f61caaff8a','{}');
INSERT INTO "variation" VALUES(2,'722d5d3141f6c77d2e05ae6f025e5bbbf6bae88fe513cd95c624a6f1ef274022','{"belly_grip":-0.1021617509065689,"com_x_m":-0.002135486126520466,"com_y_m":0.004300028892907349,"com_z_m":0.001994961148468484,"deadband_us":[-15.121429747334677,-25.218079997470543,0.23302680552015453,3.812339762255066,10.495906737345702,6.40809192719985,-4.929401129652565,-9.144415775364301],"eccentricity_m":[0.00015793864925513172,0.000636393158851555,1.8171507940565157e-05,4.836793205219574e-05,0.0002389898309079845,0.00010372420182067582,0.0002584615994315751,0.0001106592741146999],"eccentricity_phase_rad":[2.36120284450367,1.3166807388433674,5.961162354002955,1.6578986467561847,2.7571932483290365,2.233253676496215,5.851354603661287,1.012671238339571],"mass":-0.002939003778436813,"neutral_us":[2.0179965277248764,14.97969881437416,-9.960989357125747,21.798958486152735,1.9226629781798361,-18.629467081700447,-4.985191214361253,-16.354141828825053],"servo_speed":[0.013013927429007397,0.10196135322546103,0.017306348480909343,0.023580561447134878,0.06224071697897107,0.0052995539377868476,0.04484500574499547,-0.02753623867409216],"servo_torque":[0.06002791270386154,0.043898823236223794,-0.0797279855076559,0.02634235860096031,-0.034565959084311836,-0.00022611936455545334,-0.08636212157395944,0.08115638653907413],"supply_v":0.3025677140102056,"tyre_grip":[-0.16410019370228354,-0.0224092103051538,0.006972278425321785,-0.049094191710360224,0.07663835623989222,-0.06646936354152076,-0.056089817207358346,-0.0905983653534789],"wheel_radius":[-0.011045785562563864,0.008140262653046054,-0.006684374333933596,-0.00264048644566021,-0.012966884681451754,-0.0020123106398167888,0.020938049876547318,0.004193671437197896]}');
INSERT INTO "variation" VALUES(3,'a6a630f6ced9b0a00cb9d354a71f2fe669989cba344cd12fdc94820663b6447e','{"belly_grip":0.15491633607926333,"com_x_m":0.003365903992989002,"com_y_m":-0.0034615449219638178,"com_z_m":-0.004191989800459353,"deadband_us":[9.083093703880417,11.66958746350653,6.313478685056767,-17.53934349679996,4.315056980879813,22.82723348456393,5.2769256464832885,2.049482452760162],"eccentricity_m":[0.0002575672650400041,4.136975980967457e-05,0.0008371502842818644,0.00020801175067014106,0.0007369832166623365,0.000478047421257719,0.00020215376384649796,0.00028357440861417064],"eccentricity_phase_rad":[0.4744503726170091,3.690517998368783,3.0246104448116227,0.8554067399401446,2.118466944570904,0.6478111009293593,0.6110795661238996,4.727023924957002],"mass":0.06870662933830574,"neutral_us":[-2.3272402340295755,6.564320753460243,-12.339074618926725,-5.517813697427625,-5.090531364128564,-8.585191883419315,-18.033751138505327,-10.036057798616781],"servo_speed":[-0.08916677852027116,-0.014426511819400873,0.01154404385962993,-0.12724705121080318,0.02309619734191834,-0.04906098954684837,-0.05209311206924409,0.08198643554499438],"servo_torque":[-0.007450194196999831,-0.019545720500394603,0.052864016334321785,-0.01697918932893813,0.01344450516430466,-0.0267216482960703,-0.0517069260261698,-0.015603978762655697],"supply_v":0.05006234877774673,"tyre_grip":[-0.017314507812800858,0.07463633878561428,0.1141296836624839,-0.15434379297922046,0.11455433079493889,0.028534240633961032,-0.026457499058680573,0.1080103394660742],"wheel_radius":[-0.001600909534662745,0.005469419899122159,-0.02196642396356621,-0.014398450200485238,0.012946310972110646,-0.0034618962353533027,0.003716619606696784,0.0017341653959059744]}');
CREATE VIEW result AS
        SELECT e.position AS experiment_position, e.id AS experiment, e.vehicle, e.environment,
            d.position AS design_position, d.parameters, s.sample, r.outcome, r.elapsed_time_s,
            r.distance_to_target_m, r.consumed_energy_j, r.max_roll_rad, r.max_pitch_rad, r.message,
            (SELECT json_group_object(v.name, json_object('kind', v.kind, 'value', json(v.value)))
                FROM recorded v
                WHERE v.build_id = r.build_id AND v.body_id = r.body_id AND v.scene_id = r.scene_id
                    AND v.settings_id = r.settings_id AND v.variation_id = r.variation_id) AS recorded,
            r.build_id, r.body_id, r.scene_id, r.settings_id, r.variation_id
        FROM experiment e CROSS JOIN design d CROSS JOIN sample s CROSS JOIN draw w CROSS JOIN run r
        WHERE d.experiment = e.id AND s.environment_id = e.environment_id AND s.sample < e.environments
            AND w.spread_id = e.spread_id AND w.sample = s.sample
            AND r.build_id = e.build_id AND r.body_id = d.body_id AND r.scene_id = s.scene_id
            AND r.settings_id = d.settings_id AND r.variation_id = w.variation_id;
COMMIT;
