"""Cars and scenes in the file formats of other simulators: MJCF, URDF, Webots."""
