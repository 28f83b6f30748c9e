"""What built cars will do: realities, simulated, learned from, and weighed by trials."""
