"""What a car is cut from: faces, creases and joins of film, flat and folded."""
