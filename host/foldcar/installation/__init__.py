"""What foldcar needs of this machine, and whether it is there."""
