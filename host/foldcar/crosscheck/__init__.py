"""The second engine: cars and scenes in MuJoCo, driven by the firmware's pulses, compared with carsim."""
