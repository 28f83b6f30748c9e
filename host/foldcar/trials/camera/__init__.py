"""A camera beside a trial: markers, where they stand in pictures, where the car was."""
