"""Cars and scenes in the file formats of other simulators: MJCF (MuJoCo), URDF (ROS), Webots."""
